"""Read-outs: channels that are read off what a model forecasts, after its free run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, Self, get_args

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.conventions import MOTIONS
from seakeep.core.readouts import LinearHinges
from seakeep.errors import SHOWN, RequestError, did_you_mean
from seakeep.models.checks import Json, check_choice, check_keys, names_of, plain
from seakeep.models.labelled import ChannelLabel

ReadOutKind = Literal["none", "hinge", "stacked"]
Asked = Literal["hinge", "stacked", "auto"]


@dataclass(frozen=True)
class ReadOut:
    r"""A channel that is read off the forecast states, such as the load of a line that falls slack.

    A linear model cannot follow a load that stops at a floor. A read-out replaces the forecast
    of the channel by a function with hinges :math:`\max(0, x - q)` at six knots q per state, fitted
    by ridge regression (1e-2 per sample, standardised). A channel that rests on a floor in
    training never falls below it by more than its noise, whichever kind is chosen: below the 0.002
    quantile of its training. It must rest there in a hundredth of the samples or more.

    Parameters
    ----------
    channel : str
        The state that is read off.
    of : sequence of str
        The states that bend it; the motions that tauten the line.
    kind : {"auto", "hinge", "stacked"}, optional
        ``"hinge"``: a function of the states in `of`, fitted to measured states. ``"stacked"``: a
        function of all forecast states and of the hinges of those in `of`, fitted to forecasts of
        each training run by the model of the others, so that it knows their errors; it takes
        exact delay rows. ``"auto"``: whichever of these forecasts training runs that are held out
        better than no read-out, by more than two standard errors of the gain; else none.

    Raises
    ------
    RequestError
        If the channel reads itself, or a setting is out of range.

    Examples
    --------
    >>> ReadOut("mooring_stern", of=("surge", "heave", "pitch")).kind
    'auto'
    """

    channel: str
    of: tuple[str, ...]
    kind: Asked = "auto"

    def __post_init__(self) -> None:
        if not isinstance(self.channel, str) or not self.channel:
            raise RequestError(
                f"readouts: channel must be a name; received {self.channel!r:.{SHOWN}}."
            )
        what = f"readouts: {self.channel}"
        check_choice(f"{what}: kind", self.kind, get_args(Asked))
        example = "of = ['surge', 'heave', 'pitch']"
        names = names_of(self.of, f"{what}: of", example)
        if self.channel in names:
            raise RequestError(
                f"{what} cannot be read off itself. Leave it out of of = {list(names)}."
            )
        object.__setattr__(self, "of", names)


ReadOuts = tuple[ReadOut, ...] | Literal["auto"]
"""Read-outs of a model; "auto" for every load among its states."""


@dataclass(frozen=True, eq=False)
class FittedReadOut:
    """A read-out as fitted.

    Parameters
    ----------
    channel, of
        As in :class:`ReadOut`.
    kind : {"none", "hinge", "stacked"}
        What it is; what was chosen.
    column : int
        Place of the channel among the states.
    units : str
        Of the channel.
    scores : mapping of str to float
        NRMSE by kind in free runs on training runs that were held out, where kinds were compared.
    function : LinearHinges or None
        The channel of forecast states, physical units; None where the forecast stays as it is.
        Without a kind, that of a channel which rests on a floor keeps it there.
    """

    channel: str
    of: tuple[str, ...]
    kind: ReadOutKind
    column: int
    units: str
    scores: Mapping[str, float]
    function: LinearHinges | None

    def describe(self) -> str:
        """Line of a summary."""
        text = f"{self.channel}: {self.kind}"
        if self.function is not None:
            if self.kind != "none":
                text += f", of {', '.join(self.of)}"
            if np.isfinite(self.function.floor):
                text += f", floor {self.function.floor:.4g} {self.units}".rstrip()
        if self.scores:
            scores = ", ".join(f"{kind} {score:.3f}" for kind, score in self.scores.items())
            text += f" (NRMSE on held-out runs: {scores})"
        elif self.kind == "none":
            text += " (no two runs could be held out to judge it)"
        return f"  read-out      {text}"

    def to_json(self) -> Json:
        """As JSON values; numbers keep all their digits."""
        content: Json = plain(asdict(self))
        return content

    @classmethod
    def from_json(cls, content: Json) -> Self:
        """Rebuild from :meth:`to_json`."""
        function = content["function"]
        if function is not None:
            arrays = {key: np.array(function[key], dtype=float) for key in ("knots", "weights")}
            function = LinearHinges(**function | arrays)
        return cls(**content | {"of": tuple(content["of"]), "function": function})


def read_out(readouts: Sequence[FittedReadOut], values: FloatArray) -> FloatArray:
    """Free runs, shape (…, N), physical units, with the channels that are read off them."""
    computed = [
        (each.column, each.function(values)) for each in readouts if each.function is not None
    ]
    for column, channel in computed:
        values[..., column] = channel
    return values


def readouts_of(value: object) -> ReadOuts:
    """Read-outs as they are, or made of tables (in a list, or by channel), or "auto"."""
    if isinstance(value, str) and value == "auto":
        return "auto"
    if isinstance(value, Mapping):
        value = [{"channel": name, **table} for name, table in value.items()]
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise RequestError(
            f"readouts must be a list or 'auto'; received {value!r:.{SHOWN}}. Write "
            "readouts=[seakeep.ReadOut('mooring_stern', of=('surge', 'heave', 'pitch'))]."
        )
    readouts = tuple(_of_table(each) if isinstance(each, Mapping) else each for each in value)
    names = []
    for each in readouts:
        if not isinstance(each, ReadOut):
            raise RequestError(f"readouts must hold seakeep.ReadOut; received {each!r:.{SHOWN}}.")
        names.append(each.channel)
    if double := {name for name in names if names.count(name) > 1}:
        raise RequestError(
            f"readouts names {sorted(double)[0]} more than once. Name each channel once."
        )
    return readouts


def _of_table(table: Mapping[str, Any]) -> ReadOut:
    check_keys(ReadOut, table, "readouts: ")
    return ReadOut(**table)


def readouts_json(readouts: ReadOuts) -> Any:
    """Argument of :func:`readouts_of` as JSON values."""
    return readouts if readouts == "auto" else [asdict(each) for each in readouts]


def readouts_asked(readouts: ReadOuts, states: Sequence[ChannelLabel]) -> tuple[ReadOut, ...]:
    """Read-outs of a model with these states; refuses those of, or off, what is no state."""
    if readouts == "auto":
        of = tuple(label.name for label in states if label.name in MOTIONS)
        loads = [label.name for label in states if label.units == "N"]
        return tuple(ReadOut(name, of) for name in loads) if of else ()
    names = [label.name for label in states]
    for each in readouts:
        for name, what in ((each.channel, "channel"), *((name, "of") for name in each.of)):
            if name not in names:
                raise RequestError(
                    f"readouts: {each.channel}: {what} names '{name}', which is not among the "
                    f"states ({', '.join(names)}).{did_you_mean(name, names)}"
                )
    return readouts
