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
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy import linalg
from scipy.linalg import blas, lapack

from seakeep.core.embedding import TrainingWindow, snapshot_matrices
from seakeep.core.gram import Piece, gram_trace, primal_system, snapshot_gram
from seakeep.core.inverse import ridge_rows
from seakeep.core.lagged import lagged_sums
from seakeep.core.scratch import Scratch
from seakeep.errors import RequestError

__all__ = ["Method", "Precision", "Solution", "check_single", "identify"]

FloatArray = npt.NDArray[np.float64]
Method = Literal["primal", "dual", "svd"]
Precision = Literal["double", "single"]

GRAM_LIMIT = 1e-6
"""Least effective λ, as a part of the largest squared singular value, for a Gram matrix.

Its condition number is then below 1e6, and ten digits are left of sixteen."""

SINGLE_RIDGE = 100.0
"""Least effective λ for single precision."""
SINGLE_LIMIT = 1e-4
"""What :data:`GRAM_LIMIT` is, for a factor in single precision.

Rounding is 6e-8 there, so an error of a free run stays within 1e-4 standard deviations with a few
to spare for what is summed over the horizon."""
DOUBLE = "Use precision='double', or raise ridge"


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


def _gram_suffices(
    ridge: float, trace: float, gram: FloatArray | None, limit: float = GRAM_LIMIT
) -> bool | None:
    """Whether λ ≥ 1e-6 σ²_max; None where only the (upper triangle of the) Gram matrix can tell."""
    # Two bounds of the largest squared singular value from above, then the value itself.
    if ridge >= limit * trace:
        return True
    if ridge <= 0:
        return False
    if gram is None:
        return None
    upper = np.triu(gram)
    if ridge >= limit * float(np.linalg.norm(upper + np.triu(upper, 1).T)):
        return True
    top = len(gram) - 1
    largest = linalg.eigvalsh(upper, lower=False, subset_by_index=[top, top], check_finite=False)
    return bool(ridge >= limit * largest[0])


def _factor(gram: FloatArray, ridge: float, beside: int = 0) -> FloatArray:
    """Lower Cholesky factor, in Fortran order, of the upper triangle `gram` plus λ; in its place.

    The triangle above the factor keeps what stood there. `beside` counts the last rows that are
    not of a Gram matrix.
    """
    size = len(gram)
    gram.reshape(-1)[:: size + 1] += ridge
    potrf = lapack.spotrf if gram.dtype == np.float32 else lapack.dpotrf
    factor, failed = potrf(gram.T, lower=1, overwrite_a=1, clean=0)
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
    np.fill_diagonal(padded[size:, size:], np.finfo(padded.dtype).max / 4)
    factor = _factor(padded, ridge, count)
    half = np.zeros((count, len(padded)), padded.dtype)
    half[:, :size] = padded[:size, size:].T
    trsm = blas.strsm if padded.dtype == np.float32 else blas.dtrsm
    solved = trsm(1.0, factor, half.T, lower=1, trans_a=1, overwrite_b=1)
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


def check_single(ridge: float, rank: int | None) -> None:
    """Refuse single precision where it would lose too many digits.

    Parameters
    ----------
    ridge : float
        Effective λ.
    rank : int or None
        Number of singular values, instead of λ.

    Raises
    ------
    RequestError
        If λ is below 100, or a rank is given.
    """
    if rank is not None:
        raise RequestError(
            f"precision='single' does not go with rank = {rank}: singular values need the digits. "
            "Use precision='double'."
        )
    if ridge < SINGLE_RIDGE:
        raise RequestError(
            f"precision='single' needs an effective ridge of at least {SINGLE_RIDGE:g}; received "
            f"{ridge:g}. {DOUBLE} (it counts times the number of snapshot pairs where "
            "ridge_scale='per_snapshot')."
        )


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
    precision: Precision = "double",
    scratch: Scratch | None = None,
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
    precision : {"double", "single"}, optional
        Precision of the result and, where the first N rows alone are regressed, of the factor and
        of what is solved with it. Sums over snapshots are made in double precision, and so are
        all rows: their displacement structure magnifies rounding (:mod:`seakeep.core.inverse`).
    scratch : Scratch, optional
        Memory of an earlier call to use again.

    Returns
    -------
    Solution
        Coefficients of shape (N(s+1) or N, N(s+1) + Q(z+1)).

    Raises
    ------
    RequestError
        If single precision is asked for where it would lose too many digits.
    """
    pieces = [
        Piece(x, u, window.first_column, window.columns)
        for x, u, window in zip(states, inputs, windows, strict=True)
    ]
    columns = sum(piece.count for piece in pieces)
    effective = ridge * columns if per_snapshot else ridge
    single = precision == "single"
    if single:
        check_single(effective, rank)
    memory = scratch or Scratch()
    factored = single and not all_rows
    problem = _Delayed(pieces, state_delays, input_delays, all_rows, memory, factored)
    if factored and not problem.suffices(effective, SINGLE_LIMIT):
        raise RequestError(
            f"precision='single' needs an effective ridge of at least {SINGLE_LIMIT:g} of the "
            f"largest squared singular value of the {columns} snapshot pairs; received "
            f"{effective:g}. {DOUBLE}."
        )
    chosen = "svd" if rank is not None else method or problem.choose(effective)
    full_rank = min(problem.rows, columns)
    if chosen == "svd":
        regressors, targets = problem.matrices()
        if rank is not None:
            return _by_singular_values(regressors, targets, 0.0, rank)
        solution = _by_singular_values(regressors, targets, effective, None)
    else:
        form = problem.primal if chosen == "primal" else problem.dual
        solution = Solution(form(effective), chosen, effective, full_rank)
    if single:
        solution = replace(solution, coefficients=solution.coefficients.astype(np.float32))
    return solution


@dataclass(frozen=True)
class _Delayed:
    """A regression of delayed series: snapshot pairs of several runs and two delays."""

    pieces: Sequence[Piece]
    state_delays: int
    input_delays: int
    all_rows: bool
    scratch: Scratch
    single: bool = False

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
        return self.form() if self.suffices(ridge, GRAM_LIMIT) else "svd"

    def suffices(self, ridge: float, limit: float) -> bool:
        """Whether λ is at least `limit` of the largest squared singular value."""
        trace = gram_trace(self.pieces, self.state_delays, self.input_delays)
        settled = _gram_suffices(ridge, trace, None, limit)
        if settled is None:
            settled = _gram_suffices(ridge, trace, self.gram(), limit)
        return bool(settled)

    def gram(self) -> FloatArray:
        """The smaller Gram matrix, its upper triangle."""
        if self.rows <= self.columns:
            return primal_system(*self.shape, self.scratch).gram
        return snapshot_gram(*self.shape, self.scratch)

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
            system = primal_system(*self.shape, self.scratch)
            return ridge_rows(system, _factor(system.gram, ridge), ridge, self.scratch)
        room = self.pieces[0].states.shape[1]
        system = primal_system(*self.shape, self.scratch, self.single, room)
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
            gram = snapshot_gram(*self.shape, self.scratch, self.single, N)
            weights = _solve_beside(gram, targets.T, ridge).T
            top, at = np.zeros((N, self.rows)), 0
            for piece in self.pieces:
                own = weights[at : at + piece.count].astype(float)
                at += piece.count
                x = lagged_sums(own, piece.states, piece.first, self.state_delays + 1, self.scratch)
                u = lagged_sums(own, piece.inputs, piece.first, self.input_delays + 1, self.scratch)
                top[:, : self.states] += x
                top[:, self.states :] += u
            return top
        factor = _factor(snapshot_gram(*self.shape, self.scratch), ridge)
        stacked = np.concatenate([self.matrices()[0], targets.T])
        half = blas.dtrsm(1.0, factor, stacked.T, lower=1, overwrite_b=1)
        regressors, newest = half[:, : self.rows], half[:, self.rows :]
        out = np.empty((self.states, self.rows))
        np.matmul(newest.T, regressors, out=out[:N])
        np.matmul(regressors[:, : self.states - N].T, regressors, out=out[N:])
        return out
