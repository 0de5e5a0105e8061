"""Quality checks: what each finds, and what it leaves alone."""

import numpy as np
import pytest

from seakeep.signals.quality import (
    compare_sensors,
    find_outliers,
    find_saturation,
    find_stuck,
    level_drift,
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
    assert compare_sensors(early, waves(), DT).lag == pytest.approx(-0.5, abs=0.004)


def test_lag_that_runs_away_beyond_half_a_period():
    stretched = np.interp(T * (1 - 1.2 / T[-1]), T, waves())
    found = compare_sensors(stretched, waves(), DT)
    assert 0.9 < found.growth < 1.2  # the middles of the first and last windows


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
