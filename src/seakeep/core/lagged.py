r"""Products with Hankel matrices that are never built.

A sum over time of one series with another at many lags,
:math:`S_l = \sum_i a_i\, b_{k+i-l}^T` for :math:`l = 0 … L-1`, is :math:`a^T H` with the Hankel
matrix H of b. Kept newest first in one long row, b holds every row of H as a contiguous piece;
laying d lags side by side once makes a dense block that serves, moved down by q d rows, the lags
q d … q d + d − 1. So a few products with d times the data replace one with L times the data.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["lagged_response", "lagged_sums", "recent"]

FloatArray = npt.NDArray[np.float64]

RESPONSES = 24
"""Instants whose responses are one product with a Toeplitz matrix of the weights."""
BLOCK_WIDTH = 96
"""Columns of the block of lags that is laid out: wide enough for BLAS, small enough for cache."""


def recent(series: FloatArray, at: int, lags: int) -> FloatArray:
    """Sample `at` and those before it, newest first, in one row.

    Parameters
    ----------
    series : ndarray, shape (time, channel)
        Series.
    at : int
        Sample of the first block.
    lags : int
        Number of samples, zero or more.

    Returns
    -------
    ndarray, shape (lags * channel,)
        The extended snapshot of `lags` − 1 delays.
    """
    return series[at - lags + 1 : at + 1][::-1].reshape(-1)


def lagged_sums(left: FloatArray, series: FloatArray, first: int, lags: int) -> FloatArray:
    r"""Sums :math:`\sum_i a_i\, b_{k+i-l}^T` for the lags l = 0 … `lags` − 1.

    Parameters
    ----------
    left : ndarray, shape (count, rows)
        a.
    series : ndarray, shape (time, channel)
        b.
    first : int
        Sample k of the series that stands beside the first row of `left` at lag zero; at least
        `lags` − 1.
    lags : int
        Number of lags.

    Returns
    -------
    ndarray, shape (rows, lags * channel)
        The sums side by side, lag zero first: `left` transposed times the Hankel matrix of b.
    """
    count, channels = left.shape[0], series.shape[1]
    out = np.empty((left.shape[1], lags * channels))
    if out.size == 0 or count == 0:
        out[:] = 0.0
        return out
    blocks = -(-lags // max(1, BLOCK_WIDTH // channels))
    depth = -(-lags // blocks)
    rows = count + (blocks - 1) * depth
    newest_first = np.zeros((rows + depth - 1, channels))
    newest_first[: count + lags - 1] = series[first - lags + 1 : first + count][::-1]
    step = newest_first.strides[0]
    laid_out = np.ascontiguousarray(
        np.lib.stride_tricks.as_strided(
            newest_first,
            shape=(rows, depth * channels),
            strides=(step, newest_first.strides[1]),
            writeable=False,
        )
    )
    turned = np.ascontiguousarray(left[::-1].T)
    for block in range(blocks):
        at = block * depth
        width = min(depth, lags - at) * channels
        np.matmul(
            turned,
            laid_out[at : at + count, :width],
            out=out[:, at * channels : at * channels + width],
        )
    return out


def lagged_response(series: FloatArray, weights: FloatArray, first: int, count: int) -> FloatArray:
    r"""Response :math:`\sum_l g_l^T b_{k+i-l}` for i = 0 … `count` − 1.

    Some instants at a time: the samples that they reach, side by side, times a Toeplitz matrix of
    the weights.

    Parameters
    ----------
    series : ndarray, shape (time, channel)
        b.
    weights : ndarray, shape (lags * channel,)
        g, lag zero first.
    first, count : int
        Sample k, at least the number of lags less one, and the number of results.

    Returns
    -------
    ndarray, shape (count,)
        The response: the Hankel matrix of b transposed times g.
    """
    channels = series.shape[1]
    lags = weights.size // channels if channels else 0
    if lags == 0:
        return np.zeros(count)
    blocks = -(-count // RESPONSES)
    reached = np.zeros((blocks * RESPONSES + lags - 1, channels))
    reached[: count + lags - 1] = series[first - lags + 1 : first + count]
    width = (RESPONSES + lags - 1) * channels
    step, number = RESPONSES * reached.strides[0], reached.itemsize
    samples = np.lib.stride_tricks.as_strided(
        reached, shape=(blocks, width), strides=(step, number), writeable=False
    )
    # Rows one sample longer than a block's, end to end: cut at its width, each stands a sample
    # further right than the one before.
    shifted = np.zeros((RESPONSES, width + channels))
    shifted[:, : weights.size] = weights.reshape(lags, channels)[::-1].reshape(-1)
    toeplitz = shifted.reshape(-1)[: RESPONSES * width].reshape(RESPONSES, width)
    return np.asarray(samples @ toeplitz.T).reshape(-1)[:count]
