"""Interfaces of specs and models.

Helpers take a :class:`Signature`, never a whole model. A new model is a ``Spec``, a
``Model`` and one line in :data:`seakeep.models.registry.KINDS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, Literal, Protocol, Self

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.models.checks import Json
from seakeep.models.inputs import InputMap
from seakeep.models.labelled import ChannelLabel, Runs, Stop
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
        for array in (self.mean, self.std, self.spread, self.centre, self.reach):
            array.flags.writeable = False

    @property
    def bound(self) -> FloatArray:
        """Largest deviation in training, infinite for a channel that was constant there."""
        return np.where(self.reach > 0, self.reach, np.inf)

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
        follows = self.input_map.follows
        where = 0 if follows is None else self.input_delays + follows.place.taps.size
        return max(self.state_delays + 1, where)

    @property
    def lead_samples(self) -> int:
        """Samples of input after the one a step starts from that drive the step."""
        return self.input_map.lead_samples


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


class Model(Protocol):
    """A fitted model, as compare, study and report use it."""

    @property
    def kind(self) -> str:
        """Word of its spec in TOML files and in :data:`seakeep.models.registry.KINDS`."""

    @property
    def settings(self) -> Any:
        """Settings that it was fitted with; of an ensemble, those that its members share."""

    @property
    def signature(self) -> Signature:
        """Time step, labels, delays, scales and input map."""

    @property
    def n_members(self) -> int:
        """Number of members; 1 for a single model."""

    @property
    def dt(self) -> float:
        """Time step, s."""

    @property
    def states(self) -> list[str]:
        """Names of the states."""

    @property
    def inputs(self) -> list[str]:
        """Names of the measured inputs."""

    @property
    def history_samples(self) -> int:
        """Samples a forecast needs up to its start."""

    @property
    def training_spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant of the training windows of each run, s."""

    def forecast(
        self, run: xr.Dataset, start: float, steps: int | None = None, *, ahead: str = "refuse"
    ) -> xr.Dataset:
        """Free run from an instant on."""

    def forecast_windows(
        self,
        run: xr.Dataset,
        starts: Sequence[float],
        steps: int,
        *,
        ahead: str = "refuse",
        executor: Executor | None = None,
    ) -> xr.Dataset:
        """Free runs from several instants, side by side."""

    def summary(self) -> str:
        """Text that describes the model."""

    def save(self, path: str | Path) -> Path:
        """Write the model as NetCDF."""


Role = Literal["model", "reference"]


class Spec(Protocol):
    """Settings that are fitted to runs; frozen, with JSON values.

    Attributes
    ----------
    kind : str
        Its word in TOML files and in :data:`seakeep.models.registry.KINDS`.
    role : {"model", "reference"}
        Whether it is to be judged, or is what others are compared with.
    is_ensemble : bool
        Whether what it fits has several members.
    """

    kind: ClassVar[str]
    role: ClassVar[Role]
    is_ensemble: ClassVar[bool]

    def resolved(self, dt: float, encounter_period: float | None) -> Self:
        """Settings whose lengths are samples."""

    def needs(self, dt: float, encounter_period: float | None = None) -> Needs:
        """Samples that it asks of its runs at a time step and an encounter period, s."""

    def fit(
        self, runs: Runs, states: Sequence[str], inputs: Sequence[str], stop: Stop = None
    ) -> Model:
        """Identify a model from training runs."""

    def to_json(self) -> Json:
        """Settings as JSON values."""

    @classmethod
    def from_json(cls, content: Json) -> Self:
        """Settings from JSON values; unknown or missing ones raise an error."""

    @classmethod
    def restore(cls, dataset: xr.Dataset) -> Model:
        """Rebuild the model that a file holds."""
