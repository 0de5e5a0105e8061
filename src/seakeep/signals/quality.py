"""Quality of measured series: what is missing, wrong, frozen, late, and what was done about it.

The checks look and tell; none of them changes a value. Thresholds are stated in units of the
series' own noise, spread or period, not of any one data set.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import stats

from seakeep.errors import RequestError
from seakeep.signals.filters import as_series, odd_extension, positive
from seakeep.signals.gaps import stretches
from seakeep.signals.lags import windowed_lags

__all__ = [
    "Agreement",
    "compare_sensors",
    "dominant_period",
    "find_outliers",
    "find_saturation",
    "find_stuck",
    "level_drift",
]

FloatArray = npt.NDArray[np.float64]
BoolArray = npt.NDArray[np.bool_]

MISSING, BRIDGED, OUTLIER, SATURATED, STUCK, REPLACED = 1, 2, 4, 8, 16, 32
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
    """Single samples far from those beside them, by Hampel's rule.

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
    RequestError
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
    middle = 0.5 * (np.median(views[:, :width], axis=1) + np.median(views[:, -width:], axis=1))
    away = np.abs(x - middle)
    around = np.pad(away, width, mode="reflect")
    near = np.lib.stride_tricks.sliding_window_view(around, 2 * width + 1)
    spread = 1.4826 * np.median(near, axis=1)
    # Second differences of white noise have six times its variance, and know no slope.
    noise = 1.4826 * float(np.median(np.abs(np.diff(x, 2)))) / np.sqrt(6.0)
    scale = float(np.subtract(*np.percentile(x, [99, 1]))) / 4.653  # of a normal series, its SD
    found: BoolArray = away > np.maximum(threshold * np.maximum(spread, noise), least * scale)
    return found


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
        times the series' smallest step and a fiftieth of its spread.

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
    for edge in (x.max(), x.min()):
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
        If a series has gaps, or the two differ in length.

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
    count = max(3, round(shortest / positive("the time step", dt, "s")))
    other = None if witness is None else as_series(witness)
    if other is not None and other.shape != x.shape:
        raise RequestError(
            f"the witness has {other.size} samples and the series {x.size}; put both on one axis."
        )
    out = np.zeros(x.size, dtype=bool)
    for begin, end in stretches(np.diff(x) == 0):
        last = end + 1
        if last - begin < count:
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
        End minus begin of the straight line through the means of windows of four periods, and
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
    line = stats.linregress(np.arange(windows), means)
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
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(x.size))) ** 2
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
    lag, lag_spread : float
        Median over windows, s, positive where the sensor is late, searched within half a period;
        and 1.4826 times the median absolute deviation. NaN where nothing moves.
    growth : float
        Lag gained from the first two windows to the last two, s; where it jumped by a period it
        is taken to have gone on.
    correlation : float
        Median correlation at the peaks.
    at_zero : float
        Median correlation without a lag.
    gain : float
        Spread over the trusted one's.
    centre, lags : ndarray, shape (window,)
        Middle of each window with motion, s, and its lag.
    """

    period: float
    lag: float
    lag_spread: float
    growth: float
    correlation: float
    at_zero: float
    gain: float
    centre: FloatArray
    lags: FloatArray

    def faults(self) -> list[str]:
        """What speaks against the sensor, in words; empty if nothing does.

        An eighth of a period of lag is 45° of phase, a quarter of growth 90°; a correlation of
        0.8 leaves 36 % of the variance unexplained.
        """
        if not np.isfinite(self.correlation):
            return ["constant while the other sensor moves" if self.gain == 0 else "no motion seen"]
        out = []
        if self.correlation < 0.8:
            out.append(f"agrees poorly (correlation {self.correlation:.2f} at its best lag)")
        elif abs(self.growth) > self.period / 4:
            out.append(f"lag runs away by {self.growth:+.2f} s over the record")
        elif abs(self.lag) > self.period / 8:
            out.append(f"lag {self.lag:+.2f} ± {self.lag_spread:.2f} s")
        return out


def compare_sensors(
    series: npt.ArrayLike, trusted: npt.ArrayLike, dt: float, window: float | None = None
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

    Returns
    -------
    Agreement
        Windows in which the trusted sensor moves by less than 0.3 of what it does at most are
        left out.

    Raises
    ------
    RequestError
        If the series have gaps or differ in length.
    """
    x, y = as_series(series), as_series(trusted)
    period = dominant_period(y, dt) if y.std() > 0 else float("nan")
    empty = np.zeros(0)
    gain = float(x.std() / y.std()) if y.std() > 0 else float("nan")
    gain = 0.0 if gain < 1e-6 else gain  # what resampling makes of a constant
    nothing = Agreement(period, *(float("nan"),) * 5, gain, empty, empty)
    length = 4 * period if window is None else window
    if gain == 0 or not np.isfinite(gain) or x.size * dt < length + period:
        return nothing
    found = windowed_lags(x, y, dt, length, 0.5 * period)
    half = 0.5 * length
    begin = np.clip(((found.centre - half) / dt).astype(int), 0, None)
    end = ((found.centre + half) / dt).astype(int)
    motion = np.array([y[i:j].std() for i, j in zip(begin, end, strict=True)])
    kept = (motion > 0.3 * motion.max()) & np.isfinite(found.lag)
    if not kept.any():
        return nothing
    centre, lags, peak = found.centre[kept], found.lag[kept], found.correlation[kept]
    # Where the two do not go together, a lag says nothing.
    together = peak >= 0.6 if (peak >= 0.6).sum() > 3 else np.ones(peak.size, dtype=bool)
    straight = np.unwrap(lags[together], period=period)
    growth = 0.0
    if straight.size > 3:
        growth = float(straight[-2:].mean() - straight[:2].mean())
    middle = float(np.median(lags[together]))
    return Agreement(
        period, middle, float(1.4826 * np.median(np.abs(lags[together] - middle))), growth,
        float(np.median(peak)), float(np.median(found.at_zero[kept])), gain, centre, lags,
    )  # fmt: skip
