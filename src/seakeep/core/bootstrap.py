r"""Block lengths and the moving-block bootstrap (paper, section Performance metrics).

A series of :math:`\mathcal T` samples is redrawn from its overlapping blocks of :math:`r`
samples, which keeps its dependence within a block (Künsch 1989).

Intervals of statistics over cells that two factors cross: training sets and test windows.

Cells of one row share a training set, those of one column a test window: none of them is
independent of the others, and counting them as such makes intervals far too narrow. Rows and
columns are redrawn apart from each other, and a cell is taken wherever a drawn row meets a drawn
column (Owen, Annals of Applied Statistics 1, 2007: the pigeonhole bootstrap). Neighbours that
overlap are drawn together, in circular blocks. Student's distribution accounts for the few blocks
there are (:func:`seakeep.core.bootstrap.student_interval`).
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import special

from seakeep.arrays import FloatArray, IntArray, as_real, as_series, fraction, whole_number
from seakeep.errors import DataError, RequestError, did_you_mean, warn

BlockRule = Literal["carlstein", "politis_white"]

RULES = ("carlstein", "politis_white")
QUIET_LAGS = 5
"""K of Politis & White: max(5, √log₁₀ T), which is five below 10²⁵ samples."""
FEWEST_SAMPLES = 8
"""A shorter series has no block length: its quarter holds one sample."""


def _as_segments(segments: Sequence[int] | None, samples: int) -> IntArray:
    """Return the lengths of the pieces of which a series was joined; None is one piece."""
    if segments is None:
        return np.array([samples])
    lengths = np.array([whole_number(item, "a segment") for item in segments])
    if lengths.sum() != samples:
        raise RequestError(
            f"the segments add up to {lengths.sum()} samples and the series has {samples}. "
            "Give the length of each joined piece, in order."
        )
    return lengths


def _varying(series: npt.ArrayLike) -> FloatArray:
    x = as_series(series, "the series", minimum=FEWEST_SAMPLES)
    if x.min() == x.max():
        raise DataError(
            f"the series is constant ({x[0]:g}); it has no correlation, block length or density. "
            "Leave the channel out."
        )
    return x


def _autocovariance(x: FloatArray, lags: int, segments: IntArray) -> FloatArray:
    # Zeros between the pieces keep every product inside one of them.
    centred = x - x.mean()
    pieces = np.split(centred, np.cumsum(segments)[:-1])
    apart = np.concatenate([np.concatenate([piece, np.zeros(lags)]) for piece in pieces])
    return np.array([apart[: apart.size - k] @ apart[k:] for k in range(lags + 1)]) / x.size


def lag_one_correlation(series: npt.ArrayLike, segments: Sequence[int] | None = None) -> float:
    r"""Lag-one correlation :math:`\varphi` of the paper, its denominator squared.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniform samples.
    segments : sequence of int, optional
        Lengths of the joined pieces; products across a join are left out.

    Returns
    -------
    float
        :math:`\frac{\mathcal T \sum_{i=1}^{\mathcal T - 1} (\xi_{i+1} - EV)(\xi_i - EV)}
        {(\mathcal T - 1) \sum_{i=1}^{\mathcal T} (\xi_i - EV)^2}`. The printed denominator lacks
        the square and is zero. The factor can carry a very slow series beyond 1.

    Raises
    ------
    DataError
        If the series is constant, has gaps, or has fewer than eight samples.
    """
    x = _varying(series)
    pieces = _as_segments(segments, x.size)
    zero, one = _autocovariance(x, 1, pieces)
    return float(x.size * one / ((x.size - pieces.size) * zero))


def _politis_white(x: FloatArray, segments: IntArray) -> float:
    n = x.size
    longest = min(math.ceil(math.sqrt(n)) + QUIET_LAGS, n - 1)
    covariance = _autocovariance(x, longest, segments)
    small = np.abs(covariance[1:] / covariance[0]) < 2.0 * math.sqrt(math.log10(n) / n)
    # m: the first of K insignificant correlations in a row, counted as R's np and arch do.
    quiet = np.lib.stride_tricks.sliding_window_view(small, QUIET_LAGS).all(axis=-1)
    last = int(np.argmax(quiet)) if quiet.any() else int(np.flatnonzero(~small)[-1])
    last += 1
    bandwidth = min(2 * last, longest)
    lags = np.arange(1, bandwidth + 1)
    window = np.clip(2.0 * (1.0 - lags / bandwidth), 0.0, 1.0)
    weighted = window * covariance[1 : bandwidth + 1]
    slope = 2.0 * float(np.sum(lags * weighted))
    at_zero = float(covariance[0] + 2.0 * np.sum(weighted))
    variance = 4.0 / 3.0 * at_zero**2
    if variance <= 0.0:
        return 1.0
    return float(np.cbrt(2.0 * slope**2 / variance * n))


def block_length(
    series: npt.ArrayLike,
    rule: BlockRule = "carlstein",
    *,
    segments: Sequence[int] | None = None,
) -> int:
    r"""Length of the blocks of a bootstrap.

    Parameters
    ----------
    series : array_like, shape (time,)
        Uniform samples without gaps, at least eight.
    rule : {"carlstein", "politis_white"}
        ``"carlstein"`` is the paper's
        :math:`r = (2\varphi/a)^{2/3} \mathcal T^{1/3}`, :math:`a = (1-\varphi)(1+\varphi)`, with
        :func:`lag_one_correlation` by size, the optimum of an AR(1) (Carlstein 1986).
        ``"politis_white"`` takes the correlations up to the lag where they die out (Politis &
        White 2004, corrected by Patton, Politis & White 2009), no longer than
        :math:`\min(3\sqrt{\mathcal T}, \mathcal T/3)`; it is the optimum of the circular bootstrap,
        which that of moving blocks shares.
    segments : sequence of int, optional
        Lengths of the joined pieces; no product and no block then crosses a join.

    Returns
    -------
    int
        Samples, rounded to the nearest, at least 1 and at most a quarter of the series and its
        shortest segment.

    Raises
    ------
    RequestError
        If a setting is unknown or out of range.
    DataError
        If the series is constant, has gaps, or has fewer than eight samples.

    Warns
    -----
    SeakeepWarning
        If the rule asked for longer blocks than that; an interval from so few blocks is too
        narrow.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.random.default_rng(0).standard_normal(480)
    >>> block_length(x), block_length(x, "politis_white")
    (1, 1)
    """
    if rule not in RULES:
        raise RequestError(
            f"unknown rule '{rule}' of the block length.{did_you_mean(str(rule), RULES)} "
            f"There are: {', '.join(RULES)}."
        )
    x = _varying(series)
    pieces = _as_segments(segments, x.size)
    cap = min(x.size // 4, int(pieces.min()))
    if rule == "carlstein":
        phi = abs(lag_one_correlation(x, segments))
        odds = 2.0 * phi / ((1.0 - phi) * (1.0 + phi)) if phi < 1.0 else math.inf
        optimum = float(odds ** (2.0 / 3.0) * np.cbrt(x.size))
    else:
        optimum = _politis_white(x, pieces)
        cap = min(cap, math.ceil(min(3.0 * math.sqrt(x.size), x.size / 3.0)))
    if optimum > cap + 0.5:
        warn(
            f"the rule '{rule}' asks for blocks of {optimum:.0f} samples; cut to {cap}, the "
            f"longest that a series of {x.size} samples allows. So few blocks make an interval too "
            "narrow: take a longer series."
        )
    return int(np.clip(round(min(optimum, cap)), 1, cap))


def resolve_block_length(
    series: npt.ArrayLike, block: int | BlockRule, segments: Sequence[int] | None = None
) -> int:
    """Return a block length as it is, or by the rule that it names."""
    return block_length(series, block, segments=segments) if isinstance(block, str) else block


def _joined(starts: IntArray, block: int, size: int) -> IntArray:
    """Positions of blocks that start there, side by side, the last cut; shape (…, size)."""
    return (starts[..., None] + np.arange(block)).reshape(len(starts), -1)[:, :size]


def bootstrap_indices(
    n_samples: int,
    n_series: int,
    block_length: int,
    rng: np.random.Generator,
    segments: Sequence[int] | None = None,
) -> IntArray:
    """Positions that redraw a series; the same for every series that must keep step with it."""
    whole_number(n_series, "n_series")
    whole_number(block_length, "block_length")
    lengths = _as_segments(segments, n_samples)
    shortest = int(lengths.min())
    if block_length > shortest:
        what = "the series" if segments is None else "the shortest segment"
        raise RequestError(
            f"block_length of {block_length} samples does not fit into {what} of {shortest}. "
            f"Choose 1 to {shortest}; block_length(series) proposes one."
        )
    first = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    allowed = np.concatenate(
        [np.arange(a, a + n - block_length + 1) for a, n in zip(first, lengths, strict=True)]
    )
    shape = n_series, -(-n_samples // block_length)
    return _joined(allowed[rng.integers(0, allowed.size, size=shape)], block_length, n_samples)


def student_interval(
    value: npt.ArrayLike,
    redrawn: FloatArray,
    blocks: float,
    level: float,
    axis: int = 0,
    signed: bool = False,
) -> tuple[FloatArray, FloatArray]:
    r"""Interval of a statistic from its redrawn values, for few blocks.

    The bounds are :math:`v \pm t_{k-1} s \sqrt{k/(k-1)}` with s the standard deviation over the
    draws, k the number of blocks, and t the quantile of Student's distribution (Hesterberg, The
    American Statistician 69, 2015). Quantiles of the draws cover too little for ten blocks or
    fewer. A statistic of which all values are positive is taken in the logarithm, so that its
    bounds are positive too, unless it is `signed`. Where draws are infinite the bounds are the
    smallest and the largest draw.

    Parameters
    ----------
    value : array_like
        The statistic.
    redrawn : ndarray
        The same over redrawn data, along `axis`; NaN is left out.
    blocks : float
        Blocks of the data that are independent of each other, more than one.
    level : float
        Probability between the bounds.
    axis : int, optional
        Axis of the draws.
    signed : bool, optional
        Whether the statistic may be negative, whatever the draws are.

    Returns
    -------
    lower, upper : ndarray
    """
    middle = np.asarray(value, dtype=float)
    positive = not (signed or np.any(redrawn <= 0) or np.any(middle <= 0))
    if positive:
        middle, redrawn = np.log(middle), np.log(redrawn)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a statistic that is NaN in all draws
        spread = np.nanstd(redrawn, axis=axis, ddof=1)
    student = special.stdtrit(blocks - 1.0, 0.5 + level / 2)
    half = student * np.sqrt(blocks / (blocks - 1.0)) * spread
    lower, upper = middle - half, middle + half
    endless = np.isinf(redrawn).any(axis=axis)
    lower = np.where(endless, np.fmin.reduce(redrawn, axis=axis), lower)
    upper = np.where(endless, np.fmax.reduce(redrawn, axis=axis), upper)
    return (np.exp(lower), np.exp(upper)) if positive else (lower, upper)


def moving_block_bootstrap(
    series: npt.ArrayLike,
    n_series: int,
    block_length: int,
    rng: np.random.Generator,
    *,
    segments: Sequence[int] | None = None,
) -> FloatArray:
    r"""Redraw a series from its overlapping blocks.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel), DataArray or Dataset over time
        Uniform samples without gaps; all channels are redrawn from the same blocks.
    n_series : int
        Number of redrawn series (100 in the paper).
    block_length : int
        Samples of a block; :func:`block_length` proposes one.
    rng : numpy.random.Generator
        Source of the block starts.
    segments : sequence of int, optional
        Lengths of the joined pieces. No block then crosses a join; by default it may, as in the
        paper.

    Returns
    -------
    ndarray, shape (n_series, time) or (n_series, time, channel), DataArray or Dataset
        Labelled results have the dimensions (draw, time) and keep the times.

    Raises
    ------
    RequestError
        If the block does not fit, or a setting is out of range.
    DataError
        If a value is not finite.

    Notes
    -----
    The paper draws :math:`C' = \mathcal T / r` of the :math:`\mathcal T - r + 1` blocks, which is
    not a whole number; its ceiling is drawn and the last block cut. Samples within a block of
    either end lie in fewer blocks than the others and are drawn less often.

    Examples
    --------
    >>> import numpy as np
    >>> moving_block_bootstrap(np.arange(6.0), 2, 3, np.random.default_rng(1))
    array([[1., 2., 3., 2., 3., 4.],
           [3., 4., 5., 3., 4., 5.]])
    """
    x = as_series(series, "series", minimum=1, channels=True)
    return x[bootstrap_indices(x.shape[0], n_series, block_length, rng, segments)]


FEWEST = 3.0
"""Blocks of an axis below which their spread is not known."""
AT_ONCE = 4_000_000
"""Values of redrawn cells at a time: 32 MB."""


def two_way_interval(
    statistic: Callable[..., FloatArray],
    *cells: npt.ArrayLike,
    rng: np.random.Generator,
    blocks: tuple[int, int] = (1, 1),
    n_series: int = 1000,
    level: float = 0.95,
    signed: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Interval of a statistic of crossed cells by a two-way block bootstrap.

    Parameters
    ----------
    statistic : callable
        Of redrawn cells, each of shape (series, row, column, …); its result has the shape
        (series, …). A series for which it is NaN is left out.
    *cells : array_like, shape (row, column, …)
        Such as errors per training set and test window, NaN where a cell is not judged. All of
        them are redrawn alike, so that a difference between models keeps its pairs.
    rng : numpy.random.Generator
        Source of the draws.
    blocks : (int, int), optional
        Neighbouring rows, and columns, that are drawn together; :func:`overlap_block`.
    n_series : int, optional
        Number of redrawn tables.
    level : float, optional
        Probability between the bounds.
    signed : bool, optional
        Whether the statistic may be negative, whatever the draws are; bounds of any other that is
        positive throughout are positive.

    Returns
    -------
    lower, upper : ndarray, shape (…)
        Bounds; NaN where an axis of several cells, judged or not, holds fewer than three
        blocks, which say nothing of their spread. An axis of one cell is not redrawn: the
        interval is then conditional on it. So it is where one of several is judged, as where each
        test set is judged by the one training set that leaves it out.

    Raises
    ------
    RequestError
        If the cells differ in their first two axes, or a setting is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> errors = np.random.default_rng(0).normal(1.0, 0.1, (10, 10))
    >>> mean = lambda drawn: np.nanmean(drawn, axis=(1, 2))
    >>> low, high = two_way_interval(mean, errors, rng=np.random.default_rng(1))
    >>> bool(low < errors.mean() < high)
    True
    """
    tables = [as_real(each, "cells") for each in cells]
    shape = tables[0].shape[:2] if tables else ()
    if len(shape) != 2 or 0 in shape or any(each.shape[:2] != shape for each in tables):
        raise RequestError(
            "cells are arrays of one shape (row, column, …); received shapes "
            f"{', '.join(str(each.shape) for each in tables) or 'of none'}."
        )
    count, part = whole_number(n_series, "n_series"), fraction(level, "level")
    positions = []  # of redrawn rows and columns, in circular blocks
    for size, block in zip(shape, blocks, strict=True):
        starts = rng.integers(0, size, size=(count, -(-size // block)))
        positions.append(_joined(starts, block, size) % size)
    rows, columns = positions
    step = max(1, AT_ONCE // max(each.size for each in tables))
    bounds = []
    for first in range(0, count, step):
        drawn = rows[first : first + step, :, None], columns[first : first + step, None, :]
        bounds.append(np.asarray(statistic(*(each[drawn] for each in tables)), dtype=float))
    values = np.concatenate(bounds)
    smallest = min(
        (n / block for n, block in zip(shape, blocks, strict=True) if n > 1), default=0.0
    )
    if smallest < FEWEST or np.isnan(values).all():
        return np.full(values.shape[1:], np.nan), np.full(values.shape[1:], np.nan)
    value = np.asarray(statistic(*(each[None] for each in tables)), dtype=float)[0]
    return student_interval(value, values, smallest, part, signed=signed)


def overlap_block(spans: Sequence[tuple[str, float, float]]) -> int:
    """Block length for windows that overlap: one, and how many others a window shares on average.

    Parameters
    ----------
    spans : sequence of (str, float, float)
        Run, start and end of each window.

    Returns
    -------
    int
        1 for windows apart.

    Examples
    --------
    >>> overlap_block([("a", 0, 10), ("a", 5, 15), ("a", 10, 20), ("b", 0, 10)])
    2
    """
    shared = 0.0
    for run, begin, end in spans:
        for other, first, last in spans:
            if other == run:
                shared += max(0.0, min(end, last) - max(begin, first)) / max(end - begin, 1e-12)
    return max(1, round(shared / max(len(spans), 1)))
