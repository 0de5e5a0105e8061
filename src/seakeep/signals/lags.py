"""Lag of one series behind another: over a whole record, and window by window."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import scipy

from seakeep.arrays import ArrayLike, FloatArray, IntArray, as_pair, positive, ratio, time_step
from seakeep.errors import DataError, RequestError
from seakeep.signals.time_axis import record, usual_step


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
    """

    centre: FloatArray
    lag: FloatArray
    correlation: FloatArray


def windowed_lags(
    series: ArrayLike,
    reference: ArrayLike,
    dt: float,
    window: float,
    largest_lag: float,
) -> Lags:
    """Lag of a series behind a reference in windows that share a half, by cross-correlation.

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

    Returns
    -------
    Lags
        One value per window.

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
    (a, b), step = as_pair(series, reference), time_step(dt)
    length = round(window / step)
    reach = math.ceil(positive(largest_lag, "largest_lag", "s") / step)
    if length < 4 or a.size < length + 2 * reach:
        raise RequestError(
            f"the record lasts {a.size * step:g} s ({a.size} samples), too short for windows of "
            f"{window:g} s and lags of ±{largest_lag:g} s. Shorten them, in seconds, or sample at "
            "a higher rate."
        )
    starts = np.arange(reach, a.size - length - reach + 1, round(0.5 * length))
    rows = [_peak(a[s - reach : s + length + reach], b[s : s + length], reach) for s in starts]
    lag, peak = np.array(rows).T
    centre = step * (starts + 0.5 * (length - 1)).astype(float)
    return Lags(centre, lag * step, peak)


def _peak(stretch: FloatArray, reference: FloatArray, reach: int) -> tuple[float, float]:
    """Lag in samples, and correlation there."""
    length = reference.size
    views = np.lib.stride_tricks.sliding_window_view(stretch, length)
    centred = reference - reference.mean()
    power = views.std(axis=1) * np.sqrt(length) * np.sqrt(centred @ centred)
    coefficient = ratio(views @ centred, power)
    if not np.isfinite(coefficient).any():
        return np.nan, np.nan
    best = int(np.nanargmax(coefficient))
    shift, peak = float(best), float(coefficient[best])
    if 0 < best < coefficient.size - 1:
        shift, peak = parabola_peak(coefficient, best)
    return shift - reach, min(peak, 1.0)


def correlation_peak(
    first: ArrayLike, second: ArrayLike, dt: float, bounds: tuple[float, float]
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
    a, b = (each - each.mean() for each in as_pair(first, second, minimum=8, moving=True))
    step = time_step(dt)
    low, high = np.floor(bounds[0] / step), np.ceil(bounds[1] / step)
    if not low < high or max(abs(low), abs(high)) > a.size // 2:
        raise RequestError(
            f"lags from {bounds[0]:g} to {bounds[1]:g} s cannot be sought in records of "
            f"{a.size * step:g} s: give a rising range within half their length."
        )
    lags = np.arange(int(low) - 1, int(high) + 2)
    values = _correlation(a, b, lags)
    peaks = scipy.signal.find_peaks(values)[0]
    if not peaks.size:
        raise DataError(
            f"the correlation of the two records has no peak between lags of {bounds[0]:g} and "
            f"{bounds[1]:g} s (highest {values[1:-1].max():.2f}, at an end). Check which probe "
            "stands upstream, their positions, and the water depth."
        )
    place, height = parabola_peak(values, peaks[np.argmax(values[peaks])])
    return float((lags[0] + place) * step), height


def _correlation(a: FloatArray, b: FloatArray, lags: IntArray) -> FloatArray:
    """Correlation of a(t) and b(t + lag) over their common samples."""

    def summed(x: FloatArray, y: FloatArray) -> FloatArray:
        return scipy.signal.correlate(y, x, method="fft")[a.size - 1 + lags]

    one = np.ones(a.size)
    count = a.size - np.abs(lags)
    mean_a, mean_b = summed(a, one) / count, summed(one, b) / count
    power_a = summed(a**2, one) / count - mean_a**2
    power_b = summed(one, b**2) / count - mean_b**2
    covariance = summed(a, b) / count - mean_a * mean_b
    return covariance / np.sqrt(np.maximum(power_a * power_b, 1e-300))


def parabola_peak(values: FloatArray, at: int | None = None) -> tuple[float, float]:
    """Place, counted in steps, and height of a peak, by the parabola through three values.

    The peak is the one `at` a place, by default the highest; at most half a step beside it.
    """
    at = int(np.clip(np.argmax(values) if at is None else at, 1, values.size - 2))
    before, here, after = values[at - 1 : at + 2]
    bend = before - 2 * here + after
    if not bend < 0:
        return float(at), float(here)
    shift = float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))
    return at + shift, float(here - 0.25 * (before - after) * shift)


SHORTEST = 16
"""Samples in common below which a correlation says nothing."""
LONGEST = 10.0
"""Lag searched by default, s: clocks set by hand, or recordings started by hand."""
FINEST = 0.01
"""Difference, in SD of the motion, below which two sensors are taken to agree."""


@dataclass(frozen=True)
class MotionAgreement:
    """Agreement of one record of a motion with another.

    Parameters
    ----------
    correlation : float
        Greatest correlation, at `lag`.
    lag : float
        s by which the first record is late behind the second; sub-sample.
    rms : float
        Root mean square of the difference at `lag`, means removed.
    offset : float
        Mean of the first record less that of the second.
    samples : int
        Samples compared.
    at_limit : bool
        Whether `lag` is the longest searched, so that the true one may be longer.
    max_lag : float
        Longest lag searched, s.
    period : float
        Mean zero-crossing period of the motion, s.
    rival_lag : float
        Lag of the next highest peak of the correlation, s, commonly a wave period off; NaN where
        the lags searched hold no other.
    rival_correlation : float
        Correlation there; NaN likewise.
    """

    correlation: float
    lag: float
    rms: float
    offset: float
    samples: int
    at_limit: bool
    max_lag: float
    period: float
    rival_lag: float
    rival_correlation: float

    @property
    def enclosed(self) -> bool:
        """Whether lags one wave period off `lag` were searched too, on either side."""
        return abs(self.lag) + self.period <= self.max_lag

    @property
    def ambiguous(self) -> bool:
        """Whether at `rival_lag` the difference is less than twice that at `lag`."""
        # Mean square difference of two series of SD 1.
        misfit, rival = 2.0 * (1.0 - self.correlation), 2.0 * (1.0 - self.rival_correlation)
        return rival < 4.0 * max(misfit, FINEST**2)


def compare_motion(
    series: ArrayLike,
    time: ArrayLike,
    reference: ArrayLike,
    reference_time: ArrayLike,
    max_lag: float | None = None,
) -> MotionAgreement:
    """Compare a motion tracked in a video with that of a motion reference unit.

    Parameters
    ----------
    series, time : array_like, shape (time,)
        The motion and its instants, s; samples that are NaN are left out.
    reference, reference_time : array_like, shape (time,)
        The same of the reference, in the same unit; interpolated by cubics, so its step should
        resolve the motion.
    max_lag : float, optional
        Longest lag searched, s; by default 10 s, or a quarter of the shorter record. In regular
        waves a lag is known only up to a whole period: see `MotionAgreement.ambiguous`.

    Returns
    -------
    MotionAgreement

    Raises
    ------
    DataError
        If the records have too few samples in common, or one is constant.

    Examples
    --------
    >>> t = np.arange(0, 30, 0.02)
    >>> found = compare_motion(np.sin(4 * (t - 0.1)), t, np.sin(4 * t), t, max_lag=0.5)
    >>> round(found.lag, 3), round(found.correlation, 3)
    (0.1, 1.0)
    """
    (y1, t1), (y2, t2) = (
        (y[np.isfinite(y)], t[np.isfinite(y)])
        for y, t in (
            record(series, time, "the video"),
            record(reference, reference_time, "the reference"),
        )
    )
    reach = min(LONGEST, 0.25 * min(np.ptp(t1), np.ptp(t2)))
    if max_lag is not None:
        reach = positive(max_lag, "max_lag", "s")
    # Only instants whose partner lies inside the other record at every lag searched.
    common = (t1 >= t2[0] + reach) & (t1 <= t2[-1] - reach)
    t1, y1 = t1[common], y1[common]
    if t1.size < SHORTEST:
        raise DataError(
            f"the records have {t1.size} samples in common once lags of up to {reach:g} s are "
            f"allowed for, fewer than {SHORTEST}. Bring them onto one clock, or search shorter "
            "lags."
        )
    for name, each in (("series", y1), ("reference", y2)):
        if np.ptp(each) == 0:
            raise DataError(f"the {name} is constant: nothing to compare. Check the sensor.")
    spline = scipy.interpolate.CubicSpline(t2, y2)

    def correlation(lag: float) -> float:
        return float(np.corrcoef(y1, spline(t1 - lag))[0, 1])

    step = min(usual_step(t1), usual_step(t2))
    lags = np.linspace(-reach, reach, 2 * math.ceil(reach / step) + 1)
    values = np.array([correlation(lag) for lag in lags])
    best = int(np.argmax(values))
    lag, at_limit = float(lags[best]), best in (0, lags.size - 1)
    if not at_limit:
        lag = scipy.optimize.fminbound(
            lambda shift: -correlation(shift), lags[best - 1], lags[best + 1], xtol=1e-4 * step
        )
    peaks = scipy.signal.find_peaks(values)[0]
    rivals = [(values[at], lags[at]) for at in peaks if abs(at - best) > 1]
    rival, rival_lag = max(rivals, default=(np.nan, np.nan))
    crossings = np.count_nonzero(np.diff(y1 > np.mean(y1)))
    difference = y1 - spline(t1 - lag)
    return MotionAgreement(
        correlation=correlation(lag),
        lag=float(lag),
        rms=float(np.std(difference)),
        offset=float(np.mean(difference)),
        samples=t1.size,
        at_limit=at_limit,
        max_lag=reach,
        period=float(2.0 * np.ptp(t1) / max(crossings, 1)),
        rival_lag=rival_lag,
        rival_correlation=rival,
    )
