"""What a forecast reads, when it starts, and what it says."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from xarray.testing import assert_equal, assert_identical

from seakeep import HankelDMDc

DT = 0.05


@pytest.fixture
def model(make_run, channels):
    return HankelDMDc(3, 8, 1.0).fit(make_run(), **channels)


@pytest.fixture
def test_run(make_run):
    return make_run(samples=300, seed=5)


@pytest.mark.parametrize(("s", "z"), [(3, 8), (8, 3)])
def test_nothing_before_the_delays_of_each_group_is_read(make_run, channels, test_run, s, z):
    model = HankelDMDc(s, z, 1.0).fit(make_run(), **channels)
    expected = model.forecast(test_run, start=5.0, steps=50)
    read = test_run.copy(deep=True)
    read.heave[: 100 - s] = np.nan
    read.eta_fwd[: 100 - z] = np.nan
    assert_identical(model.forecast(read, start=5.0, steps=50), expected)


@pytest.mark.parametrize("offset", [-0.4, 0.0, 0.4])
def test_the_start_is_the_nearest_sample_and_the_result_says_which(model, test_run, offset):
    expected = model.forecast(test_run, start=5.0, steps=10)
    snapped = model.forecast(test_run, start=test_run.time[100] + offset * DT, steps=10)
    assert_identical(snapped, expected)
    assert snapped.attrs["start"] == test_run.time[100]
    assert snapped.time[0] == test_run.time[101]


def test_channels_time_and_units_are_kept(model, test_run):
    forecast = model.forecast(test_run.assign_attrs(run="3041_2"), start=5.0, steps=10)
    assert (forecast.heave.attrs["units"], forecast.pitch.attrs["units"]) == ("m", "rad")
    assert forecast.heave.attrs["training_std"] == model.state_std[0]
    assert forecast.time.attrs == {"units": "s", "long_name": "time"}
    assert (forecast.attrs["run"], forecast.attrs["status"]) == ("3041_2", "ok")


def test_a_forecast_goes_to_the_end_of_the_run_and_one_step_past_it(model, test_run):
    within = model.forecast(test_run, start=5.0)
    assert_array_equal(within.time, test_run.time[101:])
    past = model.forecast(test_run, start=5.0, steps=200)  # its inputs are there
    assert_equal(past.isel(time=slice(199)), within)
    assert_allclose(float(past.time[-1]), 300 * DT)
    assert np.isfinite(past.heave[-1])
    last = model.forecast(test_run, start=float(test_run.time[-1]), steps=1)
    assert_allclose(float(last.time[0]), 300 * DT)
