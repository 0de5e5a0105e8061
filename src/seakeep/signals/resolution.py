"""Resolution of a sensor: the step in which its readings change, read off a record."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from seakeep.signals.filters import as_series
from seakeep.signals.gaps import stretches

__all__ = ["reading_step"]

FloatArray = npt.NDArray[np.float64]

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

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniformly sampled, as it was recorded: no filter, no other resampling.

    Returns
    -------
    float
        The step, in the unit of the series; NaN where fewer than ten changes out of or into a held
        reading are seen, as in the record of a sensor that resolves its own noise.

    Raises
    ------
    RequestError
        If the series has gaps.

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
