r"""Free run whose input depends on the state that it has just reached."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

__all__ = ["feedback_rollout"]

FloatArray = npt.NDArray[np.float64]


def feedback_rollout(
    a: FloatArray,
    b: FloatArray,
    states: FloatArray,
    inputs: FloatArray,
    steps: int,
    next_input: Callable[[int, FloatArray], FloatArray],
) -> FloatArray:
    r"""Run :math:`\hat x_{j+1} = \hat A \hat x_j + \hat B \hat u_j` with :math:`u_j(x_j)`.

    Parameters
    ----------
    a, b : ndarray, shapes (rows, N(s+1)) and (rows, Q(z+1))
        Matrices; N rows stand for exact delay rows, else all rows are given.
    states : ndarray, shape (s + 1, N)
        History, oldest first.
    inputs : ndarray, shape (z + 1, Q)
        History, oldest first, up to the same instant.
    steps : int
        Number of instants.
    next_input : callable
        ``next_input(k, x)`` gives the input, shape (Q,), at the k-th instant after the start
        (from 1), where the state x, shape (N,), was reached. It is not asked at the last one.

    Returns
    -------
    ndarray, shape (steps, N)
        States after the start.
    """
    count, width = states.shape[1], inputs.shape[1]
    a, b = a.astype(float, copy=False), b.astype(float, copy=False)
    x, u = states[::-1].ravel(), inputs[::-1].ravel()
    exact = a.shape[0] == count < x.size
    out = np.empty((steps, count))
    for step in range(steps):
        with np.errstate(over="ignore", invalid="ignore"):  # a lost run is cut by the caller
            reached = a @ x + b @ u
        x = np.concatenate([reached, x[:-count]]) if exact else reached
        out[step] = x[:count]
        if step < steps - 1:
            u = np.concatenate([next_input(step + 1, out[step]), u[:-width]])
    return out
