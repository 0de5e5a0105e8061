"""Subspace identification of known systems, without noise and with it."""

import numpy as np
import pytest
from near import assert_near
from numpy.random import default_rng
from records import rms

from seakeep.core.embedding import TrainingWindow
from seakeep.core.subspace import identify_subspace


def plant(seed=0, inputs=2):
    """A damped system with eigenvalues of radius 0.7 to 0.95."""
    rng = default_rng(seed)
    blocks = np.zeros((4, 4))
    for at in (0, 2):
        radius, angle = rng.uniform(0.7, 0.95), rng.uniform(0.2, 1.5)
        c, s = radius * np.cos(angle), radius * np.sin(angle)
        blocks[at : at + 2, at : at + 2] = [[c, -s], [s, c]]
    return blocks, rng.normal(size=(4, inputs)), rng.normal(size=(2, 4))


def simulate(system, u, noise=0.0):
    """y_{j+1} = C z_{j+1}, so that an input acts on the next sample."""
    a, b, c = system
    z = np.zeros(len(a))
    out = np.empty((len(u), len(c)))
    for j, row in enumerate(u):
        out[j] = c @ z
        z = a @ z + b @ row
    return out + noise * default_rng(1).normal(size=out.shape)


def fitted(outputs, inputs, ridge=0.0, direct=None):
    direct = [each[:, :0] for each in inputs] if direct is None else direct
    windows = [TrainingWindow(12, len(y) - 1, 12) for y in outputs]
    lengths = {"order": 4, "output_delays": 12, "input_delays": 12, "future": 8}
    return identify_subspace(outputs, inputs, direct, windows, ridge=ridge, **lengths)


def modes(a):
    return np.sort_complex(np.linalg.eigvals(a))


@pytest.mark.parametrize("inputs", [1, 3])
def test_a_known_system_is_recovered_and_forecast_to_rounding(inputs):
    # Of two runs, each from rest: pairs across their joint would not fit the system.
    system = plant(inputs=inputs)
    u = np.split(default_rng(2).normal(size=(1000, inputs)), [300, 500])
    y = [simulate(system, each) for each in u]
    found = fitted(y[:2], u[:2])
    assert_near(modes(found.A), modes(system[0]), 1e-8)
    starts = [50, 200]
    outputs = np.stack([y[2][k - 12 : k + 1] for k in starts])
    driving = np.stack([u[2][k - 12 : k + 100] for k in starts])
    forecast = found.free_runs(outputs, driving, np.empty((2, 100, 0)))
    assert_near(forecast, [y[2][k + 1 : k + 101] for k in starts], 1e-7)


def test_a_mode_that_grows_is_moved_onto_the_unit_circle_and_no_other():
    """By 1.5 % a sample: free runs grew by 3e6 in 1000 samples."""
    a, b, c = plant()
    values, vectors = np.linalg.eig(a)
    slowest = np.abs(values) == np.abs(values).max()
    grown = np.where(slowest, 1.015 * values / np.abs(values), values)
    a = ((vectors * grown) @ np.linalg.inv(vectors)).real
    u = default_rng(2).normal(size=(300, 2))
    found = modes(fitted([simulate((a, b, c), u)], [u]).A)
    # The slower modes are small beside one that has grown a hundredfold.
    assert_near(found, np.sort_complex(np.where(slowest, values / np.abs(values), values)), 1e-6)


def test_direct_inputs_drive_and_do_not_tell_the_past():
    a, b, c = plant(inputs=3)
    u = default_rng(9).normal(size=(500, 3))
    y = simulate((a, b, c), u)
    found = fitted([y[:400]], [u[:400, :2]], direct=[u[:400, 2:]])
    # Without the past of the third input the filter estimates the state, no more.
    run = found.free_runs(y[None, 408:421], u[None, 408:490, :2], u[None, 420:490, 2:])[0]
    late = y[451:491]
    assert rms(run[30:] - late) < 0.05 * late.std()


def test_an_input_that_tells_its_own_future_needs_a_ridge_and_forecasts_with_it():
    time = np.arange(2000)
    u = np.stack([np.sin(0.3 * time), np.cos(0.3 * time) + np.sin(0.5 * time)], axis=1)
    u += 1e-3 * default_rng(7).normal(size=u.shape)
    y = simulate(plant(seed=6), u, noise=1e-3)
    found = fitted([y[:1200]], [u[:1200]], ridge=1e-6)
    run = found.free_runs(y[None, 1488:1501], u[None, 1488:1800], np.empty((1, 300, 0)))[0]
    assert rms(run - y[1501:1801]) < 0.02 * y.std()
