"""Waves continued by linear prediction."""

import numpy as np
import pytest

from seakeep.signals import predict_waves
from seakeep.signals.prediction import draw_sea, draw_waves, predictable_time
from seakeep.waves import wavenumber


def test_an_autoregressive_process_is_continued_as_it_is_expected_to_go_on():
    rng = np.random.default_rng(0)
    series = np.zeros((6000, 2))
    first, second = 2 * 0.98 * np.cos(0.4), -(0.98**2)
    for k in range(2, len(series)):
        series[k] = first * series[k - 1] + second * series[k - 2] + rng.standard_normal(2)
    expected = list(series[-2:])
    for _ in range(20):
        expected.append(first * expected[-1] + second * expected[-2])
    found = predict_waves(series + np.array([3.0, -1.0]), 20)
    spread = series.std(axis=0)
    # Four periods of 16 samples are 63 coefficients, each with a standard error of 1/√6000.
    error = np.abs(found - [3.0, -1.0] - expected[2:]).max(axis=0) / spread
    assert np.all(error < 0.25)
    assert np.all(np.abs(expected[2:]).max(axis=0) > 0.5 * spread)  # what there was to foresee


def test_columns_are_continued_alone_and_a_still_one_stays():
    rng = np.random.default_rng(2)
    both = np.stack([np.sin(0.3 * np.arange(300)), np.full(300, 0.7)], axis=1)
    both[:, 0] += 0.1 * rng.standard_normal(300)
    found = predict_waves(both, 30)
    np.testing.assert_array_equal(found[:, 0], predict_waves(both[:, 0], 30))
    np.testing.assert_allclose(found[:, 1], 0.7, rtol=1e-12)


@pytest.fixture(scope="module")
def sea():
    """Elevations at 0, 2 and 4 m, 90 s and the 6 s after them, with 2 % of noise."""
    rng = np.random.default_rng(4)
    omega = 2 * np.pi * rng.uniform(0.4, 0.9, 400)
    turned = np.outer(0.1 * np.arange(960), omega) + rng.uniform(0, 2 * np.pi, 400)
    k = wavenumber(omega, 3.6)
    waves = np.stack([np.cos(turned - k * x).sum(axis=1) for x in (0.0, 2.0, 4.0)], axis=1)
    return waves + 0.02 * waves.std() * rng.standard_normal(waves.shape)


def drawn(sea, positions, pairs=8, seed=0):
    rng = np.random.default_rng(seed)
    return draw_sea(sea[:900], 60, pairs, rng, dt=0.1, positions=positions, depth=3.6)


def test_waves_that_a_probe_has_seen_are_foreseen_at_those_after_it(sea):
    found, alone = drawn(sea, [0.0, 2.0, 4.0]), drawn(sea, [np.nan] * 3)
    spread = sea.std(axis=0)
    errors = [(each.mean(axis=0) - sea[900:]) / spread for each in (found, alone)]
    np.testing.assert_array_equal(errors[0][:, 0], errors[1][:, 0])
    middle = found.reshape(2, -1, *found.shape[1:]).mean(axis=0)  # of each pair
    np.testing.assert_allclose(middle, middle[:1] + np.zeros(middle.shape), atol=1e-9)
    for column, x in ((1, 2.0), (2, 4.0)):
        known = int(predictable_time(sea[:900, 0], 0.1, x, 3.6) / 0.1)
        error, own = (np.sqrt(np.mean(each[:known, column] ** 2)) for each in errors)
        # Noise of two probes, 0.03, and the twentieth of the variance that is faster.
        assert error < 0.05
        assert error < 0.6 * own
        assert found.std(axis=0)[:known, column].mean() < 0.1 * spread[column]


def test_futures_of_a_sea_spread_as_the_errors_of_its_prediction():
    rng, trials, pairs = np.random.default_rng(0), 300, 10
    omega = 2 * np.pi * rng.uniform(0.4, 0.9, (trials, 60, 1))
    phase = rng.uniform(0, 2 * np.pi, omega.shape)
    seas = np.cos(omega * 0.1 * np.arange(460) + phase).sum(axis=1).T
    seas += 0.05 * seas.std() * rng.standard_normal(seas.shape)
    found = draw_waves(seas[:400], 60, pairs, rng)[:, 10:]
    expected = found.mean(axis=0)
    ratio = (seas[410:] - expected) / np.sqrt(np.mean((found - expected) ** 2, axis=0))
    # The mean of a square over a variance of n pairs is n/(n − 2) (F distribution). These seas
    # tell its root to 2 %, and errors of coefficients are drawn to first order of their 62 in 400
    # samples; without them the root is 10 % larger.
    assert np.sqrt(np.mean(ratio**2)) == pytest.approx(np.sqrt(pairs / (pairs - 2)), rel=0.08)


def test_probes_that_do_not_see_the_same_waves_are_drawn_alone(sea):
    turned = sea[:900, [2, 1, 0]]  # the waves run the other way
    expected = draw_waves(turned, 60, 8, np.random.default_rng(0))
    np.testing.assert_array_equal(drawn(turned, [0.0, 2.0, 4.0]), expected)
    still = np.stack([np.zeros(900), sea[:900, 0]], axis=1)
    expected = draw_waves(still, 60, 8, np.random.default_rng(0))
    np.testing.assert_array_equal(drawn(still, [0.0, 1.0]), expected)
