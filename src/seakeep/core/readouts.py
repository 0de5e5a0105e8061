r"""Read-outs: a channel as a function of what a model forecasts, with hinges.

A line that falls slack is no linear function of the motion: its load stops at a floor. A hinge
:math:`\max(0, x - q)` bends at a knot q, and a ridge regression on states and hinges makes any
function that is linear between the knots.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from seakeep.arrays import FloatArray

__all__ = ["LinearHinges", "fit_hinges", "hinges", "knots_of"]

KNOTS = 6
"""Knots per state: quantiles from 0.05 to 0.95. Four to ten gave the same within 2 %."""


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
        features = _features(states, self.linear, self.columns, self.knots)
        value: FloatArray = features @ self.weights[1:] + self.weights[0]
        return np.maximum(value, self.floor)


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


def _features(
    states: FloatArray, linear: list[int], columns: list[int], knots: FloatArray
) -> FloatArray:
    return np.concatenate([states[..., linear], hinges(states, columns, knots)], axis=-1)
