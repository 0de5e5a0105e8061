"""Quality checks: what each finds, and what it leaves alone."""

import numpy as np
import pytest

from seakeep.signals.quality import (
    LATE,
    LEAST_CORRELATION,
    RUN_AWAY,
    compare_sensors,
    find_outliers,
    find_saturation,
    find_stuck,
    level_drift,
    reading_step,
)

DT = 0.04
T = DT * np.arange(3000)


def waves(shift=0.0, seed=0):
    frequency = np.linspace(0.4, 0.9, 20)
    phase = np.random.default_rng(seed).uniform(0, 6.28, 20)
    return np.cos(2 * np.pi * np.outer(T - shift, frequency) + phase).sum(axis=1)


@pytest.fixture
def noisy():
    x = waves()
    return x + 0.02 * x.std() * np.random.default_rng(1).standard_normal(x.size)


def test_a_sound_series_is_left_alone(noisy):
    assert not find_outliers(noisy).any()
    assert not find_saturation(noisy).any()
    assert not find_stuck(noisy, DT, 1.5).any()
    change, sure = level_drift(noisy, DT, 1.6)
    assert abs(change) < 0.5 * noisy.std() or sure < 5


def test_noise_alone_gives_no_outliers():
    assert not find_outliers(np.random.default_rng(0).standard_normal(100_000)).any()


def test_spikes(noisy):
    at = [100, 700, 1500, 2980]
    noisy[at] += 3 * noisy.std()
    assert np.flatnonzero(find_outliers(noisy)).tolist() == at


def test_still_before_the_waves_is_not_stuck(noisy):
    noisy[:600] = noisy[600]
    witness = waves() * (np.arange(3000) >= 600)
    assert not find_stuck(noisy, DT, 1.5).any()
    assert not find_stuck(noisy, DT, 1.5, witness).any()
    assert find_stuck(noisy, DT, 1.5, waves()).sum() == 601  # a witness that moved


def test_lag_is_positive_where_the_sensor_is_late():
    late, early = waves(0.5), waves(-0.5)
    found = compare_sensors(late, waves(), DT)
    # A parabola through samples 0.04 s apart: within a tenth of them.
    assert found.lag == pytest.approx(0.5, abs=0.004)
    assert found.faults()[0].startswith("lag +0.50")
    assert compare_sensors(early, waves(), DT).lag == pytest.approx(-0.5, abs=0.004)


def test_lag_that_runs_away_beyond_half_a_period():
    stretched = np.interp(T * (1 - 1.2 / T[-1]), T, waves())
    found = compare_sensors(stretched, waves(), DT)
    assert 0.9 < found.growth < 1.2  # the middles of the first and last windows
    assert "runs away" in found.faults()[0]


def test_constant_and_unrelated():
    assert compare_sensors(np.full(3000, 0.2), waves(), DT).faults() == [
        "constant while the other sensor moves"
    ]
    assert "agrees poorly" in compare_sensors(waves(seed=7), waves(), DT).faults()[0]
    assert compare_sensors(waves(0.05), waves(), DT).faults() == []


@pytest.mark.parametrize(
    ("factor", "told"),
    [(1000.0, True), (2.2, True), (1.9, False), (0.55, False), (0.45, True), (0.001, True)],
)
def test_another_scale(factor, told):
    """A wrong unit does not change a correlation; the limits are 2 and 1/2, within windows."""
    slow = 3.0 * np.sin(2 * np.pi * DT * np.arange(waves().size) / 200.0)
    found = compare_sensors(factor * (waves() + slow), waves(), DT)
    assert found.correlation > 0.9
    scales = [fault for fault in found.faults() if fault.startswith("scale")]
    assert bool(scales) is told
    assert found.gain == pytest.approx(factor, rel=0.1)  # the slow motion is a tenth in a window


def test_the_limits_on_lags_are_where_they_alone_make_the_least_correlation():
    period = 1.6
    t = np.arange(0, 200 * period, 0.001 * period)
    still = np.sin(2 * np.pi * t / period)
    late = np.sin(2 * np.pi * (t / period - LATE))
    assert np.corrcoef(still, late)[0, 1] == pytest.approx(LEAST_CORRELATION, abs=1e-3)
    grown = np.sin(2 * np.pi * (t / period - RUN_AWAY * (t / t[-1] - 0.5)))
    # The limit is stated to two digits.
    assert np.corrcoef(still, grown)[0, 1] == pytest.approx(LEAST_CORRELATION, abs=5e-3)


@pytest.mark.parametrize(("part", "flagged"), [(0.8, False), (1.2, True)])
def test_either_side_of_the_limit_on_lags(part, flagged):
    trusted = waves()
    period = compare_sensors(trusted, trusted, DT).period
    late = np.interp(T - part * LATE * period, T, trusted)
    assert bool(compare_sensors(late, trusted, DT).faults()) is flagged
    grown = np.interp(T - part * RUN_AWAY * period * (1.1 * T / T[-1] - 0.55), T, trusted)
    assert bool(compare_sensors(grown, trusted, DT).faults()) is flagged


def test_what_stands_still_has_no_lag():
    """A sensor that runs away and then freezes: the windows that it froze in say nothing."""
    stretched = np.interp(T * (1 - 1.2 / T[-1]), T, waves())
    frozen = np.where(np.arange(T.size) < 2600, stretched, stretched[2600])
    held = np.arange(T.size) >= 2600
    found = compare_sensors(frozen, waves(), DT, held=held)
    assert found.growth == pytest.approx(
        1.2 * 2600 / T.size, abs=0.15
    )  # windows of 3 s at the ends
    assert found.centre[-1] < 2600 * DT


@pytest.mark.parametrize(("spanned", "flagged"), [(2, True), (4, True), (7, False), (20, False)])
def test_motion_below_the_resolution(noisy, spanned, flagged):
    trusted = waves()
    step = 2 * np.sqrt(2) * trusted.std() / spanned
    read = step * np.round(noisy / step)
    found = compare_sensors(read, trusted, DT, step=reading_step(read))
    assert found.spanned == pytest.approx(spanned, rel=0.05)  # windows of an irregular sea
    assert any(each.startswith("motion below the resolution") for each in found.faults()) is flagged
