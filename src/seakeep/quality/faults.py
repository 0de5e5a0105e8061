"""Faults of samples: readings that no motion beside them explains, and readings that repeat.

Both rules judge a fault of one sample and of half a record alike. Thresholds are stated in units
of the series' own spread, steps and period, not of any one data set.
"""

from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.arrays import BoolArray, FloatArray, IntArray, as_series, time_step
from seakeep.signals.filters import odd_extension
from seakeep.signals.time_axis import over_gaps, stretches
from seakeep.signals.waves import dominant_period

FLAGS = {"missing": 1, "bridged": 2, "outlier": 4, "saturated": 8, "stuck": 16, "replaced": 32}
MISSING, BRIDGED, OUTLIER, SATURATED, STUCK, REPLACED = FLAGS.values()

BESIDE = 5
"""Samples on either side whose medians say where a sample should be: they stay right beside a
fault of three samples."""

REACH = 8
"""Samples on either side that are looked at: of the medians of five, the second begins at the
fourth."""

AROUND = 4 * BESIDE
"""Samples on either side whose distances from such medians give the scatter there: a fault of
three spoils nine of the 41."""

ALONE, LEAST, FAR = 6.0, 0.5, 20.0
"""Distances of outliers: from the samples beside them in standard deviations of the scatter, and of
the record, below which they do no harm; and from the record's median, at any length. Impacts on
moored models reach 9 standard deviations."""

ABRUPT = 0.7
"""Part of its distance by which an outlier is entered and left in one step: a crest grows."""

CORNER = 0.2
"""Part of their distance by which readings far from a record's median leave the samples beside them
somewhere: where a fault comes and goes within five samples 0.23, in swings of twenty samples 0.16.
"""

TIMES = 2.0
"""Times longer than the longest run of equal readings expected by chance that a held one is."""

CALM = 0.3
"""Part of a record's mean step, and of its spread, below which all that precedes a run is calm: a
vessel that lies still before the waves arrive is not a stuck sensor. So after the waves."""

WILD, NEAR = 4.6, 4
"""Times the 80th percentile of a record's steps, as three times the 95th of normal ones, that no
wave takes in one; and samples within which two readings that are entered and left so make a burst.
"""

STEEP = 3.0
"""Times the 95th percentile of a record's steps that no wave takes in one."""

AT_REST = 0.1
"""Part of a record's spread below which the motion in the periods beside a run is none: a vessel
comes to rest in small swings."""

RESOLVED = 1.5
"""Steps of a sensor that an amplitude must reach for its stay at a crest to be told from rest."""

LEAST_STEPS = 10
"""Steps out of a held value from which a median is taken; a sensor that froze once makes two."""

STRAIGHT, STRAIGHT_SHARE = 1e-6, 0.7
"""Second differences below this part of a record's spread are those of a straight line; and the
part of the changes that continue one, from which on a record counts as interpolated."""


def flag_attributes(channel: str) -> dict[str, object]:
    """Attributes of a flag variable, by the CF conventions."""
    return {
        "long_name": f"quality flags of {channel}",
        "flag_masks": tuple(FLAGS.values()),
        "flag_meanings": " ".join(FLAGS),
        "units": "1",
    }


def find_outliers(series: npt.ArrayLike) -> BoolArray:
    """Samples far from those beside them, or from all others; steps are not outliers.

    Up to three samples in a row are compared with the medians of five on either side, by Hampel's
    rule: 6 standard deviations of the scatter there, and half of the record's. Samples at any
    length are outliers beyond 20 standard deviations of the record, unless they come and go as
    smoothly as a motion does. That deviation is taken from its percentiles 5 and 95, in which a
    reading counts once, however long it repeats. Nearer ones are outliers where the record turns
    back again and again in steps that no wave takes.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled, without gaps.

    Returns
    -------
    ndarray of bool
        The outliers.

    Raises
    ------
    DataError
        If the series has gaps or fewer than sixteen samples.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.sin(np.arange(300) / 10)
    >>> x[100:103] = -999
    >>> np.flatnonzero(find_outliers(x))
    array([100, 101, 102])
    """
    x = as_series(series, minimum=2 * REACH)
    middle, spread = _spread(x[_starts(x)])
    # A point reflection continues slopes, and two sides that are averaged cancel them.
    views = np.lib.stride_tricks.sliding_window_view(odd_extension(x, REACH), BESIDE)
    medians = np.median(views, axis=1)
    # Medians at three and at six samples, so weighted, cancel the curvature of a wave.
    left = (4 * medians[REACH - BESIDE :][: x.size] - medians[: x.size]) / 3
    right = (4 * medians[REACH + 1 :][: x.size] - medians[REACH + 4 :][: x.size]) / 3
    away = np.abs(x - 0.5 * (left + right))
    # Second differences of white noise have six times its variance, and know no slope.
    noise = 1.4826 * np.median(np.abs(np.diff(x, 2))) / np.sqrt(6.0)
    # Where a signal sticks and slips, a sample is far from the middle and belongs to one side.
    outliers = (away > max(ALONE * noise, LEAST * spread)) & (away > np.abs(left - right))
    jumps = np.abs(np.diff(x, prepend=np.inf, append=np.inf))
    for begin, end in stretches(outliers):
        near = np.median(away[max(begin - AROUND, 0) : end + AROUND])
        apart = min(jumps[begin] / away[begin], jumps[end] / away[end - 1])
        outliers[begin:end] = away[begin:end].max() > ALONE * 1.4826 * near and apart > ABRUPT
    distance = np.abs(x - middle)
    far = (distance > FAR * spread) & (spread > 0)
    for begin, end in stretches(far):  # a model that is let go comes back in swings
        corner = away[max(begin - 2, 0) : end + 2].max()
        far[begin:end] = corner > CORNER * distance[begin:end].max()
    return outliers | _bursts(x) | far


def _bursts(x: FloatArray) -> BoolArray:
    """Samples between readings that are entered and left in opposite steps that no wave takes."""
    steps, out = np.diff(x), np.zeros(x.size, bool)
    if not steps.any():
        return out
    wild = np.abs(steps) > WILD * np.percentile(np.abs(steps[steps != 0]), 80)
    turns = 1 + np.flatnonzero(wild[1:] & wild[:-1] & (steps[1:] * steps[:-1] < 0))
    for begin, end in pairwise(turns):
        out[begin : end + 1] |= end - begin <= NEAR
    return out


def _starts(x: FloatArray) -> IntArray:
    """First sample of each run of equal readings."""
    return np.flatnonzero(np.append(True, np.diff(x) != 0))


def _spread(x: FloatArray) -> tuple[float, float]:
    """Median, and standard deviation by percentiles that one sample in twenty does not move."""
    low, middle, high = np.percentile(x, [5, 50, 95])
    return middle, (high - low) / 3.29  # of a normal series


MEMORY = 4
"""Samples before one from which it is told what has memory; a wave needs two of them."""


def noise_share(series: FloatArray) -> float:
    """Part of a series' variance that the samples before do not predict.

    The residual of the best linear prediction from the last four samples: one for white noise and
    for random readings of whatever size, and little for a wave. Readings that alternate, as those
    of a wave of three samples or fewer would, have no memory either.

    Examples
    --------
    >>> import numpy as np
    >>> round(noise_share(np.sin(2 * np.pi * np.arange(320) / 5)), 2)
    0.01
    >>> round(noise_share(np.random.default_rng(0).normal(size=4000)), 1)
    1.0
    """
    n = series.size
    if n < 2:
        return 0.0
    x = series - series.mean()
    power = np.array([x[lag:] @ x[: n - lag] for lag in range(min(MEMORY, n - 1) + 1)])
    if power[0] <= 0:
        return 0.0
    if power[1] < -0.5 * power[0]:
        return 1.0
    power[0] *= 1 + 1e-9  # the matrix of a noiseless wave is singular
    weights = scipy.linalg.solve_toeplitz(power[:-1], power[1:])
    return float(np.clip(1.0 - weights @ power[1:] / power[0], 0.0, 1.0))


def find_held(series: npt.ArrayLike, dt: float, witness: npt.ArrayLike | None = None) -> BoolArray:
    r"""Samples at which a sensor repeats one reading for longer than motion and resolution explain.

    A run of equal readings is held if it is longer than twice the longest one expected by chance,
    from how often readings repeat in this record, and than twice the stay of a wave of the motion
    beside it within one step q of the sensor, :math:`2 \arccos(1 - q/a) / \omega`; nothing stays
    after a step that no wave takes.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled, without gaps.
    dt : float
        Time step, s.
    witness : array_like, shape (time,), optional
        Another sensor of the same motion. With it, a run counts if it lasts a dominant period and
        the witness moves by more than 0.3 of its own spread; without it, if there was motion
        before and after it, and beside it. A vessel that lies still before the waves arrive, and
        after they are gone, is not a stuck sensor.

    Returns
    -------
    ndarray of bool
        The samples.

    Raises
    ------
    DataError
        If a series has gaps.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.sin(np.arange(600) / 10)
    >>> x[:100] = x[100]   # still at first
    >>> x[300:400] = x[300]
    >>> np.flatnonzero(find_held(x, 0.1))[[0, -1]]
    array([300, 399])
    """
    x = as_series(series)
    step = time_step(dt)
    other = None if witness is None else as_series(witness)
    out = np.zeros(x.size, bool)
    starts = _starts(x)
    if starts.size < 2:
        return out
    lengths = np.diff(np.append(starts, x.size))
    # Of n runs whose length goes on with probability p, the longest is of log n / log(1/p) (Erdős
    # and Rényi). Where all readings repeat, as the frames of a slow camera do, they count as one.
    frame = max(np.sort(lengths)[(lengths.size - 1) // 4], _frame(x))
    goes_on = max(np.mean(lengths >= 2 * frame), 1 / lengths.size)
    expected = frame * (1 + TIMES * np.log(lengths.size) / np.log(1 / goes_on))
    long = lengths > expected
    free = np.repeat(~long, lengths)
    if free.sum() < 2:
        return out
    period = dominant_period(over_gaps(x, free), step) / step
    period = period if np.isfinite(period) else 1.0
    for begin, length in zip(starts[long], lengths[long], strict=True):
        end = begin + length
        if other is None:
            out[begin:end] = length > expected + TIMES * _stay(x, starts, begin, end, period)
        else:
            out[begin:end] = length >= period and other[begin:end].std() > CALM * other.std()
    return out


def _stay(x: FloatArray, starts: IntArray, begin: int, end: int, period: float) -> float:
    """Samples for which the motion beside a run of equal readings may stay within one reading."""
    spread, changes = _spread(x[starts])[1], np.abs(np.diff(x[starts]))
    smallest, largest = changes.min(), STEEP * np.percentile(changes, 95)
    path = np.abs(np.diff(x))
    if path[max(begin - 1, 0) : begin].sum() > largest or path[end - 1 : end].sum() > largest:
        return 0.0
    path, beside = np.minimum(path, largest), max(2, round(period))
    step = path.sum() / np.count_nonzero(path)

    def calm(steps: FloatArray, values: FloatArray) -> bool:
        if not steps.size or steps.mean() < CALM * step:
            return True
        return values.size > beside and values.std() < CALM * spread

    gone = calm(path[end - 1 :], x[end:])
    before = x[max(begin - beside, 0) : begin + 1].std()
    motion = before if gone else max(before, x[end - 1 : end + beside].std())
    amplitude = np.sqrt(2) * motion
    if (
        calm(path[:begin], x[:begin])
        or motion < AT_REST * spread
        or amplitude < RESOLVED * smallest
    ):
        return np.inf
    wave = min(period, 4 * np.sqrt(2) * spread / step)
    return wave / np.pi * np.arccos(max(1 - smallest / amplitude, -1.0))


def saturated(series: FloatArray, stuck: BoolArray) -> BoolArray:
    """Held samples at the end of the sensor's range: at the highest or lowest reading, repeatedly.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.clip(np.sin(np.arange(600) / 10), -2, 0.8)
    >>> bool(saturated(x, find_held(x, 0.1)).sum() == (x == 0.8).sum())
    True
    """
    out = np.zeros(series.size, bool)
    for edge in (series.max(), series.min()):
        plateaus = stuck & (series == edge)
        if len(stretches(plateaus)) > 1:
            out |= plateaus
    return out


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
    frame = _frame(x)
    steps = []
    for begin, end in stretches(change == 0):  # x[begin] to x[end] are equal
        if end - begin >= max(2, frame):
            beside = (begin - frame, end + frame)
            steps += [abs(x[at] - x[begin]) for at in beside if 0 <= at < x.size]
    return float(np.median(steps)) if len(steps) >= LEAST_STEPS else np.nan


def _frame(x: FloatArray) -> int:
    """Samples from one frame to the next; one where a record is not straight between frames."""
    change = np.diff(x)
    moving = (change[1:] != 0) & (change[:-1] != 0)
    straight = moving & (np.abs(np.diff(change)) <= STRAIGHT * _spread(x[_starts(x)])[1])
    if straight.sum() < STRAIGHT_SHARE * np.count_nonzero(change) or not straight.any():
        return 1
    # A frame of n samples has n changes of one slope, the first and last of them cut by its ends.
    return int(np.median([end - begin for begin, end in stretches(straight)])) + 2
