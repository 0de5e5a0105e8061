r"""Tests of residuals: whiteness (Ljung and Box, 1978), and correlation with past inputs.

Ljung, System Identification (1999), section 16.6.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import signal, stats

from seakeep.arrays import FloatArray


def autocorrelation(pieces: Sequence[FloatArray], lags: int) -> FloatArray:
    """Autocorrelation of records of the same process, shape (lags + 1, channel).

    Parameters
    ----------
    pieces : sequence of ndarray, each (time, channel)
        Records; the mean of each is removed, and products do not cross a joint.
    lags : int
        Largest lag, samples; at most that of the longest record, to which shorter ones add nothing
        beyond their own ends.

    Returns
    -------
    ndarray
        One at lag 0; NaN of a channel without variance.
    """
    lags = min(lags, max(map(len, pieces)) - 1)
    centred = [x - x.mean(axis=0) for x in pieces]
    total = np.asarray(sum(_products(x, x, lags) for x in centred))
    with np.errstate(invalid="ignore"):
        return np.asarray(total / total[:1])


def ljung_box(correlation: FloatArray, samples: int) -> tuple[FloatArray, FloatArray]:
    r"""Ljung and Box's test of whiteness up to the last lag.

    Parameters
    ----------
    correlation : ndarray, shape (lags + 1, channel)
        From :func:`autocorrelation`.
    samples : int
        Length n of the records together.

    Returns
    -------
    statistic, probability : ndarray, shape (channel,)
        :math:`Q = n(n+2)\sum_k \rho_k^2/(n-k)`, and how likely white noise exceeds it.
    """
    lags = np.arange(1, len(correlation))
    weights = samples * (samples + 2) / (samples - lags)
    statistic: FloatArray = weights @ correlation[1:] ** 2
    probability: FloatArray = stats.chi2.sf(statistic, lags.size)
    return statistic, probability


def input_correlation(
    pieces: Sequence[tuple[FloatArray, FloatArray]], lags: int
) -> tuple[FloatArray, FloatArray]:
    r"""Correlation of residuals with past inputs, and its 95 % limit where there is none.

    Parameters
    ----------
    pieces : sequence of (ndarray, ndarray)
        Residuals (time, channel) and inputs (time, input) of each record.
    lags : int
        Largest lag of the input, samples.

    Returns
    -------
    correlation : ndarray, shape (lags + 1, channel, input)
    limit : ndarray, shape (channel, input)
        :math:`1.96\sqrt{\sum_k \rho_e(k)\rho_u(k)/n}` (Ljung, equation 16.71), the sum at least
        one, its value for white residuals.
    """
    samples = sum(len(e) for e, _ in pieces)
    lags = min(lags, max(len(e) for e, _ in pieces) - 1)
    residuals, inputs = ([part - part.mean(axis=0) for part in side]
                         for side in zip(*pieces, strict=True))  # fmt: skip
    e, u = autocorrelation(residuals, lags), autocorrelation(inputs, lags)
    both = e[:, :, None] * u[:, None]
    limit = 1.96 * np.sqrt(np.maximum(both[0] + 2 * both[1:].sum(axis=0), 1.0) / samples)
    total = np.zeros(both.shape)
    for r, v in zip(residuals, inputs, strict=True):
        for column in range(v.shape[1]):
            total[:, :, column] += _products(r, np.broadcast_to(v[:, [column]], r.shape), lags)
    of_e, of_u = (sum((part**2).sum(axis=0) for part in side) for side in (residuals, inputs))
    with np.errstate(invalid="ignore"):
        return total / np.sqrt(np.multiply.outer(of_e, of_u)), limit


def _products(x: FloatArray, past: FloatArray, lags: int) -> FloatArray:
    """Sums of x at an instant times `past` lag samples before, shape (lags + 1, channel)."""
    size = len(x)
    out = np.zeros((lags + 1, x.shape[1]))
    for column, (a, b) in enumerate(zip(x.T, past.T, strict=True)):
        products = signal.correlate(a, b, method="fft")[size - 1 : size + lags]
        out[: len(products), column] = products
    return out
