"""Predicted surge or none, chosen on training data: the truly better one, and nothing else read."""

from dataclasses import replace

import numpy as np
import pytest
from drifting import DT, INPUTS, STATES, drifting_run

from seakeep import DataError, HankelDMDc, ProbeAlignment, choose_alignment
from seakeep.models import AlignmentChoice

SPEC = HankelDMDc(10, 40, 1e-3, delay_rows="exact", alignment=ProbeAlignment(mode="dispersion"))


def moored_run(seed, samples=1500):
    """As a drifting run, but heave answers the elevation at rest: following the surge spoils it."""
    run = drifting_run(seed, samples)
    wave = run["eta_cog"].values
    lagged = np.interp(run["time"].values - 0.3, run["time"].values, wave)
    run["heave"] = ("time", 0.8 * wave + 0.4 * lagged, {"units": "m"})
    return run


def true_errors(make, training):
    """Error of either candidate on a run that no choice has seen."""
    test = make(9)
    out = {}
    for surge in ("predicted", "none"):
        alignment = replace(SPEC.alignment, surge=surge)
        model = replace(SPEC, alignment=alignment).fit(training, STATES, INPUTS)
        forecast = model.forecast(test, start=30.0, steps=900)
        measured = test.sel(time=forecast["time"])
        out[surge] = float(np.sqrt(np.mean((forecast["heave"] - measured["heave"]) ** 2)))
    return out


@pytest.mark.parametrize(("make", "better"), [(drifting_run, "predicted"), (moored_run, "none")])
@pytest.mark.parametrize("count", [1, 3])
def test_the_truly_better_one_is_chosen(make, better, count):
    training = [make(seed) for seed in range(1, count + 1)]
    choice = choose_alignment(SPEC, training, STATES, INPUTS)
    assert choice.alignment == replace(SPEC.alignment, surge=better)
    assert (choice.difference < 0) is (better == "predicted")
    other = "none" if better == "predicted" else "predicted"
    true = true_errors(make, training)
    assert true[better] < true[other]
    for figure in choice.medians.values():
        assert f"{figure:.3f}" in choice.describe()
    assert len(choice.windows) == len(choice.errors["none"]) == len(choice.errors["predicted"])


def test_the_windows_are_compared_in_pairs():
    errors = {
        "predicted": np.array([0.2, 0.5, 1.4, np.inf]),
        "none": np.array([0.3, 0.6, 1.3, np.inf]),
    }
    choice = AlignmentChoice(ProbeAlignment(), errors, (("run", 0.0),) * 4, 10)
    # Differences −0.1, −0.1, +0.1 and none where both diverged.
    assert choice.difference == pytest.approx(-0.05)
    assert "'predicted' the better one in 2" in choice.describe()


def test_nothing_after_the_stop_is_read():
    run = drifting_run(1)
    stop = 100.0
    expected = choose_alignment(SPEC, run, STATES, INPUTS, stop=stop)
    scrambled = run.copy(deep=True)
    after = scrambled["time"].values > stop
    for name in (*STATES, *INPUTS):
        scrambled[name].values[after] = np.nan
    found = choose_alignment(SPEC, scrambled, STATES, INPUTS, stop=stop)
    assert found.windows == expected.windows
    for surge, each in expected.errors.items():
        np.testing.assert_array_equal(found.errors[surge], each)
    last = max(start for _, start in expected.windows) + expected.steps * DT
    assert last <= stop + 1e-9


def test_each_run_is_forecast_by_the_others_alone():
    """What a run holds after a window changes no forecast of it: it does not train its model."""
    runs = {str(seed): drifting_run(seed) for seed in (1, 2)}
    expected = choose_alignment(SPEC, runs, STATES, INPUTS, steps=200)
    first = next(start for name, start in expected.windows if name == "1")
    changed = runs["1"].copy(deep=True)
    late = changed["time"].values > first + 201 * DT
    changed["heave"].values[late] *= 3.0
    found = choose_alignment(SPEC, {**runs, "1": changed}, STATES, INPUTS, steps=200)
    at = expected.windows.index(("1", first))
    for surge in ("predicted", "none"):
        assert found.errors[surge][at] == pytest.approx(expected.errors[surge][at], rel=1e-9)
        assert not np.allclose(found.errors[surge], expected.errors[surge])


def test_cost_is_bounded(monkeypatch):
    runs = {str(seed): drifting_run(seed, samples=600) for seed in range(1, 8)}
    fits = []
    fit = HankelDMDc.fit
    monkeypatch.setattr(HankelDMDc, "fit", lambda *a, **k: (fits.append(a), fit(*a, **k))[1])
    choice = choose_alignment(SPEC, runs, STATES, INPUTS, steps=40)
    assert len(fits) == 8  # four folds, two candidates
    assert len(choice.windows) == 24
    assert {name for name, _ in choice.windows} == {"1", "3", "5", "7"}


def test_windows_with_gaps_are_left_out():
    run = drifting_run(1)
    whole = choose_alignment(SPEC, run, STATES, INPUTS, steps=50)
    gap = 1200
    run["heave"].values[gap] = np.nan
    left = choose_alignment(SPEC, run, STATES, INPUTS, steps=50)
    reach = SPEC.history_samples, 50
    hit = [
        each
        for each in whole.windows
        if -reach[0] * DT <= gap * DT - each[1] - 1e-9 <= reach[1] * DT
    ]
    assert hit
    assert [each for each in whole.windows if each not in hit] == list(left.windows)


def test_data_that_cannot_decide_are_refused():
    with pytest.raises(DataError, match="less than one encounter period"):
        choose_alignment(SPEC, drifting_run(1, samples=55), STATES, INPUTS)
    run = drifting_run(1)
    run["eta_cog"].values[1000::20] = np.nan
    with pytest.raises(DataError, match="every window of the data held out"):
        choose_alignment(SPEC, run, STATES, INPUTS)
