"""Pulses of a trigger: where they are, which belong together, and their instants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.errors import DataError

__all__ = ["Pulses", "find_pulses", "match_pulses", "pulse_template", "time_pulses"]

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Pulses:
    """Pulses of a trigger.

    Parameters
    ----------
    centres : ndarray, shape (pulse,)
        Middle between the rising and the falling edge at half height, s.
    rise, fall : ndarray, shape (pulse,)
        Instants of the two edges, s, by linear interpolation between samples.
    height : float
        Height above the level at rest, in the trigger's unit; negative for pulses down.
    """

    centres: FloatArray
    rise: FloatArray
    fall: FloatArray
    height: float

    @property
    def width(self) -> float:
        """Median width at half height, s."""
        return float(np.median(self.fall - self.rise))


def find_pulses(trigger: FloatArray, time: FloatArray, name: str = "the trigger") -> Pulses:
    """Find the pulses of a trigger at half their height.

    Parameters
    ----------
    trigger, time : ndarray, shape (time,)
        Trigger in any unit, and the instants, s.
    name : str, optional
        What a message calls it.

    Returns
    -------
    Pulses
        Whole pulses only. Those of less than half or more than twice the median height or width
        are left out.

    Raises
    ------
    DataError
        If there is no pulse that stands out of the noise.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 10, 0.01)
    >>> pulses = find_pulses(np.exp(-((t - 4.003) / 0.1) ** 2), t)
    >>> [round(float(c), 3) for c in pulses.centres]
    [4.003]
    """
    x = np.where(np.isfinite(trigger), trigger, np.nanmedian(trigger)) - np.nanmedian(trigger)
    sign = 1.0 if x.max() >= -x.min() else -1.0
    x = sign * x
    noise = 1.4826 * float(np.median(np.abs(x)))
    # Wide stretches outvote spikes: the height is that of the sample in the middle of the time
    # spent above the noise.
    rising, falling, peaks = _stretches(x, max(8 * noise, 0.02 * float(x.max())))
    top = _weighted_median(peaks, falling - rising) if rising.size else float(x.max())
    for _ in range(2 if rising.size else 0):
        rising, falling, peaks = _stretches(x, 0.5 * top)
        if not rising.size:
            break
        top = _weighted_median(peaks, falling - rising)
    if not rising.size or top < 6 * noise or top <= 0:
        raise DataError(
            f"{name} has no pulses that stand out of its noise (largest value {top:g} above the "
            f"median, noise {noise:g}). Check the column that trigger names in [instruments.NAME]; "
            "or synchronise by another signal: state in its place shared (one signal both record), "
            "correlated (two that go together) or offset (s)."
        )
    half = 0.5 * top

    def crossing(at: IntArray) -> FloatArray:
        part = (half - x[at]) / (x[at + 1] - x[at])
        instants: FloatArray = time[at] + part * (time[at + 1] - time[at])
        return instants

    rise, fall = crossing(rising), crossing(falling)
    width = fall - rise
    usual = np.median(width[(peaks > 0.5 * top) & (peaks < 2 * top)])
    sound = (peaks > 0.5 * top) & (peaks < 2 * top) & (width > 0.5 * usual) & (width < 2 * usual)
    rise, fall = rise[sound], fall[sound]
    return Pulses(0.5 * (rise + fall), rise, fall, sign * top)


def _stretches(x: FloatArray, level: float) -> tuple[IntArray, IntArray, FloatArray]:
    """Last samples before a series rises above a level and before it falls below; its peaks."""
    edges = np.flatnonzero(np.diff((x > level).astype(np.int8)))
    rising, falling = edges[x[edges] <= level], edges[x[edges] > level]
    falling = falling[falling > rising[0]] if rising.size else falling[:0]
    rising = rising[: falling.size]
    peaks = [x[i : j + 2].max() for i, j in zip(rising, falling, strict=True)]
    return rising, falling, np.array(peaks, dtype=float)


def _weighted_median(values: FloatArray, weights: IntArray) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def match_pulses(
    own: FloatArray, reference: FloatArray, expected_offset: float, largest_drift: float
) -> tuple[IntArray, IntArray, float]:
    """Find which pulse of one record is which of another.

    Parameters
    ----------
    own, reference : ndarray, shape (pulse,)
        Instants in either clock, s.
    expected_offset : float
        Offset that is preferred among those that fit equally well, s.
    largest_drift : float
        Drift allowed for, a pure number.

    Returns
    -------
    (ndarray, ndarray, float)
        Indices of matched pulses in either record, and the distance to the next offset that
        would fit nearly as well (``inf`` if none does).

    Raises
    ------
    DataError
        If no offset brings pulses together.
    """
    spacing = min((float(np.diff(each).min()) for each in (own, reference) if each.size > 1),
                  default=1.0)  # fmt: skip
    reach = 0.02 * spacing + largest_drift * float(np.ptp(reference))
    candidates = np.unique(np.round((own[:, None] - reference[None, :]).ravel(), 6))
    counts = np.array([_pairs(own - shift, reference, reach)[0].size for shift in candidates])
    near = candidates[counts >= max(counts.max() - 1, 1)]
    best = float(near[np.argmin(np.abs(near - expected_offset))])
    rivals = near[np.abs(near - best) > 4 * reach]
    modulus = float(np.abs(rivals - best).min()) if rivals.size else float("inf")
    first, second = _pairs(own - best, reference, reach)
    if first.size < max(1, min(own.size, reference.size) // 3):
        raise DataError(
            f"of {own.size} pulses of the logger and {reference.size} of the reference only "
            f"{first.size} fit together. Check that both columns hold the same trigger."
        )
    return first, second, modulus


def _pairs(own: FloatArray, reference: FloatArray, reach: float) -> tuple[IntArray, IntArray]:
    nearest = np.abs(own[:, None] - reference[None, :]).argmin(axis=1)
    close = np.flatnonzero(np.abs(own - reference[nearest]) <= reach)
    _, unique = np.unique(nearest[close], return_index=True)
    return close[unique], nearest[close[unique]]


def pulse_template(
    trigger: FloatArray, time: FloatArray, pulses: Pulses, centres: FloatArray
) -> scipy.interpolate.CubicSpline:
    """Mean pulse of a record, as a function of the time from its centre.

    Parameters
    ----------
    trigger, time : ndarray, shape (time,)
        The record.
    pulses : Pulses
        Its pulses.
    centres : ndarray
        Those to be averaged, s.

    Returns
    -------
    scipy.interpolate.CubicSpline
        Over 1.5 widths to either side of the centre.
    """
    step = float(np.median(np.diff(time)))
    count = int(np.ceil(1.5 * pulses.width / step)) + 2
    away = step * np.arange(-count, count + 1)
    x = np.where(np.isfinite(trigger), trigger, np.nanmedian(trigger))
    whole = [c for c in centres if time[0] <= c + away[0] and c + away[-1] <= time[-1]]
    if not whole:
        whole = list(centres)
    mean = np.mean([np.interp(c + away, time, x) for c in whole], axis=0)
    return scipy.interpolate.CubicSpline(away, mean - np.median(x))


def time_pulses(
    trigger: FloatArray,
    time: FloatArray,
    centres: FloatArray,
    template: scipy.interpolate.CubicSpline,
) -> tuple[FloatArray, FloatArray]:
    """Instants of pulses by least squares of height, level and instant of a template.

    Parameters
    ----------
    trigger, time : ndarray, shape (time,)
        The record.
    centres : ndarray, shape (pulse,)
        First values, s.
    template : scipy.interpolate.CubicSpline
        From :func:`pulse_template`.

    Returns
    -------
    instants, errors : ndarray, shape (pulse,)
        s; NaN where the fit fails.
    """
    reach = float(template.x[-1])
    instants, errors = np.full(centres.size, np.nan), np.full(centres.size, np.nan)
    slope = template.derivative()
    for number, centre in enumerate(centres):
        at = float(centre)
        for _ in range(8):
            near = (np.abs(time - at) < reach) & np.isfinite(trigger)
            if near.sum() < 5:
                break
            away = time[near] - at
            shape = template(away)
            design = np.column_stack([shape, np.ones(away.size), -slope(away)])
            solution, *_ = np.linalg.lstsq(design, trigger[near], rcond=None)
            if solution[0] == 0:
                break
            move = float(np.clip(solution[2] / solution[0], -0.25 * reach, 0.25 * reach))
            at += move
            if abs(move) < 1e-9:
                break
        if near.sum() < 5 or abs(at - centre) > 0.5 * reach:
            continue
        residual = trigger[near] - design @ solution
        variance = float(residual @ residual) / max(near.sum() - 3, 1)
        instants[number] = at
        covariance = np.linalg.pinv(design.T @ design)[2, 2]
        errors[number] = np.sqrt(variance * covariance) / abs(solution[0])
    return instants, errors
