import numpy as np
import pytest

from seakeep.tank.dynamics import tensions

pytest.importorskip("numba")

from seakeep.tank._loop import line_tension


def test_unstretched_lengths_of_the_page(rig):
    assert rig.lines[:, 5] == pytest.approx([2.368, 2.673], abs=0.0005)  # three decimals are stated


def test_level_lines_are_springs_that_only_pull(rig):
    position = np.zeros((5, 61))
    position[0] = offsets = np.linspace(-1.0, 2.0, 61)
    bow, stern = tensions(rig, position, 0 * position)
    assert bow == pytest.approx(np.maximum(0.0, 1.1 + 1.89 * offsets), abs=1e-12)
    assert stern == pytest.approx(np.maximum(0.0, 1.1 - 1.33 * offsets), abs=1e-12)


def test_a_line_damps_only_while_it_pulls(rig):
    position, velocity = np.zeros((5, 3)), np.zeros((5, 3))
    velocity[0] = [1.0, -1.0, -10.0]
    bow = tensions(rig, position, velocity)[0]
    assert bow == pytest.approx([1.25, 0.95, 0.0], abs=1e-12)


def test_a_line_damps_the_rate_of_its_length(rig):
    position, velocity = np.random.default_rng(0).normal(0.0, 0.1, (2, 5, 1))
    slack = [tensions(rig, position + step * velocity, 0 * velocity) for step in (-1e-5, 0, 1e-5)]
    rate = (slack[2] - slack[0]) / 2e-5 / rig.lines[:, [4]]
    damped = tensions(rig, position, velocity) - slack[1]
    # Central differences of step 1e-5: rounding of 1e-10.
    assert damped == pytest.approx(rig.lines[:, [6]] * rate, abs=1e-8)


def test_stiffness_is_the_slope_of_the_forces(rig):
    def force(q):
        return np.sum([line_tension(line, *q, np.zeros(3))[1:] for line in rig.lines], axis=0)

    step = 1e-6
    slopes = [(force(step * e) - force(-step * e)) / (2 * step) for e in np.eye(3)]
    # Central differences of step 1e-6: rounding of 1e-10.
    assert rig.mooring_stiffness[:3, :3] == pytest.approx(-np.array(slopes).T, abs=1e-8)
    assert rig.mooring_stiffness[0, 0] == pytest.approx(1.89 + 1.33, rel=1e-9)


@pytest.mark.oracle
def test_tension_is_that_of_a_catenary_solver(rig):
    catenary = pytest.importorskip("moorpy.Catenary").catenary
    unstretched, stiffness = rig.lines[0, 5], rig.lines[0, 4]
    for offset in (-0.2, 0.0, 0.5, 1.4):
        reach = 2.95 + offset
        # A line of 1 mg/m: its sag is far below a millimetre, the solver needs some weight.
        weight = 1e-5
        ends = catenary(reach, 0.0, unstretched, stiffness * unstretched, weight, CB=0.0)[0:4]
        position = np.zeros((5, 1))
        position[0] = offset
        ours = tensions(rig, position, 0 * position)[0, 0]
        assert ours == pytest.approx(np.hypot(*ends[2:4]), rel=1e-3)
