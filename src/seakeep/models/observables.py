"""Observables: functions of the measured inputs that a model takes as further inputs.

An observable is added by one class with the members of :class:`Observable` and one line in
``OBSERVABLES``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cached_property
from itertools import combinations
from typing import Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.core.observables import slow_kernel, slow_squares
from seakeep.errors import SHOWN, RequestError, did_you_mean
from seakeep.models import labelled
from seakeep.models.checks import check_choice, check_keys
from seakeep.models.interface import Drive, Regressors, Span
from seakeep.models.labelled import ChannelLabel
from seakeep.signals import expressions

__all__ = [
    "OBSERVABLES",
    "Bound",
    "Expression",
    "Formula",
    "Observable",
    "Observed",
    "Observing",
    "Power",
    "Powers",
    "Product",
    "SlowSquare",
    "SlowSquares",
    "Term",
]

HALF_WIDTH = 0.5
"""Half of the length of the low-pass filter of :class:`SlowSquares`, in periods of its cutoff.

With a cutoff of 1/3 per encounter period that is 1.5 encounter periods: a wave of half the
encounter period's frequency is damped to a fifth, one at the encounter frequency to a hundredth."""
BOUND = 36.0
"""Squared standard deviations of an input at which its powers begin to grow like the input."""
STIFF = 100.0
"""How much more λ weighs on powers: an error of a high wave is an error of its cube."""
TINY = float(np.finfo(float).tiny)
SLOPE = 0.7
"""Slope of slow squares above the largest of training: a force does not grow for ever."""


class Product(NamedTuple):
    """A column as the product of inputs; a power names one more than once."""

    places: tuple[int, ...]


class Power(NamedTuple):
    """A column as a power of an input that grows like it far out.

    It is u^power / (1 + u²/limit)^((power − 1)/2).
    """

    place: int
    power: int
    limit: float


class SlowSquare(NamedTuple):
    """A column as the low-pass filtered square of a derivative of an input.

    The middle of the filter lies `shift` samples after the instant of the row. Above `top` the
    column grows with the slope ``SLOPE``.
    """

    place: int
    order: int
    kernel: FloatArray
    shift: int
    top: float = np.inf


class Formula(NamedTuple):
    """A column as an expression of inputs."""

    expression: expressions.Expression
    places: Mapping[str, int]


Term = Product | Power | SlowSquare | Formula
"""A column as hosts other than Python compute it."""


@dataclass(frozen=True, eq=False)
class Bound:
    """An observable of certain channels at a certain time step.

    Parameters
    ----------
    labels : tuple of ChannelLabel
        Its columns.
    delayed : bool
        Whether the columns take the input delays of the model, or stand as they are.
    before, ahead : int
        Samples before and after instant j that row j reads.
    columns : callable
        From the inputs, shape (time, Q), to the columns, shape (time, len(labels)); rows are NaN
        where they need samples that are not there.
    terms : tuple of Product, Power, SlowSquare or Formula, optional
        The columns for hosts other than Python; without them the model cannot be exported.
    stiffness : float, optional
        How much more λ weighs on the columns than on others.
    """

    labels: tuple[ChannelLabel, ...]
    delayed: bool
    before: int
    ahead: int
    columns: Callable[[FloatArray], FloatArray]
    terms: tuple[Term, ...] = ()
    stiffness: float = 1.0

    def below(self, tops: FloatArray) -> Bound:
        """Columns of slow squares that grow with the slope ``SLOPE`` above some values."""

        def columns(values: FloatArray) -> FloatArray:
            found = self.columns(values)
            over = np.maximum(found - tops, 0.0)
            result: FloatArray = found - (1.0 - SLOPE) * over
            return result

        pairs = zip(self.terms, tops.tolist(), strict=True)
        terms = tuple(t._replace(top=top) if isinstance(t, SlowSquare) else t for t, top in pairs)
        return replace(self, columns=columns, terms=terms)


class Observable(Protocol):
    """Functions of the inputs; frozen, with fields that are JSON values."""

    kind: ClassVar[str]

    def bind(
        self,
        inputs: Sequence[ChannelLabel],
        period: float | None,
        dt: float,
    ) -> Bound:
        """Columns for these inputs.

        `period` is the encounter period in samples, None where no observable of the model has a
        ``period`` to fill in; `dt` is the time step in s.
        """
        ...

    def reach(self, dt: float) -> tuple[int, int]:
        """Samples before and after an instant that its row reads, delays of the model apart."""
        ...


def _column(inputs: Sequence[ChannelLabel], name: str, what: str) -> int:
    names = [label.name for label in inputs]
    if name not in names:
        raise RequestError(
            f"{what} of '{name}': no such input.{did_you_mean(name, names)} Inputs of the model: "
            f"{', '.join(names) or 'none'}."
        )
    return names.index(name)


def _names(value: object, what: str) -> tuple[str, ...]:
    names: tuple[Any, ...] = (value,)
    if not isinstance(value, str) and isinstance(value, Iterable):
        names = tuple(value)
    if not names or not all(isinstance(name, str) for name in names):
        raise RequestError(
            f"{what}: of must name one or more inputs; "
            f"received {value!r:.{SHOWN}}. Write of='eta_fwd'."
        )
    return names


def _numbers(value: object, what: str, meant: str, fits: Callable[[Any], bool]) -> tuple[Any, ...]:
    given: tuple[Any, ...] = tuple(value) if isinstance(value, Iterable) else (value,)
    numbers = tuple(n.item() if isinstance(n, np.generic) else n for n in given)
    for number in numbers:
        real = isinstance(number, int | float) and not isinstance(number, bool)
        if not real or not math.isfinite(number) or not fits(number):
            raise RequestError(f"{what} must be {meant}; received {number!r:.{SHOWN}}.")
    if not numbers or len(set(numbers)) < len(numbers):
        raise RequestError(f"{what} must be {meant}, each once; received {value!r:.{SHOWN}}.")
    return numbers


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

    def __post_init__(self) -> None:
        what = "slow_squares"
        object.__setattr__(self, "of", _names(self.of, what))
        orders = _numbers(self.orders, f"{what}: orders", "0, 1 or 2", lambda n: n in (0, 1, 2))
        object.__setattr__(self, "orders", tuple(int(order) for order in orders))
        lags = _numbers(self.lags, f"{what}: lags", "encounter periods from 0", lambda n: n >= 0)
        object.__setattr__(self, "lags", lags)
        meant = "per encounter period, above 0 and at most 1"
        _numbers((self.cutoff,), f"{what}: cutoff", meant, lambda n: 0 < n <= 1)
        _numbers((self.lead,), f"{what}: lead", "encounter periods from 0", lambda n: n >= 0)
        if self.period is not None:
            _numbers((self.period,), f"{what}: period", "seconds above 0", lambda n: n > 0)

    def bind(
        self,
        inputs: Sequence[ChannelLabel],
        period: float | None,
        dt: float,
    ) -> Bound:
        """Columns for these inputs; see :class:`Observable`."""
        places = [_column(inputs, name, self.kind) for name in self.of]
        period = period if self.period is None else self.period / dt
        assert period is not None
        kernel, reach, ahead, lags = self._places(period)
        middle = ahead - reach
        labels = []
        for place in places:
            label = inputs[place]
            for order in self.orders:
                rate = ("", "/s", "/s^2")[order]
                unit = label.units and _power(label.units + rate, 2)
                dots = ("", "_rate", "_acceleration")[order]
                labels += [
                    ChannelLabel(
                        f"slow_{label.name}{dots}_squared_{lag:g}T",
                        unit,
                        f"slow part of the square of {label.long_name}{dots.replace('_', ' ')}, "
                        f"{lag:g} periods before",
                    )
                    for lag in self.lags
                ]

        def columns(values: FloatArray) -> FloatArray:
            parts = [
                slow_squares(values[:, place], self.orders, kernel, middle, lags, dt)
                for place in places
            ]
            return np.concatenate(parts, axis=1)

        terms = tuple(
            SlowSquare(place, order, kernel, middle - lag)
            for place in places
            for order in self.orders
            for lag in lags
        )
        before = max(0, reach + max(lags) - middle)
        return Bound(tuple(labels), False, before, ahead, columns, terms)

    def reach(self, dt: float) -> tuple[int, int]:
        """Samples around an instant; see :class:`Observable`."""
        if self.period is None:
            raise RequestError(
                "slow_squares counts in encounter periods, and how far it reads is asked before "
                "there are runs to count them in. State its period (s)."
            )
        _, reach, ahead, lags = self._places(self.period / dt)
        return max(0, 2 * reach + max(lags) - ahead), ahead

    def _places(self, period: float) -> tuple[FloatArray, int, int, list[int]]:
        """Filter, its reach either side with the differences, look-ahead, and lags, in samples."""
        kernel = slow_kernel(self.cutoff / period, round(HALF_WIDTH / self.cutoff * period))
        reach = len(kernel) // 2 + (max(self.orders) > 0)
        return kernel, reach, round(self.lead * period), [round(lag * period) for lag in self.lags]


@dataclass(frozen=True)
class Powers:
    r"""Powers of inputs, and products of pairs of them, with the input delays of the model.

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
    products : bool, optional
        Whether the product of each pair of the inputs is taken too.

    Raises
    ------
    RequestError
        If a setting is out of range.
    """

    of: tuple[str, ...]
    powers: tuple[int, ...] = (2, 3)
    products: bool = False
    kind: ClassVar[str] = "powers"

    def __post_init__(self) -> None:
        object.__setattr__(self, "of", _names(self.of, "powers"))
        powers = _numbers(
            self.powers, "powers: powers", "integers from 2 to 5", lambda n: n in (2, 3, 4, 5)
        )
        object.__setattr__(self, "powers", tuple(int(power) for power in powers))
        if not isinstance(self.products, bool):
            raise RequestError(
                f"powers: products must be true or false; received {self.products!r:.{SHOWN}}."
            )

    def bind(
        self,
        inputs: Sequence[ChannelLabel],
        period: float | None,
        dt: float,
        spreads: Sequence[float] = (),
    ) -> Bound:
        """Columns for these inputs, which vary by `spreads` in training; see :class:`Observable`.

        Without these the powers have no bound.
        """
        places = [_column(inputs, name, self.kind) for name in self.of]
        pairs = list(combinations(places, 2)) if self.products else []
        labels = [
            ChannelLabel(
                f"{inputs[place].name}_power_{power}",
                _power(inputs[place].units, power),
                f"{inputs[place].long_name} to the power of {power}",
            )
            for power in self.powers
            for place in places
        ]
        labels += [
            ChannelLabel(
                f"{inputs[a].name}_times_{inputs[b].name}",
                f"{inputs[a].units} {inputs[b].units}".strip(),
                f"product of {inputs[a].long_name} and {inputs[b].long_name}",
            )
            for a, b in pairs
        ]

        limits = np.full(len(places), np.inf)
        if spreads:
            limits = np.array([BOUND * spreads[place] ** 2 for place in places]) + TINY

        def columns(values: FloatArray) -> FloatArray:
            chosen = values[:, places]
            calm = np.sqrt(1.0 + chosen * chosen / limits)
            parts = [chosen * (chosen / calm) ** (power - 1) for power in self.powers]
            parts += [values[:, [a]] * values[:, [b]] for a, b in pairs]
            return np.concatenate(parts, axis=1)

        terms: list[Term] = [
            Power(place, power, float(limit))
            for power in self.powers
            for place, limit in zip(places, limits, strict=True)
        ]
        terms += [Product(pair) for pair in pairs]
        return Bound(tuple(labels), True, 0, 0, columns, tuple(terms), STIFF)

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

    def bind(
        self,
        inputs: Sequence[ChannelLabel],
        period: float | None,
        dt: float,
    ) -> Bound:
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
        return Bound((label,), True, 0, 0, columns, (Formula(parsed, places),))

    def reach(self, dt: float) -> tuple[int, int]:
        """0, 0: the instant itself."""
        return 0, 0


OBSERVABLES: dict[str, type[Observable]] = {
    each.kind: each for each in (SlowSquares, Powers, Expression)
}


def named(observable: Observable) -> str:
    """Name of an observable in texts: its kind, and what it is made of."""
    made_of = ", ".join(getattr(observable, "of", ())) or getattr(observable, "expression", "")
    return f"{observable.kind} of {made_of}"


def to_json(observable: Observable) -> dict[str, Any]:
    """Kind and settings as JSON values."""
    return {"kind": observable.kind, **asdict(observable)}  # type: ignore[call-overload]


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
    made = OBSERVABLES[str(kind)]
    check_keys(made, settings, f"observables: {kind}: ")
    return made(**settings)


def observables_of(value: object) -> tuple[Observable, ...]:
    """Observables as they are, or made of tables of their keys."""
    if isinstance(value, str | Mapping) or not isinstance(value, Iterable):
        raise RequestError(
            f"observables must be a list; received {value!r:.{SHOWN}}. Write "
            "observables=[seakeep.SlowSquares('eta_cog')]."
        )
    made = [from_json(each) if isinstance(each, Mapping) else each for each in value]
    if strange := [each for each in made if not hasattr(each, "bind")]:
        raise RequestError(
            f"observables must hold observables, such as seakeep.SlowSquares; received "
            f"{strange[0]!r:.{SHOWN}}."
        )
    return tuple(made)


@dataclass(frozen=True)
class Observing:
    """Observables that are not fitted yet; `lead` is that of the inputs they are made of."""

    observables: tuple[Observable, ...]
    lead: int = 0

    def fit(
        self,
        runs: Mapping[str, xr.Dataset],
        states: Sequence[str],
        inputs: Sequence[str],
        window: int | None,
    ) -> Observed:
        """Bind the observables to the inputs, and to the encounter period of the runs."""
        name, first = next(iter(runs.items()))
        labels = labelled.channel_labels(first, inputs)
        counts = any(getattr(each, "period", 0.0) is None for each in self.observables)
        period = labelled.mean_period(runs, list(inputs)) if counts else None
        last = slice(None if window is None else -window, None)
        records = [labelled.channel_matrix(run, inputs, name)[last] for name, run in runs.items()]
        spreads = np.nanstd(np.concatenate(records), axis=0)
        dt = labelled.run_step(first, name)
        made = Observed(self.observables, self.lead, labels, dt, period, tuple(spreads.tolist()))
        made = replace(made, tops=tuple(made.largest(records)))
        names = [label.name for group in made.regressors(labels) for label in group]
        for each in names:
            if names.count(each) > 1:
                raise RequestError(
                    f"two inputs or observables make a column '{each}'. Give an expression "
                    "another name, or leave one of the observables out."
                )
        return made


@dataclass(frozen=True)
class Observed:
    """Observables beside the inputs that they are made of: an input map.

    Parameters
    ----------
    observables : tuple of Observable
        Functions of the inputs.
    lead : int
        Samples by which the inputs that arrive here look ahead already.
    inputs : tuple of ChannelLabel
        Those inputs.
    dt : float
        Time step, s.
    period : float or None
        Encounter period, samples, where an observable counts in it.
    spreads : tuple of float
        Standard deviations of the inputs in training.
    tops : tuple of float
        Largest value in training of each column without delays.
    """

    kind: ClassVar[str] = "observables"
    reads_surge: ClassVar[bool] = False
    follows: ClassVar[None] = None
    observables: tuple[Observable, ...]
    lead: int
    inputs: tuple[ChannelLabel, ...]
    dt: float
    period: float | None
    spreads: tuple[float, ...]
    tops: tuple[float, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        """Fields alone: what is bound are functions, which a worker makes anew."""
        return {each.name: getattr(self, each.name) for each in fields(self)}

    @cached_property
    def bound(self) -> tuple[Bound, ...]:
        """The observables, ready for these inputs; slow squares below the largest of training."""
        found, tops = [], np.array(self.tops)
        for each in self.observables:
            rig = self.inputs, self.period, self.dt
            made = each.bind(*rig, self.spreads) if isinstance(each, Powers) else each.bind(*rig)
            if isinstance(each, SlowSquares) and tops.size:
                made = made.below(tops[: len(made.labels)])
            if not made.delayed:
                tops = tops[len(made.labels) :]
            found.append(made)
        return tuple(found)

    def largest(self, records: Sequence[FloatArray]) -> list[float]:
        """Largest value in some records of each column without delays."""
        direct = [self.direct(each) for each in records]
        return [float(each) for each in np.fmax.reduce(np.concatenate(direct), axis=0, initial=0.0)]

    def with_delayed(self, inputs: FloatArray) -> FloatArray:
        """Inputs, shape (time, Q), beside the columns that take the input delays."""
        more = [bound.columns(inputs) for bound in self.bound if bound.delayed]
        return np.concatenate([inputs, *more], axis=1)

    def direct(self, inputs: FloatArray) -> FloatArray:
        """Columns that stand as they are, of inputs of shape (time, Q)."""
        found = [bound.columns(inputs) for bound in self.bound if not bound.delayed]
        return np.concatenate([np.empty((len(inputs), 0)), *found], axis=1)

    @property
    def stretch(self) -> tuple[FloatArray, FloatArray]:
        """Factors of the standard deviations that the columns are divided by."""
        groups: tuple[list[float], list[float]] = [1.0] * len(self.inputs), []
        for bound in self.bound:
            groups[not bound.delayed].extend([math.sqrt(bound.stiffness)] * len(bound.labels))
        return np.array(groups[0]), np.array(groups[1])

    @cached_property
    def _around(self) -> tuple[int, int, int]:
        """Samples before and after a row that are read, and those before of delayed columns."""
        shift = [0 if b.delayed else self.lead for b in self.bound]
        before = max([0, *(b.before + s for b, s in zip(self.bound, shift, strict=True))])
        after = max([0, *(b.ahead - s for b, s in zip(self.bound, shift, strict=True))])
        return before, after, max([0, *(b.before for b in self.bound if b.delayed)])

    @property
    def lead_samples(self) -> int:
        """Samples beyond those that the inputs read already."""
        return self._around[1]

    def history(self, input_delays: int) -> int:
        """Samples of input before the start that a forecast with these delays reads."""
        return -self.reads(Span(-input_delays, 0, 1)).first

    def regressors(
        self, inputs: tuple[ChannelLabel, ...]
    ) -> tuple[tuple[ChannelLabel, ...], tuple[ChannelLabel, ...]]:
        """Return the inputs and the observables with delays, and those without."""
        more = tuple(label for b in self.bound if b.delayed for label in b.labels)
        return inputs + more, tuple(
            label for b in self.bound if not b.delayed for label in b.labels
        )

    def reads(self, span: Span) -> Span:
        """Samples of input around those of the rows; direct ones count from the start on."""
        before, after, delayed = self._around
        first = min(span.first - delayed - self.lead, span.known - before)
        return Span(first, span.known, span.stop + after)

    def wrap(self, drive: Drive, run: xr.Dataset | None, spans: Sequence[Span]) -> Drive:
        """Put the observables beside the inputs of a run."""
        read = [self.reads(span) for span in spans]
        return _Seen(drive, self, min(r.first for r in read), max(r.stop for r in read))

    def look_ahead(self, run: xr.Dataset | None, dt: float) -> float:
        """Seconds beyond those that the inputs read already."""
        return self.lead_samples * dt

    def notes(self, run: xr.Dataset) -> dict[str, str | float]:
        """Nothing beside the look-ahead, which every forecast reports."""
        return {}

    def describe(self, dt: float) -> list[str]:
        """One line per observable."""
        lines = []
        for each, bound in zip(self.observables, self.bound, strict=True):
            ahead = bound.ahead + (self.lead if bound.delayed else 0)
            columns = f"{len(bound.labels)} column{'' if len(bound.labels) == 1 else 's'}"
            delays = "with the input delays" if bound.delayed else "at lags of their own"
            lines.append(
                f"  observable    {named(each)}: {columns} {delays}, reads up to "
                f"{max(ahead - 1, 0) * dt:.3g} s after the instant forecast"
            )
        return lines

    def to_json(self) -> dict[str, Any]:
        """Observables, inputs, time step and period."""
        return {
            "observables": [to_json(each) for each in self.observables],
            "lead": self.lead,
            "inputs": [asdict(label) for label in self.inputs],
            "dt": self.dt,
            "period": self.period,
            "spreads": list(self.spreads),
            "tops": list(self.tops),
        }

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Self:
        """Rebuild from :meth:`to_json`."""
        inputs = tuple(ChannelLabel(**each) for each in content["inputs"])
        made = tuple(from_json(each) for each in content["observables"])
        moments = tuple(content["spreads"]), tuple(content["tops"])
        return cls(made, content["lead"], inputs, content["dt"], content["period"], *moments)


@dataclass(frozen=True, eq=False)
class _Seen:
    """Inputs and observables of a run, from the sample `low` to before `high` of the inputs."""

    inner: Drive
    made: Observed
    low: int
    high: int

    def rows(self, first: int, stop: int) -> Regressors:
        before, after, _ = self.made._around
        start, end = max(first - before, self.low), min(stop + after, self.high)
        inner = self.inner.rows(start, end)
        direct, lead = self.made.direct(inner.delayed), self.made.lead
        shifted = np.full_like(direct, np.nan)  # these inputs look ahead already, by the lead
        shifted[lead:] = direct[: len(direct) - lead]
        inside = slice(first - start, stop - start)
        return Regressors(
            self.made.with_delayed(inner.delayed)[inside],
            np.concatenate([inner.direct, shifted], axis=1)[inside],
        )
