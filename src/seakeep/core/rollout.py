r"""Free runs of :math:`\hat x_{k+1} = \hat A \hat x_k + \hat B \hat u_k`, many windows at once.

Windows side by side are rows of one matrix, and several steps are one product. With delayed
inputs, those of K steps are one row :math:`v_k = [u_{k+K-1}; …; u_{k-z}]`, and

.. math:: \hat x_{k+K} = A_K \hat x_k + B_K v_k, \qquad
          [x_{k+1}; …; x_{k+K}] = O_K \hat x_k + P_K v_k .

*Square* Â: K doubles by :math:`A_{2K} = A_K A_K`, :math:`B_{2K} = [B_K\;0] + [0\;A_K B_K]`, and
the outputs of the second half are those of the first, from :math:`A_K \hat x_k + B_K v_k`. That
costs a few large products and saves many small ones.

*Exact shift* (N rows): the outputs are the state, so no :math:`A_K` is needed, and a further row
of :math:`O_K` costs little: its product with the shift moves it by N, and that with the N rows of
Â is its first block times them.

A long run is taken in pieces, so that what is held beside the result does not grow with its length.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from seakeep.arrays import FloatArray, as_real, undefined
from seakeep.errors import RequestError

Arrays = tuple[FloatArray, ...]

PIECE = 300_000
"""Numbers, about, that a piece of a long run holds at once.

Few enough that memory that was used once is used again: fresh pages cost as much as the arithmetic
on them, a third of the time of forty windows."""
OUTPUT_ROWS = 192
"""Rows of the outputs of one block of an exact-shift propagator, at most, about."""
SHIFTING_COST = (2500.0, 6000.0, 900.0)
"""Nanoseconds of a block of an exact-shift propagator beyond its product, and of one more row of
blocks when it is made: fixed, per state."""
GEMM_RATE = 50.0
"""Floating-point operations per nanosecond in products of large matrices (rough)."""
SKINNY_COST = (4000.0, 0.1, 0.055)
"""Nanoseconds of a product of a square matrix with w rows: fixed, per entry, per entry and row."""
MOST_DOUBLINGS = 6


def rollout(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    histories: npt.ArrayLike,
    inputs: npt.ArrayLike,
    *,
    n_states: int | None = None,
    direct: npt.ArrayLike | None = None,
) -> FloatArray:
    r"""Free run of one model over several windows side by side.

    Parameters
    ----------
    A : array_like, shape (N(s+1), N(s+1)) or (N, N(s+1))
        State matrix. With N rows alone the delayed states are shifted exactly.
    B : array_like, shape (rows of A, Q(z+1) + D)
        Input matrix; no columns for a model without input.
    histories : array_like, shape (window, N(s+1)) or (window, s+1, N)
        Extended states :math:`\hat x_0`, newest block first; or the samples themselves, oldest
        first.
    inputs : array_like, shape (window, steps, Q(z+1)) or (window, z + steps, Q)
        Extended inputs :math:`\hat u_0 … \hat u_{steps-1}`, newest block first; or the samples
        themselves, oldest first. A model without input takes shape (window, steps, 0).
    n_states : int, optional
        N. By default it is taken from `histories` with three axes, or from an `A` with N rows;
        for extended states and a square `A` the whole state is returned.
    direct : array_like, shape (window, steps, D), optional
        Further inputs, without delays, of the last D columns of `B`.

    Returns
    -------
    ndarray, shape (window, steps, N)
        :math:`x_1 … x_{steps}`; NaN from where a window is no longer finite on.

    Raises
    ------
    RequestError
        If shapes do not fit together.

    Examples
    --------
    >>> rollout([[0.5]], [[1.0]], [[1.0]], [[[0.0], [1.0], [0.0]]])[0, :, 0]
    array([0.5  , 1.25 , 0.625])
    """
    a, b = np.atleast_2d(as_real(A, "A")), as_real(B, "B")
    start, driving = as_real(histories, "histories"), as_real(inputs, "inputs")
    rows, size = a.shape
    count = n_states or (start.shape[2] if start.ndim == 3 else rows)
    if size % count or rows not in (count, size):
        raise RequestError(
            f"A of shape {a.shape} does not belong to {count} states: its columns must be a "
            "multiple of N, and its rows N or all of them."
        )
    fits = start.ndim == 2 or start.shape[2] == count
    if not fits or (len(start), math.prod(start.shape[1:])) != (len(driving), size):
        raise RequestError(
            f"histories {start.shape} and inputs {driving.shape} do not fit A {a.shape}: "
            f"a history has {size} values, and both have one row per window."
        )
    if start.ndim == 2:
        start = start.reshape(len(start), size // count, count)[:, ::-1]
    beside = np.empty((0, 0, 0)) if direct is None else as_real(direct, "direct")
    steps = _steps(b[:, : b.shape[1] - beside.shape[2]], driving)
    if not beside.shape[2]:
        beside = np.empty((len(start), steps, 0))
    elif beside.shape[:2] != (len(start), steps):
        raise RequestError(
            f"direct inputs of shape {beside.shape} do not stand beside {len(start)} window(s) "
            f"of {steps} steps: one row per window and step is needed."
        )
    return rollouts(a, b, [(start, driving, beside)])[0]


def rollouts(
    a: FloatArray, b: FloatArray, batches: Sequence[tuple[FloatArray, FloatArray, FloatArray]]
) -> list[FloatArray]:
    """Free runs of one model over batches of windows, each batch of a length of its own.

    What makes several steps one product is prepared once for all batches.

    Parameters
    ----------
    a, b : ndarray
        A and B of :func:`rollout`.
    batches : sequence of (ndarray, ndarray, ndarray)
        Histories and inputs of each batch as samples, oldest first, and direct inputs, shape
        (window, steps, D), as for :func:`rollout`.

    Returns
    -------
    list of ndarray, each of shape (window, steps, N)
        One per batch.
    """
    count, D = batches[0][0].shape[2], batches[0][2].shape[2]
    matrices = tuple(np.split(b, [b.shape[1] - D], axis=1))[: 1 + (D > 0)]
    channels = tuple(series.shape[2] for series in batches[0][1:])[: len(matrices)]
    windows = sum(len(direct) for *_, direct in batches)
    longest = max(direct.shape[1] for *_, direct in batches)
    out = []
    with undefined():  # a free run may overflow: it is cut off where it does
        propagator = _propagator(a, matrices, count, channels, windows, longest)
        for histories, *series in batches:
            steps = series[1].shape[1]
            if not len(histories):
                out.append(np.empty((0, steps, count)))
                continue
            start = histories[:, ::-1].reshape(len(histories), a.shape[1])
            values = _run(propagator, start, tuple(series[: len(matrices)]), steps)
            finite = np.isfinite(values)
            if not finite.all():
                gone = np.logical_or.accumulate(~finite.all(axis=2), axis=1)
                values[gone] = np.nan
            out.append(values)
    return out


def _steps(b: FloatArray, inputs: FloatArray) -> int:
    """Steps that the inputs drive; extended inputs count as channels."""
    length, width = inputs.shape[1:]
    if width == b.shape[1]:
        return int(length)
    if not width or not b.shape[1] or b.shape[1] % width:
        raise RequestError(
            f"inputs with {width} channels do not fit B of shape {b.shape}: its columns must be "
            "Q(z+1). Check the number of inputs and their delays; a model without input takes "
            "inputs of shape (window, steps, 0)."
        )
    delays = b.shape[1] // width - 1
    if length <= delays:
        raise RequestError(
            f"inputs of {length} samples do not reach one step: {delays} delays need at least "
            f"{delays + 1} samples."
        )
    return int(length - delays)


@dataclass(frozen=True, eq=False)
class _Propagator:
    """K steps as one: O, P and, where the outputs are not the state, A_K and B_K.

    Outputs stand newest first; P and B_K are one matrix for each group of inputs. `state` is A_K.
    """

    steps: int
    output_state: FloatArray
    output_input: Arrays
    state: FloatArray | None = None
    state_input: Arrays = ()


def _propagator(
    a: FloatArray, b: Arrays, count: int, channels: tuple[int, ...], windows: int, steps: int
) -> _Propagator:
    """The propagator that costs least; of one step where a longer one overflows."""
    if len(a) == count and (a.shape[1] > count or not a.any()):  # of a filter A is zero
        propagator = _shifting_propagator(a, b, channels, _shifting_steps(count, steps))
        if np.isfinite(propagator.output_state).all():
            return propagator
        return _shifting_propagator(a, b, channels, 1)
    width = sum(group.shape[1] for group in b)
    times = _doublings(len(a), width, windows, steps)
    propagator = _square_propagator(a, b, count, channels, times)
    assert propagator.state is not None
    if times and not np.isfinite(propagator.state).all():
        propagator = _square_propagator(a, b, count, channels, 0)
    return propagator


def _shifting_steps(states: int, steps: int) -> int:
    """Steps of an exact-shift propagator that cost least over a free run."""
    block, row, state = SHIFTING_COST
    best = round(math.sqrt(steps * block / (row + state * states)))
    return max(1, min(steps, best, -(-OUTPUT_ROWS // states)))


def _shifting_propagator(
    a: FloatArray, b: Arrays, channels: tuple[int, ...], steps: int
) -> _Propagator:
    """Propagator of a model whose delayed states shift exactly."""
    N, size = a.shape
    output_state = np.empty((steps * N, size))
    output_input = tuple(
        np.zeros((steps * N, own.shape[1] + (steps - 1) * q))
        for own, q in zip(b, channels, strict=True)
    )
    row, at = a, (steps - 1) * N
    output_state[at:] = a
    # P of step i: û of the i-th instant enters through B̂, older ones through the step before.
    for out, own, q in zip(output_input, b, channels, strict=True):
        out[at:, (steps - 1) * q :] = own
    for step in range(1, steps):
        head = row[:, :N]
        moved = head @ a
        moved[:, : size - N] += row[:, N:]
        previous, at, row = at, at - N, moved
        output_state[at : at + N] = row
        # Later inputs stand further left: the response of the step before, moved, and one more.
        for out, own, q in zip(output_input, b, channels, strict=True):
            start, width = (steps - 1 - step) * q, own.shape[1]
            out[at : at + N, start : start + width + (step - 1) * q] = out[
                previous : previous + N, start + q :
            ]
            out[at : at + N, start + step * q :] += head @ own
    return _Propagator(steps, output_state, output_input)


def _doublings(size: int, inputs: int, windows: int, steps: int) -> int:
    """How often to double the step of a square model so that the free run costs least."""
    fixed, entry, row = SKINNY_COST
    best, least, preparation = 0, np.inf, 0.0
    for times in range(MOST_DOUBLINGS + 1):
        once = fixed + size * size * (entry + row * (windows - 1))
        blocks = -(-steps // 2**times)
        forcing = 2.0 * blocks * windows * size * inputs / GEMM_RATE
        cost = preparation + blocks * once + forcing
        if cost < least:
            best, least = times, cost
        preparation += 2.0 * size * size * (size + inputs) / GEMM_RATE
    return best


def _square_propagator(
    a: FloatArray, b: Arrays, count: int, channels: tuple[int, ...], times: int
) -> _Propagator:
    """Propagator of a model with a full Â, of two to the power of `times` steps."""
    output_state, K = a[:count], 1
    output_input = tuple(own[:count] for own in b)
    for _ in range(times):
        # Newest first: the second half of the steps stands above the first.
        output_input = tuple(
            np.concatenate(
                [_later(output_state @ own, first, K * q), np.pad(first, [(0, 0), (K * q, 0)])]
            )
            for own, first, q in zip(b, output_input, channels, strict=True)
        )
        output_state = np.concatenate([output_state @ a, output_state])
        b = tuple(_later(a @ own, own, K * q) for own, q in zip(b, channels, strict=True))
        a, K = a @ a, 2 * K
    return _Propagator(K, output_state, output_input, a, b)


def _later(early: FloatArray, late: FloatArray, pad: int) -> FloatArray:
    """[late 0] + [0 early], apart by `pad` columns."""
    out = np.pad(early, [(0, 0), (pad, 0)])
    out[:, : late.shape[1]] += late
    return out


def _run(propagator: _Propagator, start: FloatArray, inputs: Arrays, steps: int) -> FloatArray:
    # In pieces of whole blocks of K steps; the state is handed on.
    windows, size = start.shape
    K, width = propagator.steps, len(propagator.output_state)
    row_width = width + sum(each.shape[1] for each in propagator.output_input)
    row_width += 0 if propagator.state is None else 2 * size
    blocks = -(-steps // K)
    most = max(1, PIECE // (row_width * windows))
    advance = _run_shifting if propagator.state is None else _run_square
    out = np.empty((windows, blocks * K, width // K))
    state = start
    for first in range(0, blocks, most):
        number = min(most, blocks - first)
        rows = tuple(
            _input_rows(each, K, matrix.shape[1], first, number)
            for each, matrix in zip(inputs, propagator.output_input, strict=True)
        )
        newest_first, state = advance(propagator, state, rows)
        piece = out[:, first * K : (first + number) * K]
        piece[:] = newest_first.reshape(piece.shape)[:, ::-1]
    return out[:, :steps]


def _input_rows(inputs: FloatArray, K: int, width: int, first: int, number: int) -> FloatArray:
    """Inputs of each block, newest first: shape (number * window, Q(z+K)); the last block first.

    Zeros stand where the last block reaches beyond the inputs; no output that is asked for sees
    them.
    """
    windows, _, channels = inputs.shape
    if width == 0:
        return np.zeros((number * windows, 0))
    delays = width // channels - K
    length = number * K + delays
    newest_first = np.zeros((windows, length, channels))
    piece = inputs[:, first * K : first * K + length]
    newest_first[:, length - piece.shape[1] :] = piece[:, ::-1]
    window, step, channel = newest_first.strides
    blocks = np.lib.stride_tricks.as_strided(
        newest_first,
        shape=(number, windows, width),
        strides=(K * step, window, channel),
        writeable=False,
    )
    return blocks.reshape(number * windows, width)


def _forced(rows: Arrays, matrices: Arrays) -> FloatArray:
    """What all groups of inputs add."""
    out = rows[0] @ matrices[0].T
    for own, matrix in zip(rows[1:], matrices[1:], strict=True):
        out += own @ matrix.T
    return out


def _run_shifting(
    propagator: _Propagator, start: FloatArray, rows: Arrays
) -> tuple[FloatArray, FloatArray]:
    # Samples lie newest first in one long row per window, so the extended state of every block is a
    # contiguous piece of it and nothing is ever moved. Rows come with the last block first too.
    windows = len(start)
    width, size = propagator.output_state.shape
    number = len(rows[0]) // windows
    forcing = _forced(rows, propagator.output_input).reshape(number, windows, width)
    samples = np.empty((windows, number * width + size))
    samples[:, number * width :] = start
    transposed = propagator.output_state.T
    for block in range(number - 1, -1, -1):
        at = block * width
        state, piece = samples[:, at + width : at + width + size], forcing[block]
        piece += state @ transposed
        samples[:, at : at + width] = piece
    return samples[:, : number * width], samples[:, :size]


def _run_square(
    propagator: _Propagator, start: FloatArray, rows: Arrays
) -> tuple[FloatArray, FloatArray]:
    windows, size = start.shape
    number = len(rows[0]) // windows
    assert propagator.state is not None
    # states[block + 1] starts block; states[0] is what the piece ends with.
    states = np.empty((number + 1, windows, size))
    states[number] = start
    states[:number] = _forced(rows, propagator.state_input).reshape(number, windows, size)
    for block in range(number - 1, -1, -1):
        states[block] += states[block + 1] @ propagator.state.T
    outputs = states[1:].reshape(-1, size) @ propagator.output_state.T
    outputs += _forced(rows, propagator.output_input)
    newest_first = outputs.reshape(number, windows, -1).transpose(1, 0, 2)
    return np.ascontiguousarray(newest_first).reshape(windows, -1), states[0]
