r"""Observables of a wave: slow parts of squares, and powers, as columns of a regression.

Slow drift and line loads go with the square of the wave, which no linear map of the elevation can
make. The slow parts of the squares of the elevation and of its derivatives weigh the drift force
by the frequency: :math:`D_0 + D_1 \omega^2 + D_2 \omega^4`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from seakeep.arrays import FloatArray

__all__ = ["derivative", "slow_kernel", "slow_squares"]


def slow_kernel(cutoff: float, half: int) -> FloatArray:
    """Low-pass filter of finite length: a sinc under a Hann window, with unit gain at rest.

    Parameters
    ----------
    cutoff : float
        Frequency of half gain, cycles per sample.
    half : int
        Samples on either side of the middle.

    Returns
    -------
    ndarray, shape (2 half + 1,)
    """
    lag = np.arange(-half, half + 1)
    kernel = np.sinc(2 * cutoff * lag) * np.hanning(2 * half + 3)[1:-1]
    result: FloatArray = kernel / kernel.sum()
    return result


def derivative(series: FloatArray, order: int, dt: float) -> FloatArray:
    """Derivative of order 0, 1 or 2 by central differences; NaN where a neighbour is missing.

    Parameters
    ----------
    series : ndarray, shape (time,)
        Samples.
    order : {0, 1, 2}
        Order of the derivative.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray, shape (time,)
    """
    if order == 0:
        return series
    out = np.full(series.shape, np.nan)
    if order == 1:
        out[1:-1] = (series[2:] - series[:-2]) / (2.0 * dt)
    else:
        out[1:-1] = (series[2:] - 2.0 * series[1:-1] + series[:-2]) / dt**2
    return out


def slow_squares(
    series: FloatArray,
    orders: Sequence[int],
    kernel: FloatArray,
    middle: int,
    lags: Sequence[int],
    dt: float,
) -> FloatArray:
    """Slow parts of squares of a series and of its derivatives, at lags.

    Parameters
    ----------
    series : ndarray, shape (time,)
        Elevation.
    orders : sequence of {0, 1, 2}
        Orders of the derivatives that are squared.
    kernel : ndarray, shape (2 half + 1,)
        Low-pass filter, :func:`slow_kernel`.
    middle : int
        Samples by which the middle of the filter lies ahead of the instant of a row, at lag 0.
    lags : sequence of int
        Lags of the columns, samples.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray, shape (time, len(orders) × len(lags))
        Order by order, lag by lag. A row is NaN where it needs a sample that `series` does not
        hold: ``middle + half + 1`` samples ahead (``middle + half`` if only the elevation itself
        is squared) down to ``half + 1 + max(lags) - middle`` behind.
    """
    count, half = len(series), len(kernel) // 2
    out = np.full((count, len(orders) * len(lags)), np.nan)
    for row, order in enumerate(orders):
        slow = np.full(count, np.nan)
        if count >= len(kernel):
            square = derivative(series, order, dt) ** 2
            slow[half : count - half] = np.convolve(square, kernel, "valid")
        for column, lag in enumerate(lags, start=row * len(lags)):
            shift = middle - lag  # row j holds the slow part at j + shift
            first, last = max(0, -shift), min(count, count - shift)
            if first < last:
                out[first:last, column] = slow[first + shift : last + shift]
    return out
