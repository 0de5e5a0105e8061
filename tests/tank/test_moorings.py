import numpy as np
import pytest
from near import assert_near

from seakeep.tank.dynamics import tensions

pytest.importorskip("numba")

from seakeep.tank._loop import line_tension


def test_unstretched_lengths_of_the_page(rig):
    assert_near(rig.lines[:, 5], [2.368, 2.673], 0.0005)  # three decimals are stated


def test_level_lines_are_springs_that_only_pull_and_damp_while_they_do(rig):
    position, velocity = np.zeros((2, 5, 61))
    position[0] = offsets = np.linspace(-1.0, 2.0, 61)
    pulls = np.stack([1.1 + 1.89 * offsets, 1.1 - 1.33 * offsets])
    for speed in (0.0, 1.0, -10.0):
        velocity[0] = speed
        damped = np.maximum(0.0, pulls + 0.15 * speed * np.array([[1], [-1]]))
        assert_near(tensions(rig, position, velocity), (pulls > 0) * damped, 1e-12)


def test_a_line_damps_the_rate_of_its_length(rig):
    position, velocity = np.random.default_rng(0).normal(0.0, 0.1, (2, 5, 1))
    slack = [tensions(rig, position + step * velocity, 0 * velocity) for step in (-1e-5, 0, 1e-5)]
    rate = (slack[2] - slack[0]) / 2e-5 / rig.lines[:, [4]]
    damped = tensions(rig, position, velocity) - slack[1]
    # Central differences of step 1e-5: rounding of 1e-10.
    assert_near(damped, rig.lines[:, [6]] * rate, 1e-8)


def test_stiffness_is_the_slope_of_the_forces(rig):
    def force(q):
        return np.sum([line_tension(line, q, np.zeros(3))[1:] for line in rig.lines], axis=0)

    step = 1e-6
    slopes = [(force(step * e) - force(-step * e)) / (2 * step) for e in np.eye(3)]
    # Central differences of step 1e-6: rounding of 1e-10.
    assert_near(rig.mooring_stiffness[:3, :3], -np.array(slopes).T, 1e-8)
