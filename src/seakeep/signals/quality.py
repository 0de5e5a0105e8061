"""Quality of measured series: missing, wrong, frozen and late samples, and their repair.

The checks report; none of them changes a value. Thresholds are stated in units of the
series' own noise, spread or period, not of any one data set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.arrays import BoolArray, FloatArray, as_series, time_step
from seakeep.errors import RequestError
from seakeep.signals.filters import odd_extension
from seakeep.signals.lags import Lags, windowed_lags
from seakeep.signals.time_axis import stretches
from seakeep.signals.waves import tapered_power

__all__ = [
    "Agreement",
    "compare_sensors",
    "dominant_period",
    "energy_above",
    "find_outliers",
    "find_saturation",
    "find_stuck",
    "level_drift",
    "noise_floor",
    "noise_level",
    "reading_step",
]


MISSING, BRIDGED, OUTLIER, SATURATED, STUCK, REPLACED = 1, 2, 4, 8, 16, 32

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

NOISE_BAND = (0.5, 0.75)
"""Part of the Nyquist frequency where the level of the spectrum is that of the noise: above the
waves and their harmonics, below the edge of an anti-alias filter."""

FLAGS = {"missing": MISSING, "bridged": BRIDGED, "outlier": OUTLIER, "saturated": SATURATED,
         "stuck": STUCK, "replaced": REPLACED}  # fmt: skip


def flag_attributes(channel: str) -> dict[str, object]:
    """Attributes of a flag variable, by the CF conventions."""
    return {
        "long_name": f"quality flags of {channel}",
        "flag_masks": tuple(FLAGS.values()),
        "flag_meanings": " ".join(FLAGS),
        "units": "1",
    }


def find_outliers(
    series: npt.ArrayLike, half_width: int = 5, threshold: float = 6.0, least: float = 0.5
) -> BoolArray:
    """Single samples far from those beside them, by Hampel's rule; steps are not outliers.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled, without gaps.
    half_width : int, optional
        Samples on either side that are compared.
    threshold : float, optional
        Distance from the mean of the medians on either side, in standard deviations as the median
        absolute deviation gives them (of such distances nearby, or of the whole record's noise,
        whichever is larger).
    least : float, optional
        Least distance, in standard deviations of the series (by its
        percentiles 1 and 99): what is smaller
        does no harm.

    Returns
    -------
    ndarray of bool
        The outliers.

    Raises
    ------
    DataError
        If the series has gaps or is shorter than a window.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.sin(np.arange(300) / 10)
    >>> x[100] += 1.5
    >>> np.flatnonzero(find_outliers(x))
    array([100])
    """
    x = as_series(series, minimum=2 * half_width + 1)
    width = half_width
    # A point reflection continues slopes, and two sides that are averaged cancel them.
    views = np.lib.stride_tricks.sliding_window_view(odd_extension(x, width), 2 * width + 1)
    left, right = np.median(views[:, :width], axis=1), np.median(views[:, -width:], axis=1)
    middle = 0.5 * (left + right)
    away = np.abs(x - middle)
    # Where a signal sticks and slips, a sample is far from the middle and belongs to one side.
    alone = away - 0.5 * np.abs(left - right) > 0.5 * away
    around = np.pad(away, width, mode="reflect")
    near = np.lib.stride_tricks.sliding_window_view(around, 2 * width + 1)
    spread = 1.4826 * np.median(near, axis=1)
    noise = noise_level(x)
    scale = float(np.subtract(*np.percentile(x, [99, 1]))) / 4.653  # of a normal series, its SD
    found: BoolArray = away > np.maximum(threshold * np.maximum(spread, noise), least * scale)
    return found & alone


def noise_level(series: FloatArray) -> float:
    """Standard deviation of a series' white noise, by the median of its second differences."""
    # Second differences of white noise have six times its variance, and know no slope.
    return 1.4826 * float(np.median(np.abs(np.diff(series, 2)))) / float(np.sqrt(6.0))


def find_saturation(series: npt.ArrayLike, shortest: int = 4) -> BoolArray:
    """Samples at which a sensor stood at the end of its range.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled, without gaps.
    shortest : int, optional
        Equal samples in a row at the highest or lowest value that make a plateau.

    Returns
    -------
    ndarray of bool
        Plateaus that are entered or left with a step larger than the crest of a wave has: three
        times the series' smallest step and a fiftieth of its spread. None where a sensor repeats
        readings at other values more often than at these, as a camera that repeats frames does.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.clip(np.sin(np.arange(600) / 10), -2, 0.8)
    >>> bool(find_saturation(x).sum() == (x == 0.8).sum())
    True
    """
    x = as_series(series)
    out = np.zeros(x.size, dtype=bool)
    jumps = np.abs(np.diff(x))
    if not jumps.any():
        return out
    floor = max(3 * float(jumps[jumps > 0].min()), 0.02 * float(x.std()))
    ends = (x.max(), x.min())
    held = [x[begin] for begin, end in stretches(jumps == 0) if end + 1 - begin >= shortest]
    if 2 * sum(value in ends for value in held) < len(held):
        return out
    for edge in ends:
        for begin, end in stretches(x == edge):
            if end - begin < shortest:
                continue
            left = jumps[max(begin - 2, 0) : begin].sum()
            right = jumps[end - 1 : end + 1].sum()
            if max(left, right) > floor:
                out[begin:end] = True
    return out


def find_stuck(
    series: npt.ArrayLike, dt: float, shortest: float, witness: npt.ArrayLike | None = None
) -> BoolArray:
    """Samples at which a sensor repeats one value although there is motion.

    At the end of a record a tenth of `shortest` is enough, where nowhere else a reading is held for
    a third as long.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled, without gaps.
    dt : float
        Time step, s.
    shortest : float
        Shortest stretch of equal samples that counts, s.
    witness : array_like, shape (time,), optional
        Another sensor of the same motion. With it, a stretch counts if the witness moves by more
        than 0.3 of its own spread; without it, if the series itself moved so just before. A
        vessel that lies still before the waves arrive is not a stuck sensor.

    Returns
    -------
    ndarray of bool
        The samples.

    Raises
    ------
    RequestError
        If the two differ in length.
    DataError
        If a series has gaps.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.sin(np.arange(600) / 10)
    >>> x[:100] = x[100]   # still at first
    >>> x[300:400] = x[300]
    >>> np.flatnonzero(find_stuck(x, 0.1, 5.0))[[0, -1]]
    array([300, 399])
    """
    x = as_series(series)
    count = max(3, round(shortest / time_step(dt)))
    other = None if witness is None else as_series(witness)
    if other is not None and other.shape != x.shape:
        raise RequestError(
            f"the witness has {other.size} samples and the series {x.size}; put both on one axis."
        )
    out = np.zeros(x.size, dtype=bool)
    repeats = [(begin, end + 1) for begin, end in stretches(np.diff(x) == 0)]
    elsewhere = max((last - begin for begin, last in repeats if last < x.size), default=1)
    at_end = max(5, count // 10, 3 * elsewhere + 1)
    for begin, last in repeats:
        if last - begin < (min(count, at_end) if last == x.size else count):
            continue
        if other is not None:
            moving = other[begin:last].std() > 0.3 * other.std()
        else:
            before = x[max(begin - count, 0) : begin]
            moving = before.size > 2 and before.std() > 0.3 * x.std()
        if moving and x.std() > 0:
            out[begin:last] = True
    return out


def level_drift(series: npt.ArrayLike, dt: float, period: float) -> tuple[float, float]:
    """Change of a sensor's level over a record, and how sure it is.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled, without gaps, of a quantity that has no slow motion of its own.
    dt : float
        Time step, s.
    period : float
        Period of the waves, s.

    Returns
    -------
    (float, float)
        End minus start of the straight line through the means of windows of four periods, and
        that change in standard errors of the line.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 200, 0.1)
    >>> change, sure = level_drift(np.sin(4 * t) + 0.005 * t, 0.1, 1.57)
    >>> round(change, 1), bool(sure > 10)
    (1.0, True)
    """
    x = as_series(series)
    length = max(2, round(4 * period / dt))
    windows = x.size // length
    if windows < 4:
        return 0.0, 0.0
    means = x[: windows * length].reshape(windows, length).mean(axis=1)
    line = scipy.stats.linregress(np.arange(windows), means)
    sure = abs(line.slope) / line.stderr if line.stderr > 0 else 0.0
    return float(line.slope * x.size / length), float(sure)


def dominant_period(series: npt.ArrayLike, dt: float) -> float:
    """Period at the peak of a series' spectrum, s (Hann window, three bins smoothed).

    NaN for fewer than eight samples.

    Examples
    --------
    >>> import numpy as np
    >>> round(dominant_period(np.sin(np.arange(0, 100, 0.05) * 2 * np.pi / 1.6), 0.05), 1)
    1.6
    """
    x = as_series(series)
    if x.size < 8:
        return float("nan")
    power = tapered_power(x)
    power = np.convolve(power, [0.25, 0.5, 0.25], mode="same")
    power[:3] = 0.0
    return float(1.0 / np.fft.rfftfreq(x.size, dt)[int(np.argmax(power))])


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
    at_zero : float
        Median correlation without a lag.
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
    at_zero: float
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
    held: npt.ArrayLike | None = None,
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
    held : array_like of bool, shape (time,), optional
        Samples at which the sensor is known to be stuck; a lag of what stands still means nothing.
    step : float, optional
        Step in which the sensor reads, as :func:`seakeep.signals.quality.reading_step` finds it
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
    period = dominant_period(y, dt) if y.std() > 0 else float("nan")
    empty = np.zeros(0)
    gain = float(x.std() / y.std()) if y.std() > 0 else float("nan")
    gain = 0.0 if gain < 1e-6 else gain  # what resampling makes of a constant
    nothing = Agreement(period, float("nan"), step, *(float("nan"),) * 6, gain, empty, empty)
    length = 4 * period if window is None else window
    if gain == 0 or not np.isfinite(gain) or x.size * dt < length + period:
        return nothing
    stuck = np.zeros(x.size, dtype=bool) if held is None else np.asarray(held, dtype=bool)
    found, motion, gain = _windows(x, y, dt, length, period, stuck)
    if not found.lag.size:
        return nothing
    lags = found.lag[_together(found)]
    middle = float(np.median(lags))
    return Agreement(
        period=period,
        motion=motion,
        step=step,
        lag=middle,
        lag_spread=float(1.4826 * np.median(np.abs(lags - middle))),
        growth=_growth(_windows(x, y, dt, 0.5 * length, period, stuck)[0], period),
        correlation=float(np.median(found.correlation)),
        nrmse=_nrmse(x, y, dt, length, found),
        at_zero=float(np.median(found.at_zero)),
        gain=gain,
        centre=found.centre,
        lags=found.lag,
    )


def _nrmse(x: FloatArray, y: FloatArray, dt: float, length: float, found: Lags) -> float:
    """NRMSE between two sensors over the windows that are compared."""
    reach = 0.5 * length
    spans = [(max(round((c - reach) / dt), 0), round((c + reach) / dt)) for c in found.centre]
    error = [np.std(x[begin:end] - y[begin:end]) ** 2 for begin, end in spans]
    motion = [np.std(y[begin:end]) ** 2 for begin, end in spans]
    return float(np.sqrt(np.mean(error) / np.mean(motion)))


def _windows(
    x: FloatArray, y: FloatArray, dt: float, length: float, period: float, stuck: BoolArray
) -> tuple[Lags, float, float]:
    """Lags in windows with enough motion; the trusted SD and the gain in them."""
    found = windowed_lags(x, y, dt, length, 0.5 * period)
    begin = np.clip(((found.centre - 0.5 * length) / dt).astype(int), 0, None)
    end = ((found.centre + 0.5 * length) / dt).astype(int)
    motion, own = (
        np.array([z[i:j].std() for i, j in zip(begin, end, strict=True)]) for z in (y, x)
    )
    free = np.array([not stuck[i : j + 1].any() for i, j in zip(begin, end, strict=True)])
    kept = (motion > 0.3 * motion.max()) & np.isfinite(found.lag)
    kept &= free | ~np.any(kept & free)  # a sensor that sticks all the time is judged all the same
    clear = Lags(found.centre[kept], found.lag[kept], found.correlation[kept], found.at_zero[kept])
    if not kept.any():
        return clear, float("nan"), float("nan")
    mean = float(np.sqrt(np.mean(motion[kept] ** 2)))
    return clear, mean, float(np.median(own[kept] / motion[kept]))


def _together(found: Lags) -> BoolArray:
    """Windows in which the two go together: elsewhere a lag says nothing."""
    alike: BoolArray = found.correlation >= 0.6
    return alike if alike.sum() > 3 else np.ones(alike.size, dtype=bool)


def _growth(found: Lags, period: float) -> float:
    """Lag gained from the first two windows to the last two, s."""
    straight = np.unwrap(found.lag[_together(found)], period=period)
    return float(straight[-2:].mean() - straight[:2].mean()) if straight.size > 3 else 0.0


LEAST_STEPS = 10
"""Steps out of a held value from which a median is taken; a sensor that froze once makes two."""

STRAIGHT, STRAIGHT_SHARE = 1e-7, 0.7
"""Second differences below this part of a record's range are those of a straight line; and the
part of the changes that continue one, from which on a record counts as interpolated."""


def reading_step(series: npt.ArrayLike) -> float:
    """Step in which the readings of a sensor change.

    A sensor that resolves no less than a step repeats a reading until the motion has grown to the
    next one. The step is the median size of the changes out of and into readings that were held.
    A camera's readings that were interpolated to a faster rate are straight between its frames;
    a change then counts from frame to frame.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.sin(np.arange(2000) / 30)
    >>> round(reading_step(0.25 * np.round(x / 0.25)), 9)
    0.25
    """
    x = as_series(series)
    change = np.diff(x)
    if x.size < 3 or not change.any():
        return float("nan")
    frame = _frame(change, STRAIGHT * float(np.ptp(x)))
    steps = []
    for begin, end in stretches(change == 0):  # x[begin] to x[end] are equal
        if end - begin < max(2, frame):
            continue
        steps += [abs(x[begin - frame] - x[begin])] if begin >= frame else []
        steps += [abs(x[end + frame] - x[end])] if end + frame < x.size else []
    return float(np.median(steps)) if len(steps) >= LEAST_STEPS else float("nan")


def _frame(change: FloatArray, tolerance: float) -> int:
    """Samples from one frame to the next; one where a record is not straight between frames."""
    moving = (change[1:] != 0) & (change[:-1] != 0)
    straight = moving & (np.abs(np.diff(change)) <= tolerance)
    if straight.sum() < STRAIGHT_SHARE * np.count_nonzero(change):
        return 1
    # A frame of n samples has n changes of one slope, the first and last of them cut by its ends.
    return int(np.median([end - begin for begin, end in stretches(straight)])) + 2


WAVES = (0.3, 3.0)
"""Frequencies that count as those of waves, in parts of their peak's: drift lies below, and of a
Pierson-Moskowitz spectrum, whose tail is the highest of the usual ones, 1.5 % of the energy above:
:math:`1 - \\exp(-1.25 / 3^4)`."""


def energy_above(series: npt.ArrayLike, dt: float, edge: float) -> tuple[float, float]:
    """Fraction of the energy of waves that lies above a frequency.

    Noise and ringing above three times the peak's frequency do not count: to lose them does no
    harm.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 100, 0.05)
    >>> share, period = energy_above(np.sin(2 * np.pi * t) + 0.5 * np.sin(4 * np.pi * t), 0.05, 1.5)
    >>> round(share, 2), round(period, 2)
    (0.2, 1.0)
    """
    x = as_series(series)
    time_step(dt)
    period = dominant_period(x, dt) if np.ptp(x) else float("nan")
    if not np.isfinite(period):
        return float("nan"), float("nan")
    power = tapered_power(x)
    lines = np.fft.rfftfreq(x.size, dt)
    waves = (lines >= WAVES[0] / period) & (lines <= WAVES[1] / period)
    return float(power[waves & (lines > edge)].sum() / power[waves].sum()), period


def noise_floor(series: npt.ArrayLike) -> float:
    r"""Standard deviation of the noise of a record that is sampled well above its waves.

    The level of the spectrum between one half and three quarters of the Nyquist frequency, taken
    for that of white noise: the median over the lines, which neither a harmonic nor a spur moves,
    over ln 2, since the lines of noise are exponentially distributed.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled; gaps (NaN) are interpolated. A mean and a trend are removed.

    Returns
    -------
    float
        In the unit of the series; 0 of fewer than 64 samples, in which waves leak too far.

    Notes
    -----
    Pulses, as of a slack line that dips into the water, are noise by this measure. What an
    integrated channel has of noise below the band is not seen.

    Examples
    --------
    >>> import numpy as np
    >>> t, rng = np.arange(2000) / 20, np.random.default_rng(0)
    >>> waves = np.sin(2 * np.pi * 0.6 * t)
    >>> round(noise_floor(waves + 0.05 * rng.standard_normal(2000)), 2)
    0.05
    """
    x = np.asarray(series, dtype=float)
    known = np.isfinite(x)
    if known.sum() < 64:
        return 0.0
    at = np.arange(x.size)
    x = scipy.signal.detrend(np.interp(at, at[known], x[known]))
    taper = np.hanning(x.size)
    power = np.abs(np.fft.rfft(x * taper)) ** 2 / np.sum(taper**2)
    low, high = (round(edge * (power.size - 1)) for edge in NOISE_BAND)
    return float(np.sqrt(np.median(power[low:high]) / np.log(2.0)))
