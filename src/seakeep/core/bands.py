"""Bands: coverage, width and scores, and calibration of a band so that it holds what it claims.

Split-conformal prediction: the ensemble forecasts windows that its members never saw, and a
quantile of its errors there makes the band. Either the band of the members is moved outwards by a
constant margin, or the half-width is a factor times a scale that follows the members' spread, or
one that is learnt from spread, horizon and waves.
"""

from __future__ import annotations

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


FLOOR = 0.25
"""Part of the root mean square error below which the scale of a band never falls."""
CALM = 0.05
"""Envelope, in standard deviations of the training waves, below which waves count as none."""


@dataclass(frozen=True)
class ConformalMargin:
    """Quantile of the scores that makes the band, channel by channel.

    Attributes
    ----------
    margin : ndarray, shape (channel,)
        In the unit of the scores: that of the channel from :func:`band_scores`, a factor from
        scores that were divided by a scale. Infinite where a band was lost too often.
    block_length : ndarray, shape (channel,)
        Samples over which exceedances depend on each other.
    blocks : ndarray, shape (channel,)
        Blocks that the scores are worth.
    warranted : ndarray, shape (channel,)
        Probability that so many blocks can guarantee, at most `level`.
    level : float
        Probability that the band is to have.
    """

    margin: FloatArray
    block_length: FloatArray
    blocks: FloatArray
    warranted: FloatArray
    level: float


def band_scores(lower: npt.ArrayLike, upper: npt.ArrayLike, measured: npt.ArrayLike) -> FloatArray:
    r"""How far a measurement lies outside of a band; negative inside.

    Parameters
    ----------
    lower, upper, measured : array_like, shape (…, time, channel)
        Bounds and measurement in the same units.

    Returns
    -------
    ndarray, shape (…, time, channel)
        :math:`\max(l - y,\, y - u)`; infinite where the band is lost (NaN), since nothing is held
        there.

    Raises
    ------
    RequestError
        If the shapes differ.
    DataError
        If the measurement has gaps.
    """
    low, high = as_real(lower, "lower"), as_real(upper, "upper")
    y = as_real(measured, "measured")
    if not low.shape == high.shape == y.shape:
        raise RequestError(
            f"lower has shape {low.shape}, upper {high.shape} and measured {y.shape}; all must be "
            "of the same shape (…, time, channel)."
        )
    scores = np.maximum(low - finite(y, "measured"), y - high)
    return np.where(np.isnan(scores), np.inf, scores)


def spread_floor(mean: FloatArray, measured: FloatArray) -> FloatArray:
    """A quarter of the root mean square error of each channel, shape (channel,).

    Windows (window, time, channel) that were lost (NaN) are left out; 1 where all are, since no
    factor of any floor holds the measurement there.
    """
    lost = np.isnan(mean).any(axis=1, keepdims=True)
    squares = np.where(lost, 0.0, mean - measured) ** 2
    count = mean.shape[1] * np.count_nonzero(~lost, axis=(0, 1))
    rms = np.sqrt(squares.sum(axis=(0, 1)) / np.maximum(count, 1))
    return np.where(count > 0, FLOOR * rms, 1.0)


def wave_envelope(deviations: FloatArray, steps: int) -> FloatArray:
    """Root mean square of the waves that drive each step.

    Parameters
    ----------
    deviations : ndarray, shape (window, z + steps, Q)
        Standardised inputs.
    steps : int
        Steps of a window.

    Returns
    -------
    ndarray, shape (window, steps)
        Over the z + 1 rows that drive a step, and over the inputs; 1 without inputs.
    """
    windows, rows, count = deviations.shape
    if not count:
        return np.ones((windows, steps))
    total = np.zeros((windows, rows + 1))
    np.cumsum(np.sum(deviations**2, axis=2), axis=1, out=total[:, 1:])
    length = rows - steps + 1
    return np.sqrt((total[:, length:] - total[:, :steps]) / (length * count))


def _features(std: FloatArray, envelope: FloatArray, floor: FloatArray) -> FloatArray:
    """What a learnt scale depends on, (…, steps, N, 4): one, spread, horizon and waves, as logs."""
    unit = np.where(floor > 0, floor, 1.0)
    spread = np.log(np.hypot(std, unit) / unit)
    horizon = np.log1p(np.arange(std.shape[-2], dtype=float))[:, None]
    waves = np.log(np.maximum(envelope, CALM))[..., None]
    parts = np.broadcast_arrays(1.0, spread, horizon, waves)
    return np.stack(parts, axis=-1)


def learn_scale(
    mean: FloatArray,
    std: FloatArray,
    measured: FloatArray,
    envelope: FloatArray,
    floor: FloatArray,
) -> FloatArray:
    r"""Learn the logarithm of the scale of the errors, channel by channel.

    Parameters
    ----------
    mean, std, measured : ndarray, shape (window, steps, N)
        Of the forecast, and the measurement; windows that were lost (NaN) are left out.
    envelope : ndarray, shape (window, steps)
        From :func:`wave_envelope`.
    floor : ndarray, shape (N,)
        From :func:`spread_floor`.

    Returns
    -------
    ndarray, shape (4, N)
        Coefficients of one, :math:`\log\sqrt{1 + \sigma^2/f^2}`, the logarithm of the step's
        number and that of the envelope.

    Notes
    -----
    They make errors that are normal with this scale most likely; that is a convex problem, which
    Newton's method solves. A small ridge keeps what the windows do not vary in at zero.
    """
    complete = ~np.isnan(mean).any(axis=(1, 2))
    x = _features(std[complete], envelope[complete], floor)
    ratio = ((measured - mean)[complete] / np.where(floor > 0, floor / FLOOR, 1.0)) ** 2
    law = np.zeros((4, x.shape[2]))
    for channel in range(x.shape[2]):
        rows = x[:, :, channel].reshape(-1, 4)
        law[:, channel] = _most_likely(rows, ratio[..., channel].ravel())
    return law


def _most_likely(x: FloatArray, squares: FloatArray) -> FloatArray:
    """Coefficients β of the log-scale xβ of normal errors with these squares."""
    ridge = 1e-3 * max(len(x), 1) * np.diag([0.0, 1.0, 1.0, 1.0])
    law = np.zeros(4)

    def cost(beta: FloatArray) -> float:
        # A scale that is far too small costs more than any number.
        exponent = np.minimum(-2.0 * (x @ beta), 700.0)
        return float(np.sum(x @ beta + 0.5 * squares * np.exp(exponent))) + 0.5 * float(
            beta @ ridge @ beta
        )

    for _ in range(50):
        weights = squares * np.exp(-2.0 * (x @ law))
        gradient = x.T @ (1.0 - weights) + ridge @ law
        curvature = 2.0 * (x * weights[:, None]).T @ x + ridge + 1e-9 * np.eye(4)
        step, length = np.linalg.solve(curvature, gradient), 1.0
        while cost(law - length * step) > cost(law) and length > 1e-6:
            length *= 0.5
        law = law - length * step
        if np.abs(length * step).max() < 1e-9:
            break
    return law


def band_scale(
    std: FloatArray,
    floor: FloatArray,
    law: FloatArray | None = None,
    envelope: FloatArray | None = None,
) -> FloatArray:
    r"""Scale of the errors: :math:`\sqrt{\sigma^2 + f^2}`, or a learnt one not below f.

    Parameters
    ----------
    std : ndarray, shape (…, steps, N)
        Spread of the members.
    floor : ndarray, shape (N,)
        From :func:`spread_floor`.
    law : ndarray, shape (4, N), optional
        From :func:`learn_scale`.
    envelope : ndarray, shape (…, steps), optional
        From :func:`wave_envelope`; with `law`.

    Returns
    -------
    ndarray, shape (…, steps, N)
    """
    if law is None or envelope is None:
        return np.hypot(std, floor)
    exponent = np.einsum("...nk,kn->...n", _features(std, envelope, floor), law)
    return np.maximum(floor / FLOOR * np.exp(np.minimum(exponent, 50.0)), floor)


def scaled_scores(mean: FloatArray, scale: FloatArray, measured: FloatArray) -> FloatArray:
    """Errors over a scale, (…, time, channel); infinite where the forecast is lost (NaN).

    Zero where error and scale both are.
    """
    error = np.abs(measured - mean)
    scores = np.divide(error, scale, out=np.zeros_like(error), where=scale != 0)
    return np.where(np.isnan(scores), np.inf, scores)


def calibrated_bounds(
    mean: FloatArray,
    lower: FloatArray,
    upper: FloatArray,
    margin: FloatArray,
    scale: FloatArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Bounds of a calibrated band: those of the members moved, or a factor times a scale.

    Without a scale the margin is added outside of `lower` and `upper`; with one, of
    :func:`band_scale`, it is its factor around `mean`.
    """
    if scale is None:
        return lower - margin, upper + margin
    half = margin * scale
    return mean - half, mean + half


def conformal_margin(
    scores: npt.ArrayLike, level: float = 0.95, block_length: float | None = None
) -> ConformalMargin:
    r"""Margin by which a band is widened so that it holds a part `level` of the instants.

    Parameters
    ----------
    scores : array_like, shape (window, time, channel)
        From :func:`band_scores`, of windows that the band did not learn from.
    level : float
        Probability that the widened band is to have.
    block_length : float, optional
        Samples over which scores depend on each other; 1 for independent ones. By default, channel
        by channel, the integrated correlation time of the exceedances of the quantile `level`, on
        which the error of an empirical quantile depends.

    Returns
    -------
    ConformalMargin

    Raises
    ------
    RequestError
        If the shape or a setting is out of range.
    DataError
        If a score is NaN.

    Notes
    -----
    Of n scores in K = n / `block_length` blocks the margin is the order statistic of rank
    :math:`\lceil n\,\mathrm{level}\,(1 + 1/K)\rceil`, and never negative: a band is not narrowed.
    With independent exchangeable scores (K = n) this is conformalised quantile regression (Romano,
    Patterson and Candès, 2019), and the coverage of a new score is at least `level`, whatever their
    distribution. In time series it is so for exchangeable blocks, and about so for stationary
    forecast errors whose dependence is short against the record. It does not hold in another sea
    than that of the scores. Where K blocks cannot guarantee `level` (K / (K + 1) is less), the
    margin is the largest score, and ``warranted`` says what remains.

    Examples
    --------
    >>> import numpy as np
    >>> scores = np.arange(-9.0, 11.0).reshape(1, 20, 1)
    >>> found = conformal_margin(scores, 0.8, block_length=1)
    >>> float(found.margin[0]), float(found.warranted[0])
    (7.0, 0.8)
    """
    s = as_real(scores, "scores")
    if s.ndim != 3 or 0 in s.shape:
        raise RequestError(
            f"scores has shape {s.shape}; (window, time, channel) with at least one of each is "
            "needed."
        )
    level = fraction(level, "level")
    if block_length is not None and not 1 <= block_length <= s.shape[1]:
        raise RequestError(
            f"block_length must lie between 1 and the {s.shape[1]} samples of a window; received "
            f"{block_length}."
        )
    if np.isnan(s).any():
        raise DataError("scores holds NaN; a band that is lost has the score infinity.")
    n, channels = s.shape[0] * s.shape[1], range(s.shape[2])
    lengths = np.array([block_length or _dependence(s[..., c], level) for c in channels])
    blocks = n / lengths
    ranks = np.minimum(np.ceil(n * level * (1.0 + 1.0 / blocks) - 1e-9), n).astype(int)
    ordered = np.sort(s.reshape(n, -1), axis=0)
    margin = np.maximum(ordered[ranks - 1, channels], 0.0)
    return ConformalMargin(
        margin=margin,
        block_length=lengths,
        blocks=blocks,
        warranted=np.minimum(level, blocks / (blocks + 1.0)),
        level=level,
    )


def _dependence(scores: FloatArray, level: float) -> float:
    """Integrated correlation time of the exceedances, in samples, of scores (window, time)."""
    steps = scores.shape[1]
    above = scores >= np.quantile(scores, level, method="higher")
    deviations = above - above.mean()
    variance = float(np.mean(deviations**2))
    if variance == 0.0:
        return float(steps)
    total = 1.0
    for lag in range(1, steps):
        correlation = float(np.mean(deviations[:, lag:] * deviations[:, :-lag])) / variance
        if correlation <= 0.0:
            break
        total += 2.0 * correlation
    return min(total, float(steps))
