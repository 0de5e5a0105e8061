r"""Free decay: period and damping from successive extremes, and how damping grows with amplitude.

With :math:`a_k` half the distance between successive extremes, the decrement of a cycle is
:math:`\delta_k = 2 \ln(a_k / a_{k+1}) = p + q\,\bar a_k`: p is linear damping,
:math:`\zeta = p / \sqrt{4\pi^2 + p^2}`, and q quadratic (Himeno, 1981; ITTC 7.5-02-07-04.5).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import signal

from seakeep.arrays import FloatArray

SMALLEST = 0.02
"""Part of the largest half range below which an extreme counts as noise."""


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


def free_decay(series: FloatArray, dt: float) -> Decay:
    """Period, p and q of a series that was released; a constant in it does not matter.

    Parameters
    ----------
    series : ndarray, shape (time,)
        From the release on.
    dt : float
        Time step.

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
    instants, values = _extremes(series)
    ranges = 0.5 * np.abs(np.diff(values))
    nothing = Decay(np.nan, np.nan, np.nan, np.nan, 0, np.empty(0), np.empty(0))
    if ranges.size < 2:
        return nothing
    first = int(np.argmax(ranges))  # other modes die out before
    instants, ranges = instants[first:], ranges[first:]
    above = ranges >= SMALLEST * ranges.max()
    length = int(np.argmin(np.append(above, False)))
    ranges = ranges[:length]
    if length < 2:
        return nothing
    decrements = 2 * np.log(ranges[:-1] / ranges[1:])
    amplitudes = np.sqrt(ranges[:-1] * ranges[1:])
    p, q = float(decrements.mean()), np.nan
    if decrements.size >= 3:
        q, p = map(float, np.polyfit(amplitudes, decrements, 1))
    period = 2 * dt * float(np.diff(instants[: length + 1]).mean())
    ratio = float(p / np.hypot(2 * np.pi, p))
    return Decay(period, ratio, p, q, decrements.size, amplitudes, decrements)


def _extremes(series: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Instants (samples) and values of extremes, maxima and minima in turn, between samples."""
    least = SMALLEST * np.ptp(series)
    places = np.sort(
        np.concatenate([signal.find_peaks(sign * series, prominence=least)[0] for sign in (1, -1)])
    )
    before, here, after = series[places - 1], series[places], series[places + 1]
    bend = before - 2 * here + after
    shift = np.divide(0.5 * (before - after), bend, out=np.zeros_like(here), where=bend != 0)
    values: FloatArray = here - 0.25 * (before - after) * shift
    instants: FloatArray = places + shift
    return instants, values
