"""The doors of the room: input maps, leads, the registry, and one engine for all forecasts."""

import json
from dataclasses import replace
from types import SimpleNamespace
from unittest.mock import patch

import numpy as np
import pytest
from drifting import INPUTS, STATES
from ensembles import few
from records import record
from said import data_error, request_error, warned

from seakeep import BayesianHankelDMDc, HankelDMDc, Powers, ProbeAlignment, Uniform
from seakeep.models import KINDS, InputMap, alignment, outside_training
from seakeep.models.alignment import carry_by_dispersion
from seakeep.models.ensemble import Draw
from seakeep.models.validity import Coverage

DT, HEAVE = 0.1, (["heave"], ["eta"])


def sea(seed=0):
    heave, eta = np.random.default_rng(seed).standard_normal((2, 600))
    return record(DT, heave=heave, eta=eta)


# Windows, members and executors share one reading of each run.


def test_each_probe_is_carried_once_per_run(drifts, drift):
    measured = ProbeAlignment(mode="dispersion", surge="measured")
    fitted = few(alignment=measured).fit(drifts, STATES, INPUTS)
    with patch.object(alignment, "carry_by_dispersion", wraps=carry_by_dispersion) as carries:
        fitted.forecast_windows(drift, [20.0, 25.0, 30.0], steps=20)
    assert carries.call_count == len(INPUTS)


def test_a_forecast_upstream_says_how_far_ahead_it_reads(drifts, drift):
    here = ProbeAlignment(mode="effective", surge="none", celerity=2.0)
    for offset, ahead in ((0.0, 0.0), (-3.0, 1.5)):
        spec = HankelDMDc(2, 8, 1.0, alignment=replace(here, offset=offset))
        model = spec.fit(drifts, STATES, INPUTS)
        attrs = model.forecast(drift, 20.0, 30).attrs
        assert attrs["reads_input_until"] == pytest.approx(ahead - model.dt)
        assert ("upstream" in model.summary()) == (offset < 0)


# Specs and files by kind.


@pytest.mark.parametrize(
    "spec",
    [
        few(seed=np.random.default_rng(3), lead="0.5 T", ridge=2.0),
        BayesianHankelDMDc.paper(1.6, n_members=3, seed=np.random.SeedSequence(5).spawn(2)[1]),
        BayesianHankelDMDc.recommended(1.6),
    ],
)
def test_settings_come_back_from_json(spec):
    kept = json.loads(json.dumps(spec.to_json()))
    back = KINDS[spec.kind].from_json(kept)
    assert back.to_json() == spec.to_json()
    assert back.seed_sequence.state == spec.seed_sequence.state
    with request_error(r"unknown key 'rigde'\. Did you mean 'ridge'"):
        KINDS[spec.kind].from_json(kept | {"rigde": 1})


def test_needs_of_specs():
    single = HankelDMDc(3, 8, 1.0, window=100, lead=2).needs(0.1)
    assert (single.snapshots, single.history, single.inside, single.lead) == (100, 8, False, 2)
    many = few(window=Uniform("10 T", "20 T"), lead="0.5 T").needs(0.1)
    assert (many.snapshots, many.history, many.lead) == (320, 24, 8)


# What the training waves say of the waves of a forecast.


def regular():
    """A surge that follows a wave of 2 s."""
    eta = np.cos(np.pi * DT * np.arange(1200))
    return record(DT, surge=np.r_[0.0, eta[:-1]], eta=eta)


def test_higher_waves_and_a_drift_are_outside():
    run = regular()
    model = HankelDMDc(2, 8, 1.0).fit(run, ["surge"], ["eta"])
    # A regular wave is two amplitudes high; g T²/2π is 6.25 m.
    assert outside_training(model, 1.5 * run, 20.0, 600) == [
        "eta: a height of 3 m, trained up to 2 m",
        "eta: a steepness in deep water of 0.48, trained up to 0.32",
    ]
    (told,) = outside_training(model, run.assign(surge=run.surge - 3), 20.0, 600)
    assert told == "a mean surge of -3 m, upstream of the trained -1 to 1 m"
    assert outside_training(model, 1.5 * run, 20.0, 90) == []  # four waves are no sea
    words = "eta: a mean of 2.2 m, trained from -2.12 to 2.12 m (mean and 3 SD)"
    for away, steps, expected in ((2.0, 192, []), (2.2, 192, [words]), (2.2, 23, [])):
        moved = run.assign(eta=run.eta + away)
        assert outside_training(model, moved, 20.0, steps) == expected  # 31 are under two periods
    # What training has too is inside, also where the model reads departures or carried waves.
    for centre in ("pooled", "run"):
        model = HankelDMDc(2, 8, 1.0, centre=centre).fit(
            run.assign(eta=run.eta + 9), ["surge"], ["eta"]
        )
        assert outside_training(model, run.assign(eta=run.eta + 9), 50.0, 192) == []


def test_a_forecast_says_by_how_much_and_reads_its_own_surge():
    run = regular()
    wind = Coverage.of(["eta", "wind"], [np.stack([run.eta, run.eta], axis=1)], 0.1)
    assert np.isfinite(wind.steepnesses).tolist() == [True, False]
    high = run.map(lambda x: 1.5 * x, keep_attrs=True)  # as the oldest xarray takes it
    high["surge"].values[high["time"].values > 20.0] = np.nan
    words = "eta: a height of 3 m, trained up to 2 m; eta: a steepness in deep water of 0.48, "
    for spec in (HankelDMDc(2, 8, 1.0), few(window=None)):
        model = spec.fit(run, ["surge"], ["eta"])
        forecasts = [model.forecast(high, 20.0, 600)]
        if spec.is_ensemble:
            forecasts.append(model.forecast_summary(high, 20.0, 600))
        for forecast in forecasts:
            assert forecast.attrs["status"] == "ok, outside training"
            assert forecast.attrs["outside_training"].startswith(words)
        inside = model.forecast(run, 20.0, 600).attrs
        assert (inside["status"], "outside_training" in inside) == ("ok", False)


# Units of pooled runs, and values that no standard deviation holds.


def test_runs_in_other_units_are_never_pooled():
    plain, centimetres = sea(), sea(seed=1)
    del plain["heave"].attrs["units"]
    centimetres["heave"].attrs["units"] = "cm"
    with data_error(r"'heave' is in 'cm' in run 2 and in 'm' in run 3"):
        HankelDMDc(1, 4, 1.0).fit([plain, centimetres, sea()], *HEAVE)


def test_a_run_that_states_no_unit_is_taken_with_a_warning():
    plain = sea(seed=1)
    del plain["heave"].attrs["units"]
    with warned(r"'heave' of run 1 states no unit.*in 'm', as in"):
        model = HankelDMDc(1, 4, 1.0).fit([plain, sea()], *HEAVE)
    assert model.state_labels[0].units == "m"
    with warned(r"'heave' of the run states no unit.*model's 'm'"):
        model.forecast(plain, start=5.0, steps=5)


def test_an_observable_that_overflows_is_refused():
    run = sea()
    run["eta"].values[7] = 1e60
    spec = HankelDMDc(1, 4, 1.0, observables=[Powers(("eta",), (3,))])
    with data_error(r"has a standard deviation that is not finite"):
        spec.fit(run, *HEAVE)


def test_a_history_inside_the_window_is_not_counted_twice():
    draws = {
        history: Draw(HankelDMDc(4, 12, 1.0, window=50, history=history), (1.0, 0.2, 0.5))
        for history in ("inside", "before")
    }
    plain, longer = (
        SimpleNamespace(history=lambda z, most=most: most, around=InputMap().around)
        for most in (12, 60)
    )
    assert [draws[key].needed(plain) for key in draws] == [50, 62]
    assert draws["inside"].needed(longer) == 62  # a pair after the longest history
    early = InputMap(lead=7)
    every = Draw(HankelDMDc(4, 12, 1.0), (1.0, 0.2, 0.5))
    assert every.needed(early) == 12 + 2 + 6  # and the inputs that lead by six samples more
