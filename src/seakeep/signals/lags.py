"""Lag of one series behind another: over a whole record, and window by window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import fft

from seakeep.arrays import FloatArray, IntArray, as_series, positive
from seakeep.errors import DataError, RequestError

__all__ = ["Lags", "correlation_peak", "parabola_peak", "windowed_lags"]


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
    positive(dt, "the time step", "s")
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
        part, peak = parabola_peak(*coefficient[best - 1 : best + 2])
        shift += part
    return shift - reach, min(peak, 1.0), float(coefficient[reach])


def correlation_peak(
    first: npt.ArrayLike, second: npt.ArrayLike, dt: float, bounds: tuple[float, float]
) -> tuple[float, float]:
    r"""Highest peak of :math:`\mathrm{corr}[a(t), b(t+\Delta t)]` among given lags.

    Parameters
    ----------
    first, second : array_like, shape (time,)
        Two records a and b, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    bounds : (float, float)
        Least and greatest lag, s.

    Returns
    -------
    lag, correlation : float
        Lag of the peak, s, between samples by a parabola through three of them; and its height.
        At each lag the correlation is normalised over the samples that both records have there.

    Raises
    ------
    RequestError
        If the records differ in length, or the bounds reach beyond half of them.
    DataError
        If a record is constant, or the correlation has no peak within the bounds.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 60, 0.05)
    >>> lag, height = correlation_peak(np.sin(3 * t), np.sin(3 * t - 1.0), 0.05, (0.0, 1.0))
    >>> round(lag, 3), round(height, 3)
    (0.333, 1.0)
    """
    a, b = as_pair(first, second)
    step = positive(dt, "the time step", "s")
    low, high = (int(np.floor(bounds[0] / step)), int(np.ceil(bounds[1] / step)))
    if not low < high or max(abs(low), abs(high)) > a.size // 2:
        raise RequestError(
            f"lags from {bounds[0]:g} to {bounds[1]:g} s cannot be sought in records of "
            f"{a.size * step:g} s: give a rising range within half their length."
        )
    lags = np.arange(low - 1, high + 2)
    values = _correlation(a, b, lags)
    inner = values[1:-1]
    peaks = np.flatnonzero((inner >= values[:-2]) & (inner >= values[2:]))
    if not peaks.size:
        raise DataError(
            f"the correlation of the two records has no peak between lags of {bounds[0]:g} and "
            f"{bounds[1]:g} s (highest {inner.max():.2f}, at an end). Check which probe stands "
            "upstream, their positions, and the water depth."
        )
    best = int(peaks[np.argmax(inner[peaks])]) + 1
    shift, height = parabola_peak(*values[best - 1 : best + 2])
    return float((lags[best] + shift) * step), height


def _correlation(a: FloatArray, b: FloatArray, lags: IntArray) -> FloatArray:
    """Correlation of a(t) and b(t + lag) over their common samples."""
    size = fft.next_fast_len(2 * a.size, real=True)

    def summed(x: FloatArray, y: FloatArray) -> FloatArray:
        product = np.conj(fft.rfft(x, size)) * fft.rfft(y, size)
        out: FloatArray = fft.irfft(product, size)[lags]  # negative lags stand at the end
        return out

    one = np.ones(a.size)
    count = a.size - np.abs(lags)
    mean_a, mean_b = summed(a, one) / count, summed(one, b) / count
    power_a = summed(a**2, one) / count - mean_a**2
    power_b = summed(one, b**2) / count - mean_b**2
    covariance = summed(a, b) / count - mean_a * mean_b
    result: FloatArray = covariance / np.sqrt(np.maximum(power_a * power_b, 1e-300))
    return result


def parabola_peak(before: float, here: float, after: float) -> tuple[float, float]:
    """Peak of the parabola through three values: steps from the middle one, and height."""
    bend = before - 2 * here + after
    if not bend < 0:
        return 0.0, float(here)
    shift = 0.5 * (before - after) / bend
    return float(shift), float(here - 0.25 * (before - after) * shift)


def as_pair(first: npt.ArrayLike, second: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    a, b = as_series(first, minimum=8), as_series(second, minimum=8)
    if a.ndim != 1 or a.shape != b.shape:
        raise RequestError(
            f"two records of the same length are needed, shape (time,); received {a.shape} and "
            f"{b.shape}. Cut them to their common time."
        )
    for name, each in (("first", a), ("second", b)):
        if np.ptp(each) == 0:
            raise DataError(
                f"the {name} record is constant ({each[0]:g}), so it correlates with nothing. "
                "Look for a dead probe."
            )
    return a - a.mean(), b - b.mean()
