"""Waves continued by linear prediction."""

import numpy as np
import pytest

from seakeep.errors import DataError, RequestError
from seakeep.signals import predict_waves


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


def test_waves_of_a_few_frequencies_are_foreseen_and_noise_is_not():
    t = 0.05 * np.arange(1264)
    tones = sum(np.cos(2 * np.pi * f * t + f) for f in (0.5, 0.61, 0.7))
    error = predict_waves(tones[:1200], 64) - tones[1200:]
    # Burg's frequencies are off by a part that goes with the record's inverse length.
    assert np.abs(error).max() < 0.1 * tones.std()
    noise = np.random.default_rng(1).standard_normal(1200)
    # Nothing can be foreseen: the mean, to the error of the coefficients.
    assert np.abs(predict_waves(noise, 64)).max() < 0.5


def test_columns_are_continued_alone_and_a_still_one_stays():
    rng = np.random.default_rng(2)
    both = np.stack([np.sin(0.3 * np.arange(300)), np.full(300, 0.7)], axis=1)
    both[:, 0] += 0.1 * rng.standard_normal(300)
    found = predict_waves(both, 30)
    np.testing.assert_array_equal(found[:, 0], predict_waves(both[:, 0], 30))
    np.testing.assert_allclose(found[:, 1], 0.7, rtol=1e-12)


def test_what_cannot_be_continued_is_refused():
    with pytest.raises(RequestError, match="count must be a whole number of at least 1"):
        predict_waves(np.sin(np.arange(50.0)), 0)
    with pytest.raises(DataError, match="NaN"):
        predict_waves([0.0, 1.0, np.nan, 1.0, 2.0], 3)
