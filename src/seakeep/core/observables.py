r"""Observables of a wave: derivatives and slow parts of their squares, for columns of a regression.

Slow drift and line loads go with the square of the wave, which no linear map of the elevation can
make. The slow parts of the squares of the elevation and of its derivatives weigh the drift force
by the frequency: :math:`D_0 + D_1 \omega^2 + D_2 \omega^4`.
"""

from collections.abc import Sequence

import numpy as np

from seakeep.arrays import FloatArray


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
    return kernel / kernel.sum()


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
    series: FloatArray, order: int, kernel: FloatArray, shifts: Sequence[int], dt: float
) -> FloatArray:
    """Slow part of the square of a derivative of a series, at several lags.

    Parameters
    ----------
    series : ndarray, shape (time,)
        Elevation.
    order : {0, 1, 2}
        Order of the derivative that is squared.
    kernel : ndarray, shape (2 half + 1,)
        Low-pass filter, :func:`slow_kernel`.
    shifts : sequence of int
        Samples by which the middle of the filter lies ahead of the instant of a row, per column.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray, shape (time, len(shifts))
        A row is NaN where it needs a sample that `series` does not hold: ``shift + half + 1``
        ahead (``shift + half`` of the elevation itself) down to ``half + 1 - shift`` behind.
    """
    count, half = len(series), len(kernel) // 2
    out = np.full((count, len(shifts)), np.nan)
    if count < len(kernel):
        return out
    slow = np.full(count, np.nan)
    slow[half : count - half] = np.convolve(derivative(series, order, dt) ** 2, kernel, "valid")
    for column, shift in enumerate(shifts):  # row j holds the slow part at j + shift
        first, last = max(0, -shift), min(count, count - shift)
        if first < last:
            out[first:last, column] = slow[first + shift : last + shift]
    return out
