"""Coverage, width and scores of a band; numbers of a box plot."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import special

from seakeep.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    as_real,
    finite,
    fraction,
    ratio,
    undefined,
)
from seakeep.errors import DataError, RequestError

WAVE_PARTS = ("lowest waves", "middle waves", "highest waves")
HORIZON_PARTS = ("first third", "middle third", "last third")
"""Parts of a coverage table, after "all"."""


@dataclass(frozen=True)
class BandCoverage:
    """Coverage and width of a band, of each channel.

    Attributes
    ----------
    inside, below, above : ndarray, shape (…, channel)
        Fraction of the instants at which the measurement lies in the band (bounds included), below
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
    """Fraction of the instants at which a band holds the measurement, and its mean width.

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
        If the bounds are swapped.
    DataError
        If the measurement has gaps, or units or instants differ.

    Examples
    --------
    >>> band = coverage([0, 0, 0, 0], [1, 1, 1, 1], [0.5, 2.0, 0.2, -1.0])
    >>> float(band.inside), float(band.below), float(band.width)
    (0.5, 0.25, 1.0)
    """
    low, high, m = _triple(lower, upper, measured)
    finite(m, "measured")
    time = -min(m.ndim, 2)
    lost = (np.isnan(low) | np.isnan(high)).any(axis=time)
    below, above = (m < low).mean(axis=time), (m > high).mean(axis=time)
    width = (high - low).mean(axis=time)
    spread = np.where(np.ptp(m, axis=time) > 0, m.std(axis=time, ddof=1), np.nan)
    inside = ((m >= low) & (m <= high)).mean(axis=time)
    results = (inside, below, above, width, width / spread)
    return BandCoverage(*(np.where(lost, np.nan, item) for item in results))


@dataclass(frozen=True)
class CoverageTable:
    """Coverage, width and scores of a band in parts of the instants.

    Attributes
    ----------
    parts : tuple of str
        ``"all"``; the thirds of the instants by wave height, where that is known; the thirds of
        the horizon.
    instants : ndarray of int, shape (part,)
        Instants of all windows in each part.
    inside : ndarray, shape (part, channel)
        Fraction of the instants at which the measurement lies in the band, bounds included.
    width, relative_width : ndarray, shape (part, channel)
        Mean width in the unit of the channel, and in standard deviations (ddof = 1) of the
        measurement over all windows; NaN where it is constant.
    winkler, crps : ndarray, shape (part, channel)
        Means of :func:`winkler_score` and :func:`band_crps`, in the unit of the channel: less is
        better.
    """

    parts: tuple[str, ...]
    instants: IntArray
    inside: FloatArray
    width: FloatArray
    relative_width: FloatArray
    winkler: FloatArray
    crps: FloatArray


def winkler_score(
    lower: npt.ArrayLike, upper: npt.ArrayLike, measured: npt.ArrayLike, level: float = 0.95
) -> FloatArray:
    r"""Width of a band plus a penalty for each measurement outside of it.

    Parameters
    ----------
    lower, upper, measured : array_like
        Bounds and measurement in the same units, of shapes that broadcast.
    level : float, optional
        Probability that the band is to have.

    Returns
    -------
    ndarray
        :math:`u - l + \frac{2}{1 - p} \max(l - y,\, y - u,\, 0)`, p the level: in the mean least
        for the true quantiles (Winkler, 1972). NaN where the band is.

    Raises
    ------
    RequestError
        If the bounds are swapped, or `level` is not between 0 and 1.

    Examples
    --------
    >>> winkler_score(0.0, 1.0, [0.5, 1.25], level=0.9)
    array([1., 6.])
    """
    low, high, y = _triple(lower, upper, measured)
    outside = np.maximum(np.maximum(low - y, y - high), 0.0)
    return high - low + 2.0 / (1.0 - fraction(level, "level")) * outside


def band_crps(
    lower: npt.ArrayLike, upper: npt.ArrayLike, measured: npt.ArrayLike, level: float = 0.95
) -> FloatArray:
    r"""Continuous ranked probability score of the normal distribution that a band stands for.

    Parameters
    ----------
    lower, upper, measured, level
        As in :func:`winkler_score`.

    Returns
    -------
    ndarray
        Score of the normal distribution whose central interval of probability `level` is the
        band: :math:`s\,(z\,(2\Phi(z) - 1) + 2\varphi(z) - 1/\sqrt\pi)` with s its standard
        deviation and z the standardised measurement (Gneiting and Raftery, 2007); the absolute
        error of a band without width. NaN where the band is, infinite where it is.

    Raises
    ------
    RequestError
        As :func:`winkler_score`.

    Examples
    --------
    >>> band_crps([-1.96, 2.0], [1.96, 2.0], [0.0, 2.5]).round(4)
    array([0.2337, 0.5   ])
    """
    low, high, y = _triple(lower, upper, measured)
    quantile = float(special.ndtri(0.5 + 0.5 * fraction(level, "level")))
    with undefined():
        spread, error = (high - low) / (2.0 * quantile), np.abs(y - 0.5 * (low + high))
        z = ratio(error, spread, 0.0)
        density = np.exp(-0.5 * z**2) / np.sqrt(2.0 * np.pi)
        score = spread * (z * special.erf(z / np.sqrt(2.0)) + 2.0 * density - 1.0 / np.sqrt(np.pi))
    crps = np.where(spread > 0, score, error)
    return np.where(np.isinf(spread), np.inf, crps)


def _triple(
    lower: npt.ArrayLike, upper: npt.ArrayLike, measured: npt.ArrayLike
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Bounds and measurement of one shape."""
    low, high = as_real(lower, "lower"), as_real(upper, "upper")
    y = as_real(measured, "measured")
    low, high, y = np.broadcast_arrays(low, high, y)
    if np.any(low > high):
        raise RequestError(
            f"lower exceeds upper at {int(np.count_nonzero(low > high))} instant(s); they are "
            "given in the wrong order."
        )
    return low, high, y


def coverage_table(
    lower: npt.ArrayLike,
    upper: npt.ArrayLike,
    measured: npt.ArrayLike,
    level: float = 0.95,
    waves: npt.ArrayLike | None = None,
) -> CoverageTable:
    """Coverage, width and scores of a band: as a whole, by wave height and by horizon.

    Parameters
    ----------
    lower, upper, measured : array_like, shape (…, time, channel), or Dataset
        Bounds and measurement in windows of the same length. Windows in which the band of a
        channel is lost (NaN) are left out of that channel.
    level : float, optional
        Probability that the band is to have.
    waves : array_like, shape (…, time), or DataArray, optional
        Height of the waves at these instants, such as twice the envelope of the elevation. By
        default there are no parts by wave height.

    Returns
    -------
    CoverageTable, or Dataset over ``part`` and ``channel``
        The Dataset has the channels' units in the coordinate ``unit``.

    Raises
    ------
    RequestError
        If the bounds are swapped, or `level` is not between 0 and 1.
    DataError
        If the measurement or the waves have gaps, or no window is whole.

    Examples
    --------
    >>> y = np.array([0.0, 1.0, -1.0, 2.0, 0.5, 0.0])[:, None]
    >>> table = coverage_table(y * 0 - 1, y * 0 + 1, y, waves=[1, 2, 3, 4, 5, 6])
    >>> dict(zip(table.parts, table.inside[:, 0].round(2).tolist()))["middle waves"]
    0.5
    """
    low, high, y = _triple(lower, upper, measured)
    finite(y, "measured")
    heights = None
    if waves is not None:
        heights = finite(np.atleast_1d(as_real(waves, "waves")), "waves")
        heights = np.broadcast_to(heights, y.shape[:-1]).reshape(-1, y.shape[-2])
    low, high, y = (each.reshape(-1, *y.shape[-2:]) for each in (low, high, y))
    lost = np.any(np.isnan(low) | np.isnan(high), axis=1, keepdims=True)
    lost = np.broadcast_to(lost, y.shape)
    some = ~np.all(lost, axis=(1, 2))
    if not some.any():
        raise DataError(f"the band is lost in all of {some.size} window(s); nothing can be judged.")
    low, high, y, lost = low[some], high[some], y[some], lost[some]
    places = _parts(y.shape[:2], None if heights is None else heights[some])
    scores = {
        "inside": ((y >= low) & (y <= high)).astype(float),
        "width": high - low,
        "winkler": winkler_score(low, high, y, level),
        "crps": band_crps(low, high, y, level),
    }
    variables = {
        key: np.ma.stack(
            [np.ma.array(each, mask=lost)[place].mean(axis=0) for place in places.values()]
        ).filled(np.nan)
        for key, each in scores.items()
    }
    pooled = y.reshape(-1, y.shape[-1])
    spread = np.where(np.ptp(pooled, axis=0) > 0, pooled.std(axis=0, ddof=1), np.nan)
    return CoverageTable(
        parts=tuple(places),
        instants=np.array([np.count_nonzero(place) for place in places.values()]),
        relative_width=variables["width"] / spread,
        **variables,
    )


def _parts(shape: tuple[int, ...], heights: FloatArray | None) -> dict[str, BoolArray]:
    """Instants (window, time) of each part of a coverage table."""
    out = {"all": np.ones(shape, dtype=bool)}
    thirds = [(WAVE_PARTS, heights)] if heights is not None else []
    horizon = np.broadcast_to(np.arange(shape[1], dtype=float), shape)
    for names, values in (*thirds, (HORIZON_PARTS, horizon)):
        # Ranks, so that thirds are of one size where values are equal.
        order = np.argsort(values, axis=None, kind="stable")
        third = np.empty(order.size, dtype=int)
        third[order] = 3 * np.arange(order.size) // order.size
        out |= {name: (third == k).reshape(shape) for k, name in enumerate(names)}
    return out


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
        Values that were NaN.
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


def box_statistics(values: npt.ArrayLike) -> BoxStatistics:
    """Quartiles, whiskers and outliers of a sample (Tukey), as matplotlib draws them.

    Parameters
    ----------
    values : array_like
        Numbers in any shape; NaN is left out and counted. Infinite ones, such as the error of a
        forecast that diverged, are values like others.

    Returns
    -------
    BoxStatistics

    Raises
    ------
    DataError
        If all values are NaN.

    Examples
    --------
    >>> box = box_statistics([1, 2, 3, 4, 5, 20])
    >>> box.median, box.upper_whisker, box.outliers
    (3.5, 5.0, array([20.]))
    """
    everything = as_real(values, "values").ravel()
    x = np.sort(everything[~np.isnan(everything)])
    if x.size == 0:
        raise DataError(f"all {everything.size} value(s) are NaN; there is no box to draw.")
    with undefined():  # beside an infinite value
        between, higher = (
            np.quantile(x, [0.25, 0.5, 0.75], method=m) for m in ("linear", "higher")
        )
    first, middle, third = np.where(np.isnan(between), higher, between).tolist()
    room = 1.5 * (third - first)
    # A whisker never ends inside the box, also where no value lies between it and the fence.
    low = min(float(x[~(x < first - room)][0]), first)
    high = max(float(x[~(x > third + room)][-1]), third)
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
