"""Carriers and the slow position against waves and oscillations that are known."""

from math import tau

import numpy as np
import pytest
from near import assert_near
from seas import sea

from seakeep.core.recursion import carried
from seakeep.signals.propagation import carriers, mean_spectrum, position_taps, slow_position

DT, PERIOD, DEPTH = 0.05, 1.6, 3.6  # s, s, m
TIME = DT * np.arange(4000)
PROBES, BACK, AHEAD, LEAD = (-3.0, 0.0), 96, 24, 20


def recorded(waves):
    """A sea at both probes."""
    return np.stack([waves.at(TIME, x) for x in PROBES], axis=1)


@pytest.fixture(scope="module")
def spectrum():
    return mean_spectrum([recorded(sea(seed)) for seed in (1, 2, 3)], DT, PERIOD)


def test_a_carried_wave_is_that_of_linear_dispersion_to_the_error_of_the_design(spectrum):
    places, waves = np.array([-0.4, 0.0, 0.7, 1.3]), sea(9)
    taps, errors = carriers(
        *spectrum, DEPTH, DT, probes=PROBES, back=BACK, ahead=AHEAD, targets=places,
        leads=np.full(4, LEAD),
    )  # fmt: skip
    found = carried(taps, recorded(waves))
    for column, place in enumerate(places):
        true = waves.at(TIME + LEAD * DT, place)[BACK:-AHEAD]
        # The design weighs all frequencies of training and noise; this sea has lines of its own.
        assert float(np.std(found[:, column] - true) / true.std()) < 1.5 * errors[column] + 0.02
        assert errors[column] < 0.12
    # At the probe itself, within what was read, the wave is the sample.
    assert errors[1] < 0.02


def test_the_position_follows_a_slow_oscillation_and_holds_at_rest():
    samples, period, ahead = 6000, 32, 24
    t = np.arange(samples)
    rng = np.random.default_rng(4)
    slow = sum(0.3 * np.sin(tau * t / (32 * p) + rng.uniform(0, 6.28)) for p in (11, 17, 26))
    quick = 0.05 * np.sin(tau * t / 32.7)
    taps = position_taps([slow + quick], period, period, ahead)
    assert_near(taps.sum(), 1.0, 1e-12)  # a vessel at rest is where it is
    place = np.convolve(slow + quick, taps, "valid")
    true = slow[period - 1 + ahead :]
    # Thirty-two samples tell a rate, which 24 samples later is that of another phase.
    assert np.std(place[: len(true)] - true) < 0.15 * slow.std()
    # Without delay: what the weights are fitted to.
    middle = slice(400, -400)
    assert_near(slow_position(slow + quick, period)[middle], slow[middle], 0.02)
