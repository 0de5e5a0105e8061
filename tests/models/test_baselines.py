"""Baselines: what they are, against other packages and known systems; files; runs of any kind."""

from dataclasses import replace

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose
from records import record, table
from said import request_error
from scipy import signal

from seakeep import SlowSquares
from seakeep.baselines import ARX, FIR, HoldLast, Mean, Subspace
from seakeep.models.selection import select

DT = 0.1
STATES, INPUTS = ["heave", "pitch"], ["eta_fwd", "eta_aft"]
SPECS = {
    "mean": Mean(),
    "hold_last": HoldLast(window=200),
    "fir": FIR(input_delays=20),
    "arx": ARX(state_delays=3, input_delays=4),
    "subspace": Subspace(state_delays=6, input_delays=6, order=4),
}


def linear_run(seed, samples=600, noise=0.0):
    """Two damped oscillators that two waves drive; heave and pitch move in both."""
    waves, rest = np.random.default_rng(seed).normal(size=(2, 2, samples))
    laws = ([0.0, 0.5, 0.2], [1.0, -1.6, 0.75]), ([0.0, 0.3, -0.2], [1.0, -1.4, 0.6])
    motions = [signal.lfilter(*law, wave) for law, wave in zip(laws, waves, strict=True)]
    heave, pitch = [[1.0, 0.2], [0.1, 1.0]] @ np.stack(motions) + noise * rest
    channels = 3.0 + heave, pitch - 1.0, 0.5 + waves[0], waves[1]
    return record(DT, {"run": f"run {seed}"}, **dict(zip(STATES + INPUTS, channels, strict=True)))


@pytest.fixture(scope="module")
def runs():
    return [linear_run(1), linear_run(2)]


@pytest.mark.parametrize("kind", SPECS)
def test_windows_are_forecasts_and_a_history_is_what_the_settings_say(kind, runs):
    spec, test = SPECS[kind], linear_run(3)
    model = spec.fit(runs, STATES, INPUTS, stop=50.0)
    assert model.history_samples == spec.needs(DT).history + 1
    one = model.forecast(test, start=20.0, steps=40)
    several = model.forecast_windows(test, [20.0, 30.0], 40)
    assert_near(table(several, STATES)[0], table(one, STATES), 1e-10)


def test_mean_and_hold_last_are_what_they_say_and_read_no_input(runs):
    test = linear_run(3)
    model = Mean().fit(runs, STATES, INPUTS, stop=50.0)
    pooled = np.concatenate([table(run, STATES)[:501] for run in runs])
    forecast = model.forecast(test.drop_vars(INPUTS), start=20.0, steps=5)
    assert_allclose(table(forecast, STATES), [pooled.mean(axis=0)] * 5, rtol=1e-12)
    assert "reads_input_until" not in forecast.attrs
    held = HoldLast().fit(runs, STATES, INPUTS).forecast(test.drop_vars(INPUTS), 20.0, 5)
    assert_allclose(table(held, STATES), [table(test, STATES)[200]] * 5, rtol=1e-12)


@pytest.mark.parametrize("kind", ["arx", "subspace"])
def test_a_linear_vessel_is_forecast_to_rounding(kind, runs):
    test = linear_run(3)
    # Four states, and one for the constant by which the means of the samples are off.
    spec = replace(SPECS[kind], **{"ridge": 0.0, "order": 5} if kind == "subspace" else {})
    forecast = spec.fit(runs, STATES, INPUTS).forecast(test, start=20.0, steps=300)
    assert_near(table(forecast, STATES), table(test, STATES)[201:501], 1e-7)


@pytest.mark.parametrize("kind", [ARX, FIR, Subspace])
def test_lengths_in_periods_count_those_before_the_stop(kind):
    waves = np.sin(2 * np.pi * DT * np.arange(900) / np.repeat([2.0, 0.5], [300, 600]))
    run = record(DT, heave=np.random.default_rng(0).normal(waves, 0.1), eta_fwd=waves)
    spec = replace(SPECS[kind.kind], input_delays="1 T")
    model = spec.fit(run, ["heave"], (name for name in ["eta_fwd"]), stop=29.9)
    assert (model.settings.input_delays, model.inputs) == (20, ["eta_fwd"])


def test_fir_finds_a_known_impulse_response():
    rng = np.random.default_rng(5)
    response, u = rng.normal(size=(2, 12)), rng.normal(size=2000)
    # x at j + 1 comes from u at j and before.
    heave, pitch = (np.r_[0.0, np.convolve(u, h)[:1999]] for h in response)
    run = record(DT, heave=heave, pitch=pitch, eta=u)
    model = FIR(input_delays=15, ridge=0.0, standardize=False).fit(run, STATES, ["eta"])
    assert_near(model.coefficients[:, 2:], np.c_[response, np.zeros((2, 4))], 1e-10)
    assert model.spectral_radius == 0.0
    with request_error(r"FIR model is a filter of its inputs and has none"):
        FIR(input_delays=15).fit(run, STATES, [])


def test_length_and_ridge_of_a_filter_are_those_that_forecast_runs_held_out_best():
    """Scores themselves: `test_kinds.py`."""
    period = 2.0
    given = [linear_run(seed, 500, noise=0.3).assign_attrs(encounter_period=period)
             for seed in (1, 2)]  # fmt: skip
    named = {run.attrs["run"]: run for run in given}
    spec = FIR(input_delays=40, ridge="rollout")
    found = select(spec, named, STATES, INPUTS, vary=["input_delays"], horizon=(5.0, 15.0))
    assert {row["input_delays"] for row in found.rows} == {40, 24, 16}
    best = min(found.rows, key=lambda row: row["score"])
    assert 1e-5 < best["ridge"] < 0.3  # noise asks for some, and the edges are not chosen
    model = spec.fit(given, STATES, INPUTS)
    assert model.settings == found.settings
    assert f"ridge {found.settings.ridge:g}" in model.selection
    # Also where an observable counts in periods of the runs.
    counts, states = (
        replace(spec, observables=(SlowSquares(INPUTS, period=each, lead=0.0),))
        for each in (None, period)
    )
    models = [each.fit(given, STATES, INPUTS) for each in (counts, states)]
    assert models[0].settings.ridge == models[1].settings.ridge
    assert_near(models[0].coefficients, models[1].coefficients, 1e-9)


def test_the_recommended_subspace_model_takes_one_state():
    """The future of a period of 8 samples has 9 values of one state, fewer than 40."""
    spec = Subspace.recommended(8 * DT, DT)
    model = spec.fit(linear_run(1), STATES[:1], INPUTS)
    assert spec.order is None
    assert model.settings.order == len(model.space.A) == 9


def test_a_subspace_model_without_inputs_continues_the_states():
    swing = np.sin(2 * np.pi * np.arange(400) / 25)
    run = record(DT, {}, heave=swing)
    model = Subspace(6, 0, order=2, ridge=0.0).fit(run, ["heave"], [], stop=19.9)
    assert_near(model.forecast(run, start=25.0, steps=40)["heave"], swing[251:291], 1e-4)
