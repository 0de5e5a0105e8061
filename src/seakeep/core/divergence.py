r"""Jensen–Shannon divergence of two series, its interval, and its noise floor (paper, eq. JSD)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import rel_entr

from seakeep.arrays import FloatArray, as_bundle, as_real, as_series
from seakeep.core.bootstrap import BlockRule, bootstrap_indices, resolve_block_length
from seakeep.core.density import Bandwidth, bootstrapped_densities, checked_grid, kernel_density
from seakeep.errors import RequestError


@dataclass(frozen=True)
class JsdInterval:
    """Divergence of predicted and measured series over bootstrapped pairs.

    Attributes
    ----------
    mean, lower, upper : float
        Mean and quantiles 0.025 and 0.975 of `draws`, in nats.
    of_series : float
        Divergence of the series as they are, averaged over the predicted ones.
    noise_floor, noise_floor_lower, noise_floor_upper : float
        Mean and quantiles of `noise`.
    draws : ndarray, shape (predicted series, draw)
        The b-th redrawn prediction against the b-th redrawn measurement, from the same blocks.
    noise : ndarray, shape (draw,)
        The measurement against itself under two independent bootstraps.
    block_length : int
        Samples of a block.
    grid : ndarray, shape (grid,)
        Values at which the densities are given.
    predicted : ndarray, shape (predicted series, draw, grid)
        Densities of the redrawn predictions.
    measured : ndarray, shape (draw, grid)
        Densities of the redrawn measurements.
    """

    mean: float
    lower: float
    upper: float
    of_series: float
    noise_floor: float
    noise_floor_lower: float
    noise_floor_upper: float
    draws: FloatArray
    noise: FloatArray
    block_length: int
    grid: FloatArray
    predicted: FloatArray
    measured: FloatArray

    @property
    def uncertainty(self) -> float:
        """U of the paper, with the 0.975 that its table holds and its equation misprints."""
        return self.upper - self.lower


def jensen_shannon(p: npt.ArrayLike, q: npt.ArrayLike) -> FloatArray:
    r"""Jensen–Shannon divergence of two distributions on one grid.

    Parameters
    ----------
    p, q : array_like, shape (…, grid)
        Masses, or densities on one evenly spaced grid; normalised to a sum of 1 here. Multiply
        densities by the cell widths where the grid is uneven.

    Returns
    -------
    ndarray, shape (…), or float
        :math:`\tfrac12 D(p\,\|\,m) + \tfrac12 D(q\,\|\,m)`, :math:`m = \tfrac12 (p + q)`,
        natural logarithm: 0 where they agree, ln 2 where they do not overlap.

    Raises
    ------
    RequestError
        If the grids differ in length, or a mass is negative, not finite, or zero in sum.

    Examples
    --------
    >>> round(float(jensen_shannon([1.0, 0.0], [0.0, 1.0])), 4)
    0.6931
    """
    first, second = (as_real(x, name) for name, x in (("p", p), ("q", q)))
    if first.ndim < 1 or second.ndim < 1 or first.shape[-1] != second.shape[-1]:
        raise RequestError(
            f"p has shape {first.shape} and q {second.shape}; both must be given on one grid."
        )
    for name, mass in (("p", first), ("q", second)):
        if not np.all(np.isfinite(mass)) or np.any(mass < 0) or np.any(mass.sum(axis=-1) <= 0):
            raise RequestError(
                f"{name} must be finite and not negative, with a positive sum; received values "
                f"from {mass.min():g} to {mass.max():g}. Does the grid cover the series?"
            )
    first = first / first.sum(axis=-1, keepdims=True)
    second = second / second.sum(axis=-1, keepdims=True)
    middle = 0.5 * (first + second)
    total = rel_entr(first, middle).sum(axis=-1) + rel_entr(second, middle).sum(axis=-1)
    return np.asarray(np.clip(0.5 * total, 0.0, math.log(2.0)))


def jsd_interval(
    predicted: npt.ArrayLike,
    measured: npt.ArrayLike,
    *,
    block_length: int | BlockRule,
    rng: np.random.Generator,
    n_series: int = 100,
    bandwidth: Bandwidth = "paper",
    grid: npt.ArrayLike | None = None,
    segments: Sequence[int] | None = None,
) -> JsdInterval:
    """Divergence of predicted from measured series with its interval and noise floor.

    Parameters
    ----------
    predicted : array_like, shape (time,) or (series, time), or Dataset
        Predictions at the instants of `measured`; the draws of several (one of each training
        window) are pooled. With Datasets its channels are judged, each against the one of that
        name.
    measured : array_like, shape (time,), or Dataset over time
        Measurement.
    block_length : int, "carlstein" or "politis_white"
        Samples of a block, or the rule, applied to each measured channel.
    rng : numpy.random.Generator
        Source of the block starts; of Datasets each channel has a spawned child, in their order.
    n_series : int
        Number of redrawn series (100 in the paper).
    bandwidth : {"paper", "silverman"} or float
        As for :func:`seakeep.core.density.kernel_bandwidth`; each redrawn series has its own.
    grid : array_like, shape (grid,), optional
        Evenly spaced values that cover all series; by default 512 over their pooled range and
        three bandwidths on either side. Not with Datasets, whose channels have their own.
    segments : sequence of int, optional
        Lengths of the joined pieces; no block then crosses a join.

    Returns
    -------
    JsdInterval, or Dataset over ``channel``
        The Dataset holds the numbers without the draws, and ``uncertainty``.

    Raises
    ------
    RequestError
        If lengths differ, a setting is out of range, or the grid does not cover the series.
    DataError
        If a series is constant, has gaps or is too short, or units or instants differ.

    Notes
    -----
    The paper leaves the pairing open. Here the b-th prediction and the b-th measurement are
    redrawn from the same block starts, so that a perfect prediction has a divergence of exactly
    zero. The floor draws a second, independent set of the measurement: a divergence near it is
    one that a record of this length cannot distinguish from none. It is not a lower bound, because
    paired draws share their sampling error and the floor's do not.
    """
    m = as_series(measured, "measured")
    p = as_bundle(predicted, "predicted")
    if p.shape[1] != m.size:
        raise RequestError(
            f"predicted has {p.shape[1]} samples and measured {m.size}; the same block starts "
            "need the same length. Judge where both exist, on one time axis."
        )
    points = checked_grid(grid, [p, m], bandwidth)
    block = resolve_block_length(m, block_length, segments)
    positions, others = (bootstrap_indices(m.size, n_series, block, rng, segments) for _ in "ab")
    truth = bootstrapped_densities(m, positions, points, bandwidth)
    again = bootstrapped_densities(m, others, points, bandwidth)
    drawn = np.stack([bootstrapped_densities(x, positions, points, bandwidth) for x in p])
    draws = jensen_shannon(drawn, np.broadcast_to(truth, drawn.shape))
    own = jensen_shannon(kernel_density(p, points, bandwidth), kernel_density(m, points, bandwidth))
    noise = jensen_shannon(truth, again)
    low, high = np.quantile(draws, [0.025, 0.975])
    floor_low, floor_high = np.quantile(noise, [0.025, 0.975])
    return JsdInterval(
        mean=float(draws.mean()),
        lower=float(low),
        upper=float(high),
        of_series=float(np.mean(own)),
        noise_floor=float(noise.mean()),
        noise_floor_lower=float(floor_low),
        noise_floor_upper=float(floor_high),
        draws=draws,
        noise=noise,
        block_length=block,
        grid=points,
        predicted=drawn,
        measured=truth,
    )
