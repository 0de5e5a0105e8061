"""Points of a rigid body, accelerometers on it, blended rates, and Froude's law."""

import numpy as np
import pytest
import xarray as xr

from seakeep.errors import RequestError
from seakeep.signals import (
    complementary_filter,
    differentiate,
    froude_factor,
    remove_gravity,
    rotation_matrix,
    transfer_acceleration,
    transfer_position,
    transfer_velocity,
)
from seakeep.study import to_full_scale

DT = 0.005
T = DT * np.arange(4000)


@pytest.fixture
def body():
    """Position and angles of a body in space, large enough for second-order terms to show."""
    rng = np.random.default_rng(0)
    phase = rng.uniform(0, 6.28, 6)
    amplitude = [0.3, 0.1, 0.2, 0.2, 0.3, 0.25]
    every = [amplitude[i] * np.sin((2 + 0.3 * i) * T + phase[i]) for i in range(6)]
    return np.column_stack(every[:3]), np.column_stack(every[3:])


def body_rates(angles):
    """Angular velocity in the body's axes from the rotation itself: R' = R [ω]×."""
    R = rotation_matrix(angles)
    turn = np.einsum("tji,tjk->tik", R, differentiate(R, DT))
    return np.column_stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]])


def test_a_body_yaws_then_pitches_then_rolls():
    def about(axis, angle):
        turned = np.eye(3)
        i, j = (axis + 1) % 3, (axis + 2) % 3
        turned[[i, j], [i, j]] = np.cos(angle)
        turned[[j, i], [i, j]] = np.sin(angle), -np.sin(angle)
        return turned

    roll, pitch, yaw = 0.3, -0.2, 0.5
    expected = about(2, yaw) @ about(1, pitch) @ about(0, roll)
    np.testing.assert_allclose(rotation_matrix([[roll, pitch, yaw]])[0], expected, atol=1e-15)


def test_positions_differentiate_to_velocities_and_accelerations(body):
    position, angles = body
    r = [0.5, -0.2, 0.3]
    moved = transfer_position(position, angles, r)
    np.testing.assert_array_equal(transfer_position([[0.0] * 3], [[0.0] * 3], r), [[0.0] * 3])
    rates = body_rates(angles)
    velocity = transfer_velocity(differentiate(position, DT), angles, rates, r)
    inner = slice(20, -20)
    # Fourth-order differences of waves of 3 rad/s at 5 ms: dt⁴ω⁵/30 is 1e-9.
    np.testing.assert_allclose(velocity[inner], differentiate(moved, DT)[inner], atol=1e-6)
    acceleration = transfer_acceleration(
        differentiate(differentiate(position, DT), DT), angles, rates, differentiate(rates, DT), r
    )
    expected = differentiate(differentiate(moved, DT), DT)
    np.testing.assert_allclose(acceleration[inner], expected[inner], atol=1e-5)


@pytest.mark.parametrize("zeroed", [False, True])
def test_gravity_is_removed(body, zeroed):
    position, angles = body
    acceleration = differentiate(differentiate(position, DT), DT)
    up = np.array([0, 0, 9.81])
    felt = np.einsum("tji,tj->ti", rotation_matrix(angles), acceleration + up)
    found = remove_gravity(felt - (up if zeroed else 0), angles, zeroed=zeroed)
    np.testing.assert_allclose(found, acceleration, atol=1e-12)


def test_blend_keeps_slow_motion_and_needs_no_drift_removal():
    t = np.arange(0, 270, 0.05)
    slow, fast = 0.25 * np.sin(0.21 * t), 0.03 * np.sin(3.4 * t)
    rng = np.random.default_rng(0)
    x = slow + fast + 0.006 * rng.standard_normal(t.size)
    a = -(0.21**2) * slow - 3.4**2 * fast + 0.03 * rng.standard_normal(t.size) + 0.1
    rate = 0.25 * 0.21 * np.cos(0.21 * t) + 0.03 * 3.4 * np.cos(3.4 * t)
    error = complementary_filter(x, a, 0.05, 0.15) - rate
    # White noise of 0.03 m/s² at 20 Hz, integrated above 0.15 Hz, is 0.0039 m/s.
    assert error.std() < 0.0045
    position = complementary_filter(x, a, 0.05, 0.15, times=2)
    assert (position - slow - fast).std() < 0.5 * 0.006
    with pytest.raises(RequestError, match=r"the crossover must lie between 0 and 8 Hz"):
        complementary_filter(x, a, 0.05, 9.0)


@pytest.mark.parametrize(
    ("units", "power"),
    [("m", 1), ("m/s", 0.5), ("m/s^2", 0), ("rad/s", -0.5), ("N m", 4), ("W", 3.5), ("kg", 3)],
)  # fmt: skip
def test_froude(units, power):
    assert froude_factor(units, 50.0) == pytest.approx(50.0**power, rel=1e-12)


def test_words_and_density(body):
    assert froude_factor("N", 50.0, 1.025) == pytest.approx(1.025 * 125000)
    with pytest.raises(RequestError, match=r"the unit 'V' is not mechanical"):
        froude_factor("V", 50.0)
    with pytest.raises(RequestError, match=r"shape \(time, 3\).* angles: \(4000,\)"):
        transfer_position(body[0], T, [0, 0, 1])


def test_full_scale_run():
    run = xr.Dataset(
        {"heave": ("time", [0.1, 0.2, 0.1], {"units": "m", "training_std": 0.05})},
        {"time": ("time", [0.0, 0.1, 0.2], {"units": "s"})},
        {"dt": 0.1, "train_span": (0.0, 0.2), "water_depth": 3.6, "run": "a", "probe_offset": 0.3},
    )
    full = to_full_scale(run, 100.0)
    np.testing.assert_allclose(full["time"], [0.0, 1.0, 2.0])
    np.testing.assert_allclose(full["heave"], [10, 20, 10])
    assert full["heave"].attrs["training_std"] == 5.0
    assert (full.attrs["dt"], full.attrs["train_span"]) == (1.0, (0.0, 2.0))
    assert full.attrs["probe_offset"] == 30.0
    assert (full.attrs["water_depth"], full.attrs["scale_factor"]) == (360.0, 100.0)
    with pytest.raises(RequestError, match="at full scale already"):
        to_full_scale(full, 100.0)
