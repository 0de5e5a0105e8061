"""What a coarser step takes from waves."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from seakeep.signals.filters import as_series, positive
from seakeep.signals.quality import dominant_period

__all__ = ["energy_above"]

WAVES = (0.3, 3.0)
"""Frequencies that count as those of waves, in parts of their peak's: drift lies below, and of a
Pierson-Moskowitz spectrum, whose tail is the highest of the usual ones, 1.5 % of the energy above:
:math:`1 - \\exp(-1.25 / 3^4)`."""


def energy_above(series: npt.ArrayLike, dt: float, edge: float) -> tuple[float, float]:
    """Part of the energy of waves that lies above a frequency.

    Noise and ringing above three times the peak's frequency do not count: to lose them does no
    harm.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled series without gaps.
    dt : float
        Time step, s.
    edge : float
        The frequency, Hz.

    Returns
    -------
    (float, float)
        The part, 0 to 1, and the period of the spectrum's peak, s; NaN where nothing moves or the
        series has fewer than eight samples.

    Raises
    ------
    RequestError
        If the series has gaps, or the step is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 100, 0.05)
    >>> share, period = energy_above(np.sin(2 * np.pi * t) + 0.5 * np.sin(4 * np.pi * t), 0.05, 1.5)
    >>> round(share, 2), round(period, 2)
    (0.2, 1.0)
    """
    x = as_series(series)
    positive("the time step", dt, "s")
    period = dominant_period(x, dt) if np.ptp(x) else float("nan")
    if not np.isfinite(period):
        return float("nan"), float("nan")
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(x.size))) ** 2
    lines = np.fft.rfftfreq(x.size, dt)
    waves = (lines >= WAVES[0] / period) & (lines <= WAVES[1] / period)
    return float(power[waves & (lines > edge)].sum() / power[waves].sum()), period
