"""Input maps: how measured inputs become what drives a model.

A :class:`Chain` of maps is fitted with a model, and opened once per run: its :class:`Drive` then
serves all members, windows and steps. There are four maps: the identity (an empty chain),
:class:`Lead`, by which waves that have not yet arrived drive a step, :class:`ProbeAlignment`,
which carries the elevation to a vessel whose position is measured, and
:class:`~seakeep.models.following.Following`, in which the model itself says where it is. The
elevation is carried by

    distance = surge + offset + (position of the probe in training − its position in the run) + the
    run's own ``attrs["probe_offset"]``,

positive downstream, so that one linear model holds wherever the vessel has drifted to.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Literal, Self, cast

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.conventions import is_elevation
from seakeep.errors import SHOWN, DataError, RequestError
from seakeep.models import labelled
from seakeep.models.checks import check_choice, of_json, settings_of
from seakeep.models.interface import Drive, Follows, InputMap, Json, Regressors, Span, plain
from seakeep.models.labelled import ChannelLabel
from seakeep.models.observables import Observed
from seakeep.signals.propagation import (
    CarriedElevation,
    band_limit,
    carry_by_celerity,
    carry_by_dispersion,
    effective_celerity,
)
from seakeep.waves import group_speed

__all__ = ["MAPS", "Chain", "FittedAlignment", "Lead", "Measured", "ProbeAlignment", "depth_of"]

Mode = Literal["effective", "dispersion"]
Surge = Literal["measured", "predicted", "none"]


@dataclass(frozen=True, eq=False)
class Measured:
    """Inputs as they are: shape (time, Q), physical units, from the sample `first` of a run on.

    `surge`, shape (time,), is that of the vessel at the same samples, where it is known.
    """

    values: FloatArray
    first: int = 0
    surge: FloatArray | None = None

    def rows(self, first: int, stop: int) -> Regressors:
        """Inputs of a stretch."""
        values = self.values[first - self.first : stop - self.first]
        return Regressors(values, np.empty((stop - first, 0)))


@dataclass(frozen=True)
class Lead:
    """Look-ahead: the input up to `samples` after an instant drives the step from it.

    Parameters
    ----------
    samples : int
        Zero or more.
    """

    kind: ClassVar[str] = "lead"
    reads_surge: ClassVar[bool] = False
    follows: ClassVar[None] = None
    samples: int

    @property
    def lead_samples(self) -> int:
        """The look-ahead."""
        return self.samples

    def history(self, input_delays: int) -> int:
        """The delays themselves."""
        return input_delays

    def regressors(
        self, inputs: tuple[ChannelLabel, ...]
    ) -> tuple[tuple[ChannelLabel, ...], tuple[ChannelLabel, ...]]:
        """Return the inputs themselves, delayed."""
        return inputs, ()

    def reads(self, span: Span) -> Span:
        """Samples of input, later by the look-ahead."""
        return Span(span.first + self.samples, span.known, span.stop + self.samples)

    def wrap(self, drive: Drive, run: xr.Dataset | None, spans: Sequence[Span]) -> Drive:
        """Drive that reads ahead."""
        return _Ahead(drive, self.samples)

    def look_ahead(self, run: xr.Dataset | None, dt: float) -> float:
        """The look-ahead in seconds."""
        return self.samples * dt

    def notes(self, run: xr.Dataset) -> dict[str, str | float]:
        """Nothing beside the look-ahead, which every forecast reports."""
        return {}

    def describe(self, dt: float) -> list[str]:
        """One line."""
        return [
            f"  lead          {self.samples} samples: a step is driven by waves up to "
            f"{(self.samples - 1) * dt:.3g} s after the instant that it forecasts"
        ]

    def to_json(self) -> Json:
        """Return the number of samples."""
        return {"samples": self.samples}

    @classmethod
    def from_json(cls, content: Json) -> Self:
        """Rebuild from :meth:`to_json`."""
        return cls(**content)


@dataclass(frozen=True, eq=False)
class _Ahead:
    inner: Drive
    samples: int

    def rows(self, first: int, stop: int) -> Regressors:
        return self.inner.rows(first + self.samples, stop + self.samples)


@dataclass(frozen=True)
class ProbeAlignment:
    r"""How the wave input is aligned to the vessel.

    Parameters
    ----------
    mode : {"effective", "dispersion"}, optional
        One celerity for all waves, :math:`\eta(t) = \eta_{kn}(t - (x(t) - x_0)/c)` as in the
        paper, or linear dispersion, frequency by frequency.
    surge : {"measured", "predicted", "none"}, optional
        Position that the elevation is carried to: the measured surge (an output read during the
        forecast, which is then conditional on it), the slow surge that the model itself predicts,
        step by step, which takes mode "dispersion", or none, the place at rest.
    celerity : float or "common", optional
        c of mode "effective", m/s. By default each run's own, ``attrs["celerity"]``, which
        ``prepare`` finds by correlation; a run without it is carried as "common" has it: with the
        mean celerity of the training runs, which are correlated up to their stops where they do
        not state it, between the two probes among the inputs that stand farthest apart.
    offset : float, optional
        Constant distance, m, by which the elevation is carried in all runs, positive downstream;
        the paper's :math:`-x_0` where surge does not count from the place at rest.
    surge_channel : str, optional
        Name of the surge channel, m, positive downstream.
    channels : sequence of str, optional
        Inputs that are elevations; by default those with an ``attrs["x_position"]``, else those
        whose name starts with "eta".
    highest_frequency : float, optional
        Highest frequency of the waves in mode "dispersion", Hz; by default the one below which
        99.9 % of the variance of the training input lies.
    optional : bool, optional
        Whether a model goes without the alignment where the training runs do not carry what it
        needs: water depth and elevations; and without the surge where that is no state, or no
        position of a probe is stated.

    Raises
    ------
    RequestError
        If a setting is out of range or does not go with the mode.
    """

    mode: Mode = "effective"
    surge: Surge = "measured"
    celerity: float | Literal["common"] | None = None
    offset: float = 0.0
    surge_channel: str = "surge"
    channels: tuple[str, ...] | None = None
    highest_frequency: float | None = None
    optional: bool = False

    @property
    def carries(self) -> bool:
        """Whether waves are carried at all where the probes of a run stand as in training."""
        return self.surge != "none" or self.offset != 0.0

    def __post_init__(self) -> None:
        if not isinstance(self.optional, bool):
            raise RequestError(
                f"alignment: optional must be True or False; received {self.optional!r:.{SHOWN}}."
            )
        check_choice("alignment: mode", self.mode, ("effective", "dispersion"))
        check_choice("alignment: surge", self.surge, ("measured", "predicted", "none"))
        if self.surge == "predicted" and self.mode != "dispersion":
            raise RequestError(
                "alignment: surge = 'predicted' carries waves by their dispersion; received mode = "
                f"'{self.mode}'. Write mode = 'dispersion', or take surge = 'measured'."
            )
        if not (isinstance(self.celerity, str) and self.celerity == "common"):
            meant = "a positive number, 'common' or None"
            _check_number("celerity", self.celerity, "m/s", meant)
        _check_number(
            "highest_frequency", self.highest_frequency, "Hz", "a positive number or None"
        )
        if not _is_number(self.offset):
            raise RequestError(
                f"alignment: offset must be a number (m, positive downstream); received "
                f"{self.offset!r:.{SHOWN}}."
            )
        for key, mode in (("celerity", "effective"), ("highest_frequency", "dispersion")):
            if getattr(self, key) is not None and self.mode != mode:
                raise RequestError(
                    f"alignment: {key} = {getattr(self, key)!r} belongs to mode = '{mode}'; "
                    f"received mode = '{self.mode}'. Leave it out, or change the mode."
                )
        names: Any = self.channels
        if names is not None:
            if isinstance(names, str) or not isinstance(names, Iterable):
                raise RequestError(
                    "alignment: channels must be a list of names; "
                    f"received {names!r:.{SHOWN}}. Write "
                    f"channels=['{names}']."
                )
            object.__setattr__(self, "channels", tuple(names))

    @classmethod
    def of(cls, value: object) -> Self | None:
        """Return settings as they are, or made of a table of their keys; None stays None.

        Parameters
        ----------
        value : ProbeAlignment, mapping or None
            What was given as ``alignment``.

        Returns
        -------
        ProbeAlignment or None

        Raises
        ------
        RequestError
            If it is something else, or a key is not known.
        """
        example = "mode='effective', surge='measured'"
        return settings_of(cls, "alignment", value, example)

    def fit(
        self,
        runs: Mapping[str, xr.Dataset],
        states: Sequence[str],
        inputs: Sequence[str],
        window: int | None,
    ) -> FittedAlignment | Chain:
        """Complete the settings from training runs that end where training ends.

        Parameters
        ----------
        runs : mapping of str to Dataset
            Training runs, cut at the end of their training windows.
        states, inputs : sequence of str
            Channels of the model.
        window : int or None
            Samples of the training windows; None for all of the runs.

        Returns
        -------
        FittedAlignment or Chain
            With celerity, depth, band and positions; an empty chain where an optional alignment
            cannot be made.

        Raises
        ------
        RequestError
            If the runs do not carry what the settings need.
        DataError
            If a record has gaps in the window, is constant, or the probes' records do not
            correlate.
        """
        first_name, first = next(iter(runs.items()))
        labelled.check_channels(first, inputs, first_name)
        if self.optional and self.missing(runs, states, inputs):
            still = replace(self, surge="none")  # for probes that stand elsewhere in other runs
            return (
                Chain()
                if still.missing(runs, states, inputs)
                else still.fit(runs, states, inputs, window)
            )
        carried = _elevations(self, first, inputs)
        if self.surge == "predicted" and self.surge_channel not in states:
            raise RequestError(
                f"alignment: surge = 'predicted' needs '{self.surge_channel}' among the states; "
                f"received {', '.join(states)}. Add it, or choose surge = 'measured' or 'none'."
            )
        last = slice(None if window is None else -window, None)
        windows = {name: run.isel(time=last) for name, run in runs.items()}
        depth = _common_depth(runs)
        celerity = None if self.celerity == "common" else self.celerity
        spread, limit = None, self.highest_frequency
        elevations = [channel for channel, yes in zip(inputs, carried, strict=True) if yes]
        if self.mode == "dispersion":
            depth = depth_of(first, first_name, depth)
            if limit is None:
                limit = float(
                    np.median([_band(run, name, elevations) for name, run in windows.items()])
                )
        elif celerity is None:
            celerity, spread = _celerity(runs, elevations, depth)
        return FittedAlignment(
            settings=self,
            inputs=tuple(inputs),
            states=tuple(states),
            carried=carried,
            positions=tuple(_position(first, channel) for channel in inputs),
            celerity=celerity,
            celerity_spread=spread,
            water_depth=depth,
            highest_frequency=limit,
        )

    def missing(
        self, runs: Mapping[str, xr.Dataset], states: Sequence[str], inputs: Sequence[str]
    ) -> str:
        """What an optional alignment goes without, in words.

        Parameters
        ----------
        runs : mapping of str to Dataset
            Training runs.
        states, inputs : sequence of str
            Channels of the model.

        Returns
        -------
        str
            Empty where nothing is missing.
        """
        name, first = next(iter(runs.items()))
        if self.surge == "predicted" and self.surge_channel not in states:
            return f"'{self.surge_channel}' is not among the states"
        placed = self.channels or [each for each in inputs if _position(first, each) is not None]
        if not placed and self.surge != "none":
            return f"{name} states no position of a wave probe"
        if not placed and not any(is_elevation(each, rates=True) for each in inputs):
            return "no input is a wave elevation"
        if self.mode == "dispersion" and _common_depth(runs) is None:
            return "the runs state no water depth"
        return ""

    def to_json(self) -> Json:
        """Settings as JSON values."""
        made: Json = plain({each.name: getattr(self, each.name) for each in fields(self)})
        return made


@dataclass(frozen=True)
class FittedAlignment:
    """A fitted alignment.

    Parameters
    ----------
    settings : ProbeAlignment
        As it was asked for.
    inputs, states : tuple of str
        Channels of the model.
    carried : tuple of bool
        Which inputs are elevations.
    positions : tuple of float or None
        Position of each input's probe in training, m; None where the run did not state it.
    celerity : float or None
        The one given, or the mean of the training runs, m/s (mode "effective").
    celerity_spread : float or None
        Standard deviation of its estimates over the training runs, m/s.
    water_depth : float or None
        m, of the training runs.
    highest_frequency : float or None
        Hz (mode "dispersion").
    """

    kind: ClassVar[str] = "probe_alignment"
    lead_samples: ClassVar[int] = 0
    follows: ClassVar[None] = None
    settings: ProbeAlignment
    inputs: tuple[str, ...]
    states: tuple[str, ...]
    carried: tuple[bool, ...]
    positions: tuple[float | None, ...]
    celerity: float | None = None
    celerity_spread: float | None = None
    water_depth: float | None = None
    highest_frequency: float | None = None

    @property
    def placed(self) -> tuple[int, ...]:
        """Elevations at stated positions, by their places among the inputs."""
        every = enumerate(zip(self.carried, self.positions, strict=True))
        return tuple(column for column, (yes, at) in every if yes and at is not None)

    def history(self, input_delays: int) -> int:
        """The delays themselves."""
        return input_delays

    @property
    def reads_surge(self) -> bool:
        """Whether the measured surge is read after the start."""
        return self.settings.surge == "measured"

    def regressors(
        self, inputs: tuple[ChannelLabel, ...]
    ) -> tuple[tuple[ChannelLabel, ...], tuple[ChannelLabel, ...]]:
        """Return the inputs, carried to the vessel."""
        return inputs, ()

    def reads(self, span: Span) -> Span:
        """Return the same samples: what surrounds them is read where there is some."""
        return span

    def wrap(self, drive: Drive, run: xr.Dataset | None, spans: Sequence[Span]) -> Drive:
        """Carry the elevations of a run, each probe once; plain arrays are aligned already."""
        if run is None:
            return drive
        return _Carried.of(self, run, spans)

    def look_ahead(self, run: xr.Dataset | None, dt: float) -> float:
        """Time that the slowest waves take over the constant distance they are carried upstream.

        A surge upstream reads nothing more: the record is continued by linear prediction there.
        """
        if run is None:
            return 0.0
        places = zip(self.offsets(run), self.carried, strict=True)
        farthest = min((float(distance) for distance, yes in places if yes), default=0.0)
        return max(0.0, -farthest) / self._speed(run)

    def celerity_of(self, run: xr.Dataset) -> float | None:
        """Celerity at which a run is carried, m/s; None in mode "dispersion"."""
        if self.celerity is None or self.settings.celerity is not None:
            return self.celerity
        return float(run.attrs.get("celerity", self.celerity))

    def _speed(self, run: xr.Dataset) -> float:
        if (celerity := self.celerity_of(run)) is not None:
            return celerity
        assert self.highest_frequency is not None
        depth = depth_of(run, "the run", self.water_depth)
        return float(group_speed(2 * np.pi * self.highest_frequency, depth))

    def notes(self, run: xr.Dataset) -> dict[str, str | float]:
        """Mode, surge, celerity, the run's probe offset, with measured surge ``conditional_on``."""
        settings = self.settings
        out: dict[str, str | float] = {
            "alignment_mode": settings.mode,
            "alignment_surge": settings.surge,
        }
        if settings.surge == "measured":
            out["conditional_on"] = settings.surge_channel
        if (celerity := self.celerity_of(run)) is not None:
            out["alignment_celerity"] = celerity
        for key in ("probe_offset", "probe_offset_spread"):
            if key in run.attrs:
                out[key] = float(run.attrs[key])
        return out

    def describe(self, dt: float) -> list[str]:
        """One line, and one more where the waves are read upstream."""
        settings = self.settings
        speed = "" if self.celerity is None else f", celerity {self.celerity:.4g} m/s"
        if speed and settings.celerity is None:
            speed += " in training, each run's own in forecasts"
        lines = [f"  alignment     mode {settings.mode}{speed}; surge {settings.surge}"]
        if not settings.carries:
            return ["  alignment     none, but by the offset of a run's probes where it has one"]
        if settings.offset < 0:
            lines.append(
                f"    offset {settings.offset:g} m carries the waves upstream: a forecast reads "
                "them before they reach the probe"
            )
        return lines

    def to_json(self) -> Json:
        """Settings and what was fitted."""
        content = {each.name: getattr(self, each.name) for each in fields(self)}
        made: Json = plain(content | {"settings": self.settings.to_json()})
        return made

    @classmethod
    def from_json(cls, content: Json) -> Self:
        """Rebuild from :meth:`to_json`."""
        return of_json(cls, content)

    def offsets(self, run: xr.Dataset) -> FloatArray:
        """Constant distance by which each input of a run is carried, m."""
        own = float(run.attrs.get("probe_offset", 0.0))
        out = np.full(len(self.inputs), self.settings.offset + own)
        for column, channel in enumerate(self.inputs):
            here, reference = run[channel].attrs.get("x_position"), self.positions[column]
            if here is not None and reference is not None:
                out[column] += reference - float(here)
        return out

    def carries_in(self, run: xr.Dataset) -> bool:
        """Whether waves are carried at all in a run."""
        return self.settings.carries or bool(np.any(self.offsets(run)))

    def positions_in(self, run: xr.Dataset) -> tuple[float | None, ...]:
        """Position of each input's probe in a run, m; that in training where it states none."""
        found = [_position(run, channel) for channel in self.inputs]
        pairs = zip(found, self.positions, strict=True)
        return tuple(trained if here is None else here for here, trained in pairs)

    def carry(
        self, run: xr.Dataset, name: str, samples: slice, surges: tuple[float, float]
    ) -> tuple[CarriedElevation | None, ...]:
        """Prepare the elevations of a stretch to be read at surge + offset; None for others."""
        values = labelled.channel_matrix(run, self.inputs, name, samples)
        dt = labelled.run_step(run, name)
        out: list[CarriedElevation | None] = []
        for column, offset in enumerate(self.offsets(run)):
            reach = (surges[0] + offset, surges[1] + offset)
            if not self.carried[column]:
                out.append(None)
            elif self.settings.mode == "effective":
                celerity = self._speed(run)
                out.append(carry_by_celerity(values[:, column], dt, reach, celerity))
            else:
                depth = depth_of(run, name, self.water_depth)
                limit = self.highest_frequency
                out.append(carry_by_dispersion(values[:, column], dt, reach, depth, limit))
        return tuple(out)


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Carried elevations of a stretch of a run without gaps, from sample `first` on."""

    first: int
    stop: int
    carriers: tuple[CarriedElevation | None, ...]


@dataclass(frozen=True, eq=False)
class _Carried:
    """Inputs of a run carried to the vessel; elevations before and after what is wanted count."""

    values: FloatArray
    surge: FloatArray
    offsets: FloatArray
    stretches: tuple[_Stretch, ...]

    @classmethod
    def of(cls, map_: FittedAlignment, run: xr.Dataset, spans: Sequence[Span]) -> Self:
        name = labelled.run_name(run, "the run")
        settings = map_.settings
        # No wave is read beyond the look-ahead of the last instant that is asked for.
        dt = labelled.run_step(run, name)
        last = max(span.stop for span in spans) + math.ceil(map_.look_ahead(run, dt) / dt)
        values = labelled.channel_matrix(run, map_.inputs, name)[:last]
        size = len(values)
        surge, reach = np.zeros(size), (0.0, 0.0)
        if settings.surge != "none":
            time = np.asarray(run["time"].values, dtype=float)
            surge = labelled.channel_matrix(run, [settings.surge_channel], name)[:, 0]
            for span in spans:  # read where it is allowed, and no further
                read = surge[span.first : span.stop]
                labelled.check_finite(
                    read[:, None], [settings.surge_channel], name, span.first, time
                )
            every = np.concatenate([surge[span.first : span.stop] for span in spans])
            reach = float(every.min()), float(every.max())
        sound = np.all(np.isfinite(values), axis=1)
        gaps = np.flatnonzero(~sound)
        found: list[_Stretch] = []
        for span in spans:
            if any(each.first <= span.first and span.stop <= each.stop for each in found):
                continue
            before, after = gaps[gaps < span.first], gaps[gaps >= span.stop]
            first = int(before[-1]) + 1 if before.size else 0
            stop = int(after[0]) if after.size else size
            carriers = map_.carry(run, name, slice(first, stop), reach)
            found.append(_Stretch(first, stop, carriers))
        return cls(values, surge, map_.offsets(run), tuple(found))

    def rows(self, first: int, stop: int) -> Regressors:
        surge = self.surge[first:stop]
        stretch = self._stretch(first)
        out = self.values[first:stop].copy()
        inside = slice(first - stretch.first, stop - stretch.first)
        for column, carrier in enumerate(stretch.carriers):
            if carrier is not None:
                out[:, column] = carrier.at(surge + self.offsets[column], inside)[:, 0]
        return Regressors(out, np.empty((stop - first, 0)))

    def _stretch(self, sample: int) -> _Stretch:
        return next(each for each in self.stretches if each.first <= sample < each.stop)


@dataclass(frozen=True)
class Chain:
    """Input maps one after the other, the first one nearest to the measurement.

    Parameters
    ----------
    maps : tuple of InputMap
        Any number; none leaves the inputs as they are.
    """

    kind: ClassVar[str] = "chain"
    maps: tuple[InputMap, ...] = ()

    def __post_init__(self) -> None:
        # An optional alignment that was left out is an empty chain.
        flat = [m for each in self.maps for m in (each.maps if isinstance(each, Chain) else [each])]
        object.__setattr__(self, "maps", tuple(flat))

    @classmethod
    def of(cls, input_map: InputMap) -> Chain:
        """An input map as a chain: itself, or of it alone."""
        return input_map if isinstance(input_map, Chain) else cls((input_map,))

    @property
    def lead_samples(self) -> int:
        """Samples of input after instant j that row j reads."""
        return self.reads(Span(0, 0, 1)).stop - 1

    def history(self, input_delays: int) -> int:
        """Samples of input before the start that a forecast with these delays reads."""
        return max(input_delays, -self.reads(Span(-input_delays, 0, 1)).first)

    @property
    def reads_surge(self) -> bool:
        """Whether a map reads the measured surge after the start."""
        return any(each.reads_surge for each in self.maps)

    @property
    def follows(self) -> Follows | None:
        """Place of the vessel that a map follows, and the state that it is a sum of."""
        return next((each.follows for each in self.maps if each.follows is not None), None)

    @property
    def alignment(self) -> FittedAlignment | None:
        """The alignment among the maps, or that of one which follows the predicted surge."""
        found = (getattr(each, "alignment", each) for each in self.maps)
        return next((each for each in found if isinstance(each, FittedAlignment)), None)

    @property
    def observed(self) -> Observed | None:
        """Observables among the maps, or those of one which follows the predicted surge."""
        found = (getattr(each, "observed", each) for each in self.maps)
        return next((each for each in found if isinstance(each, Observed)), None)

    @property
    def stretch(self) -> tuple[FloatArray, FloatArray] | None:
        """Factors of the standard deviations that the columns are divided by; None for ones.

        λ of a model that follows its own surge is small, and weighs more on powers.
        """
        found = (cast("Any", each).stretch for each in self.maps if each.follows)
        return next(found, None)

    def regressors(
        self, inputs: tuple[ChannelLabel, ...]
    ) -> tuple[tuple[ChannelLabel, ...], tuple[ChannelLabel, ...]]:
        """Labels after the last map."""
        direct: tuple[ChannelLabel, ...] = ()
        for each in self.maps:
            inputs, more = each.regressors(inputs)
            direct += more
        return inputs, direct

    def reads(self, span: Span) -> Span:
        """Samples of the measured inputs that are read."""
        for each in reversed(self.maps):
            span = each.reads(span)
        return span

    def wrap(self, drive: Drive, run: xr.Dataset | None, spans: Sequence[Span]) -> Drive:
        """Drive of the last map, opened on those before it."""
        for number, each in enumerate(self.maps):
            after = Chain(self.maps[number + 1 :])
            drive = each.wrap(drive, run, [after.reads(span) for span in spans])
        return drive

    def look_ahead(self, run: xr.Dataset | None, dt: float) -> float:
        """Sum of those of the maps, s."""
        return sum(each.look_ahead(run, dt) for each in self.maps)

    def notes(self, run: xr.Dataset) -> dict[str, str | float]:
        """Those of all maps."""
        return {key: value for each in self.maps for key, value in each.notes(run).items()}

    def describe(self, dt: float) -> list[str]:
        """Lines of all maps."""
        return [line for each in self.maps for line in each.describe(dt)]

    def to_json(self) -> Json:
        """Maps with their kinds."""
        return {"maps": [{"kind": each.kind, **each.to_json()} for each in self.maps]}

    @classmethod
    def from_json(cls, content: Json) -> Self:
        """Rebuild from :meth:`to_json`; an unknown kind raises a DataError."""
        maps = []
        for rest in content["maps"]:
            kind = str(rest.pop("kind"))
            if kind not in MAPS:
                raise DataError(
                    f"the input map '{kind}' is not known here. Update seakeep, or import the "
                    "module that adds it to seakeep.models.inputs.MAPS."
                )
            maps.append(MAPS[kind].from_json(rest))
        return cls(tuple(maps))


MAPS: dict[str, type[InputMap]] = {
    each.kind: each for each in (Lead, FittedAlignment, Observed, Chain)
}
"""Input maps by their kind, as files name them; the one that follows the surge adds itself."""


def _is_number(value: object) -> bool:
    real = isinstance(value, numbers.Real) and not isinstance(value, bool)
    return real and math.isfinite(value)  # type: ignore[arg-type]


def _check_number(name: str, value: object, unit: str, meant: str) -> None:
    if value is not None and not (_is_number(value) and value > 0):  # type: ignore[operator]
        raise RequestError(
            f"alignment: {name} must be {meant} ({unit}); received {value!r:.{SHOWN}}."
        )


def _elevations(
    settings: ProbeAlignment, run: xr.Dataset, inputs: Sequence[str]
) -> tuple[bool, ...]:
    if settings.channels is not None:
        strangers = [channel for channel in settings.channels if channel not in inputs]
        if strangers:
            raise RequestError(
                f"alignment: channels names '{strangers[0]}', which is not among the inputs "
                f"({', '.join(inputs) or 'none'}). Name inputs of the model."
            )
        chosen = tuple(channel in settings.channels for channel in inputs)
    else:
        chosen = tuple(_position(run, channel) is not None for channel in inputs)
        if not any(chosen):
            chosen = tuple(is_elevation(channel, rates=True) for channel in inputs)
    if not any(chosen):
        raise RequestError(
            f"alignment: none of the inputs ({', '.join(inputs) or 'none'}) is known as a wave "
            "elevation. Give the channels an attribute x_position ([rig.positions] of the "
            "campaign), or name them: alignment channels = ['…']."
        )
    return chosen


def _position(run: xr.Dataset, channel: str) -> float | None:
    value = run[channel].attrs.get("x_position")
    return None if value is None else float(value)


def depth_of(run: xr.Dataset, name: str, otherwise: float | None) -> float:
    """Water depth of a run, m: its own, or another one where it states none."""
    depth = run.attrs.get("water_depth", otherwise)
    if depth is None:
        raise RequestError(
            f"alignment: mode = 'dispersion' needs the water depth and {name} has no attribute "
            "'water_depth'. State water_depth (m, inf for deep water) in [rig], or set "
            "run.attrs['water_depth']."
        )
    return float(depth)


def _common_depth(runs: Mapping[str, xr.Dataset]) -> float | None:
    stated = [run.attrs["water_depth"] for run in runs.values() if "water_depth" in run.attrs]
    return float(stated[0]) if stated else None


def _sound(run: xr.Dataset, name: str, channels: Sequence[str]) -> FloatArray:
    values = labelled.channel_matrix(run, channels, name)
    labelled.check_finite(values, channels, name, 0, np.asarray(run["time"].values, dtype=float))
    return values


def _band(run: xr.Dataset, name: str, elevations: Sequence[str]) -> float:
    return band_limit(_sound(run, name, elevations), labelled.run_step(run, name))


def _celerity(
    runs: Mapping[str, xr.Dataset], elevations: Sequence[str], depth: float | None
) -> tuple[float, float | None]:
    """Celerity from the mean slowness over the runs, and its standard deviation over them."""
    slowness = []
    for name, run in runs.items():
        if "celerity" in run.attrs:
            slowness.append(1.0 / float(run.attrs["celerity"]))
            continue
        placed = {c: x for c in elevations if (x := _position(run, c)) is not None}
        if len(set(placed.values())) < 2 or depth is None:
            raise RequestError(
                f"alignment: the celerity cannot be estimated from {name}: it takes the water "
                f"depth ({'missing' if depth is None else f'{depth:g} m'}) and two probes at "
                f"different positions among the inputs (positions stated: {len(placed)}). State "
                "celerity (m/s), or water_depth and positions in [rig]."
            )
        first, last = min(placed, key=placed.__getitem__), max(placed, key=placed.__getitem__)
        apart = placed[last] - placed[first]
        values = _sound(run, name, [first, last])
        try:
            found = effective_celerity(
                values[:, 0], values[:, 1], labelled.run_step(run, name), apart, depth
            )
        except DataError as error:
            raise DataError(f"{name}, '{first}' and '{last}': {error}") from None
        slowness.append(found.lag / apart)
    speeds = 1.0 / np.array(slowness)
    spread = float(speeds.std(ddof=1)) if len(slowness) > 1 else None
    return float(1.0 / np.mean(slowness)), spread
