"""A model in service: estimates, forecasts and states to go on from, sample by sample."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from drifting import FOLLOWED, INPUTS, SQUARES, STATES
from ensembles import few
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from records import fed, record, rms, table
from said import request_error
from scipy import signal, stats
from threadpoolctl import threadpool_info, threadpool_limits

import seakeep.models.live
from seakeep import HankelDMDc, Powers, load_live
from seakeep.core.kalman import DelayFilter
from seakeep.models.live import CONSISTENCY, LEAST_RECORD, MOTIONS
from seakeep.models.validity import Validity
from seakeep.signals import predict_waves
from seakeep.signals.prediction import foresee
from seakeep.study import nowcast
from seakeep.waves import group_speed

START, STEPS = 500, 60  # the record that is kept holds all samples up to there
LAST = 49.9  # s, the newest of them
SETTINGS = {
    "plain": {},
    "lead": {"lead": 6},
    "aligned": {
        "lead": 6,
        "memory": 40,
        "alignment": FOLLOWED,
        "observables": (SQUARES, Powers("eta_fwd")),
    },
}


in_place_and_carried = pytest.mark.parametrize("key", ["plain", "aligned"])


@pytest.fixture(scope="module")
def models(drifts):
    return {
        key: HankelDMDc(4, 12, 1.0, **{"delay_rows": "exact"} | each).fit(drifts, STATES, INPUTS)
        for key, each in SETTINGS.items()
    }


@pytest.fixture(scope="module")
def model(models):
    return models["plain"]


def play(live, run, first, stop, lost=(), dead=()):
    """Step through samples; those that are `lost`, and `dead` channels, are not measured."""
    u, y = table(run, INPUTS), table(run, STATES)
    for name in dead:
        y[:, STATES.index(name)] = np.nan
    return np.array([live.step(u[at], None if at in lost else y[at]) for at in range(first, stop)])


def started(model, run, stop=START):
    live = model.live(like=run)
    play(live, run, 0, stop)
    return live


@pytest.fixture
def waves(drift):
    return table(drift, INPUTS)


@pytest.fixture
def motions(drift):
    return table(drift, STATES)


@pytest.fixture
def live(model, drift):
    return started(model, drift)


def driven(live, run):
    """Forecast under the waves that were measured."""
    return live.forecast(STEPS, table(run, INPUTS)[START:])


def mean(forecast, statistic="mean"):
    return table(forecast.sel(statistic=statistic), STATES)


def std(forecast):
    return mean(forecast, "std")


@pytest.mark.parametrize("key", SETTINGS)
def test_fed_with_everything_it_is_the_forecast(models, drift, key, motions):
    model = models[key]
    live = started(model, drift)
    found = driven(live, drift)
    expected = model.forecast(drift, start=LAST, steps=STEPS)
    # The same numbers go through the same products; an instant differs by the rounding of its sum.
    assert_array_equal(mean(found), table(expected, STATES))
    assert_array_equal(live.state, motions[START - 1])
    assert not live.covariance.any()
    play(live, drift, START, START + max(model.signature.lead_samples, 1))  # and then it is final
    # One-step predictions in physical units, and the forecast in deviations: rounding.
    assert_near(live.innovation, motions[START] - table(expected, STATES)[0], 1e-9)


def test_without_states_the_estimate_and_its_error_are_those_of_the_open_loop(
    model, live, drift, waves
):
    lost = 120
    expected = table(model.forecast(drift, start=LAST, steps=lost), STATES)
    for since in range(1, lost + 1):
        at = START + since - 1
        (estimate,) = play(live, drift, at, at + 1, lost=[at])
        # One-step predictions in physical units, and the forecast in deviations: rounding adds up.
        assert_near(estimate, expected[since - 1], 1e-9)
        assert_allclose(np.sqrt(np.diagonal(live.covariance)), model.errors.at(since), rtol=1e-9)
    found = live.forecast(10, waves[START + lost :])
    assert_allclose(std(found), model.errors.at(lost + np.arange(1, 11)), rtol=1e-9)


def test_errors_are_those_of_data_that_were_not_trained_on():
    """Of p coefficients from n rows, the residual holds σ²(1 − p/n), a new error σ²(1 + p/n)."""
    found, rng = [], default_rng(0)
    for _ in range(100):
        heave, wave = rng.standard_normal((2, 105))
        noise = record(1.0, heave=heave, eta_fwd=wave)
        found.append(HankelDMDc(4, 4, 1e-9).fit(noise, ["heave"], ["eta_fwd"]).errors.residual)
    # 100 rows of 10 coefficients; 100 repetitions tell a variance to 1.4 %.
    assert_allclose(np.mean(found), 1.1, rtol=0.05)


def test_a_dead_sensor_is_followed_through_the_others(model, live, drift, waves, motions):
    steps = 200
    found = play(live, drift, START, START + steps, dead=["heave"])
    truth = motions[START : START + steps]
    assert_array_equal(found[:, 0], truth[:, 0])
    assert_array_equal(np.isnan(live.innovation), [False, True])
    deviation = np.sqrt(live.covariance[1, 1])
    assert 0 < deviation < 1.001 * model.errors.at(steps)[1]
    assert rms(found[:, 1] - truth[:, 1]) < 3 * deviation
    forecast = live.forecast(STEPS, waves[START + steps :])
    own, bound = (model.errors.of_forecast(STEPS, since) for since in (0, steps))
    carried = np.minimum(own + live._filter.ahead(STEPS, live._raised), bound)
    assert_allclose(std(forecast) ** 2, carried, rtol=1e-9)
    assert np.any(carried > 1.1 * own)
    assert np.any(carried < 0.9 * bound)
    again = play(live, drift, START + steps, START + steps + 5)
    assert_array_equal(again[-1], motions[START + steps + 4])
    assert not live.covariance.any()


def test_before_the_history_is_there_nothing_is_known_of_a_dead_sensor(model, drift):
    live = model.live(like=drift)
    play(live, drift, 0, 5, dead=["heave"])
    assert_allclose(np.sqrt(live.covariance[1, 1]), model.state_scale.spread[1], rtol=1e-12)


def test_errors_of_an_estimate_last_as_those_of_free_runs_do(live, drift):
    free = DelayFilter(live._a, live._filter.process, live._noise)
    rms = live.errors.rms
    for _ in rms:
        free.shift()
    added_up = np.sqrt(np.diagonal(free.covariance)[-2:])
    live.errors = replace(live.errors, rms=9 * rms)  # which limit nothing
    play(live, drift, START, START + 60, dead=["heave"])
    known = np.sqrt(live._filter.covariance[-1, -1])
    expected = known * rms[-1, 1] / added_up[1]
    assert_allclose(np.sqrt(live.covariance[1, 1]), expected, rtol=1e-9)  # rounding of sums
    assert expected > 1.5 * known


def test_measurement_noise_makes_an_estimate_of_a_measured_state(model, drift):
    noise = {"heave": 0.05, "surge": 0.02}
    live = model.live(noise=noise)
    rough = drift.copy(deep=True)
    rough["heave"].values += noise["heave"] * default_rng(1).standard_normal(drift.sizes["time"])
    found = play(live, rough, 0, START)[200:, 1]
    truth = drift["heave"].values[200:START]
    assert np.std(found - truth) < 0.9 * np.std(rough["heave"].values[200:START] - truth)


def test_consistency_names_the_state_and_shows_in_free_runs_what_one_step_hides():
    """Of two states that each follow x' = .98 x + b u + w, one is pushed by .7 SD of w for good."""

    def sea(seed, push, samples=1500):
        rng = default_rng(seed)
        wave, noise = rng.standard_normal(samples), rng.standard_normal((samples, 2))
        forced = 0.5 * wave[:, None] + noise
        forced[:, 0] += push
        x = signal.lfilter([0.0, 1.0], [1.0, -0.98], forced, axis=0)
        return record(0.1, sway=x[:, 0], heave=x[:, 1], eta_fwd=wave)

    model = HankelDMDc(0, 0, 1e-6, delay_rows="exact").fit(
        sea(1, 0.0, 20_000), ["sway", "heave"], ["eta_fwd"]
    )

    def after(push):
        run = sea(2, push)
        live = fed(model.live(), table(run, ["eta_fwd"]), table(run, ["sway", "heave"]))
        return live, live.forecast(32, np.zeros((32, 1)))

    (sound, calm), (drifting, pushed) = after(0.0), after(0.7)
    # 256 squares of a normal number have a mean of 1 ± 0.09 (SD); those of free runs, which are
    # alike within some dozens of samples, of 1 ± 0.4.
    assert_near(sound.consistency, 1.0, 0.3)
    one_step, free = sound.consistency_by_state
    assert_near(one_step, 1.0, 0.3)
    assert np.all((free > 0.2) & (free < 2.2))
    one_step, (sway, heave) = drifting.consistency_by_state
    assert_near(one_step, [1.49, 1.0], 0.4)
    # At a lead of 64: 0.49 (1 − .98⁶⁴)² / .02² of the push over (1 − .98¹²⁸) / .0396 of w.
    assert sway > 5 > 2.2 > heave > 0.2
    assert_allclose(drifting.consistency, drifting.consistency_by_state.mean())
    # The state that errs is named, its claims shrink by the errors of late, and the other's not.
    assert (sound.validity, drifting.validity) == (0, Validity.CONSISTENCY)
    assert [each.attrs["validity"] for each in (calm, pushed)] == ["inside", "consistency"]
    widened = table((pushed / calm).sel(statistic="std"), ["sway", "heave"])[0]
    assert_allclose(widened, [np.sqrt(sway), 1.0], rtol=1e-9)
    assert pushed.sway.attrs["lead_time"] < calm.sway.attrs["lead_time"]
    # A push of 2 SD adds 4 to the squares of one step. If it began 400 samples ago it shows (over
    # all samples, as 0.5); if it ended 330 ago, 256 and a free run of 64 or more, it is forgotten,
    # of which running means would keep e^(−330/256) = .28.
    begun, _ = after(np.where(np.arange(1500) < 1100, 0.0, 2.0))
    assert_near(begun.consistency_by_state[0, 0], 1 + 4 * (1 - np.exp(-400 / 256)), 1)
    ended, _ = after(np.where(np.arange(1500) < 1170, 2.0, 0.0))
    assert_near(ended.consistency_by_state[0, 0], 1.0, 0.3)
    assert ended.validity == Validity(0)


def test_no_claim_exceeds_what_errors_of_late_and_departures_allow(model, drift, monkeypatch):
    loud = drift.map(lambda x: 1.5 * x, keep_attrs=True)
    live, of_late = started(model, loud), np.ones((2, len(STATES)))
    monkeypatch.setattr(type(live), "consistency_by_state", of_late)
    calm = driven(live, loud)
    scale = model.signature.state_scale
    away = table(loud, STATES)[:START] - scale.centre
    usual = np.maximum(scale.spread**2, np.mean(away**2, axis=0))
    most = np.sqrt(usual + (mean(calm) - scale.centre) ** 2)
    assert np.all(1e3 * std(calm)[-1] > most[-1])
    of_late[0] = 1e6  # one step ahead alone
    assert_allclose(std(driven(live, loud)), np.minimum(1e3 * std(calm), most), rtol=1e-9)
    of_late[1] = 1e6  # in free runs too
    assert_allclose(std(driven(live, loud)), 1e3 * std(calm), rtol=1e-9)


def test_outside_the_training_the_band_widens_and_says_why(model, drift, monkeypatch):
    higher = drift.map(lambda x: 1.7 * x, keep_attrs=True)
    stds = []
    for each in (drift, higher):
        live = started(model, each)
        made = driven(live, each)
        stds.append(std(made))
    assert Validity.HEIGHT in live.conditions.validity
    assert "a height of" in repr(live.conditions)
    assert "height" in made.attrs["validity"]
    waves = table(higher, INPUTS)[:START]
    waves = waves - waves.mean(axis=0)
    heights = 4 * np.sqrt(np.mean(waves**4, axis=0) / (3 * np.mean(waves**2, axis=0)))
    assert_allclose(made.attrs["height"], heights, rtol=1e-12)
    ratio = np.max(heights / made.attrs["trained_height"])
    of_late = np.maximum(live.consistency_by_state.max(axis=0), ratio**2)
    # Beside the rounding, nothing but the two reasons widens the band.
    assert_allclose(stds[1], np.sqrt(of_late) * stds[0], rtol=1e-12)
    assert ratio > 1.3
    drifted = model.live()
    play(drifted, drift.assign(surge=drift.surge + 5), 0, START)
    assert drifted.conditions.validity == Validity.SURGE
    # Without errors of late, the height alone.
    monkeypatch.setattr(type(live), "consistency_by_state", np.ones((2, len(STATES))))
    made = driven(live, higher)
    assert_allclose(std(made), ratio * model.errors.at(np.arange(STEPS) + 1), rtol=1e-12)


@in_place_and_carried
@pytest.mark.parametrize(
    ("name", "flag"), [(INPUTS[1], Validity.LOST), ("heave", Validity.CONSISTENCY)]
)
def test_a_sample_that_jumps_is_lost_and_named(models, drift, tmp_path, key, name, flag):
    spiked, lost = started(models[key], drift), started(models[key], drift)
    assert spiked.validity == Validity(0)
    spiked = load_live(models[key], spiked.save(tmp_path / "live.nc"))
    far = drift[name].values[START] + 8 * drift[name].std()
    for value, live in ((far, spiked), (np.nan, lost)):
        other = drift.copy(deep=True)
        other[name].values[START] = value
        play(live, other, START, START + 1)
    assert [spiked.jumped, lost.jumped] == [(name,), ()]
    assert_array_equal(spiked.state, lost.state)
    assert flag in spiked.validity
    for live in (spiked, lost):
        play(live, drift, START + 1, START + 60)
    assert spiked.jumped == ()
    assert_array_equal(mean(spiked.forecast(STEPS)), mean(lost.forecast(STEPS)))
    assert spiked.validity == lost.validity == Validity(0)


def test_a_load_may_jump_and_so_may_an_input_that_is_no_wave(model):
    units = [label.units for label in model.signature.state_labels]
    least = model.live(roles={INPUTS[0]: "constant"}).equations["smoothest"]
    assert_array_equal(np.isinf(least), [True, False, *(each not in MOTIONS for each in units)])
    assert_allclose(4 * least[1], 0.01 * model.coverage.heights[1], rtol=1e-12)


def test_filled_waves_drive_no_free_run(model, waves, motions):
    live, gaps = model.live(), model.live()
    for at in range(2 * START):
        is_lost = at >= START and at % live.model.history_samples == 0
        live.step(None if is_lost else waves[at], motions[at])
        hole = at > 4 and at % live.model.history_samples == 0
        gaps.step(None if hole else waves[at], motions[at])
        if at == START:
            before = live.consistency_by_state[1]
    assert np.all(before != 1)
    assert np.isnan(gaps.consistency_by_state[1]).all()
    # What is not judged is forgotten.
    assert np.all(np.abs(live.consistency_by_state[1] - 1) < 0.3 * np.abs(before - 1))


def test_waves_that_were_filled_from_few_samples_judge_nothing(model, waves, motions):
    begins, live = model.history_samples, model.live()
    for at in range(2 * begins + 20):
        live.step(None if at == 5 else waves[at], motions[at])
        one_step = live.consistency_by_state[0]
        assert np.isnan(one_step).any() or at > begins + 5
    assert np.all(np.isfinite(one_step))


@pytest.mark.parametrize("value", [9.97e36, 1e200])
def test_a_spike_is_forgotten_by_the_consistency(model, drift, value, monkeypatch):
    monkeypatch.setattr(seakeep.models.live, "MOTIONS", ())
    live = started(model, drift)
    spoilt = drift.copy(deep=True)
    spoilt["heave"].values[START] = value
    play(live, spoilt, START, START + 5)
    assert 0.3 < live.consistency < 10  # 100 / 256 for each of some samples
    play(live, drift, START + 5, START + 600)
    assert 0.5 < live.consistency < 1.5


def test_waves_that_are_not_known_widen_the_band(models, drift, waves):
    live = started(models["lead"], drift)
    known, unknown = driven(live, drift), live.forecast(STEPS)
    part = live.forecast(STEPS, waves[START : START + 20])
    assert [each.attrs["known_input"] for each in (known, part, unknown)] == [STEPS + 5, 20, 0]
    least, more, most = map(std, (known, part, unknown))
    assert_allclose(more[:14], least[:14], rtol=1e-6)
    assert np.all(most[6:20] > more[6:20])
    assert np.all(np.minimum(more, most)[-20:] > least[-20:])
    for name in STATES:
        leads = [each[name].attrs["lead_time"] for each in (unknown, part, known)]
        assert leads == sorted(leads)
    width = mean(known, "upper") - mean(known, "lower")
    assert_allclose(width, 2 * stats.t.ppf(0.975, 48) * least, rtol=1e-6)


def test_a_band_that_is_widened_does_not_move_a_mean_that_is_not_known(models, drift, monkeypatch):
    live = started(models["lead"], drift)
    calm = live.forecast(STEPS)
    monkeypatch.setattr(type(live), "consistency_by_state", np.full((2, len(STATES)), 30.0))
    widened = live.forecast(STEPS)
    assert_array_equal(mean(widened), mean(calm))
    assert np.all(widened.heave.sel(statistic="std") > calm.heave.sel(statistic="std"))


def test_what_follows_is_predicted_as_the_forecast_predicts_it(models, drifts, drift):
    steps, cut = 150, drift.isel(time=slice(START))
    for model in (models["lead"], few(lead=6).fit(drifts, STATES, INPUTS)):
        expected = model.forecast(cut, float(cut.time[-1]), steps, ahead="predict")
        if "member" in expected.dims:
            assert expected["heave"].std("member").values[-1] > 0  # a band stays
            expected = expected.mean("member")
        found = started(model, cut).forecast(steps)
        assert_near(mean(found), table(expected, STATES), 1e-9)
        # By then all weight is on the mean of training, which errs by the SD there.
        scale = model.signature.state_scale
        assert_near(mean(found)[-1, 1], scale.centre[1], 1e-9)
        assert_allclose(std(found)[-20:, 1], scale.spread[1], rtol=1e-9)


def test_what_the_probe_up_wave_has_seen_is_foreseen_and_filled_down_wave(
    model, models, drift, waves
):
    rough, rng = drift.copy(deep=True), default_rng(6)
    for name in INPUTS:
        rough[name].values += 5e-4 * rng.standard_normal(drift.sizes["time"])
    apart, filled, known = [], [], waves[START:]
    # 3.67 m at the group speed of 0.38 Hz, below which a twentieth of the waves lies; of forty
    # frequencies, each holds as much as that.
    for like, expected in ((None, 0.0), (drift, 3.67 / group_speed(2 * np.pi * 0.384, 3.6))):
        live = models["lead"].live(like=like)
        play(live, rough, 0, START)
        error = mean(live.forecast(10)) - mean(live.forecast(10, known))
        apart.append(np.square(error[:, 1]).mean())  # heave: surge answers no wave
        assert_allclose(live.forecast(2).attrs["predictable"], expected, rtol=0.15)
        live = model.live(like=like)
        play(live, rough, 0, START)
        for _ in range(10):
            live.step()
        filled.append(np.sqrt(np.mean((live._known_inputs()[-10:] - known[:10]) ** 2, axis=0)))
    assert apart[1] < 0.1 * apart[0]
    assert filled[1][0] == filled[0][0]  # the first probe
    assert filled[1][1] < 0.5 * filled[0][1]


@in_place_and_carried
def test_in_the_dark_a_forecast_is_that_of_the_last_sample(models, drift, tmp_path, key):
    """Mean and band go on; in the light again, the service says that waves are lost."""
    live, count = started(models[key], drift), 30
    before = live.forecast(STEPS)
    for _ in range(count):
        live.step()
    path = live.save(tmp_path / "state.nc")
    found = live.forecast(STEPS - count)
    assert_array_equal(mean(load_live(models[key], path).forecast(STEPS - count)), mean(found))
    assert not live.validity & Validity.LOST  # the band holds what is not known
    assert found.attrs["known_input"] == 0
    for each in ("mean", "std"):
        # What is predicted from is the same, but for the oldest samples of a full record.
        assert_near(mean(found, each), mean(before, each)[count:], 2e-3)
    play(live, drift, START + count, START + count + 8)
    assert live.validity & Validity.LOST  # thirty samples are no gap that is closed
    play(live, drift, START + count + 8, START + count + models[key].history_samples)
    assert not live.validity & Validity.LOST  # nothing that is read was lost
    for _ in range(len(live.errors.rms) + 1):
        live.step()
    found, scale = live.forecast(2), models[key].signature.state_scale
    assert_allclose(mean(found), [scale.centre] * 2, rtol=1e-12)
    assert np.all(std(found) > 0.999 * scale.spread)


def test_in_the_dark_the_waves_widen_the_band_though_a_sensor_was_dead(model, drift):
    live = started(model, drift, START - 40)
    play(live, drift, START - 40, START, dead=["heave"])
    for _ in range(30):
        live.step()
    both = live.errors.of_forecast(1) + live._filter.ahead(1, live._raised)
    variance = np.minimum(both, live.errors.of_forecast(1, 70))[0]
    assert std(live.forecast(5))[0, 1] ** 2 > 1.05 * variance[1]


def test_forecasts_read_waves_whose_short_gaps_are_closed(
    models, drift, monkeypatch, waves, motions
):
    live, waves, seen = models["aligned"].live(like=drift), waves[:START], []
    lost = default_rng(8).uniform(size=START) < 0.1
    lost[:4], lost[-2:] = False, [True, False]  # the newest gap has one sample behind it
    for at in range(START):
        live.step(None if lost[at] else waves[at], motions[at])
    filled = np.square(live._known_inputs() - waves)[lost].mean()
    monkeypatch.setattr(live, "_foreseen", lambda of, count: seen.append(of) or foresee(of, count))
    live.forecast(5)
    assert np.square(seen[0] - waves)[lost].mean() < 0.1 * filled
    assert_array_equal(seen[0][~lost], waves[~lost])


def test_a_dead_probe_is_filled_by_no_more_than_waves(models, drift, waves, motions):
    """Also the one up-wave, for which what it was filled by is read again and again."""
    for dead in range(2):
        lost = waves.copy()
        lost[:, dead] = np.nan
        live = fed(started(models["aligned"], drift), lost[START:], motions[START:])
        assert np.abs(live._known_inputs()[-200:, dead]).max() < np.abs(waves[:, dead]).max()


def test_skill_against_lead_time_is_that_of_forecasts_by_hand(model, live, drift):
    steps, known = 10, drift.copy(deep=True)
    known["heave"].values[START + 5] = np.nan  # not measured, and not judged
    spread, truth = model.state_scale.spread, table(known, STATES)
    span = tuple(float(drift.time[at]) for at in (START, START + 1 + steps))
    found = nowcast(model, known.assign_attrs(test_span=span), steps)
    assert found.attrs["starts"] == 2
    judged = []
    for at in (START, START + 1):
        play(live, drift, at, at + 1)
        forecast, measured = live.forecast(steps), truth[at + 1 : at + 1 + steps]
        held = (mean(forecast, "lower") <= measured) & (measured <= mean(forecast, "upper"))
        squares = ((mean(forecast) - measured) / spread) ** 2, (std(forecast) / spread) ** 2
        judged.append(np.where(np.isfinite(measured), [*squares, 100.0 * held], np.nan))
    squares, claimed, inside = np.nanmean(judged, axis=0)
    assert_allclose([found.error, found.claimed], np.sqrt([squares, claimed]), rtol=1e-12)
    assert_array_equal(found.coverage, inside)


def test_of_a_sample_what_is_missing_is_predicted_and_what_is_there_taken(
    model, drift, waves, motions
):
    live = model.live()
    play(live, drift, 0, START)
    live.step({INPUTS[0]: waves[START, 0]}, motions[START])
    expected = [waves[START, 0], predict_waves(waves[:START], 1)[0, 1]]
    assert_array_equal(live._known_inputs()[-1], expected)


def test_a_step_and_a_forecast_run_on_one_thread(live, waves):
    seen = []

    def seen_by(values):
        threads = {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}
        seen.append(threads)
        return values

    class Sample(dict):
        def get(self, key, default=None):
            return seen_by(default)

    class Rows:
        def __array__(self, dtype=None, copy=None):
            return seen_by(waves[START : START + 5])

    with threadpool_limits(2, user_api="blas"):
        live.step(Sample())
        live.forecast(5, Rows())
        assert len(seen) > 2
        assert all(each == {1} for each in seen)


@in_place_and_carried
def test_a_restarted_process_goes_on_bit_for_bit(models, drift, tmp_path, key):
    live = started(models[key], drift)
    path = tmp_path / "state.nc"
    for at in range(START, START + 20):  # all that wait to be judged are in the state
        gone = {"lost": range(START, at, 2), "dead": ["heave"]} if at >= START + 10 else {}
        play(live, drift, at, at + 1, **gone)
        if at == START + 5:
            live.step()
        again = load_live(models[key], live.save(path))
        assert_array_equal(again.consistency_by_state, live.consistency_by_state)
    for each in (live, again):
        play(each, drift, START + 20, START + 40, lost=[START + 23])
    for name in ("state", "covariance", "innovation", "time", "consistency_by_state"):
        assert_array_equal(getattr(again, name), getattr(live, name))
    assert again.consistency == live.consistency
    assert again.conditions.surge == live.conditions.surge
    assert_array_equal(mean(again.forecast(20)), mean(live.forecast(20)))
    with request_error("is the state of another model"):
        load_live(models["lead"], path)


def test_what_is_kept_does_not_grow_and_does_not_count(live, drift, tmp_path):
    size = live.save(tmp_path / "a.nc").stat().st_size
    tracemalloc.start()
    play(live, drift, 0, START)
    assert live.save(tmp_path / "b.nc").stat().st_size < 1.1 * size  # the head's numbers grow
    before = tracemalloc.get_traced_memory()[0]
    play(live, drift, 0, START)
    # Python's own caches; arrays of what came since would hold 500 rows of 4 numbers.
    assert tracemalloc.get_traced_memory()[0] - before < 8 * 4 * 500
    tracemalloc.stop()
    # Inputs, whether they were lost, and estimated states; squared errors of late; of the rest no
    # more than delays reach.
    kept = 8 * (LEAST_RECORD * (2 * len(INPUTS) + len(STATES)) + CONSISTENCY * 2 * len(STATES))
    assert kept < size < kept + 8_000


BAD = {
    "y has shape": {"y": [1.0]},
    "u has shape": {"u": [0.0, 0.0, 0.0, 0.0, 0.0]},
    "u holds an infinite value. Give NaN for what was not": {"u": {INPUTS[1]: -np.inf}},
    "y names 'heav', which the model does not know. Did you mean 'heave'": {"y": {"heav": 1.0}},
    "y holds an infinite value": {"y": {"heave": np.inf}},
    "is not after the last sample at": {"time": 1.0},
    "Call step\\(\\) without arguments once for each sample": {"time": 1e3},
}


@pytest.mark.parametrize("message", BAD)
def test_a_bad_sample_leaves_the_state_as_it_was(model, drift, message, waves, motions):
    assert np.isnan(model.live().state).all()
    live, untouched = started(model, drift, 100), started(model, drift, 100)
    good = {"u": waves[100], "y": motions[100]}
    with request_error(message):
        live.step(**good | BAD[message])
    for each in (live, untouched):
        each.step(**good)
    assert_array_equal(live.state, untouched.state)
    assert live.consistency == untouched.consistency


def test_times_since_1970_are_told_apart(model, waves, motions):
    live = model.live()
    live.step(waves[0], motions[0], time=1780000000.5)
    with request_error(r"time = 1780000000\.45 s is not after the last sample at 1780000000\.5 s"):
        live.step(waves[1], motions[1], time=1780000000.45)
    with request_error(r"time = 1780000000\.75 s is 0\.25 s after"):
        live.step(waves[1], motions[1], time=1780000000.75)


def test_a_known_actuator_follows_its_plan_whatever_the_probe_does():
    """Surge that answers a wave and a thruster: x' = .9 x + .3 u + .5 thrust, exactly."""

    def made(seed):
        rng, samples = default_rng(seed), 1200
        wave = np.sin(0.3 * np.arange(samples) + rng.uniform(0, 6)) + rng.normal(0, 0.3, samples)
        thrust = np.repeat(rng.uniform(-1, 1, samples // 30), 30)
        surge = signal.lfilter([0.0, 1.0], [1.0, -0.9], 0.3 * wave + 0.5 * thrust)
        return record(0.1, surge=surge, eta=wave, thrust=thrust)

    model = HankelDMDc(0, 0, 1e-9, delay_rows="exact").fit(
        {str(seed): made(seed) for seed in (1, 2)}, ["surge"], ["eta", "thrust"]
    )
    run = made(3)
    live, constant = (model.live(roles={"thrust": role}) for role in ("known", "constant"))
    u, y = table(run, ["eta", "thrust"]), table(run, ["surge"])
    for each in (live, constant):
        fed(each, u[:300], y[:300])
    for at in range(300, 320):
        live.step([np.nan, u[at, 1]], y[at])  # the probe is dead; the thrust is known
        assert live._known_inputs()[-1, 1] == u[at, 1]
    assert not live.conditions.reasons[:, 1].any()
    live.step({"eta": u[320, 0]}, y[320])  # the thrust was not measured
    assert live._known_inputs()[-1, 1] == u[319, 1]
    plan, steps = np.sin(np.arange(40)), 40
    still, moved = (live.forecast(steps, {"thrust": each}) for each in (0 * plan, plan))
    answer = signal.lfilter([0.5], [1, -0.9], np.concatenate([[0.0], plan[:-1]]))
    # The ridge moves the answer by a millionth.
    assert_near((moved.surge - still.surge).drop_sel(statistic="std"), [answer] * 3, 1e-5)
    # Extremes of training are −1 and 1, mean and 3 SD about 1.7.
    for plan_of, word in ((1.2, False), (-1.2, False), (2.2, True), (-2.2, True)):
        ahead = live.forecast(steps, {"thrust": np.append(plan_of, 0 * plan[1:])})
        assert ("mean" in ahead.attrs["validity"]) == word
    with request_error(r"'thrust' is a known input, and future gives 3 of"):
        live.forecast(steps, {"thrust": plan[:3]})
    with request_error("roles names 'eat', which the model does not know"):
        model.live(roles={"eat": "known"})
    # A constant stays; waves that are given count though the other column is not.
    known = u[300:340].copy()
    known[:, 1] = u[299, 1]
    expected = model.forecast_arrays(y[:300], u[:300], known, steps)
    given = constant.forecast(steps, {"eta": u[300:340, 0]})
    assert_near(given.surge.sel(statistic="mean"), expected[:, 0], 1e-12)
    assert given.attrs["known_input"] == 39


def test_the_jacobian_is_the_derivative_of_a_forecast(models, waves, motions):
    """Of a model with squares and a place: along its rows, what a forecast changes by."""
    model, rng = models["aligned"], default_rng(0)
    count = model.history_samples
    x = motions[300 - model.signature.state_samples : 300]
    u = waves[300 - count : 300 + model.lead_samples]
    change = [1e-4 * rng.standard_normal(each.shape) for each in (x, u)]

    def after(side):
        rows = u + side * change[1]
        return model.forecast_arrays(x + side * change[0], rows[:count], rows[count:], 1)[0]

    along = sum(np.tensordot(d, c, 2) for d, c in zip(model.jacobian(x, u), change, strict=True))
    assert_allclose(along, 0.5 * (after(1) - after(-1)), rtol=1e-4, atol=1e-9)
