"""Settings chosen by free runs on training runs that are held out."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from drifting import INPUTS as PROBES
from drifting import STATES as DRIFTING
from drifting import drifting_runs
from free_runs import held_out_scores
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from oscillators import OF_ARX, arx_run
from records import record
from said import data_error
from squared import DT, INPUTS, STATES, runs

from seakeep import HankelDMDc, ProbeAlignment, Select
from seakeep.models.candidates import default_observables
from seakeep.models.labelled import elevations, mean_period
from seakeep.models.selection import RIDGES, Problem, groups_of, select

SPEC = HankelDMDc(6, 12, "rollout", delay_rows="exact")


def test_a_run_in_which_nothing_moves_weighs_nothing_beside_plain_fits_and_forecasts():
    given = runs(4)
    for name in STATES:
        given["run3"][name].values[:] *= 1e-6
    found = select(SPEC, given, STATES, INPUTS, horizon=(15.0, 30.0))
    scores = {row["ridge"]: row["score"] for row in found.rows}
    assert list(scores) == list(RIDGES)
    for ridge in (RIDGES[0], RIDGES[4], RIDGES[-1]):
        spec = replace(SPEC, ridge=ridge, ridge_scale="per_snapshot")
        errors = [held_out_scores(spec, given, STATES, INPUTS, steps, 12) for steps in (150, 300)]
        # Sums in another order; horizons count alike.
        assert_near(scores[ridge], np.mean(errors, axis=0)[:3].mean(), 1e-10)
    # The largest that is as good as the best.
    near = [ridge for ridge, score in scores.items() if score <= 1.03 * min(scores.values())]
    assert [row["ridge"] for row in found.rows if row["chosen"]] == [max(near)]
    assert found.settings.ridge == max(near)


def test_each_delay_is_scored_as_by_a_fit_and_forecasts_of_its_own():
    given = runs()
    found = select(
        SPEC, given, STATES, INPUTS, vary=["input_delays", "state_delays"], horizon=(15,)
    )
    least = [row for row in found.rows if row["ridge"] == RIDGES[0]]  # scales hardly matter there
    tried = {(row["state_delays"], row["input_delays"]): row["score"] for row in least}
    assert {z for _, z in tried} >= {12, 20, 30, 50}
    assert len({s for s, _ in tried}) > 2
    for (s, z), score in tried.items():
        reach = max(s, z)
        # The same pairs as with the longest delays.
        cut = {name: run.isel(time=slice(50 - reach, None)) for name, run in given.items()}
        spec = replace(SPEC, state_delays=s, input_delays=z, ridge=RIDGES[0])
        plain = replace(spec, ridge_scale="per_snapshot")
        scores = held_out_scores(plain, cut, STATES, INPUTS, 150, reach)
        # Moments of the cut runs, and of the whole ones.
        assert_allclose(score, np.mean(scores), rtol=1e-2)


def test_free_runs_side_by_side_score_as_one_after_the_other(monkeypatch):
    judge, batches = Problem.judge, []

    def both(problem, tried, fold):
        found = judge(problem, tried, fold)
        for one, (scores, weights) in zip(tried, found, strict=True):
            ((alone, own),) = judge(problem, [one], fold)
            # Products of matrices are summed in another order.
            assert_near(scores, alone, 1e-9)
            assert_array_equal(weights, own)
        batches.append(len(tried))
        return found

    monkeypatch.setattr(Problem, "judge", both)
    given = drifting_runs(2, 900)
    spec = HankelDMDc(
        4, 12, "rollout", delay_rows="exact", lead=6, select=Select(observables=True),
        alignment=ProbeAlignment(mode="dispersion", surge="predicted"),
    )  # fmt: skip
    spec.fit(given.values(), DRIFTING, PROBES)
    assert max(batches) == 4  # none, either, and both observables


def sines(periods):
    """A run of a minute whose channels have these periods, s."""
    angles = 2 * np.pi * DT * np.arange(600)
    return record(DT, **{name: np.sin(angles / period) for name, period in periods.items()})


def test_periods_are_counted_in_the_first_elevation():
    periods = {"wind": 5, "eta_fwd_rate": 3, "gauge": 2.5, "eta_fwd": 2}
    run = sines(periods)
    run["wind"].attrs["units"] = "m/s"
    still = run.assign(eta_fwd=0 * run["eta_fwd"])
    # Crossings of a sine between samples are linear to a thousandth of a step.
    for given in ({"a": run}, {"still": still, "a": run}):
        assert_allclose(mean_period(given, [*periods]), 2 / DT, rtol=1e-3)
    assert_allclose(mean_period({"a": run}, ["wind", "gauge"]), 2.5 / DT, rtol=1e-3)
    stated = run.assign_attrs(encounter_period=1.5)
    assert_allclose(mean_period({"still": still, "b": stated}, [*periods]), 15)
    with data_error(r"no input \(wind\) is a wave elevation, eta_…\. Set run"):
        mean_period({"a": run}, ["wind"])


@pytest.mark.parametrize("order", [slice(None), slice(None, None, -1)])
def test_periods_are_those_of_the_elevation_farthest_up_wave(order):
    """A free name is an elevation where its channel states a position and metres."""
    periods = {"eta_fwd": 2, "wave": 2.5, "gauge": 3, "pressure": 4}
    run = sines(periods)
    run["pressure"].attrs.update(units="Pa", x_position=-9.0)
    run["eta_fwd"].attrs["x_position"] = 1.0
    names = [*periods][order]
    assert_allclose(mean_period({"a": run}, names), 2 / DT, rtol=1e-3)
    run["wave"].attrs["x_position"] = -1.0
    assert_allclose(mean_period({"a": run}, names), 2.5 / DT, rtol=1e-3)
    assert {*elevations(run, names, "a")} == {"eta_fwd", "wave"}


def test_observables_are_those_of_elevations_of_any_name():
    spec = replace(SPEC, ridge=1e-3, ridge_scale="per_snapshot", select=Select(observables=True))
    found = []
    for name in ("eta", "wave"):
        given = {key: run.rename(eta=name) for key, run in runs().items()}
        for run in given.values():
            run[name].attrs["x_position"] = 0.0
        found.append(spec.fit(given, STATES, [name]))
    first, other = (each.settings.observables for each in found)
    assert [each.kind for each in other] == [each.kind for each in first] != []
    assert_array_equal(found[0].A, found[1].A)


def test_runs_that_repeat_the_wave_are_one_group_whatever_stands_first():
    first, other = (run.assign(drift=run["drift"] + 1.0) for run in runs(2).values())
    again = first.assign(drift=other["drift"], wind=other["heave"].assign_attrs(units="m/s"))
    given = {
        "first": first.assign(wind=first["heave"]),
        "again": again,
        "other": other.assign(wind=first["heave"]),
    }
    groups = groups_of(given, "auto", ["wind", "drift", "eta"])
    assert groups["first"] == groups["again"] != groups["other"]
    assert len(set(groups_of(given, "run", ["eta"]).values())) == 3
    # Nothing tells of waves, so that nothing is held out together.
    assert len(set(groups_of({"again": again, "b": again}, "auto", ["wind"]).values())) == 2


def test_unseen_seas_are_offered_the_envelopes_of_several_probes_alone():
    given = {
        name: run.assign(eta_2=run["eta"] + 0.01 * run["heave"]).assign_attrs(sea_state=name)
        for name, run in runs().items()
    }
    seen, unseen = (default_observables(["eta", "eta_2"], 1.0, each)[0] for each in (False, True))
    assert (seen.orders, seen.lead) == ((0, 1, 2), 2.0)
    assert (unseen.orders, unseen.lead) == ((0,), 0.0)
    # Each run is a sea state of its own here, so that both judge alike: by the lowest error, or by
    # the largest λ that is as good.
    differ = []
    for folds in ("run", "sea_state"):
        found = select(
            replace(SPEC, input_delays=5), given, STATES, ["eta", "eta_2"],
            vary=("observables",), ridges=tuple(np.geomspace(1e-3, 1e3, 61)), horizon=(15.0,),
            folds=folds,
        )  # fmt: skip
        (taken,) = [row for row in found.rows if row["chosen"]]
        scores = {
            row["ridge"]: row["score"]
            for row in found.rows
            if row["observables"] == taken["observables"]
        }
        least = min(scores.values())
        alike = [ridge for ridge, score in scores.items() if score <= 1.03 * least]
        assert taken["ridge"] == (max(alike) if folds == "run" else min(scores, key=scores.get))
        differ.append(len(alike) > 1)
    assert any(differ)  # the two rules


def test_a_look_ahead_that_the_data_has_is_found():
    # The wave is recorded half a period after it acts.
    given = {name: run.assign(eta=run["eta"].roll(time=5)) for name, run in runs().items()}
    options = replace(SPEC, input_delays=12, lead=0)
    found = select(options, given, STATES, INPUTS, vary=("lead",), horizon=(15.0,))
    assert found.settings.lead == 5


def test_of_a_short_run_nothing_is_held_out():
    short = {"run": runs(1)["run0"].isel(time=slice(200))}
    fallen = select(SPEC, short, STATES, INPUTS, horizon=(15.0,))
    assert fallen.settings.ridge == 1e-3
    assert "no window of 150 samples can be held out of runs of at most 200" in fallen.note


@pytest.mark.parametrize("history", ["before", "inside"])
def test_the_parts_of_a_single_run_are_those_of_its_training_window(history):
    run = runs(1)["run0"]
    window, reach = 400, max(SPEC.state_delays, SPEC.input_delays)
    read = window if history == "inside" else window + reach
    spec = replace(SPEC, observables=(), history=history)
    late = {"run": run.isel(time=slice(-read, None))}
    of_window, of_late = (
        select(each, given, STATES, INPUTS, horizon=(10.0,))
        for each, given in ((replace(spec, window=window), {"run": run}), (spec, late))
    )
    assert "3 parts held out in turn" in of_window.note
    assert of_window.settings.window == window
    scores = [[row["score"] for row in each.rows] for each in (of_window, of_late)]
    assert_allclose(*scores, rtol=1e-9)


def test_what_grows_is_never_chosen():
    """A motion that grows by half a per cent a step: the truth has no stable model."""
    given = {f"run{seed}": arx_run(seed, [1.005], [0.5], 120, 1.0) for seed in range(3)}
    spec = HankelDMDc(2, 2, "rollout", delay_rows="exact")
    found = select(spec, given, *OF_ARX, horizon=(1.0,))
    ranked = sorted(found.rows, key=lambda row: row["score"])
    stable = []
    for row in ranked:
        model = replace(spec, ridge=row["ridge"], ridge_scale="per_snapshot").fit(given, *OF_ARX)
        stable.append(bool(np.abs(np.linalg.eigvals(model.A)).max() < 1))
    assert not stable[0]  # over ten steps the truth itself is best
    assert found.settings.ridge == ranked[stable.index(True)]["ridge"]


def test_a_vessel_that_drifts_gets_an_alignment_and_the_measured_surge_is_no_choice():
    given = drifting_runs(2, 600)
    spec = HankelDMDc(4, 12, "rollout", delay_rows="exact")
    options = {"vary": ("alignment",), "horizon": (15.0,)}
    found = select(spec, given, DRIFTING, PROBES, **options)
    best = {}
    for row in found.rows:
        best[row["alignment"]] = min(row["score"], best.get(row["alignment"], np.inf))
    # Surge does not matter to "none"; carried over no distance it would be the same twice.
    assert set(best) == {"none", "dispersion, predicted"}
    assert best["dispersion, predicted"] < 0.8 * best["none"]
    assert found.settings.alignment.surge == "predicted"
    stated = replace(spec, alignment=ProbeAlignment(mode="dispersion", surge="measured"))
    with ThreadPoolExecutor(2) as pool:
        again = select(stated, given, DRIFTING, PROBES, **options, executor=pool)
    # In another order, in which other candidates have few λ.
    one, other = (
        {(row["alignment"], row["ridge"]): row["score"] for row in each.rows}
        for each in (found, again)
    )
    both = sorted(one.keys() & other.keys())  # equal but for where memory is aligned
    assert_allclose([one[key] for key in both], [other[key] for key in both], rtol=1e-9)
    assert again.settings == found.settings
    # Without positions and depth there is nothing to carry by.
    bare = {
        name: run.drop_attrs().assign_attrs(encounter_period=1.5) for name, run in given.items()
    }
    left = select(spec, bare, DRIFTING, PROBES, **options)
    assert {row["alignment"] for row in left.rows} == {"none"}
