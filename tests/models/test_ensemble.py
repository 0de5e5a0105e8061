import dataclasses
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from ensembles import INPUTS, STATES, few, wave_run
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from records import arrays_at, fed, record, table
from said import data_error, warned
from scipy import stats
from xarray.testing import assert_equal, assert_identical

from seakeep import HankelDMDc, LogUniform, Uniform, summarize
from seakeep.models import engine, forecasts
from seakeep.models.ensemble import child

PERIOD, DT = 1.6, 0.1  # 16 samples per period


@pytest.fixture(scope="module")
def run():
    return wave_run()


def small(**changes):
    settings = {"window": Uniform("8 T", "14 T"), "ridge": Uniform(0.5, 5), "delay_rows": "ridge"}
    return few(**settings | {"n_members": 6, "seed": 3} | changes)


def fitted(run, **changes):
    return small(**changes).fit(run, STATES, INPUTS, stop=60.0)


STABLE = Uniform(200, 400)
"""λ at which all members of these tests are stable."""


def test_the_mean_of_a_centred_ensemble_is_the_single_model_and_its_spread_stays():
    runs, unseen = {name: wave_run(seed) for seed, name in enumerate("abc")}, wave_run(7)
    spec = small(train_on="windows", ridge=LogUniform(1, 100), delay_rows="exact", lead=4)
    settings = dataclasses.replace(spec.central(DT), window=None)
    single = settings.fit(runs, STATES, INPUTS)
    apart, centred = (
        dataclasses.replace(spec, centred=each).fit(runs, STATES, INPUTS) for each in (False, True)
    )
    wanted = table(apart.forecast_summary(unseen, 65.0, 120), STATES)
    expected = table(single.forecast(unseen, 65.0, 120), STATES)
    moved = expected - wanted[0]
    assert np.abs(moved).max() > 1e-3
    wanted[[0, 2, 3]] += moved  # all but the standard deviation
    close = 1e-12  # rounding of the sums
    assert_near(table(centred.forecast_summary(unseen, 65.0, 120), STATES), wanted, close)
    x, u, ahead = arrays_at(centred, unseen, 65.0)
    assert_near(centred.hold().forecast_arrays(x, u, ahead, 120)[:4], wanted, close)
    live = fed(centred.live(), u, x)
    mean, std, *_ = table(live.forecast(120, ahead), STATES)
    assert_near(mean, expected, close)
    one_step = table(single.forecast(unseen, 64.6, 1), STATES)[0]
    assert_near(live.innovation, x[-4] - one_step, close)  # three wait for waves ahead
    both = np.hypot(wanted[1], live.errors.at(np.arange(1, 121)))  # of members, and of any model
    assert_allclose(std, both, rtol=1e-9)
    left = centred.without("b").forecast_summary(unseen, 65.0, 120)
    two = settings.fit({name: runs[name] for name in "ac"}, STATES, INPUTS)
    expected = table(two.forecast(unseen, 65.0, 120), STATES)
    assert_near(table(left, STATES)[0], expected, close)


def test_draws_are_rounded_to_the_nearest_sample(run):
    draws = fitted(run).draws
    for name in ("window", "state_delays", "input_delays"):
        assert_array_equal(draws[f"{name}_samples"], np.floor(draws[name] * PERIOD / DT + 0.5))


@pytest.mark.parametrize("sampling", ["monte_carlo", "sobol"])
def test_a_member_does_not_depend_on_the_number_of_members(run, sampling):
    six = fitted(run, sampling=sampling).draws
    assert_equal(six, fitted(run, sampling=sampling, n_members=8).draws.isel(member=slice(6)))
    assert not np.allclose(six.ridge, fitted(run, sampling=sampling, seed=4).draws.ridge)


def test_sobol_points_fill_the_prior_evenly(run):
    draws = fitted(run, sampling="sobol", n_members=16).draws
    # One point in each sixteenth of each margin: the property of the net.
    cells = np.floor((draws.ridge.values - 0.5) / 4.5 * 16).astype(int)
    assert sorted(cells) == list(range(16))


def test_infeasible_draws_are_drawn_again_and_counted(run):
    # 60 s are 601 samples: windows of up to 40 periods ask for up to 640 and their history.
    draws = fitted(run, window=Uniform("30 T", "40 T"), n_members=20).draws
    reach = np.maximum(draws.state_delays_samples, draws.input_delays_samples)
    assert np.all(draws.window_samples + reach <= 601)
    assert draws.attrs["redrawn"] == int(draws.redrawn.sum()) > 0


def test_priors_that_never_fit_are_refused(run):
    text = (
        r"no feasible draw in 1000: the shortest run has 601 samples up to stop, and the last "
        r"draw asked for \d+ \(window 800, .*\). Give longer runs or a later stop, or narrow"
    )
    with data_error(text):
        fitted(run, window="50 T")


def test_the_seed_may_be_a_sequence_or_a_generator(run):
    sequence = np.random.SeedSequence(3)
    assert_equal(fitted(run).draws, fitted(run, seed=sequence).draws)
    assert sequence.n_children_spawned == 0
    spec = small(seed=default_rng(1), lead="0.2 T")
    first, second = (spec.fit(run, STATES, INPUTS, stop=60.0).draws for _ in range(2))
    assert_identical(first, second)
    assert child(sequence, 2).random() == default_rng(sequence.spawn(3)[2]).random()


def test_the_summary_is_that_of_the_members(run, monkeypatch):
    ensemble = fitted(run, ridge=STABLE)
    members = ensemble.forecast(run, start=65.0, steps=77)
    expected, values = summarize(members, level=0.9), table(members, STATES)
    _, std, lower, _ = table(expected, STATES)
    assert_allclose(lower, np.quantile(values, 0.05, axis=0), rtol=1e-12)
    assert_allclose(std, values.std(axis=0, ddof=1), rtol=1e-12)
    for held, chunk in ((2**25, 2**23), (0, 1500)):
        monkeypatch.setattr(engine, "HELD", held)
        monkeypatch.setattr(forecasts, "CHUNK", chunk)
        found = ensemble.forecast_summary(run, start=65.0, steps=77, level=0.9)
        assert_array_equal(table(found, STATES), table(expected, STATES))
    assert (found.members, found.diverged, found.level) == (6, 0, 0.9)


def test_windows_side_by_side_equal_single_forecasts(run):
    ensemble = fitted(run)
    starts = [65.0, 70.3]
    together = ensemble.forecast_windows(run, starts, steps=60)
    assert dict(together.sizes) == {"window": 2, "member": 6, "lead": 60}
    for window, start in enumerate(starts):
        single = ensemble.forecast(run, start=start, steps=60)
        # Two windows are one product: other roundings.
        assert_near(table(together, STATES)[window], table(single, STATES), 1e-10)
    judged, _ = ensemble.judged_runs(run, "run", [650, 703], 60)
    assert_near(judged, table(together, STATES).mean(axis=1), 1e-10)
    summary = ensemble.summarize_windows(run, starts, steps=60)
    expected = summarize(together)
    assert_array_equal(table(summary, STATES), table(expected, STATES))
    one = summarize(together.assign_coords(window=[3, 4]).isel(window=1))
    assert one.window == 4
    assert_array_equal(table(one, STATES), table(expected, STATES)[1])


def test_the_frequentist_ensemble_differs_in_its_windows_alone(run):
    fixed = {
        "window": "10 T",
        "state_delays": "0.5 T",
        "input_delays": "1 T",
        "ridge": 1,
    }
    ensemble = fitted(run, train_on="windows", **fixed)
    draws = ensemble.draws
    assert len(np.unique(draws.last_sample)) == 6
    assert draws.last_sample.min() >= 160 + 16 - 1
    assert draws.last_sample.max() <= 600
    last = float(run.time[int(draws.last_sample[1])])
    expected = HankelDMDc(8, 16, 1.0, window=160).fit(run, STATES, INPUTS, stop=last)
    assert_near(ensemble.member(1).A, expected.A, 1e-10)
    assert_allclose(ensemble.member(1).training.stop, (last,))
    shortest = run.isel(time=slice(160 + 16))  # which leaves one place for the window
    found = small(train_on="windows", **fixed).fit(shortest, STATES, INPUTS)
    assert set(found.draws.last_sample.values) == {175}


def test_members_that_diverge_say_when():
    # Explosive data make explosive members.
    rng = default_rng(0)
    time = DT * np.arange(300)
    growth = np.exp(2.5 * time) * np.cos(5 * time) * 1e-9
    heave = growth + 1e-12 * rng.normal(size=300)
    pitch, eta = rng.normal(size=(2, 300))
    run = record(DT, heave=heave, pitch=pitch, eta=eta)
    ensemble = small(window="10 T", ridge=1e-3, n_members=10).fit(run, STATES, INPUTS, stop=20.0)
    forecast = ensemble.forecast(run, start=20.0, steps=99)
    summary = ensemble.forecast_summary(run, start=20.0, steps=99)
    lost = np.isnan(forecast.heave).any("time").values
    assert lost.any()
    gone = forecast.time.values[np.isnan(forecast.heave).values.argmax(axis=1)]
    said = [float(text.split()[4]) for text in forecast.status.values[lost]]
    assert_near(said, gone[lost], 5e-3)  # as many digits as the step asks
    assert_array_equal(summary.status, forecast.status)
    assert summary.attrs["diverged"] == forecast.attrs["diverged"] == lost.sum()
    assert forecast.attrs["status"] == f"{lost.sum()} of 10 members diverged"
    with warned(r"\d+ of 10 members have a spectral radius of one or mor"):
        radii = ensemble.spectral_radii()
    assert np.all(radii[lost] > 1)
    assert f"({np.sum(radii >= 1)} of 10 UNSTABLE: their long forecasts" in ensemble.summary()


def test_spectral_radii_are_those_of_the_members(run):
    ensemble = fitted(run, ridge=STABLE)
    # The same matrix through the same routine; memory may lie otherwise.
    expected = [ensemble.member(number).spectral_radius for number in range(6)]
    told = []
    found = ensemble.spectral_radii(
        executor=ThreadPoolExecutor(2), progress=lambda *step: told.append(step)
    )
    assert_allclose(found, expected, rtol=1e-12)
    assert told == [(k, 6, f"member {k}") for k in range(1, 7)]


def test_training_spans_are_those_of_the_members(run):
    runs = {"one": run, "two": wave_run(1)}
    for train_on in ("all", "runs", "windows"):
        ensemble = small(train_on=train_on, n_members=8).fit(runs, STATES, INPUTS, stop=60.0)
        spans = [ensemble.member(number).training_spans for number in range(8)]
        for name, found in ensemble.training_spans.items():
            firsts, stops = zip(*[each[name] for each in spans if name in each], strict=True)
            assert found == (min(firsts), max(stops))


def test_forecasts_carry_the_spread_that_tells_a_slack_channel(run):
    ensemble = fitted(run)
    pooled = np.concatenate([each.states for each in ensemble.arrays]).std(axis=0, ddof=1)
    for forecast in (
        ensemble.forecast(run, 65.0, 5),
        ensemble.forecast_summary(run, 65.0, 5),
        ensemble.summarize_windows(run, [65.0], 5),
    ):
        found = [forecast[name].attrs["training_std"] for name in STATES]
        assert_allclose(found, pooled, rtol=1e-13)  # the order of a sum


def test_draws_are_quantiles_of_any_distribution_of_scipy(run):
    prior = stats.truncnorm(-2, 2, loc=11, scale=1)
    draws = fitted(run, window=prior, ridge=stats.gamma(2.0)).draws
    for member in range(6):
        quantiles = child(np.random.SeedSequence(3), member).random(4)
        assert draws.window[member] == prior.ppf(quantiles[0])
        assert draws.ridge[member] == stats.gamma(2.0).ppf(quantiles[3])
