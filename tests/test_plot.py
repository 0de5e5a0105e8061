"""Figures of labelled results: what they draw, and on which Axes."""

import numpy as np
import pytest
from ensembles import few
from moored import moored_run
from near import assert_near
from said import request_error

from seakeep import HankelDMDc, check, plot

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

STATES, WHEN = ["surge", "heave", "pitch"], {"start": 10.0, "steps": 50}


@pytest.fixture(scope="module")
def run():
    return moored_run(2)


@pytest.fixture(scope="module")
def model(run):
    return HankelDMDc(2, 4, 0.01, delay_rows="exact").fit(run, STATES, ["eta"])


def test_overlay_draws_each_channel_with_units_on_its_axes(run, model):
    forecast = model.forecast(run, **WHEN)
    figure = plot.overlay(forecast, run)
    assert len(figure.axes) == 3
    assert "[deg]" in figure.axes[2].get_ylabel()
    lines = {line.get_label(): line for line in figure.axes[1].get_lines()}
    np.testing.assert_array_equal(lines["forecast"].get_ydata(), forecast.heave.values)
    given = Figure().subplots()
    assert plot.overlay(forecast[["heave"]], run, axes=given) is given.figure
    assert len(given.get_lines()) == 2
    with request_error(r"axes holds 1 Axes and the figure draws 3 panels"):
        plot.overlay(forecast, run, axes=given)


def test_a_measurement_is_drawn_at_its_own_instants_as_far_as_it_goes(run, model):
    forecast = model.forecast(run, **WHEN)
    other = run.interp(time=np.arange(9.93, 16.0, 0.03))
    for last, measured in {11.9: run.sel(time=slice(11.95)), 14.99: other}.items():
        drawn, _ = plot.overlay(forecast, measured).axes[0].get_lines()
        at = measured.sel(time=slice(10.1 - 1e-6, 15.0 + 1e-6))
        np.testing.assert_array_equal(drawn.get_data(), [at.time, at.surge])
        assert_near(drawn.get_xdata()[-1], last, 0.02)
    with request_error(r"forecast is a DataArray; a run is an xarray\.Dataset"):
        plot.overlay(forecast.heave, run)


def test_modes_are_drawn_of_the_check_that_knows_their_states(model):
    assert len(plot.modes(check.modes(model)).axes) == 2
    with request_error(r"Draw that of seakeep\.check\.modes\(model\)"):
        plot.modes(model.modes())


def test_band_takes_members_or_their_statistics(run, model):
    ensemble = few().fit(run, ["heave"], ["eta"])
    members = ensemble.forecast(run, **WHEN)
    for forecast in (members, ensemble.forecast_summary(run, **WHEN)):
        assert len(plot.band(forecast, run).axes[0].collections) == 1
    with request_error(r"Channels: none\. .*with seakeep\.plot\.band"):
        plot.overlay(members, run)
    with request_error(r"measured has no coordinate 'time'"):
        plot.band(members, run.drop_vars("time"))
    with request_error(r"it has no band\. Draw it with seakeep\.plot\.overlay"):
        plot.band(model.forecast(run, **WHEN), run)
