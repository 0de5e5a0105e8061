"""The calibrated band of an ensemble: on windows that no member read, kept in its file."""

import numpy as np
import pytest
import xarray as xr
from ensembles import INPUTS, STATES, few, wave_run
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from records import arrays_at, table
from said import request_error

from seakeep import Uniform, load_model
from seakeep.core.bands import band_scores, conformal_margin
from seakeep.models.calibration import held_out, learn_margin

DT = 0.1
NOISY = {"ridge": Uniform(200, 400), "delay_rows": "ridge", "seed": 1}


def sea(seed, samples=1600, name="sea"):
    """In noise by which the members' band is too narrow."""
    return wave_run(seed, samples, name, 1.5)


def seas(names):
    """A sea of its own for each name."""
    return {name: sea(seed, 500, name) for seed, name in enumerate(names)}


@pytest.fixture(scope="module")
def run():
    return sea(0)


@pytest.fixture(scope="module")
def ensemble(run):
    spec = few(window=Uniform("10 T", "16 T"), n_members=8, **NOISY)
    return spec.fit(run, STATES, INPUTS, stop=60.0)


SCALES = ["spread", "constant", "learnt"]


@pytest.fixture(scope="module")
def bands(ensemble, run, tmp_path_factory):
    """Calibrated ensembles, from their files."""
    part, folder = run.sel(time=slice(None, 110.0)), tmp_path_factory.mktemp("bands")
    made = {scale: ensemble.calibrate(part, steps=40, scale=scale) for scale in SCALES}
    return {scale: load_model(each.save(folder / scale)) for scale, each in made.items()}


def wide_of(ensemble, run):
    return ensemble.forecast_summary(run, 120.0, 30, band="calibrated")


def assert_kept(kept, ensemble, members):
    """Members of an ensemble are what is left, and forecast as they did."""
    run = sea(3, 300, "other")
    found, every = (table(each.forecast(run, 10.0, 40), STATES) for each in (kept, ensemble))
    assert_array_equal(found, every[members])


@pytest.mark.parametrize("scale", SCALES)
def test_the_calibrated_band_covers_unseen_windows_as_it_says(bands, run, scale):
    inside = {"members": [], "calibrated": []}
    for start in np.arange(112.0, 155.0, 4.0):
        for band, found in inside.items():
            summary = bands[scale].forecast_summary(run, start, 40, band=band)
            _, _, low, high = table(summary, STATES)
            measured = table(run.sel(time=summary["time"], method="nearest"), STATES)
            found.append(((low <= measured) & (measured <= high)).mean())
    assert np.mean(inside["members"]) < 0.6
    # 880 instants, nearly independent noise: a standard error of 0.007, and 0.01 of the margin.
    assert_near(np.mean(inside["calibrated"]), 0.95, 0.036)


def test_the_band_is_a_factor_times_the_spread_with_a_floor(bands, ensemble, run):
    calibrated = bands["spread"]
    plain = ensemble.forecast_summary(run, 120.0, 30)
    wide = wide_of(calibrated, run)
    found = calibrated.calibration
    mean, std, *_ = table(plain, STATES)
    assert np.all(4 * found.floor > 1.5)  # the noise alone
    half = found.conformal.margin * np.sqrt(std**2 + found.floor**2)
    assert_near(table(wide, STATES)[[0, 2, 3]], [mean, mean - half, mean + half], 1e-12)
    assert "calibrated factor times the root" in wide["statistic"].attrs["comment"]


def test_bounds_are_moved_by_a_constant_margin_and_nothing_else(bands, ensemble, run):
    calibrated = bands["constant"]
    plain = ensemble.forecast_summary(run, 120.0, 30)
    wide = wide_of(calibrated, run)
    margin = calibrated.calibration.conformal.margin
    assert (margin > 0).all()
    sides = np.array([0, 0, -1, 1])[:, None, None] + np.zeros((30, 1))
    # One addition: rounding of numbers of about ten.
    assert_near(table(wide, STATES) - table(plain, STATES), sides * margin, 1e-14 * 10)
    assert wide.attrs["band"] == "calibrated"
    xr.testing.assert_identical(plain, calibrated.forecast_summary(run, 120.0, 30))


def test_no_window_touches_what_a_member_has_read(ensemble, bands, run):
    calibrated = bands["constant"]
    (first, last) = ensemble.read_spans["sea"]
    # The longest draw with its delay history, up to stop.
    needed = max(draw.needed(ensemble.signature.input_map) for draw in ensemble.members)
    assert_allclose(last, 60.0)
    assert_allclose(last - first, (needed - 1) * DT)
    reach = ensemble.history_samples - 1
    before = int((round(first / DT) - 1 - reach) // 40)
    after = (1100 - 600) // 40
    assert calibrated.calibration.windows == {"sea": before + after}
    # The scores are those of these windows, the first of them by hand.
    starts = [*(reach * DT + 4.0 * np.arange(before)), *(60.0 + 4.0 * np.arange(after))]
    found = ensemble.summarize_windows(run, starts, 40)
    scores = []
    for window, start in enumerate(starts):
        at, here = round(start / DT), found.isel(window=window)
        _, _, low, high = table(here, STATES)
        scores.append(band_scores(low, high, table(run, STATES)[at + 1 : at + 41]))
    expected = conformal_margin(np.stack(scores), 0.95)
    assert_allclose(calibrated.calibration.conformal.margin, expected.margin, rtol=1e-12)
    # A part that begins after the first sample that a member read is known by its samples.
    part = run.isel(time=slice(round(last / DT) - 200, 1100)).assign_attrs(run="part")
    found = ensemble.calibrate(part, 40).calibration.windows
    assert found == {"part": after}


def test_a_learnt_band_is_the_same_of_windows_of_held_members_and_of_arrays(bands, run):
    learnt = bands["learnt"]
    one = wide_of(learnt, run)
    several = learnt.summarize_windows(run, [115.0, 120.0], 30, band="calibrated")
    arrays = learnt.hold().forecast_arrays(*arrays_at(learnt, run, 120.0), 30, band="calibrated")
    mean, _, _, upper = found = table(one, STATES)
    assert np.all(np.ptp(upper - mean, axis=0) > 0.01 * (upper - mean).mean(axis=0))  # no constant
    # Products of matrices of other sizes: other roundings.
    assert_near(table(several, STATES)[1], found, 1e-9)
    assert_near(arrays.upper, upper, 1e-9)
    assert "learnt from the members' spread" in one["statistic"].attrs["comment"]
    assert "times a learnt scale and a floor of" in learnt.summary()


def pooled(train_on, runs, window=None, inputs=INPUTS):
    return few(window=window, n_members=6, train_on=train_on, **NOISY).fit(runs, STATES, inputs)


def assert_learnt(found, *by_hand):
    """Margin and floor are those of errors of runs, each judged by an ensemble."""
    judged = [held_out({"run": pair}, 40, 0.95)["run"] for pair in by_hand]
    expected, floor, _ = learn_margin(judged, 0.95, "spread")
    assert_allclose(found.conformal.margin, expected.margin, rtol=1e-9)  # rounding
    assert_allclose(found.floor, floor, rtol=1e-9)


def test_folds_are_forecast_by_what_the_other_runs_teach():
    runs = seas("abc")
    ensemble = pooled("all", runs)
    with request_error(r"or let each run .* \(folds='run'"):
        ensemble.calibrate(runs, steps=40)
    found = ensemble.calibrate(runs, steps=40, folds="run").calibration
    # By hand: the same settings fitted anew on the other runs, which none of them has read.
    others = [{key: runs[key] for key in runs if key != name} for name in runs]
    assert_learnt(found, *zip([pooled("all", each) for each in others], runs.values(), strict=True))
    assert found.folds == "run"
    assert found.windows == dict.fromkeys(runs, (500 - ensemble.history_samples) // 40)
    # A run that none has read is forecast by all.
    other = {"other": sea(3, 500, "other")}
    one, two = (ensemble.calibrate(other, 40, folds=folds).calibration for folds in ("run", None))
    assert_array_equal(one.conformal.margin, two.conformal.margin)


def test_a_run_that_repeats_the_judged_one_does_not_train():
    """As in fit and study; where every run repeats it, the others are what there is."""
    runs = {name: sea(seed, 500, name) for name, seed in (("a", 0), ("b", 1), ("c", 1))}
    runs["c"]["heave"] += 0.01 * np.random.default_rng(0).normal(size=500)
    for names, taught in (("abc", "a"), ("bc", "c")):
        ensemble = pooled("all", {name: runs[name] for name in names})
        found = ensemble.calibrate({"b": runs["b"]}, 40, folds="run").calibration
        assert_learnt(found, (pooled("all", {taught: runs[taught]}), runs["b"]))
    # A command that two runs share is no wave that they repeat.
    runs = {name: run.rename(eta="thrust") for name, run in runs.items()}
    others = pooled("all", {name: runs[name] for name in "ac"}, inputs=["thrust"])
    found = pooled("all", runs, inputs=["thrust"]).calibrate({"b": runs["b"]}, 40, folds="run")
    assert_learnt(found.calibration, (others, runs["b"]))


def test_members_that_learn_from_the_run_alone_do_not_forecast_it():
    ensemble = pooled("runs", seas("ab"))
    without = ensemble.without("a")
    assert [each.name for each in without.arrays] == ["b"]
    kept = [number for number, draw in enumerate(ensemble.members) if draw.run == 1]
    assert 0 < without.n_members == len(kept) < 6
    assert_kept(without, ensemble, kept)


def test_a_single_run_is_forecast_in_thirds_by_what_the_rest_of_it_teaches():
    run = sea(0, 900, "a")
    found = pooled("all", {"a": run}).calibrate({"a": run}, 40, folds="run").calibration
    judged = []
    for begin, end in ((0, 300), (300, 600), (600, 900)):
        rest = {"before": run.isel(time=slice(begin)), "after": run.isel(time=slice(end, None))}
        ensemble = pooled("all", {name: each for name, each in rest.items() if each.sizes["time"]})
        judged.append((ensemble, run.isel(time=slice(begin, end))))
    assert_learnt(found, *judged)
    count = (300 - ensemble.history_samples) // 40
    assert found.windows == {f"a, part {number}": count for number in (1, 2, 3)}


def test_members_whose_windows_reach_into_a_third_do_not_forecast_it():
    ensemble = pooled("windows", {"a": sea(0, 900, "a")}, Uniform("4 T", "8 T"))
    before = ensemble.arrays[0].offset  # samples that no member reads
    kept = ensemble.without_part(300 - before, 600 - before)
    spans = [(d.first(0, 900, ensemble.signature.input_map), d.last) for d in ensemble.members]
    free = [number for number, (first, last) in enumerate(spans) if last < 300 or first >= 600]
    assert 0 < len(free) < 6
    assert_kept(kept, ensemble, free)
