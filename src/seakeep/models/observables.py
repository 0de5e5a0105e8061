"""Observables: functions of the measured inputs that a model takes as further inputs.

An observable is added by one class with the members of :class:`seakeep.models.terms.Observable` and
one line in ``OBSERVABLES``.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from seakeep.arrays import (
    TINY,
    Datasets,
    FloatArray,
    check_choice,
    check_keys,
    names_of,
    number,
)
from seakeep.errors import SHOWN, RequestError, did_you_mean
from seakeep.models import labelled
from seakeep.models.labelled import ChannelLabel
from seakeep.models.terms import Bound, Formula, Observable, Power, SlowSquare, slow_kernel
from seakeep.signals import expressions

HALF_WIDTH = 0.5
"""Half of the length of the low-pass filter of :class:`SlowSquares`, in periods of its cutoff.

With a cutoff of 1/3 per encounter period that is 1.5 encounter periods: a wave of half the
encounter period's frequency is damped to a fifth, one at the encounter frequency to a hundredth."""
BOUND = 36.0
"""Squared standard deviations of an input at which its powers begin to grow like the input."""
STIFF = 100.0
"""How much more λ weighs on powers: an error of a high wave is an error of its cube."""
SLOPE = 0.7
"""Slope of slow squares above the largest of training: a force does not grow for ever."""


def _column(inputs: Sequence[ChannelLabel], name: str, what: str) -> int:
    names = [label.name for label in inputs]
    if name not in names:
        raise RequestError(
            f"{what} of '{name}': no such input.{did_you_mean(name, names)} Inputs of the model: "
            f"{', '.join(names) or 'none'}."
        )
    return names.index(name)


def _numbers(
    value: Any, what: str, meant: str, low: float, high: float = math.inf, whole: bool = False
) -> tuple[Any, ...]:
    """Numbers in a list, each once and within bounds; one number is a list of it."""
    given = value if isinstance(value, Iterable) else (value,)
    numbers = tuple(each.item() if isinstance(each, np.generic) else each for each in given)
    for each in numbers:
        number(each, what, meant, low, high)
    if not numbers or len(set(numbers)) < len(numbers):
        raise RequestError(f"{what} must be {meant}, each once; received {value!r:.{SHOWN}}.")
    if not whole:
        return numbers
    if strange := [each for each in numbers if each != int(each)]:
        raise RequestError(f"{what} must be {meant}; received {strange[0]!r}.")
    return tuple(map(int, numbers))


def _inputs(value: Any, what: str) -> tuple[str, ...]:
    listed = (value,) if isinstance(value, str) else value
    return names_of(listed, f"{what}: of", "of='eta_fwd'")


def _power(unit: str, power: int) -> str:
    if not unit or unit == "1":
        return unit
    return f"({unit})^{power}" if any(sign in unit for sign in "/*· ") else f"{unit}^{power}"


@dataclass(frozen=True)
class SlowSquares:
    """Slow parts of squares of an elevation and of its derivatives.

    Slow drift and the loads of mooring lines go with them. They stand among the regressors without
    the delays of the model, at lags of their own. Above the largest of training they grow by 0.7
    of what they would.

    Parameters
    ----------
    of : str or sequence of str
        Elevations among the inputs: the one at the vessel, where there is one, else all of them.
    orders : sequence of {0, 1, 2}, optional
        Orders of the derivatives. Each weighs the drift force by another power of the frequency.
    cutoff : float, optional
        Frequency of half gain of the low-pass filter, per encounter period.
    lead : float, optional
        How far ahead of an instant its row reads the elevation, encounter periods.
    lags : sequence of float, optional
        Lags of the columns, encounter periods.
    period : float, optional
        Encounter period, s; by default that of the training runs.

    Raises
    ------
    RequestError
        If a setting is out of range.
    """

    of: tuple[str, ...]
    orders: tuple[int, ...] = (0, 1, 2)
    cutoff: float = 1 / 3
    lead: float = 2.0
    lags: tuple[float, ...] = (0, 1, 2, 3, 4, 5)
    period: float | None = None
    kind: ClassVar[str] = "slow_squares"
    delayed: ClassVar[bool] = False

    def __post_init__(self) -> None:
        orders = _numbers(self.orders, "slow_squares: orders", "0, 1 or 2", 0, 3, whole=True)
        lags = _numbers(self.lags, "slow_squares: lags", "encounter periods from 0", 0)
        object.__setattr__(self, "of", _inputs(self.of, self.kind))
        object.__setattr__(self, "orders", orders)
        object.__setattr__(self, "lags", lags)
        meant = "per encounter period, above 0 and at most 1"
        number(self.cutoff, "slow_squares: cutoff", meant, TINY, math.nextafter(1, 2))
        number(self.lead, "slow_squares: lead", "encounter periods from 0", 0)
        if self.period is not None:
            number(self.period, "slow_squares: period", "seconds above 0", TINY)

    def bind(self, inputs: Sequence[ChannelLabel], dt: float) -> Bound:
        """Columns for these inputs; see :class:`Observable`."""
        places = [_column(inputs, name, self.kind) for name in self.of]
        kernel, reach, ahead, lags = self._places(dt)
        shifts = tuple(ahead - reach - lag for lag in lags)
        labels, terms = [], []
        for place in places:
            label = inputs[place]
            for order in self.orders:
                rate = ("", "/s", "/s^2")[order]
                unit = label.units and _power(label.units + rate, 2)
                dots = ("", "_rate", "_acceleration")[order]
                terms.append(SlowSquare(place, order, kernel, shifts, dt))
                for lag in self.lags:
                    words = f"slow part of the square of {label.long_name}{dots.replace('_', ' ')}"
                    name = f"slow_{label.name}{dots}_squared_{lag:g}T"
                    labels.append(ChannelLabel(name, unit, f"{words}, {lag:g} periods before"))
        return Bound(tuple(labels), terms=tuple(terms), slope=SLOPE)

    def reach(self, dt: float) -> tuple[int, int]:
        """Samples around an instant; see :class:`Observable`."""
        _, reach, ahead, lags = self._places(dt)
        return max(0, 2 * reach + max(lags) - ahead), ahead

    def _places(self, dt: float) -> tuple[FloatArray, int, int, list[int]]:
        """Filter, its reach either side with the differences, look-ahead, and lags, in samples."""
        if self.period is None:
            raise RequestError(
                "slow_squares counts in encounter periods, and how far it reads is asked before "
                "there are runs to count them in. State its period (s)."
            )
        period = self.period / dt
        kernel = slow_kernel(self.cutoff / period, round(HALF_WIDTH / self.cutoff * period))
        reach = len(kernel) // 2 + (max(self.orders) > 0)
        return kernel, reach, round(self.lead * period), [round(lag * period) for lag in self.lags]


def counted_in(observable: Observable, period: float | None) -> Observable:
    """An observable that counts in an encounter period (s) where it states no other."""
    if getattr(observable, "period", 0.0) is None:
        return replace(observable, period=period)  # type: ignore[type-var]
    return observable


def at_once(observable: Observable) -> Observable:
    """An observable without lags, the middle of its filter at the instant itself."""
    if isinstance(observable, SlowSquares):
        return replace(observable, lags=(0,), lead=HALF_WIDTH / observable.cutoff)
    return observable


@dataclass(frozen=True)
class Powers:
    r"""Powers of inputs, with the input delays of the model.

    Steep waves move a vessel at wave frequency by more than a linear map of the elevation makes.
    Powers stay bounded by the input far out, :math:`u^q/(1 + u^2/36σ^2)^{(q-1)/2}`, so that seas
    above those of training are not answered by their cubes; where a model follows its own surge, λ
    weighs a hundred times on them.

    Parameters
    ----------
    of : str or sequence of str
        Inputs.
    powers : sequence of int, optional
        Exponents, 2 to 5.

    Raises
    ------
    RequestError
        If a setting is out of range.
    """

    of: tuple[str, ...]
    powers: tuple[int, ...] = (2, 3)
    kind: ClassVar[str] = "powers"
    delayed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "of", _inputs(self.of, self.kind))
        powers = _numbers(self.powers, "powers: powers", "integers from 2 to 5", 2, 6, whole=True)
        object.__setattr__(self, "powers", powers)

    def bind(self, inputs: Sequence[ChannelLabel], dt: float) -> Bound:
        """Columns for these inputs; see :class:`Observable`."""
        places = [_column(inputs, name, self.kind) for name in self.of]
        labels = [
            ChannelLabel(
                f"{inputs[place].name}_power_{power}",
                _power(inputs[place].units, power),
                f"{inputs[place].long_name} to the power of {power}",
            )
            for power in self.powers
            for place in places
        ]
        power = Power(tuple(places), self.powers)
        return Bound(tuple(labels), terms=(power,), stiffness=STIFF)

    def reach(self, dt: float) -> tuple[int, int]:
        """0, 0: the instant itself."""
        return 0, 0


@dataclass(frozen=True)
class Expression:
    """An expression of inputs, with the input delays of the model.

    Parameters
    ----------
    name : str
        Name of the column.
    expression : str
        Arithmetic of inputs, as in a derived channel of a campaign: ``"wind**2"``. ``mean`` of one
        value is refused: a row must not depend on the rest of the record.

    Raises
    ------
    RequestError
        If it is not an expression.
    """

    name: str
    expression: str
    units: str = ""
    kind: ClassVar[str] = "expression"
    delayed: ClassVar[bool] = True

    def __post_init__(self) -> None:
        for key in ("name", "expression"):
            if not isinstance(text := getattr(self, key), str) or not text:
                raise RequestError(f"expression: {key} must be a text; received {text!r:.{SHOWN}}.")
        if "mean(" in self.expression.replace(" ", ""):
            raise RequestError(
                f"expression {self.expression!r}: mean is over all of a record, which a row must "
                "not depend on. Write the number, or average(a, b)."
            )
        expressions.parse(self.expression)

    def bind(self, inputs: Sequence[ChannelLabel], dt: float) -> Bound:
        """Columns for these inputs; see :class:`Observable`."""
        parsed = expressions.parse(self.expression)
        places = {name: _column(inputs, name, self.kind) for name in parsed.channels}

        def columns(values: FloatArray) -> FloatArray:
            sound = np.all(np.isfinite(values[:, list(places.values())]), axis=1)
            out = np.full((len(values), 1), np.nan)
            chosen = {name: values[sound, place] for name, place in places.items()}
            out[sound, 0] = parsed.evaluate(chosen)
            return out

        label = ChannelLabel(self.name, self.units, self.expression)
        return Bound((label,), columns, (Formula(parsed, places),))

    def reach(self, dt: float) -> tuple[int, int]:
        """0, 0: the instant itself."""
        return 0, 0


OBSERVABLES: dict[str, type[Observable]] = {
    each.kind: each for each in (SlowSquares, Powers, Expression)
}


def named(observable: Observable) -> str:
    """Name of an observable in texts: its kind, and what it is made of."""
    made_of = ", ".join(getattr(observable, "of", ())) or getattr(observable, "expression", "")
    return f"{observable.kind} of {made_of}" if made_of else observable.kind


def from_json(table: Mapping[str, Any]) -> Observable:
    """Make an observable of its kind and settings, as a file or a TOML table states them.

    Raises
    ------
    RequestError
        If the kind or a key is not known, or a setting is out of range.
    """
    settings = dict(table)
    kind = settings.pop("kind", None)
    try:
        check_choice("observables: kind", kind, list(OBSERVABLES))
    except RequestError as error:
        raise RequestError(
            f"{error} A kind of another module is known once that is imported."
        ) from None
    observable = OBSERVABLES[str(kind)]
    check_keys(observable, settings, f"observables: {kind}: ")
    return observable(**settings)


def observables_of(value: object) -> tuple[Observable, ...]:
    """Observables as they are, or made of tables of their keys."""
    if isinstance(value, str | Mapping) or not isinstance(value, Iterable):
        raise RequestError(
            f"observables must be a list; received {value!r:.{SHOWN}}. Write "
            "observables=[seakeep.SlowSquares('eta_cog')]."
        )
    return tuple(from_json(each) if isinstance(each, Mapping) else each for each in value)


@dataclass(frozen=True)
class Observed:
    """Observables beside the inputs that they are made of, as fitted.

    Parameters
    ----------
    observables : tuple of Observable
        Functions of the inputs.
    inputs : tuple of ChannelLabel
        Those inputs.
    dt : float
        Time step, s.
    spreads : tuple of float
        Standard deviations of the inputs in training.
    tops : tuple of float
        Largest value in training of each column without delays.
    """

    observables: tuple[Observable, ...]
    inputs: tuple[ChannelLabel, ...]
    dt: float
    spreads: tuple[float, ...]
    tops: tuple[float, ...] = ()

    @classmethod
    def fit(
        cls,
        observables: tuple[Observable, ...],
        runs: Datasets,
        inputs: Sequence[str],
        window: int | None,
    ) -> Self:
        """Bind observables to inputs, and to the encounter period of the runs."""
        name, first = next(iter(runs.items()))
        labels = labelled.channel_labels(first, inputs)
        dt = labelled.run_step(first, name)
        if any(getattr(each, "period", 0.0) is None for each in observables):
            period = labelled.mean_period(runs, list(inputs)) * dt
            observables = tuple(counted_in(each, period) for each in observables)
        records = [
            labelled.channel_matrix(run, inputs, name)
            for name, run in labelled.last_samples(runs, window).items()
        ]
        spreads = np.nanstd(np.concatenate(records), axis=0)
        observed = cls(observables, labels, dt, tuple(spreads.tolist()))
        direct = np.concatenate([observed.direct(each) for each in records])
        tops = np.fmax.reduce(direct, axis=0, initial=0.0)
        names = [label.name for group in (labels, *observed.labels) for label in group]
        for each in names:
            if names.count(each) > 1:
                raise RequestError(
                    f"two inputs or observables make a column '{each}'. Give an expression "
                    "another name, or leave one of the observables out."
                )
        return replace(observed, tops=tuple(tops.tolist()))

    def __getstate__(self) -> dict[str, Any]:
        """Fields alone: what is bound are functions, which a worker makes anew."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @cached_property
    def bound(self) -> tuple[Bound, ...]:
        """The observables, ready for these inputs."""
        return tuple(each.bind(self.inputs, self.dt) for each in self.observables)

    @cached_property
    def limits(self) -> FloatArray:
        """Squares at which powers of each input begin to grow like the input."""
        return BOUND * np.square(self.spreads) + TINY

    @cached_property
    def groups(self) -> tuple[tuple[Bound, ...], ...]:
        """The observables with the input delays, and those without."""
        pairs = [*zip(self.observables, self.bound, strict=True)]
        return tuple(
            tuple(bound for each, bound in pairs if each.delayed == wanted)
            for wanted in (True, False)
        )

    def reach(self, *, delayed: bool) -> tuple[int, int]:
        """Samples before and after an instant that rows with delays, or without, read."""
        own = [
            (0, 0),
            *(each.reach(self.dt) for each in self.observables if each.delayed == delayed),
        ]
        before, after = zip(*own, strict=True)
        return max(before), max(after)

    @cached_property
    def slopes(self) -> FloatArray:
        """Slope of each column without delays above the largest value of training."""
        return np.array([each.slope for each in self.groups[1] for _ in each.labels])

    @cached_property
    def labels(self) -> tuple[tuple[ChannelLabel, ...], ...]:
        """Labels of the columns with delays, and of those without."""
        return tuple(
            tuple(label for each in group for label in each.labels) for group in self.groups
        )

    @property
    def stretch(self) -> tuple[FloatArray, ...]:
        """Factors of the standard deviations of the columns with delays, and of those without."""
        return tuple(
            np.array([math.sqrt(each.stiffness) for each in group for _ in each.labels])
            for group in self.groups
        )

    def with_delayed(self, inputs: FloatArray) -> FloatArray:
        """Inputs, shape (time, Q), beside the columns that take the input delays."""
        more = [each.of(inputs, self.limits) for each in self.groups[0]]
        return np.concatenate([inputs, *more], axis=1) if more else inputs

    def direct(self, inputs: FloatArray) -> FloatArray:
        """Columns that stand as they are, of inputs of shape (time, Q)."""
        parts = [each.of(inputs, self.limits) for each in self.groups[1]]
        columns = np.concatenate([np.empty((len(inputs), 0)), *parts], axis=1)
        if self.tops:
            columns -= (1.0 - self.slopes) * np.maximum(columns - self.tops, 0.0)
        return columns

    def describe(self, lead: int) -> list[str]:
        """One line per observable; `lead` is the look-ahead of the inputs."""
        lines = []
        for each, bound in zip(self.observables, self.bound, strict=True):
            ahead = each.reach(self.dt)[1] + (lead if each.delayed else 0)
            columns = f"{len(bound.labels)} column{'' if len(bound.labels) == 1 else 's'}"
            delays = "with the input delays" if each.delayed else "at lags of their own"
            lines.append(
                f"  observable    {named(each)}: {columns} {delays}, reads up to "
                f"{max(ahead - 1, 0) * self.dt:.3g} s after the instant forecast"
            )
        return lines


NOTHING = Observed((), (), 0.0, ())
"""No observables."""
