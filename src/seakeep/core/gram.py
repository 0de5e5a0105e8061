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

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from seakeep.core.lagged import lagged_response, lagged_sums, recent
from seakeep.core.scratch import Scratch

__all__ = ["Piece", "PrimalSystem", "gram_trace", "primal_system", "snapshot_gram"]

FloatArray = npt.NDArray[np.float64]

PANELS = 4
"""Pieces in which the upper triangle of a product is made."""


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
    gram : ndarray, shape (p, p)
        Upper triangle of C, p = Q(z+1) + N(s+1).
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
    pieces: Sequence[Piece], state_delays: int, input_delays: int, scratch: Scratch
) -> PrimalSystem:
    r"""Gram matrix :math:`\hat Y \hat Y^T` and right-hand side :math:`X' \hat Y^T`.

    Parameters
    ----------
    pieces : sequence of Piece
        Runs.
    state_delays, input_delays : int
        s and z.
    scratch : Scratch
        Memory.

    Returns
    -------
    PrimalSystem
        Its Gram matrix is part of `scratch`.
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
        sums_u = lagged_sums(newest, u, start + 1, z + 2, scratch)
        sums_x = lagged_sums(newest, x, start + 1, s + 2, scratch)
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
    signed = edges.copy()
    signed[1::2] *= -1.0
    gram = scratch.take((size, size))
    # The running sums take whole blocks, so the squares on the diagonal must be there.
    _upper_product(edges.T, signed, gram, below=max(N, Q) - 1)
    _fill_primal(gram, heads, N, Q, inputs)
    return PrimalSystem(gram, right, heads, edges, N, Q, inputs)


def _fill_primal(gram: FloatArray, heads: FloatArray, N: int, Q: int, inputs: int) -> None:
    # Heads into the first block rows and columns, then running sums along block diagonals.
    gram[:Q] = heads[:Q]
    gram[:inputs, inputs : inputs + N] = heads[Q:, :inputs].T
    gram[inputs : inputs + N, inputs:] = heads[Q:, inputs:]
    size = len(gram)
    if Q:
        for at in range(Q, inputs, Q):
            row, before = gram[at : at + Q], gram[at - Q : at]
            row[:, at:inputs] += before[:, at - Q : inputs - Q]
            row[:, inputs + N :] += before[:, inputs : size - N]
    for at in range(inputs + N, size, N):
        gram[at : at + N, at:] += gram[at - N : at, at - N : size - N]


def snapshot_gram(
    pieces: Sequence[Piece], state_delays: int, input_delays: int, scratch: Scratch
) -> FloatArray:
    r"""Gram matrix :math:`\hat Y^T \hat Y` of the snapshots of all runs.

    Parameters
    ----------
    pieces : sequence of Piece
        Runs.
    state_delays, input_delays : int
        s and z.
    scratch : Scratch
        Memory; the result is part of it.

    Returns
    -------
    ndarray, shape (n, n)
        Its upper triangle, n the number of snapshot pairs of all runs.
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
    signed = steps.copy()
    signed[:, N + Q :] *= -1.0
    gram = scratch.take((len(steps), len(steps)))
    _upper_product(steps, signed.T, gram, below=0)
    for i, piece in enumerate(pieces):
        own_x = recent(piece.states, piece.first, s + 1)
        own_u = recent(piece.inputs, piece.first, z + 1)
        for j, other in enumerate(pieces):
            head = lagged_response(other.states, own_x, other.first, other.count)
            head += lagged_response(other.inputs, own_u, other.first, other.count)
            if i <= j:
                gram[ends[i], ends[j] : ends[j + 1]] = head
            else:
                gram[ends[j] : ends[j + 1], ends[i]] = head
    for i in range(len(pieces)):
        for at in range(ends[i] + 1, ends[i + 1]):
            row = gram[at, at : ends[i + 1]]
            row += gram[at - 1, at - 1 : ends[i + 1] - 1]
            for j in range(i + 1, len(pieces)):
                row = gram[at, ends[j] + 1 : ends[j + 1]]
                row += gram[at - 1, ends[j] : ends[j + 1] - 1]
    return gram


def _upper_product(left: FloatArray, right: FloatArray, out: FloatArray, below: int) -> None:
    # In panels of rows, each from its diagonal (or `below` it) on: a little more than half of the
    # product. What is left out is memory as it was found, and must never be read.
    edges = [len(out) * panel // PANELS for panel in range(PANELS + 1)]
    for begin, stop in pairwise(edges):
        first = max(0, begin - below)
        np.matmul(left[begin:stop], right[:, first:], out=out[begin:stop, first:])
