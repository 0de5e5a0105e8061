r"""Peaks of a response: exceedance, Rayleigh and Weibull, and the most probable extreme.

Weibull's law is :math:`P(a > x) = \exp(-(x/b)^k)`; Rayleigh's is that with k = 2 and
:math:`b = \sqrt 2\,\sigma`. Of N peaks the most probable largest is
:math:`b\,(\ln N)^{1/k}` (Ochi, 1990, section 4).
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy import stats

from seakeep.arrays import FloatArray

FEWEST = 10
"""Peaks from which on a law is fitted."""


class Weibull(NamedTuple):
    """Weibull's law of peaks, fitted by maximum likelihood.

    Attributes
    ----------
    shape, scale : float
        k and b; NaN where there are fewer than ten peaks.
    peaks : int
        How many.
    """

    shape: float
    scale: float
    peaks: int


def peaks_between(series: FloatArray, crossings: FloatArray) -> FloatArray:
    """Largest value between successive crossings.

    Parameters
    ----------
    series : ndarray, shape (time,)
        Deviations from the mean.
    crossings : ndarray
        Samples of zero-up-crossings.

    Returns
    -------
    ndarray, shape (crossings − 1,)
    """
    edges = np.ceil(crossings).astype(int)
    return np.array([series[a:b].max() for a, b in pairwise(edges) if b > a], dtype=float)


def fit_weibull(peaks: FloatArray) -> Weibull:
    r"""Fit Weibull's law to positive peaks by maximum likelihood.

    Parameters
    ----------
    peaks : ndarray, shape (peak,)
        Those that are not positive are left out.

    Returns
    -------
    Weibull
        Its shape less the bias of maximum likelihood, :math:`1.38\,k/n` (Cohen and Whitten, 1982).
    """
    x = peaks[peaks > 0]
    if x.size < FEWEST or np.ptp(x) == 0:
        return Weibull(np.nan, np.nan, x.size)
    unit = x / x.max()  # powers stay in range
    logs = np.log(unit)
    k = 1.2 / max(float(logs.std()), 1e-3)
    for _ in range(50):
        power = unit**k
        total, first, second = power.sum(), power @ logs, power @ logs**2
        value = first / total - 1 / k - logs.mean()
        slope = second / total - (first / total) ** 2 + 1 / k**2
        step = value / slope
        k = max(k - step, 0.5 * k)
        if abs(step) < 1e-12 * k:
            break
    k *= 1 - 1.38 / x.size
    scale = float(x.max() * np.mean(unit**k) ** (1 / k))
    return Weibull(float(k), scale, x.size)


def most_probable_extreme(law: Weibull, peaks: float) -> tuple[float, float, float]:
    r"""Most probable largest of many peaks, with an interval for what the fit does not know.

    Parameters
    ----------
    law : Weibull
        Of peaks that do not depend on each other.
    peaks : float
        How many are expected in the time asked for.

    Returns
    -------
    extreme, lower, upper : float
        By the asymptotic covariance of the estimates: the variance of
        :math:`\ln x` is :math:`(1.109 + 0.608\,g^2 - 0.514\,g)/(n k^2)` with
        :math:`g = \ln\ln N` (Lawless, Statistical Models and Methods for Lifetime Data, 2003,
        section 5.2).
    """
    if not np.isfinite(law.shape) or peaks <= 1:
        return np.nan, np.nan, np.nan
    g = np.log(np.log(peaks))
    extreme = law.scale * np.exp(g / law.shape)
    variance = (1.109 + 0.608 * g**2 - 0.514 * g) / (law.peaks * law.shape**2)
    width = np.exp(stats.t.ppf(0.975, law.peaks - 1) * np.sqrt(variance))
    return float(extreme), float(extreme / width), float(extreme * width)
