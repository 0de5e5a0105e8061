"""Time axes: checks, the uniform step, and resampling onto another one."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from scipy import special

from seakeep.errors import DataError
from seakeep.signals.filters import as_series, odd_extension, positive

__all__ = ["resample", "uniform_step"]

FloatArray = npt.NDArray[np.float64]

STEP_TOLERANCE = 0.01
"""A time axis is uniform if no instant is further than this part of a step from its grid."""

PASSBAND = 0.8
"""Part of the lower Nyquist frequency up to which resampling keeps what there is."""


def as_seconds(time: npt.ArrayLike, name: str = "the run") -> FloatArray:
    """Return times as floats; refuse dates, words and what else is not a number of seconds.

    Parameters
    ----------
    time : array_like
        Instants, s.
    name : str, optional
        What the message calls the owner of the times.

    Returns
    -------
    ndarray
        The times, of the same shape.

    Raises
    ------
    DataError
        If they are not numbers.
    """
    t = np.asarray(time)
    if t.dtype.kind not in "iuf":
        raise DataError(
            f"the times of {name} are of type {t.dtype}; seconds as numbers are expected. "
            "Subtract the first instant and divide by one second."
        )
    return t.astype(float, copy=False)


def instant_text(instant: float, dt: float) -> str:
    """Write an instant to a thousandth of a time step, whatever it is counted from.

    Parameters
    ----------
    instant : float
        s.
    dt : float
        Time step, s; 0 asks for all digits of the instant.

    Returns
    -------
    str
        Without the unit, and without zeros at its end.

    Examples
    --------
    >>> instant_text(1700000034.35, 0.05), instant_text(2.0, 0.05)
    ('1700000034.35', '2')
    """
    known = 15 - len(f"{abs(instant):.0f}")  # digits of a double
    wanted = 3 - math.floor(math.log10(dt)) if dt > 0 else known
    return fixed(instant, max(0, min(wanted, known)))


def span_text(begin: float, end: float, dt: float) -> str:
    """Write a span of time, with its unit; instants as :func:`instant_text`."""
    return f"{instant_text(begin, dt)} to {instant_text(end, dt)} s"


def fixed(value: float, decimals: int) -> str:
    """Write a number to so many decimals, without zeros at its end."""
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def check_order(time: npt.ArrayLike, name: str = "the run") -> FloatArray:
    """Return the times as floats; refuse values that are not finite, repeated or unsorted.

    Parameters
    ----------
    time : array_like, shape (time,)
        Instants, s.
    name : str, optional
        What the message calls the owner of the times.

    Returns
    -------
    ndarray
        The times.

    Raises
    ------
    DataError
        If a time is no number, not finite, repeated, or smaller than the one before.
    """
    t = as_seconds(time, name)
    if t.ndim != 1 or t.size < 2:
        raise DataError(f"{name} has {t.size} instant(s); a time axis needs at least two.")
    if not np.all(np.isfinite(t)):
        at = int(np.flatnonzero(~np.isfinite(t))[0])
        raise DataError(
            f"the times of {name} hold a value that is not finite at sample {at} "
            f"({int(np.sum(~np.isfinite(t)))} in all). Remove these rows, or repair the times."
        )
    steps = np.diff(t)

    def told(sample: int) -> str:
        return f"{instant_text(t[sample], float(np.median(np.abs(steps))))} s"

    if np.any(steps == 0):
        at = int(np.flatnonzero(steps == 0)[0])
        raise DataError(
            f"the times of {name} repeat: {told(at)} stands at samples {at} and {at + 1} "
            f"({int(np.sum(steps == 0))} repetitions in all). Remove the double rows, or raise the "
            "number of decimals the logger writes."
        )
    if np.any(steps < 0):
        at = int(np.flatnonzero(steps < 0)[0])
        raise DataError(
            f"the times of {name} are not sorted: {told(at + 1)} follows {told(at)} at sample "
            f"{at + 1}. Sort the rows by time, or split the file where the clock was restarted."
        )
    return t


def uniform_step(time: npt.ArrayLike, name: str = "the run") -> float:
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
        If the times are no numbers, unsorted, repeated, or further from a uniform grid than a
        hundredth of a step and than the decimals explain with which they were written.

    Examples
    --------
    >>> uniform_step([0.0, 0.1, 0.2, 0.3])
    0.1
    """
    t = as_seconds(time, name)
    if t.ndim != 1 or t.size < 2:
        check_order(t, name)
    step = float((t[-1] - t[0]) / (t.size - 1))
    off = np.abs(t - (t[0] + step * np.arange(t.size)))
    # Times this close to a rising grid are finite and sorted; else the order is looked at.
    close = step > 0 and np.max(off) <= STEP_TOLERANCE * step
    if not close:
        check_order(t, name)
    if not close and np.max(off) > max(STEP_TOLERANCE * step, printed_tolerance(t, step)):
        raise DataError(_irregularity(t, name))
    # A decimal step such as 0.04 that was summed or printed comes back as what was meant.
    rounded = float(f"{step:.10g}")
    return rounded if abs(rounded - step) * t.size < 1e-6 * step else step


def printed_tolerance(t: FloatArray, step: float) -> float:
    """How far rounding to the decimals that the times were written with may move an instant."""
    for decimals in range(7):
        unit = 10.0**-decimals
        if unit <= 0.1 * step:
            scaled = t / unit
            if np.max(np.abs(scaled - np.rint(scaled))) < 1e-3:
                return 1.001 * unit  # half a unit at the instant, half at the ends of the grid
    return 0.0


def _irregularity(t: FloatArray, name: str) -> str:
    steps = np.diff(t)
    usual = float(np.median(steps))

    def told(sample: int) -> str:
        return f"{instant_text(t[sample], usual)} s"

    counts = steps / usual
    gaps = np.flatnonzero(counts > 1.5)
    if gaps.size and np.max(np.abs(counts - np.rint(counts))) < 0.1:
        longest = gaps[np.argmax(steps[gaps])]
        return (
            f"the times of {name} have {gaps.size} gap(s): after t = {told(int(gaps[0]))}, "
            f"{int(np.rint(counts[gaps[0]])) - 1} sample(s) of {usual:g} s are missing; the "
            f"longest gap, after t = {told(int(longest))}, lasts {steps[longest]:g} s. Fill the "
            "gap, or use the record before or after it."
        )
    at = int(np.argmax(np.abs(steps - usual)))
    return (
        f"the times of {name} are not uniform: steps run from {steps.min():g} to {steps.max():g} s "
        f"(median {usual:g} s), the oddest after t = {told(at)}. Interpolate the series onto a "
        "uniform step before reading it, or split it where the clock changed."
    )


def resample(
    series: npt.ArrayLike,
    time: npt.ArrayLike,
    new_time: npt.ArrayLike,
    attenuation: float = 60.0,
    passband: float = PASSBAND,
    anti_alias: bool = True,
) -> FloatArray:
    """Band-limited resampling of a uniform series onto another uniform time axis.

    Each new sample is a Kaiser-windowed sinc sum over the old ones. Its cut lies between
    `passband` times the lower of the two Nyquist frequencies and that frequency itself, so that
    going to a larger step does not alias; phase is kept, and constants are kept exactly.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps.
    time : array_like, shape (time,)
        Its instants, s.
    new_time : array_like, shape (new_time,)
        The instants wanted, s, uniform and inside the span of `time`.
    attenuation : float, optional
        Attenuation above the new Nyquist frequency, dB; less than 50 is taken as 50.
    passband : float, optional
        Edge of the pass band as a part of the lower Nyquist frequency.
    anti_alias : bool, optional
        False cuts at the old Nyquist frequency: samples are taken as they are, and what lies
        above the new one is folded into the result, as in the paper's chain.

    Returns
    -------
    ndarray, shape (new_time,) or (new_time, channel)
        The series at the new instants. Where the instants coincide and the step is the same, the
        samples are handed on untouched.

    Raises
    ------
    DataError
        If a time axis is not uniform, or new instants lie outside the old span.
    RequestError
        If the series has gaps.

    Examples
    --------
    >>> import numpy as np
    >>> old, new = np.arange(0, 30, 0.01), np.arange(0, 29, 0.05)
    >>> out = resample(np.sin(old), old, new)
    >>> bool(np.max(np.abs(out - np.sin(new))[40:-40]) < 1e-3)
    True
    """
    array = as_series(series)
    t, wanted = as_seconds(time, "the series"), as_seconds(new_time, "the new time axis")
    dt, new_dt = uniform_step(t, "the series"), uniform_step(wanted, "the new time axis")
    if array.shape[0] != t.size:
        raise DataError(
            f"the series has {array.shape[0]} samples and the time axis {t.size}; they must agree. "
            "Time runs along the first axis."
        )
    slack = 1e-6 * dt
    if wanted[0] < t[0] - slack or wanted[-1] > t[-1] + slack:
        raise DataError(
            f"new instants from {span_text(wanted[0], wanted[-1], dt)} lie outside the series, "
            f"which runs from {span_text(t[0], t[-1], dt)}. Shorten the new time axis."
        )
    position = (wanted - t[0]) / dt
    nearest = np.rint(position)
    if abs(new_dt - dt) < 1e-9 * dt and np.max(np.abs(position - nearest)) < 1e-6:
        same: FloatArray = array[nearest.astype(int)]
        return same

    # The lower one, in cycles an old sample.
    nyquist = 0.5 * min(1.0, dt / new_dt if anti_alias else 1.0)
    return _sinc_sums(array, position, (passband * nyquist, nyquist), attenuation)


PHASES = 256
"""Places between two samples at which the kernel is tabulated."""
AT_ONCE = 500_000
"""Weights formed at once: they stay in the processor's cache."""


def _sinc_sums(
    array: FloatArray, position: FloatArray, edges: tuple[float, float], attenuation: float
) -> FloatArray:
    """Low-passed values of a series between its samples.

    `position` counts in old samples; `edges`, of the pass and stop bands, are cycles a sample.
    """
    attenuation = max(positive("the attenuation", attenuation, "dB"), 50.0)
    width = edges[1] - edges[0]
    half = int(np.ceil((attenuation - 7.95) / (4.57 * np.pi * width) + 1))  # Kaiser's formula
    bank = _kernels(half, 0.1102 * (attenuation - 8.7), sum(edges))
    base = np.floor(position).astype(int)
    place = (position - base) * PHASES
    phase = np.minimum(place.astype(int), PHASES - 1)
    cubic = _lagrange(place - phase)
    columns = odd_extension(array, half).reshape(array.shape[0] + 2 * half, -1).T
    views = [
        np.lib.stride_tricks.sliding_window_view(np.ascontiguousarray(each), 2 * half)
        for each in columns
    ]
    out = np.empty((position.size, len(views)))
    rows_at_once = max(1, AT_ONCE // (2 * half))
    for first in range(0, position.size, rows_at_once):
        rows = slice(first, first + rows_at_once)
        weights = cubic[0, rows, None] * bank[phase[rows]]
        for each in (1, 2, 3):
            weights += cubic[each, rows, None] * bank[phase[rows] + each]
        for column, view in enumerate(views):
            out[rows, column] = np.einsum("ij,ij->i", weights, view[base[rows] + 1])
    result: FloatArray = out.reshape((position.size, *array.shape[1:]))
    return result


def _kernels(half: int, beta: float, band: float) -> FloatArray:
    """Kaiser-windowed sincs, row by row later by 1 / PHASES of a sample, the first by minus one.

    Each row sums to one, so that constants are kept, between the rows too. A cubic through four
    rows is the kernel to 1e-9: its fourth derivative is (2 pi 0.55)^4 / 5 at most.
    """
    lag = np.arange(-1, PHASES + 2)[:, None] / PHASES - np.arange(-half + 1, half + 1)
    inside = 1.0 - (lag / half) ** 2
    # Beyond its ends by a row, the window goes on analytically: I0(i y) is J0(y).
    window = np.where(
        inside >= 0,
        special.i0(beta * np.sqrt(np.maximum(inside, 0.0))),
        special.j0(beta * np.sqrt(np.maximum(-inside, 0.0))),
    )
    kernels: FloatArray = window * np.sinc(band * lag)
    kernels /= kernels.sum(axis=1, keepdims=True)
    return kernels


def _lagrange(x: FloatArray) -> FloatArray:
    """Weights of the cubic through values at -1, 0, 1 and 2, at `x` between 0 and 1."""
    return np.stack(
        [
            -x * (x - 1) * (x - 2) / 6,
            (x + 1) * (x - 1) * (x - 2) / 2,
            -(x + 1) * x * (x - 2) / 2,
            (x + 1) * x * (x - 1) / 6,
        ]
    )
