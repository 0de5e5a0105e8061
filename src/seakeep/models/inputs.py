"""From the measured inputs of a run to the columns that drive a model.

The map has up to four links: the elevation is carried to the vessel (alignment), observables of the
carried inputs stand beside them, and a lead shifts those that take the model's delays. It is fitted
once and frozen; :meth:`FittedInputs.open` applies it to a run, whose record is carried once for all
windows, members and passes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
import xarray as xr
from scipy import signal

from seakeep.arrays import FloatArray
from seakeep.errors import DataError, RequestError
from seakeep.models import labelled, observables
from seakeep.models.alignment import FittedAlignment, ProbeAlignment, fit_alignment
from seakeep.models.labelled import ChannelLabel
from seakeep.models.observables import Bound, Observable
from seakeep.signals.propagation import CarriedElevation
from seakeep.signals.waves import encounter_period

__all__ = ["Drive", "FittedInputs", "Rows", "fit_inputs"]

SURGE_CUTOFF = 0.2
"""A predicted surge is followed below this frequency, per encounter period.

Surge at wave frequency is part of the response that the model learns from the wave; following its
prediction too feeds its error back. Between 0.1 and 0.33 the skill on the virtual tank is flat."""


class Rows(NamedTuple):
    """Columns that drive a model, row by row.

    Attributes
    ----------
    delayed : ndarray, shape (time, Q')
        Columns that take the input delays of the model.
    direct : ndarray, shape (time, D)
        Columns without delays.
    """

    delayed: FloatArray
    direct: FloatArray


@dataclass(frozen=True, eq=False)
class FittedInputs:
    """The input map of a model.

    Parameters
    ----------
    measured : tuple of ChannelLabel
        Measured inputs.
    dt : float
        Time step, s.
    alignment : FittedAlignment, optional
        How the elevation is carried to the vessel.
    lead : int
        Samples by which the delayed columns look ahead: row j holds them at j + lead.
    observables : tuple of Observable
        Functions of the (carried) inputs that stand beside them.
    period : float or None
        Encounter period, samples; observables and a predicted surge need it.
    """

    measured: tuple[ChannelLabel, ...]
    dt: float
    alignment: FittedAlignment | None = None
    lead: int = 0
    observables: tuple[Observable, ...] = ()
    period: float | None = None

    @cached_property
    def bound(self) -> tuple[Bound, ...]:
        """The observables, ready for these inputs."""
        return tuple(
            each.bind(self.measured, self.period or 1.0, self.dt) for each in self.observables
        )

    @property
    def names(self) -> list[str]:
        """Names of the measured inputs."""
        return [label.name for label in self.measured]

    @property
    def delayed(self) -> tuple[ChannelLabel, ...]:
        """Columns that take the input delays of the model: the inputs, then observables."""
        return self.measured + tuple(label for b in self.bound if b.delayed for label in b.labels)

    @property
    def direct(self) -> tuple[ChannelLabel, ...]:
        """Columns without delays."""
        return tuple(label for b in self.bound if not b.delayed for label in b.labels)

    @property
    def lead_samples(self) -> int:
        """Samples beyond instant j that row j reads."""
        return max([self.lead] + [b.ahead + (self.lead if b.delayed else 0) for b in self.bound])

    def history(self, input_delays: int) -> int:
        """Samples before instant j that a model with these delays reads at instant j."""
        before = max([0, *(b.before for b in self.bound if b.delayed)])
        direct = max([0, *(b.before for b in self.bound if not b.delayed)])
        return max(input_delays + before, direct)

    @property
    def follows_prediction(self) -> bool:
        """Whether the elevation is carried to the surge that the model predicts."""
        return self.alignment is not None and self.alignment.settings.surge == "predicted"

    def arrays(self, values: FloatArray) -> Rows:
        """Rows of inputs that are aligned already.

        Parameters
        ----------
        values : ndarray, shape (time, Q)
            Inputs.

        Returns
        -------
        Rows
            As long as `values`; NaN where a row needs samples that are not there.
        """
        parts = [(b.delayed, b.columns(values)) for b in self.bound]
        delayed = np.concatenate([values, *(part for yes, part in parts if yes)], axis=1)
        if self.lead:
            shifted = np.full_like(delayed, np.nan)
            shifted[: max(len(values) - self.lead, 0)] = delayed[self.lead :]
            delayed = shifted
        none = np.empty((len(values), 0))
        return Rows(delayed, np.concatenate([none, *(p for yes, p in parts if not yes)], axis=1))

    def open(self, run: xr.Dataset, name: str, needed: Sequence[slice]) -> Drive:
        """Apply the map to a run.

        Parameters
        ----------
        run : Dataset
            The run.
        name : str
            What messages call it.
        needed : sequence of slice
            Instants whose rows will be asked for, as samples of the run. Nothing is read beyond
            ``lead_samples`` after the last of them.

        Returns
        -------
        Drive

        Raises
        ------
        RequestError, DataError
            If the run lacks an input or what the alignment needs, or has gaps where it is needed.
        """
        last = max(samples.stop for samples in needed) + self.lead_samples
        values = labelled.channel_matrix(run, self.names, name)[:last]
        drive = Drive(self, run, name, values)
        alignment = self.alignment
        if alignment is not None and alignment.settings.surge == "measured":
            surges = [drive.surge(drive.reach(samples)) for samples in needed]
            low, high = drive.surge_range
            drive.surge_range = (
                min(low, *(float(surge.min()) for surge in surges)),
                max(high, *(float(surge.max()) for surge in surges)),
            )
        return drive

    def to_json(self) -> dict[str, Any]:
        """The map as JSON values, less the labels of the measured inputs."""
        return {
            "alignment": None if self.alignment is None else asdict(self.alignment),
            "lead": self.lead,
            "observables": [observables.to_json(each) for each in self.observables],
            "period": self.period,
        }

    @classmethod
    def from_json(
        cls, table: Mapping[str, Any], measured: Sequence[ChannelLabel], dt: float
    ) -> Self:
        """Rebuild a map from :meth:`to_json`."""
        alignment = table["alignment"]
        return cls(
            measured=tuple(measured),
            dt=dt,
            alignment=None if alignment is None else FittedAlignment.from_dict(alignment),
            lead=int(table["lead"]),
            observables=tuple(observables.from_json(each) for each in table["observables"]),
            period=table["period"],
        )


class Drive:
    """The inputs of a run, ready to drive a model; made by :meth:`FittedInputs.open`.

    Parameters
    ----------
    inputs : FittedInputs
        The map.
    run : Dataset
        The run.
    name : str
        What messages call it.
    values : ndarray, shape (time, Q)
        Its measured inputs, up to the last sample that may be read.
    """

    def __init__(
        self, inputs: FittedInputs, run: xr.Dataset, name: str, values: FloatArray
    ) -> None:
        self.inputs = inputs
        self.run = run
        self.name = name
        self.values = values
        self.time = np.asarray(run["time"].values, dtype=float)
        alignment = inputs.alignment
        self.surge_range = (0.0, 0.0) if alignment is None else alignment.surge_range
        self._gaps = np.flatnonzero(~np.all(np.isfinite(values), axis=1))
        self._carried: dict[tuple[int, int], list[CarriedElevation | None]] = {}

    def rows(self, samples: slice, surge: FloatArray | None = None) -> Rows:
        """Columns that drive the model at some instants.

        Parameters
        ----------
        samples : slice
            Instants, as samples of the run.
        surge : ndarray, optional
            Surge over :meth:`reach` of the samples, m; by default the measured one (below
            ``SURGE_CUTOFF`` where the model follows its prediction).

        Returns
        -------
        Rows
            NaN where a row needs inputs that the run does not hold.

        Raises
        ------
        DataError
            If an input, or a surge that is needed, has gaps at these instants.
        """
        whole = self.reach(samples)
        ready = self.inputs.arrays(self._aligned(whole, surge))
        first, count = samples.start - whole.start, min(samples.stop, whole.stop) - samples.start
        out = []
        for part in ready:
            padded = np.full((samples.stop - samples.start, part.shape[1]), np.nan)
            padded[:count] = part[first : first + count]
            out.append(padded)
        return Rows(*out)

    def reach(self, samples: slice) -> slice:
        """Samples of the run that the rows of `samples` read, as far as there is no gap."""
        stretch = self._stretch(samples)
        return slice(
            max(samples.start - self.inputs.history(0), stretch.start),
            min(samples.stop + self.inputs.lead_samples, stretch.stop),
        )

    def path(self, at: int, samples: slice, predicted: FloatArray | None = None) -> FloatArray:
        """Surge that a forecast follows: measured up to its start, then held or predicted.

        Parameters
        ----------
        at : int
            Sample of the start; no surge after it is read.
        samples : slice
            Instants of the rows.
        predicted : ndarray, shape (steps,), optional
            Surge after the start as the pass before predicted it, m; by default it is held at its
            mean over the last encounter period.

        Returns
        -------
        ndarray
            Over :meth:`reach` of the samples, m.
        """
        whole, period = self.reach(samples), self.inputs.period
        assert period is not None
        known = self.surge(slice(whole.start, at + 1))
        if predicted is None:
            future = np.full(whole.stop - at - 1, known[-max(round(period), 1) :].mean())
        else:
            future = np.clip(np.nan_to_num(predicted, nan=known[-1]), *self.surge_range)
            future = np.pad(future, (0, max(whole.stop - at - 1 - len(future), 0)), mode="edge")
        return _slow(np.concatenate([known, future[: whole.stop - at - 1]]), period)

    def surge(self, samples: slice) -> FloatArray:
        """Measured surge, m; zeros where the alignment does not use it."""
        alignment = self.inputs.alignment
        if alignment is None or alignment.settings.surge == "none":
            return np.zeros(samples.stop - samples.start)
        channel = alignment.settings.surge_channel
        values = labelled.channel_matrix(self.run, [channel], self.name, samples)
        labelled.check_finite(values, [channel], self.name, samples.start, self.time)
        return values[:, 0]

    def _aligned(self, samples: slice, surge: FloatArray | None) -> FloatArray:
        values = self.values[samples]
        labelled.check_finite(values, self.inputs.names, self.name, samples.start, self.time)
        alignment = self.inputs.alignment
        if alignment is None:
            return values
        if surge is None:
            surge = self.surge(samples)
            if self.inputs.follows_prediction:
                assert self.inputs.period is not None
                surge = _slow(surge, self.inputs.period)
        stretch = self._stretch(samples)
        inside = slice(samples.start - stretch.start, samples.stop - stretch.start)
        out = values.copy()
        offsets = alignment.offsets(self.run, self.inputs.names)
        for column, carrier in enumerate(self._carriers(stretch)):
            if carrier is not None:
                out[:, column] = carrier.at(surge + offsets[column], inside)[:, 0]
        return out

    def _stretch(self, samples: slice) -> slice:
        """Longest stretch of the record without gaps around samples that have none."""
        gaps = self._gaps
        before, after = gaps[gaps < samples.start], gaps[gaps >= samples.stop]
        return slice(
            int(before[-1]) + 1 if before.size else 0,
            int(after[0]) if after.size else len(self.values),
        )

    def _carriers(self, stretch: slice) -> list[CarriedElevation | None]:
        """Elevations ready to be read anywhere: made once per stretch of the record."""
        key = (stretch.start, stretch.stop)
        if key not in self._carried:
            alignment = self.inputs.alignment
            assert alignment is not None
            values = self.values[stretch]
            self._carried[key] = alignment.carry(
                self.run, self.inputs.names, self.name, values, self.surge_range
            )
        return self._carried[key]


def _slow(surge: FloatArray, period: float) -> FloatArray:
    """Surge below ``SURGE_CUTOFF``, without delay; `period` in samples."""
    sections = signal.butter(4, 2 * SURGE_CUTOFF / period, output="sos")
    padding = min(len(surge) - 1, round(5 * period))
    result: FloatArray = signal.sosfiltfilt(sections, surge, padlen=padding)
    return result


def fit_inputs(
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    window: int | None,
    *,
    alignment: ProbeAlignment | None,
    lead: int,
    chosen: Sequence[Observable],
) -> FittedInputs:
    """Complete an input map from training runs.

    Parameters
    ----------
    runs : mapping of str to Dataset
        Training runs, cut at the end of their training windows.
    states, inputs : sequence of str
        Channels of the model.
    window : int or None
        Samples of the training windows; None for all of the runs.
    alignment : ProbeAlignment or None
        How the elevation is carried to the vessel.
    lead : int
        Samples by which the delayed columns look ahead.
    chosen : sequence of Observable
        Functions of the inputs.

    Returns
    -------
    FittedInputs

    Raises
    ------
    RequestError
        If an observable or the alignment does not go with the inputs.
    DataError
        As :func:`seakeep.models.alignment.fit_alignment`.
    """
    name, first = next(iter(runs.items()))
    measured = labelled.channel_labels(first, inputs) if inputs else ()
    fitted = None
    if alignment is not None:
        fitted = fit_alignment(alignment, runs, states, inputs, window)
    follows = alignment is not None and alignment.surge == "predicted"
    period = _period(runs, inputs) if follows or chosen else None
    dt = labelled.run_step(first, name)
    made = FittedInputs(measured, dt, fitted, lead, tuple(chosen), period)
    names = [label.name for label in (*made.delayed, *made.direct)]
    for name in names:
        if names.count(name) > 1:
            raise RequestError(
                f"two inputs or observables make a column '{name}'. Give an expression another "
                "name, or leave one of the observables out."
            )
    return made


def _period(runs: Mapping[str, xr.Dataset], inputs: Sequence[str]) -> float:
    """Mean encounter period of the training runs, samples: stated by them, or counted."""
    found = []
    for name, run in runs.items():
        dt = labelled.run_step(run, name)
        stated = run.attrs.get("encounter_period")
        if stated is not None:
            found.append(float(stated) / dt)
            continue
        wave = labelled.channel_matrix(run, inputs[:1], name)[:, 0]
        wave = wave[np.isfinite(wave)]
        try:
            found.append(encounter_period(wave, dt) / dt)
        except (DataError, RequestError) as error:
            raise DataError(
                f"{name}: observables and a predicted surge need the encounter period, and it "
                f"cannot be counted in '{inputs[0]}': {error} Set "
                "run.attrs['encounter_period'] (s)."
            ) from None
    return float(np.mean(found))
