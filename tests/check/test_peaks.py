"""Peaks of responses: laws against scipy, intervals by simulation, and where the sea is another."""

import numpy as np
import pytest
import scipy
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose
from records import record
from seas import sea

from seakeep import HankelDMDc, check
from seakeep.check.peaks import fit_weibull, most_probable_extreme
from seakeep.study import to_full_scale


def sea_run(height=0.04, period=2.0, seed=0, **attrs):
    """A narrow sea, and a heave that follows it a sample later."""
    waves = sea(seed, (0.8 / period, 1.2 / period), period, 60).at(0.1 * np.arange(3000))
    wave = height / 4 * waves / waves.std()
    heave = 0.8 * np.roll(wave, 1) + 1e-5 * default_rng(seed).standard_normal(3000)
    attrs = {"encounter_period": period, "waves": "irregular", "water_depth": np.inf, **attrs}
    return record(0.1, attrs, eta=wave, heave=heave)


@pytest.fixture(scope="module")
def train():
    return sea_run(run="train")


@pytest.fixture(scope="module")
def model(train):
    return HankelDMDc(0, 1, 1e-6, delay_rows="exact").fit({"train": train}, ["heave"], ["eta"])


def test_weibull_is_that_of_scipy():
    peaks = 2.0 * default_rng(0).weibull(1.7, 400)
    found = fit_weibull(peaks)
    shape, _, scale = scipy.stats.weibull_min.fit(peaks, floc=0)
    # scipy keeps the bias of maximum likelihood, and stops at 1e-4.
    assert_allclose(found.shape / (1 - 1.38 / 400), shape, rtol=1e-3)
    assert_allclose(found.scale, scale, rtol=3e-3)  # of a shape without bias


def test_intervals_of_the_extreme_cover_as_they_say():
    rng = default_rng(4)
    true = 2.0 * np.log(1000) ** (1 / 1.7)
    inside = []
    for _ in range(500):
        _, low, high = most_probable_extreme(fit_weibull(2.0 * rng.weibull(1.7, 60)), 1000)
        inside.append(low < true < high)
    # 500 repetitions know a coverage of 95 % to 1 % (one SD).
    assert 0.92 <= np.mean(inside) <= 0.98


def test_statistics_of_a_narrow_sea_are_those_of_rayleigh(model):
    found = check.statistics(model, {"test": sea_run(seed=3, scale_factor=36.0)}).sel(state="heave")
    assert_allclose(found.attrs["duration"], 3 * 3600 / 6)
    assert_allclose(found.significant_double_amplitude, 0.032, rtol=0.01)
    assert_allclose(found.zero_crossing_period, 2.0, rtol=0.05)
    assert_near(found.weibull_shape, 2.0, 0.5)
    at = found.sel(kind="measured")
    assert at.extreme_lower < 0.008 * np.sqrt(2 * np.log(900)) < at.extreme_upper
    above = np.exp(-((at.peak.max() / at.weibull_scale) ** at.weibull_shape))
    assert_allclose(at.extreme_chance, 1 - (1 - above) ** at.peaks, rtol=1e-6)
    step = float(found.deviation[1] - found.deviation[0])
    assert_near(step * found.density.sum("place"), 1.0, 0.01)
    assert 0 <= found.divergence < 0.01  # the model follows the sea
    ranked = found.peak.sel(kind="forecast").values
    assert np.all(np.diff(ranked[np.isfinite(ranked)]) <= 0)


def test_troughs_have_a_law_of_their_own(model, train):
    run = sea_run(seed=3)
    run["heave"] = run.heave.where(run.heave > 0, 1.5 * run.heave)
    found, turned = (
        check.statistics(model, {"test": run.assign(heave=sign * run.heave)}).sel(kind="measured")
        for sign in (1, -1)
    )
    # Half a wave more or less at either end, and the mean.
    assert_allclose(found.trough, turned.extreme, rtol=0.02)
    assert_allclose(found.trough_chance, turned.extreme_chance, rtol=0.1)
    assert 1.3 * found.extreme < found.trough
    load = train.assign(load=train.heave.assign_attrs(units="N"))
    own = model.settings.fit({"train": load}, ["load"], ["eta"])
    assert check.statistics(own, {"test": load}).trough.isnull().all()


def test_statistics_at_full_scale_follow_froudes_law(model, train):
    run = sea_run(seed=3, scale_factor=36.0)
    own = model.settings.fit({"train": to_full_scale(train, 36.0)}, ["heave"], ["eta"])
    found = check.statistics(own, {"test": to_full_scale(run, 36.0)})
    expected = check.statistics(model, {"test": run})
    assert_allclose(found.attrs["duration"], 3 * 3600)
    for key, factor in {"extreme": 36.0, "mean": 36.0, "zero_crossing_period": 6.0}.items():
        assert_allclose(found[key], factor * expected[key].values, rtol=1e-6)


def test_noise_of_a_sensor_makes_no_peaks(model):
    run = sea_run(seed=3)
    run["heave"] = run.heave + 5.0
    noise = 0.2 * float(run.heave.std())
    run["heave"] = run.heave + noise * default_rng(0).standard_normal(3000)
    run.heave.attrs = {"units": "m", "noise_std": noise}
    found = check.statistics(model, {"test": run}).sel(state="heave")
    # 150 waves, of which a band of 0.4 SD hides a few; noise without the band makes a third more.
    assert_allclose(found.zero_crossing_period.sel(kind="measured"), 2.0, rtol=0.08)
    assert_near(found["mean"].sel(kind="measured"), 5.0, 1e-3)


def test_waves_outside_the_training_are_named(model, train):
    runs = {
        "train": train,
        "alike": sea_run(seed=1),
        "steep": sea_run(height=0.08, seed=5),
        "short": sea_run(period=1.0, seed=2, encounter_period=1.0),
    }
    found = check.validity(model, runs)
    told = dict(zip(found.run.values, found.outside.values, strict=True))
    assert told["train"] == told["alike"] == ""
    assert "a height of 0.08" in told["steep"]
    assert "outside the periods that trained the model" in told["short"]
    assert "steepness" in told["short"]
    assert_allclose(found.height.sel(run="train", part="train"), 0.04, rtol=0.01)


@pytest.mark.parametrize("name", ["eta_fwd", "thrust"])
def test_periods_of_an_input_that_is_still_are_judged_of_waves_alone(name):
    t = np.arange(0, 200, 0.1)
    run = record(0.1, heave=np.sin(1.2 * t), **{name: np.sin(1.5 * t)})
    model = HankelDMDc(2, 2, 1e-3).fit(run, ["heave"], [name])
    for size, judged in ((0.2, True), (0.01, name == "eta_fwd")):
        found = model.coverage.conditions(size * np.sin(6.0 * t)[:, None], model.signature)
        assert found.reasons[0, 0] == judged
