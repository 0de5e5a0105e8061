r"""Time axes: order, step, gaps and jitter; gaps bridged where that is asked for.

A logger's clock reads :math:`c(t) = \text{offset} + (1 + \text{drift})\,t` at the reference time t.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from seakeep.arrays import ArrayLike, BoolArray, FloatArray, IntArray, as_real, time_step
from seakeep.errors import DataError

STEP_TOLERANCE = 0.01
"""A time axis is uniform if no instant is further than this part of a step from its grid."""


DAY = 86400.0
"""Seconds of a day."""


def instant_text(instant: float, dt: float) -> str:
    """Write an instant to a thousandth of a time step, for any origin of time.

    Examples
    --------
    >>> instant_text(1700000034.35, 0.05), instant_text(2.0, 0.05)
    ('1700000034.35', '2')
    """
    known = 15 - len(f"{abs(instant):.0f}")  # digits of a double
    wanted = 3 - math.floor(math.log10(dt)) if dt > 0 else known
    decimals = max(0, min(wanted, known))
    return np.format_float_positional(instant, decimals, unique=False, trim="-")


def span_text(begin: float, end: float, dt: float) -> str:
    """Write a span of time, with its unit; instants as :func:`instant_text`."""
    return f"{instant_text(begin, dt)} to {instant_text(end, dt)} s"


ASSUMED = "assumed the same as the reference's"
"""Method of a clock of which nothing is known."""


@dataclass(frozen=True)
class Clock:
    """A logger's clock against the reference, and how well it is known.

    Parameters
    ----------
    offset : float
        What the clock reads at reference time 0, s.
    drift : float
        How much faster than the reference it runs, a pure number (25e-6 is 25 ppm).
    offset_error, drift_error : float
        Standard errors of the two; NaN where the data do not determine them.
    method : str
        How it was found.
    count : int
        Pulses, windows or samples that it rests on.
    residual : float
        RMS of what a straight line of clock over clock leaves, s.
    modulus : float
        The offset is known only up to multiples of this (s): a train of equal pulses fits again
        after each period. ``inf`` where it is unique.
    centre : float
        Reference time at which the errors of reading and drift are independent, s.

    Examples
    --------
    >>> clock = Clock(offset=0.37, drift=25e-6)
    >>> float(clock.reference(clock.reading(100.0)))
    100.0
    """

    offset: float = 0.0
    drift: float = 0.0
    offset_error: float = 0.0
    drift_error: float = 0.0
    method: str = "the same clock"
    count: int = 0
    residual: float = 0.0
    modulus: float = np.inf
    centre: float = 0.0

    def reference(self, readings: ArrayLike) -> FloatArray:
        """Reference time of readings of this clock, s."""
        return (as_real(readings, "the readings") - self.offset) / (1.0 + self.drift)

    def reading(self, time: ArrayLike) -> FloatArray:
        """What this clock reads at reference times, s."""
        return self.offset + (1.0 + self.drift) * as_real(time, "the times")

    def reading_error(self, time: float) -> float:
        """Standard error of what this clock reads at a reference time, s."""
        level = max(self.offset_error**2 - (self.centre * self.drift_error) ** 2, 0.0)
        return math.hypot(math.sqrt(level), (time - self.centre) * self.drift_error)

    @property
    def known(self) -> bool:
        """Whether offset and drift were found or stated; else they are zero because none was."""
        return self.method not in (Clock.method, ASSUMED)

    def describe(self) -> str:
        """One line for people: offset and drift with their errors, and where they come from."""
        if not self.known:
            return self.method
        offset, drift = f"{1e3 * self.offset:+z.2f}", f"{1e6 * self.drift:+z.1f}"
        if np.isfinite(self.drift_error):
            offset += f" ± {1e3 * self.offset_error:.2f}"
            drift += f" ± {1e6 * self.drift_error:.1f}"
        return f"{offset} ms, {drift} ppm ({self.method}, n = {self.count})"

    def with_drift(self, drift: float, why: str) -> Clock:
        """Clock of another drift, which reads the same in the middle of what this rests on."""
        offset = self.offset + (self.drift - drift) * self.centre
        return replace(self, offset=offset, drift=drift, method=f"{self.method}, {why}")


def past_midnight(time: FloatArray) -> FloatArray:
    """Seconds of day that go on counting after midnight, where they fall by a day less few steps.

    Examples
    --------
    >>> import numpy as np
    >>> past_midnight(np.array([86399.5, 86399.75, 0.0, 0.25]))
    array([86399.5 , 86399.75, 86400.  , 86400.25])
    """
    steps = np.diff(time)
    if not (steps < 0).any():
        return time
    ahead = steps + DAY
    midnights = (ahead > 0) & (ahead < 5 * np.median(steps))
    return time + DAY * np.cumsum([0, *midnights])


def check_order(time: ArrayLike, name: str) -> FloatArray:
    """Return the times as floats; refuse values that are not finite, repeated or unsorted."""
    t = as_real(time, f"the times of {name}", DataError)
    if t.ndim != 1 or t.size < 2:
        raise DataError(
            f"{name} has {t.size} instant(s); a time axis needs at least two. "
            "Give the whole record."
        )
    if (lost := np.flatnonzero(~np.isfinite(t))).size:
        raise DataError(
            f"the times of {name} hold a value that is not finite at sample {lost[0]} "
            f"({lost.size} in all). Remove these rows, or repair the times."
        )
    steps = np.diff(t)
    if (repeated := np.flatnonzero(steps == 0)).size:
        at = repeated[0]
        raise DataError(
            f"the times of {name} repeat: {_shown(t, at)} stands at samples {at} and {at + 1} "
            f"({repeated.size} repetitions in all). Remove the double rows, or raise the "
            "number of decimals the logger writes."
        )
    if (falling := np.flatnonzero(steps < 0)).size:
        at = falling[0]
        raise DataError(
            f"the times of {name} are not sorted: {_shown(t, at + 1)} follows {_shown(t, at)} at "
            f"sample {at + 1}. Sort the rows by time, or split the file where the clock was "
            "restarted."
        )
    return t


def _shown(t: FloatArray, sample: int | np.intp) -> str:
    """Instant of a sample in a message."""
    return f"{instant_text(t[sample], np.median(np.abs(np.diff(t))))} s"


def record(series: ArrayLike, time: ArrayLike, owner: str) -> tuple[FloatArray, FloatArray]:
    """Signal of an owner, not finite where it has gaps, and its instants in their order."""
    x, t = as_real(series, f"the signal of {owner}"), check_order(time, owner)
    if np.isfinite(x).sum() < 2:
        raise DataError(f"the signal of {owner} has fewer than two values. Give a longer record.")
    return x, t


def inside(time: FloatArray, span: tuple[float, float], dt: float) -> BoolArray:
    """Instants in a span, both ends included."""
    slack = 1e-6 * dt
    return (time >= span[0] - slack) & (time <= span[1] + slack)


def usual_step(time: ArrayLike) -> float:
    """Median step of instants, s."""
    return float(np.median(np.diff(time)))


def uniform_step(time: ArrayLike, name: str = "the run") -> float:
    """Time step of a uniformly sampled axis.

    Parameters
    ----------
    time : array_like, shape (time,)
        Instants, s.
    name : str, optional
        What a message calls the owner of the times.

    Returns
    -------
    float
        The step, s: the span divided by the number of intervals.

    Raises
    ------
    DataError
        If the times are not numbers, unsorted, repeated, or further from a uniform grid than a
        hundredth of a step and than the decimals explain with which they were written.

    Examples
    --------
    >>> uniform_step([0.0, 0.1, 0.2, 0.3])
    0.1
    """
    t = check_order(time, name)
    step = float((t[-1] - t[0]) / (t.size - 1))
    if np.max(np.abs(t - (t[0] + step * np.arange(t.size)))) > _tolerance(t, step):
        raise DataError(_irregularity(t, name))
    # A decimal step such as 0.04 that was summed or printed comes back as what was meant.
    rounded = float(f"{step:.10g}")
    return rounded if abs(rounded - step) * t.size < 1e-6 * step else step


def _tolerance(t: FloatArray, step: float) -> float:
    """How far an instant may be from its grid, by the step and by the decimals of the times."""
    least = STEP_TOLERANCE * step
    for decimals in range(7):
        unit = 10.0**-decimals
        if unit <= 0.1 * step:
            scaled = t / unit
            if np.max(np.abs(scaled - np.rint(scaled))) < 1e-3:
                # Half a unit at the instant, half at the ends of the grid.
                return max(least, 1.001 * unit)
    return least


def _irregularity(t: FloatArray, name: str) -> str:
    steps, report = np.diff(t), inspect_times(t, name)
    step, counts = report.step, np.diff(report.place)
    gaps = np.flatnonzero(counts > 1)
    if gaps.size and np.max(np.abs(steps / step - counts)) < 0.1:
        longest = gaps[np.argmax(steps[gaps])]
        return (
            f"the times of {name} have {gaps.size} gap(s): after t = {_shown(t, gaps[0])}, "
            f"{counts[gaps[0]] - 1} sample(s) of {step:g} s are missing; the "
            f"longest gap, after t = {_shown(t, longest)}, lasts {steps[longest]:g} s. Fill the "
            "gap, or use the record before or after it."
        )
    usual = np.median(steps)
    at = np.argmax(np.abs(steps - usual))
    return (
        f"the times of {name} are not uniform: steps run from {steps.min():g} to {steps.max():g} s "
        f"(median {usual:g} s), the oddest after t = {_shown(t, at)}. Interpolate the series onto "
        "a uniform step before reading it, or split it where the clock changed."
    )


@dataclass(frozen=True)
class TimeReport:
    """Step, gaps and jitter of a time axis.

    Parameters
    ----------
    step : float
        Step of the grid that fits the instants best, s.
    begin : float
        First instant of that grid, s.
    count : int
        Instants that are there.
    missing : int
        Instants of the grid that are not.
    gaps : tuple of (float, float)
        Last instant before each gap and its length, s.
    jitter_rms : float
        Distance of the instants from the grid, s.
    jittered : bool
        Whether that is more than a hundredth of a step and than the decimals explain.
    place : ndarray of int
        Instant of the grid that each stands for.

    Examples
    --------
    >>> inspect_times([0.0, 0.1, 0.2, 0.5, 0.6]).gaps
    ((0.2, 0.3),)
    """

    step: float
    begin: float
    count: int
    missing: int
    gaps: tuple[tuple[float, float], ...]
    jitter_rms: float
    jittered: bool
    place: IntArray

    @property
    def uniform(self) -> bool:
        """Whether there is neither gap nor jitter."""
        return not self.gaps and not self.jittered


def inspect_times(time: ArrayLike, name: str = "the run") -> TimeReport:
    """Look for gaps and jitter in a time axis.

    Parameters
    ----------
    time : array_like, shape (time,)
        Increasing instants, s.
    name : str, optional
        What a message calls their owner.

    Returns
    -------
    TimeReport
        The report.

    Raises
    ------
    DataError
        If the times are not finite, repeated or unsorted.
    """
    t = check_order(time, name)
    steps = np.diff(t)
    # Rounding of the times averages out; in one step it would add up over a long gap.
    usual = steps[steps < 1.5 * np.median(steps)].mean()
    place = np.concatenate([[0], np.cumsum(np.maximum(np.rint(steps / usual), 1))]).astype(int)
    step, begin = np.polyfit(place, t, 1)
    away = t - (begin + step * place)
    at = np.flatnonzero(np.diff(place) > 1)
    return TimeReport(
        step=float(step),
        begin=float(begin),
        count=t.size,
        missing=int(place[-1]) + 1 - t.size,
        gaps=tuple((float(t[i]), float(round(t[i + 1] - t[i], 9))) for i in at),
        jitter_rms=math.sqrt(np.mean(away**2)),
        jittered=bool(np.abs(away).max() > _tolerance(t, step)),
        place=place,
    )


def onto_uniform(
    time: ArrayLike, series: ArrayLike, name: str = "the run"
) -> tuple[FloatArray, FloatArray]:
    """Put series onto a uniform axis, NaN where samples are missing.

    Samples of an axis that only has gaps are returned untouched. On an axis with jitter they are
    interpolated by cubic splines between gaps, which needs several samples per wave.

    Parameters
    ----------
    time : array_like, shape (time,)
        Increasing instants, s.
    series : array_like, shape (time,) or (time, channel)
        Values; NaN stays NaN.
    name : str, optional
        What a message calls their owner.

    Returns
    -------
    time, series : ndarray
        Uniform instants, s, and the values there.

    Raises
    ------
    DataError
        As :func:`inspect_times`; also if more than half of the samples are missing.

    Examples
    --------
    >>> onto_uniform([0.0, 1.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0])[1]
    array([ 5.,  6., nan,  7.,  8.])
    """
    report = inspect_times(time, name)
    t, x = check_order(time, name), as_real(series, f"the series of {name}")
    if report.missing > t.size:
        raise DataError(
            f"{name} misses {report.missing} samples and has {t.size}: its times do not make a "
            "record. Split the file where the logger paused, or state its sampling rate."
        )
    place = report.place
    out = np.full((place[-1] + 1, *x.shape[1:]), np.nan)
    grid = report.begin + report.step * np.arange(out.shape[0])
    out[place] = x
    if report.uniform:
        return t.copy(), out
    if report.jittered:
        there = np.isfinite(out.reshape(out.shape[0], -1)).all(axis=1)
        for first, after in stretches(np.asarray(there)):
            if after - first >= 4:
                part = slice(*np.searchsorted(place, [first, after]))
                spline = scipy.interpolate.CubicSpline(t[part], x[part])
                out[first:after] = spline(np.clip(grid[first:after], *t[part][[0, -1]]))
    return grid, out


def stretches(wanted: BoolArray) -> list[tuple[int, int]]:
    """Start and end (not included) of each stretch of true values.

    Examples
    --------
    >>> import numpy as np
    >>> stretches(np.array([False, True, True, False, True]))
    [(1, 3), (4, 5)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def over_gaps(series: FloatArray, there: BoolArray | None = None) -> FloatArray:
    """Series with straight lines across its gaps, and its first and last value before and after.

    Gaps are samples that are not finite, or not `there`; a series without any value gets zeros.

    Examples
    --------
    >>> import numpy as np
    >>> over_gaps(np.array([0.0, 1.0, np.nan, 3.0]))
    array([0., 1., 2., 3.])
    """
    there = np.isfinite(series) if there is None else there
    at = np.flatnonzero(there)
    if not at.size:
        return np.zeros(series.size)
    return np.interp(np.arange(series.size), at, series[at])


@dataclass(frozen=True)
class Bridged:
    """A series whose gaps were filled, and which samples were.

    Parameters
    ----------
    values : ndarray, shape (time,)
        The series without gaps.
    short : ndarray of bool, shape (time,)
        Samples of gaps that are short enough to be believed.
    long : ndarray of bool, shape (time,)
        Samples of the others, and of gaps at the ends: filled so that a filter can run over
        them, and not to be used.
    """

    values: FloatArray
    short: BoolArray
    long: BoolArray


def bridge(series: ArrayLike, dt: float, longest: float) -> Bridged:
    """Fill gaps by a monotone cubic through the samples beside them.

    Parameters
    ----------
    series : array_like, shape (time,)
        Series with NaN where samples are missing.
    dt : float
        Time step, s.
    longest : float
        Gaps up to this length count as short, s.

    Returns
    -------
    Bridged
        The series, and what was filled.

    Raises
    ------
    DataError
        If fewer than two samples are there.
    RequestError
        If the step is not positive.

    Examples
    --------
    >>> bridge([0.0, 1.0, float("nan"), 3.0], 1.0, 2.0).values
    array([0., 1., 2., 3.])
    """
    x = as_real(series, "the series")
    time_step(dt)
    missing = ~np.isfinite(x)
    short, long = np.zeros_like(missing), np.zeros_like(missing)
    there = np.flatnonzero(~missing)
    if there.size < 2:
        raise DataError(
            f"the series has {there.size} value(s) in {x.size} samples: too few to bridge a gap. "
            "Leave the channel out."
        )
    filled = x.copy()
    for begin, end in stretches(missing):
        inner = begin > 0 and end < x.size
        kind = short if inner and (end - begin) * dt <= longest * (1 + 1e-9) else long
        kind[begin:end] = True
        # Four samples on either side, spread over a gap's own length so that noise counts less.
        hop = max(1, (end - begin) // 4)
        near = np.concatenate([begin - 1 - hop * np.arange(4)[::-1], end + hop * np.arange(4)])
        near = np.intersect1d(near, there)
        if inner and near.size >= 2:
            filled[begin:end] = scipy.interpolate.PchipInterpolator(near, x[near])(
                np.arange(begin, end)
            )
        else:
            filled[begin:end] = x[end] if begin == 0 else x[begin - 1]
    return Bridged(filled, short, long)
