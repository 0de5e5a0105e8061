r"""Response of a linear model of delayed states and inputs to waves of one frequency.

The model is :math:`\hat x_{j+1} = \hat A \hat x_j + \hat B \hat u_j` on delayed vectors; with
:math:`u_j = e^{i\omega j}` its steady answer is :math:`H(\omega)\,e^{i\omega j}`.
"""

from __future__ import annotations

import numpy as np

from seakeep.arrays import ComplexArray, FloatArray


def frequency_response(
    state_rows: FloatArray,
    input_rows: FloatArray,
    omega: FloatArray,
    n_states: int,
    n_delayed: int,
    input_delays: int,
) -> ComplexArray:
    r"""Transfer functions of a delayed model, :math:`(e^{i\omega} I - \hat A)^{-1} \hat B(\omega)`.

    Parameters
    ----------
    state_rows : ndarray, shape (N or N(s+1), N(s+1))
        Regressed rows of Â, newest block first; with N rows the others shift the delays.
    input_rows : ndarray, shape (as many rows, n(z+1) + m)
        The same rows of B̂: n regressors with z delays, then m without.
    omega : ndarray, shape (frequency,)
        Radians per sample, 0 to π.
    n_states, n_delayed, input_delays : int
        N, n and z.

    Returns
    -------
    ndarray of complex, shape (frequency, N, n + m)
        Output per input, both as the coefficients have them (standardised).
    """
    turn = np.exp(1j * np.asarray(omega, dtype=float))
    lagged = n_delayed * (input_delays + 1)
    back = turn[:, None] ** -np.arange(input_delays + 1)
    delayed = input_rows[:, :lagged].reshape(-1, input_delays + 1, n_delayed)
    direct = np.broadcast_to(input_rows[:, lagged:], (turn.size, *input_rows[:, lagged:].shape))
    driven = np.concatenate([np.einsum("fl,rlq->frq", back, delayed), direct], axis=2)
    size = state_rows.shape[1]
    if len(state_rows) == n_states:
        lags = size // n_states
        back = turn[:, None] ** -np.arange(lags)
        rows = state_rows.reshape(n_states, lags, n_states)
        system = turn[:, None, None] * np.eye(n_states) - np.einsum("fl,rlj->frj", back, rows)
        result: ComplexArray = np.linalg.solve(system, driven)
        return result
    # One frequency at a time: the whole of Â is large.
    each = [np.linalg.solve(z * np.eye(size) - state_rows, b)[:n_states]
            for z, b in zip(turn, driven, strict=True)]  # fmt: skip
    return np.array(each, dtype=complex)
