"""Faults of samples of every length are found, and sound series are left alone."""

from math import tau

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from near import assert_near
from numpy.random import default_rng
from records import record
from seas import sea

from seakeep.campaign.pipeline import flag_samples
from seakeep.campaign.settings import PreparationSettings
from seakeep.quality import Record
from seakeep.quality.faults import (
    FLAGS,
    find_held,
    find_outliers,
    noise_share,
    reading_step,
    saturated,
)
from seakeep.quality.samples import constant, flagged, levels, noise

DT = 0.04
T = DT * np.arange(3000)
PERIOD = 1.6


def waves():
    frequency = np.linspace(0.4, 0.9, 20)
    return np.cos(tau * np.outer(T, frequency) + default_rng(0).uniform(0, 6.28, 20)).sum(axis=1)


@pytest.fixture
def noisy():
    x = waves()
    return x + 0.02 * x.std() * default_rng(1).standard_normal(x.size)


def reported(x):
    """Kinds of findings about samples."""
    group = flag_samples(record(DT, heave=x), PreparationSettings(), {})
    run, checks = Record("r", group, {"": group}), (flagged, constant, noise, levels)
    return {each.kind.name for check in checks for each in check(run)}


def faulty(x, kind, length, place):
    """A series with a fault; one that is held repeats the reading before it."""
    at = slice(start := round(place * (x.size - length)), start + length)
    x = np.round(x, 3)
    rng = default_rng(length)
    random = rng.uniform(40, 200, length) * (-1) ** np.arange(length)
    burst = rng.uniform(5, 15, length) * x.std() * rng.choice([-1, 1], length)
    held = x[max(start - 1, 0)]
    x[at] = {"held": held, "zero": 0.0, "-99.9": -99.9, "spiked": random, "burst": burst}[kind]
    return x


def test_sixteen_samples_are_enough_to_be_judged():
    assert not reported(waves()[:16])


@pytest.mark.parametrize("length", [1, 3, 4, 5, 10, 40, 300, 1600, 3000])
@pytest.mark.parametrize("kind", ["held", "zero", "-99.9", "spiked", "burst"])
def test_a_fault_of_any_length_is_reported(kind, length):
    """Shorter runs of plausible readings occur by chance: 4 equal ones do not in 3000 samples."""
    if kind in ("-99.9", "spiked", "burst") or length > 3:
        for place in (0.2, 0.37, 0.5, 0.9):
            assert reported(faulty(waves() + 0.2, kind, length, place)), place


@pytest.mark.parametrize(("equal", "stuck"), {2: 0, 3: 0, 4: 4, 5: 5}.items())
def test_the_shortest_run_of_equal_readings_that_is_held(equal, stuck):
    """Where none repeats, one in n may, and twice the longest run of that chance is three."""
    x = waves()
    x[1000 : 1000 + equal] = x[1000]
    assert find_held(x, DT).sum() == stuck


@pytest.mark.parametrize("length", [4, 40, 300])
def test_a_burst_is_flagged_whole(noisy, length):
    """Alternating readings, of which the first and the last may pass for a flank."""
    at = 1000 + np.arange(length)
    noisy[at] = noisy.std() * default_rng(0).uniform(5, 15, length) * (-1) ** at
    assert set(at[1:-1]) <= set(np.flatnonzero(find_outliers(noisy))) <= set(at)


def test_a_sound_series_is_left_alone(noisy):
    assert reported(noisy) == set()
    # A pulse of seven samples, three times the spread: it grows and falls.
    impact = noisy.copy()
    impact[1500:1507] += 3 * noisy.std() * np.hanning(9)[1:-1]
    assert not find_outliers(impact).any()
    noise = default_rng(0).standard_normal(100_000)
    assert not find_outliers(noise).any()
    # The share of n samples of white noise scatters by 1/√n.
    assert_near(noise_share(noise), 1.0, 0.01)
    for size, kinds in ((0.4, set()), (0.7, {"DRIFT"})):  # a drift of less does no harm
        assert reported(noisy + size * noisy.std() * np.linspace(0, 1, 3000)) == kinds


def test_a_probe_that_dies_has_no_drift_besides():
    """Stuck on a crest from the middle on: the level has moved by more than half the spread."""
    x = waves()
    dead = 1500 + int(np.argmax(x[1500:1600]))
    x[dead:] = x[dead]
    assert reported(x) == {"STUCK"}


def test_drop_outs_are_told_by_their_flag():
    lost = FLAGS["missing"] * (abs(T - 10) < 1).astype(np.int16)
    group = record(DT, heave=waves()).assign_coords(heave_flags=("time", lost))
    (found,) = flagged(Record("r", group, {"": group}))
    assert (found.kind.name, found.details["samples"]) == ("MISSING", 49)


def test_at_rest_around_the_waves_is_not_held(noisy):
    noisy[:600] = noisy[600]
    assert not find_held(noisy, DT).any()
    assert not find_held(noisy, DT, waves() * (np.arange(3000) >= 600)).any()
    assert find_held(noisy, DT, waves()).sum() == 601  # a witness that moved
    x = np.round(waves() * np.exp(-0.1 * np.clip(T - 80, 0, None) * tau / PERIOD), 1)
    assert not find_held(x, DT).any()


@pytest.mark.parametrize("steps", [3, 5, 10, 100])
def test_a_coarse_sensor_stays_at_crests_and_holds_nothing(steps):
    step = 2 * np.sqrt(2) * waves().std() / steps
    x = step * np.round(waves() / step)
    assert not find_held(x, DT).any()
    assert not find_held(x[: 3000 - np.argmax(np.diff(x[::-1]) != 0)], DT).any()  # ends at a crest


def test_saturation_recurs_at_the_end_of_the_range():
    x = np.clip(waves(), -4.0, 4.0)
    edges = np.abs(x) == 4.0
    found = saturated(x, find_held(x, DT))
    assert found.sum() > 0.9 * edges.sum()  # crests that are cut for three samples are left out
    assert not found[~edges].any()
    x = waves()
    top = int(np.argmax(x))
    x[top : top + 12] = x[top]  # once, at its highest
    assert reported(x) == {"STUCK"}


def test_a_model_that_is_let_go_swings_back():
    """Most of its record is rest, beside which the first swings are further than 20 SD."""
    decay = np.exp(-0.5 * T) * np.cos(5 * T) + 1e-4 * default_rng(0).standard_normal(T.size)
    assert not find_outliers(decay).any()
    decay[300:340] += np.clip(np.arange(40) / 3, 0, 1)  # a reading that comes within three samples
    assert find_outliers(decay)[302:340].all()


OFTEN = np.arange(0, 100, 0.005)
SEA = sea(3, (0.4, 0.9), peak=PERIOD, components=20).at(OFTEN)


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
    # Frames fall between samples, so that the last part of a change is missed: one of `every`.
    between = np.interp(OFTEN, OFTEN[::every] + 0.0013, 0.5 * np.round(SEA[::every] / 0.5))
    assert reading_step(between) == pytest.approx(0.5, rel=1.1 / every)


def test_noise_larger_than_the_step_hides_it():
    noisy = SEA + 0.05 * default_rng(3).standard_normal(SEA.size)
    for read in (
        SEA,
        np.full(500, 2.0),
        np.where(OFTEN < 50, SEA, SEA[10_000]),
    ):  # the last froze once
        assert np.isnan(reading_step(read))
    assert np.isnan(reading_step(np.round(noisy, 5)))
    # Steps well above the noise are seen through it.
    assert reading_step(0.4 * np.round(noisy / 0.4)) == pytest.approx(0.4, rel=1e-6)
