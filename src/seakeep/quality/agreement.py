"""Agreement of a sensor with another one of the same motion: lag, correlation, scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from seakeep.arrays import BoolArray, FloatArray, as_series
from seakeep.signals.lags import Lags, windowed_lags
from seakeep.signals.waves import dominant_period

LEAST_CORRELATION = 0.8
"""At a lower correlation no lag and no scale is given: 36 % of the variance would be the sensor's
own."""

LARGEST_NRMSE = 0.2
"""NRMSE between two sensors of one motion beyond which they disagree: models of the paper reach
errors of 0.1 to 0.3, and none can be better than the sensors that it learns from."""

LATE = float(np.arcsin(LARGEST_NRMSE / 2) / np.pi)
r"""Lag that alone makes that NRMSE, in periods: it is :math:`2 \sin(\pi\tau/T)`; 0.032."""

RUN_AWAY = 0.11
r"""Growth of a lag over a record that alone makes that NRMSE, in periods: over a lag that grows by
g periods about 0 it is :math:`\sqrt{2 - 2 \sin(\pi g)/(\pi g)}`."""

FEWEST_STEPS = 5.0
"""Steps of a sensor that a motion must span from crest to trough: measurement-systems analysis asks
for five distinct categories (AIAG, MSA, 4th edition)."""

LARGEST_GAIN = 2.0
"""Factor between the motions of two sensors beyond which one of them has another unit or
calibration: a correlation of 0.8 leaves room for 1.25 by what the sensor adds of its own, and a
wrong unit makes 10 or more."""


@dataclass(frozen=True)
class Agreement:
    """How a sensor agrees with a trusted one of the same motion.

    Parameters
    ----------
    period : float
        Dominant period of the trusted one, s.
    motion : float
        Standard deviation of the trusted one over the windows compared, in its unit.
    step : float
        Step in which the sensor reads, in the same unit; NaN where it is not known to.
    lag, lag_spread : float
        Median over windows, s, positive where the sensor is late, searched within half a period;
        and 1.4826 times the median absolute deviation. NaN where nothing moves.
    growth : float
        Lag gained from the first two windows to the last two, s; where it jumped by a period it
        is taken to have gone on. These windows are half as long, since a lag that runs away does
        so within a window.
    correlation : float
        Median correlation at the peaks.
    nrmse : float
        RMS of the difference between the two, each less its mean, over the trusted one's standard
        deviation, in the windows with motion.
    gain : float
        Median over windows of the sensor's spread over the trusted one's; over the whole record
        where nothing can be compared.
    centre, lags : ndarray, shape (window,)
        Middle of each window with motion, s, and its lag.
    """

    period: float
    motion: float
    step: float
    lag: float
    lag_spread: float
    growth: float
    correlation: float
    nrmse: float
    gain: float
    centre: FloatArray
    lags: FloatArray

    @property
    def spanned(self) -> float:
        """Steps of the sensor that the motion spans from crest to trough (2√2 of its SD)."""
        known = np.isfinite(self.step) and self.step > 0
        return float(2 * np.sqrt(2) * self.motion / self.step) if known else float("inf")


def compare_sensors(
    series: npt.ArrayLike,
    trusted: npt.ArrayLike,
    dt: float,
    window: float | None = None,
    stuck_samples: npt.ArrayLike | None = None,
    step: float = float("nan"),
) -> Agreement:
    """Compare a sensor with a trusted one of the same motion, window by window.

    Parameters
    ----------
    series, trusted : array_like, shape (time,)
        Uniformly sampled side by side, without gaps.
    dt : float
        Time step, s.
    window : float, optional
        Length of the windows, s; by default four periods.
    stuck_samples : array_like of bool, shape (time,), optional
        Samples at which the sensor is known to be stuck; a lag of what stands still means nothing.
    step : float, optional
        Step in which the sensor reads, as :func:`seakeep.quality.faults.reading_step` finds it
        in the record.

    Returns
    -------
    Agreement
        Windows that hold a stuck sample, and those in which the trusted sensor moves by less than
        0.3 of what it does at most, are left out.

    Raises
    ------
    RequestError
        If the series differ in length.
    DataError
        If a series has gaps.
    """
    x, y = as_series(series), as_series(trusted)
    period = dominant_period(y, dt)
    empty = np.zeros(0)
    gain = float(x.std() / y.std()) if y.std() > 0 else float("nan")
    gain = 0.0 if gain < 1e-6 else gain  # what resampling makes of a constant
    nothing = Agreement(period, float("nan"), step, *(float("nan"),) * 5, gain, empty, empty)
    length = 4 * period if window is None else window
    if gain == 0 or not np.isfinite(gain) or x.size * dt < length + period:
        return nothing
    stuck = (
        np.zeros(x.size, dtype=bool)
        if stuck_samples is None
        else np.asarray(stuck_samples, dtype=bool)
    )
    windows, motion, gain = _windows(x, y, dt, length, period, stuck)
    if not windows.lag.size:
        return nothing
    spans = [
        slice(max(round((c - 0.5 * length) / dt), 0), round((c + 0.5 * length) / dt))
        for c in windows.centre
    ]
    error, moved = ([np.std(z[span]) ** 2 for span in spans] for z in (x - y, y))
    lags = windows.lag[_together(windows)]
    short = _windows(x, y, dt, 0.5 * length, period, stuck)[0]
    straight = np.unwrap(short.lag[_together(short)], period=period)
    middle = float(np.median(lags))
    return Agreement(
        period=period,
        motion=motion,
        step=step,
        lag=middle,
        lag_spread=float(1.4826 * np.median(np.abs(lags - middle))),
        growth=float(straight[-2:].mean() - straight[:2].mean()) if straight.size > 3 else 0.0,
        correlation=float(np.median(windows.correlation)),
        nrmse=float(np.sqrt(np.mean(error) / np.mean(moved))),
        gain=gain,
        centre=windows.centre,
        lags=windows.lag,
    )


def _windows(
    x: FloatArray, y: FloatArray, dt: float, length: float, period: float, stuck: BoolArray
) -> tuple[Lags, float, float]:
    """Lags in windows with enough motion; the trusted SD and the gain in them."""
    lags = windowed_lags(x, y, dt, length, 0.5 * period)
    begin = np.clip(((lags.centre - 0.5 * length) / dt).astype(int), 0, None)
    end = ((lags.centre + 0.5 * length) / dt).astype(int)
    motion, own = (
        np.array([z[i:j].std() for i, j in zip(begin, end, strict=True)]) for z in (y, x)
    )
    free = np.array([not stuck[i : j + 1].any() for i, j in zip(begin, end, strict=True)])
    moving = (motion > 0.3 * motion.max()) & np.isfinite(lags.lag)
    moving &= free | ~np.any(
        moving & free
    )  # a sensor that sticks all the time is judged all the same
    clear = Lags(lags.centre[moving], lags.lag[moving], lags.correlation[moving])
    if not moving.any():
        return clear, float("nan"), float("nan")
    mean = float(np.sqrt(np.mean(motion[moving] ** 2)))
    return clear, mean, float(np.median(own[moving] / motion[moving]))


def _together(lags: Lags) -> BoolArray:
    """Windows in which the two go together: elsewhere a lag says nothing."""
    alike: BoolArray = lags.correlation >= 0.6
    return alike if alike.sum() > 3 else np.ones(alike.size, dtype=bool)
