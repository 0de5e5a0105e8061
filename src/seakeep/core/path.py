r"""Coefficients of one delayed regression at many λ or ranks, from its Gram matrix.

A Cholesky factorisation gives those at each λ, :math:`H (C + \lambda I)^{-1}`, and one
eigendecomposition those of all ranks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import linalg

from seakeep.arrays import FloatArray


def ridge_path(gram: FloatArray, right: FloatArray, ridges: Sequence[float]) -> FloatArray:
    """Coefficients of ridge regressions of one problem at several λ.

    Parameters
    ----------
    gram : ndarray, shape (p, p)
        Products of the regressors; the upper triangle is read.
    right : ndarray, shape (N, p)
        Products of the targets with the regressors.
    ridges : sequence of float
        λ > 0, each; what is below the rounding of the Gram matrix is raised to it.

    Returns
    -------
    ndarray, shape (len(ridges), N, p)
    """
    path, least = np.empty((len(ridges), *right.shape)), _rounding(gram, gram.diagonal().max())
    for out, ridge in zip(path, ridges, strict=True):
        shifted = gram.copy()
        shifted[np.diag_indices_from(shifted)] += max(ridge, least)
        factor = linalg.cho_factor(shifted, overwrite_a=True, check_finite=False)
        out[:] = linalg.cho_solve(factor, right.T, check_finite=False).T
    return path


def truncated_path(gram: FloatArray, right: FloatArray, ranks: Sequence[int]) -> FloatArray:
    """Coefficients of least squares on the largest singular values, at several ranks.

    Parameters
    ----------
    gram : ndarray, shape (p, p)
        Products of the regressors, whose eigenvalues are the squared singular values; the upper
        triangle is read.
    right : ndarray, shape (N, p)
        Products of the targets with the regressors.
    ranks : sequence of int
        Numbers of singular values that are kept, each at least 1.

    Returns
    -------
    ndarray, shape (len(ranks), N, p)
    """
    values, vectors = np.linalg.eigh(gram, UPLO="U")
    values, vectors = values[::-1], vectors[:, ::-1]
    sound = int(np.count_nonzero(values > _rounding(gram, values[0])))
    turned = (right @ vectors[:, :sound]) / values[:sound]
    orders = [min(rank, sound) for rank in ranks]
    return np.stack([turned[:, :rank] @ vectors[:, :rank].T for rank in orders])


def _rounding(gram: FloatArray, largest: float) -> float:
    """Value below which an eigenvalue of a Gram matrix is rounding."""
    return len(gram) * float(np.finfo(float).eps * largest)
