"""Elevation carried to another place: exact waves, moving vessels, irregular seas, errors."""

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from records import rms
from seas import sea

from seakeep.signals import carry_by_celerity, carry_by_dispersion

DEPTH = 3.6
DT = 1.64 / 32
TIME = DT * np.arange(2048)
WAVES = sea()
INNER = slice(200, -200)  # 10 s: what was at the probe before or after the record is a guess


def drifting():
    """Surge of a moored vessel: a slow drift with wave-frequency motion on it."""
    return 0.5 + 0.4 * np.sin(2 * np.pi * TIME / 30) + 0.03 * np.sin(3.0 * TIME)


def carried_to(place, carry, record, *how):
    """Elevation at one place, or at one per sample."""
    span = float(np.min(place)), float(np.max(place))
    return carry(record, DT, span, *how).at(place).reshape(record.shape)


@pytest.mark.parametrize("distance", [1.0, -1.0, 3.67, "moving"])
def test_an_irregular_sea_is_carried_by_dispersion(distance):
    place = drifting() if distance == "moving" else distance
    carried = carried_to(place, carry_by_dispersion, WAVES.at(TIME), DEPTH, 1.2)
    # 1e-3 of the sea's SD: the Jacobi-Anger series ends at 1e-9; the rest is the ends' fade.
    assert rms((carried - WAVES.at(TIME, place))[INNER]) < 1e-3 * WAVES.at(TIME).std()
    # Above the frequency that holds 99.9 % of the variance the wavenumber goes on along its
    # tangent: the root of a thousandth (3 %) times a phase error of some 0.3 rad over 3.67 m.
    limited = carried_to(place, carry_by_dispersion, WAVES.at(TIME), DEPTH) - WAVES.at(TIME, place)
    assert rms(limited[INNER]) < 0.015 * WAVES.at(TIME).std()


def test_one_celerity_is_the_paper_s_delay():
    place, celerity = drifting(), 2.8
    slow = 0.3 * np.cos(3.0 * TIME + 0.4) + 0.2 * np.cos(5.1 * TIME)
    carried = carried_to(place, carry_by_celerity, slow, celerity)
    late = TIME - place / celerity
    exact = 0.3 * np.cos(3.0 * late + 0.4) + 0.2 * np.cos(5.1 * late)
    assert_near(carried[INNER], exact[INNER], 1e-4)


def test_nothing_moves_at_no_distance():
    record = np.column_stack([WAVES.at(TIME) + 0.3, sea(1).at(TIME) - 2.0])
    # A transform and its inverse, at the rounding of values of some 10.
    for carry, by in ((carry_by_dispersion, DEPTH), (carry_by_celerity, 2.8)):
        assert_near(carry(record, DT, (0.0, 0.0), by).at(0.0).reshape(record.shape), record, 1e-12)


def test_a_place_outside_the_range_is_taken_to_its_end():
    carried = carry_by_dispersion(WAVES.at(TIME), DT, (0.0, 1.0), DEPTH)
    assert_array_equal(carried.at(5.0), carried.at(1.0))
    assert_allclose(carried.at(0.4, 100), carried.at(np.full(5, 0.4), slice(98, 103))[2])
