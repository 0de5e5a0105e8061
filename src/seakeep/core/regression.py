r"""Tikhonov-regularised and rank-truncated least squares, :math:`\hat X' \approx G \hat Y`.

One function, :func:`solve`, whatever the shape and the conditioning:

* primal, :math:`G = X' Y^T (Y Y^T + \lambda I)^{-1}` (the paper's formula), where there are no
  fewer columns than rows;
* dual, :math:`G = X' (Y^T Y + \lambda I)^{-1} Y^T`, the same matrix, where there are fewer;
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

from seakeep.core.embedding import TrainingWindow, snapshot_matrices

__all__ = ["Method", "Solution", "identify", "solve"]

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


def solve(
    regressors: FloatArray,
    targets: FloatArray,
    ridge: float,
    rank: int | None = None,
    method: Method | None = None,
) -> Solution:
    r"""Solve :math:`\min_G \|X' - G Y\|_F^2 + \lambda \|G\|_F^2`.

    Parameters
    ----------
    regressors : ndarray, shape (rows, columns)
        Y.
    targets : ndarray, shape (targets, columns)
        X'.
    ridge : float
        Effective λ, zero or positive. Zero gives the solution of least norm.
    rank : int, optional
        Number of singular values kept; then λ is not used (truncated-SVD DMD).
    method : {"primal", "dual", "svd"}, optional
        Forces a form; by default shape and conditioning decide.

    Returns
    -------
    Solution
        Coefficients and how they were found.
    """
    if rank is not None:
        return _by_singular_values(regressors, targets, 0.0, rank)
    chosen = method or choose_method(regressors, ridge)
    if chosen == "svd":
        return _by_singular_values(regressors, targets, ridge, None)
    full_rank = min(regressors.shape)
    if chosen == "primal":
        gram = regressors @ regressors.T
        gram.flat[:: gram.shape[0] + 1] += ridge
        right = targets @ regressors.T
        coefficients = linalg.solve(
            gram, right.T, assume_a="pos", overwrite_a=True, overwrite_b=True, check_finite=False
        ).T
        return Solution(coefficients, "primal", ridge, full_rank)
    gram = regressors.T @ regressors
    gram.flat[:: gram.shape[0] + 1] += ridge
    weights = linalg.solve(gram, targets.T, assume_a="pos", overwrite_a=True, check_finite=False)
    return Solution(weights.T @ regressors.T, "dual", ridge, full_rank)


def choose_method(regressors: FloatArray, ridge: float) -> Method:
    """Form that keeps ten digits: a Gram matrix where λ allows it, else singular values.

    Parameters
    ----------
    regressors : ndarray, shape (rows, columns)
        Y.
    ridge : float
        Effective λ.

    Returns
    -------
    {"primal", "dual", "svd"}
        The form.
    """
    rows, columns = regressors.shape
    form: Method = "primal" if rows <= columns else "dual"
    # The trace bounds the largest squared singular value from above; most often that settles it.
    if ridge >= GRAM_LIMIT * float(np.einsum("ij,ij->", regressors, regressors)):
        return form
    if ridge <= 0:
        return "svd"
    gram = regressors @ regressors.T if rows <= columns else regressors.T @ regressors
    size = gram.shape[0]
    largest = linalg.eigvalsh(gram, subset_by_index=[size - 1, size - 1], check_finite=False)[0]
    return form if ridge >= GRAM_LIMIT * largest else "svd"


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
        λ.
    per_snapshot : bool, optional
        Whether λ is multiplied by the number of columns.
    rank : int, optional
        Number of singular values, instead of λ.
    all_rows : bool, optional
        Whether the rows of the delayed states are regressed too, as in the paper, or the first N
        alone.
    method : {"primal", "dual", "svd"}, optional
        As in :func:`solve`.

    Returns
    -------
    Solution
        Coefficients of shape (N(s+1) or N, N(s+1) + Q(z+1)).
    """
    pieces = [
        snapshot_matrices(x, u, window, state_delays, input_delays, all_rows)
        for x, u, window in zip(states, inputs, windows, strict=True)
    ]
    regressors = np.concatenate([piece[0] for piece in pieces], axis=1)
    targets = np.concatenate([piece[1] for piece in pieces], axis=1)
    effective = ridge * regressors.shape[1] if per_snapshot else ridge
    return solve(regressors, targets, effective, rank, method)
