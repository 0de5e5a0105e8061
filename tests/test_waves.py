"""Linear waves: limits, the paper's speeds, and the way back."""

from math import tau

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from seakeep.waves import GRAVITY, group_speed, phase_speed, wavelength_to_frequency, wavenumber


def test_deep_water():
    omega = np.array([0.5, 1.0, 5.0])
    # The closed form, to rounding.
    assert_allclose(wavenumber(omega), omega**2 / GRAVITY, rtol=1e-15)
    assert_allclose(phase_speed(omega), GRAVITY / omega, rtol=1e-15)
    assert_allclose(group_speed(omega), 0.5 * GRAVITY / omega, rtol=1e-12)


def test_shallow_water():
    depth, omega = 2.0, 1e-4
    # The first correction is of the order (kh)²/6 = 3e-10.
    speed = np.sqrt(GRAVITY * depth)
    for found in (phase_speed(omega, depth), group_speed(omega, depth)):
        assert_allclose(found, speed, rtol=1e-8)
    assert phase_speed(0.0, depth) == group_speed(0.0, depth) == speed
    assert wavenumber(0.0, depth) == 0.0


def test_speeds_of_the_paper():
    omega = wavelength_to_frequency(1.40 * np.array([1.5, 2.0, 3.0]), depth=3.6)
    # Printed with three decimals, 1.8107 rounded up and 2.0909 and 2.5607 cut off.
    assert_allclose(phase_speed(omega, depth=3.6), [1.811, 2.090, 2.560], atol=1e-3)
    # Printed group speeds are halves of these; at the longest wave, kh = 5.4, so are ours.
    assert_allclose(group_speed(omega, depth=3.6), [0.905, 1.045, 1.280], atol=1.5e-3)


def test_group_speed_is_the_slope_of_the_dispersion_relation():
    k, depth = np.array([0.1, 0.5, 1.0, 3.0]), 1.7
    h = 1e-5
    omega = [wavelength_to_frequency(tau / (k + d), depth) for d in (-h, h)]
    # Central difference: truncation of the order h², rounding of the order eps/h = 1e-11.
    slope = (omega[1] - omega[0]) / (2 * h)
    assert_allclose(group_speed(wavelength_to_frequency(tau / k, depth), depth), slope, rtol=1e-8)


@given(st.floats(0.01, 1e4), st.floats(0.01, 1e4) | st.just(np.inf))
def test_length_to_frequency_and_back(length, depth):
    k = wavenumber(wavelength_to_frequency(length, depth), depth)
    # Newton's method ends at rounding; ω² and tanh cost a few digits more.
    assert_allclose(tau / k, length, rtol=1e-12)


def test_no_number_of_a_sea_overflows():
    values = np.array([1e-9, 1e-3, 1.0, 1e3, 1e9])
    for function in (wavenumber, phase_speed, group_speed, wavelength_to_frequency):
        found = function(values, np.append(values, np.inf)[:, None])
        assert found.shape == (6, 5)
        assert np.isfinite(found).all()
