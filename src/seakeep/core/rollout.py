r"""Free runs of :math:`\hat x_{k+1} = \hat A \hat x_k + \hat B \hat u_k`, many windows at once."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from seakeep.errors import RequestError

__all__ = ["input_forcing", "rollout"]

FloatArray = npt.NDArray[np.float64]


def rollout(
    A: npt.ArrayLike,
    B: npt.ArrayLike,
    histories: npt.ArrayLike,
    inputs: npt.ArrayLike,
    *,
    n_states: int | None = None,
    limit: float = np.inf,
) -> FloatArray:
    r"""Free run of one model over several windows side by side.

    Parameters
    ----------
    A : array_like, shape (N(s+1), N(s+1)) or (N, N(s+1))
        State matrix. With N rows alone the delayed states are shifted exactly.
    B : array_like, shape (rows of A, Q(z+1))
        Input matrix; no columns for a model without input.
    histories : array_like, shape (window, N(s+1)) or (window, s+1, N)
        Extended states :math:`\hat x_0`, newest block first; or the samples themselves, oldest
        first.
    inputs : array_like, shape (window, steps, Q(z+1)) or (window, z + steps, Q)
        Extended inputs :math:`\hat u_0 … \hat u_{steps-1}`, newest block first; or the samples
        themselves, oldest first. A model without input takes shape (window, steps, 0).
    n_states : int, optional
        N. By default it is read from `histories` with three axes, or from an `A` with N rows. A
        square `A` with extended `histories` leaves it open: lower rows that are an exact shift are
        read as delays, and any other square `A` as N = N(s+1), so that the whole extended state
        is returned.
    limit : float, optional
        A window is given up where a value exceeds this or is not finite: NaN from there on.

    Returns
    -------
    ndarray, shape (window, steps, N)
        :math:`x_1 … x_{steps}`.

    Raises
    ------
    RequestError
        If shapes do not fit together.

    Examples
    --------
    >>> rollout([[0.5]], [[1.0]], [[1.0]], [[[0.0], [1.0], [0.0]]])[0, :, 0]
    array([0.5  , 1.25 , 0.625])
    """
    a, b = np.atleast_2d(np.asarray(A, dtype=float)), np.asarray(B, dtype=float)
    start = np.asarray(histories, dtype=float)
    driving = np.asarray(inputs, dtype=float)
    if start.ndim not in (2, 3) or driving.ndim != 3 or b.ndim != 2 or len(b) != len(a):
        raise RequestError(
            "rollout needs A (rows, N(s+1)), B (rows, Q(z+1)), histories (window, N(s+1)) or "
            "(window, s+1, N), inputs (window, steps, Q(z+1)) or (window, z+steps, Q); received "
            f"{a.shape}, {b.shape}, {start.shape}, {driving.shape}."
        )
    count = _count_states(a, b, start, n_states)
    if start.ndim == 3:
        start = start[:, ::-1].reshape(start.shape[0], -1)
    if start.shape[1] != a.shape[1] or start.shape[0] != driving.shape[0]:
        raise RequestError(
            f"histories {np.shape(histories)} and inputs {driving.shape} do not fit A {a.shape}: "
            f"a history has {a.shape[1]} values, and both have one row a window."
        )
    if a.shape[0] == a.shape[1] and _shifts_exactly(a, b, count):
        a, b = a[:count], b[:count]
    forcing = input_forcing(b, driving)
    with np.errstate(over="ignore", invalid="ignore"):
        if a.shape[0] == count and a.shape[1] > count:
            out = _run_shifting(a, start, forcing)
        else:
            out = _run_square(a, start, forcing, count)
        lost = ~np.all((np.abs(out) <= limit) & np.isfinite(out), axis=2)
    out[np.logical_or.accumulate(lost, axis=1)] = np.nan
    return out


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
        count = next(n for n in divisors if _shifts_exactly(a, b, n))
    if count < 1 or size % count or rows not in (count, size):
        raise RequestError(
            f"A of shape {a.shape} does not belong to {count} states: its columns must be a "
            "multiple of N, and its rows N or all of them."
        )
    return count


def _shifts_exactly(a: FloatArray, b: FloatArray, count: int) -> bool:
    kept = a.shape[1] - count
    lower = a[count:]
    return (
        not np.any(b[count:])
        and not np.any(lower[:, kept:])
        and bool(np.all(lower[:, :kept] == np.eye(kept)))
    )


def input_forcing(b: FloatArray, inputs: FloatArray) -> FloatArray:
    r"""Input part :math:`\hat B \hat u_k` of every step, shape (window, steps, rows).

    Parameters
    ----------
    b : ndarray, shape (rows, Q(z+1))
        Input matrix.
    inputs : ndarray, shape (window, steps, Q(z+1)) or (window, z + steps, Q)
        As in :func:`rollout`.

    Returns
    -------
    ndarray, shape (window, steps, rows)
        The forcing.

    Raises
    ------
    RequestError
        If the channels of `inputs` do not divide the columns of `b`.
    """
    windows, length, width = inputs.shape
    if width == b.shape[1]:
        return inputs @ b.T
    if width == 0 or b.shape[1] % width:
        raise RequestError(
            f"inputs with {width} channels do not fit B of shape {b.shape}: its columns must be "
            "Q(z+1). Check the number of inputs and their delays."
        )
    delays = b.shape[1] // width - 1
    steps = length - delays
    if steps < 1:
        raise RequestError(
            f"inputs of {length} samples do not reach one step: {delays} delays need at least "
            f"{delays + 1} samples."
        )
    newest_first = np.ascontiguousarray(inputs[:, ::-1])
    step = newest_first.strides[1]
    extended = np.lib.stride_tricks.as_strided(
        newest_first,
        shape=(windows, steps, b.shape[1]),
        strides=(newest_first.strides[0], step, newest_first.strides[2]),
        writeable=False,
    )
    return (extended @ b.T)[:, ::-1]


def _run_shifting(a: FloatArray, start: FloatArray, forcing: FloatArray) -> FloatArray:
    # Samples lie newest first in one long row a window, so the extended state of every step is a
    # contiguous piece of it and nothing is ever moved.
    windows, steps, count = forcing.shape
    size = a.shape[1]
    samples = np.empty((windows, steps * count + size))
    samples[:, steps * count :] = start
    transposed = np.ascontiguousarray(a.T)
    at = steps * count
    for step in range(steps):
        samples[:, at - count : at] = samples[:, at : at + size] @ transposed + forcing[:, step]
        at -= count
    newest_first = samples[:, : steps * count].reshape(windows, steps, count)
    return np.ascontiguousarray(newest_first[:, ::-1])


def _run_square(a: FloatArray, start: FloatArray, forcing: FloatArray, count: int) -> FloatArray:
    windows, steps, _ = forcing.shape
    out = np.empty((windows, steps, count))
    transposed = np.ascontiguousarray(a.T)
    state = start
    for step in range(steps):
        state = state @ transposed + forcing[:, step]
        out[:, step] = state[:, :count]
    return out
