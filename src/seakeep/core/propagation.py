r"""Propagators of several steps: one product where a loop would take K.

For :math:`\hat x_{k+1} = \hat A \hat x_k + \hat B \hat u_k` with delayed inputs, the inputs of K
steps are one row :math:`v_k = [u_{k+K-1}; …; u_{k-z}]`, and

.. math:: \hat x_{k+K} = A_K \hat x_k + B_K v_k, \qquad
          [x_{k+1}; …; x_{k+K}] = O_K \hat x_k + P_K v_k .

*Square* Â: K doubles by :math:`A_{2K} = A_K A_K`, :math:`B_{2K} = [B_K\;0] + [0\;A_K B_K]`, and
the outputs of the second half are those of the first, from :math:`A_K \hat x_k + B_K v_k`. That
costs a few large products and saves many small ones; :func:`doublings` weighs them.

*Mirrored* Â: ridge on all rows makes those of the delayed states :math:`P - \lambda P (C + \lambda
I)^{-1}`, so they are symmetric but for their last N columns. One window alone is bound by reading
Â from memory, and half of it need not be read: :func:`mirrored` finds that half.

*Exact shift* (N rows): the outputs are the state, so no :math:`A_K` is needed, and a further row
of :math:`O_K` costs little: its product with the shift moves it by N, and that with the N rows of
Â is its first block times them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from seakeep.core.scratch import LINE, Scratch

__all__ = [
    "Propagator",
    "doublings",
    "mirrored",
    "shifting_propagator",
    "shifting_steps",
    "square_propagator",
    "step_cost",
]

FloatArray = npt.NDArray[np.float64]

OUTPUT_ROWS = 192
"""Rows of the outputs of one step of an exact-shift propagator, at most, about."""
SHIFTING_COST = (2500.0, 6000.0, 900.0)
"""Nanoseconds of a step of an exact-shift propagator beyond its product, and of one more row of
blocks when it is made: fixed, per state."""

GEMM_RATE = 50.0
"""Products of large matrices, multiply-adds in double-operations per nanosecond (rough)."""
SKINNY_COST = (4000.0, 0.1, 0.055)
"""Nanoseconds of a product of a square matrix with w rows: fixed, per entry, per entry and row."""
MIRRORED_COST = (2000.0, 0.065)
"""Nanoseconds of a step with half of Â: fixed, per entry."""
MOST_DOUBLINGS = 6
TILE = 96
"""Side of the squares in which a matrix is compared with its mirror image."""


@dataclass(frozen=True, eq=False)
class Propagator:
    """Several steps as one.

    Parameters
    ----------
    steps : int
        K.
    output_state, output_input : ndarray, shapes (K N, N(s+1)) and (K N, Q(z+K))
        O and P; the newest output first.
    state, state_input : ndarray or None
        A_K and B_K; None where the outputs themselves are the state (exact shift).
    """

    steps: int
    output_state: FloatArray
    output_input: FloatArray
    state: FloatArray | None = None
    state_input: FloatArray | None = None


def shifting_propagator(a: FloatArray, b: FloatArray, channels: int, steps: int) -> Propagator:
    """Propagator of a model whose delayed states shift exactly.

    Parameters
    ----------
    a : ndarray, shape (N, N(s+1))
        Rows of Â for the newest block.
    b : ndarray, shape (N, Q(z+1))
        Rows of B̂ for it.
    channels : int
        Q.
    steps : int
        Most steps of the free run.

    Returns
    -------
    Propagator
        Of as many steps as cost least, and about ``OUTPUT_ROWS / N`` at most.
    """
    N, size = a.shape
    K = shifting_steps(N, steps)
    width = b.shape[1]
    output_state = np.empty((K * N, size), a.dtype)
    output_input = np.zeros((K * N, width + (K - 1) * channels), a.dtype)
    row, at = a, (K - 1) * N
    output_state[at:] = a
    # P of step i: û of the i-th instant enters through B̂, older ones through the step before.
    output_input[at:, (K - 1) * channels :] = b
    for step in range(1, K):
        head = row[:, :N]
        moved = head @ a
        moved[:, : size - N] += row[:, N:]
        previous, at, row = at, at - N, moved
        output_state[at : at + N] = row
        # Later inputs stand further left: the response of the step before, moved, and one more.
        begin = (K - 1 - step) * channels
        output_input[at : at + N, begin : begin + width + (step - 1) * channels] = output_input[
            previous : previous + N, begin + channels :
        ]
        output_input[at : at + N, begin + step * channels :] += head @ b
    return Propagator(K, output_state, output_input)


def shifting_steps(states: int, steps: int) -> int:
    """Steps of an exact-shift propagator that cost least over a free run.

    Parameters
    ----------
    states : int
        N.
    steps : int
        Steps of the free run.

    Returns
    -------
    int
        K, at most about ``OUTPUT_ROWS / N``.
    """
    step, fixed, state = SHIFTING_COST
    best = round(math.sqrt(steps * step / (fixed + state * states)))
    return max(1, min(steps, best, -(-OUTPUT_ROWS // states)))


def step_cost(size: int, windows: int, width: float = 1.0) -> float:
    """Estimate of the time of one step of `windows` rows with a square matrix, ns.

    `width` is the size of a number beside one in double precision.
    """
    fixed, entry, row = SKINNY_COST
    return fixed + width * size * size * (entry + row * (windows - 1))


def doublings(
    size: int, inputs: int, windows: int, steps: int, width: float = 1.0
) -> tuple[int, float]:
    """How often to double the step of a square model so that the free run costs least.

    Parameters
    ----------
    size, inputs : int
        Columns of Â and B̂.
    windows, steps : int
        Windows side by side, and their steps.
    width : float, optional
        Size of a number beside one in double precision.

    Returns
    -------
    times : int
        Number of doublings; K is two to its power.
    cost : float
        Estimate of the time, ns.
    """
    once, rate = step_cost(size, windows, width), GEMM_RATE / width
    best, least, preparation = 0, np.inf, 0.0
    for count in range(MOST_DOUBLINGS + 1):
        blocks = -(-steps // 2**count)
        forcing = 2.0 * blocks * windows * size * inputs / rate
        cost = preparation + blocks * once + forcing
        if cost < least:
            best, least = count, cost
        preparation += 2.0 * size * size * (size + inputs) / rate
    return best, least


def mirrored(
    a: FloatArray, inputs: int, count: int, steps: int, scratch: Scratch
) -> FloatArray | None:
    """Rows of Â for the delayed states as the upper triangle of a symmetric matrix.

    Parameters
    ----------
    a : ndarray, shape (N(s+1), N(s+1))
        Â.
    inputs, count, steps : int
        Columns of B̂, N, and the steps of the one window.
    scratch : Scratch
        Memory; the result is part of it.

    Returns
    -------
    ndarray, shape (padded, padded), or None
        Its first Ns rows, padded by zeros to whole lines of cache (BLAS is a tenth faster on
        them); None where Â is not of this kind, or several steps at once cost less.
    """
    size = len(a)
    kept = size - count
    fixed, entry = MIRRORED_COST
    cost = steps * (fixed + entry * size * size + 2.0 * size * inputs / GEMM_RATE)
    block = a[count:, :kept]
    # In single precision BLAS is no faster with half of a matrix than with all of it.
    if a.dtype == np.float32 or kept == 0 or cost > doublings(size, inputs, 1, steps)[1]:
        return None
    # Square by square, so that a block and its mirror image lie in cache together.
    for row in range(0, kept, TILE):
        for column in range(0, row + 1, TILE):
            tile = block[row : row + TILE, column : column + TILE]
            if not np.array_equal(tile, block[column : column + TILE, row : row + TILE].T):
                return None
    padded = size + (-size) % LINE
    out: FloatArray = scratch.take((padded, padded))
    out[:kept, :size] = a[count:]
    out[:kept, size:] = 0.0
    out[kept:] = 0.0
    return out


def square_propagator(
    a: FloatArray, b: FloatArray, count: int, channels: int, times: int, scratch: Scratch
) -> Propagator:
    """Propagator of a model with a full Â, of two to the power of `times` steps.

    Parameters
    ----------
    a, b : ndarray, shapes (N(s+1), N(s+1)) and (N(s+1), Q(z+1))
        Â and B̂.
    count, channels : int
        N and Q.
    times : int
        Number of doublings.
    scratch : Scratch
        Memory; the result is part of it.

    Returns
    -------
    Propagator
        With state matrices.
    """
    output_state, output_input, K = a[:count], b[:count], 1
    for _ in range(times):
        pad = K * channels
        width = b.shape[1]
        wider_output = np.zeros((2 * len(output_state), width + pad), a.dtype)
        half = len(output_state)
        # Newest first: the second half of the steps stands above the first.
        wider_output[:half, pad:] = output_state @ b
        wider_output[:half, :width] += output_input
        wider_output[half:, pad:] = output_input
        output_state = np.concatenate([output_state @ a, output_state])
        output_input = wider_output
        wider = scratch.take((len(b), width + pad), a.dtype)
        squared = scratch.take(a.shape, a.dtype)
        wider[:, :pad] = 0.0
        np.matmul(a, b, out=wider[:, pad:])
        wider[:, :width] += b
        np.matmul(a, a, out=squared)
        a, b, K = squared, wider, 2 * K
    return Propagator(K, output_state, output_input, a, b)
