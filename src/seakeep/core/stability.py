r"""Eigenvalues of :math:`\hat A` clipped to a radius.

With exact delay rows only the top block row of :math:`\hat A` is free: feedback through it,
:math:`\hat A + E K` with E the first columns of the identity, moves eigenvalues and keeps the
shift. Rows of K that are combinations of the left eigenvectors :math:`w_i^H` of some modes move
these modes alone; all other eigenvalues, and the right eigenvectors of their modes, stay.
"""

from __future__ import annotations

import numpy as np
from scipy import linalg

from seakeep.arrays import FloatArray


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
