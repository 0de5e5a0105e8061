r"""Many ridge regressions of the same delayed series: folds, delays and λ from one Gram matrix.

The columns of all candidates are built once, standardised once for all runs. A fold is the sum of
the moments of its runs, with an affine correction for its own means and standard deviations; a
choice of delays and of columns is a part of the Gram matrix; and a Cholesky
factorisation gives the coefficients at each λ, :math:`H (C + \lambda I)^{-1}`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from seakeep.arrays import FloatArray, IntArray

__all__ = ["Moments", "lagged", "ridge_path", "truncated_path"]


@dataclass(frozen=True, eq=False)
class Moments:
    """Sums over the snapshot pairs of some runs; they add up.

    Parameters
    ----------
    count : int
        Number of snapshot pairs.
    gram : ndarray, shape (p, p)
        Sum of products of the regressors.
    right : ndarray, shape (N, p)
        Sum of products of the targets with the regressors.
    sums : ndarray, shape (p,)
        Sum of the regressors.
    targets : ndarray, shape (N,)
        Sum of the targets.
    """

    count: int
    gram: FloatArray
    right: FloatArray
    sums: FloatArray
    targets: FloatArray

    @classmethod
    def of(cls, regressors: FloatArray, targets: FloatArray) -> Moments:
        """Moments of regressors, shape (pairs, p), and targets, shape (pairs, N)."""
        return cls(
            len(regressors),
            regressors.T @ regressors,
            targets.T @ regressors,
            regressors.sum(axis=0),
            targets.sum(axis=0),
        )

    def __add__(self, other: Moments) -> Moments:
        return Moments(
            self.count + other.count,
            self.gram + other.gram,
            self.right + other.right,
            self.sums + other.sums,
            self.targets + other.targets,
        )

    def chosen(self, columns: IntArray) -> Moments:
        """Moments of some of the regressors."""
        return Moments(
            self.count,
            self.gram[np.ix_(columns, columns)],
            self.right[:, columns],
            self.sums[columns],
            self.targets,
        )

    def standardised(
        self,
        mean: FloatArray,
        scale: FloatArray,
        target_mean: FloatArray,
        target_scale: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Gram matrix and right-hand side of deviations from means, in units of scales.

        Parameters
        ----------
        mean, scale : ndarray, shape (p,)
            Of the regressors.
        target_mean, target_scale : ndarray, shape (N,)
            Of the targets.

        Returns
        -------
        gram : ndarray, shape (p, p)
        right : ndarray, shape (N, p)
        """
        crossed = np.outer(mean, self.sums - 0.5 * self.count * mean)
        gram = (self.gram - crossed - crossed.T) / scale / scale[:, None]
        right = (
            self.right
            - np.outer(target_mean, self.sums)
            - np.outer(self.targets - self.count * target_mean, mean)
        )
        return gram, right / scale / target_scale[:, None]


def ridge_path(gram: FloatArray, right: FloatArray, ridges: Sequence[float]) -> FloatArray:
    """Coefficients of ridge regressions of one problem at several λ.

    Parameters
    ----------
    gram : ndarray, shape (p, p)
        Products of the regressors.
    right : ndarray, shape (N, p)
        Products of the targets with the regressors.
    ridges : sequence of float
        λ > 0, each; what is below the rounding of the Gram matrix is raised to it.

    Returns
    -------
    ndarray, shape (len(ridges), N, p)
    """
    found, least = np.empty((len(ridges), *right.shape)), _rounding(gram, gram.diagonal().max())
    for out, ridge in zip(found, ridges, strict=True):
        shifted = gram.copy()
        shifted[np.diag_indices_from(shifted)] += max(ridge, least)
        out[:] = linalg.solve(shifted, right.T, overwrite_a=True, assume_a="pos").T
    return found


def truncated_path(gram: FloatArray, right: FloatArray, ranks: Sequence[int]) -> FloatArray:
    """Coefficients of least squares on the largest singular values, at several ranks.

    Parameters
    ----------
    gram : ndarray, shape (p, p)
        Products of the regressors, whose eigenvalues are the squared singular values.
    right : ndarray, shape (N, p)
        Products of the targets with the regressors.
    ranks : sequence of int
        Numbers of singular values that are kept, each at least 1.

    Returns
    -------
    ndarray, shape (len(ranks), N, p)
    """
    values, vectors = np.linalg.eigh(gram)
    values, vectors = values[::-1], vectors[:, ::-1]
    sound = int(np.count_nonzero(values > _rounding(gram, values[0])))
    turned = (right @ vectors[:, :sound]) / values[:sound]
    kept = [min(rank, sound) for rank in ranks]
    return np.stack([turned[:, :rank] @ vectors[:, :rank].T for rank in kept])


def _rounding(gram: FloatArray, largest: float) -> float:
    """Value below which an eigenvalue of a Gram matrix is rounding."""
    return len(gram) * float(np.finfo(float).eps * largest)


def lagged(series: FloatArray, first: int, count: int, lags: int) -> FloatArray:
    """Rows of a series and of its past.

    Parameters
    ----------
    series : ndarray, shape (time, channel)
        Samples.
    first, count : int
        First instant of the rows, and how many there are.
    lags : int
        Longest lag; ``first`` is at least as large.

    Returns
    -------
    ndarray, shape (count, channel (lags + 1))
        Newest block first.
    """
    blocks = [series[first - lag : first - lag + count] for lag in range(lags + 1)]
    return np.concatenate(blocks, axis=1)
