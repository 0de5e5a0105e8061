"""Waves to come: what an autoregressive model of a record expects, and what a probe up-wave saw."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy

from seakeep.arrays import ArrayLike, BoolArray, FloatArray, as_series, whole_number
from seakeep.signals.calculus import autoregression, continued
from seakeep.signals.propagation import LEAST_CORRELATION, band_limit, carry_by_dispersion
from seakeep.waves import group_speed

MEMORY = 4.0
"""Wave periods that a linear prediction looks back. On the virtual tank the error over 0.75
encounter periods is 0.53 SD with one half of a period, 0.43 with one, 0.38 with two, 0.32 with
four."""
UNLIKE = math.sqrt(1.0 - LEAST_CORRELATION**2)
"""Part of a record's SD that may be left of it once the waves carried to it are taken off."""
NOISE = 1e-6
"""Part of a record's variance that counts as noise: a sum of tones, as of a simulated sea, would
seem to be known for good without it."""
JUMP, OF_LATE, FEWEST = 12.0, 256, 32
"""Third differences over their RMS above which a sample jumps, the samples of that RMS, and those
before which none is judged. Waves and motions of the virtual tank reach 5.3, and seas of the
skewness 0.77 reach 9.0."""
SLOWLY, QUICKLY = 0.99, 0.05
"""Shares of a record's variance below the waves that arrive last, and below the first ones."""


def predict_waves(series: ArrayLike, count: int) -> FloatArray:
    """Continue elevations by linear prediction, each from its own record.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Elevations, uniformly sampled, without gaps; tens of wave periods are best.
    count : int
        Number of samples to predict.

    Returns
    -------
    ndarray, shape (count,) or (count, channel)
        The samples after the record: what an autoregressive model of its last four periods
        expects. They tend to the mean, as waves cannot be foreseen for long.

    Raises
    ------
    RequestError
        If `count` is not a positive integer.
    DataError
        If a record has gaps.

    Notes
    -----
    The coefficients are found by Burg's method (Maximum entropy spectral analysis, 1975), which
    makes a stable model of any record.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 60, 0.05)
    >>> tone = np.cos(2 * np.pi * t / 1.6)
    >>> bool(np.max(np.abs(predict_waves(tone[:1000], 32) - tone[1000:1032])) < 0.02)
    True
    """
    array = as_series(series, minimum=4, channels=True)
    return foresee(array.reshape(len(array), -1), count).expected.reshape(-1, *array.shape[1:])


class Foreseen(NamedTuple):
    """What is known of inputs to come.

    Parameters
    ----------
    expected : ndarray, shape (count, channel)
        The samples after a record.
    departures : ndarray, shape (channel, count, channel)
        What an innovation of one SD adds to them, of each channel, at the first sample. Later ones
        add the same, later.
    freedom : float
        Degrees of freedom of the variance of the innovations: samples per coefficient.
    """

    expected: FloatArray
    departures: FloatArray
    freedom: float


def foresee(
    series: ArrayLike,
    count: int,
    *,
    dt: float = 1.0,
    positions: ArrayLike = math.nan,
    depth: float = math.inf,
) -> Foreseen:
    r"""Continue elevations at probes that see the same waves, and say how they may depart from it.

    The farthest probe up-wave is continued as by :func:`predict_waves`. Each further one is what
    the probe before it has measured, followed by its future, carried by linear dispersion, plus
    what the waves so carried leave of its own record, which is continued from that.

    Parameters
    ----------
    series : array_like, shape (time, channel)
        As in :func:`predict_waves`.
    count : int
        Number of samples to predict.
    dt : float
        Time step, s.
    positions : array_like, shape (channel,)
        Of the probes, m, positive downstream; NaN, as all by default, for a channel with a record
        of its own.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.

    Returns
    -------
    Foreseen
        A probe whose record is not the one before it carried to it, to a correlation of 0.8, is
        continued from its own.

    Raises
    ------
    RequestError, DataError
        As :func:`predict_waves` and :func:`carry_by_dispersion`.

    Notes
    -----
    An autoregressive model of the filter :math:`A(z)` departs from its prediction by the
    innovations to come, filtered by :math:`1/A(z)`. Those of the power σ² have the variance
    :math:`\sigma^2 \sum_{i<k} \psi_i^2` after k samples, with the impulse response ψ.
    """
    array, number = as_series(series, minimum=4, channels=True), whole_number(count, "count")
    size, channels = array.shape
    # What is expected of each channel, and then how innovations of each make it depart.
    future, orders = np.zeros((number, channels, 1 + channels)), np.empty(channels)

    def follow(column: int, values: FloatArray) -> None:
        deviations, first = values - values.mean(), np.zeros(number)
        order = 1
        if np.ptp(deviations) > 0:
            order = round(MEMORY / max(band_limit(deviations, 1.0, 0.5), 1.0 / deviations.size))
        whitening, power = autoregression(deviations, order, NOISE)
        first[0], orders[column] = math.sqrt(power), len(whitening) - 1
        future[:, column, 0] += values.mean() + continued(deviations, whitening, number)
        future[:, column, 1 + column] = scipy.signal.lfilter([1.0], whitening, first)

    places = np.broadcast_to(np.asarray(positions, float), channels)
    order = np.argsort(places)[: np.isfinite(places).sum()].tolist()
    for column in set(range(channels)) - set(order[1:]):
        follow(column, array[:, column])
    for before, here in pairwise(order):
        rest = array[:, here]
        if np.ptp(array[:, before]) > 0:
            apart, limit = places[here] - places[before], band_limit(array[:, before], dt)
            past = np.zeros((size, 1 + channels))
            past[:, 0] = array[:, before]
            both = np.concatenate([past, future[:, before]])  # carrying is linear
            carried = carry_by_dispersion(both, dt, (apart, apart), depth, limit).at(apart)
            slowest = 2 * np.pi * band_limit(array[:, before], dt, SLOWLY)
            settled = min(int(apart / group_speed(slowest, depth) / dt), size // 2)
            left = (rest - carried[:size, 0])[settled:]
            if left.std() <= UNLIKE * rest.std():
                rest, future[:, here] = left, carried[size:]
        follow(here, rest)
    expected, departures = future[..., 0], future[..., 1:].transpose(2, 0, 1)
    return Foreseen(expected, departures, size / max(orders, default=1.0))


class Jumps:
    """Tells samples that jump, by their third difference from the last three that were taken.

    Waves and motions go on smoothly, and their third differences are mostly those of noise. Over a
    gap, Newton's divided difference takes their place, so that the tolerance grows with the gap:
    what stays where it jumped to is taken in the end.

    Parameters
    ----------
    least : ndarray, shape (channel,)
        RMS of third differences at least, above zero; infinite where nothing jumps.
    """

    def __init__(self, least: FloatArray) -> None:
        self.least = least
        # Values of the last three samples that were taken, the last first, and their ages; sum and
        # weight of squares that fade.
        self.memory = np.full((8, least.size), np.nan)
        self.memory[6:] = 0.0

    @np.errstate(over="ignore")
    def of(self, sample: FloatArray) -> BoolArray:
        """Which values of the next sample jump; it holds NaN where there is none."""
        first, second, third, a, b, c, squares, weight = self.memory
        for age in (a, b, c):
            age += 1
        away = sample - first * (b * c) / ((b - a) * (c - a))
        away -= second * (a * c) / ((a - b) * (c - b)) + third * (a * b) / ((a - c) * (b - c))
        away = np.abs(6.0 / (a * b * c) * away)
        usual = np.maximum(np.sqrt(squares / np.maximum(weight, 1.0)), self.least)
        jumps = (away > JUMP * usual) & (weight >= FEWEST)
        taken = np.isfinite(sample) & ~jumps
        # Jumps count too, but not for all that they are: what has become rougher is soon usual.
        beside = ((c == 3) | jumps) & np.isfinite(sample) & np.isfinite(self.least)
        self.memory[6:] *= np.where(beside, 1.0 - 1.0 / OF_LATE, 1.0)
        squares += np.where(beside, np.minimum(away, 0.5 * JUMP * usual) ** 2, 0.0)
        weight += beside
        newer = [sample, first, second, np.zeros(sample.size), a, b]
        self.memory[:6] = np.where(taken, newer, self.memory[:6])
        return jumps


def close_gaps(record: FloatArray, lost: BoolArray, longest: int) -> None:
    """Close gaps by a cubic through two measured samples on either side.

    Across a quarter of a wave's period it errs by 0.04 of the SD, and what samples before tell by
    0.3 on the virtual tank.

    Parameters
    ----------
    record : ndarray, shape (time,)
        Uniformly sampled; changed in place.
    lost : ndarray of bool, shape (time,)
        Which samples were not measured; closed ones are taken out.
    longest : int
        Samples of a gap at most.
    """
    known, rows = np.flatnonzero(~lost), np.flatnonzero(lost)
    after = np.searchsorted(known, rows)
    rows, after = (each[(after > 0) & (after < known.size)] for each in (rows, after))
    is_short = known[after] - known[after - 1] <= longest + 1
    rows, places = rows[is_short, None], after[is_short, None] + np.arange(-2, 2)
    there = (places >= 0) & (places < known.size)  # one may lack at either end of the record
    near = known[np.clip(places, 0, known.size - 1)]
    weights = np.where(there, record[near], 0.0)
    for own in range(4):  # Lagrange's polynomials
        others = there & there[:, own : own + 1] & (np.arange(4) != own)
        apart = np.where(others, near[:, own : own + 1] - near, 1)
        weights[:, own] *= np.where(others, (rows - near) / apart, 1.0).prod(axis=1)
    record[rows[:, 0]] = weights.sum(axis=1)
    lost[rows] = False


def fill_future(
    series: FloatArray, known: int, foreseen: Callable[[FloatArray, int], Foreseen]
) -> tuple[FloatArray, int, float]:
    """Fill what is missing of records from a sample on, and say how it may depart from that.

    Parameters
    ----------
    series : ndarray, shape (time, channel)
        Elevations, not finite where they are missing.
    known : int
        Sample from which on they are filled; one at least is missing.
    foreseen : callable
        :func:`foresee` with the positions of the probes: called with a record and a count.

    Returns
    -------
    futures : ndarray, shape (1 + 2 channels, time, channel)
        First what is expected, then departures from it by an innovation of each channel where it
        is first missing, then their opposites.
    first : int
        First sample of which one is missing.
    freedom : float
        As in :class:`Foreseen`.
    """
    gaps = ~np.isfinite(series)
    lacking = np.flatnonzero(gaps.any(axis=1))
    at = int(np.searchsorted(lacking, known))
    first, begin = int(lacking[at]), int(lacking[at - 1]) + 1 if at else 0
    missing, found = gaps[first:], foreseen(series[begin:first], len(series) - first)
    departures, filled = np.zeros((gaps.shape[1], *series.shape)), series.copy()
    for column, late in enumerate(missing.argmax(axis=0)):
        if missing[:, column].any():
            away = found.departures[column, : len(missing) - late]
            departures[column, first + late :] = away * missing[late:]
    filled[first:][missing] = found.expected[missing]
    futures = np.concatenate([filled[None], filled + departures, filled - departures])
    return futures, first, found.freedom


def predictable_time(series: ArrayLike, dt: float, distance: float, depth: float) -> float:
    r"""Time for which the waves at a place are known from a probe up-wave of it.

    Parameters
    ----------
    series : array_like, shape (time,)
        Elevation at the probe, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    distance : float
        From the probe to the place, m, positive downstream.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.

    Returns
    -------
    float
        :math:`d/c_g`, s, with the group speed of the frequency below which a twentieth of the
        record's variance lies: waves that the probe has not seen yet, and which are faster, carry
        no more than that.

    Raises
    ------
    RequestError, DataError
        If an argument is out of range, or the record has gaps or is constant.

    Examples
    --------
    >>> import numpy as np
    >>> wave = np.cos(3.0 * np.arange(0, 60, 0.05))
    >>> round(predictable_time(wave, 0.05, 2.0, np.inf), 1)  # 2 d ω / g
    1.2
    """
    return float(distance / group_speed(2 * np.pi * band_limit(series, dt, QUICKLY), depth))
