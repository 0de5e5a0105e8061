"""How often a band holds the measurement, and how wide it is; and the numbers of a box plot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from seakeep.arrays import FloatArray, as_real, number
from seakeep.errors import DataError, RequestError

__all__ = ["BandCoverage", "BoxStatistics", "box_statistics", "coverage"]


@dataclass(frozen=True)
class BandCoverage:
    """Coverage and width of a band, of each channel.

    Attributes
    ----------
    inside, below, above : ndarray, shape (…, channel)
        Part of the instants at which the measurement lies in the band (bounds included), below
        it, and above it; they add up to 1.
    width : ndarray, shape (…, channel)
        Mean width, in the unit of the channel.
    relative_width : ndarray, shape (…, channel)
        Mean width in measured standard deviations (ddof = 1 over the window); NaN where the
        measurement is constant.
    """

    inside: FloatArray
    below: FloatArray
    above: FloatArray
    width: FloatArray
    relative_width: FloatArray


def coverage(lower: npt.ArrayLike, upper: npt.ArrayLike, measured: npt.ArrayLike) -> BandCoverage:
    """Part of the instants at which a band holds the measurement, and the mean width of the band.

    Parameters
    ----------
    lower, upper : array_like, shape (…, time, channel) or (time,), or Dataset
        Bounds, infinite where a margin is; a channel with a NaN in either (too few members left)
        gives NaN.
    measured : array_like, shape (…, time, channel) or (time,), or Dataset
        Measurement, or on the tank the truth, in the same units.

    Returns
    -------
    BandCoverage, or Dataset over the leading dimensions and ``channel``
        Arrays of shape (…, channel); without the channel axis for a series. The Dataset has the
        channels' units in the coordinate ``unit``.

    Raises
    ------
    RequestError
        If the shapes differ, or the bounds are swapped.
    DataError
        If the measurement has gaps or fewer than two instants, or units or instants differ.

    Examples
    --------
    >>> band = coverage([0, 0, 0, 0], [1, 1, 1, 1], [0.5, 2.0, 0.2, -1.0])
    >>> float(band.inside), float(band.below), float(band.width)
    (0.5, 0.25, 1.0)
    """
    low, high = as_real(lower, "lower"), as_real(upper, "upper")
    m = as_real(measured, "measured")
    plain = m.ndim == 1 and low.ndim == 1
    tail = slice(-1 if plain else -2, None)
    shapes = {item.shape[tail] for item in (low, high, m)}
    if m.ndim < 1 or len(shapes) != 1 or low.shape != high.shape or (not plain and m.ndim < 2):
        raise RequestError(
            f"lower has shape {low.shape}, upper {high.shape} and measured {m.shape}; all must "
            "end in (time, channel) of the same size, or be series of the same length."
        )
    try:
        np.broadcast_shapes(low.shape, m.shape)
    except ValueError:
        raise RequestError(
            f"lower and upper have shape {low.shape} and measured {m.shape}; the axes before "
            "(time, channel) must agree, or be missing in measured."
        ) from None
    if not np.all(np.isfinite(m)):
        raise DataError(
            f"measured holds {int(np.count_nonzero(~np.isfinite(m)))} value(s) that are NaN or "
            "infinite. Fill its gaps first, or judge a window without them."
        )
    if plain:
        low, high, m = low[:, None], high[:, None], m[:, None]
    if m.shape[-2] < 2:
        raise DataError(f"a window of {m.shape[-2]} instant(s) has no width to judge; give two.")
    if np.any(low > high):
        raise RequestError(
            f"lower exceeds upper at {int(np.count_nonzero(low > high))} instant(s); they are "
            "given in the wrong order."
        )
    lost = (np.isnan(low) | np.isnan(high)).any(axis=-2)
    below, above = (m < low).mean(axis=-2), (m > high).mean(axis=-2)
    width = (high - low).mean(axis=-2)
    spread = np.where(np.ptp(m, axis=-2) > 0, m.std(axis=-2, ddof=1), np.nan)
    inside = ((m >= low) & (m <= high)).mean(axis=-2)
    results = (inside, below, above, width, width / spread)
    kept = [np.where(lost, np.nan, item) for item in results]
    return BandCoverage(*[item[..., 0] if plain else item for item in kept])


@dataclass(frozen=True)
class BoxStatistics:
    """The numbers that a box plot draws.

    Attributes
    ----------
    lower_quartile, median, upper_quartile : float
        Quartiles, interpolated linearly.
    lower_whisker, upper_whisker : float
        Furthest values within 1.5 inter-quartile ranges of the box.
    outliers : ndarray, shape (outlier,)
        Values beyond the whiskers, ascending.
    mean : float
        Mean.
    count : int
        Values judged.
    left_out : int
        Values that were NaN or infinite (a forecast that diverged).
    """

    lower_quartile: float
    median: float
    upper_quartile: float
    lower_whisker: float
    upper_whisker: float
    outliers: FloatArray
    mean: float
    count: int
    left_out: int

    @property
    def interquartile_range(self) -> float:
        """Height of the box."""
        return self.upper_quartile - self.lower_quartile


def box_statistics(values: npt.ArrayLike, reach: float = 1.5) -> BoxStatistics:
    """Quartiles, whiskers and outliers of a sample (Tukey), as matplotlib draws them.

    Parameters
    ----------
    values : array_like
        Numbers in any shape; those that are not finite are left out and counted.
    reach : float
        Inter-quartile ranges beyond the box within which a whisker ends.

    Returns
    -------
    BoxStatistics

    Raises
    ------
    RequestError
        If `reach` is negative.
    DataError
        If no value is finite.

    Examples
    --------
    >>> box = box_statistics([1, 2, 3, 4, 5, 20])
    >>> box.median, box.upper_whisker, box.outliers
    (3.5, 5.0, array([20.]))
    """
    everything = as_real(values, "values").ravel()
    x = np.sort(everything[np.isfinite(everything)])
    if x.size == 0:
        raise DataError(f"none of {everything.size} value(s) is finite; there is no box to draw.")
    if not number(reach, "reach") >= 0:
        raise RequestError(f"reach must be zero or more; received {reach}.")
    first, middle, third = (float(item) for item in np.quantile(x, [0.25, 0.5, 0.75]))
    room = reach * (third - first)
    # A whisker never ends inside the box, also where no value lies between it and the fence.
    low = min(float(x[x >= first - room][0]), first)
    high = max(float(x[x <= third + room][-1]), third)
    return BoxStatistics(
        lower_quartile=first,
        median=middle,
        upper_quartile=third,
        lower_whisker=low,
        upper_whisker=high,
        outliers=x[(x < low) | (x > high)],
        mean=float(x.mean()),
        count=int(x.size),
        left_out=int(everything.size - x.size),
    )
