"""What a forecast knows of a model: its signature, and the samples that a spec asks for."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any, Literal

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.errors import RequestError
from seakeep.models.inputs import InputMap
from seakeep.models.labelled import ChannelLabel
from seakeep.models.readouts import FittedReadOut


@dataclass(frozen=True, eq=False)
class Scale:
    """Moments of channels over the training windows.

    Parameters
    ----------
    mean, std : ndarray, shape (channel,)
        What is subtracted, and what is divided by (0 and 1 without standardisation).
    spread : ndarray, shape (channel,)
        Standard deviation over the training windows, with standardisation or without.
    centre, reach : ndarray, shape (channel,)
        Mean over the training windows, and the largest deviation from it.
    """

    mean: FloatArray
    std: FloatArray
    spread: FloatArray
    centre: FloatArray
    reach: FloatArray

    def __post_init__(self) -> None:
        for each in fields(self):
            getattr(self, each.name).flags.writeable = False

    @property
    def bound(self) -> FloatArray:
        """Largest deviation in training, infinite for a channel that was constant there."""
        return np.where(self.reach > 0, self.reach, np.inf)

    def part(self, channels: Any) -> Scale:
        """Moments of some channels: an index of arrays."""
        return Scale(*(getattr(self, each.name)[channels] for each in fields(self)))

    def deviations(self, values: FloatArray) -> FloatArray:
        """Standardised deviations of physical values, shape (…, channel)."""
        return (values - self.mean) / self.std

    def physical(self, deviations: FloatArray, out: FloatArray | None = None) -> FloatArray:
        """Physical values of standardised deviations, shape (…, channel); `out` may be these."""
        values = np.multiply(deviations, self.std, out=out)
        values += self.mean
        return values


@dataclass(frozen=True, eq=False)
class Signature:
    """What a forecast needs to know about a model or an ensemble.

    Parameters
    ----------
    dt : float
        Time step, s.
    state_labels, input_labels : tuple of ChannelLabel
        Names, units and long names of the states and of the measured inputs.
    state_delays, input_delays : int
        s and z; for an ensemble the longest of a member.
    input_map : InputMap
        How measured inputs become regressors, as fitted.
    state_scale, input_scale, direct_scale : Scale
        Moments of the states, of the delayed and of the direct regressors over the training
        windows; for an ensemble over all that its members learn from.
    readouts : tuple of FittedReadOut
        Channels that are read off the free runs.
    parameter : str
        Attribute of runs that the model varies with, if it does.
    """

    dt: float
    state_labels: tuple[ChannelLabel, ...]
    input_labels: tuple[ChannelLabel, ...]
    state_delays: int
    input_delays: int
    input_map: InputMap = field(repr=False)
    state_scale: Scale = field(repr=False)
    input_scale: Scale = field(repr=False)
    direct_scale: Scale = field(repr=False)
    readouts: tuple[FittedReadOut, ...] = field(default=(), repr=False)
    parameter: str = ""

    @property
    def states(self) -> list[str]:
        """Names of the states, in the order of the model."""
        return [label.name for label in self.state_labels]

    @property
    def inputs(self) -> list[str]:
        """Names of the measured inputs, in the order of the model."""
        return [label.name for label in self.input_labels]

    @property
    def regressors(self) -> list[str]:
        """Names of what the inputs become: the delayed regressors, then the direct ones."""
        return [
            label.name for group in self.input_map.regressors(self.input_labels) for label in group
        ]

    @property
    def history_samples(self) -> int:
        """Samples a forecast needs up to its start, that one included."""
        return max(self.state_delays, self.input_map.history(self.input_delays)) + 1

    @property
    def state_samples(self) -> int:
        """Samples of the states among these: where the vessel was counts for delayed waves too."""
        follows, reference = self.input_map.follows, self.input_map.reference
        where = 0
        if follows is not None:
            where = max(self.input_delays, reference) + follows.place.taps.size
        return max(self.state_delays + 1, reference, where)

    @property
    def lead_samples(self) -> int:
        """Samples of input after the one a step starts from that drive the step."""
        return self.input_map.lead_samples

    def check_fixed(self) -> None:
        """Refuse a model whose means are those before each start."""
        if self.input_map.reference:
            raise RequestError(
                "the model forecasts departures from the means before each start (centre = 'run'), "
                "which forecast, compare and forecast_arrays take from what they are given. For "
                "anything else, fit it with centre = 'pooled'."
            )


@dataclass(frozen=True)
class Needs:
    """Samples that a spec asks of its runs.

    Parameters
    ----------
    snapshots : int
        Of the longest training window; 1 where all of a run trains.
    history : int
        Before the start of a forecast, that one not counted.
    inside : bool
        Whether the delay history of training lies inside the window.
    lead : int
        Input after the last instant but one that a forecast reads.
    """

    snapshots: int
    history: int
    inside: bool = False
    lead: int = 0


Role = Literal["model", "reference"]
