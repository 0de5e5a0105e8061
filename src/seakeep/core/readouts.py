r"""Read-outs: the load of a line as a function of motions and of the wave at the line.

A part of a line's load is no linear function of the motions: the line wets and falls slack with
the wave at the place where it meets the water. A ridge regression on few features follows that, and
gives way to the linear forecast where a feature leaves the range of training.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from seakeep.arrays import FloatArray, IntArray

KNOTS = (0.15, 0.3, 0.5, 0.7, 0.85)
"""Quantiles of the surge at which the load bends."""
RIDGE = 1e-2
"""λ per sample on standardised features."""
MARGIN = 0.1
"""Part of the trained range by which a load goes beyond either end of it."""
SOFT = 0.5
"""Standard deviations beyond the trained range at which half of the weight is left."""
FLOOR = 0.002
"""Quantile of a slack channel that is its floor: what it rests on, less its noise."""
FLAT = 0.3
"""Slope up to which a channel is slack."""
LOWEST, SURELY, LEAST = (0.1, 0.03, 0.01), 4.0, 20
"""Parts of the samples in which a slack channel is looked for, the standard errors that are added
to their slopes, and the least number of samples that show one.

In irregular waves of the virtual tank, seed 0, the lowest hundredth of the line that falls slack
has a slope of 0.02 ± 0.04; in regular waves at λ/L 3 that of a taut line 0.22 ± 0.38."""


def features(values: list[Any], knots: FloatArray) -> list[Any]:
    """Features of a load.

    Parameters
    ----------
    values : list of array_like
        Surge, other motions, and elevation and rate of the wave at the line, standardised.
    knots : ndarray, shape (knot,)
        Where the load bends with the surge.

    Returns
    -------
    list of array_like
        The motions, hinges of the surge, and twelve functions of the wave.
    """
    *motions, wave, rate = values
    speed = np.absolute(rate)
    out = [*motions, *(np.maximum(motions[0] - knot, 0.0) for knot in knots)]
    out += [wave, rate, speed, np.square(wave), wave * rate, np.maximum(wave - 0.5, 0.0)]
    for begin in (0.0, 0.5, 1.0):
        wet = np.minimum(np.maximum((wave - begin) / 0.5, 0.0), 1.0)
        out += [wet * rate, wet * speed]
    return out


@dataclass(frozen=True, eq=False)
class LoadMap:
    r"""Load of a line as a function of states and of the wave at the line.

    The regression f, clipped to `span`, is blended with the state x of the load itself,
    :math:`x + (f - x) / (1 + 4 d^2)`, where d is the distance of motions and wave from the range
    of training, in standard deviations.

    Parameters
    ----------
    place : float
        Place of the line, m, positive downstream of the last probe.
    column : int
        Place of the load among the states.
    columns : list of int
        Places of surge and other motions.
    mean, std, low, high : ndarray, shape (len(columns) + 2,)
        Moments and range in training of these motions and of the wave's elevation and rate.
    knots : ndarray, shape (knot,)
        Where the load bends with the standardised surge.
    weights : ndarray, shape (1 + features,)
        Constant, and weights of the :func:`features`.
    span : ndarray, shape (2,)
        Least and largest value.
    """

    place: float
    column: int
    columns: list[int]
    mean: FloatArray
    std: FloatArray
    low: FloatArray
    high: FloatArray
    knots: FloatArray
    weights: FloatArray
    span: FloatArray

    def __call__(self, states: Any, wave: Any) -> Any:
        """The load, shape (…), of states, shape (…, N), and elevation and rate, shape (…, 2)."""
        given = [states[..., column] for column in self.columns] + [wave[..., 0], wave[..., 1]]
        values, apart, load = [], 1.0, self.weights[0]
        for x, mean, std, low, high in zip(
            given, self.mean, self.std, self.low, self.high, strict=True
        ):
            values.append((x - mean) / std)
            apart = apart + np.square(np.maximum(np.maximum(low - x, x - high), 0.0) / (SOFT * std))
        for weight, each in zip(self.weights[1:], features(values, self.knots), strict=True):
            load = load + weight * each
        state = states[..., self.column]
        bounded = np.minimum(np.maximum(load, self.span[0]), self.span[1])
        return state + (bounded - state) / apart


def sums(values: FloatArray, load: FloatArray, knots: FloatArray) -> FloatArray:
    """Products of constant, features and load, shape (2 + features, 2 + features).

    Parameters
    ----------
    values : ndarray, shape (sample, len(columns) + 2)
        Standardised motions and wave; see :func:`features`.
    load : ndarray, shape (sample,)
        The load.
    knots : ndarray, shape (knot,)
        Where the load bends with the surge.
    """
    rows = np.stack([np.ones(len(load)), *features([*values.T], knots), load])
    return rows @ rows.T


def weights_of(products: FloatArray) -> FloatArray:
    """Weights of constant and features by ridge regression, from sums, shape (…, F + 1, F + 1)."""
    gram, right = products[..., :-1, :-1].copy(), products[..., :-1, -1:]
    diagonal = np.arange(1, gram.shape[-1])
    gram[..., diagonal, diagonal] += RIDGE * gram[..., :1, 0]
    return np.asarray(np.linalg.solve(gram, right))[..., 0]


def best_place(products: FloatArray) -> int:
    """Place whose regression errs least on each run as the other runs teach it.

    Parameters
    ----------
    products : ndarray, shape (place, run, F + 1, F + 1)
        From :func:`sums`.
    """
    whole = products.sum(axis=1)
    errors = np.zeros(len(products))
    for run in range(products.shape[1]):
        others = whole - products[:, run] if products.shape[1] > 1 else whole
        left = np.concatenate([weights_of(others), np.full((len(whole), 1), -1.0)], axis=1)
        errors += np.einsum("pi,pij,pj->p", left, products[:, run], left)
    return int(errors.argmin())


def floor_of(states: FloatArray, target: FloatArray, columns: list[int], runs: IntArray) -> float:
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
    runs : ndarray of int, shape (sample,)
        Run of each sample, from 0 on; the map has a constant for each, since zeros of a sensor that
        differ from run to run look like a floor.

    Returns
    -------
    float
        The ``FLOOR`` quantile of the channel, or −inf.
    """
    constants = runs[:, None] == np.arange(runs.max() + 1)
    bending = np.concatenate([states[:, columns], constants], axis=1)
    linear = bending @ np.linalg.lstsq(bending, target, rcond=None)[0]
    rests = any(_slope(linear, target, part) < FLAT for part in LOWEST)
    return float(np.quantile(target, FLOOR)) if rests else -np.inf


def _slope(linear: FloatArray, target: FloatArray, part: float) -> float:
    """Slope of a channel over its linear map where that is lowest, plus standard errors."""
    low = linear <= np.quantile(linear, part)
    across = linear[low] - linear[low].mean()
    spread = float(across @ across)
    if not spread > 0 or len(across) < LEAST:
        return np.inf
    slope = float(across @ target[low]) / spread
    left = target[low] - target[low].mean() - slope * across
    return slope + SURELY * float(np.sqrt(left @ left / (len(across) - 2) / spread))
