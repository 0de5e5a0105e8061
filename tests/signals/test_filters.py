"""Low-pass filters: what they were asked for, measured."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy import signal

from seakeep.signals import low_pass, lowpass_taps, resample


@settings(max_examples=25)
@given(st.floats(0.02, 0.3), st.floats(1.1, 1.5), st.sampled_from([50.0, 60.0, 80.0]))
def test_gains_of_the_taps(passband, ratio, attenuation):
    stopband = passband * ratio
    taps = lowpass_taps(1.0, passband, stopband, attenuation)
    frequency, response = signal.freqz(taps, worN=8192, fs=1.0)
    gain = np.abs(response)
    # The design is checked on a grid; between its points, 1/64 of a lobe apart, 1 ‰ may hide.
    ripple = 1.002 * 10 ** (-attenuation / 20)
    assert np.max(np.abs(gain[frequency <= passband] - 1)) < ripple
    assert np.max(gain[frequency >= stopband]) < ripple
    assert taps.size % 2 == 1
    assert_array_equal(taps, taps[::-1])
    assert taps.sum() == pytest.approx(1.0, rel=1e-12)  # unit gain at 0 Hz, to rounding


def test_the_filter_of_the_paper_has_about_2400_taps():
    assert 2300 < lowpass_taps(500.0, 10.0, 10.75, 60.0).size < 2500


def test_constants_and_ramps_are_kept_up_to_the_ends():
    t = np.arange(0, 10, 0.01)
    for series in (np.full(t.size, 3.0), 2.0 * t - 1.0):
        # Point reflection continues a ramp exactly: only rounding is left.
        assert_allclose(low_pass(series, 0.01, 2.0), series, atol=1e-12)


def test_a_coarser_record_averages_at_its_ends_too():
    # At its end the line through ten samples has (4 n - 2) / (n (n + 1)) = 0.35 of their variance.
    time = np.arange(400.0)
    first = resample(np.eye(400), time, time[:391:10])[0]
    last = resample(np.eye(400), time, time[9::10])[-1]
    assert_allclose([first @ first, last @ last], 38 / 110, rtol=0.02)
    assert_allclose([first @ time, last @ time], [0.0, 399.0], atol=0.01)
