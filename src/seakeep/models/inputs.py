"""Input maps: how measured inputs become what drives a model, and the signature of a model.

A map is fitted with a model and opened once per run: its :class:`Drive` then serves all members,
windows and steps. It aligns the elevations to the vessel, reads them ahead, and puts observables
beside them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.core.recursion import carried, read_table
from seakeep.errors import RequestError
from seakeep.models.alignment import SQUARED, Bank, FittedAlignment, Following
from seakeep.models.labelled import ChannelLabel, Span
from seakeep.models.observables import NOTHING, Observed
from seakeep.models.readouts import FittedReadOut


class Regressors(NamedTuple):
    """What drives the step from each of several samples, in physical units.

    `delayed` regressors enter with the model's input delays; `direct` ones bring their own and
    enter as they are.
    """

    delayed: FloatArray
    direct: FloatArray


class Around(NamedTuple):
    """Samples of input that rows read about the instant from which a step starts.

    Before it those with delays, and those without; after both, and after the instant forecast.
    """

    back: int
    before: int
    ahead: int
    after: int


@dataclass(frozen=True, eq=False)
class InputMap:
    """How measured inputs become regressors, as fitted.

    Parameters
    ----------
    alignment : FittedAlignment, optional
        Of the elevations to the vessel.
    lead : int, optional
        Look-ahead: the input up to `lead` samples after an instant drives the step from it; 0
        where carriers read ahead.
    observed : Observed, optional
        Observables; by default there are none. Those with delays are functions of the aligned
        inputs. Those without are functions of the inputs without look-ahead, which are the measured
        ones where the model follows its own surge.
    follows : Following, optional
        Carriers to the place where the surge that the model predicts takes the vessel.
    reference : int, optional
        Samples up to the start of a forecast whose means states and regressors depart from.
    """

    alignment: FittedAlignment | None = None
    lead: int = 0
    observed: Observed = NOTHING
    follows: Following | None = None
    reference: int = 0

    @cached_property
    def around(self) -> Around:
        """Samples that rows read."""
        back, ahead = self.observed.reach(delayed=True)
        before, later = self.observed.reach(delayed=False)
        ahead += self.lead
        if self.follows is not None:
            back = max(self.follows.back, self.follows.place.taps.size - 1)
            ahead = self.follows.ahead
        ahead = max(ahead, later)
        return Around(back, before, ahead, max(ahead - 1, 0))

    @property
    def reads_surge(self) -> bool:
        """Whether the measured surge is read after the start of a forecast."""
        return self.alignment is not None and self.alignment.settings.surge == "measured"

    @property
    def stretch(self) -> tuple[FloatArray, FloatArray]:
        """Factors of what columns are divided by, where the surge is followed.

        λ of a model that follows its own surge is small, and weighs more on powers.
        """
        assert self.follows is not None
        inputs = np.ones(len(self.follows.alignment.inputs))
        delayed, direct = self.observed.stretch
        return np.append(inputs, delayed), np.append(direct, 1.0)

    def regressors(
        self, inputs: tuple[ChannelLabel, ...]
    ) -> tuple[tuple[ChannelLabel, ...], tuple[ChannelLabel, ...]]:
        """Labels of the delayed and of the direct regressors made of these inputs."""
        delayed, direct = self.observed.labels
        return inputs + delayed, direct + (SQUARED,) * (self.follows is not None)

    def reads(self, span: Span) -> Span:
        """Samples of the measured inputs that rows read; direct ones count from the start on."""
        back, before, ahead, _ = self.around
        first = min(span.first - back, span.known - before)
        if not self.observed.observables and self.follows is None:
            first = span.first + self.lead
        return Span(first - self.reference, span.known, span.stop + ahead)

    def history(self, input_delays: int) -> int:
        """Samples of input before the start that a forecast with these delays reads."""
        return max(input_delays, -self.reads(Span(-input_delays, 0, 1)).first)

    def drive(
        self,
        values: FloatArray,
        spans: Sequence[Span],
        *,
        run: xr.Dataset | None = None,
        first: int = 0,
        surge: FloatArray | None = None,
    ) -> Drive:
        """Regressors of a run.

        Parameters
        ----------
        values : ndarray, shape (time, Q)
            Measured inputs, physical units.
        spans : sequence of Span
            Samples whose regressors are wanted.
        run : Dataset, optional
            The run, with its rig and its surge. Without one, `values` are aligned already to a
            measured surge, and the rig of a model that follows its surge is that of training.
        first : int, optional
            Sample of the run at which `values` start.
        surge : ndarray, shape (time,), optional
            Surge of the vessel at the same samples, where the model follows it.
        """
        if self.follows is not None:
            return Drive(self, values, first, surge, self.follows.banks(run), run, spans)
        if spans:
            read = [self.reads(span) for span in spans]
            if self.alignment is not None and run is not None:
                values, first = self.alignment.carry(run, read), 0
            low, high = min(each.first for each in read), max(each.stop for each in read)
            values, first = values[low - first : max(high - first, 0)], low
        return Drive(self, values, first)

    def look_ahead(self, run: xr.Dataset, dt: float) -> float:
        """Seconds of input after the one a step starts from that drive the step, in this run."""
        ahead = self.around.ahead * dt
        if self.alignment is not None and self.follows is None:
            ahead += self.alignment.look_ahead(run)
        return ahead

    def describe(self, dt: float) -> list[str]:
        """Lines of a model's summary."""
        carried = self.follows or self.alignment
        lines = [] if carried is None else carried.describe()
        if self.lead:
            lines.append(
                f"  lead          {self.lead} samples: a step is driven by waves up to "
                f"{(self.lead - 1) * dt:.3g} s after the instant that it forecasts"
            )
        if self.reference:
            lines.append(
                f"  centre        departures from means of {self.reference} samples up to a start"
            )
        return lines + self.observed.describe(self.lead)


@dataclass(frozen=True, eq=False)
class Drive:
    """Regressors of one run, made once and shared by members and windows.

    Parameters
    ----------
    input_map : InputMap
        The map.
    values : ndarray, shape (time, Q)
        Inputs, carried to a measured surge, from the sample `first` of the run on.
    first : int
        Their first sample.
    surge : ndarray, shape (time,), optional
        Surge at the same samples, of a model that follows it.
    banks : tuple of Bank, optional
        Carriers in the rig of the run, of a model that follows its surge.
    run : Dataset, optional
        The run, with its rig; that of training without one.
    spans : sequence of Span
        Samples whose regressors are wanted, where the model follows its surge.
    """

    input_map: InputMap
    values: FloatArray
    first: int
    surge: FloatArray | None = None
    banks: tuple[Bank, ...] = ()
    run: xr.Dataset | None = None
    spans: Sequence[Span] = ()

    def rows(self, first: int, stop: int, table: FloatArray | None = None) -> Regressors:
        """Regressors of the samples from `first` to before `stop`, shape (sample, channel).

        `table` is :meth:`table` of these samples, where it is there already.

        Rows are NaN where they need inputs that are not there. Waves of a model that follows its
        surge are those at the measured one; without one, of a vessel at rest in the mean place.
        """
        input_map, direct = self.input_map, self.direct(first, stop)
        if input_map.follows is None:
            begin, end = (each + input_map.lead - self.first for each in (first, stop))
            back, _, ahead, _ = input_map.around
            low = max(begin - back, 0)
            values = self.values[low : end + ahead - input_map.lead]
            delayed = input_map.observed.with_delayed(values)
            return Regressors(delayed[begin - low : end - low], direct)
        place, here = input_map.follows.place, self.places(first, stop)
        if table is None:
            table = self.table(first, stop)
        delayed = read_table(place, table, np.arange(stop - first), here)
        squared = (here - place.centre) ** 2
        return Regressors(delayed, np.concatenate([direct, squared[:, None]], axis=1))

    def direct(self, first: int, stop: int) -> FloatArray:
        """Columns without delays that no state drives."""
        if not self.input_map.observed.observables:
            return np.empty((stop - first, 0))
        _, before, ahead, _ = self.input_map.around
        begin = max(first - before, self.first)
        values = self.values[begin - self.first : stop + ahead - self.first]
        return self.input_map.observed.direct(values)[first - begin : stop - begin]

    @cached_property
    def whole(self) -> tuple[int, FloatArray]:
        """First of the samples that are wanted, and the table of all of them."""
        first = min(span.first for span in self.spans)
        return first, self.table(first, max(span.stop for span in self.spans))

    def table(self, first: int, stop: int) -> FloatArray:
        """Delayed regressors of samples at all places, shape (time, place, n)."""
        follows = self.input_map.follows
        assert follows is not None
        back, count = follows.back, follows.place.count
        values = self.values[first - back - self.first : stop + follows.ahead - self.first]
        out = np.empty((stop - first, count, values.shape[1]))
        out[:] = values[back : back + stop - first, None]
        for bank in self.banks:
            out[:, :, bank.column] = carried(bank.taps, values[:, bank.columns])
        flat = self.input_map.observed.with_delayed(out.reshape(-1, out.shape[2]))
        return flat.reshape(stop - first, count, flat.shape[1])

    def waves(self, places: tuple[float, ...], first: int, stop: int) -> FloatArray:
        """Wave at places about the vessel at rest an instant after samples.

        Elevation and its rate, shape (time, place, 2).
        """
        follows = self.input_map.follows
        assert follows is not None
        begin = first - follows.back - self.first
        values = self.values[begin : stop + follows.ahead - self.first, follows.placed]
        read = carried(follows.lines(self.run, places), values)
        return read.reshape(stop - first, len(places), 2)

    def places(self, first: int, stop: int) -> FloatArray:
        """Place of the vessel by its measured surge; at rest in the mean without one."""
        assert self.input_map.follows is not None
        place = self.input_map.follows.place
        if self.surge is None:
            return np.full(stop - first, place.centre)
        return place.of(self.surge[first - self.first - place.taps.size + 1 : stop - self.first])


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

    @cached_property
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

    @cached_property
    def states(self) -> list[str]:
        """Names of the states, in the order of the model."""
        return [label.name for label in self.state_labels]

    @cached_property
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
    def scales(self) -> tuple[Scale, Scale, Scale]:
        """Moments of the states, of the delayed and of the direct regressors."""
        return self.state_scale, self.input_scale, self.direct_scale

    def scaled(self, states: Scale, inputs: Scale, direct: Scale) -> Self:
        """The same with other moments."""
        return replace(self, state_scale=states, input_scale=inputs, direct_scale=direct)

    @cached_property
    def input_history(self) -> int:
        """Samples of input before the start that a forecast reads."""
        return self.input_map.history(self.input_delays)

    @property
    def input_after(self) -> int:
        """Samples of input after its last instant that a forecast reads."""
        return self.input_map.around.after

    @cached_property
    def history_samples(self) -> int:
        """Samples a forecast needs up to its start, that one included."""
        return max(self.state_delays, self.input_history) + 1

    @cached_property
    def state_samples(self) -> int:
        """Samples of the states among these: where the vessel was counts for delayed waves too."""
        follows, reference = self.input_map.follows, self.input_map.reference
        where = 0
        if follows is not None:
            where = max(self.input_delays, reference) + follows.place.taps.size
        return max(self.state_delays + 1, reference, where)

    @cached_property
    def lead_samples(self) -> int:
        """Samples of input after the one a step starts from that drive the step."""
        return self.input_map.around.ahead

    def check_fixed(self) -> None:
        """Refuse a model whose means are those before each start."""
        if self.input_map.reference:
            raise RequestError(
                "the model forecasts departures from the means before each start (centre = 'run'), "
                "which forecast, compare and forecast_arrays take from what they are given. For "
                "anything else, fit it with centre = 'pooled'."
            )
