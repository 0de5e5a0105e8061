"""Rotations, blended rates, and Froude's law."""

import numpy as np
import pytest
import xarray as xr
from near import assert_near
from numpy.testing import assert_allclose
from records import rms
from said import request_error

from seakeep.signals import complementary_filter, froude_factor, rotation_matrix, transfer_position
from seakeep.study import to_full_scale


def test_yaw_is_after_pitch_after_roll():
    """What is made of it: `tests/campaign/test_steps.py`."""
    angles = np.array([0.3, -0.4, 0.5])
    roll, pitch, yaw = rotation_matrix(np.diag(angles))
    assert_near(rotation_matrix([angles])[0], yaw @ pitch @ roll, 1e-15)


def test_blend_keeps_slow_motion_and_needs_no_drift_removal():
    t = np.arange(0, 270, 0.05)
    slow, fast, drift = 0.25 * np.sin(0.21 * t), 0.03 * np.sin(3.4 * t), 0.1 * t
    rng = np.random.default_rng(0)
    x = slow + fast + drift + 0.006 * rng.standard_normal(t.size)
    a = -(0.21**2) * slow - 3.4**2 * fast + 0.03 * rng.standard_normal(t.size) + 0.1
    rate = 0.25 * 0.21 * np.cos(0.21 * t) + 0.03 * 3.4 * np.cos(3.4 * t) + 0.1
    # White noise of 0.03 m/s² at 20 Hz, integrated above 0.15 Hz, is 0.0039 m/s.
    assert rms(complementary_filter(x, a, 0.05, 0.15) - rate) < 0.0045
    position = complementary_filter(x, a, 0.05, 0.15, times=2)
    assert (position - slow - fast - drift).std() < 0.5 * 0.006
    with request_error(r"the crossover must lie between 0 and 8 Hz"):
        complementary_filter(x, a, 0.05, 9.0)


@pytest.mark.parametrize(
    ("units", "power"),
    {"m": 1, "m/s": 0.5, "m/s^2": 0, "rad/s": -0.5, "N m": 4, "W": 3.5, "kg": 3}.items(),
)  # fmt: skip
def test_froude(units, power):
    assert_allclose(froude_factor(units, 50.0), 50.0**power, rtol=1e-12)


def test_words_and_density():
    assert froude_factor("N", 50.0, 1.025) == pytest.approx(1.025 * 125000)
    with request_error(r"the unit 'V' is not mechanical"):
        froude_factor("V", 50.0)
    with request_error(r"shape \(time, 3\).* angles: \(4,\)"):
        transfer_position(np.zeros((4, 3)), np.zeros(4), [0, 0, 1])


def test_full_scale_run():
    own = {"units": "m", "training_std": 0.05, "accuracy": 0.1, "lead_time": 2.0, "x_position": 1.0}
    facts = {"dt": 0.1, "train_span": (0.0, 0.2), "water_depth": 3.6, "run": "a",
             "probe_offset": 0.3, "celerity": 2.0}  # fmt: skip
    run = xr.Dataset(
        {"heave": ("time", [0.1, 0.2, 0.1], own)},
        {"time": ("time", [0.0, 0.1, 0.2], {"units": "s"})},
        facts | {"trained_height": [0.1, 8.0]},  # of mixed units
    )
    full = to_full_scale(run, 100.0)
    assert_allclose(full["time"], [0.0, 1.0, 2.0])
    assert_allclose(full["heave"], [10, 20, 10])
    assert full["heave"].attrs == {
        "units": "m", "training_std": 5.0, "accuracy": 10.0, "lead_time": 20.0, "x_position": 100.0,
    }  # fmt: skip
    assert run["heave"].attrs == own
    assert full.attrs == {
        "dt": 1.0, "train_span": (0.0, 2.0), "water_depth": 360.0, "run": "a",
        "probe_offset": 30.0, "celerity": 20.0, "scale_factor": 100.0, "scale": "full",
    }  # fmt: skip
    with request_error("at full scale already"):
        to_full_scale(full, 100.0)


def test_members_are_lost_at_instants_of_full_scale():
    forecast = xr.Dataset(
        {
            "heave": (("member", "time"), np.ones((2, 2)), {"units": "m"}),
            "status": ("member", ["ok", "diverged at t = 5.2 s"]),
        },
        {"time": ("time", [5.1, 5.2], {"units": "s"}), "diverged_at": ("member", [np.nan, 5.2])},
        {"members": 2, "diverged": 1, "outside_training": "a height of 1 m", "status": ""},
    )
    full = to_full_scale(forecast, 100.0)
    assert full["diverged_at"].values[1] == pytest.approx(52.0)
    assert full["status"].values.tolist() == ["ok", "diverged at t = 52 s"]
    assert full.attrs["outside_training"] == "at model scale: a height of 1 m"
