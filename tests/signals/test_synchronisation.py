"""Clocks recovered from pulses; from signals: `tests/campaign/test_steps.py`."""

from math import tau

import numpy as np
import pytest
from near import assert_near
from numpy.random import default_rng
from records import rms
from said import data_error

from seakeep.signals import (
    Clock,
    clock_from_correlation,
    clock_from_pulses,
    clock_from_shared,
    pool_drift,
)
from seakeep.signals.lags import _correlation
from seakeep.signals.synchronisation import without_doubtful_drift


def pulses(t):
    phase = t % 20.0 - 10.0
    return np.where(np.abs(phase) < 0.25, np.cos(tau * phase) ** 2, 0.0)


def logger(signal, rate, length, noise, seed, offset=0.0, drift=0.0):
    readings = np.arange(round(length * rate)) / rate
    true = (readings - offset) / (1 + drift)
    return signal(true) + noise * default_rng(seed).standard_normal(true.size), readings


@pytest.mark.parametrize(
    ("rate", "offset", "drift", "noise"),
    [(500.0, 0.0, 0.0, 0.002), (50.0, 0.37, 25e-6, 0.002), (30.0, -1.2, -40e-6, 0.02)],
)
def test_pulses_give_offset_and_drift_with_honest_errors(rate, offset, drift, noise):
    misses = []
    for seed in range(20):
        ours = logger(pulses, rate, 270.0, noise, seed, offset, drift)
        clock = clock_from_pulses(*ours, *logger(pulses, 500.0, 270.0, 0.002, 100 + seed))
        # Below 2 ms for a fast logger, a tenth of a sample for the others: the bounds.
        assert abs(clock.offset - offset) < (2e-3 if rate >= 500 else 0.1 / rate)
        misses.append(
            (
                (clock.offset - offset) / clock.offset_error,
                (clock.drift - drift) / clock.drift_error,
            )
        )
    # The scatter of 20 normalised errors is 1 ± 0.16; within 3 of these.
    assert_near(np.std(misses, axis=0), 1, 0.5)


def waves(seed):
    rng = default_rng(seed)
    omega, phase = tau * rng.uniform(0.3, 0.9, 12), rng.uniform(0, tau, 12)
    return lambda t: np.cos(np.outer(t, omega) + phase).sum(axis=1) / np.sqrt(6)


@pytest.mark.parametrize(
    ("rates", "noises", "worst"),
    [((50, 50), (0, 0.05), 1e-3), ((30, 200), (0.2, 0.02), 3e-3), ((80, 50), (0.05, 0.05), 1e-3)],
)
def test_a_shared_signal_gives_honest_errors_through_the_noise_of_both(rates, noises, worst):
    # With the noise of both left in, errors are three to seven times what is claimed.
    misses = []
    for seed in range(12):
        ours = logger(waves(seed), rates[0], 100.0, noises[0], seed, 0.3717, -40e-6)
        reference = logger(waves(seed), rates[1], 100.0, noises[1], 50 + seed)
        clock = clock_from_shared(3 * ours[0] + 1, ours[1], *reference)
        read = clock.reading(clock.centre) - 0.3717 - (1 - 40e-6) * clock.centre
        error = clock.reading_error(clock.centre)
        assert abs(read) < worst
        misses.append((read / error, (clock.drift + 40e-6) / clock.drift_error))
    # The root mean square of 12 normalised errors is 1 ± 0.2.
    assert_near(np.sqrt(np.mean(np.square(misses), axis=0)), 1, 0.6)


def test_windows_that_share_a_half_are_not_counted_twice():
    misses = []
    for seed in range(25):
        ours, readings = logger(waves(seed), 20.0, 200.0, 0.0, seed, 0.3, 20e-6)
        other = waves(1000 + seed)(readings)  # what only one of them sees
        reference = logger(waves(seed), 20.0, 200.0, 0.0, seed)
        clock = clock_from_correlation(ours + 0.3 * other, readings, *reference, 20.0, 1.0)
        misses.append((clock.drift - 20e-6) / clock.drift_error)
    # The root mean square of 25 is 1 ± 0.14.
    assert_near(rms(misses), 1, 0.42)


@pytest.mark.parametrize(
    ("find", "offset", "drift", "other"),
    [
        (clock_from_correlation, 40.0, 0.0, 0.0),  # windows at wrong lags scatter
        (clock_from_correlation, 5.05, 0.0, 0.0),  # 0.98 at the last lag, 0.05 s off
        (clock_from_shared, 0.3, 3e-3, 0.0),  # no clock drifts so
        (clock_from_shared, 0.3, 0.0, 1.0),  # two signals that only go together
    ],
)
def test_what_is_no_clock_is_refused(find, offset, drift, other):
    def signal(t):
        return waves(0)(t) + other * waves(1)(t)

    ours = logger(signal, 20.0, 200.0, 0.0, 0, offset, drift)
    with data_error("largest_lag"):
        find(*ours, *logger(waves(0), 20.0, 200.0, 0.0, 0), 20.0, 5.0)


def test_pulses_down_lost_and_doubled():
    signal, time = logger(pulses, 100.0, 200.0, 0.001, 0, 0.2, 1e-5)
    reference, instants = logger(pulses, 500.0, 200.0, 0.001, 1)
    signal[(time > 45) & (time < 55)] = 0.0  # a lost pulse
    signal[(time > 61) & (time < 61.02)] = 5.0  # a spike is no pulse
    clock = clock_from_pulses(-3 * signal + 7, time, reference, instants)
    assert_near(clock.offset, 0.2, 1e-3)
    assert clock.count == 9
    assert_near(clock.modulus, 20.0, 0.1)
    assert clock.describe().endswith("ppm (trigger pulses, n = 9)")
    # Which period of the train is meant can be said.
    stated = clock_from_pulses(signal, time, reference, instants, expected_offset=19.0)
    assert_near(stated.offset, 20.2, 3e-3)


def test_uneven_pulses_leave_no_doubt():
    def train(t):
        return sum(np.exp(-(((t - c) / 0.1) ** 2)) for c in (5.0, 17.0, 31.0, 64.0, 90.0))

    clock = clock_from_pulses(
        *logger(train, 100.0, 130.0, 0.001, 0, 33.0), *logger(train, 500.0, 100.0, 0.001, 1)
    )
    assert_near(clock.offset, 33.0, 1e-3)
    assert clock.modulus == np.inf


def test_one_pulse_gives_an_offset_and_no_drift():
    clock = clock_from_pulses(
        *logger(pulses, 100.0, 20.0, 0.001, 0, 0.2), *logger(pulses, 500.0, 20.0, 0.001, 1)
    )
    assert_near(clock.offset, 0.2, 1e-3)
    assert clock.drift == 0
    assert np.isnan(clock.drift_error)


def clock(drift, error=2e-6):
    return Clock(0.1, drift, 1e-3, error, "trigger pulses", 13, 1e-3, centre=100.0)


def test_drifts_that_differ_are_not_pooled():
    apart = [clock(10e-6), clock(60e-6)]
    assert pool_drift(apart) == apart
    one, other, same = pool_drift([clock(20e-6), clock(22e-6), Clock()])
    assert one.drift == other.drift == pytest.approx(21e-6)
    assert one.drift_error == pytest.approx(2e-6 / np.sqrt(2))
    assert one.method == "trigger pulses, drift of 2 runs"
    assert_near(one.reading(100.0), clock(20e-6).reading(100.0), 1e-12)
    assert same == Clock()


def test_a_doubtful_drift_is_not_applied():
    doubtful = clock(20e-6, 11e-6)
    offset = without_doubtful_drift(doubtful)
    assert offset.drift == 0
    assert "offset only" in offset.describe()
    assert_near(offset.reading(100.0), doubtful.reading(100.0), 1e-12)
    certain = clock(20e-6, 9e-6)
    assert without_doubtful_drift(certain) == certain


def test_the_correlation_at_a_lag_is_that_of_the_samples_in_common():
    a, b = default_rng(0).standard_normal((2, 40)) + 5.0
    found = _correlation(a, b, np.array([-25, 0, 25]))
    expected = [np.corrcoef(x, y)[0, 1] for x, y in ((a[25:], b[:15]), (a, b), (a[:15], b[25:]))]
    assert_near(found, expected, 1e-12)  # rounding of an FFT
