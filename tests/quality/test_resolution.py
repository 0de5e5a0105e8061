"""The step in which a sensor reads, read off its record."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from seas import sea

from seakeep.quality.faults import reading_step

T = np.arange(0, 100, 0.005)
SEA = sea(3, (0.4, 0.9), peak=1.6, components=20).at(T)


@given(
    step=st.floats(0.05, 3.0),
    offset=st.floats(-10, 10),
    gain=st.sampled_from([1e-3, 1.0, 1e3]),
    every=st.sampled_from([1, 2, 4]),
)
@settings(max_examples=40)
def test_the_step_of_an_ideal_rounding_sensor_is_found(step, offset, gain, every):
    read = gain * step * np.round((SEA[::every] + offset) / step)
    # Samples are so close that the motion passes one step at a time, to rounding.
    assert reading_step(read) == pytest.approx(gain * step, rel=1e-6)


@pytest.mark.parametrize("every", [8, 10, 13])
def test_frames_that_were_interpolated_to_a_faster_rate(every):
    read = 0.5 * np.round(SEA[::every] / 0.5)
    # Frames fall between samples, so that the last part of a change is missed: one of `every`.
    between = np.interp(T, T[::every] + 0.0013, read)
    assert reading_step(between) == pytest.approx(0.5, rel=1.1 / every)


def test_noise_larger_than_the_step_hides_it():
    noisy = SEA + 0.05 * np.random.default_rng(3).standard_normal(SEA.size)
    for read in (SEA, np.full(500, 2.0), np.where(T < 50, SEA, SEA[10_000])):  # the last froze once
        assert np.isnan(reading_step(read))
    assert np.isnan(reading_step(np.round(noisy, 5)))
    # Steps well above the noise are seen through it.
    assert reading_step(0.4 * np.round(noisy / 0.4)) == pytest.approx(0.4, rel=1e-6)
