r"""Free runs of a model whose waves are read where the vessel is: one causal recursion.

The place of the vessel at instant j is a weighted sum of its last surges,
:math:`p_j = \sum_i h_i\, x_{j-i}`. What drives the step from j is a table over places, linear
between them:

.. math:: u_j = (1 - f)\, U_{j,g} + f\, U_{j,g+1}, \qquad
          x_{j+1} = A [x_j; …; x_{j-s}] + B [u_j; …; u_{j-z}] + D\, (p_j - \bar p)^2 + v_j .

Nothing but the table and the states up to j enters the step. Models of several λ and windows run
side by side.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from seakeep.arrays import FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Place:
    """Where waves are read: a weighted sum of the last surges, on a grid.

    Parameters
    ----------
    taps : ndarray, shape (P,)
        Weights of the last surges, newest first.
    lowest, spacing : float
        First place of the grid and the distance between two, m.
    count : int
        Number of places.
    centre : float
        Place about which the slow surge is squared, m.
    """

    taps: FloatArray = field(repr=False)
    lowest: float
    spacing: float
    count: int
    centre: float

    @property
    def grid(self) -> FloatArray:
        """Places, m."""
        return self.lowest + self.spacing * np.arange(float(self.count))

    @property
    def highest(self) -> float:
        """Last place, counted on the grid; a hair before it, so that there is one above it."""
        return float(np.nextafter(self.count - 1.0, 0.0))

    def of(self, surge: FloatArray) -> FloatArray:
        """Places of the samples from the P-th on, of a surge of shape (time,)."""
        position = np.convolve(surge, self.taps, "valid")
        return np.clip(position, self.lowest, self.grid[-1])


def read_table(
    place: Place, table: FloatArray, samples: IntArray, places: FloatArray
) -> FloatArray:
    """Rows of a table at samples and places, linear between two places.

    Parameters
    ----------
    place : Place
        The grid.
    table : ndarray, shape (time, place, column)
        What would drive a step at each sample and place.
    samples : ndarray of int, shape (…)
        Samples.
    places : ndarray, shape (…)
        Places within the grid, m.

    Returns
    -------
    ndarray, shape (…, column)
    """
    flat = table.reshape(-1, table.shape[2])
    on_grid = np.minimum((places - place.lowest) / place.spacing, place.highest)
    return _between(flat, np.diff(flat, axis=0), samples * place.count, on_grid[..., None])


def _between(
    flat: FloatArray, slopes: FloatArray, firsts: IntArray, on_grid: FloatArray
) -> FloatArray:
    """Rows at places that are counted on the grid, shape (…, 1), from the rows of samples on."""
    below = on_grid.astype(np.intp)
    rows = firsts + below[..., 0]
    read = slopes.take(rows, axis=0)
    read *= on_grid - below
    read += flat.take(rows, axis=0)
    return read


@dataclass(frozen=True, eq=False)
class Recursion:
    """Models of equal delays that run side by side.

    Parameters
    ----------
    on_states : ndarray, shape (model, N, N(s+1))
        A, newest block first.
    on_inputs : ndarray, shape (model, N, n(z+1))
        B, newest block first.
    on_square : ndarray, shape (model, N)
        D.
    gain, offset : float
        Surge of the vessel, m, of the state of the surge: offset + gain · x.
    column : int
        Place of the surge among the states.
    """

    on_states: FloatArray
    on_inputs: FloatArray
    on_square: FloatArray
    gain: float
    offset: float
    column: int


def recursion(
    models: Recursion,
    place: Place,
    histories: FloatArray,
    delayed: FloatArray,
    table: FloatArray,
    starts: IntArray,
    forcing: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Free runs of several models over several windows, side by side.

    Parameters
    ----------
    models : Recursion
        A, B and D.
    place : Place
        Where waves are read.
    histories : ndarray, shape (window, at least max(s + 1, P), N)
        States up to each start, oldest first.
    delayed : ndarray, shape (window, z, n)
        What drove the steps before each start, oldest first.
    table : ndarray, shape (time, place, n)
        What would drive the steps from each start on, at each place.
    starts : ndarray of int, shape (window,)
        Samples of the table from which the windows start.
    forcing : ndarray, shape (model, window, steps, N)
        v: what everything else adds at each step.

    Returns
    -------
    states : ndarray, shape (model, window, steps, N)
        States after the starts; not finite from where a run is lost.
    driving : ndarray, shape (model, window, steps, n)
        What drove the steps.
    """
    count, windows, steps, N = forcing.shape
    back, n = histories.shape[1], table.shape[2]
    size, width = models.on_states.shape[2], models.on_inputs.shape[2]
    # Newest first, so that the extended state of each step is a block of one buffer.
    states = np.empty((count, windows, (steps + back) * N))
    states[..., steps * N :] = histories[:, ::-1].reshape(windows, -1)
    states[..., : steps * N] = forcing[:, :, ::-1].reshape(count, windows, -1)
    inputs = np.empty((count, windows, steps * n + width - n))
    inputs[..., steps * n :] = delayed[:, ::-1].reshape(windows, -1)
    # One column more for the place on the grid, counted in its spacing.
    wide = max(size, models.column + (len(place.taps) - 1) * N + 1)
    on_states = np.zeros((count, wide, N + 1))
    on_states[:, :size, :N] = models.on_states.transpose(0, 2, 1)
    on_states[:, models.column :: N, N][:, : len(place.taps)] = (
        models.gain / place.spacing * place.taps
    )
    on_inputs = np.ascontiguousarray(models.on_inputs.transpose(0, 2, 1))
    on_square = place.spacing**2 * models.on_square[:, None]
    parts = (states, inputs, on_states, on_inputs, on_square)
    # One model alone needs no axis of its own, which saves a third of the time.
    x, u, a, b, d = (each[0] for each in parts) if count == 1 else parts
    product = np.dot if count == 1 else np.matmul
    still = (models.offset * place.taps.sum() - place.lowest) / place.spacing
    centre = (place.centre - place.lowest) / place.spacing
    flat = np.ascontiguousarray(table.reshape(-1, n))
    slopes, highest = np.diff(flat, axis=0), place.highest
    firsts = starts * place.count
    with np.errstate(over="ignore", invalid="ignore"):
        for step in range(steps):
            at, to = (steps - step) * N, (steps - 1 - step) * n
            computed = product(x[..., at : at + wide], a)
            # A run that is lost keeps a place; its states stay lost.
            here = np.fmin(np.fmax(computed[..., N:] + still, 0.0), highest)
            u[..., to : to + n] = _between(flat, slopes, firsts, here)
            computed = computed[..., :N] + product(u[..., to : to + width], b)
            here -= centre
            here *= here
            computed += here * d
            x[..., at - N : at] += computed
            firsts += place.count
    out = states[..., : steps * N].reshape(count, windows, steps, N)
    driving = inputs[..., : steps * n].reshape(count, windows, steps, n)
    return out[:, :, ::-1], driving[:, :, ::-1]
