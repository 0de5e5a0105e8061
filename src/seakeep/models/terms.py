r"""What an observable computes: its columns, and the samples that these read.

An observable in a file of its own needs this module alone; see :mod:`seakeep.models.observables`.

Slow drift and line loads go with the square of the wave, which no linear map of the elevation can
make. The slow parts of the squares of the elevation and of its derivatives weigh the drift force
by the frequency: :math:`D_0 + D_1 \omega^2 + D_2 \omega^4`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.models.labelled import ChannelLabel
from seakeep.signals.expressions import Expression


class Power(NamedTuple):
    r"""Columns as a power of inputs that grows like these far out.

    Each is :math:`u^q/(1 + u^2/L)^{(q-1)/2}` with a limit L of its own for each input.
    """

    places: tuple[int, ...]
    powers: tuple[int, ...]

    def columns(self, inputs: Any, limits: FloatArray) -> Any:
        """The columns of inputs, shape (time, Q), power by power."""
        u = inputs[:, list(self.places)]
        calm = u / np.sqrt(1.0 + u * u / limits[list(self.places)])
        return np.concatenate([u * calm ** (power - 1) for power in self.powers], axis=1)


class Formula(NamedTuple):
    """A column as an expression of inputs."""

    expression: Expression
    places: Mapping[str, int]

    def columns(self, inputs: Any, limits: FloatArray) -> Any:
        """The column of inputs, shape (time, Q)."""
        return self.expression.of(lambda name: inputs[:, [self.places[name]]])


class SlowSquare(NamedTuple):
    """Columns as the low-pass filtered square of a derivative of an input, at several lags.

    The middle of the filter lies one of `shifts` samples after the instant of the row.
    """

    place: int
    order: int
    kernel: FloatArray
    shifts: tuple[int, ...]
    dt: float

    def columns(self, inputs: FloatArray, limits: FloatArray) -> FloatArray:
        """The columns of inputs, shape (time, Q)."""
        return slow_squares(inputs[:, self.place], self.order, self.kernel, self.shifts, self.dt)


Term = Power | SlowSquare | Formula
"""Columns as Python and all other hosts compute them.

All but slow squares are arithmetic of numpy, which arrays, texts of C and nodes of graphs know."""


@dataclass(frozen=True, eq=False)
class Bound:
    """An observable of certain channels at a certain time step.

    Parameters
    ----------
    labels : tuple of ChannelLabel
        Its columns.
    columns : callable, optional
        From the inputs, shape (time, Q), to the columns, shape (time, len(labels)); rows are NaN
        where they need samples that are not there; by default what the terms say.
    terms : tuple of Power, SlowSquare or Formula, optional
        The columns as all hosts compute them; a model without runs in Python alone.
    stiffness : float, optional
        How much more λ weighs on the columns than on others.
    slope : float, optional
        Slope of the columns above the largest values of training.
    """

    labels: tuple[ChannelLabel, ...]
    columns: Callable[[FloatArray], FloatArray] | None = None
    terms: tuple[Term, ...] = ()
    stiffness: float = 1.0
    slope: float = 1.0

    def of(self, inputs: FloatArray, limits: FloatArray) -> FloatArray:
        """Columns of inputs, shape (time, Q), whose powers have limits, shape (Q,)."""
        if self.columns is not None:
            return self.columns(inputs)
        return np.concatenate([term.columns(inputs, limits) for term in self.terms], axis=1)


class Observable(Protocol):
    """Functions of the inputs; frozen, with fields that are JSON values.

    The columns take the input delays of the model where it is `delayed`, and stand as they are
    otherwise. A field ``period`` that is None becomes the encounter period of the runs, s.
    """

    kind: ClassVar[str]
    delayed: ClassVar[bool]

    def bind(self, inputs: Sequence[ChannelLabel], dt: float) -> Bound:
        """Columns for these inputs at a time step, s."""

    def reach(self, dt: float) -> tuple[int, int]:
        """Samples before and after an instant that its row reads, delays of the model apart."""


def slow_kernel(cutoff: float, half: int) -> FloatArray:
    """Low-pass filter of finite length: a sinc under a Hann window, with unit gain at rest.

    Parameters
    ----------
    cutoff : float
        Frequency of half gain, cycles per sample.
    half : int
        Samples on either side of the middle.

    Returns
    -------
    ndarray, shape (2 half + 1,)
    """
    lag = np.arange(-half, half + 1)
    kernel = np.sinc(2 * cutoff * lag) * np.hanning(2 * half + 3)[1:-1]
    return kernel / kernel.sum()


def derivative(series: FloatArray, order: int, dt: float) -> FloatArray:
    """Derivative of order 0, 1 or 2 by central differences; NaN where a neighbour is missing.

    Parameters
    ----------
    series : ndarray, shape (time,)
        Samples.
    order : {0, 1, 2}
        Order of the derivative.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray, shape (time,)
    """
    if order == 0:
        return series
    out = np.full(series.shape, np.nan)
    if order == 1:
        out[1:-1] = (series[2:] - series[:-2]) / (2.0 * dt)
    else:
        out[1:-1] = (series[2:] - 2.0 * series[1:-1] + series[:-2]) / dt**2
    return out


def slow_squares(
    series: FloatArray, order: int, kernel: FloatArray, shifts: Sequence[int], dt: float
) -> FloatArray:
    """Slow part of the square of a derivative of a series, at several lags.

    Parameters
    ----------
    series : ndarray, shape (time,)
        Elevation.
    order : {0, 1, 2}
        Order of the derivative that is squared.
    kernel : ndarray, shape (2 half + 1,)
        Low-pass filter, :func:`slow_kernel`.
    shifts : sequence of int
        Samples by which the middle of the filter lies ahead of the instant of a row, per column.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray, shape (time, len(shifts))
        A row is NaN where it needs a sample that `series` does not hold: ``shift + half + 1``
        ahead (``shift + half`` of the elevation itself) down to ``half + 1 - shift`` behind.
    """
    count, half = len(series), len(kernel) // 2
    out = np.full((count, len(shifts)), np.nan)
    if count < len(kernel):
        return out
    slow = np.full(count, np.nan)
    slow[half : count - half] = np.convolve(derivative(series, order, dt) ** 2, kernel, "valid")
    for column, shift in enumerate(shifts):  # row j holds the slow part at j + shift
        first, last = max(0, -shift), min(count, count - shift)
        if first < last:
            out[first:last, column] = slow[first + shift : last + shift]
    return out
