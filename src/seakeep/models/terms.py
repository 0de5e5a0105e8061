"""What an observable computes: its columns, and the samples that these read.

An observable in a file of its own needs this module alone; see :mod:`seakeep.models.observables`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.core.observables import slow_squares
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
