r"""Free runs of :math:`\hat x_{k+1} = \hat A \hat x_k + \hat B \hat u_k`, many windows at once.

Windows side by side are rows of one matrix, and several steps are one product
(:mod:`seakeep.core.propagation`). Several windows of a model with a full Â share its response to an
impulse (:mod:`seakeep.core.superposition`). A long run is taken in pieces, so that what is held
beside the result does not grow with its length.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import blas

from seakeep.core.propagation import (
    Propagator,
    doublings,
    mirrored,
    shifting_propagator,
    square_propagator,
)
from seakeep.core.scratch import Scratch
from seakeep.core.superposition import (
    convolve,
    grows,
    impulse_states,
    state_at_rest,
    superposition_cost,
)
from seakeep.errors import RequestError

__all__ = ["rollout"]

FloatArray = npt.NDArray[np.float64]

PIECE = 4_000_000
"""Numbers, about, that a piece of a long run holds at once."""
SYMMETRIC = 1e-8
"""Part of its largest entry by which a symmetric matrix may differ from its mirror image."""


def rollout(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    histories: npt.ArrayLike,
    inputs: npt.ArrayLike,
    *,
    n_states: int | None = None,
    scratch: Scratch | None = None,
) -> FloatArray:
    r"""Free run of one model over several windows side by side.

    Parameters
    ----------
    A : array_like, shape (N(s+1), N(s+1)) or (N, N(s+1))
        State matrix. With N rows alone the delayed states are shifted exactly. One of type
        float32 asks for single precision throughout.
    B : array_like, shape (rows of A, Q(z+1))
        Input matrix; no columns for a model without input.
    histories : array_like, shape (window, N(s+1)) or (window, s+1, N)
        Extended states :math:`\hat x_0`, newest block first; or the samples themselves, oldest
        first.
    inputs : array_like, shape (window, steps, Q(z+1)) or (window, z + steps, Q)
        Extended inputs :math:`\hat u_0 … \hat u_{steps-1}`, newest block first; or the samples
        themselves, oldest first. A model without input takes shape (window, steps, 0).
    n_states : int, optional
        N. By default it is read from `histories` with three axes, or from an `A` with N rows, or
        from the lower rows of a square `A`: an exact shift, or regressed rows, which are a
        symmetric matrix but for their last N columns. A square `A` that is neither has no delays
        that could be told, and its whole state is returned. Give N where `A` has two rows and was
        regressed: one number is always symmetric.
    scratch : Scratch, optional
        Memory of an earlier call to use again.

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
    kind = np.float32 if np.asarray(A).dtype == np.float32 else np.float64
    arrays: list[FloatArray] = [np.asarray(each, kind) for each in (A, B, histories, inputs)]
    a, b, start, driving = np.atleast_2d(arrays[0]), *arrays[1:]
    if start.ndim not in (2, 3) or driving.ndim != 3 or b.ndim != 2 or len(b) != len(a):
        raise RequestError(
            "rollout needs A (rows, N(s+1)), B (rows, Q(z+1)), histories (window, N(s+1)) or "
            "(window, s+1, N), inputs (window, steps, Q(z+1)) or (window, z+steps, Q); received "
            f"{a.shape}, {b.shape}, {start.shape}, {driving.shape}."
        )
    count = _count_states(a, b, start, n_states)
    if start.ndim == 3:
        start = start[:, ::-1].reshape(len(start), start.shape[1] * start.shape[2])
    if start.shape[1] != a.shape[1] or start.shape[0] != driving.shape[0]:
        raise RequestError(
            f"histories {np.shape(histories)} and inputs {driving.shape} do not fit A {a.shape}: "
            f"a history has {a.shape[1]} values, and both have one row a window."
        )
    if a.shape[0] == a.shape[1] and _shifts_exactly(a, b, count):
        a, b = a[:count], b[:count]
    channels, steps = _input_steps(b, driving)
    if not len(start):
        return np.empty((0, steps, count))
    with np.errstate(over="ignore", invalid="ignore"):
        memory = scratch or Scratch()
        out = None
        if _superposes(a, b, count, driving, steps):
            out = _superpose(a, b, count, start, driving, steps, memory)
        if out is None:
            symmetric, propagator = _prepare(a, b, count, channels, len(start), steps, memory)
            out = _run(propagator, symmetric, start, driving, steps, count, memory)
        out = out.astype(float, copy=False)
    _cut_lost(out, float(np.finfo(kind).max))
    return out


def _superposes(a: FloatArray, b: FloatArray, count: int, inputs: FloatArray, steps: int) -> bool:
    """Whether the windows are many enough for the response to an impulse to cost least."""
    windows, length, channels = inputs.shape
    size = len(a)
    if size < a.shape[1] or not channels or windows * count * (length + steps) > PIECE:
        return False
    width = a.itemsize / 8
    cost = superposition_cost(size, count, channels, length - steps, windows, steps, width)
    stepwise = doublings(size, b.shape[1], windows, steps, width)[1]
    # A transform would spread a gap over all instants.
    return cost < stepwise and bool(np.isfinite(inputs).all())


def _superpose(
    a: FloatArray,
    b: FloatArray,
    count: int,
    start: FloatArray,
    inputs: FloatArray,
    steps: int,
    scratch: Scratch,
) -> FloatArray | None:
    """Free runs by superposition; None where that would lose digits."""
    windows, length, channels = inputs.shape
    memory = scratch.mark()
    impulse = impulse_states(a, b, channels, scratch)
    rest = state_at_rest(impulse, inputs)
    begun = np.concatenate([start - rest, impulse[-1]])
    silent = np.zeros((len(begun), steps, 0), a.dtype)
    _, propagator = _prepare(a, b[:, :0], count, 0, len(begun), steps, scratch)
    free = _run(propagator, None, begun, silent, steps, count, scratch)
    early = impulse[:, :, :count].copy()
    scratch.release(memory)
    kernel = np.concatenate([early, free[windows:].transpose(1, 0, 2)])[:length]
    if grows(kernel, length - steps):
        return None
    forced = convolve(np.ascontiguousarray(kernel.transpose(1, 2, 0)), inputs, steps)
    return free[:windows] + forced.transpose(0, 2, 1)


def _cut_lost(out: FloatArray, most: float) -> None:
    """NaN from where a window exceeds `most`, or is not finite, on; in pieces of time."""
    windows, steps, count = out.shape
    length = max(1, PIECE // (16 * max(1, windows * count)))
    lost = np.zeros((windows, 1), dtype=bool)
    for first in range(0, steps, length):
        piece = out[:, first : first + length]
        gone: npt.NDArray[np.bool_] = np.any(~(np.abs(piece) <= most), axis=2)
        gone[:, :1] |= lost
        if gone.any():
            piece[np.logical_or.accumulate(gone, axis=1)] = np.nan
            lost = np.any(gone, axis=1, keepdims=True)


def _prepare(
    a: FloatArray,
    b: FloatArray,
    count: int,
    channels: int,
    windows: int,
    steps: int,
    scratch: Scratch,
) -> tuple[FloatArray | None, Propagator]:
    """Symmetric half of Â, where it is used, and the propagator."""
    if a.shape[0] == count and a.shape[1] > count:
        propagator = shifting_propagator(a, b, channels, steps)
        if not np.isfinite(propagator.output_state).all():
            propagator = shifting_propagator(a, b, channels, 1)
        return None, propagator
    symmetric = mirrored(a, b.shape[1], count, steps, scratch) if windows == 1 else None
    times = 0
    if symmetric is None:
        times, _ = doublings(a.shape[1], b.shape[1], windows, steps, a.itemsize / 8)
    propagator = square_propagator(a, b, count, channels, times, scratch)
    assert propagator.state is not None
    # A model that grows without bound overflows sooner in powers of Â than in single steps.
    if times and not np.isfinite(propagator.state).all():
        propagator = square_propagator(a, b, count, channels, 0, scratch)
    return symmetric, propagator


def _count_states(a: FloatArray, b: FloatArray, start: FloatArray, given: int | None) -> int:
    rows, size = a.shape
    if given is not None:
        count = given
    elif start.ndim == 3:
        count = start.shape[2]
    elif rows < size:
        count = rows
    else:
        divisors = (n for n in range(1, size + 1) if size % n == 0)
        count = next(n for n in divisors if _shifts_exactly(a, b, n) or _is_regressed(a, n))
    if count < 1 or size % count or rows not in (count, size):
        raise RequestError(
            f"A of shape {a.shape} does not belong to {count} states: its columns must be a "
            "multiple of N, and its rows N or all of them."
        )
    return count


def _is_regressed(a: FloatArray, count: int) -> bool:
    """Whether the lower rows are those of a least-squares fit to delayed states.

    Their targets are rows P of the regressors themselves, so the fit is P times a smoother of the
    regressors onto themselves, with ridge or without, which is symmetric and not negative.
    """
    kept = len(a) - count
    block = a[count:, :kept]
    if kept < 2:
        return False
    diagonal = np.diagonal(block)
    if not np.all(diagonal > 0) and not _stands_still(diagonal, count):
        return False
    tolerance = SYMMETRIC * np.abs(block).max()
    # The first row tells most other matrices apart.
    return bool(
        np.all(np.abs(block[0] - block[:, 0]) <= tolerance)
        and np.all(np.abs(block - block.T) <= tolerance)
    )


def _stands_still(diagonal: FloatArray, count: int) -> bool:
    """Whether what is not positive are channels that were zero in training, in every delay."""
    rounding = 100 * float(np.finfo(diagonal.dtype).eps) * np.abs(diagonal).max()
    still = (np.abs(diagonal) <= rounding).reshape(-1, count)
    return (
        bool(np.all(diagonal >= -rounding))
        and not np.all(still)
        and np.array_equal(still.all(axis=0), still.any(axis=0))
    )


def _shifts_exactly(a: FloatArray, b: FloatArray, count: int) -> bool:
    kept = a.shape[1] - count
    lower, moved = a[count:], np.eye(min(kept, 1), kept)
    # The first of these rows tells most other matrices apart.
    if kept and (np.any(b[count]) or not np.array_equal(lower[:1, :kept], moved)):
        return False
    return (
        not np.any(b[count:])
        and not np.any(lower[:, kept:])
        and bool(np.all(lower[:, :kept] == np.eye(kept)))
    )


def _input_steps(b: FloatArray, inputs: FloatArray) -> tuple[int, int]:
    """Channels a sample of the inputs, and steps they drive; extended inputs count as channels."""
    length, width = inputs.shape[1:]
    if width == b.shape[1]:
        return width, length
    if width == 0 or b.shape[1] == 0 or b.shape[1] % width:
        mend = (
            "Check the number of inputs and their delays."
            if b.shape[1]
            else "A model without input takes inputs of shape (window, steps, 0)."
        )
        raise RequestError(
            f"inputs with {width} channels do not fit B of shape {b.shape}: its columns must be "
            f"Q(z+1). {mend}"
        )
    delays = b.shape[1] // width - 1
    if length - delays < 1:
        raise RequestError(
            f"inputs of {length} samples do not reach one step: {delays} delays need at least "
            f"{delays + 1} samples."
        )
    return width, length - delays


def _run(
    propagator: Propagator,
    symmetric: FloatArray | None,
    start: FloatArray,
    inputs: FloatArray,
    steps: int,
    count: int,
    scratch: Scratch,
) -> FloatArray:
    # In pieces of whole blocks of K steps; the state is handed on.
    windows, size = start.shape
    K = propagator.steps
    held = propagator.output_input.shape[1] + K * count
    held += 0 if propagator.state is None else 2 * size
    blocks = -(-steps // K)
    most = max(1, PIECE // (held * max(windows, 1)))
    out = np.empty((windows, blocks * K, count), start.dtype)
    state = start
    for first in range(0, blocks, most):
        number = min(most, blocks - first)
        memory = scratch.mark()
        rows = _input_rows(propagator, inputs, first, number, scratch)
        if propagator.state is None:
            newest_first, state = _run_shifting(propagator, state, rows, scratch)
        elif symmetric is not None:
            newest_first, state = _run_mirrored(propagator, symmetric, state, rows, scratch)
        else:
            newest_first, state = _run_square(propagator, state, rows, scratch)
        piece = out[:, first * K : (first + number) * K]
        piece[:] = newest_first.reshape(windows, number * K, count)[:, ::-1]
        state = state.copy()
        scratch.release(memory)
    return out[:, :steps]


def _input_rows(
    propagator: Propagator, inputs: FloatArray, first: int, number: int, scratch: Scratch
) -> FloatArray:
    """Inputs of each block, newest first: shape (number * window, Q(z+K)); the last block first.

    Zeros stand where the last block reaches beyond the inputs; no output that is asked for sees
    them.
    """
    windows, _, channels = inputs.shape
    K, width = propagator.steps, propagator.output_input.shape[1]
    if width == 0:
        return np.zeros((number * windows, 0), inputs.dtype)
    delays = width // channels - K
    begin, length = first * K, number * K + delays
    newest_first = np.zeros((windows, length, channels), inputs.dtype)
    piece = inputs[:, begin : begin + length]
    newest_first[:, length - piece.shape[1] :] = piece[:, ::-1]
    window, step, channel = newest_first.strides
    blocks = np.lib.stride_tricks.as_strided(
        newest_first,
        shape=(number, windows, width),
        strides=(K * step, window, channel),
        writeable=False,
    )
    out: FloatArray = scratch.take((number, windows, width), inputs.dtype)
    out[:] = blocks
    return out.reshape(number * windows, width)


def _run_shifting(
    propagator: Propagator, start: FloatArray, rows: FloatArray, scratch: Scratch
) -> tuple[FloatArray, FloatArray]:
    # Samples lie newest first in one long row a window, so the extended state of every block is a
    # contiguous piece of it and nothing is ever moved. Rows come with the last block first too.
    windows = len(start)
    width, size = propagator.output_state.shape
    number = len(rows) // windows
    forcing = scratch.take((len(rows), width), rows.dtype)
    np.matmul(rows, propagator.output_input.T, out=forcing)
    forcing = forcing.reshape(number, windows, width)
    samples = scratch.take((windows, number * width + size), rows.dtype)
    samples[:, number * width :] = start
    if windows == 1:
        line, output = samples[0], propagator.output_state
        for at in range((number - 1) * width, -1, -width):
            piece = line[at : at + width]
            np.dot(output, line[at + width : at + width + size], out=piece)
            piece += forcing[at // width, 0]
    else:
        transposed = np.ascontiguousarray(propagator.output_state.T)
        for block in range(number - 1, -1, -1):
            at = block * width
            state = samples[:, at + width : at + width + size]
            samples[:, at : at + width] = state @ transposed + forcing[block]
    return samples[:, : number * width], samples[:, :size]


def _run_mirrored(
    propagator: Propagator,
    symmetric: FloatArray,
    start: FloatArray,
    rows: FloatArray,
    scratch: Scratch,
) -> tuple[FloatArray, FloatArray]:
    assert propagator.state_input is not None
    number, size, N = len(rows), start.shape[1], len(propagator.output_state)
    padded = len(symmetric)
    # A row holds a state and, after it, what the symmetric product says beyond the oldest delay.
    states = scratch.zeros((number + 1, padded + N))
    states[number, :size] = start[0]
    np.matmul(rows, propagator.state_input.T, out=states[:number, :size])
    half, newest = symmetric.T, np.ascontiguousarray(propagator.output_state).T
    symv, gemv = blas.dsymv, blas.dgemv
    before = states[number]
    for block in range(number - 1, -1, -1):
        row = states[block]
        symv(1.0, half, before[:padded], beta=1.0, y=row[N:], overwrite_y=1, lower=1)
        gemv(1.0, newest, before[:size], beta=1.0, y=row[:N], overwrite_y=1, trans=1)
        before = row
    return states[:number, :N].reshape(1, -1), states[:1, :size]


def _run_square(
    propagator: Propagator, start: FloatArray, rows: FloatArray, scratch: Scratch
) -> tuple[FloatArray, FloatArray]:
    windows, size = start.shape
    number = len(rows) // windows
    assert propagator.state is not None
    assert propagator.state_input is not None
    # states[block + 1] starts block; states[0] is what the piece ends with.
    states = scratch.take((number + 1, windows, size), rows.dtype)
    states[number] = start
    np.matmul(rows, propagator.state_input.T, out=states[:number].reshape(-1, size))
    if windows == 1:
        line = states[:, 0]
        for block in range(number - 1, -1, -1):
            line[block] += propagator.state @ line[block + 1]
    else:
        transposed = np.ascontiguousarray(propagator.state.T)
        for block in range(number - 1, -1, -1):
            states[block] += states[block + 1] @ transposed
    outputs = states[1:].reshape(-1, size) @ propagator.output_state.T
    outputs += rows @ propagator.output_input.T
    newest_first = outputs.reshape(number, windows, -1).transpose(1, 0, 2)
    return np.ascontiguousarray(newest_first).reshape(windows, -1), states[0]
