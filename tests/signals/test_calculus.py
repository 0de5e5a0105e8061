"""Integrals, derivatives and envelopes against analytic signals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from seakeep.signals import band_pass, differentiate, envelope_squared, integrate
from seakeep.signals.calculus import expected_in_gaps

DT = 0.01
T = np.arange(0, 80, DT)
INNER = slice(2500, -2500)


@settings(max_examples=20)
@given(st.floats(0.5, 4.0), st.floats(0.0, 6.28), st.sampled_from([0, 1, 2]))
def test_integral_of_a_wave_in_the_band(frequency, phase, times):
    omega = 2 * np.pi * frequency
    wave = np.sin(omega * T + phase)
    derivative = omega**times * np.sin(omega * T + phase + times * np.pi / 2)
    # What is slower than the band goes: an offset, and a drift.
    drifting = derivative + 0.2 + 0.01 * np.sin(2 * np.pi * 0.02 * T)
    out = (
        integrate(drifting, DT, (0.4, 5.0), times) if times else band_pass(drifting, DT, (0.4, 5.0))
    )
    # Linear prediction continues a wave over the ends; what is left is the offset's end.
    assert np.max(np.abs(out - wave)[INNER]) < 0.005
    assert np.max(np.abs(out - wave)) < 0.05


@pytest.mark.parametrize(("frequency", "gain"), {0.2: 0.0, 0.4: 0.5, 5.0: 0.5, 6.0: 0.0}.items())
def test_gain_of_the_band(frequency, gain):
    wave = np.sin(2 * np.pi * frequency * T)
    out = band_pass(wave, DT, (0.4, 5.0))[INNER]
    # Read off a record of 30 s with flanks of 0.2 Hz: a few per cent.
    assert np.sqrt(2) * out.std() == pytest.approx(gain, abs=0.03)


def test_derivative_of_a_quartic_is_exact():
    # Of a parabola at the ends too; rounding of T⁴ = 4e7 over dt.
    t = np.arange(0, 2, 0.1)
    assert_allclose(differentiate(t**4 - t, 0.1)[2:-2], (4 * t**3 - 1)[2:-2], atol=1e-11)
    assert_allclose(differentiate(t**2 - t, 0.1), 2 * t - 1, atol=1e-11)


def test_a_derivative_has_no_more_noise_at_its_ends():
    # Rows of weights; inside sqrt(2 (8² + 1)) / 12, and 67 / 12 by a quartic at the ends.
    noise = np.linalg.norm(differentiate(np.eye(9), 1.0), axis=1)
    assert_allclose(noise[2:-2], np.sqrt(130) / 12)
    assert noise.max() < 1.2


def test_gaps_have_the_waves_that_are_expected():
    t = np.arange(0, 60, 0.05)
    waves = np.cos(np.outer(t, np.linspace(0.7, 1.6, 12)) + np.arange(12.0) ** 2).sum(axis=1)
    for length in (8.0, 20.0):
        lost = (t >= 30) & (t < 30 + length)
        filled = expected_in_gaps(np.where(lost, 0.0, waves), lost)
        assert_allclose(filled[~lost], waves[~lost], atol=1e-12)
        if length == 8.0:
            assert np.abs(filled - waves).max() < 0.01 * waves.std()
        # In 20 s of 60 s what fits either side best is 68 times as high.
        assert np.abs(filled).max() < 1.01 * np.abs(waves).max()


def test_envelope_of_a_group():
    slow = 1.0 + 0.4 * np.cos(2 * np.pi * 0.05 * T)
    out = envelope_squared(5.0 + slow * np.sin(2 * np.pi * 1.0 * T), DT)
    # The kernel of the Hilbert transform falls as 1/(π t): a kink at an end, 25 s away, leaks
    # about 1/(π ω t) = 0.002 of its size, twice an amplitude of 1.4, into a square of 2.
    assert_allclose(out[INNER], (slow**2)[INNER], atol=0.03)
