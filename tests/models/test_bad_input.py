"""Wrong data and wrong requests: each has its own message, and the message says the mend."""

from functools import partial

import numpy as np
import pytest
import xarray as xr
from said import data_error, request_error, warned

from seakeep import HankelDMDc

fit = partial(HankelDMDc(3, 8, 1.0).fit, states=["heave", "pitch"], inputs=["eta_fwd", "eta_cog"])


@pytest.fixture
def model(run):
    return fit(run)


def test_wrong_times_are_refused_in_training_and_in_forecasts(model, run):
    """Which times are wrong: `tests/signals/test_time_axis.py`."""
    bad = run.assign_coords(time=run.time + 0.35 * (run.time > 2.475))
    message = r"1 gap\(s\): after t = 2\.45 s, 7 sample\(s\) of 0\.05 s"
    with data_error(message):
        fit(bad)
    with data_error(message):
        model.forecast(bad, start=5.0, steps=5)


def test_times_that_state_another_unit_than_seconds_are_refused(model, run):
    run["time"].attrs["units"] = "ms"
    message = (
        r"channel 'time' of run is in 'ms' and the model expects 's'\. Convert the channel and"
    )
    with data_error(message):
        fit(run)
    with data_error(message):
        model.forecast(run.assign_attrs(run="run"), start=5.0, steps=5)
    for spelt in ("s", "sec", "seconds since 2024-05-03"):
        run["time"].attrs["units"] = spelt
        assert fit(run).dt == model.dt


def test_a_dimension_of_length_one_is_to_be_squeezed(model, run):
    case = run.expand_dims("case")
    with data_error(r"\('case', 'time'\) and shape \(1, 400\); .* Take run\.squeeze\(\)\."):
        fit(case)
    np.testing.assert_array_equal(fit(case.squeeze()).A, model.A)
    with data_error(r"shape \(2, 400\); .* Give each channel its own variable\."):
        fit(xr.concat([case, case], "case"))


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["heave", "eta_cog"])
def test_gaps_in_the_window_are_refused(run, name, value):
    run[name][250:253] = value
    message = rf"channel '{name}' of run has 3 missing or infinite value\(s\) .* t = 12\.5 s"
    with data_error(message + r".* gaps up to longest_gap are bridged where"):
        fit(run)


def test_gaps_in_what_a_forecast_reads_are_refused(model, run):
    run.heave[98] = np.nan
    with data_error(r"'heave' .* 1 missing .* the first at t = 4\.9 s"):
        model.forecast(run, start=5.0, steps=20)
    run.eta_fwd[150] = np.nan
    with data_error(r"'eta_fwd' .* the first at t = 7\.5 s"):
        model.forecast(run, start=6.0, steps=40)


@pytest.mark.parametrize(
    ("kind", "values"),
    {
        "<U3": np.full(400, "1.0"),
        "complex128": np.full(400, 1j),
        "timedelta64": np.arange(400).astype("timedelta64[ns]"),
    }.items(),
)
def test_a_channel_that_is_not_a_number_is_refused(run, values, kind):
    bad = run.assign(heave=("time", values))
    with data_error(f"'heave' of run is of type {kind}.*, not a real number"):
        fit(bad)


ARRAYS = {"x_history": (9, 2), "u_history": (9, 2), "u_future": (19, 2)}


@pytest.mark.parametrize(
    ("name", "shape", "message"),
    [
        ("x_history", (2, 9), r"\(2, 9\); .* 4 rows \(s \+ 1\) and 2 col.* looks transposed"),
        ("u_history", (2, 9), r"\(2, 9\); .* 9 rows \(z \+ 1\) and 2 col.* looks transposed"),
        ("u_future", (2, 19), r"\(2, 19\); .* 19 rows \(steps − 1\) .* looks transposed"),
        ("x_history", (3, 2), r"\(3, 2\); .*at least 4 rows"),
        ("u_history", (9, 3), r"\(9, 3\); .*and 2 columns"),
        ("x_history", (9,), r"\(9,\); expected \(time, channel\)"),
    ],
)
def test_arrays_of_another_shape_are_refused_and_never_turned(model, name, shape, message):
    arrays = {key: np.zeros(size) for key, size in (ARRAYS | {name: shape}).items()}
    with request_error(f"{name} has shape {message}"):
        model.forecast_arrays(**arrays, steps=20)


@pytest.mark.parametrize(
    ("settings", "samples", "missing"),
    [
        ({}, 9, "10 samples are needed .*, 9 were received, 1 are missing"),
        ({"window": 4}, 8, "10 samples are needed .*, 8 were received, 2 are missing"),
        (
            {"window": 7, "history": "inside"},
            100,
            "10 samples are needed .*, 7 were received, 3 are missing.* longer window",
        ),
        ({"window": 120}, 100, "has 100 samples up to .* asks for 120: 20 are missing"),
    ],
)
def test_a_run_that_is_too_short_is_told_how_many_samples_are_missing(
    run, channels, settings, samples, missing
):
    short = run.isel(time=slice(samples))
    with data_error(missing):
        HankelDMDc(3, 8, 1.0, **settings).fit(short, **channels)


def test_the_shortest_run_that_is_long_enough_trains(run):
    assert fit(run.isel(time=slice(10))).training.columns == (1,)


def test_runs_of_another_step_are_refused(model, run):
    coarse = run.isel(time=slice(None, None, 2))
    message = r"time step of 0\.1 s and the model one of 0\.05 s\. Resample"
    with data_error(message):
        fit([run, coarse])
    coarse.attrs["encounter_period"] = 2.5  # of 25 steps: with those of the model it is 1.25 s
    with data_error(rf"{message}.* encounter_period = 1\.25 in \[campaign\]"):
        model.forecast(coarse, start=5.0, steps=5)


@pytest.mark.parametrize("value", [0.0, 0.1, 1e5 / 3])
@pytest.mark.parametrize("name", ["pitch", "eta_fwd"])
def test_a_constant_channel_cannot_be_standardised(run, channels, name, value):
    run[name][:] = value
    with data_error(rf"channel '{name}' is constant \(.*\) over the training window"):
        fit(run)
    model = HankelDMDc(3, 8, 1.0, standardize=False).fit(run, **channels)
    assert np.all(np.isfinite(model.forecast(run, start=5.0, steps=20).heave))


def test_a_channel_constant_in_one_run_alone_is_told_and_standardised_over_all(make_run):
    slack = make_run(seed=1)
    slack.pitch[:] = 0.1
    with warned(r"channel 'pitch' of run 2 is constant \(0\.1\) .* If its sensor was dead, leave"):
        model = fit([make_run(), slack])
    assert np.all(model.state_std > 0)


def test_another_unit_than_trained_is_refused(model, run):
    degrees = run.copy()
    degrees["pitch"] = np.degrees(run.pitch).assign_attrs(units="deg")
    with data_error(r"channel 'pitch' of .* is in 'deg' and the model expects 'rad'\. Convert"):
        model.forecast(degrees, start=5.0, steps=5)


@pytest.mark.parametrize(
    ("message", "changes"),
    {
        "states names heave more than once": {"states": ["heave", "heave"]},
        "eta_fwd is both a state and an input": {"states": ["heave", "eta_fwd"]},
        r"states must be a list .* the string 'heave'\. Write states=": {"states": "heave"},
        "states is empty: name at least one channel": {"states": []},
        r"states must be a list of channel names; received \[0\]": {"states": [0]},
        r"no channel 'heeve'\. Did you mean 'heave'\? It has: heave": {"states": ["heeve"]},
        r"inputs must be a list .* received None\. .* takes inputs=\[\]": {"inputs": None},
        r"stop = 25 s is outside run, which runs from 0 to 19\.95 s": {"stop": 25.0},
        r"stop = nan s is outside run": {"stop": np.nan},
        "stop has 2 instants for 1 runs": {"stop": [5.0, 6.0]},
        "stop must be an instant in seconds; received True for run": {"stop": [True]},
        "stop must be an instant in seconds; received '5' for run": {"stop": {"run": "5"}},
        "stop names the run 'rum', which is not .*Did you mean 'run'": {"stop": {"rum": 5.0}},
        "no run was given": {"runs": []},
        r"is a ndarray; a run is an xarray\.Dataset": {"runs": np.zeros((3, 4))},
        "has no coordinate 'time' .*sample": {"runs": xr.Dataset({"heave": ("sample", [0.0])})},
    }.items(),
)
def test_what_fit_refuses(run, changes, message):
    with request_error(message):
        fit(**{"runs": run, **changes})


@pytest.mark.parametrize(
    ("start", "steps", "message"),
    [
        (0.25, 5, r"6 samples of history .* needs 9 .*: 3 are missing\. Start at 0\.4 s"),
        (-1.0, 5, "start = .* s is outside the run, which runs from 0 to"),
        ("a", 5, "start must be an instant in seconds; received 'a'"),
        (10.0, 201, r"201 steps from 10 s need the input up to 20 s .* 19\.95 s\. At most 200"),
        (5.0, 0, "steps must be an integer of at least 1; received"),
        ([5.0, 6.0], None, r"steps is None, .* from each of the 2 starts\. Give the number"),
        ([], 5, "starts is empty"),
        ({5.0}, 5, r"starts must be a list of instants; received \{5\.0\}"),
    ],
)
def test_what_a_forecast_refuses(model, run, start, steps, message):
    forecast = model.forecast if np.isscalar(start) else model.forecast_windows
    with request_error(message):
        forecast(run, start, steps)
    assert model.forecast(run, start=0.4, steps=5).sizes["time"] == 5


def test_a_run_shorter_than_the_history_has_no_later_start(model, run):
    with request_error(r"needs 9 .*The run ends at 0\.35 s: give a longer one"):
        model.forecast(run.isel(time=slice(8)), 0.25, 1)


@pytest.mark.parametrize(
    ("message", "settings"),
    {
        "state_delays must be an integer of at least 0; received -1": {"state_delays": -1},
        "input_delays must be an integer .* received True": {"input_delays": True},
        "window must be an integer of at least 2; received 1": {"window": 1},
        "rank must be an integer of at least 1": {"rank": 0, "ridge": 0},
        r"ridge must be a number, zero or positive, or .*; received -1\.0": {"ridge": -1.0},
        "ridge must be a number, .* or the word rollout; received nan": {"ridge": np.nan},
        "ridge must be a number, .* or the word rollout; received '100'": {"ridge": "100"},
        "history must be 'before' or 'inside'; received 'outside'": {"history": "outside"},
        "delay_rows must be 'ridge' or 'exact'; received 'shift'": {"delay_rows": "shift"},
        "ridge_scale must be 'absolute' or 'per_snapshot'; received 'x'": {"ridge_scale": "x"},
        "standardize must be True or False; received 'no'": {"standardize": "no"},
        "alignment must be a seakeep.ProbeAlignment or None; received 'none": {"alignment": "none"},
    }.items(),
)
def test_wrong_settings_are_refused(settings, message):
    with request_error(message):
        HankelDMDc(**{"state_delays": 3, "input_delays": 8, "ridge": 1.0, **settings})


def test_a_period_and_a_step_that_were_swapped_are_told():
    for make in (HankelDMDc.paper, HankelDMDc.recommended):
        with request_error(r"dt = 9 s is no shorter than .* 0\.1 s\. Are the tw"):
            make(0.1, 9.0)
