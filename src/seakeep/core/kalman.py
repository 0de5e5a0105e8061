r"""Kalman filter of a delay model: the newest sample is regressed, older ones shift.

The state is :math:`[x_{k-s}; …; x_{k-1}; x_k]`, oldest first, of a model
:math:`x_{k+1} = a\,[x_{k-s}; …; x_k] + f_k + w_k` with white noise w. A measurement reads some
rows of :math:`x_k`. The covariance depends on which rows were measured and on no value, so means
may be run again later with the same gains, once a forcing f is known that was a guess before.
"""

from collections.abc import Iterator
from itertools import islice

import numpy as np
from scipy import linalg

from seakeep.arrays import TINY, BoolArray, FloatArray


class DelayFilter:
    """Covariance and gains of the filter, in place: nothing grows from step to step.

    Parameters
    ----------
    a : ndarray, shape (N, N(s+1))
        Regressed rows, oldest block first.
    process : ndarray, shape (N, N)
        Covariance of the process noise.
    noise : ndarray, shape (N,)
        Variances of the measurement noise.

    Attributes
    ----------
    covariance : ndarray, shape (N(s+1), N(s+1))
        Of the state, which is known exactly at first.
    """

    def __init__(self, a: FloatArray, process: FloatArray, noise: FloatArray) -> None:
        self.a, self.process, self.noise = a, process, noise
        size = a.shape[1]
        self.covariance, self._next = np.zeros((2, size, size))

    def shift(self, newest: FloatArray | None = None) -> None:
        """One step in time.

        `newest`, shape (N, N), is the covariance of the new sample where it does not depend on
        those before; by default the model predicts it.
        """
        before, after = self.covariance, self._next
        count, size = self.a.shape
        older = size - count
        after[:older, :older] = before[count:, count:]
        if newest is None:
            top = self.a @ before
            after[older:, :older] = top[:, count:]
            # Exactly symmetric: an antisymmetric error of rounding would grow.
            block = top @ self.a.T + self.process
            after[older:, older:] = 0.5 * (block + block.T)
        else:
            after[older:, :older] = 0.0
            after[older:, older:] = newest
        after[:older, older:] = after[older:, :older].T
        self.covariance, self._next = after, before

    def limit(self, variances: FloatArray, *, exactly: bool = False) -> None:
        """Scale the newest sample's errors down to variances of shape (N,), or `exactly` to them.

        Correlations stay as they are.
        """
        newest = slice(len(self.covariance) - len(variances), None)
        variance = np.diagonal(self.covariance)[newest]
        factor = np.sqrt(variances / np.maximum(variance, TINY))
        if not exactly:
            factor = np.minimum(factor, 1.0)
        rows = self.covariance[newest] * factor[:, None]
        rows[:, newest] = self.covariance[newest, newest] * np.outer(factor, factor)
        self.covariance[newest], self.covariance[:, newest] = rows, rows.T  # exactly symmetric

    def measure(self, seen: BoolArray) -> FloatArray:
        """Update by the rows that were measured.

        Parameters
        ----------
        seen : ndarray of bool, shape (N,)
            Which rows of the newest sample were measured.

        Returns
        -------
        gain : ndarray, shape (N(s+1), N)
            What a unit of innovation adds to the state; zero columns for rows not measured.
        """
        count, size = self.a.shape
        gain = np.zeros((size, count))
        rows = np.flatnonzero(seen)
        if not rows.size:
            return gain
        places = size - count + rows
        cross = self.covariance[:, places]
        innovation = cross[places] + np.diag(self.noise[rows])
        weights = linalg.cho_solve(linalg.cho_factor(innovation, lower=True), cross.T).T
        self.covariance -= weights @ cross.T
        self.covariance += self.covariance.T.copy()
        self.covariance *= 0.5
        exact = places[self.noise[rows] == 0.0]
        self.covariance[exact] = 0.0
        self.covariance[:, exact] = 0.0
        gain[:, rows] = weights
        return gain

    def ahead(self, steps: int, raised: FloatArray) -> FloatArray:
        """Variances that today's errors alone leave after 1 … `steps` steps, shape (steps, N).

        Errors of each state are `raised` by a factor, shape (N,).
        """
        count, size = self.a.shape
        factors = np.tile(raised, size // count)
        covariance = self.covariance * np.outer(factors, factors)
        every = islice(reaches(self.a), steps)
        return np.stack([np.einsum("ij,ij->i", reach @ covariance, reach) for reach in every])

    def added_up(self, steps: int) -> FloatArray:
        """Variances of free runs after `steps` steps, shape (N,), by the process noise alone."""
        count = len(self.a)
        out = np.diagonal(self.process).copy()
        for reach in islice(reaches(self.a), steps - 1):
            newest = reach[:, -count:]
            out += np.einsum("ij,ij->i", newest @ self.process, newest)
        return out


def reaches(a: FloatArray) -> Iterator[FloatArray]:
    """Rows that carry a delayed state 1, 2, … steps ahead, each shape (N, N(s+1))."""
    count, size = a.shape
    reach = a
    while True:
        yield reach
        on = reach[:, size - count :] @ a
        on[:, count:] += reach[:, : size - count]
        reach = on


def process_noise(residual: FloatArray, a: FloatArray, noise: FloatArray) -> FloatArray:
    r"""Process noise that is left of one-step residuals when measurement noise is taken out.

    A residual of measured histories is :math:`w_k + v_{k+1} - a\,[v_{k-s}; …; v_k]`, so its
    covariance is Q + R + a (I ⊗ R) aᵀ.

    Parameters
    ----------
    residual : ndarray, shape (N, N)
        Covariance of the residuals.
    a : ndarray, shape (N, N(s+1))
        Regressed rows.
    noise : ndarray, shape (N,)
        Variances of the measurement noise.

    Returns
    -------
    ndarray, shape (N, N)
        Q; directions that the measurement noise would make negative are kept at 1e-6 of the
        residual's largest variance.
    """
    spread = np.sqrt(np.maximum(np.diagonal(residual), TINY))
    every = np.tile(noise, a.shape[1] // a.shape[0])
    left = (residual - np.diag(noise) - (a * every) @ a.T) / np.outer(spread, spread)
    values, vectors = linalg.eigh(left)
    sound = (vectors * np.maximum(values, 1e-6)) @ vectors.T
    return sound * np.outer(spread, spread)
