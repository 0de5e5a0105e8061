r"""Read-outs: a channel as a function of what a model forecasts, with hinges.

A line that falls slack is not a linear function of the motion: its load stops at a floor. A hinge
:math:`\max(0, x - q)` bends at a knot q, and a ridge regression on states and hinges makes any
function that is linear between the knots.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from seakeep.arrays import FloatArray

KNOTS = 6
"""Knots per state: quantiles from 0.05 to 0.95. Four to ten gave the same within 2 %."""
FLOOR = 0.002
"""Quantile of a slack channel that is its floor: what it rests on, less its noise."""
LOW, FLAT = 0.1, 0.3
"""Part of the samples in which a slack channel is looked for, and the slope up to which it is."""
LOWEST, SURELY, LEAST = (0.03, 0.01), 4.0, 20
"""Smaller parts, for lines that are seldom slack, the standard errors that are added to their
slopes, and the least number of samples that show one.

In irregular waves of the virtual tank, seed 0, the lowest hundredth of the line that falls slack
has a slope of 0.02 ± 0.04; in regular waves at λ/L 3 that of a taut line 0.22 ± 0.38."""


def knots_of(states: FloatArray, columns: list[int]) -> FloatArray:
    """Knots of some states, shape (len(columns), KNOTS): quantiles of what they did."""
    quantiles: FloatArray = np.quantile(states[:, columns], np.linspace(0.05, 0.95, KNOTS), axis=0)
    return quantiles.T


def hinges(states: FloatArray, columns: list[int], knots: FloatArray) -> FloatArray:
    """Hinges of some states.

    Parameters
    ----------
    states : ndarray, shape (…, N)
        States.
    columns : list of int
        Those that bend.
    knots : ndarray, shape (len(columns), K)
        Where they bend.

    Returns
    -------
    ndarray, shape (…, len(columns) K)
    """
    bent = np.maximum(states[..., columns, None] - knots, 0.0)
    return bent.reshape(*states.shape[:-1], -1)


@dataclass(frozen=True, eq=False)
class LinearHinges:
    """A channel as a function of states that is linear between knots.

    Parameters
    ----------
    linear : list of int
        States that enter as they are.
    columns : list of int
        States that bend.
    knots : ndarray, shape (len(columns), K)
        Where they bend.
    weights : ndarray, shape (1 + len(linear) + len(columns) K,)
        Constant, weights of the states, weights of the hinges.
    floor : float
        Least value.
    """

    linear: list[int]
    columns: list[int]
    knots: FloatArray
    weights: FloatArray
    floor: float

    def __call__(self, states: FloatArray) -> FloatArray:
        """The channel, shape (…), of states, shape (…, N)."""
        # Term by term: the same bits for any other content of the array, and no table of all
        # hinges.
        terms = [(column, None) for column in self.linear]
        terms += [(c, q) for c, knots in zip(self.columns, self.knots, strict=True) for q in knots]
        value: Any = self.weights[0]
        for (column, knot), weight in zip(terms, self.weights[1:], strict=True):
            state = states[..., column]
            value = value + weight * (state if knot is None else np.maximum(state - knot, 0.0))
        result: FloatArray = np.maximum(value, self.floor)
        return result

    def rescaled(self, mean: FloatArray, scale: FloatArray, target: int) -> LinearHinges:
        """The same function of states with these means and scales, shape (N,), for one of them."""
        columns, K = self.columns, self.knots.shape[1]
        each = np.concatenate([scale[self.linear], np.repeat(scale[columns], K)])
        weights = self.weights[1:] * scale[target] / each
        constant = self.weights[0] * scale[target] + mean[target]
        constant -= weights[: len(self.linear)] @ mean[self.linear]
        return LinearHinges(
            self.linear,
            columns,
            self.knots * scale[columns, None] + mean[columns, None],
            np.concatenate([[constant], weights]),
            self.floor * float(scale[target]) + float(mean[target]),
        )


def fit_hinges(
    states: FloatArray,
    target: FloatArray,
    linear: list[int],
    columns: list[int],
    knots: FloatArray,
    ridge: float,
    floor: float,
) -> LinearHinges:
    """Fit a channel on states and their hinges by ridge regression.

    Parameters
    ----------
    states : ndarray, shape (sample, N)
        States, standardised.
    target : ndarray, shape (sample,)
        The channel, standardised.
    linear, columns, knots, floor
        As in :class:`LinearHinges`.
    ridge : float
        λ per sample; the constant is not regularised.

    Returns
    -------
    LinearHinges
    """
    features = _features(states, linear, columns, knots)
    mean, middle = features.mean(axis=0), float(target.mean())
    deviations = features - mean
    gram = deviations.T @ deviations
    gram[np.diag_indices_from(gram)] += ridge * len(states)
    weights = np.linalg.solve(gram, deviations.T @ (target - middle))
    constant = middle - float(mean @ weights)
    return LinearHinges(linear, columns, knots, np.concatenate([[constant], weights]), floor)


def resting(column: int, floor: float) -> LinearHinges:
    """A channel as it is, but never below its floor."""
    return LinearHinges([column], [], np.empty((0, KNOTS)), np.array([0.0, 1.0]), floor)


def floor_of(states: FloatArray, target: FloatArray, columns: list[int]) -> float:
    """Floor of a channel that rests on it, and −inf of one that does not.

    Where a line is slack its load stays as the motion goes on: in the tail of samples in which a
    linear map of the states that bend it is lowest, the load no longer follows that map. Where it
    does, no floor is known, and the least value of the training says nothing about higher waves.

    Parameters
    ----------
    states : ndarray, shape (sample, N)
        Measured states.
    target : ndarray, shape (sample,)
        The channel.
    columns : list of int
        States that bend it.

    Returns
    -------
    float
        The ``FLOOR`` quantile of the channel, or −inf.
    """
    bending = np.concatenate([states[:, columns], np.ones((len(states), 1))], axis=1)
    linear = bending @ np.linalg.lstsq(bending, target, rcond=None)[0]
    rests = _slope(linear, target, LOW)[0] < FLAT
    for part in LOWEST:
        slope, error = _slope(linear, target, part)
        rests = rests or slope + SURELY * error < FLAT
    return float(np.quantile(target, FLOOR)) if rests else -np.inf


def _slope(linear: FloatArray, target: FloatArray, part: float) -> tuple[float, float]:
    """Slope of a channel over its linear map where that is lowest, and its standard error."""
    low = linear <= np.quantile(linear, part)
    across = linear[low] - linear[low].mean()
    spread = float(across @ across)
    if not spread > 0 or len(across) < LEAST:
        return 1.0, np.inf
    slope = float(across @ target[low]) / spread
    left = target[low] - target[low].mean() - slope * across
    return slope, float(np.sqrt(left @ left / (len(across) - 2) / spread))


def _features(
    states: FloatArray, linear: list[int], columns: list[int], knots: FloatArray
) -> FloatArray:
    return np.concatenate([states[..., linear], hinges(states, columns, knots)], axis=-1)
