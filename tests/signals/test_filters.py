"""Filters: what they were asked for, measured; integrals and envelopes of analytic signals."""

from math import tau

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from scipy import signal

from seakeep.signals import (
    band_pass,
    differentiate,
    envelope_squared,
    integrate,
    low_pass,
    lowpass_taps,
)
from seakeep.signals.calculus import expected_in_gaps

DT = 0.01
T = np.arange(0, 80, DT)
INNER = slice(2500, -2500)


@settings(max_examples=25)
@given(st.floats(0.02, 0.3), st.floats(1.1, 1.5), st.sampled_from([50.0, 60.0, 80.0]))
def test_gains_of_the_taps(passband, ratio, attenuation):
    stopband = passband * ratio
    taps = lowpass_taps(1.0, passband, stopband, attenuation)
    frequency, response = signal.freqz(taps, worN=8192, fs=1.0)
    gain = np.abs(response)
    # The design is checked on a grid; between its points, 1/64 of a lobe apart, 1 ‰ may hide.
    ripple = 1.002 * 10 ** (-attenuation / 20)
    assert_near(gain[frequency <= passband], 1, ripple)
    assert np.max(gain[frequency >= stopband]) < ripple
    assert taps.size % 2 == 1
    assert_array_equal(taps, taps[::-1])
    assert_allclose(taps.sum(), 1.0, rtol=1e-12)  # unit gain at 0 Hz, to rounding


def test_the_filter_of_the_paper_has_about_2400_taps():
    assert 2300 < lowpass_taps(500.0, 10.0, 10.75, 60.0).size < 2500


def test_constants_and_ramps_are_kept_up_to_the_ends():
    t = np.arange(0, 10, 0.01)
    for series in (np.full(t.size, 3.0), 2.0 * t - 1.0):
        # Point reflection continues a ramp exactly: only rounding is left.
        assert_near(low_pass(series, 0.01, 2.0), series, 1e-12)


@settings(max_examples=20)
@given(st.floats(0.5, 4.0), st.floats(0.0, 6.28), st.sampled_from([0, 1, 2]))
def test_integral_of_a_wave_in_the_band(frequency, phase, times):
    omega = tau * frequency
    wave = np.sin(omega * T + phase)
    derivative = omega**times * np.sin(omega * T + phase + times * np.pi / 2)
    # What is slower than the band goes: an offset, and a drift.
    drifting = derivative + 0.2 + 0.01 * np.sin(tau * 0.02 * T)
    out = (
        integrate(drifting, DT, (0.4, 5.0), times) if times else band_pass(drifting, DT, (0.4, 5.0))
    )
    # Linear prediction continues a wave over the ends; what is left is the offset's end.
    assert_near(out[INNER], wave[INNER], 0.005)
    assert_near(out, wave, 0.05)


@pytest.mark.parametrize(("frequency", "gain"), {0.2: 0.0, 0.4: 0.5, 5.0: 0.5, 6.0: 0.0}.items())
def test_gain_of_the_band(frequency, gain):
    out = band_pass(np.sin(tau * frequency * T), DT, (0.4, 5.0))[INNER]
    # Read off a record of 30 s with flanks of 0.2 Hz: a few per cent.
    assert_near(np.sqrt(2) * out.std(), gain, 0.03)


def test_derivative_of_a_quartic_is_exact():
    # Fourth order, at the ends too; rounding of T⁴ = 4e7 over dt.
    t = np.arange(0, 2, 0.1)
    assert_near(differentiate(t**4 - t, 0.1), 4 * t**3 - 1, 1e-11)


def test_gaps_have_the_waves_that_are_expected():
    t = np.arange(0, 60, 0.05)
    waves = np.cos(np.outer(t, np.linspace(0.7, 1.6, 12)) + np.arange(12.0) ** 2).sum(axis=1)
    for length in (8.0, 20.0):
        lost = (t >= 30) & (t < 30 + length)
        filled = expected_in_gaps(np.where(lost, 0.0, waves), lost)
        assert_near(filled[~lost], waves[~lost], 1e-12)
        if length == 8.0:
            assert_near(filled, waves, 0.01 * waves.std())
        # In 20 s of 60 s what fits either side best is 68 times as high.
        assert np.abs(filled).max() < 1.01 * np.abs(waves).max()


def test_envelope_of_a_group():
    slow = 1.0 + 0.4 * np.cos(tau * 0.05 * T)
    out = envelope_squared(5.0 + slow * np.sin(tau * 1.0 * T), DT)
    # The kernel of the Hilbert transform falls as 1/(π t): a kink at an end, 25 s away, leaks
    # about 1/(π ω t) = 0.002 of its size, twice an amplitude of 1.4, into a square of 2.
    assert_near(out[INNER], (slow**2)[INNER], 0.03)
