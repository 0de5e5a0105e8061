r"""Rows of the inverse of a regularised Hankel Gram matrix from its displacement structure.

Let :math:`M = C + \lambda I` with :math:`C` of :mod:`seakeep.core.gram`, and let Z move the lags
down by one, newest first, filling with zeros. The recursion there says :math:`M - Z M Z^T = B
\Sigma B^T` of low rank: with E selecting the newest lags, α and β the edges of each run and
:math:`F = M E - \tfrac12 E E^T M E`,

.. math:: B \Sigma B^T = \alpha\alpha^T - \beta\beta^T + E F^T + F E^T .

The inverse :math:`H` has the same structure the other way round. For τ = ±1, multiplying
:math:`(I-\tau Z) M + M (I-\tau Z)^T - (I-\tau Z) M (I-\tau Z)^T = B \Sigma B^T` from both sides,
first by :math:`(I-\tau Z)^{-1}` and its transpose, then by H, then by :math:`(I-\tau Z)^T` and
:math:`(I-\tau Z)`, gives

.. math:: H - Z^T H Z = G \Sigma G^T , \qquad G = (I-\tau Z)^T H (I-\tau Z)^{-1} B ,

which determines H by running sums from the oldest lag. So H costs 2(N+Q+R) solutions (R runs), a
product of that rank and one addition an entry, in the place of inverting. :math:`(I-\tau
Z)^{-1}` sums a series over its lags; τ = −1 sums it with turning signs, which keeps a smooth
series small, and τ = 1 one that turns its sign at every sample.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.linalg import lapack

from seakeep.core.gram import PrimalSystem

__all__ = ["ridge_rows"]

FloatArray = npt.NDArray[np.float64]


def ridge_rows(system: PrimalSystem, factor: FloatArray, ridge: float) -> FloatArray:
    r"""Coefficients of all rows of the next extended state.

    The rows that shift the delayed states need no right-hand side: with P the rows of the
    identity that select the lags 0 … s−1 of the states, their targets are :math:`P \hat Y`, and
    :math:`P C M^{-1} = P - \lambda P M^{-1}`.

    Parameters
    ----------
    system : PrimalSystem
        Heads, edges and right-hand side; its Gram matrix is no longer looked at.
    factor : ndarray, shape (p, p)
        Lower Cholesky factor of M, in Fortran order.
    ridge : float
        λ.

    Returns
    -------
    ndarray, shape (N(s+1), p)
        [Â B̂], states first.
    """
    N, Q, inputs = system.states, system.channels, system.inputs
    size = system.right.shape[1]
    extended, width, edges = size - inputs, N + Q, len(system.edges)
    tau = -1.0 if _is_smooth(system) else 1.0
    rank = edges + 2 * width
    rows = np.empty((rank + N, size))
    rows[:edges] = system.edges
    newest, solving = rows[edges : edges + width], rows[edges + width : rank]
    newest[...] = 0.0
    solving[...] = system.heads
    for at, begin, count in ((0, 0, Q), (Q, inputs, N)):
        own = np.arange(count)
        newest[at + own, begin + own] = 1.0
        solving[at + own, begin + own] += ridge
        solving[:, begin : begin + count] *= 0.5
    _sum_over_lags(rows[:rank, :inputs], Q, tau)
    _sum_over_lags(rows[:rank, inputs:], N, tau)
    rows[rank:] = system.right
    solved = np.asarray(lapack.dpotrs(factor, rows.T, lower=1, overwrite_b=1)[0]).T
    plus, minus = _generators(solved[:rank], system, tau)
    # One block of rows more than is returned: the oldest lag begins the running sums.
    out = np.empty((extended + N, size))
    out[:N, :extended] = solved[rank:, inputs:]
    out[:N, extended:] = solved[rank:, :inputs]
    scale = np.sqrt(ridge)
    for generator in (plus, minus):
        generator *= scale
    for columns, source in (
        (slice(extended), slice(inputs, None)),
        (slice(extended, None), slice(inputs)),
    ):
        # A product of a matrix with its own transpose is symmetric to the last bit.
        np.matmul(minus[:, inputs:].T, minus[:, source], out=out[N:, columns])
        out[N:, columns] -= plus[:, inputs:].T @ plus[:, source]
    for at in range(extended - N, 0, -N):
        row, older = out[at : at + N], out[at + N : at + 2 * N]
        row[:, : extended - N] += older[:, N:extended]
        row[:, extended : size - Q] += older[:, extended + Q :]
    shifted = extended - N
    out[N:].reshape(-1)[: shifted * size : size + 1] += 1.0
    return out[:extended]


def _is_smooth(system: PrimalSystem) -> bool:
    """Whether neighbouring samples are alike: the sign of their products, summed."""
    N, Q, inputs = system.states, system.channels, system.inputs
    total = float(np.trace(system.heads[Q:, inputs + N : inputs + 2 * N]))
    if inputs > Q:
        total += float(np.trace(system.heads[:Q, Q : 2 * Q]))
    return total >= 0


def _sum_over_lags(rows: FloatArray, channels: int, tau: float) -> None:
    """Apply the inverse of I − τ Z to each row, in its place."""
    if not rows.shape[1]:
        return
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
    N, Q, inputs = system.states, system.channels, system.inputs
    size, edges, width = solved.shape[1], len(system.edges), N + Q
    moved = solved.copy()
    moved[:, : inputs - Q] -= tau * solved[:, Q:inputs]
    moved[:, inputs : size - N] -= tau * solved[:, inputs + N :]
    newest, heads = moved[edges : edges + width], moved[edges + width :]
    # E F^T + F E^T as a difference of squares, both parts of one size so that nothing cancels.
    balance = np.sqrt(np.linalg.norm(heads) / np.linalg.norm(newest))
    newest *= balance / np.sqrt(2.0)
    heads *= 1.0 / (balance * np.sqrt(2.0))
    plus = np.concatenate([moved[0:edges:2], newest + heads])
    minus = np.concatenate([moved[1:edges:2], newest - heads])
    return plus, minus
