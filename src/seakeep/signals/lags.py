"""Lag of one series behind another, window by window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from seakeep.errors import RequestError
from seakeep.signals.filters import as_series, positive

__all__ = ["Lags", "windowed_lags"]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Lags:
    """Lags of a series behind a reference.

    Parameters
    ----------
    centre : ndarray, shape (window,)
        Middle of each window, s from the first sample.
    lag : ndarray, shape (window,)
        s, positive where the series is late; NaN where a window holds no motion.
    correlation : ndarray, shape (window,)
        Correlation coefficient at the peak; NaN where there is no motion.
    at_zero : ndarray, shape (window,)
        Correlation coefficient without a lag.
    """

    centre: FloatArray
    lag: FloatArray
    correlation: FloatArray
    at_zero: FloatArray


def windowed_lags(
    series: npt.ArrayLike,
    reference: npt.ArrayLike,
    dt: float,
    window: float,
    largest_lag: float,
    overlap: float = 0.5,
) -> Lags:
    """Lag of a series behind a reference in windows, by bounded cross-correlation.

    The coefficient is that of the two stretches compared, each less its mean, so that the ends
    of a window do not pull the peak towards zero lag; a parabola places the peak between samples.

    Parameters
    ----------
    series, reference : array_like, shape (time,)
        Uniformly sampled side by side, without gaps.
    dt : float
        Time step, s.
    window : float
        Length of a window, s.
    largest_lag : float
        Lags searched on either side, s.
    overlap : float, optional
        Part of a window that the next one shares.

    Returns
    -------
    Lags
        One value a window.

    Raises
    ------
    RequestError
        If the series differ in length, or are shorter than a window and two lags.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 60, 0.05)
    >>> late = windowed_lags(np.sin(4 * (t - 0.123)), np.sin(4 * t), 0.05, 10.0, 0.5)
    >>> bool(np.all(np.abs(late.lag - 0.123) < 1e-3))
    True
    """
    a, b = as_series(series), as_series(reference)
    positive("the time step", dt, "s")
    if a.shape != b.shape or a.ndim != 1:
        raise RequestError(
            f"the two series must be one channel each, of one length; received shapes {a.shape} "
            f"and {b.shape}."
        )
    reach = int(np.ceil(largest_lag / dt))
    length = round(window / dt)
    if length < 4 or a.size < length + 2 * reach:
        raise RequestError(
            f"{a.size} samples are too few for windows of {length} and lags of ±{reach} samples. "
            "Shorten the window or the largest lag."
        )
    hop = max(1, round(length * (1.0 - overlap)))
    starts = np.arange(reach, a.size - length - reach + 1, hop)
    rows = [_peak(a[s - reach : s + length + reach], b[s : s + length], reach) for s in starts]
    lag, peak, zero = np.array(rows, dtype=float).T
    centre = (starts + 0.5 * (length - 1)) * float(dt)
    return Lags(centre.astype(float), lag * float(dt), peak, zero)


def _peak(stretch: FloatArray, reference: FloatArray, reach: int) -> tuple[float, float, float]:
    """Lag in samples, correlation there and correlation at zero."""
    length = reference.size
    views = np.lib.stride_tricks.sliding_window_view(stretch, length)
    centred = reference - reference.mean()
    scale = float(np.sqrt(centred @ centred))
    spread = views.std(axis=1) * np.sqrt(length)
    moving = (spread > 0) & (scale > 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        coefficient = np.where(moving, (views @ centred) / (spread * scale), np.nan)
    if not np.isfinite(coefficient).any():
        return (np.nan, np.nan, np.nan)
    best = int(np.nanargmax(coefficient))
    shift, peak = float(best), float(coefficient[best])
    if 0 < best < coefficient.size - 1:
        left, right = coefficient[best - 1], coefficient[best + 1]
        bend = left - 2 * peak + right
        if np.isfinite(bend) and bend < 0:
            part = 0.5 * (left - right) / bend
            shift, peak = shift + part, peak - 0.25 * (left - right) * part
    return shift - reach, min(peak, 1.0), float(coefficient[reach])
