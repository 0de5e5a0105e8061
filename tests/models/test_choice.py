"""Which candidate is taken: the simplest within the noise, and a start unless it is beaten."""

from dataclasses import replace

import numpy as np
import pytest
from squared import DT, INPUTS, PERIOD, STATES, runs, sea

from seakeep import HankelDMDc, ProbeAlignment, Select, SlowSquares
from seakeep.models import selection
from seakeep.models.candidates import Candidates
from seakeep.models.selection import Trial, groups_of, select, simplest

T = PERIOD * DT
OPEN = Select(True, True, True, True, period=T, horizon=10)
SPEC = replace(HankelDMDc.recommended(T, DT), select=OPEN)
REMEMBERS, PLAIN = replace(SPEC, memory=9), replace(SPEC, memory=0)


def without_drift():
    return {name: run.drop_vars("drift") for name, run in runs().items()}


def trial(*by_group):
    """Two windows of each group, at a worse λ and at the better one."""
    scores = np.repeat(by_group, 2) + np.tile([-0.05, 0.05], len(by_group))
    weights = np.full(scores.size, 1 / scores.size)
    groups = np.repeat(np.arange(len(by_group)), 2)
    return Trial((1e-3, 1e-2), np.stack([scores + 1.0, scores]), weights, groups)


@pytest.mark.parametrize(
    ("other", "is_as_good"),
    {
        (0.31, 0.21, 0.11): False,  # worse by as much everywhere: no noise
        (0.34, 0.22, 0.06): True,  # by .01 in the mean, with a standard error of .026
        (0.33, 0.21, 0.10): False,  # by .0133, with one of .0088
        (0.32, 0.20, 0.10): True,  # by .0067, with one of as much
        (0.20, 0.20, 0.10): True,
    }.items(),
)
def test_the_noise_is_a_standard_error_over_what_is_held_out(other, is_as_good):
    best = trial(0.3, 0.2, 0.1)
    assert trial(*other).is_as_good_as(best) == is_as_good
    assert best.is_as_good_as(best)


@pytest.mark.parametrize(
    ("best", "other", "is_taken"),
    [
        ((0.3, 0.2), (0.36, 0.19), False),  # 10 % worse; two groups do not tell the noise, .035
        ((0.3, 0.2), (0.303, 0.203), True),  # 1.2 % worse everywhere
        ((0.3, 0.2, 0.1), (0.4, 0.26, 0.0), True),  # 10 % worse, within the noise of three
        ((0.3, 0.2, 0.1), (0.33, 0.22, 0.11), False),  # 10 % worse everywhere
    ],
)
def test_what_is_simpler_errs_little_more(best, other, is_taken):
    trials = {REMEMBERS: trial(*best), PLAIN: trial(*other)}
    assert (simplest(trials, REMEMBERS, 0.0) == PLAIN) == is_taken


@pytest.mark.parametrize(("alike", "is_taken"), [(0.0, True), (0.03, False)])
def test_what_is_simpler_counts_with_the_ridge_that_it_would_be_given(alike, is_taken):
    scores = np.array([[0.104, 0.104], [0.107, 0.107]])  # 4 % and 7 % worse than the best
    other = Trial((1e-3, 1e-2), scores, np.array([0.5, 0.5]), np.array([0, 1]))
    trials = {REMEMBERS: trial(0.1, 0.1), PLAIN: other}
    assert (simplest(trials, REMEMBERS, alike) == PLAIN) == is_taken


@pytest.mark.parametrize(("surge", "lead"), [("predicted", 9), ("measured", 0)])
def test_the_look_ahead_of_carried_waves_is_no_part_of_its_own(surge, lead):
    alignment = ProbeAlignment(mode="dispersion", surge=surge)
    ahead, without = (replace(SPEC, alignment=alignment, lead=each) for each in (9, 0))
    trials = {ahead: trial(0.3, 0.2), without: trial(0.298, 0.198)}
    assert simplest(trials, without, 0.0).lead == lead


def test_a_group_that_repeats_counts_once():
    # The second and the third fold repeat each other: worse in two of three, and in one of two.
    one, other = trial(0.3, 0.2, 0.2), trial(0.29, 0.23, 0.23)
    assert not other.is_as_good_as(one)
    pair = np.array([0, 0, 1, 1, 1, 1])
    assert replace(other, groups=pair).is_as_good_as(replace(one, groups=pair))


@pytest.mark.parametrize(
    ("means", "left"),
    [
        ([0.1, None, 0.2, None, 0.3], [1]),  # the best is the first
        ([0.3, None, 0.2, None, 0.1], [3]),  # and the last
        ([0.1, None, 0.102, None, 0.2], [1, 3]),  # 2 % worse counts as the best
        ([0.2, 0.1, 0.2, None, 0.3], []),
        ([None, None, 0.1, None, 0.2], [0, 1, 3]),
    ],
)
def test_the_ridges_about_the_best_are_tried(means, left):
    scores = np.array(means, dtype=float)[:, None]
    its = Trial((0.0, 1.0, 2.0, 3.0, 4.0), scores, np.ones(1), np.zeros(1, dtype=int))
    assert its.between() == left


def test_the_ridges_about_the_best_of_what_is_taken_are_tried(monkeypatch):
    monkeypatch.setattr(selection, "NEAR", 0.0)
    given = without_drift()
    found = select(replace(SPEC, select=None), given, ["heave"], INPUTS, opened=("observables",))
    assert found.settings.observables == ()
    levels = {}
    for row in found.rows:
        levels.setdefault(row["observables"], []).append(row["ridge"])
    # First every fourth; at last those about the best of what is taken.
    every = list(selection.RIDGES)
    assert levels.pop("none") == [*every[:5], every[8]]
    assert [*levels.values()] == [every[::4]] * 3


@pytest.mark.parametrize("count", [selection.FEW, selection.FEW + 1])
def test_windows_of_few_runs_stay_in_memory_and_are_read_once(monkeypatch, count):
    made = []
    read_groups, problem = selection.read_groups, selection._problem
    monkeypatch.setattr(selection, "read_groups", lambda *a: made.append(1) or read_groups(*a))
    kept = []
    monkeypatch.setattr(selection, "_problem", lambda *a: kept.append(problem(*a)) or kept[-1])
    given = {f"{n}": next(iter(runs().values())).assign_attrs(run=f"{n}") for n in range(count)}
    choice = {"vary": ("observables",), "folds": "run", "horizon": (10.0,)}
    found = select(replace(SPEC, select=None), given, ["heave"], INPUTS, **choice)
    (one,) = kept
    assert len(one.read) == (count if count == selection.FEW else 0)
    assert (len(made) == count) == (count == selection.FEW)
    for each in one.read.values():
        for starts, windows, measured in each:
            assert len(windows.histories) == len(starts) == len(measured)
    # Longer ones are others, which are read anew.
    longer = 2 * max(one.horizons)
    judged = [each.predicted.shape for each in one.held_out(found.settings, 1e-3, longer)]
    assert judged == [(len(one.starts(n, longer)), longer, 1) for n in range(count)]


def test_a_look_ahead_that_is_left_open_may_be_varied_too():
    spec = replace(SPEC, alignment=None, select=None)
    found = select(spec, runs(), STATES, INPUTS, vary=("lead",), opened=("observables", "lead"))
    # The squares are those that go with each look-ahead: what was tried without one is not new.
    tried = [(row["lead"], row["observables"], row["ridge"]) for row in found.rows]
    assert {lead for lead, names, _ in tried if "slow_squares" in names} == {0, 5, 8, 10}
    assert len(set(tried)) == len(tried)


def test_what_brings_nothing_is_not_recommended():
    given = without_drift()
    model = SPEC.fit(given, ["heave"], INPUTS)
    settings = model.settings
    assert (settings.alignment, settings.observables, settings.memory) == (None, (), 0)
    assert settings.lead == 0
    assert "lead 0" in model.selection
    spec = replace(SPEC, select=None, ridge=1e-3, lead=0, alignment=None, readouts=())
    assert model.lead_samples == spec.fit(given, ["heave"], INPUTS).lead_samples == 0


def test_a_start_is_left_only_for_what_is_better_beyond_the_noise():
    given = without_drift()
    start = HankelDMDc(6, 12, 1e-3, delay_rows="exact", ridge_scale="per_snapshot")
    found = select(start, given, ["heave"], INPUTS, vary=("observables",), horizon=(10.0,))
    assert replace(found.settings, ridge=start.ridge) == start
    assert "; what it starts from: nothing that was tried is better by more than" in found.note


def test_regular_waves_are_held_out_by_period_and_others_are_said_to_be_extrapolation():
    periods = {"a": 1.0, "b": 1.25, "again": 1.01, "c": 0.8}
    given = {name: sea(n, frequency=1 / p) for n, (name, p) in enumerate(periods.items())}
    assert groups_of(given, "auto", INPUTS) == {"a": "a", "b": "b", "again": "a", "c": "c"}
    assert groups_of(given, "run", INPUTS)["again"] == "again"
    model = replace(SPEC, select=replace(OPEN, horizon=(5,))).fit(given, STATES, INPUTS)
    said = "forecasts at periods other than 0.8 to 1.25 s extrapolate"
    assert f"all runs are of regular waves: {said}" in model.selection
    assert "held out with each: the runs of its period; 3 waves differ" in model.selection
    mixed = given | {"irregular": sea(9)}
    assert groups_of(mixed, "auto", INPUTS) == {name: name for name in mixed}


def test_stated_squares_are_no_look_ahead_that_is_left_out():
    squares = SlowSquares("eta", orders=(0,), lags=(0, 1))
    spec = replace(SPEC, observables=(squares,))
    assert set(spec.fit(runs(), STATES, INPUTS).settings.observables) <= {squares}


@pytest.mark.parametrize(("ahead", "alike"), [(0.5, True), (0.0, False)])
def test_stated_squares_that_look_ahead_share_their_columns(ahead, alike):
    squares = SlowSquares("eta", orders=(0,), lags=(0, 1), lead=ahead)
    base = replace(SPEC, select=None, alignment=None, lead=6, observables=(squares,))
    given = runs(), STATES, INPUTS
    tried = Candidates(base, given, PERIOD, DT, (), ("lead",), unseen=False, rivals=False)
    assert (tried.columns(base) == tried.columns(replace(base, lead=0))) == alike
