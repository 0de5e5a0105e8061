"""Conformal margins: the coverage they warrant, found on synthetic scores of known distribution."""

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from records import autoregressive
from scipy import stats

from seakeep.core.bands import (
    band_scale,
    learn_scale,
    scaled_scores,
    spread_floor,
    wave_envelope,
)
from seakeep.models.calibration import Judged, learn_margin
from seakeep.statistics import band_scores, conformal_margin


def test_margins_by_hand():
    """Rank ⌈0.9 · 40⌉ of 39: a new score is below it with probability 36/40."""
    scores = np.arange(1.0, 40.0).reshape(1, 39, 1)
    assert conformal_margin(scores, 0.9, block_length=1).margin == [36.0]
    # Few blocks warrant less, and give the largest score.
    few = conformal_margin(scores[:, :12].reshape(2, 6, 1), 0.95, block_length=6)
    assert (few.margin, few.blocks) == ([12.0], [2])
    assert_allclose(few.warranted, [2 / 3])
    # A band is never narrowed.
    assert conformal_margin(-scores, 0.9).margin == [0.0]


def test_dependent_scores_are_worth_fewer_and_the_coverage_is_kept():
    rng = default_rng(2)
    held, plain, worth = [], [], []
    for _ in range(400):
        noise = np.sqrt(1 - 0.95**2) * rng.standard_normal((6, 200, 1))
        scores = autoregressive(noise, 0.95, axis=1)[:, 100:]
        for found, out in (
            (conformal_margin(scores, 0.9), held),
            (conformal_margin(scores, 0.9, block_length=1), plain),
        ):
            out.append(stats.norm.cdf(found.margin[0]))
        worth.append(conformal_margin(scores, 0.9).blocks[0])
    error = np.std(held) / np.sqrt(len(held))
    # As if the 600 scores were independent, too little is covered; with their dependence, enough.
    assert np.mean(plain) < 0.9 - 3 * error
    assert 0.9 - 3 * error < np.mean(held) < 0.95
    assert np.median(worth) < 600 / 5


def test_a_learnt_scale_is_the_one_that_the_errors_have():
    """Errors whose scale goes with the spread, with the waves, and grows over the horizon."""
    rng = default_rng(0)
    envelope = np.exp(rng.normal(0.0, 0.5, (400, 50)))
    std = np.exp(rng.normal(0.0, 0.5, (400, 50, 1)))
    horizon = (1.0 + np.arange(50))[:, None]
    sigma = 0.4 * std**0.5 * envelope[..., None] ** 0.8 * horizon**0.3
    mean = rng.standard_normal(sigma.shape)
    y = mean + sigma * rng.standard_normal(sigma.shape)
    floor = 1e-3 * spread_floor(mean, y)  # the spread alone, and no floor
    law = learn_scale(mean, std, y, envelope, floor)
    # 20,000 normal errors know a logarithm of their scale to 1/√40,000; the ridge takes 0.1 %.
    assert_allclose(law[1:, 0], [0.5, 0.3, 0.8], atol=0.03)
    assert_allclose(np.log(band_scale(std, floor, law, envelope) / sigma), 0.0, atol=0.1)


def test_a_learnt_scale_is_judged_by_runs_that_it_did_not_learn_from():
    rng, zeros = default_rng(4), np.zeros((8, 50, 1))
    errors = [spread * rng.standard_normal(zeros.shape) for spread in (1.0, 3.0)]
    values = np.stack([zeros, zeros + 1, zeros, zeros], axis=1)
    found, *_ = learn_margin([Judged(values, y, np.ones((8, 50))) for y in errors], 0.95, "learnt")
    # The scale of the calm run is three times too small for the other: of |z| · 3 and
    # |z|/3 in equal parts, 95 % lie below 1.645 · 3. 800 errors tell it to 6 %.
    assert_allclose(found.margin[0], 1.645 * 3, rtol=0.15)


def test_the_envelope_is_that_of_the_waves_that_drive_a_step():
    waves, z, steps = default_rng(5).standard_normal((2, 12, 3)), 4, 8
    found = wave_envelope(waves, steps)
    for step in range(steps):
        expected = np.sqrt(np.mean(waves[:, step : step + z + 1] ** 2, axis=(1, 2)))
        # Differences of running sums.
        assert_allclose(found[:, step], expected, rtol=1e-12)
    assert_array_equal(wave_envelope(np.empty((2, 12, 0)), steps), 1.0)


def test_floor_and_scores_by_hand_and_forecasts_that_are_lost():
    mean, std, y = np.array(
        [[[0.0, 2.0], [np.nan, np.nan]], [[0.0, 1.0], [np.nan, np.nan]], [[3.0, -2.0], [0.0, 0.0]]]
    )[..., None]
    floor = spread_floor(mean, y)
    assert_allclose(floor[0], np.sqrt((9 + 16) / 2) / 4, rtol=1e-15)
    assert spread_floor(mean[1:], y[1:])[0] == 1.0
    scores = scaled_scores(mean, band_scale(std, floor), y)
    assert_allclose(scores[0, :, 0], [3 / floor[0], 4 / np.hypot(1, floor[0])])
    assert np.isinf(scores[1]).all()
    # Neither error nor scale: a channel that never moves.
    assert scaled_scores(y * 0, y * 0, y * 0).max() == 0.0


def test_scores_by_hand_and_a_band_that_is_lost():
    lower, upper, y = np.array([[0.0, 0.0, np.nan], [1.0, 2.0, 3.0], [1.5, 0.5, 1.0]])[..., None]
    assert_array_equal(band_scores(lower, upper, y)[:, 0], [0.5, -0.5, np.inf])
    # Lost in more of the windows than the level leaves: no margin is wide enough.
    scores = np.concatenate([np.zeros((3, 10, 1)), np.full((1, 10, 1), np.inf)])
    assert conformal_margin(scores, 0.9, block_length=1).margin[0] == np.inf
    assert conformal_margin(scores, 0.7, block_length=1).margin[0] == 0.0


def test_the_block_is_the_integrated_correlation_time():
    """Exceedances of a score that is held for k samples: 1 + 2 Σ (1 − j/k) = k."""
    rng = default_rng(0)
    scores = np.stack([np.repeat(rng.standard_normal(500), 8) for _ in range(20)])[..., None]
    found = conformal_margin(scores, 0.9).block_length[0]
    assert_allclose(found, 8, rtol=0.1)  # the first correlations beyond 8 are noise of 1 %
