"""Alignment of the wave input in fit and forecast: a vessel that drifts, probes that are moved."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from drifting import DEPTH, INPUTS, POSITIONS, STATES, drifting_run

from seakeep import (
    BayesianHankelDMDc,
    DataError,
    Fixed,
    HankelDMDc,
    ProbeAlignment,
    Uniform,
    estimate_probe_offset,
)


def spec(alignment):
    return HankelDMDc(10, 40, 1e-3, delay_rows="exact", alignment=alignment)


def heave_error(model, run, start=60.0, steps=300):
    forecast = model.forecast(run, start=start, steps=steps)
    measured = run["heave"].sel(time=forecast["time"])
    return float(np.sqrt(np.mean((forecast["heave"] - measured) ** 2)) / measured.std())


@pytest.fixture(scope="module")
def runs():
    return [drifting_run(seed, name=f"run {seed}") for seed in (1, 2)]


@pytest.fixture(scope="module")
def models(runs):
    settings = {
        "none": None,
        "rest": ProbeAlignment(mode="dispersion", surge="none"),
        "dispersion": ProbeAlignment(mode="dispersion", surge="measured"),
        "effective": ProbeAlignment(mode="effective", surge="measured"),
        "predicted": ProbeAlignment(mode="dispersion", surge="predicted"),
    }
    return {key: spec(each).fit(runs, STATES, INPUTS) for key, each in settings.items()}


def test_alignment_makes_one_linear_model_hold_wherever_the_vessel_is(models):
    run = drifting_run(7)
    errors = {key: heave_error(model, run) for key, model in models.items()}
    # Heave is linear in the elevation at the vessel: dispersion leaves the noise and the ridge.
    assert errors["dispersion"] < 0.06
    assert errors["predicted"] < 0.12  # and what the forecast of surge is off
    assert errors["effective"] < 0.5 * errors["none"]
    assert errors["none"] > 0.4
    # With no surge and no offset the elevation stays where it is, to a transform's rounding.
    assert errors["rest"] == pytest.approx(errors["none"], rel=1e-6)


def test_a_shorter_forecast_is_the_start_of_a_longer_one(models):
    run = drifting_run(7)
    # Where the surge is measured, the shorter one reads no wave beyond its end and continues the
    # record by prediction: 3 % of the heave there. A recursion reads the same.
    for key, part in (("dispersion", 0.03), ("predicted", 1e-12)):
        long = models[key].forecast(run, start=60.0, steps=200)
        short = models[key].forecast(run, start=60.0, steps=50)
        sd = float(long["heave"].std())
        np.testing.assert_allclose(short["heave"], long["heave"][:50], atol=part * sd)


def test_arrays_take_what_the_model_aligned(models):
    run = drifting_run(7)
    model = models["effective"]
    forecast = model.forecast(run, start=60.0, steps=100)
    u = model.aligned_inputs(run)
    u = np.column_stack([u[name] for name in model.inputs])
    x = np.column_stack([run[name] for name in model.states])
    arrays = model.forecast_arrays(x[:601], u[:601], u[601:], 100)
    np.testing.assert_allclose(arrays[:, 1], forecast["heave"], atol=1e-7)
    system, state = model.to_state_space(), model.initial_state(run, 60.0)
    state = system.A @ state + system.B @ (u[600] - model.input_mean)
    first = system.C @ state + model.state_mean
    np.testing.assert_allclose(first, arrays[0], atol=1e-7)


def test_fit_estimates_and_keeps_what_the_alignment_needs(models):
    fitted = models["effective"].alignment
    assert fitted.positions == (48.42, 52.09)
    assert fitted.carried == (True, True)
    # Phase speeds of 0.3 to 0.9 Hz run from 4.4 to 1.7 m/s, 3.0 at the peak.
    assert 2.3 < fitted.celerity < 3.3
    assert models["dispersion"].alignment.water_depth == DEPTH
    assert 0.5 < models["dispersion"].alignment.highest_frequency < 1.0


def test_each_run_is_carried_at_its_own_celerity_unless_one_is_asked_for(runs):
    own = [run.assign_attrs(celerity=c) for run, c in zip(runs, (2.5, 3.0), strict=True)]
    slow = drifting_run(7).assign_attrs(celerity=2.0)
    model = spec(ProbeAlignment(mode="effective")).fit(own, STATES, INPUTS)
    common = spec(ProbeAlignment(mode="effective", celerity="common")).fit(own, STATES, INPUTS)
    # The mean slowness of the training runs is that of no run.
    mean = 2 / (1 / 2.5 + 1 / 3.0)
    for found, expected in ((model, 2.0), (common, mean)):
        assert found.alignment.celerity == pytest.approx(mean)
        assert found.alignment.celerity_of(slow) == pytest.approx(expected)
        attrs = found.forecast(slow, start=60.0, steps=10).attrs
        assert attrs["alignment_celerity"] == pytest.approx(expected)
    stated = spec(ProbeAlignment(mode="effective", celerity=2.0)).fit(own, STATES, INPUTS)
    xr.testing.assert_allclose(model.aligned_inputs(slow), stated.aligned_inputs(slow))
    assert model.alignment.celerity_of(drifting_run(8)) == pytest.approx(mean)


def test_an_ensemble_and_a_single_model_take_the_celerity_from_the_same_span(runs):
    alignment = {"mode": "effective"}
    single = replace(spec(ProbeAlignment(**alignment)), window=300)
    cut = [run.sel(time=slice(0, 100)) for run in runs]
    alone = single.fit(runs, STATES, INPUTS, stop=100.0).alignment.celerity
    assert aligned_ensemble(cut, **alignment).alignment.celerity == alone


def test_a_probe_that_was_moved_and_says_so_changes_nothing(models):
    run = drifting_run(7, moved=0.5)
    wrong = heave_error(models["dispersion"], run)
    for name, x in POSITIONS.items():
        run[name].attrs["x_position"] = x + 0.5
    right = heave_error(models["dispersion"], run)
    assert right < 0.06 < 0.3 < wrong


def test_an_offset_is_found_with_its_spread(models):
    run = drifting_run(7, moved=-0.4)
    found = estimate_probe_offset(models["dispersion"], run, (0.0, 60.0))
    # 0.4 m upstream: carry 0.4 m downstream. 55 s of 27 waves with next to no noise.
    assert found.offset == pytest.approx(0.4, abs=0.03)
    assert found.interval[0] - 0.01 <= found.offset <= found.interval[1] + 0.01
    assert 0 < found.spread < 0.05
    assert found.nrmse < 0.25 * found.nrmse_uncorrected
    corrected = heave_error(models["dispersion"], run.assign_attrs(probe_offset=found.offset))
    assert corrected < 0.1


def test_a_gap_in_the_surge_is_named_in_a_forecast(models):
    run = drifting_run(7)
    run["surge"].values[700] = np.nan
    with pytest.raises(DataError, match=r"channel 'surge' of run has 1 missing .* at t = 70 s"):
        models["dispersion"].forecast(run, start=60.0, steps=300)
    models["dispersion"].forecast(run, start=60.0, steps=50)


def aligned_ensemble(runs, **alignment):
    return BayesianHankelDMDc(
        encounter_period=2.0,
        window=Uniform("15 T", "25 T"),
        state_delays=Uniform("0.4 T", "0.8 T"),
        input_delays=Uniform("1 T", "3 T"),
        ridge=Fixed(1e-3),
        n_members=3,
        delay_rows="exact",
        alignment=ProbeAlignment(**alignment),
    ).fit(runs, STATES, INPUTS)


def test_the_celerity_is_that_of_the_mean_slowness():
    speeds = (2.0, 2.2, 2.7)
    given = {f"run{c}": drifting_run(seed).assign_attrs(celerity=c)
             for seed, c in enumerate(speeds)}  # fmt: skip
    alignment = ProbeAlignment(mode="effective", surge="none")
    model = HankelDMDc(2, 4, 1.0, alignment=alignment).fit(given, ["heave"], INPUTS)
    assert model.alignment.celerity == pytest.approx(3 / sum(1 / c for c in speeds), rel=1e-12)
