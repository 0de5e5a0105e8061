"""Checks of sensors against one another: redundant ones, and probes by the waves that pass them.

Agreement of a sensor with another one of the same motion: lag, correlation, scale.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import FloatArray, as_series
from seakeep.conventions import MOTIONS
from seakeep.quality.faults import STUCK, find_held, noise_share
from seakeep.quality.findings import (
    Findings,
    Kind,
    Record,
    Redundant,
    channels_of,
    filled,
    sound,
    step_of,
)
from seakeep.signals import misplaced_probes
from seakeep.signals.lags import Lags, windowed_lags
from seakeep.signals.waves import dominant_period


class SensorsKind(Kind):
    """Findings from the comparison of two sensors."""

    STILL = "against {other}: constant while the other sensor moves"
    UNSEEN = "against {other}: no motion seen"
    RESOLUTION = (
        "against {other}: motion below the resolution: from crest to trough it spans "
        "{spanned:.1f} of the steps in which the sensor reads ({value:.2g})"
    )
    AGREEMENT = (
        "against {other}: agrees poorly (correlation {correlation:.2f} at its best lag), {so}"
    )
    LAG_GROWS = "against {other}: lag runs away by {value:+.2f} over the record, {so}"
    LAG = "against {other}: lag {value:+.2f} (± {spread:.2f} s), {so}"
    DIFFERENCE = "against {other}: differs beyond a lag, {so}"
    SCALE = (
        "against {other}: scale: its standard deviation is {value:.3g} times as large; the unit or "
        "the calibration of one of them is wrong",
        "Check unit and column in [channels.{channel}].",
    )
    DERIVATIVE = (
        "is {value:+.3g} times the {order}derivative of {other}, and should be +1 times it",
        "Check unit, sign and column of both in [channels].",
    )
    HELD = "holds still for {value:.3g} while {other} moves, from {place:.4g} s"
    POSITION = (
        "is stated to stand {limit:+.3f} from {other}, and the phases of the waves fit "
        "{value:+.3f} (± {spread:.3f} m){unsure}; an elevation carried by the stated distance is "
        "wrong by {error:.2f} of its standard deviation",
        "Check [rig.positions] of the campaign, which count along the waves (x times the cosine of "
        "the angle at which they run), the water depth and the probes' clocks. At forward speed "
        "dispersion does not hold: leave water_depth out of [rig].",
    )
    NO_POSITION = (
        "is stated to stand {limit:+.3f} from {other}, and at no distance do the phases of the "
        "waves that both recorded fit (the correlation is {correlation:.2f} at best)",
        "Check the water depth, [rig.positions], and signs and clocks of the probes. At forward "
        "speed dispersion does not hold: leave water_depth out of [rig].",
    )
    CELERITY = (
        "correlates by only {value:.2f} with {other} at the lag that gives the run's celerity "
        "({celerity:.2f} m/s), which may be wrong"
    )


def compared(run: xr.Dataset, groups: Redundant) -> dict[tuple[str, str], Agreement]:
    """Compare the channels of each group with its first, which is trusted.

    Parameters
    ----------
    run : Dataset
        All channels on one axis.
    groups : mapping of tuple of str to float
        Sensors of one quantity, and the windows in which they are compared (s).

    Returns
    -------
    dict of (str, str) to Agreement
        By channel and trusted channel.
    """
    out = {}
    dt = step_of(run)
    for (first, *others), window in groups.items() if run.sizes["time"] >= 16 else ():
        trusted = filled(run[first])
        for name in others:
            stuck = None
            if f"{name}_flags" in run.coords:
                stuck = run[f"{name}_flags"].values & STUCK
            step = run[name].attrs.get("reading_step", np.nan)
            out[name, first] = compare_sensors(filled(run[name]), trusted, dt, window, stuck, step)
    return out


def redundant(record: Record) -> Findings:
    """Redundant sensors that disagree by more than a model may err, or hold still alone."""
    run = record.whole
    for (name, other), agreement in compared(run, record.redundant).items():
        for kind, value, limit, unit in _faults(agreement, run[name].attrs["units"]):
            yield record.finding(
                kind,
                name,
                value,
                limit,
                unit,
                other=other,
                correlation=agreement.correlation,
                spread=agreement.lag_spread,
                spanned=agreement.spanned,
                so=f"so that the NRMSE between the two is {agreement.nrmse:.2f}",
            )
        x, dt = filled(run[name]), step_of(run)
        stuck = find_held(x, dt, filled(run[other]))
        if stuck.any() and np.isfinite(agreement.period):
            start, length = float(run["time"][int(np.argmax(stuck))]), float(stuck.sum()) * dt
            yield record.finding(
                SensorsKind.HELD, name, length, agreement.period, "s", start, other=other
            )


def _faults(agreement: Agreement, unit: str) -> Iterator[tuple[SensorsKind, float, float, str]]:
    """Evidence against a sensor: kind, value, limit, unit."""
    if not np.isfinite(agreement.correlation):
        kind = SensorsKind.STILL if agreement.gain == 0 else SensorsKind.UNSEEN
        yield kind, agreement.gain, np.nan, "1"
        return
    if agreement.spanned < FEWEST_STEPS:
        yield SensorsKind.RESOLUTION, agreement.step, agreement.motion, unit
    scaled = not 1 / LARGEST_GAIN <= agreement.gain <= LARGEST_GAIN
    if agreement.correlation >= LEAST_CORRELATION and scaled:
        yield SensorsKind.SCALE, agreement.gain, LARGEST_GAIN, "1"
    if scaled or agreement.nrmse > LARGEST_NRMSE:
        growth, late = RUN_AWAY * agreement.period, LATE * agreement.period
        if agreement.correlation < LEAST_CORRELATION:
            yield SensorsKind.AGREEMENT, agreement.nrmse, LARGEST_NRMSE, "1"
        elif abs(agreement.growth) > growth:
            yield SensorsKind.LAG_GROWS, agreement.growth, growth, "s"
        elif abs(agreement.lag) > late:
            yield SensorsKind.LAG, agreement.lag, late, "s"
        elif not scaled:
            yield SensorsKind.DIFFERENCE, agreement.nrmse, LARGEST_NRMSE, "1"


def derivatives(record: Record) -> Findings:
    """Rates and accelerations of another sign or scale than the motion they belong to."""
    run, dt, count = record.whole, step_of(record.whole), record.whole.sizes["time"]
    frequency = np.fft.rfftfreq(count, dt)
    for motion, (order, (suffix, words)) in product(MOTIONS, enumerate(DERIVED, 1)):
        name = motion + suffix
        if name in TILTED or not {motion, name} <= {*run.data_vars}:
            continue
        x, derivative = filled(run[motion]), filled(run[name])
        period = dominant_period(derivative, dt)
        near = (frequency > 0.5 / period) & (frequency < 2.0 / period)
        if not np.ptp(x) or not near.any():
            continue
        both = np.stack([x - x.mean(), derivative - derivative.mean()]) * np.hanning(count)
        moved, measured = np.fft.rfft(both)[:, near]
        expected = (2j * np.pi * frequency[near]) ** order * moved
        gain = np.vdot(expected, measured).real / np.vdot(expected, expected).real
        alike = gain * np.linalg.norm(expected) / np.linalg.norm(measured)
        if abs(alike) >= LEAST_CORRELATION and not 1 / LARGEST_GAIN <= gain <= LARGEST_GAIN:
            yield record.finding(
                SensorsKind.DERIVATIVE, name, gain, LARGEST_GAIN, "1", other=motion, order=words
            )


def positions(record: Record) -> Findings:
    """Stated positions of wave probes against the phases of the waves that passed them.

    Nothing can be said without a water depth, nor of regular waves, still water and noise.
    """
    run, depth = record.whole, record.water_depth
    places = {
        name: channel.attrs["x_position"]
        for name, channel in channels_of(run).items()
        if "x_position" in channel.attrs and noise_share(sound(run, name)) <= 0.5
    }
    if depth is None or record.waves in ("regular", "still"):
        return
    series = {name: filled(run[name]) for name in places}
    for each in misplaced_probes(series, places, step_of(run), depth):
        separation = each.separation
        yield record.finding(
            SensorsKind.POSITION if separation.known else SensorsKind.NO_POSITION,
            each.probe,
            separation.separation,
            separation.stated,
            "m",
            other=each.other,
            spread=separation.spread,
            correlation=separation.correlation,
            error=separation.input_error,
            unsure="" if each.certain else ", or the other probe is misplaced",
        )


DERIVED = ("_rate", ""), ("_acceleration", "second ")
"""Suffixes of the derivatives of a motion, and their order in words."""

TILTED = ("surge_acceleration", "sway_acceleration")
"""Accelerations that tilt changes: accelerometers feel gravity too."""

LEAST_CORRELATION = 0.8
"""At a lower correlation no lag and no scale is given: 36 % of the variance would be the sensor's
own."""

LARGEST_NRMSE = 0.2
"""NRMSE between two sensors of one motion beyond which they disagree: models of the paper reach
errors of 0.1 to 0.3, and none can be better than the sensors that it learns from."""

LATE = float(np.arcsin(LARGEST_NRMSE / 2) / np.pi)
r"""Lag that alone makes that NRMSE, in periods: it is :math:`2 \sin(\pi\tau/T)`; 0.032."""

RUN_AWAY = 0.11
r"""Growth of a lag over a record that alone makes that NRMSE, in periods: over a lag that grows by
g periods about 0 it is :math:`\sqrt{2 - 2 \sin(\pi g)/(\pi g)}`."""

FEWEST_STEPS = 5.0
"""Steps of a sensor that a motion must span from crest to trough: measurement-systems analysis asks
for five distinct categories (AIAG, MSA, 4th edition)."""

LARGEST_GAIN = 2.0
"""Factor between the motions of two sensors beyond which one of them has another unit or
calibration: a correlation of 0.8 leaves room for 1.25 by what the sensor adds of its own, and a
wrong unit makes 10 or more."""


@dataclass(frozen=True)
class Agreement:
    """How a sensor agrees with a trusted one of the same motion.

    Parameters
    ----------
    period : float
        Dominant period of the trusted one, s.
    motion : float
        Standard deviation of the trusted one over the windows compared, in its unit.
    step : float
        Step in which the sensor reads, in the same unit; NaN where it is not known to.
    lag, lag_spread : float
        Median over windows, s, positive where the sensor is late, searched within half a period;
        and 1.4826 times the median absolute deviation. NaN where nothing moves.
    growth : float
        Lag gained from the first two windows to the last two, s; where it jumped by a period it
        is taken to have gone on. These windows are half as long, since a lag that runs away does
        so within a window.
    correlation : float
        Median correlation at the peaks.
    nrmse : float
        RMS of the difference between the two, each less its mean, over the trusted one's standard
        deviation, in the windows with motion.
    gain : float
        Median over windows of the sensor's spread over the trusted one's; over the whole record
        where nothing can be compared.
    centre, lags : ndarray, shape (window,)
        Middle of each window with motion, s, and its lag.
    """

    period: float
    motion: float
    step: float
    lag: float
    lag_spread: float
    growth: float
    correlation: float
    nrmse: float
    gain: float
    centre: FloatArray
    lags: FloatArray

    @property
    def spanned(self) -> float:
        """Steps of the sensor that the motion spans from crest to trough (2√2 of its SD)."""
        return float(2 * np.sqrt(2) * self.motion / self.step) if self.step > 0 else np.inf


def compare_sensors(
    series: npt.ArrayLike,
    trusted: npt.ArrayLike,
    dt: float,
    window: float | None = None,
    stuck_samples: npt.ArrayLike | None = None,
    step: float = np.nan,
) -> Agreement:
    """Compare a sensor with a trusted one of the same motion, window by window.

    Parameters
    ----------
    series, trusted : array_like, shape (time,)
        Uniformly sampled side by side, without gaps.
    dt : float
        Time step, s.
    window : float, optional
        Length of the windows, s; by default four periods.
    stuck_samples : array_like of bool, shape (time,), optional
        Samples at which the sensor is known to be stuck; a lag of what stands still means nothing.
    step : float, optional
        Step in which the sensor reads, as :func:`seakeep.quality.faults.reading_step` finds it
        in the record.

    Returns
    -------
    Agreement
        Windows that hold a stuck sample, and those in which the trusted sensor moves by less than
        0.3 of what it does at most, are left out.

    Raises
    ------
    RequestError
        If the series differ in length.
    DataError
        If a series has gaps.
    """
    x, y = as_series(series), as_series(trusted)
    period = dominant_period(y, dt)
    empty = np.zeros(0)
    gain = float(x.std() / y.std()) if y.std() > 0 else np.nan
    gain = 0.0 if gain < 1e-6 else gain  # what resampling makes of a constant
    nothing = Agreement(period, np.nan, step, *(np.nan,) * 5, gain, empty, empty)
    length = 4 * period if window is None else window
    if not 0 < gain < np.inf or x.size * dt < length + period:
        return nothing
    stuck = np.zeros(x.size, bool) if stuck_samples is None else np.asarray(stuck_samples, bool)

    def moving(length: float) -> tuple[Lags, list[slice]]:
        """Lags in windows with enough motion, and the samples of these."""
        lags = windowed_lags(x, y, dt, length, 0.5 * period)
        edges = np.stack([lags.centre - 0.5 * length, lags.centre + 0.5 * length], axis=1) / dt
        spans = [slice(*each) for each in edges.round().astype(int).clip(0)]
        motion = np.array([y[span].std() for span in spans])
        free = np.array([not stuck[span].any() for span in spans])
        moves = (motion > 0.3 * motion.max()) & np.isfinite(lags.lag)
        # A sensor that sticks all the time is judged all the same.
        moves &= free | ~np.any(moves & free)
        clear = Lags(lags.centre[moves], lags.lag[moves], lags.correlation[moves])
        return clear, [spans[k] for k in np.flatnonzero(moves)]

    windows, spans = moving(length)
    if not spans:
        return nothing
    error, moved, own = (np.array([z[span].std() for span in spans]) for z in (x - y, y, x))
    motion, lags = float(np.sqrt(np.mean(moved**2))), _telling(windows)
    straight = np.unwrap(_telling(moving(0.5 * length)[0]), period=period)
    middle = float(np.median(lags))
    return Agreement(
        period=period,
        motion=motion,
        step=step,
        lag=middle,
        lag_spread=float(1.4826 * np.median(np.abs(lags - middle))),
        growth=float(straight[-2:].mean() - straight[:2].mean()) if straight.size > 3 else 0.0,
        correlation=float(np.median(windows.correlation)),
        nrmse=float(np.sqrt(np.mean(error**2))) / motion,
        gain=float(np.median(own / moved)),
        centre=windows.centre,
        lags=windows.lag,
    )


def _telling(lags: Lags) -> FloatArray:
    """Lags of the windows in which the two go together, of all where these are few."""
    alike = lags.correlation >= 0.6
    return lags.lag[alike] if alike.sum() > 3 else lags.lag
