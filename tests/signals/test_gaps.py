"""Gaps and jitter: told, masked, and bridged only when asked."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from seakeep import DataError
from seakeep.signals import bridge, inspect_times, onto_uniform, uniform_step


def test_gaps_are_told_and_masked():
    t = 0.02 * np.arange(500)
    kept = np.ones(500, bool)
    kept[100:110] = kept[300] = False
    report = inspect_times(t[kept])
    assert inspect_times(np.round(np.arange(900) / 30, 3)).uniform  # decimals are no jitter
    assert report.gaps == ((1.98, 0.22), (5.98, 0.04))
    assert (report.missing, report.jittered) == (11, False)
    time, x = onto_uniform(t[kept], np.sin(t[kept]))
    assert_allclose(time, t, atol=1e-12)
    assert_array_equal(np.isnan(x), ~kept)
    assert_array_equal(x[kept], np.sin(t[kept]))


def test_rounding_of_times_does_not_add_up_over_a_long_gap():
    t = np.arange(1800) / 30 + 20 * (np.arange(1800) >= 900)
    report = inspect_times(np.round(t, 3))
    assert (report.missing, report.jittered) == (600, False)
    assert report.step == pytest.approx(1 / 30, rel=1e-6)
    with pytest.raises(DataError, match=r"600 sample\(s\) of 0\.0333333 s are missing"):
        uniform_step(np.round(t, 3))


def test_jitter_is_told_and_interpolated_away():
    rng = np.random.default_rng(0)
    t = 0.02 * np.arange(500) + 0.002 * rng.standard_normal(500)
    report = inspect_times(t)
    assert report.jittered
    assert report.jitter_rms == pytest.approx(0.002, rel=0.1)
    time, x = onto_uniform(t, np.sin(2 * np.pi * t))
    assert np.ptp(np.diff(time)) < 1e-12
    # A wave of 50 samples: cubic splines leave 1e-5, and the first sample is held.
    assert_allclose(x[1:-1], np.sin(2 * np.pi * time)[1:-1], atol=1e-4)


def test_short_gaps_are_bridged_and_long_ones_marked():
    t = 0.01 * np.arange(1000)
    x = np.sin(2 * np.pi * 0.5 * t)
    holed = x.copy()
    holed[100:115] = holed[400:600] = holed[:3] = np.nan
    result = bridge(holed, 0.01, longest=0.2)
    assert np.flatnonzero(result.short).tolist() == list(range(100, 115))
    assert result.long.sum() == 203
    # 0.15 s of a wave of 2 s, beside its crest: a monotone cubic cuts off 1 − cos(π 0.15/2).
    assert np.max(np.abs(result.values - x)[100:115]) < 0.03
    there = np.isfinite(holed)
    assert_array_equal(result.values[there], x[there])
