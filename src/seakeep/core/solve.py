r"""Tikhonov-regularised and rank-truncated least squares, :math:`\hat X' \approx G \hat Y`.

Gram matrices of delayed series come from their structure (:mod:`seakeep.core.embedding`), their
Cholesky factorisation gives the coefficients at each λ, and the form is chosen by shape and
conditioning:

* primal, :math:`G = X' Y^T (Y Y^T + \lambda I)^{-1}` (the paper's formula), or dual,
  :math:`G = X' (Y^T Y + \lambda I)^{-1} Y^T`, the same matrix, whichever is less work;
* singular values, where forming a Gram matrix would square away the accuracy: the effective λ is
  below 1e-6 of its trace, or λ = 0 (minimum norm), or a rank is given. Where the newest rows alone
  are regressed, the primal form serves down to 1e-10.

All rows of the next extended state need rows of the inverse of :math:`M = C + \lambda I`. Let Z
move the lags down by one, newest first, filling with zeros. The recursion of the Gram matrix says
:math:`M - Z M Z^T = B \Sigma B^T` of low rank: with E selecting the newest lags, α and β the edges
of each run and :math:`F = M E - \tfrac12 E E^T M E`,

.. math:: B \Sigma B^T = \alpha\alpha^T - \beta\beta^T + E F^T + F E^T .

The inverse :math:`H` has the same structure the other way round. For τ = ±1, multiplying
:math:`(I-\tau Z) M + M (I-\tau Z)^T - (I-\tau Z) M (I-\tau Z)^T = B \Sigma B^T` from both sides,
first by :math:`(I-\tau Z)^{-1}` and its transpose, then by H, then by :math:`(I-\tau Z)^T` and
:math:`(I-\tau Z)`, gives

.. math:: H - Z^T H Z = G \Sigma G^T , \qquad G = (I-\tau Z)^T H (I-\tau Z)^{-1} B ,

which determines H by running sums from the oldest lag. So H costs 2(channels + R) solutions (R
runs), a product of that rank and one addition per entry, instead of an inversion.
:math:`(I-\tau Z)^{-1}` sums a series over its lags; τ = −1 sums it with turning signs, which keeps
a smooth series small, and τ = 1 one that turns its sign at every sample.

Eigenvalues of :math:`\hat A` are clipped to a radius. With exact delay rows only the top block row
of :math:`\hat A` is free: feedback through it, :math:`\hat A + E K` with E the first columns of the
identity, moves eigenvalues and keeps the shift. Rows of K that are combinations of the left
eigenvectors :math:`w_i^H` of some modes move these modes alone; all other eigenvalues, and the
right eigenvectors of their modes, stay.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy import linalg
from scipy.linalg import blas, lapack

from seakeep.arrays import FloatArray
from seakeep.core.embedding import (
    Delayed,
    PrimalSystem,
    TrainingWindow,
    embed,
    gram_trace,
    lagged_sums,
    primal_system,
    snapshot_gram,
)

Method = Literal["primal", "dual", "svd"]

GRAM_LIMIT = 1e-6
"""Least effective λ, as a part of the Gram matrix's trace, for which that is formed.

Its condition number is then below 1e6, and ten digits are left of sixteen."""

NARROW_LIMIT = 1e-10
"""The same where the newest rows alone are regressed, as forecasts have them.

Six digits are left at least, and eight to eleven at the λ that free runs choose on the virtual
tank: λ itself is known to half a decade."""


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
    clipped : tuple of float
        Moduli of the eigenvalues that were clipped, largest first.
    """

    coefficients: FloatArray
    method: Method
    ridge: float
    rank: int
    clipped: tuple[float, ...] = ()


def identify(
    states: Sequence[FloatArray],
    inputs: Sequence[FloatArray],
    windows: Sequence[TrainingWindow],
    *,
    state_delays: int | None,
    input_delays: int,
    ridge: float,
    direct: Sequence[FloatArray] | None = None,
    per_snapshot: bool = False,
    rank: int | None = None,
    all_rows: bool = True,
    method: Method | None = None,
    radius: float | None = None,
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
        s and z. With `state_delays` None the states are targets and no regressors: a filter of
        the inputs, for which `all_rows` must be False.
    ridge : float
        λ, zero or positive. Zero gives the solution of least norm.
    direct : sequence of ndarray, each (time, D), optional
        Further inputs of the runs, which enter without delays.
    per_snapshot : bool, optional
        Whether λ is multiplied by the number of columns.
    rank : int, optional
        Number of singular values kept, instead of λ (truncated-SVD DMD).
    all_rows : bool, optional
        Whether the rows of the delayed states are regressed too, as in the paper, or the first N
        alone.
    method : {"primal", "dual", "svd"}, optional
        Forces a form; by default shape and conditioning decide.
    radius : float, optional
        Eigenvalues outside it are clipped (:func:`clip_modes`).

    Returns
    -------
    Solution
        Coefficients of shape (N(s+1) or N, N(s+1) + Q(z+1) + D): states, inputs, direct inputs.
    """
    groups = [] if state_delays is None else [(states, state_delays)]
    groups.append((inputs, input_delays))
    if direct is not None:
        groups.append((direct, 0))
    problem = Delayed(states, groups, windows)
    effective = ridge * problem.columns if per_snapshot else ridge
    chosen = "svd" if rank is not None else method or _choose(problem, effective, all_rows)
    if chosen == "svd":
        solution = by_singular_values(*_matrices(problem, all_rows), effective, rank)
    else:
        form = _primal if chosen == "primal" else _dual
        count = min(problem.rows, problem.columns)
        solution = Solution(form(problem, effective, all_rows), chosen, effective, count)
    if radius is None or state_delays is None:
        return solution
    size = problem.groups[0].stop
    rows, clipped = clip_modes(solution.coefficients[:, :size], radius)
    coefficients = np.concatenate([rows, solution.coefficients[:, size:]], axis=1)
    return replace(solution, coefficients=coefficients, clipped=clipped)


def _choose(problem: Delayed, ridge: float, all_rows: bool) -> Method:
    """The form that is less work, or singular values where λ is too small for a Gram matrix."""
    p, n, a = problem.rows, problem.columns, problem.groups[0].stop
    is_narrow = not all_rows and p <= n
    if ridge < (NARROW_LIMIT if is_narrow else GRAM_LIMIT) * gram_trace(problem):
        return "svd"
    if not all_rows:
        return "primal" if is_narrow else "dual"
    # By their largest terms.
    rank = 2 * (problem.groups[-1].head.stop + len(problem.pieces))
    primal = p**3 / 3 + 2 * rank * p * (p + a)
    dual = n**3 / 3 + n * n * p + n * a * (2 * p - a)
    return "primal" if primal <= dual else "dual"


def _matrices(problem: Delayed, all_rows: bool) -> tuple[FloatArray, FloatArray]:
    """Hankel matrices of regressors and targets, built."""
    target_delays = problem.delays[0] if all_rows else 0
    regressors, targets = [], []
    for piece in problem.pieces:
        groups = zip(piece.series, problem.delays, strict=True)
        extended = [embed(x, delay, piece.first, piece.count) for x, delay in groups]
        regressors.append(np.concatenate(extended))
        targets.append(embed(piece.states, target_delays, piece.first + 1, piece.count))
    return np.concatenate(regressors, axis=1), np.concatenate(targets, axis=1)


def _primal(problem: Delayed, ridge: float, all_rows: bool) -> FloatArray:
    r"""Coefficients from :math:`C = \hat Y \hat Y^T`."""
    system = primal_system(problem)
    factor = factorise(system.gram, ridge)
    return _all_rows(system, factor, ridge) if all_rows else solve_rows(factor, system.right)


def _dual(problem: Delayed, ridge: float, all_rows: bool) -> FloatArray:
    r"""Coefficients from :math:`K = \hat Y^T \hat Y`.

    With :math:`K + \lambda I = L L^T` the newest rows are :math:`(K + \lambda I)^{-1} X'^T`
    summed against the lagged series; all rows are :math:`\hat X' L^{-T} Z` with
    :math:`Z = L^{-1} \hat Y^T`, and those of the delayed states are :math:`P Z^T Z`.
    """
    targets = np.concatenate([piece.targets for piece in problem.pieces])
    N = targets.shape[1]
    factor = factorise(snapshot_gram(problem), ridge)
    if not all_rows:
        weights = solve_rows(factor, targets.T.copy()).T
        top, at = np.zeros((N, problem.rows)), 0
        for piece in problem.pieces:
            own = weights[at : at + piece.count]
            at += piece.count
            for series, group in zip(piece.series, problem.groups, strict=True):
                top[:, group.rows] += lagged_sums(own, series, piece.first, group.lags)
        return top
    stacked = np.concatenate([_matrices(problem, all_rows)[0], targets.T])
    half = blas.dtrsm(1.0, factor, stacked.T, lower=1, overwrite_b=1)
    regressors, newest = half[:, : problem.rows], half[:, problem.rows :]
    out = np.empty((problem.groups[0].stop, problem.rows))
    np.matmul(newest.T, regressors, out=out[:N])
    np.matmul(regressors[:, : len(out) - N].T, regressors, out=out[N:])
    return out


def by_singular_values(
    regressors: FloatArray, targets: FloatArray, ridge: float = 0.0, rank: int | None = None
) -> Solution:
    """Ridge regression of plain matrices, or least squares of least norm.

    Parameters
    ----------
    regressors, targets : ndarray, shapes (p, columns) and (q, columns)
        One column per observation.
    ridge : float, optional
        λ, zero or positive. Zero gives the solution of least norm.
    rank : int, optional
        Number of singular values kept, instead of λ.

    Returns
    -------
    Solution
        Coefficients of shape (q, p).
    """
    # A rank replaces λ.
    ridge = ridge if rank is None else 0.0
    left, values, right = linalg.svd(regressors, full_matrices=False, check_finite=False)
    # Below this, a singular value is rounding (the rule of numpy.linalg.matrix_rank).
    floor = np.finfo(float).eps * max(regressors.shape) * (values[0] if values.size else 0.0)
    count = int(np.count_nonzero(values > floor))
    if rank is not None:
        count = min(count, rank)
    values = values[:count]
    weights = values / (values**2 + ridge)
    coefficients = ((targets @ right[:count].T) * weights) @ left[:, :count].T
    return Solution(coefficients, "svd", ridge, count)


def _all_rows(system: PrimalSystem, factor: FloatArray, ridge: float) -> FloatArray:
    r"""Coefficients of all rows of the next extended state, shape (N(s+1), p).

    The rows that shift the delayed states need no right-hand side: with P the rows of the
    identity that select the lags 0 … s−1 of the states, their targets are :math:`P \hat Y`, and
    :math:`P C M^{-1} = P - \lambda P M^{-1}`. `factor` is the lower Cholesky factor of M, in
    Fortran order; the Gram matrix of `system` is no longer looked at.
    """
    states = system.groups[0]
    N, extended, size = states.channels, states.stop, system.groups[-1].stop
    edges, width = len(system.edges), len(system.heads)
    # Whether neighbouring samples are alike: the sign of their products, summed.
    alike = [system.heads[g.head, g.older][:, : g.channels].trace() for g in system.groups]
    tau = -1.0 if sum(alike) >= 0 else 1.0
    rank = edges + 2 * width
    rows = np.empty((rank + N, size))
    rows[:edges] = system.edges
    newest, solving = rows[edges : edges + width], rows[edges + width : rank]
    newest[...] = 0.0
    solving[...] = system.heads
    for group in system.groups:
        np.fill_diagonal(newest[group.head, group.newest], 1.0)
        own = np.arange(group.channels)
        solving[group.head.start + own, group.start + own] += ridge
        solving[:, group.newest] *= 0.5
        _sum_over_lags(rows[:rank, group.rows], group.channels, tau)
    rows[rank:] = system.right
    solved = solve_rows(factor, rows)
    plus, minus = _generators(solved[:rank], system, tau)
    scale = np.sqrt(ridge)
    plus *= scale
    minus *= scale
    # One block of rows more than is returned: the oldest lag starts the running sums.
    out = np.empty((extended + N, size))
    out[:N] = solved[rank:]
    for columns in (slice(extended), slice(extended, None)):
        # A product of a matrix with its own transpose is symmetric to the last bit.
        np.matmul(minus[:, :extended].T, minus[:, columns], out=out[N:, columns])
        out[N:, columns] -= plus[:, :extended].T @ plus[:, columns]
    for at in range(extended - N, 0, -N):
        row, older = out[at : at + N], out[at + N : at + 2 * N]
        for group in system.groups:
            row[:, group.newer] += older[:, group.older]
    shifted = extended - N
    out[N:].reshape(-1)[: shifted * size : size + 1] += 1.0
    return out[:extended]


def _sum_over_lags(rows: FloatArray, channels: int, tau: float) -> None:
    """Apply the inverse of I − τ Z to each row, in its place."""
    lags = rows.reshape(len(rows), -1, channels)  # a view: only the last axis is split
    if tau < 0:
        lags[:, 1::2] *= -1.0
    np.cumsum(lags, axis=1, out=lags)
    if tau < 0:
        lags[:, 1::2] *= -1.0


def _generators(
    solved: FloatArray, system: PrimalSystem, tau: float
) -> tuple[FloatArray, FloatArray]:
    """Rows g of G with H − Zᵀ H Z = Σ g gᵀ over the first less the same over the second."""
    edges, width = len(system.edges), len(system.heads)
    moved = solved.copy()
    for group in system.groups:
        moved[:, group.newer] -= tau * solved[:, group.older]
    newest, heads = moved[edges : edges + width], moved[edges + width :]
    # E F^T + F E^T as a difference of squares, both parts of one size so that nothing cancels.
    balance = np.sqrt(np.linalg.norm(heads) / np.linalg.norm(newest))
    newest *= balance / np.sqrt(2.0)
    heads *= 1.0 / (balance * np.sqrt(2.0))
    plus = np.concatenate([moved[0:edges:2], newest + heads])
    minus = np.concatenate([moved[1:edges:2], newest - heads])
    return plus, minus


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
    least = len(gram) * float(np.finfo(float).eps * gram.diagonal().max())
    return np.stack(
        [solve_rows(factorise(gram.copy(), max(ridge, least)), right.copy()) for ridge in ridges]
    )


def factorise(gram: FloatArray, ridge: float) -> FloatArray:
    """Lower Cholesky factor, in Fortran order, of the upper triangle `gram` plus λ; in its place.

    The triangle above the factor keeps what stood there.
    """
    size = len(gram)
    gram.reshape(-1)[:: size + 1] += ridge
    factor, failed = lapack.dpotrf(gram.T, lower=1, overwrite_a=1, clean=0)
    if failed:
        raise np.linalg.LinAlgError(
            f"the Gram matrix of {size} rows with ridge {ridge:g} is not positive "
            "definite. Raise ridge."
        )
    return factor


def solve_rows(factor: FloatArray, rows: FloatArray) -> FloatArray:
    """Rows times the inverse of a matrix, by its lower Cholesky factor; in their place."""
    return lapack.dpotrs(factor, rows.T, lower=1, overwrite_b=1)[0].T


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
