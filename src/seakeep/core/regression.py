r"""Tikhonov-regularised and rank-truncated least squares, :math:`\hat X' \approx G \hat Y`.

Gram matrices of delayed series come from their structure (:mod:`seakeep.core.gram`), and the form
is chosen by shape and conditioning:

* primal, :math:`G = X' Y^T (Y Y^T + \lambda I)^{-1}` (the paper's formula), or dual,
  :math:`G = X' (Y^T Y + \lambda I)^{-1} Y^T`, the same matrix, whichever is less work;
* singular values, where forming a Gram matrix would square away the accuracy: the effective λ is
  below 1e-6 of the largest squared singular value, or λ = 0 (minimum norm), or a rank is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import linalg
from scipy.linalg import blas, lapack

from seakeep.core.embedding import TrainingWindow, snapshot_matrices
from seakeep.core.gram import Piece, gram_trace, primal_system, snapshot_gram
from seakeep.core.inverse import ridge_rows
from seakeep.core.lagged import lagged_sums

__all__ = ["Method", "Solution", "identify"]

FloatArray = npt.NDArray[np.float64]
Method = Literal["primal", "dual", "svd"]

GRAM_LIMIT = 1e-6
"""Least effective λ, as a part of the largest squared singular value, for a Gram matrix.

Its condition number is then below 1e6, and ten digits are left of sixteen."""


@dataclass(frozen=True)
class Solution:
    """Coefficients of a linear map and how they were found.

    Parameters
    ----------
    coefficients : ndarray, shape (targets, regressors)
        G.
    method : {"primal", "dual", "svd"}
        The form that was solved.
    ridge : float
        Effective λ: what was added to the diagonal.
    rank : int
        Number of singular values used; for the primal and dual forms all of them.
    """

    coefficients: FloatArray
    method: Method
    ridge: float
    rank: int


def _gram_suffices(ridge: float, gram: FloatArray) -> bool:
    """Whether λ ≥ 1e-6 σ²_max, from the upper triangle of the Gram matrix."""
    # A bound of the largest squared singular value from above, then the value itself.
    upper = np.triu(gram)
    if ridge >= GRAM_LIMIT * float(np.linalg.norm(upper + np.triu(upper, 1).T)):
        return True
    top = len(gram) - 1
    largest = linalg.eigvalsh(upper, lower=False, subset_by_index=[top, top], check_finite=False)
    return bool(ridge >= GRAM_LIMIT * largest[0])


def _factor(gram: FloatArray, ridge: float, beside: int = 0) -> FloatArray:
    """Lower Cholesky factor, in Fortran order, of the upper triangle `gram` plus λ; in its place.

    The triangle above the factor keeps what stood there. `beside` counts the last rows that are
    not of a Gram matrix.
    """
    size = len(gram)
    gram.reshape(-1)[:: size + 1] += ridge
    factor, failed = lapack.dpotrf(gram.T, lower=1, overwrite_a=1, clean=0)
    if failed:
        raise np.linalg.LinAlgError(
            f"the Gram matrix of {size - beside} rows with ridge {ridge:g} is not positive "
            "definite. Raise ridge, or use method='svd'."
        )
    return np.asarray(factor)


def _solve_beside(padded: FloatArray, right: FloatArray, ridge: float) -> FloatArray:
    """`right` times the inverse of a Gram matrix plus λ, shape of `right`.

    The Gram matrix M − λI stands at the head of `padded`, and the right-hand sides R are put
    beside it, so that Cholesky does the forward half of the solution on its way: the factor of
    [M Rᵀ; R κI] begins with that of M, and R L⁻ᵀ stands below. κ is so large that what it is
    reduced by does not count.
    """
    count, size = right.shape
    padded[:size, size:] = right.T
    padded[size:, size:] = 0.0
    np.fill_diagonal(padded[size:, size:], np.finfo(float).max / 4)
    factor = _factor(padded, ridge, count)
    half = np.zeros((count, len(padded)))
    half[:, :size] = padded[:size, size:].T
    solved = blas.dtrsm(1.0, factor, half.T, lower=1, trans_a=1, overwrite_b=1)
    return np.asarray(solved).T[:, :size]


def _by_singular_values(
    regressors: FloatArray, targets: FloatArray, ridge: float, rank: int | None
) -> Solution:
    left, values, right = linalg.svd(regressors, full_matrices=False, check_finite=False)
    # Below this, a singular value is rounding (the rule of numpy.linalg.matrix_rank).
    floor = np.finfo(float).eps * max(regressors.shape) * (values[0] if values.size else 0.0)
    kept = int(np.count_nonzero(values > floor))
    if rank is not None:
        kept = min(kept, rank)
    values = values[:kept]
    weights = values / (values**2 + ridge)
    coefficients = ((targets @ right[:kept].T) * weights) @ left[:, :kept].T
    return Solution(coefficients, "svd", ridge, kept)


def identify(
    states: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    windows: Sequence[TrainingWindow],
    *,
    state_delays: int,
    input_delays: int,
    ridge: float,
    per_snapshot: bool = False,
    rank: int | None = None,
    all_rows: bool = True,
    method: Method | None = None,
) -> Solution:
    r"""Identify :math:`[\hat A\; \hat B]` from one or several runs.

    Snapshot pairs of the runs stand side by side; none crosses a joint.

    Parameters
    ----------
    states : sequence of ndarray, each (time, N)
        States of the runs, standardised or not.
    inputs : sequence of ndarray, each (time, Q)
        Their inputs.
    windows : sequence of TrainingWindow
        The samples of each run that train.
    state_delays, input_delays : int
        s and z.
    ridge : float
        λ, zero or positive. Zero gives the solution of least norm.
    per_snapshot : bool, optional
        Whether λ is multiplied by the number of columns.
    rank : int, optional
        Number of singular values kept, instead of λ (truncated-SVD DMD).
    all_rows : bool, optional
        Whether the rows of the delayed states are regressed too, as in the paper, or the first N
        alone.
    method : {"primal", "dual", "svd"}, optional
        Forces a form; by default shape and conditioning decide.

    Returns
    -------
    Solution
        Coefficients of shape (N(s+1) or N, N(s+1) + Q(z+1)).
    """
    pieces = [
        Piece(x, u, window.first_column, window.columns)
        for x, u, window in zip(states, inputs, windows, strict=True)
    ]
    columns = sum(piece.count for piece in pieces)
    effective = ridge * columns if per_snapshot else ridge
    problem = _Delayed(pieces, state_delays, input_delays, all_rows)
    chosen = "svd" if rank is not None else method or problem.choose(effective)
    full_rank = min(problem.rows, columns)
    if chosen == "svd":
        regressors, targets = problem.matrices()
        if rank is not None:
            return _by_singular_values(regressors, targets, 0.0, rank)
        return _by_singular_values(regressors, targets, effective, None)
    form = problem.primal if chosen == "primal" else problem.dual
    return Solution(form(effective), chosen, effective, full_rank)


@dataclass(frozen=True)
class _Delayed:
    """A regression of delayed series: snapshot pairs of several runs and two delays."""

    pieces: Sequence[Piece]
    state_delays: int
    input_delays: int
    all_rows: bool

    @property
    def shape(self) -> tuple[Sequence[Piece], int, int]:
        """Pieces and delays."""
        return self.pieces, self.state_delays, self.input_delays

    @property
    def states(self) -> int:
        """Rows of the extended state."""
        return int(self.pieces[0].states.shape[1]) * (self.state_delays + 1)

    @property
    def rows(self) -> int:
        """Regressors."""
        return self.states + int(self.pieces[0].inputs.shape[1]) * (self.input_delays + 1)

    @property
    def columns(self) -> int:
        """Snapshot pairs."""
        return sum(piece.count for piece in self.pieces)

    def form(self) -> Method:
        """The form that is less work, by its largest terms."""
        p, n, a = self.rows, self.columns, self.states
        if not self.all_rows:
            return "primal" if p <= n else "dual"
        b = p - a
        first = self.pieces[0]
        rank = 2 * (first.states.shape[1] + first.inputs.shape[1] + len(self.pieces))
        primal = p**3 / 3 + 2 * rank * p * (p + a)
        dual = n**3 / 3 + n * n * p + n * a * (a + 2 * b)
        return "primal" if primal <= dual else "dual"

    def choose(self, ridge: float) -> Method:
        """The form, or singular values where λ is too small for a Gram matrix."""
        settled = ridge >= GRAM_LIMIT * gram_trace(*self.shape)
        if settled or (ridge > 0 and _gram_suffices(ridge, self.gram())):
            return self.form()
        return "svd"

    def gram(self) -> FloatArray:
        """The smaller Gram matrix, its upper triangle."""
        if self.rows <= self.columns:
            return primal_system(*self.shape).gram
        return snapshot_gram(*self.shape)

    def matrices(self) -> tuple[FloatArray, FloatArray]:
        """Hankel matrices of regressors and targets, built."""
        built = []
        for piece in self.pieces:
            window = TrainingWindow(piece.first, piece.first + piece.count, piece.first)
            built.append(
                snapshot_matrices(
                    piece.states,
                    piece.inputs,
                    window,
                    self.state_delays,
                    self.input_delays,
                    self.all_rows,
                )
            )
        regressors, targets = zip(*built, strict=True)
        return np.concatenate(regressors, axis=1), np.concatenate(targets, axis=1)

    def primal(self, ridge: float) -> FloatArray:
        r"""Coefficients from :math:`C = \hat Y \hat Y^T`."""
        if self.all_rows:
            system = primal_system(*self.shape)
            return ridge_rows(system, _factor(system.gram, ridge), ridge)
        room = self.pieces[0].states.shape[1]
        system = primal_system(*self.shape, room)
        top = _solve_beside(system.gram, system.right, ridge)
        return np.concatenate([top[:, system.inputs :], top[:, : system.inputs]], axis=1)

    def dual(self, ridge: float) -> FloatArray:
        r"""Coefficients from :math:`K = \hat Y^T \hat Y`.

        With :math:`K + \lambda I = L L^T` the newest rows are :math:`(K + \lambda I)^{-1} X'^T`
        summed against the lagged series; all rows are :math:`\hat X' L^{-T} Z` with
        :math:`Z = L^{-1} \hat Y^T`, and those of the delayed states are :math:`P Z^T Z`.
        """
        targets = np.concatenate([piece.targets for piece in self.pieces])
        N = targets.shape[1]
        if not self.all_rows:
            gram = snapshot_gram(*self.shape, N)
            weights = _solve_beside(gram, targets.T, ridge).T
            top, at = np.zeros((N, self.rows)), 0
            for piece in self.pieces:
                own = weights[at : at + piece.count].astype(float)
                at += piece.count
                x = lagged_sums(own, piece.states, piece.first, self.state_delays + 1)
                u = lagged_sums(own, piece.inputs, piece.first, self.input_delays + 1)
                top[:, : self.states] += x
                top[:, self.states :] += u
            return top
        factor = _factor(snapshot_gram(*self.shape), ridge)
        stacked = np.concatenate([self.matrices()[0], targets.T])
        half = blas.dtrsm(1.0, factor, stacked.T, lower=1, overwrite_b=1)
        regressors, newest = half[:, : self.rows], half[:, self.rows :]
        out = np.empty((self.states, self.rows))
        np.matmul(newest.T, regressors, out=out[:N])
        np.matmul(regressors[:, : self.states - N].T, regressors, out=out[N:])
        return out
