"""The error in regular waves is taken apart into what it was made of."""

import numpy as np
import pytest
import xarray as xr
from cells import cells
from near import assert_near

from seakeep.study.judge import is_regular, regular_response

DT, FREQUENCY = 0.05, 0.86
TIME = DT * np.arange(1, 161)
TURN = 2 * np.pi * FREQUENCY * TIME + np.array([0.0, 1.0, 2.0])[:, None]


def groups():
    """Two training sets, three windows, of one channel named surge."""
    measured = 0.9 + 0.1 * np.cos(TURN)
    forecast = 0.9 + 0.3 + 0.08 * np.cos(TURN + np.radians(40.0))
    test = cells(
        ["surge"], TIME, measured=measured[..., None], judged=np.ones((2, 3), bool),
        run=["wave"] * 3, mean=np.tile(forecast[..., None], (1, 2, 1, 1, 1)),
        error=np.ones((1, 3, 2, 3, 1)),
    )  # fmt: skip
    runs = xr.Dataset({"wave_frequency": ("run", [FREQUENCY, np.nan])}, {"run": ["wave", "sea"]})
    return {"tests/t": test, "runs": runs}


def parts_of(made):
    return regular_response(made, "t").sel(model="m", channel="surge")


def test_the_parts_are_what_the_forecast_was_made_of():
    found = parts_of(groups())
    # The record is not a whole number of periods, so that its own SD differs from 0.1/√2.
    own = groups()["tests/t"]["measured"].std("time", ddof=1).values[:, 0]
    # The offset and the wave are not quite orthogonal over 6.9 periods: 1 % of the offset.
    assert found["error_offset"] == pytest.approx(np.sqrt(np.mean((0.3 / own) ** 2)), rel=0.01)
    assert found["amplitude_ratio"] == pytest.approx(0.8, rel=1e-9)
    assert_near(found["phase_lead"], 40.0, 1e-6)
    assert found["error_rest"] < 1e-6


def test_the_phase_is_the_circular_mean_over_cells():
    made = groups()
    leads = np.radians([170.0, -160.0, -160.0])[:, None]  # the last of them past half a turn
    made["tests/t"]["mean"][:] = np.cos(TURN + leads)[..., None]
    found = parts_of(made)["phase_lead"]
    assert_near(found, np.degrees(np.angle(np.exp(1j * leads).mean())), 1e-6)
    assert found.attrs["units"] == "deg"


def test_the_squares_add_up_to_that_of_the_error():
    made = groups()
    rng = np.random.default_rng(0)
    made["tests/t"]["mean"] += 0.05 * rng.standard_normal(made["tests/t"]["mean"].shape)
    found, test = parts_of(made), made["tests/t"]
    error = ((test["mean"] - test["measured"]) ** 2).mean("time")
    expected = float((error / test["measured"].var("time", ddof=1)).mean())
    squares = sum(float(found[f"error_{key}"]) ** 2 for key in ("offset", "wave", "rest"))
    assert squares == pytest.approx(expected, rel=1e-12)


def test_a_set_in_an_irregular_sea_is_not_taken_apart():
    made = groups()
    assert is_regular(made, "t")
    made["tests/t"]["run"] = ("window", np.array(["wave", "sea", "wave"], dtype=object))
    assert not is_regular(made, "t")
