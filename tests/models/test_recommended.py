"""What `recommended` chooses at fit, what it goes without, and what it refuses."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from said import request_error
from squared import DT, INPUTS, PERIOD, STATES, runs, sea

from seakeep import BayesianHankelDMDc, HankelDMDc, LogUniform, ProbeAlignment, Select, Uniform

T = PERIOD * DT
SHORT = Select(observables=True, horizon=10, period=T)
SPEC = replace(HankelDMDc.recommended(T, DT), select=SHORT)


def test_columns_and_ridge_are_chosen_and_the_model_says_from_what():
    model = SPEC.fit(runs(), STATES, INPUTS)
    settings = model.settings
    kinds = [each.kind for each in settings.observables]
    assert "slow_squares" in kinds  # the drift is made of one
    assert isinstance(settings.ridge, float)
    assert settings.select is None
    first, *rest = model.selection.splitlines()
    # Six λ of both observables, and three of each and of none, which err a fifth more.
    assert first.startswith(f"ridge {settings.ridge:g} per snapshot pair: out of 15 settings")
    assert first.endswith("not aligned to the surge: 'surge' is not among the states")
    tried = ["none", "slow_squares", "powers", "slow_squares, powers"]
    for line, names in zip(rest, tried, strict=True):
        assert f"observables {names}, lead" in line
        assert ("(chosen)" in line) == (names == ", ".join(kinds))
    # The settings that were chosen give the same model again.
    assert_array_equal(settings.fit(runs(), STATES, INPUTS).coefficients, model.coefficients)
    assert model.history_samples <= SPEC.needs(DT).history + 1
    assert model.lead_samples <= SPEC.needs(DT).lead


def test_an_ensemble_draws_around_what_was_chosen():
    single = SPEC.fit(runs(), STATES, INPUTS)
    spec = BayesianHankelDMDc.recommended(T, n_members=8)
    assert [spec.input_delays.ppf(q) for q in (0, 0.5, 1)] == [2, 3, 4]
    ensemble = replace(spec, select=SHORT).fit(runs(), STATES, INPUTS)
    assert ensemble.settings.observables == single.settings.observables
    assert ensemble.selection == single.selection
    assert ensemble.selection.splitlines()[-1].strip() in ensemble.summary()
    ratio = ensemble.draws.ridge.values / single.settings.ridge
    assert np.all((ratio >= 0.3) & (ratio <= 3))
    assert len(set(ratio)) == 8
    assert ensemble.settings.lead == single.settings.lead == 8
    assert_array_equal(  # what a worker gets
        pickle.loads(pickle.dumps(ensemble)).member(0).A, ensemble.member(0).A
    )


def test_members_learn_from_windows_of_long_runs_and_else_from_all_of_them():
    spec = replace(
        BayesianHankelDMDc.recommended(T, n_members=12), ridge=LogUniform(0.1, 10), select=None
    )
    long = {name: sea(seed, samples=round(130 * PERIOD)) for seed, name in enumerate("abc")}
    taught = spec.fit(long, STATES, INPUTS)
    assert taught.origin["train_on"] == "windows"
    assert {draw.run for draw in taught.members} == {0, 1, 2}
    lengths = np.array([draw.settings.window for draw in taught.members]) / PERIOD
    assert 60 <= lengths.min() < lengths.max() <= 120
    assert len({(draw.run, draw.last, draw.settings.window) for draw in taught.members}) == 12
    regular = {**long, "c": long["c"].assign_attrs(waves="regular")}
    short = {**long, "c": sea(2, samples=round(110 * PERIOD))}
    for given in (regular, short, {"a": long["a"]}):
        ensemble = spec.fit(given, STATES, INPUTS)
        assert ensemble.origin["train_on"] == "all"
        assert {(draw.run, draw.settings.window) for draw in ensemble.members} == {(None, None)}
    again = replace(spec, train_on="windows", window=Uniform("60 T", "120 T"))
    assert again.fit(long, STATES, INPUTS).origin == taught.origin


def test_regular_runs_train_beside_irregular_ones():
    given = runs() | {"regular": sea(10, frequency=1.4)}
    assert SPEC.fit(given, STATES, INPUTS).training.runs == tuple(given)


@pytest.mark.parametrize(
    ("unknown", "missing"),
    {
        "": "",
        "depth": "the runs state no water depth",
        "position": "the run states no position of a wave probe",
    }.items(),
)
def test_an_optional_alignment_is_left_out_where_the_rig_is_not_known(unknown, missing):
    run = sea(0).rename(drift="surge").assign_attrs(water_depth=2.0)
    run["eta"].attrs["x_position"] = -1.0
    if unknown == "depth":
        del run.attrs["water_depth"]
    if unknown == "position":
        del run["eta"].attrs["x_position"]
    given = {"the run": run}, ["heave", "surge"], ["eta"]
    alignment = ProbeAlignment(mode="dispersion", surge="predicted", optional=True)
    assert alignment.missing(*given) == missing
    spec = HankelDMDc(6, 12, 1.0, delay_rows="exact", alignment=alignment, lead=8)
    model = spec.fit(*given)
    if unknown != "depth":
        assert model.alignment.settings.surge == ("none" if missing else "predicted")
        return
    assert model.alignment is None
    needed = replace(alignment, optional=False)
    with request_error("needs the water depth"):
        replace(spec, alignment=needed).fit(*given)
