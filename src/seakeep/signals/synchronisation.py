r"""Clocks of loggers against one another: offset and drift, with their uncertainty.

A :class:`Clock` is found from pulses that both loggers record, from a signal that both record, or
from the lag between two related signals, window by window.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from scipy.interpolate import CubicSpline

from seakeep.arrays import ArrayLike, FloatArray, IntArray
from seakeep.core.spectra import autocorrelation
from seakeep.errors import DataError, RequestError
from seakeep.signals.filters import low_pass
from seakeep.signals.lags import windowed_lags
from seakeep.signals.time_axis import Clock, record, stretches, uniform_step, usual_step
from seakeep.signals.waves import dominant_period, noise_level, tapered_power

LARGEST_DRIFT = 1e-3
"""Drift of a clock that is believed: a thousand ppm."""

LARGEST_SCATTER = 1 / 12
"""Scatter of the lags of windows about a line, in periods of the waves, that is believed. Related
signals stay below half of it; windows that are compared at wrong lags exceed three times it."""

LEAST_SHARED = 0.8
"""Correlation of a signal in the records of two loggers, once their clocks agree, that is believed:
noise of three quarters of its SD."""

SIGNAL, ABOVE = 0.99, 20.0
"""Part of the squared slope of a signal, which tells instants, that is compared where two loggers
record it, and the power over that of its noise from which on it counts."""

_OFFSET = (
    "state as offset (s) about what the logger's clock reads when the reference's reads 0 (of a "
    "campaign: in [instruments.NAME])"
)
_LAGS = (
    " Where the clocks differ by more than largest_lag ({:g} s), raise it, or "
    f"{_OFFSET}; in regular waves, keep it below half a period."
)


def _line(own: FloatArray, reference: FloatArray, errors: FloatArray, method: str) -> Clock:
    """Straight line of one clock over another, outliers left out, at least as wrong as `errors`."""
    late, inliers = own - reference, np.ones(own.size, bool)
    for _ in range(5):
        centre, level = float(reference[inliers].mean()), float(late[inliers].mean())
        away = reference - centre
        spread = away[inliers] @ away[inliers]
        drift = float(away[inliers] @ late[inliers] / spread) if spread > 0 else 0.0
        residual = late - level - drift * away
        scale = 1.4826 * np.median(np.abs(residual[inliers])) + 1e-9
        updated = np.abs(residual) <= 5.0 * scale
        if inliers.sum() < 5 or updated.sum() < 3 or np.array_equal(updated, inliers):
            break
        inliers = updated
    count = int(inliers.sum())
    rms = math.sqrt(np.mean(residual[inliers] ** 2))
    formal = np.sqrt(np.mean(errors[inliers] ** 2))
    sigma = max(rms * np.sqrt(count / (count - 2)) if count > 2 else 0.0, formal)
    drift_error = float(sigma / np.sqrt(spread)) if spread > 0 else np.nan
    offset_error = float(np.hypot(sigma / np.sqrt(count), centre * drift_error))
    offset = level - drift * centre
    return Clock(offset, drift, offset_error, drift_error, method, count, rms, centre=centre)


def _adjusted(
    values: FloatArray, shape: FloatArray, *slopes: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Least squares of values by a shape with a gain, a level, and shifts along its slopes.

    Returns
    -------
    shifts, errors : ndarray, shape (slope,)
        Shifts, and their standard errors if what is left is white.
    left : ndarray
        What the fit leaves of the values.
    gain : float
    """
    design = np.column_stack([shape, np.ones(shape.size), *slopes])
    solution = np.linalg.lstsq(design, values, rcond=None)[0]
    left, gain = values - design @ solution, float(solution[0]) or 1.0
    variance = left @ left / max(left.size - len(solution), 1)
    errors = np.sqrt(variance * np.diagonal(np.linalg.pinv(design.T @ design))[2:]) / abs(gain)
    return np.asarray(solution[2:] / gain), errors, left, gain


def clock_from_pulses(
    trigger: ArrayLike,
    time: ArrayLike,
    reference_trigger: ArrayLike,
    reference_time: ArrayLike,
    expected_offset: float = 0.0,
) -> Clock:
    """Clock of a logger from a trigger that it and the reference record.

    Each pulse is timed to a part of a sample by fitting the mean pulse of the faster logger to it
    (height, level and instant); a straight line through the instants, outliers left out, gives
    offset and drift.

    Parameters
    ----------
    trigger : array_like, shape (time,)
        The trigger as the logger recorded it, in any unit, pulses up or down.
    time : array_like, shape (time,)
        Readings of the logger's clock, s.
    reference_trigger, reference_time : array_like
        The same of the reference.
    expected_offset : float, optional
        Of all offsets that fit a periodic train, the one nearest to this is taken, s.

    Returns
    -------
    Clock
        The clock.

    Raises
    ------
    DataError
        If a record has no pulses, or none of one fits those of the other.

    Examples
    --------
    >>> import numpy as np
    >>> def pulses(t):
    ...     phase = (t + 5) % 10 - 5
    ...     return np.where(abs(phase) < 0.25, np.cos(2 * np.pi * phase) ** 2, 0.0)
    >>> t, c = np.arange(0, 60, 0.002), np.arange(0, 60, 0.02)
    >>> clock = clock_from_pulses(pulses((c - 0.3) / 1.00002), c, pulses(t), t)
    >>> round(clock.offset, 4), round(1e6 * clock.drift, 1), clock.count
    (0.3, 20.0, 5)
    """
    logger = record(trigger, time, "the logger")
    standard = record(reference_trigger, reference_time, "the reference")
    own, own_width = find_pulses(*logger, "the logger's trigger")
    reference, width = find_pulses(*standard, "the reference's trigger")
    own, reference, modulus = match_pulses(own, reference, expected_offset)
    if usual_step(standard[1]) <= usual_step(logger[1]):
        template = pulse_template(*standard, width, reference)
    else:
        template = pulse_template(*logger, own_width, own)
    own, own_errors = time_pulses(*logger, own, template)
    reference, errors = time_pulses(*standard, reference, template)
    errors = np.hypot(own_errors, errors)
    sound = np.isfinite(errors)
    if not sound.any():
        raise DataError(
            "no pulse of the trigger could be timed: the pulses of the two loggers differ in "
            "shape. Check that both columns hold the same trigger."
        )
    clock = _line(own[sound], reference[sound], errors[sound], "trigger pulses")
    return replace(clock, modulus=modulus)


def clock_from_correlation(
    series: ArrayLike,
    time: ArrayLike,
    reference: ArrayLike,
    reference_time: ArrayLike,
    window: float,
    largest_lag: float,
    least_correlation: float = 0.6,
) -> Clock:
    """Clock of a logger from the lag of its signal behind a related one, window by window.

    Parameters
    ----------
    series, time : array_like, shape (time,)
        A signal of the logger and the readings of its clock, s, uniform.
    reference, reference_time : array_like
        A signal of the reference that goes up and down with it.
    window : float
        Length of a window, s: several periods of the slowest wave.
    largest_lag : float
        Lags searched on either side, s. In regular waves a lag is known only up to a period.
    least_correlation : float, optional
        Windows whose peak correlation is lower are left out.

    Returns
    -------
    Clock
        The clock: a straight line through the lags, outliers left out.

    Raises
    ------
    DataError
        If fewer than two windows correlate, or their lags are not those of one clock.
    RequestError
        If what the records share is shorter than the window and twice the largest lag.
    """
    a, c = record(series, time, "the logger")
    b, t = record(reference, reference_time, "the reference")
    step = min(uniform_step(c, "the logger"), uniform_step(t, "the reference"))
    begin, end = max(c[0], t[0]), min(c[-1], t[-1])
    if end - begin < window + 2 * largest_lag:
        raise RequestError(
            f"the clock of the logger runs from {c[0]:.1f} to {c[-1]:.1f} s and the reference's "
            f"from {t[0]:.1f} to {t[-1]:.1f} s. They share {max(end - begin, 0.0):g} s, and a "
            f"window of {window:g} s with lags of ±{largest_lag:g} s needs "
            f"{window + 2 * largest_lag:g} s. Shorten window or largest_lag; or {_OFFSET}."
        )
    grid = begin + step * np.arange(int((end - begin) / step + 1e-9) + 1)
    other = CubicSpline(t, b)(grid)
    lags = windowed_lags(CubicSpline(c, a)(grid), other, step, window, largest_lag)
    # The highest correlation at an end of the lags is no peak.
    good = (lags.correlation >= least_correlation) & (np.abs(lags.lag) < largest_lag)
    if good.sum() < 2:
        raise DataError(
            f"{int(good.sum())} of {good.size} windows correlate by {least_correlation:g} or more: "
            "the two signals do not go together. Choose other channels, or another window."
            + _LAGS.format(largest_lag)
        )
    instants = begin + lags.centre[good]
    clock = _line(instants + lags.lag[good], instants, 0 * instants, "correlation of windows")
    period = dominant_period(other, step)
    if clock.residual > LARGEST_SCATTER * period:
        raise DataError(
            f"the lags of {clock.count} windows scatter by {clock.residual:.2g} s, in waves of "
            f"{period:.2g} s: they are not those of one clock." + _LAGS.format(largest_lag)
        )
    # Neighbours share a half, so that two windows count as one.
    once = math.sqrt(2)
    return replace(
        clock,
        offset_error=once * clock.offset_error,
        drift_error=once * clock.drift_error,
    )


def clock_from_shared(
    series: ArrayLike,
    time: ArrayLike,
    reference: ArrayLike,
    reference_time: ArrayLike,
    window: float = 20.0,
    largest_lag: float = 5.0,
) -> Clock:
    """Clock of a logger from one signal that it and the reference both record.

    The lags of windows give a first value; least squares over all samples, in which offset and
    drift of the clock and gain and level of the signal are free, refine it. What lies above the
    frequencies of the signal is noise, and is removed from both records before.

    Parameters
    ----------
    series, time, reference, reference_time, window, largest_lag
        As in :func:`clock_from_correlation`; the signals agree up to gain, level and noise.

    Returns
    -------
    Clock
        The clock.

    Raises
    ------
    DataError, RequestError
        As :func:`clock_from_correlation`; a DataError too if the signals differ.
    """
    first = clock_from_correlation(series, time, reference, reference_time, window, largest_lag)
    a, c = record(series, time, "the logger")
    b, t = record(reference, reference_time, "the reference")
    offset, rate = first.offset, 1 + first.drift
    turned = usual_step(c) < usual_step(t)  # the spline is of the faster one
    if turned:
        (a, c), (b, t), offset, rate = (b, t), (a, c), -offset / rate, 1 / rate
    own_step, step = usual_step(c), usual_step(t)
    # Noise between samples is less than at them, which would draw the instants there.
    edge = max(_highest_frequency(a, own_step), _highest_frequency(b, step))
    a, own_end = _below(edge, a, own_step)
    b, end = _below(edge, b, step)
    other = CubicSpline(t, b)
    whole = (c >= c[0] + own_end) & (c <= c[-1] - own_end)
    centre = float(c.mean())
    for _ in range(6):
        instants = (c - offset) / rate
        inside = whole & (instants >= t[0] + end) & (instants <= t[-1] - end)
        slope = other(instants[inside], 1)
        turn = -slope * (c[inside] - centre)
        (shift, stretch), errors, left, gain = _adjusted(
            a[inside], other(instants[inside]), -slope, turn
        )
        offset, rate = float(offset + shift - stretch * centre), float(rate + stretch)
        if abs(shift) < 1e-9 and abs(stretch) < 1e-12:
            break
    alike = math.sqrt(max(1.0 - float(left.var() / a[inside].var()), 0.0))
    # Samples of a residual that goes with the slope, as both are waves, count less than once each.
    lags = min(round(window / own_step), left.size // 2)
    together = np.prod([autocorrelation([x[:, None]], lags) for x in (left, slope)], axis=0)[:, 0]
    summed = np.linspace(2.0, 0.0, lags + 1)[1:] @ np.nan_to_num(together[1:])
    level_error, drift_error = (errors * np.sqrt(max(1.0 + summed, 1.0))).tolist()
    rms = float(np.sqrt(left @ left / left.size) / (abs(gain) * np.std(slope) + 1e-300))
    if turned:
        offset, rate = -offset / rate, 1 / rate
    if alike < LEAST_SHARED or abs(rate - 1) > max(LARGEST_DRIFT, 2.0 * drift_error):
        raise DataError(
            f"at their best fit, with a drift of {1e6 * (rate - 1):+.0f} ppm, the two records "
            f"correlate by {alike:.2f}: no clock drifts so, or they share no signal."
            + _LAGS.format(largest_lag)
        )
    offset_error = float(np.hypot(level_error, centre * drift_error))
    return Clock(
        offset, rate - 1, offset_error, drift_error, "shared channel", left.size, rms, centre=centre
    )


def _highest_frequency(series: FloatArray, dt: float) -> float:
    """Frequency below which nearly all of a signal's slope lies that stands above its noise, Hz."""
    power = tapered_power(series)
    slope = np.where(power > ABOVE * noise_level(power), power, 0.0) * np.arange(power.size) ** 2.0
    grown = np.cumsum(slope)
    return float(np.argmax(grown >= SIGNAL * grown[-1]) / (series.size * dt))


def _below(edge: float, series: FloatArray, dt: float) -> tuple[FloatArray, float]:
    """Series without what lies far above a frequency, and how long the ends of the filter are, s.

    A series that was hardly sampled there is as it was.
    """
    if not 0 < edge < 0.2 / dt:
        return series, 0.0
    return low_pass(series, dt, edge, 2 * edge), 2.0 / edge


def pool_drift(clocks: Sequence[Clock]) -> list[Clock]:
    r"""Clocks of one logger in several runs, with one drift where the runs agree.

    A quartz keeps its rate from run to run, and the drift of a short run is poorly known. The
    weighted mean is taken if :math:`\chi^2` does not speak against it at 1 in 1000; each offset
    then follows from its own run.

    Parameters
    ----------
    clocks : sequence of Clock
        The same logger's in each run.

    Returns
    -------
    list of Clock
        In the same order; unchanged where the runs differ, or where fewer than two are known.

    Examples
    --------
    >>> one = Clock(0.1, 20e-6, 1e-3, 4e-6, "trigger pulses", 13, 1e-3, centre=100.0)
    >>> other = Clock(0.3, 30e-6, 1e-3, 4e-6, "trigger pulses", 13, 1e-3, centre=100.0)
    >>> [f"{1e6 * clock.drift:.0f} {clock.offset:.4f}" for clock in pool_drift([one, other])]
    ['25 0.0995', '25 0.3005']
    """
    known = [c for c in clocks if 0 < c.drift_error < np.inf]
    if len(known) < 2:
        return list(clocks)
    weights = np.array([c.drift_error**-2 for c in known])
    drifts = np.array([c.drift for c in known])
    mean = float(weights @ drifts / weights.sum())
    error = float(weights.sum() ** -0.5)
    if weights @ (drifts - mean) ** 2 > scipy.stats.chi2.ppf(0.999, len(known) - 1):
        return list(clocks)
    return [
        replace(
            clock.with_drift(mean, f"drift of {len(known)} runs"),
            offset_error=math.hypot(clock.reading_error(clock.centre), clock.centre * error),
            drift_error=error,
        )
        if clock.known
        else clock
        for clock in clocks
    ]


def without_doubtful_drift(clock: Clock) -> Clock:
    """Clock with its offset alone where the data do not determine its drift.

    A drift is applied only if it exceeds its expanded uncertainty (twice the standard error, 95 %):
    a doubtful one would put a larger error into the ends of a record than it takes out. Without
    it the clock reads as before in the middle of what it was found from.

    Examples
    --------
    >>> found = Clock(0.1, 20e-6, 1e-3, 30e-6, "trigger pulses", 3, 1e-3, centre=30.0)
    >>> kept = without_doubtful_drift(found)
    >>> kept.drift, round(kept.offset, 4), kept.method
    (0.0, 0.1006, 'trigger pulses, offset only: a drift of +20.0 ppm is not certain')
    """
    if not 0 < abs(clock.drift) <= 2.0 * clock.drift_error:
        return clock
    return clock.with_drift(
        0.0, f"offset only: a drift of {1e6 * clock.drift:+z.1f} ppm is not certain"
    )


def find_pulses(trigger: FloatArray, time: FloatArray, name: str) -> tuple[FloatArray, float]:
    """Find the whole pulses of a trigger at half their height; NaN is taken for rest.

    Pulses of less than half or more than twice the median height or width are left out.

    Returns
    -------
    centres : ndarray, shape (pulse,)
        Middle between the rising and the falling edge, by linear interpolation, s.
    width : float
        Median width, s.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 10, 0.01)
    >>> centres, width = find_pulses(np.exp(-((t - 4.003) / 0.1) ** 2), t, "the trigger")
    >>> [round(float(c), 3) for c in centres], round(width, 2)
    ([4.003], 0.17)
    """
    x = trigger - np.nanmedian(trigger)
    x[~np.isfinite(x)] = 0.0
    x = x if x.max() >= -x.min() else -x
    noise = 1.4826 * np.median(np.abs(x))
    # Wide stretches outvote spikes: the height is that of the sample in the middle of the time
    # spent above the noise.
    top = x.max()
    level = max(8 * noise, 0.02 * top)
    for _ in range(3):
        whole = [(a, b) for a, b in stretches(x > level) if a > 0 and b < x.size]
        if not whole:
            break
        edges = np.array(whole)
        peaks = np.array([x[a:b].max() for a, b in whole])
        top = np.quantile(np.repeat(peaks, np.ptp(edges, axis=1)), 0.5, method="lower")
        level = 0.5 * top
    if not whole or top < 6 * noise:
        raise DataError(
            f"{name} has no pulses that stand out of its noise (largest value {top:g} above the "
            f"median, noise {noise:g}). Check the column that trigger names in [instruments.NAME]; "
            "or synchronise by another signal: state instead shared (one signal both record), "
            "correlated (two that go together) or offset (s)."
        )
    before = edges - 1
    part = (level - x[before]) / (x[edges] - x[before])
    rise, fall = (time[before] + part * (time[edges] - time[before])).T
    width = fall - rise
    sound = (peaks > 0.5 * top) & (peaks < 2 * top)
    usual = np.median(width[sound])
    sound &= (width > 0.5 * usual) & (width < 2 * usual)
    return 0.5 * (rise + fall)[sound], float(np.median(width[sound]))


def match_pulses(
    own: FloatArray, reference: FloatArray, expected_offset: float
) -> tuple[FloatArray, FloatArray, float]:
    """Pulses that match in two records (instants, s).

    Also the distance to the next offset that would fit nearly as well, ``inf`` if none does. Of
    offsets that fit equally well, the one nearest to `expected_offset` is taken.
    """
    spacing = min([np.diff(each).min() for each in (own, reference) if each.size > 1], default=1.0)
    reach = 0.02 * spacing + LARGEST_DRIFT * np.ptp(reference)

    def pairs(shift: float) -> tuple[IntArray, IntArray]:
        apart = np.abs(own[:, None] - shift - reference)
        nearest = apart.argmin(axis=1)
        close = np.flatnonzero(apart.min(axis=1) <= reach)
        _, unique = np.unique(nearest[close], return_index=True)
        return close[unique], nearest[close[unique]]

    candidates = np.unique(np.round(own[:, None] - reference, 6))
    counts = np.array([pairs(shift)[0].size for shift in candidates])
    near = candidates[counts >= max(counts.max() - 1, 1)]
    best = near[np.argmin(np.abs(near - expected_offset))]
    rivals = np.abs(near - best)
    modulus = float(np.min(rivals[rivals > 4 * reach], initial=np.inf))
    first, second = pairs(best)
    if first.size < max(1, min(own.size, reference.size) // 3):
        raise DataError(
            f"of {own.size} pulses of the logger and {reference.size} of the reference only "
            f"{first.size} fit together; the former come every {usual_step(own):.4g} s, "
            f"the latter every {usual_step(reference):.4g} s. Check that both columns hold "
            "the same trigger, and the unit of both times."
        )
    return own[first], reference[second], modulus


def pulse_template(
    trigger: FloatArray, time: FloatArray, width: float, centres: FloatArray
) -> CubicSpline:
    """Mean pulse of a record over the time from its centre, 1.5 widths to each side."""
    step = usual_step(time)
    count = math.ceil(1.5 * width / step) + 2
    away = step * np.arange(-count, count + 1)
    x = np.where(np.isfinite(trigger), trigger, np.nanmedian(trigger))
    inside = (centres + away[0] >= time[0]) & (centres + away[-1] <= time[-1])
    whole = centres[inside] if inside.any() else centres
    mean = np.interp(whole[:, None] + away, time, x).mean(axis=0)
    return CubicSpline(away, mean - np.median(x))


def time_pulses(
    trigger: FloatArray,
    time: FloatArray,
    centres: FloatArray,
    template: CubicSpline,
) -> tuple[FloatArray, FloatArray]:
    """Instants of pulses and their standard errors, s; NaN where the fit fails.

    By least squares of height, level and instant of a template.
    """
    reach = template.x[-1]
    instants, errors = np.full((2, centres.size), np.nan)
    for pulse, centre in enumerate(centres):
        at = centre
        for _ in range(8):
            near = (np.abs(time - at) < reach) & np.isfinite(trigger)
            if near.sum() < 5:
                break
            away = time[near] - at
            (shift,), (error,), *_ = _adjusted(trigger[near], template(away), -template(away, 1))
            move = np.clip(shift, -0.25 * reach, 0.25 * reach)
            at += move
            if abs(move) < 1e-9:
                break
        if near.sum() >= 5 and abs(at - centre) <= 0.5 * reach:
            instants[pulse], errors[pulse] = at, error
    return instants, errors
