r"""Peaks of a response: exceedance, Rayleigh and Weibull, and the most probable extreme.

Weibull's law is :math:`P(a > x) = \exp(-(x/b)^k)`; Rayleigh's is that with k = 2 and
:math:`b = \sqrt 2\,\sigma`. Of N peaks the most probable largest is
:math:`b\,(\ln N)^{1/k}` (Ochi, 1990, section 4).

Free decay: period and damping from successive extremes, and how damping grows with amplitude.

With :math:`a_k` half the distance between successive extremes, the decrement of a cycle is
:math:`\delta_k = 2 \ln(a_k / a_{k+1}) = p + q\,\bar a_k`: p is linear damping,
:math:`\zeta = p / \sqrt{4\pi^2 + p^2}`, and q quadratic (Himeno, 1981; ITTC 7.5-02-07-04.5).
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy import signal, stats

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


SMALLEST = 0.02
"""Part of the whole range below which a swing counts as noise."""
NOISE = 4.0
"""SDs of noise on either side that thousands of its samples hardly leave."""
APART = 2.0
"""Half periods of the largest swing after which the next extreme is another motion's."""


class Decay(NamedTuple):
    """What a decaying oscillation shows; NaN where it has too few extremes.

    Attributes
    ----------
    period : float
        Damped period.
    damping_ratio : float
        Of small amplitudes, from p.
    p, q : float
        Decrement of a cycle at zero amplitude, and its growth per unit of amplitude.
    cycles : int
        Number of decrements.
    amplitudes, decrements : ndarray, shape (cycles,)
        Mean amplitude (geometric) and decrement of each.
    """

    period: float
    damping_ratio: float
    p: float
    q: float
    cycles: int
    amplitudes: FloatArray
    decrements: FloatArray


def free_decay(series: FloatArray, dt: float, noise: float = 0.0) -> Decay:
    """Period, p and q of a series that was released; a constant in it does not matter.

    Swings count from the largest on, until one is lost in noise. Extremes are those of parabolas
    through a third of a half period on either side, which shrink all of them alike; what follows
    is weighted by amplitude, as noise matters by its inverse.

    Parameters
    ----------
    series : ndarray, shape (time,)
        From the release on.
    dt : float
        Time step.
    noise : float, optional
        Standard deviation of the noise of its sensor.

    Returns
    -------
    Decay

    Examples
    --------
    >>> t = np.arange(0, 60, 0.05)
    >>> found = free_decay(np.exp(-0.05 * t) * np.cos(t), 0.05)
    >>> round(found.period / (2 * np.pi), 3), round(found.damping_ratio, 3)
    (1.0, 0.05)
    """
    least = max(SMALLEST * np.ptp(series), 2 * NOISE * noise)
    nothing = Decay(np.nan, np.nan, np.nan, np.nan, 0, np.empty(0), np.empty(0))
    places = np.sort(
        np.concatenate([signal.find_peaks(sign * series, prominence=least)[0] for sign in (1, -1)])
    )
    if places.size < 3:
        return nothing
    places = places[np.argmax(np.abs(np.diff(series[places]))) :]  # other modes die out before
    window = 2 * max((places[1] - places[0]) // 3, 1) + 1
    value, slope, bend = (
        signal.savgol_filter(series, window, 2, deriv=order)[places] for order in range(3)
    )
    shift = -np.divide(slope, bend, out=np.zeros_like(bend), where=bend != 0)
    gaps = np.diff(places + shift)
    length = int(np.argmin(np.append(gaps < APART * gaps[0], False)))
    if length < 2:
        return nothing
    gaps, ranges = gaps[:length], 0.5 * np.abs(np.diff(value + 0.5 * slope * shift))[:length]
    decrements = 2 * np.log(ranges[:-1] / ranges[1:])
    amplitudes = np.sqrt(ranges[:-1] * ranges[1:])
    p, q = float(decrements.mean()), np.nan
    if decrements.size >= 3:
        q, p = map(float, np.polyfit(amplitudes, decrements, 1, w=amplitudes))
    period = 2 * dt * float(np.average(gaps, weights=ranges))
    ratio = float(p / np.hypot(2 * np.pi, p))
    return Decay(period, ratio, p, q, decrements.size, amplitudes, decrements)
