"""Intervals of statistics over cells that two factors cross: training sets and test windows.

Cells of one row share a training set, those of one column a test window: none of them is
independent of the others, and counting them as such makes intervals far too narrow. Rows and
columns are redrawn apart from each other, and a cell is taken wherever a drawn row meets a drawn
column (Owen, Annals of Applied Statistics 1, 2007: the pigeonhole bootstrap). Neighbours that
overlap are drawn together, in circular blocks. Student's distribution accounts for the few blocks
there are (:func:`seakeep.core.bootstrap.student_interval`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from seakeep.arrays import FloatArray, as_real, fraction, whole_number
from seakeep.core.bootstrap import student_interval
from seakeep.errors import RequestError

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
        Bounds; NaN where an axis of several cells holds fewer than three
        blocks, which say nothing of their spread. An axis of one cell is not redrawn: the
        interval is then conditional on it.

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
        drawn = (starts[:, :, None] + np.arange(block)) % size
        positions.append(drawn.reshape(count, -1)[:, :size])
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
