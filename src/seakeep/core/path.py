r"""Coefficients of one delayed regression at many λ, from its Gram matrix.

A Cholesky factorisation gives those at each λ, :math:`H (C + \lambda I)^{-1}`.
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
    path = np.empty((len(ridges), *right.shape))
    least = len(gram) * float(np.finfo(float).eps * gram.diagonal().max())
    for out, ridge in zip(path, ridges, strict=True):
        shifted = gram.copy()
        shifted[np.diag_indices_from(shifted)] += max(ridge, least)
        factor = linalg.cho_factor(shifted, overwrite_a=True, check_finite=False)
        out[:] = linalg.cho_solve(factor, right.T, check_finite=False).T
    return path
