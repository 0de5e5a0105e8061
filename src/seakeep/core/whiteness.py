r"""Tests of residuals: whiteness (Ljung and Box, 1978), and correlation with past inputs.

Ljung, System Identification (1999), section 16.6.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import signal, stats

from seakeep.arrays import FloatArray

__all__ = ["autocorrelation", "input_correlation", "ljung_box"]


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
    sums = sum(_products(x - x.mean(axis=0), x - x.mean(axis=0), lags) for x in pieces)
    total = np.asarray(sums)
    out = np.full(total.shape, np.nan)
    result: FloatArray = np.divide(total, total[:1], out=out, where=total[:1] > 0)
    return result


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
    size = pieces[0][1].shape[1]
    e, u = (autocorrelation([pair[side] for pair in pieces], lags) for side in (0, 1))
    both = e[:, :, None] * u[:, None]
    limit = 1.96 * np.sqrt(np.maximum(both[0] + 2 * both[1:].sum(axis=0), 1.0) / samples)
    columns = []
    for column in range(size):
        total: Any = 0.0
        of_e: Any = 0.0
        of_u = 0.0
        for residual, inputs in pieces:
            r = residual - residual.mean(axis=0)
            v = inputs[:, [column]] - inputs[:, [column]].mean(axis=0)
            total = total + _products(r, np.broadcast_to(v, r.shape), lags)
            of_e, of_u = of_e + (r**2).sum(axis=0), of_u + float((v**2).sum())
        power = np.sqrt(np.asarray(of_e * of_u))
        out = np.full(np.shape(total), np.nan)
        columns.append(np.divide(total, power, out=out, where=power > 0))
    return np.stack(columns, axis=-1), limit


def _products(x: FloatArray, past: FloatArray, lags: int) -> FloatArray:
    """Sums of x at an instant times `past` lag samples before, shape (lags + 1, channel)."""
    size = len(x)
    out = np.zeros((lags + 1, x.shape[1]))
    for column, (a, b) in enumerate(zip(x.T, past.T, strict=True)):
        found = signal.correlate(a, b, method="fft")[size - 1 : size + lags]
        out[: len(found), column] = found
    return out
