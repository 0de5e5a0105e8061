"""Test inputs that repeat training inputs are found, up to a constant phase; others are not."""

import numpy as np
import pytest
import seas
from near import assert_near

from seakeep.signals import find_leakage

DT = 1.64 / 32
TIME = DT * np.arange(4096)
HALF = 2048


def sea(seed=0, jitter=0.0):
    """The paper's 100 components over 0.28–1.13 Hz, equally spaced or jittered within bins."""
    half = 0.5 * 0.85 / 99
    return seas.sea(seed, (0.28 - half, 1.13 + half), jitter=jitter).at(TIME)


def leak(training, test):
    return find_leakage(training, test, DT)


@pytest.mark.parametrize("seed", range(3))
def test_equally_spaced_components_come_back_after_116_5_seconds(seed):
    record = sea(seed) + 0.03 * np.random.default_rng(seed).standard_normal(TIME.size)
    found = leak([sea(9)[:HALF], record[:HALF]], record[HALF:])
    assert (found.training, found.share > 0.6) == (1, True)
    assert_near(HALF * DT + found.test_start - found.training_start, 99 / 0.85, DT)
    # 0.28 Hz times the repetition, less whole turns: 0.28 · 116.47 = 32.61 turns, that is 220°;
    # half a sample is 5° of the waves themselves.
    assert_near(np.degrees(found.phase) % 360, 220, 6)
    assert found.correlation > 0.99


@pytest.mark.parametrize("seed", range(5))
def test_other_seas_do_not(seed):
    assert leak([sea(seed + 10), sea(seed + 20)], sea(seed)) is None
    jittered = sea(seed, jitter=1.0)
    assert leak([jittered[:HALF]], jittered[HALF:]) is None


def test_a_few_waves_are_alike_in_any_two_seas():
    short = sea(0)[1000 : 1000 + 32 * 12]  # an irregular record, unlike four waves
    assert leak([sea(10), sea(20), sea(30)], short) is None
    assert leak([sea(1)], sea(1)[1000 : 1000 + 32 * 25]) is not None


def test_a_loop_of_forty_seconds_within_a_test():
    """25 periods of 210 s; 20 of them are a stretch."""
    record, count = sea(1, jitter=1.0), round(40 / DT)
    record[1000 : 1000 + count] = sea(0)[2000 : 2000 + count]
    found = leak([sea(0)], record)
    assert_near(found.training_start - found.test_start, 1000 * DT, DT)
    assert 0.1 < found.share < 0.25


def test_regular_waves_repeat_by_their_nature():
    wave = 0.05 * np.sin(3.0 * TIME) * (1 + 0.04 * np.sin(0.3 * TIME))
    assert leak([wave[:HALF]], wave[HALF:]) is None
    assert leak([sea()], np.zeros(100)) is None
    assert leak([sea()[:100]], sea()) is None  # shorter than a stretch


def test_still_water_before_the_waves_is_no_part_of_the_comparison():
    # Two wave trains that build up after still water: they differ in all but that.
    ramp = np.clip((TIME - 20.0) / 10.0, 0.0, 1.0)
    trains = [ramp * np.sin(2 * np.pi * TIME / period) for period in (0.9, 0.63)]
    assert leak([trains[0]], trains[1]) is None
    found = leak([sea()], np.concatenate([np.zeros(600), sea()[:1400]]))
    assert found.share == 1.0
    assert_near(found.test_start - found.training_start, 600 * DT, DT)
