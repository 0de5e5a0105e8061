"""Time axes, their gaps and jitter, and resampling."""

from math import tau

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from said import data_error
from scipy import special

from seakeep.signals import bridge, inspect_times, onto_uniform, resample, uniform_step


def test_step_comes_back_as_meant():
    assert uniform_step(np.cumsum(np.full(1000, 0.04))) == 0.04
    assert uniform_step(100.0 + np.arange(500) * 0.774) == 0.774


@pytest.mark.parametrize("rate", [30.0, 60.0, 29.97, 512.0])
def test_times_with_few_decimals_are_uniform(rate):
    # Milliseconds: the instants are off by up to 3 % of a step at 60 Hz, 26 % at 512 Hz.
    time = np.round(np.arange(3000) / rate, 4 if rate > 100 else 3)
    # The ends of the record are rounded too, by a part of a step in 3000.
    assert_allclose(uniform_step(time), 1 / rate, rtol=1e-4)


@pytest.mark.parametrize(
    ("message", "time"),
    {
        r"the run has 1 instant\(s\); a time axis needs at least two": [0.0],
        "hold a value that is not finite at sample 1 .1 in all.*Remove these": [0.0, np.nan, 0.2],
        r"repeat: 0\.1 s stands at samples 1 and 2 \(1 rep.*\. Remove": [0.0, 0.1, 0.1, 0.2],
        r"not sorted: 0\.05 s follows 0\.1 s at sample 2\. Sort": [0.0, 0.1, 0.05, 0.2],
        r"1 gap\(s\): after t = 0\.2 s, 2 sample\(s\) of 0\.1 s are missing; the longest gap"
        r", after t = 0\.2 s, lasts 0\.3 s\. Fill the gap": [0.0, 0.1, 0.2, 0.5, 0.6, 0.7, 0.8],
        r"not uniform: steps run from 0\.05 to 0\.14 s \(median 0\.1 s\), the oddest after t = 0\.":
            [0.0, 0.1, 0.2, 0.34, 0.45, 0.5, 0.6],
    }.items(),
)  # fmt: skip
def test_what_is_no_uniform_axis(time, message):
    with data_error(message):
        uniform_step(time)


@pytest.mark.parametrize("new_dt", [4.0, 5.25, 10.0])
def test_what_would_alias_is_removed(new_dt):
    time = np.arange(6000.0)
    new_time = np.arange(0, 5990, new_dt)
    for factor in (1.05, 1.3, 1.9):
        above = np.sin(tau * factor * 0.5 / new_dt * time)
        inner = slice(int(800 / new_dt), -int(800 / new_dt))
        # 60 dB, within about 1 dB.
        assert np.max(np.abs(resample(above, time, new_time)[inner])) < 1.5e-3
        # As the paper takes samples: what its filter lets pass is folded.
        assert np.abs(resample(above, time, new_time, anti_alias=False)[inner]).max() > 0.9


def direct_sums(series, position, edges, attenuation):
    """Windowed-sinc sums written out: each new sample with a kernel of its own."""
    beta = 0.1102 * (attenuation - 8.7)
    half = int(np.ceil((attenuation - 7.95) / (4.57 * np.pi * (edges[1] - edges[0])) + 1))
    out = []
    for each in position:
        at = np.arange(int(np.floor(each)) - half + 1, int(np.floor(each)) + half + 1)
        lag = each - at
        kernel = special.i0(beta * np.sqrt(np.maximum(1 - (lag / half) ** 2, 0)))
        kernel *= np.sinc(sum(edges) * lag)
        out.append(series[at] @ kernel / kernel.sum())
    return np.array(out)


@pytest.mark.parametrize(("new_dt", "attenuation"), [(0.37, 60.0), (1.0007, 100.0), (25.6, 60.0)])
def test_tabulated_kernels_are_the_kernels(new_dt, attenuation):
    """On noise, which fills the band: the table's cubic is off by 1.5e-10 of a sample's size."""
    series = np.random.default_rng(0).standard_normal(12000)
    wanted = 4000.3 + new_dt * np.arange(150)
    nyquist = 0.5 / max(1.0, new_dt)
    expected = direct_sums(series, wanted, (0.8 * nyquist, nyquist), attenuation)
    assert_near(resample(series, np.arange(12000.0), wanted, attenuation), expected, 2e-9)


def test_constants_are_kept_exactly_to_the_ends():
    time = np.arange(0, 20, 0.01)
    out = resample(np.full(time.size, 7.0), time, np.arange(0, 19.9, 0.0513))
    assert_allclose(out, 7.0, rtol=1e-14)  # rounding of a sum


def test_gaps_are_told_and_masked():
    t = 0.02 * np.arange(500)
    kept = np.ones(500, bool)
    kept[100:110] = kept[300] = False
    report = inspect_times(t[kept])
    assert inspect_times(np.round(np.arange(900) / 30, 3)).uniform  # decimals are no jitter
    assert report.gaps == ((1.98, 0.22), (5.98, 0.04))
    assert (report.missing, report.jittered) == (11, False)
    time, x = onto_uniform(t[kept], np.sin(t[kept]))
    assert_near(time, t, 1e-12)
    assert_array_equal(np.isnan(x), ~kept)
    assert_array_equal(x[kept], np.sin(t[kept]))


def test_rounding_of_times_does_not_add_up_over_a_long_gap():
    t = np.arange(1800) / 30 + 20 * (np.arange(1800) >= 900)
    report = inspect_times(np.round(t, 3))
    assert (report.missing, report.jittered) == (600, False)
    assert_allclose(report.step, 1 / 30, rtol=1e-6)
    with data_error(r"600 sample\(s\) of 0\.0333333 s are missing"):
        uniform_step(np.round(t, 3))


def test_jitter_is_told_and_interpolated_away():
    t = 0.02 * np.arange(500) + 0.002 * np.random.default_rng(0).standard_normal(500)
    report = inspect_times(t)
    assert report.jittered
    assert_allclose(report.jitter_rms, 0.002, rtol=0.1)
    time, x = onto_uniform(t, np.sin(tau * t))
    assert np.ptp(np.diff(time)) < 1e-12
    # A wave of 50 samples: cubic splines leave 1e-5, and the first sample is held.
    assert_near(x[1:-1], np.sin(tau * time)[1:-1], 1e-4)


def test_short_gaps_are_bridged_and_long_ones_marked():
    x = np.sin(tau * 0.005 * np.arange(1000))
    holed = x.copy()
    holed[100:115] = holed[400:600] = holed[:3] = np.nan
    result = bridge(holed, 0.01, longest=0.2)
    assert np.flatnonzero(result.short).tolist() == list(range(100, 115))
    assert result.long.sum() == 203
    # 0.15 s of a wave of 2 s, beside its crest: a monotone cubic cuts off 1 − cos(π 0.15/2).
    assert_near(result.values[100:115], x[100:115], 0.03)
    there = np.isfinite(holed)
    assert_array_equal(result.values[there], x[there])
