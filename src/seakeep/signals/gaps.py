"""Gaps and jitter of time axes, told and masked; gaps bridged where that is asked for."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.errors import DataError, RequestError
from seakeep.signals.clocks import check_order, printed_tolerance
from seakeep.signals.filters import positive

__all__ = ["Bridged", "TimeReport", "bridge", "inspect_times", "onto_uniform", "stretches"]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class TimeReport:
    """What a time axis looks like.

    Parameters
    ----------
    step : float
        Step of the grid that fits the instants best, s.
    count : int
        Instants that are there.
    missing : int
        Instants of the grid that are not.
    gaps : tuple of (float, float)
        Last instant before each gap and its length, s.
    jitter_rms, jitter_max : float
        Distance of the instants from the grid, s.
    jittered : bool
        Whether that is more than a hundredth of a step and than the decimals explain.

    Examples
    --------
    >>> inspect_times([0.0, 0.1, 0.2, 0.5, 0.6]).gaps
    ((0.2, 0.3),)
    """

    step: float
    count: int
    missing: int
    gaps: tuple[tuple[float, float], ...]
    jitter_rms: float
    jitter_max: float
    jittered: bool

    @property
    def uniform(self) -> bool:
        """Whether there is neither gap nor jitter."""
        return not self.gaps and not self.jittered


def inspect_times(time: npt.ArrayLike, name: str = "the run") -> TimeReport:
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
    place, step, begin = _grid(t)
    away = t - (begin + step * place)
    at = np.flatnonzero(np.diff(place) > 1)
    worst = float(np.abs(away).max())
    return TimeReport(
        step=step,
        count=t.size,
        missing=int(place[-1]) + 1 - t.size,
        gaps=tuple((float(t[i]), float(round(t[i + 1] - t[i], 9))) for i in at),
        jitter_rms=float(np.sqrt(np.mean(away**2))),
        jitter_max=worst,
        jittered=worst > max(0.01 * step, printed_tolerance(t, step)),
    )


def _grid(t: FloatArray) -> tuple[npt.NDArray[np.int64], float, float]:
    """Whole number of steps from the first instant to each, the step, and the grid's begin."""
    usual = float(np.median(np.diff(t)))
    place = np.concatenate([[0], np.cumsum(np.maximum(np.rint(np.diff(t) / usual), 1))])
    for _ in range(2):  # a usual step that is off by rounding adds up over a long gap
        step, begin = np.polyfit(place, t, 1)
        again = np.rint((t - begin) / step)
        if np.array_equal(again, place) or np.any(np.diff(again) < 1):
            break
        place = again - again[0]
    return place.astype(np.int64), float(step), float(begin)


def onto_uniform(
    time: npt.ArrayLike, series: npt.ArrayLike, name: str = "the run"
) -> tuple[FloatArray, FloatArray]:
    """Put series onto a uniform axis, NaN where samples are missing.

    Samples of an axis that only has gaps are handed on untouched. On an axis with jitter they are
    interpolated by cubic splines between gaps, which asks for several samples a wave.

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
    t, x = np.asarray(time, dtype=float), np.asarray(series, dtype=float)
    if report.missing > t.size:
        raise DataError(
            f"{name} misses {report.missing} samples and has {t.size}: its times are hardly a "
            "record. Split the file where the logger paused, or state its sampling rate."
        )
    place, step, begin = _grid(t)
    out = np.full((int(place[-1]) + 1, *x.shape[1:]), np.nan)
    grid = begin + step * np.arange(out.shape[0])
    out[place] = x
    if not report.gaps and not report.jittered:
        return t.copy(), out
    if report.jittered:
        flat, source = out.reshape(out.shape[0], -1), x.reshape(t.size, -1)
        for begin_row, end_row in stretches(np.isfinite(source).all(axis=1), place):
            part = slice(begin_row, end_row)
            if end_row - begin_row >= 4:
                spline = scipy.interpolate.CubicSpline(t[part], source[part])
                rows = place[part]
                flat[rows] = spline(np.clip(grid[rows], t[begin_row], t[end_row - 1]))
    return grid, out


def stretches(
    wanted: BoolArray, place: npt.NDArray[np.int64] | None = None
) -> list[tuple[int, int]]:
    """Begin and end (not included) of each stretch of true values.

    Parameters
    ----------
    wanted : ndarray of bool
        The values.
    place : ndarray of int, optional
        Positions on a grid; a stretch ends where they jump.

    Returns
    -------
    list of (int, int)

    Examples
    --------
    >>> import numpy as np
    >>> stretches(np.array([False, True, True, False, True]))
    [(1, 3), (4, 5)]
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(np.int8)))
    runs = list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
    if place is None:
        return runs
    parts = []
    for begin, end in runs:
        breaks = np.flatnonzero(np.diff(place[begin:end]) > 1) + begin + 1
        bounds = [begin, *breaks.tolist(), end]
        parts += list(itertools.pairwise(bounds))
    return parts


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


def bridge(series: npt.ArrayLike, dt: float, longest: float) -> Bridged:
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
    x = np.asarray(series, dtype=float)
    positive("the time step", dt, "s")
    if x.ndim != 1:
        raise RequestError(f"one series at a time is bridged; received shape {x.shape}.")
    missing = ~np.isfinite(x)
    short, long = np.zeros_like(missing), np.zeros_like(missing)
    if not missing.any():
        return Bridged(x, short, long)
    there = np.flatnonzero(~missing)
    if there.size < 2:
        raise DataError(
            f"the series has {there.size} value(s) in {x.size} samples: there is nothing to go by. "
            "Leave the channel out."
        )
    filled = x.copy()
    for begin, end in stretches(missing):
        inner = begin > 0 and end < x.size
        kind = short if inner and (end - begin) * dt <= longest * (1 + 1e-9) else long
        kind[begin:end] = True
        # Four samples on either side, spread over a gap's own length so that noise counts less.
        hop = max(1, (end - begin) // 4)
        left = begin - 1 - hop * np.arange(4)
        right = end + hop * np.arange(4)
        near = np.concatenate([left[left >= 0][::-1], right[right < x.size]])
        near = near[~missing[near]]
        if inner and near.size >= 2:
            filled[begin:end] = scipy.interpolate.PchipInterpolator(near, x[near])(
                np.arange(begin, end)
            )
        else:
            filled[begin:end] = x[end] if begin == 0 else x[begin - 1]
    return Bridged(filled, short, long)
