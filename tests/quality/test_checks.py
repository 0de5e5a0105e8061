"""Checks report faults as data: which kind, where, how large."""

import json
from dataclasses import replace
from math import tau

import numpy as np
import pytest
import xarray as xr
from near import assert_near
from records import record
from said import warned
from seas import sea

from seakeep.quality import Finding, Record, as_json, check, findings_of, warn_of
from seakeep.quality.clocks import clocks
from seakeep.quality.faults import reading_step
from seakeep.quality.samples import SamplesKind
from seakeep.quality.samples import waves as waves_of
from seakeep.quality.sensors import LATE, RUN_AWAY, compare_sensors, derivatives, redundant
from seakeep.signals import Clock

DT = 0.04
T = DT * np.arange(3000)
PERIOD = 1.6


def waves(shift=0.0, seed=0):
    return 3.2 * sea(seed, (0.4, 0.9), peak=PERIOD, components=20).at(T - shift)


def against(series, trusted=None, step=np.nan, window=None):
    """Findings against a sensor beside a trusted one."""
    trusted = waves() if trusted is None else trusted
    run = record(DT, one=trusted, two=series)
    run["two"].attrs["reading_step"] = step
    return list(redundant(Record("r", run, redundant={("one", "two"): window})))


def kinds(*args, **keys):
    return [each.kind.name for each in against(*args, **keys)]


def test_a_late_one():
    (found,) = against(waves(0.3))
    assert found.kind.name == "LAG"
    assert_near(found.value, 0.3, 0.004)  # a tenth of a sample
    assert (found.unit, found.channel, found.run) == ("s", "two", "r")
    assert_near(against(waves(-0.3))[0].value, -0.3, 0.004)
    assert found.text.startswith("against one: lag +0.30 s (± 0.0")


@pytest.mark.parametrize("hours", [0, 10])
@pytest.mark.parametrize(("level", "told"), [(0.009, False), (0.012, True)])
def test_a_clock_is_as_uncertain_as_at_the_start_of_its_record(hours, level, told):
    # Times of day count from midnight, and 4 ppm over ten hours are 0.14 s.
    start = 3600.0 * hours
    group = record(DT, heave=waves()).assign_coords(time=T + start)
    error = np.hypot(level, (start + 60.0) * 4e-6)
    clock = Clock(0.3, 2e-6, error, 4e-6, "trigger pulses", 9, 1e-3, centre=start + 60.0)
    found = [*clocks(Record("r", group, {"mru": group}, {"mru": clock}))]
    # 60 s of drift add little.
    assert [each.value for each in found] == [pytest.approx(level, rel=1e-3)] * told
    said = "clock poorly known: ± 0.012 s at the start of its record; +300"
    assert all(each.text.startswith(said) for each in found)


def test_a_record_of_one_logger_needs_no_clock():
    run = record(DT, heave=waves())
    assert check(Record("r", run, {"": run})) == []


def test_a_phase_that_drifts_about_zero():
    """0.27 periods over the record, with a median near 0: this one passed."""
    (found,) = against(np.interp(T + 0.27 * PERIOD * (T / T[-1] - 0.5), T, waves()))
    assert found.kind.name == "LAG_GROWS"
    assert found.value == pytest.approx(-0.27 * PERIOD, rel=0.15)  # windows at the ends


def test_noise_of_another_size_than_a_model_s_error():
    noise = np.random.default_rng(0).normal(0, waves().std(), T.size)
    assert kinds(waves() + 0.1 * noise) == []
    assert kinds(waves() + 0.3 * noise) == ["DIFFERENCE"]


def test_constant_and_unrelated():
    assert kinds(np.full(3000, 0.2)) == ["STILL"]
    assert kinds(waves(seed=7)) == ["AGREEMENT"]


@pytest.mark.parametrize(
    ("factor", "told"),
    {1000.0: True, 2.2: True, 1.9: False, 0.55: False, 0.45: True, 0.001: True}.items(),
)
def test_another_scale(factor, told):
    """A wrong unit does not change a correlation; the limits are 2 and 1/2."""
    assert kinds(factor * waves()) == (["SCALE"] if told else ["DIFFERENCE"])


@pytest.mark.parametrize(("order", "suffix"), [(1, "rate"), (2, "acceleration")])
def test_a_derivative_of_another_sign_or_scale_than_its_motion(order, suffix):
    x = sea(0, (0.4, 0.9), peak=PERIOD, components=20)
    omega = tau * x.frequency
    changed = replace(x, phase=x.phase + order * tau / 4, amplitude=omega**order * x.amplitude)

    def gains(factor):
        both = np.stack([x.at(T), factor * changed.at(T)])
        both += (
            0.3 * both.std(axis=1, keepdims=True) * np.random.default_rng(0).normal(size=both.shape)
        )
        run = record(DT, {}, **dict(zip(("roll", f"roll_{suffix}"), both, strict=True)))
        return [each.value for each in derivatives(Record("r", run))]

    assert gains(1.0) == gains(0.6) == gains(1.8) == []
    sway = record(DT, {}, sway=x.at(T), sway_acceleration=changed.at(T) * -1.0)
    assert not [*derivatives(Record("r", sway))]  # gravity may turn it over
    for factor in (-1.0, -57.3, 57.3):
        assert gains(factor) == [pytest.approx(factor, rel=0.1)]  # noise of 0.3 SD lowers it


@pytest.mark.parametrize(("part", "told"), [(0.8, False), (1.25, True)])
def test_either_side_of_the_limits_on_lags(part, told):
    t = np.sin(tau * T / PERIOD)
    for late in (LATE, RUN_AWAY * (T / T[-1] - 0.5)):
        assert bool(kinds(np.sin(tau * (T / PERIOD - part * late)), t)) is told


@pytest.mark.parametrize(("spanned", "told"), {2: True, 4: True, 7: False, 20: False}.items())
def test_motion_below_the_resolution(spanned, told):
    step = 2 * np.sqrt(2) * waves().std() / spanned
    noisy = waves() + 0.02 * waves().std() * np.random.default_rng(1).standard_normal(T.size)
    read = step * np.round(noisy / step)
    assert ("RESOLUTION" in kinds(read, step=reading_step(read))) is told


def test_what_stands_still_has_no_lag():
    """A sensor that runs away and then freezes: the windows that it froze in say nothing."""
    stretched = np.interp(T * (1 - 1.2 / T[-1]), T, waves())
    frozen = np.where(np.arange(T.size) < 2600, stretched, stretched[2600])
    found = compare_sensors(frozen, waves(), DT, stuck_samples=np.arange(T.size) >= 2600)
    assert_near(found.growth, 1.2 * 2600 / T.size, 0.15)  # windows of 3 s at the ends
    assert found.centre[-1] < 2600 * DT


@pytest.mark.parametrize(
    ("height", "slower", "stated", "told"),
    [
        (0.13, 1, None, []),  # m; waves of 1.6 s are 4 m long, and break at 0.57 m
        (0.50, 1, None, []),
        (0.62, 1, None, ["WAVES"]),
        (0.13, 20, None, []),
        (0.13, 1000, None, ["WAVES"]),  # times in ms
        (0.13, 1, 1.6 * 2.9, []),
        (0.13, 1, 1.6 * 3.2, ["STATED_PERIOD"]),
        (0.13, 1, 1.6 / 3.2, ["STATED_PERIOD"]),
    ],
)
def test_waves_that_none_of_their_period_is(height, slower, stated, told):
    run = record(DT * slower, eta_fwd=height / 8**0.5 * np.sin(tau * T / PERIOD))
    assert [each.kind.name for each in waves_of(Record("r", run, stated_period=stated))] == told
    assert not [*waves_of(Record("r", run, stated_period=stated, waves="still"))]


@pytest.mark.parametrize(("level", "told"), [(0.12, False), (0.14, True), (-18.5, True)])
def test_a_gauge_that_counts_from_elsewhere_than_still_water(level, told):
    """Waves of 0.13 m."""
    run = record(DT, eta_fwd=level + 0.13 / 8**0.5 * np.sin(tau * T / PERIOD))
    values = [each.value for each in waves_of(Record("r", run))]
    assert values == [pytest.approx(level, rel=1e-3)] * told  # waves in parts at the end


def test_channels_that_hold_no_wave_are_left():
    lost = np.where(T < 2 * DT, 0.1, np.nan)
    run = record(DT, eta_fwd=np.full(T.size, np.nan), eta_aft=lost, surge=lost)
    assert not [*waves_of(Record("r", run))]


FOUND = Finding(SamplesKind.DRIFT, "first", "pitch", np.deg2rad(5.0), 0.01, "rad")


def test_a_sentence_is_rendered_from_data_angles_in_degrees():
    assert FOUND.text == "level drifts by +5 deg over the record"


def test_a_kind_that_is_not_loaded_keeps_its_sentence():
    stored = json.loads(as_json([FOUND]))
    stored[0]["kind"] = "OF_ANOTHER_VERSION"
    (found,) = findings_of(xr.Dataset(attrs={"quality": json.dumps(stored)}))
    assert found.text == FOUND.text
    assert found.value == FOUND.value


def test_warnings_of_the_channels_of_a_model_come_once():
    told = set()
    with warned(r"^first: pitch level drifts .* record\.$"):
        warn_of([FOUND, FOUND], told, ["pitch"])
    warn_of([FOUND], told, ["pitch"])
    warn_of([FOUND], set(), ["heave"])
    warn_of([FOUND], set())  # no remedy: nothing is wrong with the campaign file
