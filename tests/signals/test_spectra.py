"""Zero crossings and the encounter period."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from seakeep.errors import DataError
from seakeep.signals import encounter_period, zero_up_crossings


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
