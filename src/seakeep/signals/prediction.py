"""Waves to come: what an autoregressive model of a record expects, and what a probe up-wave saw."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.arrays import FloatArray, as_series, whole_number
from seakeep.signals.calculus import continued, predicted, reflections, whitening
from seakeep.signals.propagation import LEAST_CORRELATION, band_limit, carry_by_dispersion
from seakeep.waves import group_speed

MEMORY = 4.0
"""Wave periods that a linear prediction looks back. On the virtual tank the error over 0.75
encounter periods is 0.53 SD with one half of a period, 0.43 with one, 0.38 with two, 0.32 with
four."""
UNLIKE = math.sqrt(1.0 - LEAST_CORRELATION**2)
"""Part of a record's SD that may be left of it once the waves carried to it are taken off."""
WHOLLY = 1.0 - 1e-12
"""Largest reflection coefficient whose error is drawn: rounding hides those of a pure tone."""
SLOWLY, QUICKLY = 0.99, 0.05
"""Shares of a record's variance below the waves that arrive last, and below the first ones."""


def predict_waves(series: npt.ArrayLike, count: int) -> FloatArray:
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
    array, number = as_series(series, minimum=4, channels=True), whole_number(count, "count")

    def following(values: FloatArray) -> FloatArray:
        deviations = values - values.mean()
        return np.asarray(values.mean() + predicted(deviations, number, _memory(deviations)))

    return np.asarray(np.apply_along_axis(following, 0, array))


def draw_waves(
    series: npt.ArrayLike, count: int, pairs: int, rng: np.random.Generator
) -> FloatArray:
    r"""Draw what may follow elevations, each from its own record: futures about the predicted one.

    Parameters
    ----------
    series, count
        As in :func:`predict_waves`.
    pairs : int
        Number of pairs of futures; those of a pair lie opposite each other about the prediction,
        so that their mean is the prediction.
    rng : Generator
        Source of the Gaussian innovations.

    Returns
    -------
    ndarray, shape (2 * pairs, count) or (2 * pairs, count, channel)
        Each pair has an autoregressive model of its own, since its coefficients are known from a
        record of n samples only: Fisher's transform of the m-th reflection coefficient has a
        standard error of :math:`1/\sqrt{n - m - 3}`. Innovations have the power that the model
        leaves of the record, n/(n − p) times for p coefficients.

    Raises
    ------
    RequestError, DataError
        As :func:`predict_waves`.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> futures = draw_waves(rng.standard_normal(400), 5, 3, rng)
    >>> futures.shape, bool(np.ptp(futures[:3] + futures[3:], axis=0).max() < 1e-12)
    ((6, 5), True)
    """
    array, number = as_series(series, minimum=4, channels=True), whole_number(count, "count")

    def futures(values: FloatArray) -> FloatArray:
        deviations, size = values - values.mean(), values.size
        order = max(1, min(_memory(deviations), size // 3))
        coefficients = reflections(deviations, order)
        own = whitening(coefficients)
        expected = continued(deviations, own[None], np.zeros((1, number)))[0]
        left = scipy.signal.lfilter(own, [1.0], deviations)[order:]
        power = math.sqrt(size / (size - order)) * left.std()
        apart = rng.standard_normal((pairs, order)) / np.sqrt(
            np.maximum(size - 3 - np.arange(1, order + 1), 1)
        )
        filters = whitening(np.tanh(np.arctanh(np.clip(coefficients, -WHOLLY, WHOLLY)) + apart))
        innovations = power * rng.standard_normal((pairs, number))
        errors = continued(deviations, filters, innovations) - expected
        middle = values.mean() + expected
        return np.concatenate([middle + errors, middle - errors])

    return np.asarray(np.apply_along_axis(futures, 0, array))


def draw_sea(
    series: npt.ArrayLike,
    count: int,
    pairs: int,
    rng: np.random.Generator,
    *,
    dt: float,
    positions: npt.ArrayLike,
    depth: float,
) -> FloatArray:
    r"""Draw what may follow elevations at probes that see the same waves, one after the other.

    The farthest probe up-wave is drawn as :func:`draw_waves` does. Each further one is what the
    probe before it has measured, followed by its future, carried by linear dispersion, plus what
    the waves so carried leave of its own record, which is drawn from that.

    Parameters
    ----------
    series : array_like, shape (time, channel)
        As in :func:`draw_waves`.
    count, pairs, rng
        As in :func:`draw_waves`.
    dt : float
        Time step, s.
    positions : array_like, shape (channel,)
        Of the probes, m, positive downstream; NaN for a channel that is drawn from its own record.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.

    Returns
    -------
    ndarray, shape (2 * pairs, count, channel)
        Futures in opposite pairs. A probe whose record is not the one before it carried to it, to
        a correlation of 0.8, is drawn from its own.

    Raises
    ------
    RequestError, DataError
        As :func:`draw_waves` and :func:`carry_by_dispersion`.
    """
    array = as_series(series, minimum=4, channels=True)
    out = draw_waves(array, count, pairs, rng)
    places, size = np.asarray(positions, dtype=float), len(array)
    order = [int(each) for each in np.argsort(places) if np.isfinite(places[each])]
    for before, here in pairwise(order):
        if not np.ptp(array[:, before]) > 0:
            continue
        apart = float(places[here] - places[before])
        expected = out[:, :, before].mean(axis=0)
        # Prediction and departures from it, beside one another: carrying is linear.
        past, future = np.zeros((size, pairs + 1)), np.empty((int(count), pairs + 1))
        past[:, 0], future[:, 0] = array[:, before], expected
        future[:, 1:] = (out[:pairs, :, before] - expected).T
        limit = band_limit(array[:, before], dt)
        both = np.concatenate([past, future])
        carried = carry_by_dispersion(both, dt, (apart, apart), depth, limit).at(apart)
        settled = apart / group_speed(2 * np.pi * band_limit(array[:, before], dt, SLOWLY), depth)
        left = (array[:, here] - carried[:size, 0])[min(int(settled / dt), size // 2) :]
        if left.std() > UNLIKE * array[:, here].std():
            continue
        drawn = draw_waves(left, count, pairs, rng) + carried[size:, 0]
        moved = carried[size:, 1:].T
        out[:, :, here] = drawn + np.concatenate([moved, -moved])
    return out


def predictable_time(series: npt.ArrayLike, dt: float, distance: float, depth: float) -> float:
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
    edge = band_limit(series, dt, QUICKLY)
    return float(distance / group_speed(2 * np.pi * edge, depth))


def _memory(deviations: FloatArray) -> int:
    """Order of the autoregressive model of a record: some of its wave periods."""
    if not np.ptp(deviations) > 0:
        return 1
    return round(MEMORY / max(band_limit(deviations, 1.0, 0.5), 1.0 / deviations.size))
