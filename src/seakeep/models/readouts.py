"""Read-outs: channels that are read off what a model forecasts, after its free run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from seakeep.arrays import FloatArray, as_table, check_choice
from seakeep.conventions import MOTIONS, is_load
from seakeep.core.readouts import LoadMap
from seakeep.errors import RequestError, did_you_mean
from seakeep.models.labelled import ChannelLabel

ReadOutKind = Literal["none", "wave"]
Asked = Literal["wave", "auto"]
ReadOuts = tuple[tuple[str, Asked], ...] | Literal["auto"]
"""Kinds of read-outs by channel; "auto" for every load among the states."""


@dataclass(frozen=True, eq=False)
class FittedReadOut:
    """A read-out as fitted.

    Parameters
    ----------
    channel : str
        The state that is read off.
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
            text += f" at {self.load.place:.3g} m"
        if self.floor > -np.inf:
            text += f", floor {self.floor:.4g} {self.units}".rstrip()
        if self.scores:
            scores = ", ".join(f"{kind} {score:.3f}" for kind, score in self.scores.items())
            text += f" (NRMSE on held-out runs: {scores})"
        elif self.kind == "none":
            text += " (not judged: no waves are carried, or no two runs can be held out)"
        return f"  read-out      {text}"


def read_out(
    readouts: Sequence[FittedReadOut], values: FloatArray, waves: FloatArray | None
) -> None:
    """Put channels that are read off free runs, shape (…, N), physical units, into these.

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
    channels = {}
    for each in readouts:
        wave = None
        if each.load is not None:
            if waves is None:
                continue
            wave = waves[..., lines.index(each), :]
        channels[each.column] = each.read(values, wave)
    for column, channel in channels.items():
        values[..., column] = channel


def readouts_of(value: Any) -> ReadOuts:
    """Kinds by channel, in a mapping or as pairs, or "auto"; refuses what is no kind."""
    if isinstance(value, str) and value == "auto":
        return "auto"
    kinds = as_table(dict(value) if isinstance(value, tuple) else value, "readouts")
    for channel, kind in kinds.items():
        check_choice(f"readouts: {channel}", kind, get_args(Asked))
    return tuple(kinds.items())


def readouts_json(readouts: ReadOuts) -> Any:
    """Argument of :func:`readouts_of` as JSON values."""
    return readouts if isinstance(readouts, str) else dict(readouts)


def motions_of(states: Sequence[ChannelLabel], channel: str) -> list[int]:
    """Places of motions and their rates among the states, without a channel that is read off."""
    motions = {*MOTIONS, *(f"{name}_rate" for name in MOTIONS)} - {channel}
    return [column for column, label in enumerate(states) if label.name in motions]


def readouts_asked(readouts: ReadOuts, states: Sequence[ChannelLabel]) -> dict[str, Asked]:
    """Kinds by channel of a model with these states; refuses those of what is no state."""
    if isinstance(readouts, str):
        loads = [label.name for label in states if is_load(label.units)]
        return dict.fromkeys(loads if motions_of(states, "") else [], "auto")
    names = [label.name for label in states]
    for channel, _ in readouts:
        if channel not in names:
            raise RequestError(
                f"readouts names '{channel}', which is not among the states ({', '.join(names)})."
                f"{did_you_mean(channel, names)}"
            )
    return dict(readouts)
