r"""Response of a linear model of delayed states and inputs to waves of one frequency.

The model is :math:`\hat x_{j+1} = \hat A \hat x_j + \hat B \hat u_j` on delayed vectors; with
:math:`u_j = e^{i\omega j}` its steady answer is :math:`H(\omega)\,e^{i\omega j}`.

Eigenvalues of :math:`\hat A` clipped to a radius.

With exact delay rows only the top block row of :math:`\hat A` is free: feedback through it,
:math:`\hat A + E K` with E the first columns of the identity, moves eigenvalues and keeps the
shift. Rows of K that are combinations of the left eigenvectors :math:`w_i^H` of some modes move
these modes alone; all other eigenvalues, and the right eigenvectors of their modes, stay.
"""

import numpy as np
from scipy import linalg

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
        return np.linalg.solve(system, driven)
    # One frequency at a time: the whole of Â is large.
    each = [np.linalg.solve(z * np.eye(size) - state_rows, b)[:n_states]
            for z, b in zip(turn, driven, strict=True)]  # fmt: skip
    return np.array(each, dtype=complex)


def clip_modes(rows: FloatArray, radius: float) -> tuple[FloatArray, tuple[float, ...]]:
    r"""Move the eigenvalues outside a radius onto it, with their angles, and leave all others.

    Parameters
    ----------
    rows : ndarray, shape (N or N(s+1), N(s+1))
        Regressed rows of :math:`\hat A`; below them stands the exact shift.
    radius : float
        Largest modulus that is left.

    Returns
    -------
    rows : ndarray
        The rows with these eigenvalues clipped; the same array where there are none.
    moduli : tuple of float
        Moduli that were clipped, largest first.

    Notes
    -----
    One real mode or one conjugate pair is moved at a time, by feedback through the direction b that
    moves it most: with :math:`g = w^H b`, the row :math:`2 \Re(f w^H)` with
    :math:`f = (\lambda'-\lambda)(\bar\lambda'-\lambda) / (g (\bar\lambda-\lambda))` places a pair
    at :math:`\lambda'` and its conjugate, and :math:`w (\lambda'-\lambda)/g` a real mode.
    """
    count, size = rows.shape
    a = np.concatenate([rows, np.eye(size - count, size)])
    turned, vectors, number = linalg.schur(
        a.T, output="real", sort=lambda real, imag=0.0: bool(np.hypot(real, imag) > radius)
    )
    if not number:
        return rows, ()
    # basis.T @ a = small @ basis.T: the left invariant subspace of these modes.
    basis, small = vectors[:, :number], turned[:number, :number].T.copy()
    moduli = np.sort(np.abs(np.linalg.eigvals(small)))[::-1]
    entry = basis[:count].T
    feedback = np.zeros((count, number))
    for _ in range(number):
        values, left = linalg.eig(small, left=True, right=False)
        worst = int(np.argmax(np.abs(values)))
        value, w = values[worst], left[:, worst].conj()
        if abs(value) <= radius * (1.0 + 1e-9):
            break
        reach = w @ entry
        direction = np.linalg.svd(np.stack([reach.real, reach.imag]))[2][0]
        wanted, gain = value * radius / abs(value), reach @ direction
        if value.imag == 0.0:
            row = ((wanted - value) / gain * w).real
        else:
            factor = (wanted - value) * (wanted.conj() - value) / (value.conj() - value)
            row = 2.0 * (factor / gain * w).real
        feedback += np.outer(direction, row)
        small += np.outer(entry @ direction, row)
    return rows + feedback @ basis.T, tuple(float(each) for each in moduli)
