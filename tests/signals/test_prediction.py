"""Waves continued by linear prediction."""

import numpy as np
import pytest
import seas
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from records import autoregressive, rms

from seakeep.signals import predict_waves
from seakeep.signals.prediction import (
    FEWEST,
    JUMP,
    Foreseen,
    Jumps,
    close_gaps,
    fill_future,
    foresee,
    predictable_time,
)


def jumps_of(series, least=1e-3):
    """Samples of one channel that jump."""
    jumps = Jumps(np.array([least]))
    return [at for at, value in enumerate(series) if jumps.of(np.array([value])).any()]


def test_a_jump_is_far_above_third_differences_of_late_and_is_taken_where_it_stays():
    t = np.arange(400.0)
    parabola = 3.0 - 0.2 * t + 0.01 * t**2
    assert 100 not in jumps_of(parabola + 0.011 * (t == 100))
    assert jumps_of(parabola + 0.013 * (t == 100)) == [100]
    assert jumps_of(parabola + 0.013 * (t == FEWEST))[:1] != [FEWEST]  # too few before it
    # 3 · 4 · 5 / 6 times as much is tolerated two samples later. Of the parabola through 98, 99 and
    # 102, those at 103 and 104 depart by .0667 and .15, over 20 and 60.
    shifted = jumps_of(parabola + 0.1 * (t >= 100))
    assert shifted[:4] == [100, 101, 103, 104]
    assert shifted[-1] < 130
    assert jumps_of(parabola + 0.1 * (t >= 100), 0.1) == jumps_of(1e9 * t**9, np.inf) == []
    noise, at = default_rng(0).standard_normal(1500), np.arange(1500) == 1000
    usual = np.sqrt(20.0)  # third differences of white noise: 1, 3, 3, 1
    assert 1000 not in jumps_of(noise + 0.8 * JUMP * usual * at)
    assert jumps_of(noise + 1.3 * JUMP * usual * at) == [1000]
    # Gaps lower the divided differences of noise, and not what is usual.
    gaps = noise.copy()
    gaps[1:750:2] = np.nan
    assert jumps_of(gaps) == []
    rougher = np.concatenate([noise, 30 * noise])
    assert 0 < len(jumps_of(rougher)) < 400
    assert jumps_of(rougher)[-1] < 2500


def test_what_is_missing_is_filled_from_the_record_after_the_last_gap():
    series = np.arange(24.0).reshape(12, 2)
    series[3, 0] = np.nan  # before what is filled
    series[7:, 0] = series[9:11, 1] = np.nan  # the second probe is back at the end

    def foreseen(record, count):
        assert_array_equal(record, series[4:7])
        departures = np.arange(1.0, 21.0).reshape(2, 5, 2)
        return Foreseen(100.0 + np.arange(10.0).reshape(5, 2), departures, 3.0)

    futures, first, freedom = fill_future(series, 6, foreseen)
    assert (first, freedom) == (7, 3.0)
    filled = series.copy()
    filled[7:, 0], filled[9:11, 1] = 100.0 + np.arange(0.0, 10.0, 2), [105.0, 107.0]
    assert_array_equal(futures[0], filled)
    moved = np.zeros((2, 5, 2))
    moved[0] = np.arange(1.0, 11.0).reshape(5, 2)
    moved[1, 2:] = np.arange(11.0, 17.0).reshape(3, 2)  # from where it is first missing on
    moved[:, [0, 1, 4], 1] = 0.0  # what is measured does not depart
    assert_array_equal(futures[1:3, 7:] - filled[7:], moved)
    assert_array_equal(futures[3:] + futures[1:3], [2 * filled] * 2)


def test_short_gaps_are_closed_by_cubics_and_the_newest_by_what_there_is():
    t = np.arange(40.0)
    cubic, square = 1.0 - 0.3 * t + 0.02 * t**2 - 4e-4 * t**3, 2.0 - 0.1 * t + 0.01 * t**2
    lost = np.zeros(40, bool)
    lost[[0, 5, *range(8, 16), *range(20, 29), 37, 38]] = True  # one, eight, nine; one sample after
    left = np.isin(t, [0, *range(20, 29)])
    for series, places in ((cubic, t < 30), (square, t > 30)):
        record, gone = np.where(lost, 9.0, series), lost.copy()
        close_gaps(record, gone, 8)
        assert_array_equal(gone, left)
        assert_array_equal(record[left], 9.0)
        closed = places & ~left
        assert_allclose(record[closed], series[closed], rtol=1e-12)


def test_columns_are_continued_alone_and_a_still_one_stays():
    both = np.stack([np.sin(0.3 * np.arange(300)), np.full(300, 0.7)], axis=1)
    both[:, 0] += 0.1 * default_rng(2).standard_normal(300)
    found = predict_waves(both, 30)
    assert_array_equal(found[:, 0], predict_waves(both[:, 0], 30))
    assert_allclose(found[:, 1], 0.7, rtol=1e-12)


@pytest.fixture(scope="module")
def sea():
    """Elevations at 0, 2 and 4 m, 90 s and the 6 s after them, with 2 % of noise."""
    made, time = seas.sea(4, (0.4, 0.9), peak=1.0, components=400), 0.1 * np.arange(960)
    waves = np.stack([made.at(time, x) for x in (0.0, 2.0, 4.0)], axis=1)
    return waves + 0.02 * default_rng(4).standard_normal(waves.shape)


def foreseen(sea, positions):
    return foresee(sea[:900], 60, dt=0.1, positions=positions, depth=3.6)


def test_waves_that_a_probe_has_seen_are_foreseen_at_those_after_it(sea):
    found, alone = foreseen(sea, [0.0, 2.0, 4.0]), foreseen(sea, [np.nan] * 3)
    spread = sea.std(axis=0)
    errors = [(each.expected - sea[900:]) / spread for each in (found, alone)]
    assert_array_equal(errors[0][:, 0], errors[1][:, 0])
    claimed = np.sqrt(np.cumsum((found.departures**2).sum(axis=0), axis=0)) / spread
    for column, x in ((1, 2.0), (2, 4.0)):
        known = int(predictable_time(sea[:900, 0], 0.1, x, 3.6) / 0.1)
        error, own = (rms(each[:known, column]) for each in errors)
        # Noise of two probes, 0.03, and the twentieth of the variance that is faster.
        assert error < 0.05
        assert error < 0.6 * own
        assert claimed[:known, column].mean() < 0.1
    # Of the first probe, an innovation arrives at the last one after those in between.
    arrival = np.abs(found.departures[0]).argmax(axis=0)
    assert arrival[0] < arrival[1] < arrival[2]


def test_departures_of_a_sea_are_the_errors_of_its_prediction():
    rng, trials, time = default_rng(0), 300, 0.1 * np.arange(460)
    parts = [seas.sea(k, (0.4, 0.9), components=60).at(time) for k in range(trials)]
    record = np.transpose(parts) + 0.05 * rng.standard_normal((460, trials))
    found = foresee(record[:400], 60, dt=0.1, positions=[np.nan] * trials, depth=3.6)
    own = found.departures[np.arange(trials), :, np.arange(trials)]
    assert not (found.departures.sum(axis=0) - own.T).any()
    ratio = (record[400:] - found.expected).T / np.sqrt(np.cumsum(own**2, axis=1))
    # These seas tell the root to 2 %. Errors of 62 coefficients in 400 samples count as those of
    # one step do, to first order; without them the root is 15 % larger.
    assert_allclose(rms(ratio), 1.0, rtol=0.1)
    assert 4 < found.freedom < 400 / 62  # of the largest order


def test_the_power_of_innovations_is_that_of_a_known_process():
    series = default_rng(1).standard_normal((6000, 1))
    found = foresee(1.0 + 2.0 * autoregressive(series, 0.8, axis=0), 30, dt=0.1,
                    positions=[np.nan], depth=3.6)  # fmt: skip
    # 6000 samples tell an SD to a hundredth.
    assert_allclose(found.departures[0, :3, 0], [2.0, 1.6, 1.28], rtol=0.05)


def test_probes_that_do_not_see_the_same_waves_are_continued_alone(sea):
    turned = sea[:, [2, 1, 0]]  # the waves run the other way
    still = np.stack([np.zeros(960), sea[:, 0]], axis=1)
    for record, positions in ((turned, [0.0, 2.0, 4.0]), (still, [0.0, 1.0])):
        apart, alone = foreseen(record, positions), foreseen(record, [np.nan] * len(positions))
        assert_array_equal(apart.expected, alone.expected)
        assert_array_equal(apart.departures, alone.departures)
        assert_array_equal(alone.expected, predict_waves(record[:900], 60))
