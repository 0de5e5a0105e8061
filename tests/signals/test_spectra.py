"""Zero crossings and the encounter period."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seakeep.errors import DataError, RequestError
from seakeep.signals import encounter_period, peak_period, wave_statistics, zero_up_crossings
from seakeep.signals.spectra import paper_welch


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


def test_a_coarse_spectrum_moves_the_peak():
    # Nominal 2.12 s: segments of 8.2 s have bins of 0.12 Hz (the paper reads 2.02 s from them).
    rng = np.random.default_rng(0)
    t = np.arange(0, 600, 0.02)
    f = np.linspace(0.28, 1.13, 400) + rng.uniform(-1e-3, 1e-3, 400)
    density = f**-5 * np.exp(-1.25 * (1 / (2.12 * f)) ** 4)
    phase = rng.uniform(0, 2 * np.pi, 400)
    series = sum(
        np.sqrt(d) * np.cos(2 * np.pi * a * t + p)
        for a, d, p in zip(f, density, phase, strict=True)
    )
    coarse, fine = peak_period(series, 0.02, "paper"), peak_period(series, 0.02)
    assert coarse < 2.08
    # A minute's segments: bins of 1/60 Hz and 20 of them; the peak of a random sea scatters.
    assert fine == pytest.approx(2.12, rel=0.08)


@given(st.floats(1.0, 4.0), st.floats(0.01, 2.0))
def test_statistics_of_a_regular_wave(period, height):
    t = np.arange(0, 240, 0.05)
    found = wave_statistics(0.5 * height * np.sin(2 * np.pi * t / period), 0.05)
    # A broken number of waves in 240 s, and for the peak a parabola within bins of 1/60 Hz.
    assert found.significant_height == pytest.approx(2**0.5 * height, rel=0.02)
    assert found.zero_crossing_period == pytest.approx(period, rel=5e-3)
    assert found.peak_period == pytest.approx(period, rel=0.01)
    assert found.moment_period == pytest.approx(period, rel=0.02)


def test_paper_welch_keeps_its_seconds():
    segment, overlap, padded = paper_welch(0.05)
    assert (segment * 0.05, overlap * 0.05) == pytest.approx((8.2, 0.25), abs=0.03)
    assert padded * 0.05 == pytest.approx(131.07, abs=0.03)


@pytest.mark.parametrize(
    ("call", "kind", "message"),
    [
        (lambda: peak_period(np.ones(9), 1.0, "rec"), RequestError, "preset must be 'recommended'"),
        (lambda: peak_period(np.ones(99), 1.0), DataError, "the record is constant: it has no pea"),
    ],
)
def test_what_has_no_peak(call, kind, message):
    with pytest.raises(kind, match=message):
        call()
