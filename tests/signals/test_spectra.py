"""Zero crossings, the encounter period, spectra and heights."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seakeep.errors import DataError, RequestError
from seakeep.signals import (
    encounter_period,
    significant_height,
    wave_heights,
    wave_spectrum,
    zero_up_crossings,
)


@given(
    st.floats(min_value=0.5, max_value=10.0),
    st.floats(min_value=0.0, max_value=6.28),
    st.floats(min_value=-5, max_value=5),
)
def test_period_of_a_regular_wave(period, phase, offset):
    t = np.arange(0, 200, 0.05)
    series = offset + 0.3 * np.sin(2 * np.pi * t / period + phase)
    # The mean over a broken number of waves shifts all crossings alike; interpolation on 10
    # samples a wave and more leaves a part in a thousand of a sample.
    assert encounter_period(series, 0.05) == pytest.approx(period, rel=2e-3)


def test_crossings_lie_between_samples():
    np.testing.assert_allclose(zero_up_crossings([-1.0, 3.0, -1.0, -1.0], 0.5), [0.125])


def test_it_is_a_period_and_no_frequency():
    # The paper prints N/T; its value, 1.64 s, is T/N.
    t = np.arange(0, 164, 0.01)
    assert encounter_period(np.sin(2 * np.pi * t / 1.64), 0.01) == pytest.approx(1.64, rel=1e-6)


def test_still_water_has_no_period():
    with pytest.raises(
        DataError,
        match=r"the record of 5 s crosses its mean upwards 0 time\(s\); at least two .* Give a lo",
    ):
        encounter_period(np.zeros(100), 0.05)


def test_the_spectrum_holds_the_variance():
    rng = np.random.default_rng(0)
    series = rng.standard_normal(20_000)
    for options in ({}, {"segment": 4096, "overlap": 128, "padded": 65536}):
        frequency, density = wave_spectrum(series, 0.05, **options)
        # White noise of unit variance, 5 to 16 segments: a per cent or two of the variance.
        assert np.trapezoid(density, frequency) == pytest.approx(1.0, rel=0.04)


def test_a_tones_peak_is_found_between_the_segments_lines():
    t = np.arange(0, 210, 0.01)
    frequency, density = wave_spectrum(np.sin(2 * np.pi * 0.4717 * t), 0.01, 819, 25, 13107)
    # A segment of 8.2 s has lines 0.12 Hz apart; padding places the peak to 0.0076 Hz.
    assert frequency[np.argmax(density)] == pytest.approx(0.4717, abs=0.008)


def test_segments_that_do_not_fit_are_refused():
    with pytest.raises(RequestError, match=r"segments of 2 to 100 samples .* received segments of"):
        wave_spectrum(np.ones(100), 0.1, segment=200)
    with pytest.raises(RequestError, match="at least as long as a segment"):
        wave_spectrum(np.ones(100), 0.1, segment=50, padded=20)


def test_heights_are_crest_less_trough():
    t = np.arange(0, 40, 0.005)
    # Beats: the heights follow the envelope, twice the amplitude on average.
    heights = wave_heights((1 + 0.1 * np.sin(0.5 * t)) * np.sin(6.0 * t), 0.005)
    assert heights.size == pytest.approx(40 * 6 / (2 * np.pi), abs=1.5)
    assert heights.mean() == pytest.approx(2.0, rel=0.01)
    assert np.ptp(heights) == pytest.approx(0.4, rel=0.05)


def test_significant_height_is_four_deviations():
    t = np.arange(0, 100, 0.01)
    assert significant_height(0.1 * np.sin(t * 2 * np.pi)) == pytest.approx(4 * 0.1 / np.sqrt(2))
