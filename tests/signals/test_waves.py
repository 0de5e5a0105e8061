"""Zero crossings, the encounter period, spectra and heights."""

from dataclasses import replace
from math import tau

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose
from seas import sea

from seakeep.signals import (
    encounter_period,
    repeated_waves,
    wave_heights,
    wave_spectrum,
    wave_statistics,
    waves_part,
    zero_up_crossings,
)
from seakeep.signals.waves import WAVES, energy_above, is_regular


def test_crossings_lie_between_samples():
    assert_allclose(zero_up_crossings([-1.0, 3.0, -1.0, -1.0], 0.5), [0.125])


def test_waves_are_regular_with_a_start_and_harmonics_and_a_narrow_sea_is_not():
    t = np.arange(0, 60, 0.02)
    wave = np.sin(6.0 * t) + 0.5 * np.sin(12.0 * t) + 0.2 * np.sin(18.0 * t)
    assert is_regular(np.clip(t / 15 - 1, 0, 1) * wave)  # still for a quarter, then a ramp
    assert not is_regular(wave + 0.7 * np.sin(7.0 * t))
    for seed in range(5):  # eight waves or so
        assert not is_regular(sea(seed, band=(0.38, 0.7)).at(np.arange(0, 16, 0.02)))
    assert not is_regular(sea(0, band=(0.7, 1.3), peak=1.1).at(np.arange(0, 100, 0.02)))


def test_a_focused_group_repeats_no_sea_that_holds_a_group_like_it():
    t = np.arange(0, 120, 0.1)
    seas = [sea(seed, band=(0.38, 0.6)) for seed in range(20)]
    records = {str(seed): each.at(t) for seed, each in enumerate(seas)}
    group = replace(seas[0], phase=-tau * 60 * seas[0].frequency).at(t)
    group *= 3.0 / group.max()
    records |= {"group": group, "again": np.roll(group, 30), "cut": records["3"][200:800]}
    alike = {name: first for name, first in repeated_waves(records, 0.1).items() if name != first}
    assert alike == {"again": "group", "cut": "3"}


def test_the_spectrum_holds_the_variance():
    series = default_rng(0).standard_normal(20_000)
    for options in ({}, {"segment": 4096, "overlap": 128, "padded": 65536}):
        frequency, density = wave_spectrum(series, 0.05, **options)
        # White noise of unit variance, 5 to 16 segments: a per cent or two of the variance.
        assert_allclose(np.trapezoid(density, frequency), 1.0, rtol=0.04)


def test_heights_are_crest_less_trough():
    t = np.arange(0, 40, 0.005)
    # Beats: the heights follow the envelope, twice the amplitude on average.
    heights = wave_heights((1 + 0.1 * np.sin(0.5 * t)) * np.sin(6.0 * t), 0.005)
    assert_allclose(heights.mean(), 2.0, rtol=0.01)
    assert_allclose(np.ptp(heights), 0.4, rtol=0.05)


@given(st.floats(1.0, 4.0), st.floats(0.01, 2.0))
def test_statistics_of_a_regular_wave(period, height):
    found = wave_statistics(0.5 * height * np.sin(tau * np.arange(0, 240, 0.05) / period), 0.05)
    # A broken number of waves in 240 s, and for the peak a parabola within bins of 1/60 Hz.
    assert_allclose(found.significant_height, 2**0.5 * height, rtol=0.02)
    assert_allclose(found.zero_crossing_period, period, rtol=5e-3)
    assert_allclose(found.peak_period, period, rtol=0.01)
    assert_allclose(found.moment_period, period, rtol=0.02)


T = 0.02 * np.arange(12_000)


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_a_record_that_begins_and_ends_in_waves_is_counted_as_the_paper_does(seed):
    x = sea(seed).at(T[:6000])
    assert zero_up_crossings(x, 0.02).size == np.count_nonzero(np.diff(np.sign(x - x.mean())) > 0)
    assert waves_part(x, 0.02) == slice(0, x.size)


@pytest.mark.parametrize(("still", "drift"), [(12.0, 0.0), (40.0, 0.05), (400.0, 0.05)])
@pytest.mark.parametrize("after", [False, True])
def test_still_water_around_the_waves_is_not_counted(still, drift, after):
    """Noise and slow drift of the probe cross the mean hundreds of times before the waves."""
    rng = default_rng(3)
    x = sea(2).at(T)
    true = encounter_period(x, 0.02)
    quiet = int(still / 0.02)
    whole = np.concatenate([np.zeros(quiet), x, np.zeros(quiet * after)])
    whole = whole + drift * np.sin(tau * 0.02 * np.arange(whole.size) / 37) + 0.03
    noise = 0.02 * rng.standard_normal(whole.size)
    noise[quiet : quiet + x.size] = 0.0  # what noise does among the waves is another question
    # The first waves may fall to the still part: a few of 140, and the mean moves by as little.
    assert_allclose(encounter_period(whole + noise, 0.02), true, rtol=0.01)
    assert quiet * 0.02 - 0.1 <= zero_up_crossings(whole + noise, 0.02)[0] < quiet * 0.02 + 5
    assert_near(wave_heights(whole + noise, 0.02).size, T[-1] / true, 4)


def test_noise_on_the_waves_is_not_counted_with_hysteresis():
    x = sea(4).at(T)
    noisy = x + 0.04 * default_rng(0).standard_normal(x.size)
    least = 0.2  # five deviations of the noise
    assert zero_up_crossings(noisy, 0.02).size > 1.2 * zero_up_crossings(x, 0.02).size
    clean = zero_up_crossings(x, 0.02, least).size
    # A wave whose crest just reaches the limit may count on one side alone.
    assert_near(zero_up_crossings(noisy, 0.02, least).size, clean, 2)
    # Waves whose crest or trough stays below a fifth of a deviation are left out: few.
    assert_allclose(encounter_period(noisy, 0.02, least), encounter_period(x, 0.02), rtol=0.1)
    regular = np.sin(tau * np.arange(0, 100, 0.02) / 1.7 + 1)
    assert encounter_period(regular, 0.02, 0.3) == encounter_period(regular, 0.02)


def test_what_a_coarser_step_takes_is_the_spectrum_s_own_integral():
    """Of Pierson and Moskowitz', 1 - exp(-1.25 (fp/f)^4) lies above f; seas scatter around it."""
    seas = [sea(seed, (0.4, 6.0), peak=1.0, components=300).at(T[::2]) for seed in range(8)]
    for edge in (1.0, 1.5, 2.0):
        found = np.mean([energy_above(each, 0.04, edge)[0] for each in seas])
        above = 1 - np.exp(-1.25 / edge**4) / np.exp(-1.25 / WAVES[1] ** 4)
        # Eight seas of 240 waves: their energy is known to some 3 %.
        assert_near(found, above, 0.03)
    # Noise above three times the peak does not count, and a constant has no waves.
    noise = 0.3 * default_rng(0).standard_normal(seas[0].size)
    assert energy_above(seas[0] + noise, 0.04, 4.0)[0] == 0.0
    assert np.isnan(energy_above(np.ones(100), 0.1, 1.0)).all()
