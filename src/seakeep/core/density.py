r"""Distributions of series: kernel densities, their interval and divergence, and box plots.

A density is (paper, eq. PDF)
:math:`PDF(\xi, y) = \frac{1}{\mathcal T h} \sum_i K((y - \xi_i)/h)` with a normal kernel.

Jensen–Shannon divergence of two series has an interval and a noise floor (paper, eq. JSD).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import fft
from scipy.sparse import csc_array
from scipy.special import rel_entr

from seakeep.arrays import (
    FloatArray,
    IntArray,
    as_bundle,
    as_real,
    as_series,
    undefined,
    whole_number,
)
from seakeep.core.bootstrap import BlockRule, bootstrap_indices, resolve_block_length
from seakeep.errors import DataError, RequestError, did_you_mean, warn

MOST_BINS = 2**21
"""Bins of a density, which fit into 16 MB; finer ones are summed directly."""

Bandwidth = Literal["paper", "silverman"] | float
FACTORS = {"paper": (1.06, 1.0), "silverman": (0.9, 1.34)}
"""Factor of a rule, and divisor of its inter-quartile range."""

BINS_PER_BANDWIDTH = 32
"""Linear binning then errs by at most 1/(8·32²) = 1.2e-4 of the peak of one kernel."""
REACH = 8.5
"""Bandwidths beyond the grid that are kept; the kernel there is 2e-16 of its peak."""
COARSE = 1.5
"""Grid steps of more bandwidths than this misstate the mass of a kernel by over 3e-4."""


def _as_grid(values: npt.ArrayLike) -> FloatArray:
    """Return the grid of a density; refuse one that does not increase."""
    grid = as_real(values, "the grid")
    if grid.size < 2 or not np.all(np.isfinite(grid)) or not np.all(np.diff(grid) > 0):
        raise RequestError(
            "the grid must increase strictly, be finite, and have at least two points; sort it, "
            "once each."
        )
    return grid


def _is_even(grid: FloatArray) -> bool:
    """Whether a grid has one step."""
    steps = np.diff(grid)
    return np.allclose(steps, steps.mean(), rtol=1e-6, atol=0.0)


def _redrawn(series: FloatArray, positions: IntArray) -> tuple[FloatArray, IntArray]:
    """Samples in ascending order, and how often each stands in each row of positions."""
    order = np.argsort(series, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(order.size)
    rows = place[positions] + order.size * np.arange(len(positions))[:, None]
    times = np.bincount(rows.ravel(), minlength=order.size * len(rows))
    return series[order], times.reshape(len(rows), order.size)


def _once(series: FloatArray) -> tuple[FloatArray, IntArray]:
    """The same of a series as it is."""
    return np.sort(series), np.ones((1, series.size), dtype=np.intp)


def _bandwidths(
    ordered: FloatArray, times: IntArray, bandwidth: Bandwidth, of_constant: float = 0.0
) -> FloatArray:
    """Bandwidth of each row of :func:`_redrawn`; a constant one is refused, or has another's."""
    if isinstance(bandwidth, str) and bandwidth in FACTORS:
        factor, scale = FACTORS[bandwidth]
        count, below = ordered.size, np.cumsum(times, axis=1)

        def at(place: float) -> FloatArray:
            """The sample at a place, counted from zero; linear between two."""
            low, high = (
                ordered[(below > whole).argmax(axis=1)]
                for whole in (math.floor(place), math.ceil(place))
            )
            return low + (place % 1.0) * (high - low)

        deviation, weights = ordered - ordered.mean(), times.astype(float)
        variance = (weights @ deviation**2 - (weights @ deviation) ** 2 / count) / (count - 1)
        spread = np.where(at(count - 1) > at(0), np.sqrt(np.maximum(variance, 0.0)), 0.0)
        inner = (at(0.75 * (count - 1)) - at(0.25 * (count - 1))) / scale
        width = np.where(inner > 0, np.minimum(spread, inner), spread)
        h = factor * width * count**-0.2
        h = np.where(h > 0, h, of_constant)
    elif not isinstance(bandwidth, str) and 0 < bandwidth < math.inf:
        h = np.full(len(times), float(bandwidth))
    else:
        raise RequestError(
            "a bandwidth must be 'paper', 'silverman' or a positive number in the unit of the "
            f"series; received {bandwidth!r:.60}.{did_you_mean(str(bandwidth), FACTORS)}"
        )
    if not h.all():
        raise DataError(
            f"the series is constant ({ordered[0]:g}); it has no correlation, block length "
            "or density. Leave the channel out."
        )
    return h


def kernel_bandwidth(series: npt.ArrayLike, bandwidth: Bandwidth = "paper") -> float:
    r"""Bandwidth of a normal kernel.

    Parameters
    ----------
    series : array_like, shape (time,)
        Samples; their order does not matter.
    bandwidth : {"paper", "silverman"} or float
        ``"paper"`` is :math:`1.06 \min(SD, IQR)\, \mathcal T^{-1/5}` as printed, which lacks the
        1.34 under the inter-quartile range; ``"silverman"`` is
        :math:`0.9 \min(SD, IQR/1.34)\, n^{-1/5}` (Silverman 1986, eq. 3.31); a number is kept.

    Returns
    -------
    float
        In the unit of the series. SD has ddof = 1; quartiles are interpolated linearly. Where the
        inter-quartile range is zero (half the samples are equal) SD stands alone.

    Raises
    ------
    RequestError
        If the rule is unknown or the number not positive.
    DataError
        If the series is constant, has gaps, or has fewer than two samples.

    Examples
    --------
    >>> round(kernel_bandwidth([0.0, 1.0, 2.0, 3.0, 4.0], "silverman"), 4)
    0.9736
    """
    return float(_bandwidths(*_once(as_series(series)), bandwidth)[0])


def _densities(ordered: FloatArray, times: IntArray, grid: FloatArray, h: FloatArray) -> FloatArray:
    """Densities, shape (row, grid), of the rows of :func:`_redrawn`, each with its bandwidth."""
    span, steps = grid[-1] - grid[0], grid.size - 1
    even = _is_even(grid)
    # Bins between two grid points, of the narrowest kernel, and grid points beyond either end.
    fine = math.ceil(min(span / steps / h.min() * BINS_PER_BANDWIDTH, MOST_BINS))
    beyond = math.ceil(min(REACH * h.max() / span * steps, MOST_BINS))
    points = int(fft.next_fast_len(grid.size + 2 * beyond, real=True))
    bins = points * fine
    if even and len(times) > 1 and len(times) * bins > MOST_BINS:  # room for few at a time
        out = np.empty((len(times), grid.size))
        for rows in np.array_split(np.argsort(h), 2):  # so that a narrow one slows few others
            out[rows] = _densities(ordered, times[rows], grid, h[rows])
        return out
    if not even or bins > MOST_BINS:
        reach = h[:, None] * np.sqrt(2.0)
        sums = [(times * np.exp(-(((ordered - each) / reach) ** 2))).sum(axis=1) for each in grid]
        return np.stack(sums, axis=1) / (reach * np.sqrt(np.pi) * ordered.size)
    # Share each sample between the two nearest of fine bins, then convolve with the kernel.
    bin_width = span / (steps * fine)
    position = (ordered - grid[0]) / bin_width + beyond * fine
    near = np.flatnonzero((position >= 0) & (position < bins - 1))
    left = position[near].astype(np.intp)
    share = position[near] - left
    pairs = [np.stack(each, axis=1).ravel() for each in ((1.0 - share, share), (left, left + 1))]
    shares = csc_array((*pairs, 2 * np.arange(near.size + 1)), (bins, near.size))
    counts = (shares @ times.T[near]).T
    # So many values to a grid step resolve all frequencies that the narrowest kernel leaves.
    enough = math.ceil(span / steps / h.min() * REACH / np.pi)
    angular = 2.0 * np.pi * fft.rfftfreq(bins, bin_width)[: points * enough // 2 + 1]
    kernel = np.exp(-0.5 * (h[:, None] * angular) ** 2)
    smooth = fft.irfft(fft.rfft(counts)[:, : angular.size] * kernel, n=points * enough)
    inner = enough * smooth[:, beyond * enough :: enough][:, : grid.size]
    return np.maximum(inner, 0.0) / (ordered.size * span / steps)


def kernel_density(
    series: npt.ArrayLike, grid: npt.ArrayLike, bandwidth: Bandwidth = "paper"
) -> FloatArray:
    r"""Density of a series by a normal kernel.

    Parameters
    ----------
    series : array_like, shape (time,) or (series, time)
        Samples.
    grid : array_like, shape (grid,)
        Increasing values at which the density is wanted, in the unit of the series. It need not
        cover the series.
    bandwidth : {"paper", "silverman"} or float
        As for :func:`kernel_bandwidth`; each series has its own.

    Returns
    -------
    ndarray, shape (grid,) or (series, grid)
        Density, per unit of the series.

    Raises
    ------
    RequestError
        If shapes, grid or bandwidth are wrong.
    DataError
        If a series has gaps or fewer than two samples, or is constant under a rule.

    Notes
    -----
    On an evenly spaced grid the samples are shared between bins of h/32 and convolved by FFT; the
    result differs from the sum by at most 1.3e-4 of the peak of one kernel,
    :math:`1/(h\sqrt{2\pi})`. On another grid the sum is taken as it is.

    Examples
    --------
    >>> import numpy as np
    >>> grid = np.linspace(-5, 6, 300)
    >>> p = kernel_density([0.0, 1.0], grid, bandwidth=1.0)
    >>> round(float(np.trapezoid(p, grid)), 4)
    1.0
    """
    x, points = as_bundle(series, "the series"), _as_grid(grid)
    out = [_densities(*row, points, _bandwidths(*row, bandwidth))[0] for row in map(_once, x)]
    return out[0] if np.ndim(series) == 1 else np.stack(out)


def density_grid(
    *series: npt.ArrayLike, bandwidth: Bandwidth = "paper", points: int = 512, margin: float = 3.0
) -> FloatArray:
    """Evenly spaced grid over the pooled range of all series, with room for their kernels.

    Parameters
    ----------
    *series : array_like, shape (time,) or (series, time)
        All that are to be compared on the grid.
    bandwidth : {"paper", "silverman"} or float
        As for :func:`kernel_bandwidth`.
    points : int
        Number of points.
    margin : float
        Bandwidths, of the widest, beyond the smallest and the largest sample.

    Returns
    -------
    ndarray, shape (points,)

    Raises
    ------
    RequestError, DataError
        As :func:`kernel_density`.

    Warns
    -----
    SeakeepWarning
        If its step is over 1.5 bandwidths of a series; a divergence on it is then coarse.
    """
    whole_number(points, "points", 2)
    all_of_them = [as_bundle(item, "the series") for item in series]
    widths = [kernel_bandwidth(each, bandwidth) for x in all_of_them for each in x]
    low = float(min(map(np.min, all_of_them)) - margin * max(widths))
    high = float(max(map(np.max, all_of_them)) + margin * max(widths))
    narrow = min(widths)
    step = (high - low) / (points - 1)
    if step > COARSE * narrow:
        warn(
            f"the grid of {points} points over {low:.4g} to {high:.4g} has a step of {step:.3g}, "
            f"and the narrowest kernel a bandwidth of {narrow:.3g}. Look for a forecast that ran "
            "away or a spike in the measurement, or take more points."
        )
    return np.linspace(low, high, points)


def checked_grid(
    grid: npt.ArrayLike | None, series: Sequence[FloatArray], bandwidth: Bandwidth
) -> FloatArray:
    """Return the grid as given if it covers all series evenly, or a new one."""
    if grid is None:
        return density_grid(*series, bandwidth=bandwidth)
    points = _as_grid(grid)
    low, high = min(map(np.min, series)), max(map(np.max, series))
    if points[0] > low or points[-1] < high:
        raise RequestError(
            f"the grid runs from {points[0]:g} to {points[-1]:g} and the series from {low:g} to "
            f"{high:g}; mass outside would be lost. Use density_grid(…) of all the series."
        )
    if not _is_even(points):
        raise RequestError("the grid must be evenly spaced here; use density_grid(…).")
    return points


def bootstrapped_densities(
    series: FloatArray, positions: IntArray, grid: FloatArray, bandwidth: Bandwidth
) -> FloatArray:
    """Densities of one series redrawn at the given positions."""
    drawn, own = _redrawn(series, positions), kernel_bandwidth(series, bandwidth)
    return _densities(*drawn, grid, _bandwidths(*drawn, bandwidth, own))


@dataclass(frozen=True)
class JsdInterval:
    """Divergence of predicted and measured series over bootstrapped pairs.

    Attributes
    ----------
    mean, lower, upper : float
        Mean and quantiles 0.025 and 0.975 of `draws`, in nats.
    of_series : float
        Divergence of the series as they are, averaged over the predicted ones.
    noise_floor, noise_floor_lower, noise_floor_upper : float
        Mean and quantiles of `noise`.
    draws : ndarray, shape (predicted series, draw)
        The b-th redrawn prediction against the b-th redrawn measurement, from the same blocks.
    noise : ndarray, shape (draw,)
        The measurement against itself under two independent bootstraps.
    block_length : int
        Samples of a block.
    grid : ndarray, shape (grid,)
        Values at which the densities are given.
    predicted : ndarray, shape (predicted series, draw, grid)
        Densities of the redrawn predictions.
    measured : ndarray, shape (draw, grid)
        Densities of the redrawn measurements.
    """

    mean: float
    lower: float
    upper: float
    of_series: float
    noise_floor: float
    noise_floor_lower: float
    noise_floor_upper: float
    draws: FloatArray
    noise: FloatArray
    block_length: int
    grid: FloatArray
    predicted: FloatArray
    measured: FloatArray

    @property
    def uncertainty(self) -> float:
        """U of the paper, with the 0.975 that its table holds and its equation misprints."""
        return self.upper - self.lower


NUMBERS = (
    "mean", "lower", "upper", "uncertainty", "of_series", "noise_floor",
    "noise_floor_lower", "noise_floor_upper", "block_length",
)  # fmt: skip
"""What a table says of a :class:`JsdInterval`."""


def jensen_shannon(p: npt.ArrayLike, q: npt.ArrayLike) -> FloatArray:
    r"""Jensen–Shannon divergence of two distributions on one grid.

    Parameters
    ----------
    p, q : array_like, shape (…, grid)
        Masses, or densities on one evenly spaced grid; normalised to a sum of 1 here. Multiply
        densities by the cell widths where the grid is uneven.

    Returns
    -------
    ndarray, shape (…), or float
        :math:`\tfrac12 D(p\,\|\,m) + \tfrac12 D(q\,\|\,m)`, :math:`m = \tfrac12 (p + q)`,
        natural logarithm: 0 where they agree, ln 2 where they do not overlap.

    Examples
    --------
    >>> round(float(jensen_shannon([1.0, 0.0], [0.0, 1.0])), 4)
    0.6931
    """
    first, second = as_real(p, "p"), as_real(q, "q")
    first = first / first.sum(axis=-1, keepdims=True)
    second = second / second.sum(axis=-1, keepdims=True)
    middle = 0.5 * (first + second)
    total = rel_entr(first, middle).sum(axis=-1) + rel_entr(second, middle).sum(axis=-1)
    return np.clip(0.5 * total, 0.0, math.log(2.0))


def jsd_interval(
    predicted: npt.ArrayLike,
    measured: npt.ArrayLike,
    *,
    block_length: int | BlockRule,
    rng: np.random.Generator,
    n_series: int = 100,
    bandwidth: Bandwidth = "paper",
    grid: npt.ArrayLike | None = None,
    segments: Sequence[int] | None = None,
) -> JsdInterval:
    """Divergence of predicted from measured series with its interval and noise floor.

    Parameters
    ----------
    predicted : array_like, shape (time,) or (series, time), or Dataset
        Predictions at the instants of `measured`; the draws of several (one of each training
        window) are pooled. With Datasets its channels are judged, each against the one of that
        name.
    measured : array_like, shape (time,), or Dataset over time
        Measurement.
    block_length : int, "carlstein" or "politis_white"
        Samples of a block, or the rule, applied to each measured channel.
    rng : numpy.random.Generator
        Source of the block starts; of Datasets each channel has a spawned child, in their order.
    n_series : int
        Number of redrawn series (100 in the paper).
    bandwidth : {"paper", "silverman"} or float
        As for :func:`seakeep.core.density.kernel_bandwidth`; each redrawn series has its own.
    grid : array_like, shape (grid,), optional
        Evenly spaced values that cover all series; by default 512 over their pooled range and
        three bandwidths on either side. Not with Datasets, whose channels have their own.
    segments : sequence of int, optional
        Lengths of the joined pieces; no block then crosses a join.

    Returns
    -------
    JsdInterval, or Dataset over ``channel``
        The Dataset holds the numbers without the draws, and ``uncertainty``.

    Raises
    ------
    RequestError
        If lengths differ, a setting is out of range, or the grid does not cover the series.
    DataError
        If a series is constant, has gaps or is too short, or units or instants differ.

    Notes
    -----
    The paper leaves the pairing open. Here the b-th prediction and the b-th measurement are
    redrawn from the same block starts, so that a perfect prediction has a divergence of exactly
    zero. The floor draws a second, independent set of the measurement: a divergence near it is
    one that a record of this length cannot distinguish from none. It is not a lower bound, because
    paired draws share their sampling error and the floor's do not.
    """
    (interval,) = jsd_intervals(
        [as_bundle(predicted, "predicted")],
        measured,
        block_length=block_length,
        rng=rng,
        n_series=n_series,
        bandwidth=bandwidth,
        grid=grid,
        segments=segments,
    )
    return interval


def jsd_intervals(
    predictions: Sequence[FloatArray],
    measured: npt.ArrayLike,
    *,
    block_length: int | BlockRule,
    rng: np.random.Generator,
    n_series: int,
    bandwidth: Bandwidth,
    grid: npt.ArrayLike | None = None,
    segments: Sequence[int] | None = None,
) -> list[JsdInterval]:
    """Divergences of several predictions, (series, time), from a measurement that is redrawn once.

    All stand on one grid; arguments as for :func:`jsd_interval`.
    """
    m = as_series(measured, "measured")
    for p in predictions:
        if p.shape[1] != m.size:
            raise RequestError(
                f"predicted has {p.shape[1]} samples and measured {m.size}; the same block starts "
                "need the same length. Judge where both exist, on one time axis."
            )
    points = checked_grid(grid, [*predictions, m], bandwidth)
    block = resolve_block_length(m, block_length, segments)
    positions, others = (bootstrap_indices(m.size, n_series, block, rng, segments) for _ in "ab")
    truth = bootstrapped_densities(m, positions, points, bandwidth)
    noise = jensen_shannon(truth, bootstrapped_densities(m, others, points, bandwidth))
    floor_low, floor_high = np.quantile(noise, [0.025, 0.975])
    once = kernel_density(m, points, bandwidth)
    intervals = []
    for p in predictions:
        drawn = np.stack([bootstrapped_densities(x, positions, points, bandwidth) for x in p])
        draws = jensen_shannon(drawn, np.broadcast_to(truth, drawn.shape))
        low, high = np.quantile(draws, [0.025, 0.975])
        own = jensen_shannon(kernel_density(p, points, bandwidth), once)
        intervals.append(
            JsdInterval(
                mean=float(draws.mean()),
                lower=float(low),
                upper=float(high),
                of_series=float(np.mean(own)),
                noise_floor=float(noise.mean()),
                noise_floor_lower=float(floor_low),
                noise_floor_upper=float(floor_high),
                draws=draws,
                noise=noise,
                block_length=block,
                grid=points,
                predicted=drawn,
                measured=truth,
            )
        )
    return intervals


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
