r"""Delay embedding: training windows, extended snapshots, their matrices and Gram matrices.

The extended vectors are :math:`\hat x_j = [x_j; x_{j-1}; …; x_{j-s}]` and
:math:`\hat u_j = [u_j; u_{j-1}; …; u_{j-z}]` (paper, equations of section HDMDc); the blocks are
lag-major, the newest first. Series are ``(time, channel)``.

Gram matrices of these Hankel matrices follow from their displacement structure. A regression of
delayed series has groups of channels, each with delays of its own. Let :math:`w_t` be a group,
:math:`\hat w_j = [w_j; w_{j-1}; …]`, and let the columns j run from a to b. Moving both lags of a
block by one moves its sum over time by one sample,

.. math:: C_{l+1,l'+1} = C_{l,l'} + w_{a-1-l} w_{a-1-l'}^T - w_{b-l} w_{b-l'}^T ,

so the Gram matrix :math:`C = \hat Y \hat Y^T` is its first block row and column, a matrix of rank
two for each run, and a running sum along block diagonals: O(p²) operations instead of O(p² m). The
same holds for the blocks between two groups, and several runs add up.

In the other space, :math:`K = \hat Y^T \hat Y`, moving both snapshots by one adds the newest
samples and drops the oldest; for groups w with delays d,

.. math:: K_{i+1,j+1} = K_{i,j} + \sum_w w_{i+1}^T w_{j+1} - w_{i-d}^T w_{j-d} ,

so K is its first row, a product of rank twice the channels, and a running sum along diagonals:
O(n²) instead of O(n² p). Between two runs there is a first column too.

First rows are sums over time of one series with another at many lags, :math:`S_l = \sum_i a_i\,
b_{k+i-l}^T`, which is :math:`a^T H` with the Hankel matrix H of b. Kept newest first in one long
row, b holds every row of H as a contiguous piece; laying d lags side by side once makes a dense
block that serves, moved down by q d rows, the lags q d … q d + d − 1. So a few products with d
times the data replace one with L times the data, and H is never built.

Only upper triangles are made; what stands below the diagonal is not meaningful.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from seakeep.arrays import FloatArray, as_real
from seakeep.errors import RequestError

History = Literal["before", "inside"]


@dataclass(frozen=True)
class TrainingWindow:
    """Which samples of a run train a model.

    Parameters
    ----------
    first, last : int
        First and last sample of the window, both included.
    first_column : int
        Sample j of the first snapshot pair (j, j+1).
    """

    first: int
    last: int
    first_column: int

    @property
    def columns(self) -> int:
        """Number of snapshot pairs; zero or less where the run is too short."""
        return self.last - self.first_column

    @property
    def samples(self) -> slice:
        """The samples of the window, from which means and standard deviations are taken."""
        return slice(self.first, self.last + 1)


def training_window(
    last: int, window: int | None, state_delays: int, input_delays: int, history: History
) -> TrainingWindow:
    """Place the window of `window` samples that ends at sample `last`.

    Parameters
    ----------
    last : int
        Last sample of the window.
    window : int or None
        Number of snapshots m; None takes all samples up to `last`.
    state_delays, input_delays : int
        s and z.
    history : {"before", "inside"}
        Whether the delay history of the first snapshot lies before the window (or, where the
        run starts too late for that, as far into it as it must), or inside it.

    Returns
    -------
    TrainingWindow
        Its ``columns`` may be zero or negative: the caller knows the names for the message.

    """
    reach = max(state_delays, input_delays)
    first = 0 if window is None else last - window + 1
    earliest = first + reach if history == "inside" else reach
    return TrainingWindow(first, last, max(first, earliest))


def embed(series: FloatArray, delays: int, first: int, count: int) -> FloatArray:
    """Extended snapshots as columns.

    Parameters
    ----------
    series : ndarray, shape (time, channel)
        Series.
    delays : int
        Number of delayed copies, s or z.
    first, count : int
        Sample of the first column, and the number of columns.

    Returns
    -------
    ndarray, shape (channel * (delays + 1), count)
        Column i holds sample ``first + i`` and the `delays` samples before it, newest first.

    Raises
    ------
    RequestError
        If the series is not an array (time, channel) of real numbers, or a column lies outside it.

    Examples
    --------
    >>> import numpy as np
    >>> embed(np.arange(5.0)[:, None], delays=1, first=1, count=4)
    array([[1., 2., 3., 4.],
           [0., 1., 2., 3.]])
    """
    series = as_real(series, "the series")
    if series.ndim != 2 or not 0 <= first - delays <= first <= first + count <= series.shape[0]:
        raise RequestError(
            f"columns {first} to {first + count - 1} with {delays} delays do not lie in a series "
            f"of shape {series.shape}; (time, channel) with all of these samples is needed."
        )
    newest_first = np.ascontiguousarray(series[first - delays : first + count][::-1])
    columns = sliding_window_view(newest_first, delays + 1, axis=0)[::-1]
    return columns.transpose(0, 2, 1).reshape(count, -1).T


def block_means(series: FloatArray, blocks: Sequence[tuple[int, int]]) -> FloatArray:
    """Means of a series over blocks of lags.

    Parameters
    ----------
    series : ndarray, shape (time, channel)
        Samples; missing ones count as zero.
    blocks : sequence of (int, int)
        Of each block the lag before its first, and its last.

    Returns
    -------
    ndarray, shape (time, channels of each block)
        Zero where a block begins before the series.
    """
    total = np.cumsum(np.nan_to_num(series), axis=0)
    total = np.concatenate([np.zeros((1, series.shape[1])), total])
    out = np.zeros((len(series), len(blocks), series.shape[1]))
    for number, (before, last) in enumerate(blocks):
        sums = total[last - before : len(series) - before] - total[: max(len(series) - last, 0)]
        out[last:, number] = sums / (last - before)
    return out.reshape(len(series), -1)


def spread_means(
    coefficients: FloatArray, states: int, delays: int, blocks: Sequence[tuple[int, int]]
) -> FloatArray:
    """Coefficients of delayed states instead of :func:`block_means`, on the last axis.

    Parameters
    ----------
    coefficients : ndarray, shape (…, N(s+1) + others + N · blocks)
        Of the states, of other regressors, and of the means.
    states, delays : int
        N and s, where the first block begins after.
    blocks : sequence of (int, int)
        The blocks, side by side.

    Returns
    -------
    ndarray, shape (…, N(last + 1) + others)
        Each mean is a sum of delayed states of equal weights.
    """
    size, end = states * (delays + 1), coefficients.shape[-1] - states * len(blocks)
    parts = [coefficients[..., :size]]
    for number, (before, last) in enumerate(blocks):
        own = coefficients[..., end + number * states : end + (number + 1) * states]
        parts.append(np.tile(own / (last - before), last - before))
    return np.concatenate([*parts, coefficients[..., size:end]], axis=-1)


BLOCK_WIDTH = 96
"""Columns of the block of lags that is laid out: wide enough for BLAS, small enough for cache."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One run of the regression.

    Parameters
    ----------
    states : ndarray, shape (time, N)
        Targets: each snapshot is followed by the next sample.
    series : tuple of ndarray, each (time, channel)
        Its groups of regressors; where states are among them, they are the first.
    first : int
        Sample of the first snapshot; its delay history lies before it.
    count : int
        Number of snapshot pairs.
    """

    states: FloatArray
    series: tuple[FloatArray, ...]
    first: int
    count: int

    @property
    def targets(self) -> FloatArray:
        """Newest blocks of the next snapshots, shape (count, N)."""
        return self.states[self.first + 1 : self.first + 1 + self.count]


class Group(NamedTuple):
    """Where a group stands among the regressors: from row `start` to `stop`, newest lag first.

    `head` is the place of its channels among the newest samples of all groups; `newest` are its
    rows of lag zero, `older` those of the other lags, and `newer` those of all lags but the last:
    `older` moved up by one lag.
    """

    channels: int
    lags: int
    start: int
    stop: int
    head: slice
    rows: slice
    newest: slice
    older: slice
    newer: slice


def lay_out(channels: Iterable[int], lags: Iterable[int]) -> tuple[Group, ...]:
    """Place groups of so many channels and lags below each other."""
    groups = []
    stop = head = 0
    for width, count in zip(channels, lags, strict=True):
        start, stop, head = stop, stop + width * count, head + width
        places = (start, stop), (start, start + width), (start + width, stop), (start, stop - width)
        own = slice(head - width, head)
        groups.append(Group(width, count, start, stop, own, *(slice(*each) for each in places)))
    return tuple(groups)


class Delayed:
    """A regression of delayed series: snapshot pairs of several runs, and delays of each group.

    Parameters
    ----------
    states : sequence of ndarray, each (time, N)
        States of the runs.
    groups : sequence of (sequence of ndarray, int)
        Series by run and delays of each group; one may have no channel, and is left out.
    windows : sequence of TrainingWindow
        The samples of each run that train.

    Attributes
    ----------
    groups : tuple of Group
        Places of the groups; the first ends with the extended state.
    rows, columns : int
        Number of regressors and of snapshot pairs.
    """

    def __init__(
        self,
        states: Sequence[FloatArray],
        groups: Sequence[tuple[Sequence[FloatArray], int]],
        windows: Sequence[TrainingWindow],
    ) -> None:
        there = [(runs, delays) for runs, delays in groups if runs[0].shape[1]]
        self.delays = [delays for _, delays in there]
        self.pieces = [
            Piece(x, tuple(runs[run] for runs, _ in there), window.first_column, window.columns)
            for run, (x, window) in enumerate(zip(states, windows, strict=True))
        ]
        channels = (runs[0].shape[1] for runs, _ in there)
        self.groups = lay_out(channels, (delay + 1 for delay in self.delays))
        self.rows = self.groups[-1].stop
        self.columns = sum(piece.count for piece in self.pieces)


def _sum_down(gram: FloatArray, heads: FloatArray, groups: Sequence[Group]) -> None:
    """Set the first block row and column of each group to `heads`, and sum along the diagonals."""
    for number, group in enumerate(groups):
        later, N = groups[number + 1 :], group.channels
        gram[group.newest, group.start :] = heads[group.head, group.start :]
        for other in later:
            gram[group.rows, other.newest] = heads[other.head, group.rows].T
        for at in range(group.start + N, group.stop, N):
            row = gram[at : at + N, at : group.stop]
            row += gram[at - N : at, at - N : group.stop - N]
            for other in later:
                row = gram[at : at + N, other.older]
                row += gram[at - N : at, other.newer]


@dataclass(frozen=True, eq=False)
class PrimalSystem:
    """Normal equations of delayed series.

    Parameters
    ----------
    gram : ndarray, shape (p, p)
        Upper triangle of C.
    right : ndarray, shape (N, p)
        Products of the next states (the newest block alone) with the regressors.
    heads : ndarray, shape (channels, p)
        Rows of C of the newest samples of all groups.
    edges : ndarray, shape (2 runs, p)
        What enters at the start (even rows) and leaves at the end (odd rows) of a run where a
        block moves by a lag.
    groups : tuple of Group
        Places of the groups.
    """

    gram: FloatArray
    right: FloatArray
    heads: FloatArray
    edges: FloatArray
    groups: tuple[Group, ...]

    @property
    def whole(self) -> FloatArray:
        """Both triangles of C."""
        return np.triu(self.gram) + np.triu(self.gram, 1).T


def gram_trace(problem: Delayed) -> float:
    """Trace of the Gram matrix, which bounds the largest squared singular value from above."""
    total = 0.0
    for piece in problem.pieces:
        for series, delay in zip(piece.series, problem.delays, strict=True):
            # Only what the snapshots reach: what stands before may be a gap.
            reached = series[piece.first - delay : piece.first + piece.count]
            # Each sample counts as often as there are lags at which a snapshot holds it.
            up = np.arange(1.0, len(reached) + 1)
            times = np.minimum(np.minimum(up, up[::-1]), min(piece.count, delay + 1))
            total += float(times @ np.einsum("tc,tc->t", reached, reached))
    return total


def primal_system(problem: Delayed) -> PrimalSystem:
    r"""Gram matrix :math:`\hat Y \hat Y^T` and right-hand side :math:`X' \hat Y^T`."""
    pieces, groups = problem.pieces, problem.groups
    size, width = problem.rows, groups[-1].head.stop
    edges, heads = np.zeros((2 * len(pieces), size)), np.zeros((width, size))
    N = pieces[0].states.shape[1]
    right = np.zeros((N, size))
    # States among the regressors are targets of an instant before too.
    is_shared = pieces[0].series[0] is pieces[0].states
    targets = slice(N) if is_shared else slice(width, width + N)
    for piece, entering, leaving in zip(pieces, edges[::2], edges[1::2], strict=True):
        start, end = piece.first, piece.first + piece.count - 1
        current = piece.series if is_shared else (*piece.series, piece.states)
        newest = np.concatenate([x[start + 1 : end + 1] for x in current], axis=1)
        first = np.concatenate([x[start] for x in piece.series])[:, None]
        following = piece.states[end + 1][:, None]
        for x, group in zip(piece.series, groups, strict=True):
            # One more lag and one column less than the heads need: the sums of the next states
            # are the same sums one lag later, up to one product at either end.
            sums = lagged_sums(newest, x, start + 1, group.lags + 1)
            heads[:, group.rows] += first * _recent(x, start, group.lags)
            heads[:, group.rows] += sums[:width, : group.stop - group.start]
            right[:, group.rows] += following * _recent(x, end, group.lags)
            right[:, group.rows] += sums[targets, group.channels :]
            entering[group.older] = _recent(x, start - 1, group.lags - 1)
            leaving[group.older] = _recent(x, end, group.lags - 1)
    # The product of the edges, heads over it, then the running sums.
    signed = edges.copy()
    signed[1::2] *= -1.0
    gram = edges.T @ signed
    _sum_down(gram, heads, groups)
    return PrimalSystem(gram, right, heads, edges, groups)


def snapshot_gram(problem: Delayed) -> FloatArray:
    r"""Gram matrix :math:`\hat Y^T \hat Y` of the snapshots of all runs."""
    pieces, groups = problem.pieces, problem.groups
    width = groups[-1].head.stop
    counts = [piece.count for piece in pieces]
    ends = np.cumsum([0, *counts])
    steps = np.zeros((ends[-1], 2 * width))
    for piece, begin, stop in zip(pieces, ends[:-1], ends[1:], strict=True):
        rows, first, count = steps[begin:stop], piece.first, piece.count
        for x, delay, group in zip(piece.series, problem.delays, groups, strict=True):
            rows[1:, group.head] = x[first + 1 : first + count]
            rows[1:, width:][:, group.head] = x[first - delay : first - delay + count - 1]
    signed = np.ascontiguousarray(steps.T)
    signed[width:] *= -1.0
    heads = np.zeros((len(pieces), len(steps)))
    for own, head in zip(pieces, heads, strict=True):
        newest = [
            _recent(x, own.first, group.lags) for x, group in zip(own.series, groups, strict=True)
        ]
        for piece, begin, stop in zip(pieces, ends[:-1], ends[1:], strict=True):
            for x, weights in zip(piece.series, newest, strict=True):
                head[begin:stop] += lagged_response(x, weights, piece.first, piece.count)
    gram = steps @ signed
    _sum_down(gram, heads, lay_out([1] * len(pieces), counts))
    return gram


def _recent(series: FloatArray, at: int, lags: int) -> FloatArray:
    """Sample `at` and those before it, newest first, in one row."""
    return series[at - lags + 1 : at + 1][::-1].reshape(-1)


def lagged_sums(left: FloatArray, series: FloatArray, first: int, lags: int) -> FloatArray:
    r"""Sums :math:`\sum_i a_i\, b_{k+i-l}^T` for the lags l = 0 … `lags` − 1.

    `left` is a, shape (count, rows), `series` b, and `first` the sample k of the series that
    stands beside the first row of `left` at lag zero. The sums stand side by side, lag zero first.
    """
    count, channels = left.shape[0], series.shape[1]
    out = np.empty((left.shape[1], lags * channels))
    blocks = -(-lags // max(1, BLOCK_WIDTH // channels))
    depth = -(-lags // blocks)
    rows = count + (blocks - 1) * depth
    newest_first = np.zeros((rows + depth - 1, channels))
    newest_first[: count + lags - 1] = series[first - lags + 1 : first + count][::-1]
    laid_out = np.ascontiguousarray(
        np.lib.stride_tricks.as_strided(
            newest_first,
            shape=(rows, depth * channels),
            strides=newest_first.strides,
            writeable=False,
        )
    )
    turned = np.ascontiguousarray(left[::-1].T)
    for block in range(blocks):
        at = block * depth
        width = min(depth, lags - at) * channels
        np.matmul(
            turned,
            laid_out[at : at + count, :width],
            out=out[:, at * channels : at * channels + width],
        )
    return out


def lagged_response(series: FloatArray, weights: FloatArray, first: int, count: int) -> FloatArray:
    r"""Response :math:`\sum_l g_l^T b_{k+i-l}` for i = 0 … `count` − 1.

    `series` is b, `weights` g in one row, with lag zero first, and `first` the sample k.
    """
    lags = weights.size // series.shape[1]
    reached = series[first - lags + 1 : first + count]
    out = np.zeros(count)
    for channel, own in zip(reached.T, weights.reshape(lags, -1).T, strict=True):
        out += np.convolve(channel, own, mode="valid")
    return out
