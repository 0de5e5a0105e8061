r"""Gram matrices of Hankel matrices from their displacement structure.

Let :math:`w_t` be a series, :math:`\hat w_j = [w_j; w_{j-1}; …]`, and let the columns j run from
a to b. Moving both lags of a block by one moves its sum over time by one sample,

.. math:: C_{l+1,l'+1} = C_{l,l'} + w_{a-1-l} w_{a-1-l'}^T - w_{b-l} w_{b-l'}^T ,

so the Gram matrix :math:`C = \hat Y \hat Y^T` is its first block row and column, a matrix of rank
two for each run, and a running sum along block diagonals: O(p²) operations instead of O(p² m). The
same holds for the blocks between states and inputs, and several runs add up.

In the other space, :math:`K = \hat Y^T \hat Y`, moving both snapshots by one adds the newest
samples and drops the oldest,

.. math:: K_{i+1,j+1} = K_{i,j} + x_{i+1}^T x_{j+1} - x_{i-s}^T x_{j-s}
          + u_{i+1}^T u_{j+1} - u_{i-z}^T u_{j-z} ,

so K is its first row, a product of rank 2(N+Q), and a running sum along diagonals: O(n² (N+Q))
instead of O(n² p). Between two runs there is a first column too.

Only upper triangles are made; what stands below the diagonal is not meaningful.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from seakeep.core.lagged import lagged_response, lagged_sums, recent

__all__ = ["Piece", "PrimalSystem", "gram_trace", "primal_system", "snapshot_gram"]

FloatArray = npt.NDArray[np.float64]

PANEL = 64
"""Rows, about, in which a Gram matrix is made: few enough to stay in cache."""


@dataclass(frozen=True, eq=False)
class Piece:
    """One run of the regression.

    Parameters
    ----------
    states, inputs : ndarray, shapes (time, N) and (time, Q)
        Series.
    first : int
        Sample of the first snapshot; its delay history lies before it.
    count : int
        Number of snapshot pairs.
    """

    states: FloatArray
    inputs: FloatArray
    first: int
    count: int

    @property
    def targets(self) -> FloatArray:
        """Newest blocks of the next snapshots, shape (count, N)."""
        return self.states[self.first + 1 : self.first + 1 + self.count]


@dataclass(frozen=True, eq=False)
class PrimalSystem:
    """Normal equations of delayed series; inputs stand before states, newest lags first.

    Parameters
    ----------
    gram : ndarray, shape (p + room, p + room)
        Upper triangle of C in its first p rows and columns, p = Q(z+1) + N(s+1).
    right : ndarray, shape (N, p)
        Products of the next states (the newest block alone) with the regressors.
    heads : ndarray, shape (Q + N, p)
        Rows of C of the newest inputs and states.
    edges : ndarray, shape (2 runs, p)
        What enters at the begin (even rows) and leaves at the end (odd rows) of a run where a
        block moves by a lag.
    states, channels, inputs : int
        N, Q and Q(z+1).
    """

    gram: FloatArray
    right: FloatArray
    heads: FloatArray
    edges: FloatArray
    states: int
    channels: int
    inputs: int


def gram_trace(pieces: Sequence[Piece], state_delays: int, input_delays: int) -> float:
    """Sum of squares of the Hankel matrix: the trace of its Gram matrix.

    Parameters
    ----------
    pieces : sequence of Piece
        Runs.
    state_delays, input_delays : int
        s and z.

    Returns
    -------
    float
        It bounds the largest squared singular value from above.
    """
    total = 0.0
    for piece in pieces:
        for series, delays in ((piece.states, state_delays), (piece.inputs, input_delays)):
            # Only what the snapshots reach: what stands before may be a gap.
            reached = series[piece.first - delays : piece.first + piece.count]
            energy = np.zeros(len(reached) + 1)
            np.cumsum(np.einsum("tc,tc->t", reached, reached), out=energy[1:])
            total += float(np.sum(energy[piece.count :]) - np.sum(energy[: delays + 1]))
    return total


def primal_system(
    pieces: Sequence[Piece],
    state_delays: int,
    input_delays: int,
    room: int = 0,
) -> PrimalSystem:
    r"""Gram matrix :math:`\hat Y \hat Y^T` and right-hand side :math:`X' \hat Y^T`.

    Parameters
    ----------
    pieces : sequence of Piece
        Runs.
    state_delays, input_delays : int
        s and z.
    room : int, optional
        Rows and columns beyond the Gram matrix, for right-hand sides.

    Returns
    -------
    PrimalSystem
        Gram matrix, right-hand side, heads and edges.
    """
    s, z = state_delays, input_delays
    N, Q = pieces[0].states.shape[1], pieces[0].inputs.shape[1]
    inputs = Q * (z + 1)
    size = inputs + N * (s + 1)
    edges = np.zeros((2 * len(pieces), size))
    heads = np.zeros((Q + N, size))
    right = np.zeros((N, size))
    for number, piece in enumerate(pieces):
        x, u, start = piece.states, piece.inputs, piece.first
        end = start + piece.count - 1
        # One more lag and one column less than the heads need: the sums of the next states are
        # the same sums one lag later, up to one product at either end.
        newest = np.concatenate([u[start + 1 : end + 1], x[start + 1 : end + 1]], axis=1)
        sums_u = lagged_sums(newest, u, start + 1, z + 2)
        sums_x = lagged_sums(newest, x, start + 1, s + 2)
        snapshot = np.concatenate([recent(u, start, z + 1), recent(x, start, s + 1)])
        heads += np.concatenate([u[start], x[start]])[:, None] * snapshot
        heads[:, :inputs] += sums_u[:, : Q * (z + 1)]
        heads[:, inputs:] += sums_x[:, : N * (s + 1)]
        snapshot = np.concatenate([recent(u, end, z + 1), recent(x, end, s + 1)])
        right += x[end + 1][:, None] * snapshot
        right[:, :inputs] += sums_u[Q:, Q:]
        right[:, inputs:] += sums_x[Q:, N:]
        for row, at in ((edges[2 * number], start - 1), (edges[2 * number + 1], end)):
            row[Q:inputs] = recent(u, at, z)
            row[inputs + N :] = recent(x, at, s)
    gram = np.empty((size + room, size + room))
    _fill_primal(gram[:size, :size], heads, edges, N, Q, inputs)
    return PrimalSystem(gram, right, heads, edges, N, Q, inputs)


def _fill_primal(
    gram: FloatArray, heads: FloatArray, edges: FloatArray, N: int, Q: int, inputs: int
) -> None:
    # Panel by panel: the product of the edges from the panel's diagonal block on, heads over it,
    # then the running sums while it is in cache. Sums take whole blocks, so that of the diagonal
    # blocks the lower halves are made too; what is left of them is memory as it was found, and
    # must never be read.
    size = len(gram)
    signed = edges.copy()
    signed[1::2] *= -1.0
    for begin, stop in _panels(0, inputs, Q):
        np.matmul(edges[:, begin:stop].T, signed[:, begin:], out=gram[begin:stop, begin:])
        gram[begin:stop, inputs : inputs + N] = heads[Q:, begin:stop].T
        if begin == 0:
            gram[:Q] = heads[:Q]
        for at in range(max(begin, Q), stop, Q):
            block = gram[at : at + Q, at:inputs]
            block += gram[at - Q : at, at - Q : inputs - Q]
    for at in range(inputs + N, size, N):
        gram[Q:inputs, at : at + N] += gram[: max(inputs - Q, 0), at - N : at]
    for begin, stop in _panels(inputs, size, N):
        np.matmul(edges[:, begin:stop].T, signed[:, begin:], out=gram[begin:stop, begin:])
        if begin == inputs:
            gram[inputs : inputs + N, inputs:] = heads[Q:, inputs:]
        for at in range(max(begin, inputs + N), stop, N):
            gram[at : at + N, at:] += gram[at - N : at, at - N : size - N]


def snapshot_gram(
    pieces: Sequence[Piece],
    state_delays: int,
    input_delays: int,
    room: int = 0,
) -> FloatArray:
    r"""Gram matrix :math:`\hat Y^T \hat Y` of the snapshots of all runs.

    Parameters
    ----------
    pieces : sequence of Piece
        Runs.
    state_delays, input_delays : int
        s and z.
    room : int, optional
        Rows and columns beyond the Gram matrix, for right-hand sides.

    Returns
    -------
    ndarray, shape (n + room, n + room)
        Its upper triangle in the first n rows and columns, n the number of snapshot pairs of all
        runs.
    """
    s, z = state_delays, input_delays
    N, Q = pieces[0].states.shape[1], pieces[0].inputs.shape[1]
    ends = np.cumsum([0, *(piece.count for piece in pieces)])
    steps = np.empty((ends[-1], 2 * (N + Q)))
    for piece, begin, stop in zip(pieces, ends[:-1], ends[1:], strict=True):
        rows, first, count = steps[begin:stop], piece.first, piece.count
        rows[0] = 0.0
        rows[1:, :N] = piece.states[first + 1 : first + count]
        rows[1:, N : N + Q] = piece.inputs[first + 1 : first + count]
        rows[1:, N + Q : 2 * N + Q] = piece.states[first - s : first - s + count - 1]
        rows[1:, 2 * N + Q :] = piece.inputs[first - z : first - z + count - 1]
    signed = np.ascontiguousarray(steps.T)
    signed[N + Q :] *= -1.0
    heads = np.empty((len(pieces), len(steps)))
    for own, head in zip(pieces, heads, strict=True):
        own_x = recent(own.states, own.first, s + 1)
        own_u = recent(own.inputs, own.first, z + 1)
        for piece, begin, stop in zip(pieces, ends[:-1], ends[1:], strict=True):
            head[begin:stop] = lagged_response(piece.states, own_x, piece.first, piece.count)
            head[begin:stop] += lagged_response(piece.inputs, own_u, piece.first, piece.count)
    size = len(steps)
    gram = np.empty((size + room, size + room))
    _fill_snapshots(gram[:size, :size], heads, steps, signed, ends)
    return gram


def _fill_snapshots(
    gram: FloatArray,
    heads: FloatArray,
    steps: FloatArray,
    signed: FloatArray,
    ends: npt.NDArray[np.int64],
) -> None:
    # As above, with blocks of one; each run has a first row, and a first column above it.
    runs = list(pairwise(ends.tolist()))
    for run, (first, last) in enumerate(runs):
        others, above = runs[run + 1 :], gram[first, first:last]
        for begin, stop in _panels(first, last, 1):
            np.matmul(steps[begin:stop], signed[:, begin:], out=gram[begin:stop, begin:])
            if begin == first:
                gram[first, first:] = heads[run, first:]
            for later in range(run + 1, len(runs)):
                gram[begin:stop, runs[later][0]] = heads[later, begin:stop]
            for at in range(max(begin, first + 1), stop):
                row = gram[at, at:last]
                np.add(row, above[:-1], out=row)
                above = row
                for other, end in others:
                    row = gram[at, other + 1 : end]
                    row += gram[at - 1, other : end - 1]


def _panels(begin: int, end: int, block: int) -> Iterator[tuple[int, int]]:
    """Ranges of about ``PANEL`` rows, in whole blocks."""
    height = max(block, PANEL // max(block, 1) * block)
    for at in range(begin, end, max(height, 1)):
        yield at, min(at + height, end)
