"""Wave statistics of measured series."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from seakeep.errors import DataError
from seakeep.signals.filters import as_series, positive

__all__ = ["encounter_period", "zero_up_crossings"]

FloatArray = npt.NDArray[np.float64]


def zero_up_crossings(series: npt.ArrayLike, dt: float) -> FloatArray:
    """Instants at which a series, less its mean, crosses zero upwards.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled series without gaps.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray
        Instants after the first sample, s, by linear interpolation.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 10, 0.01)
    >>> [round(float(c), 2) for c in zero_up_crossings(-np.cos(2 * np.pi * t / 4), 0.01)]
    [1.0, 5.0, 9.0]
    """
    x = as_series(series)
    x = x - x.mean()
    before = np.flatnonzero((x[:-1] < 0) & (x[1:] >= 0))
    crossings: FloatArray = (before - x[before] / (x[before + 1] - x[before])) * positive(
        "the time step", dt, "s"
    )
    return crossings


def encounter_period(series: npt.ArrayLike, dt: float) -> float:
    r"""Mean zero-up-crossing period of a wave record.

    Parameters
    ----------
    series : array_like, shape (time,)
        Wave elevation, uniformly sampled, without gaps.
    dt : float
        Time step, s.

    Returns
    -------
    float
        Mean time between successive zero-up-crossings, s.

    Raises
    ------
    DataError
        If the record crosses zero upwards fewer than twice.

    Notes
    -----
    The paper's equation for :math:`\hat T` prints :math:`N_{zup} / \mathcal T`, which is a
    frequency; its value of 1.64 s is the inverse. Time is counted from the first to the last
    crossing, so that the parts of waves at either end do not bias the mean.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 60, 0.02)
    >>> round(encounter_period(np.sin(2 * np.pi * t / 1.64), 0.02), 3)
    1.64
    """
    crossings = zero_up_crossings(series, dt)
    if crossings.size < 2:
        raise DataError(
            f"the record of {np.size(series) * dt:g} s crosses its mean upwards {crossings.size} "
            "time(s); at least two crossings are needed for a period. Give a longer record, or "
            "state encounter_period in the campaign."
        )
    return float((crossings[-1] - crossings[0]) / (crossings.size - 1))
