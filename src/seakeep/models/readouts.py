"""Read-outs: channels that are read off what a model forecasts, after its free run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, Self, get_args

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.conventions import MOTIONS
from seakeep.core.readouts import LoadMap
from seakeep.errors import SHOWN, RequestError, did_you_mean
from seakeep.models.checks import Json, check_choice, check_keys, names_of, plain
from seakeep.models.labelled import ChannelLabel

ReadOutKind = Literal["none", "wave"]
Asked = Literal["wave", "auto"]
ARRAYS = ("mean", "std", "low", "high", "knots", "weights", "span")
"""Parts of a load map that are arrays."""


@dataclass(frozen=True)
class ReadOut:
    r"""A load that is read off the forecast: a function of motions and of the wave at its line.

    A linear model cannot follow a load that depends on how deep its line is in the water, or that
    stops at a floor. A read-out replaces the forecast of the channel by a ridge regression (1e-2
    per sample, standardised) on motions, hinges of the surge, and elevation and rate of the wave
    at one place, which is the one whose regression errs least on training runs that are left out
    in turn. The waves are carried there by the filters of an alignment with ``surge="predicted"``.
    Where motions or wave leave the range of training, the forecast of the channel itself takes
    over. A channel that rests on a floor in training never falls below it by more than its noise,
    whichever kind is chosen: below the 0.002 quantile of its training. It must rest there in a
    hundredth of the samples or more.

    Parameters
    ----------
    channel : str
        The state that is read off.
    of : sequence of str
        The motions that it depends on, and their rates.
    kind : {"auto", "wave"}, optional
        ``"auto"``: ``"wave"`` where that forecasts training runs that are held out better than no
        read-out, by more than two standard errors of the gain and 2 % of the error; else none.

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
    kind : {"none", "wave"}
        What it is; what was chosen.
    column : int
        Place of the channel among the states.
    units : str
        Of the channel.
    scores : mapping of str to float
        NRMSE by kind in free runs on training runs that were held out, where kinds were compared.
    floor : float
        Least value of a channel that rests on a floor in training; else −inf.
    load : LoadMap or None
        The channel of forecast states and waves, physical units; None without a kind.
    """

    channel: str
    of: tuple[str, ...]
    kind: ReadOutKind
    column: int
    units: str
    scores: Mapping[str, float]
    floor: float
    load: LoadMap | None

    @property
    def acts(self) -> bool:
        """Whether it changes anything."""
        return self.load is not None or self.floor > -np.inf

    def read(self, states: Any, wave: Any) -> Any:
        """The channel, shape (…), of states, shape (…, N), and the wave at its line, (…, 2)."""
        linear = states[..., self.column] if self.load is None else self.load(states, wave)
        return np.maximum(linear, self.floor)

    def describe(self) -> str:
        """Line of a summary."""
        text = f"{self.channel}: {self.kind}"
        if self.load is not None:
            text += f" at {self.load.place:.3g} m, of {', '.join(self.of)}"
        if self.floor > -np.inf:
            text += f", floor {self.floor:.4g} {self.units}".rstrip()
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
        load = content["load"]
        if load is not None:
            arrays = {key: np.array(value) for key, value in load.items() if key in ARRAYS}
            load = LoadMap(**load | arrays)
        return cls(**content | {"of": tuple(content["of"]), "load": load})


def read_out(
    readouts: Sequence[FittedReadOut], values: FloatArray, waves: FloatArray | None
) -> FloatArray:
    """Free runs, shape (…, N), physical units, with the channels that are read off them.

    Parameters
    ----------
    readouts : sequence of FittedReadOut
        What is read off.
    values : ndarray, shape (…, N)
        Free runs; they are changed.
    waves : ndarray, shape (…, line, 2), or None
        Elevation and rate at the line of each that has one; None leaves their channels as they are.
    """
    lines = [each for each in readouts if each.load is not None]
    channels = []
    for each in readouts:
        if each.load is None:
            channels.append((each.column, each.read(values, None)))
        elif waves is not None:
            wave = waves[..., lines.index(each), :]
            channels.append((each.column, each.read(values, wave)))
    for column, channel in channels:
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
        motions = {*MOTIONS, *(f"{name}_rate" for name in MOTIONS)}
        of = tuple(label.name for label in states if label.name in motions)
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
