r"""Free runs of a model whose waves are read where the vessel is: one causal recursion.

The place of the vessel at instant j is a weighted sum of its last surges,
:math:`p_j = \sum_i h_i\, x_{j-i}`. What drives the step from j is a table over places, linear
between them:

.. math:: u_j = (1 - f)\, U_{j,g} + f\, U_{j,g+1}, \qquad
          x_{j+1} = A [x_j; …; x_{j-s}] + B [u_j; …; u_{j-z}] + D\, (p_j - \bar p)^2 + v_j .

Nothing but the table and the states up to j enters the step. Models of several λ and windows run
side by side.
"""

from dataclasses import dataclass, field

import numpy as np

from seakeep.arrays import FloatArray, IntArray, undefined


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
        highest = self.lowest + self.spacing * (self.count - 1)
        return np.minimum(np.maximum(position, self.lowest), highest)


def carried(taps: FloatArray, record: FloatArray) -> FloatArray:
    """Elevations at the places of carriers.

    Parameters
    ----------
    taps : ndarray, shape (place, probe, taps)
        Weights of samples about an instant, oldest first (:mod:`seakeep.signals.propagation`).
    record : ndarray, shape (time, probe)
        Elevations at the probes.

    Returns
    -------
    ndarray, shape (time − taps + 1, place)
        The first row belongs to the instant of sample `back`.
    """
    places, _, length = taps.shape
    if len(record) < length:
        return np.zeros((0, places))
    windows = np.lib.stride_tricks.sliding_window_view(record, length, axis=0)
    carried_to: FloatArray = windows.reshape(len(windows), -1) @ taps.reshape(places, -1).T
    return carried_to


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
    on_grid = np.minimum((places - place.lowest) / place.spacing, place.highest)
    flat = table.reshape(-1, table.shape[2])
    return _between(flat, samples * place.count, on_grid[..., None])


def read_row(flat: FloatArray, first: int, on_grid: float, out: FloatArray) -> None:
    """Read the row at a place that is counted on the grid, of the sample whose rows start so.

    A tenth of the time of :func:`read_table`, which does the same for many.
    """
    row = int(on_grid)
    part = on_grid - row
    row += first
    np.array((1.0 - part, part)).dot(flat[row : row + 2], out)


def _between(flat: FloatArray, firsts: IntArray, on_grid: FloatArray) -> FloatArray:
    """Rows at places that are counted on the grid, shape (…, 1), from the rows of samples on."""
    below = on_grid.astype(np.intp)
    rows = firsts + below[..., 0]
    read = flat.take(rows + 1, axis=0)
    value = flat.take(rows, axis=0)
    read -= value
    read *= on_grid - below
    read += value
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
    gain, offset : ndarray, shape (model,)
        Surge of the vessel, m, of the state of the surge: offset + gain · x.
    column : int
        Place of the surge among the states.
    """

    on_states: FloatArray
    on_inputs: FloatArray
    on_square: FloatArray
    gain: FloatArray
    offset: FloatArray
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
    histories : ndarray, shape (model, window, at least max(s + 1, P), N)
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
    back, n = histories.shape[2], table.shape[2]
    size, width = models.on_states.shape[2], models.on_inputs.shape[2]
    # Newest first, so that the extended state of each step is a block of one buffer.
    states = np.empty((count, windows, (steps + back) * N))
    states[..., steps * N :] = histories[:, :, ::-1].reshape(count, windows, -1)
    states[..., : steps * N] = forcing[:, :, ::-1].reshape(count, windows, -1)
    inputs = np.empty((count, windows, 1 + steps * n + width - n))
    inputs[..., 1 + steps * n :] = delayed[:, ::-1].reshape(windows, -1)
    # One column more for the place on the grid, counted in its spacing.
    wide = max(size, models.column + (len(place.taps) - 1) * N + 1)
    on_states = np.zeros((count, N + 1, wide))
    on_states[:, :N, :size] = models.on_states
    on_states[:, N, models.column :: N][:, : len(place.taps)] = np.outer(
        models.gain / place.spacing, place.taps
    )
    # A filter has no A: of its states the place alone is made.
    is_filter = not models.on_states.any()
    if is_filter:
        on_states = on_states[:, N:]
    # D stands before B, and the square before what drives the step, where the next step writes.
    on_square = place.spacing**2 * models.on_square[..., None]
    on_inputs = np.concatenate([on_square, models.on_inputs], axis=2)
    # Rows stay in one piece: products with few windows take half of the time.
    turned = (each.transpose(0, 2, 1) for each in (on_states, on_inputs))
    parts = (states, inputs, *turned)
    # One model alone needs no axis of its own, and one window none and no arrays of one number:
    # half of the time each.
    x, u, a, b = (each[0] for each in parts) if count == 1 else parts
    is_alone = count == windows == 1
    if is_alone:
        x, u = x[0], u[0]
    product = np.ndarray.dot if count == 1 else np.matmul
    each_still = (models.offset * place.taps.sum() - place.lowest) / place.spacing
    still = float(each_still[0]) if count == 1 else each_still[:, None, None]
    centre = (place.centre - place.lowest) / place.spacing
    flat, highest = np.ascontiguousarray(table.reshape(-1, n)), place.highest
    firsts, first = starts * place.count, int(starts[0]) * place.count
    with undefined():
        for step in range(steps):
            at, to = (steps - step) * N, (steps - 1 - step) * n + 1
            computed = product(x[..., at : at + wide], a)
            # A run that is lost keeps a place; its states stay lost.
            if is_alone:
                alone = min(max(0.0, float(computed[-1]) + still), highest)
                read_row(flat, first + step * place.count, alone, u[to : to + n])
                u[to - 1] = (alone - centre) ** 2
            else:
                here = np.fmin(np.fmax(computed[..., -1:] + still, 0.0), highest)
                u[..., to : to + n] = _between(flat, firsts + step * place.count, here)
                u[..., to - 1 : to] = (here - centre) ** 2
            new = x[..., at - N : at]
            if not is_filter:
                new += computed[..., :N]
            new += product(u[..., to - 1 : to + width], b)
    out = states[..., : steps * N].reshape(count, windows, steps, N)
    driving = inputs[..., 1 : 1 + steps * n].reshape(count, windows, steps, n)
    return out[:, :, ::-1], driving[:, :, ::-1]
