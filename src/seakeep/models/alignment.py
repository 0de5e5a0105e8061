"""Alignment of measured elevations to a moving vessel.

The elevation is carried by

    distance = surge + offset + (position of the probe in training − its position in the run) + the
    run's own ``attrs["probe_offset"]``,

positive downstream, so that one linear model holds wherever the vessel has drifted to.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.conventions import is_elevation
from seakeep.errors import DataError, RequestError
from seakeep.models import labelled
from seakeep.models.checks import (
    TINY,
    check_choice,
    check_flag,
    check_number,
    names_of,
    settings_of,
)
from seakeep.models.labelled import Span
from seakeep.signals.propagation import (
    CarriedElevation,
    band_limit,
    carry_by_celerity,
    carry_by_dispersion,
    effective_celerity,
)
from seakeep.waves import group_speed

Mode = Literal["effective", "dispersion"]
Surge = Literal["measured", "predicted", "none"]


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
    optional: bool = False

    @property
    def carries(self) -> bool:
        """Whether waves are carried at all where the probes of a run stand as in training."""
        return self.surge != "none" or self.offset != 0.0

    def __post_init__(self) -> None:
        check_flag("alignment: optional", self.optional)
        check_choice("alignment: mode", self.mode, ("effective", "dispersion"))
        check_choice("alignment: surge", self.surge, ("measured", "predicted", "none"))
        if self.surge == "predicted" and self.mode != "dispersion":
            raise RequestError(
                "alignment: surge = 'predicted' carries waves by their dispersion; received mode = "
                f"'{self.mode}'. Write mode = 'dispersion', or take surge = 'measured'."
            )
        check_number("alignment: offset", self.offset, "a number (m, positive downstream)", -np.inf)
        if self.celerity is not None:
            if self.celerity != "common":
                meant = "a positive number, 'common' or None (m/s)"
                check_number("alignment: celerity", self.celerity, meant, TINY)
            if self.mode != "effective":
                raise RequestError(
                    f"alignment: celerity = {self.celerity!r} belongs to mode = 'effective'; "
                    f"received mode = '{self.mode}'. Leave it out, or change the mode."
                )
        if self.channels is not None:
            example = f"channels = ['{self.channels}']"
            object.__setattr__(
                self, "channels", names_of(self.channels, "alignment: channels", example)
            )

    @classmethod
    def of(cls, value: object) -> Self | None:
        """Return settings as they are, or made of a table of their keys; None stays None."""
        return settings_of(cls, "alignment", value, "mode='effective', surge='measured'")

    def fit(
        self,
        runs: Mapping[str, xr.Dataset],
        states: Sequence[str],
        inputs: Sequence[str],
        window: int | None,
    ) -> FittedAlignment | None:
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
        FittedAlignment or None
            With celerity, depth, band and positions; None where an optional alignment cannot be
            made.

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
            missing = still.missing(runs, states, inputs)
            return None if missing else still.fit(runs, states, inputs, window)
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
        limit = None
        elevations = [channel for channel, yes in zip(inputs, carried, strict=True) if yes]
        if self.mode == "dispersion":
            depth = depth_of(first, first_name, depth)
            limit = float(
                np.median([_band(run, name, elevations) for name, run in windows.items()])
            )
        elif celerity is None:
            celerity = _celerity(runs, elevations, depth)
        return FittedAlignment(
            settings=self,
            inputs=tuple(inputs),
            carried=carried,
            positions=tuple(_position(first, channel) for channel in inputs),
            celerity=celerity,
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


@dataclass(frozen=True)
class FittedAlignment:
    """A fitted alignment.

    Parameters
    ----------
    settings : ProbeAlignment
        As it was asked for.
    inputs : tuple of str
        Channels of the model.
    carried : tuple of bool
        Which inputs are elevations.
    positions : tuple of float or None
        Position of each input's probe in training, m; None where the run did not state it.
    celerity : float or None
        The one given, or the mean of the training runs, m/s (mode "effective").
    water_depth : float or None
        m, of the training runs.
    highest_frequency : float or None
        Below which 99.9 % of the variance of the training input lies, Hz (mode "dispersion").
    """

    settings: ProbeAlignment
    inputs: tuple[str, ...]
    carried: tuple[bool, ...]
    positions: tuple[float | None, ...]
    celerity: float | None = None
    water_depth: float | None = None
    highest_frequency: float | None = None

    @property
    def placed(self) -> tuple[int, ...]:
        """Elevations at stated positions, by their places among the inputs."""
        every = enumerate(zip(self.carried, self.positions, strict=True))
        return tuple(column for column, (yes, at) in every if yes and at is not None)

    @property
    def reads_surge(self) -> bool:
        """Whether the measured surge is read after the start."""
        return self.settings.surge == "measured"

    def look_ahead(self, run: xr.Dataset) -> float:
        """Time that the slowest waves take over the constant distance they are carried upstream, s.

        A surge upstream reads nothing more: the record is continued by linear prediction there.
        """
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
        if settings.mode == "effective":
            out["alignment_celerity"] = self._speed(run)
        for key in ("probe_offset", "probe_offset_spread"):
            if key in run.attrs:
                out[key] = float(run.attrs[key])
        return out

    def describe(self) -> list[str]:
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
        positions = [_position(run, channel) for channel in self.inputs]
        pairs = zip(positions, self.positions, strict=True)
        return tuple(trained if here is None else here for here, trained in pairs)

    def carry(self, run: xr.Dataset, spans: Sequence[Span]) -> FloatArray:
        """Inputs of a run, elevations carried to the vessel where spans read them.

        What surrounds a span without a gap counts, up to the look-ahead of the last instant.

        Returns
        -------
        ndarray, shape (time, Q)
            Elevations are NaN where no span reads them.
        """
        name, settings = labelled.run_name(run, "the run"), self.settings
        dt = labelled.run_step(run, name)
        last = max(span.stop for span in spans) + math.ceil(self.look_ahead(run) / dt)
        values = labelled.channel_matrix(run, self.inputs, name)[:last]
        surge, reach = np.zeros(len(values)), (0.0, 0.0)
        if settings.surge != "none":
            time = np.asarray(run["time"].values, dtype=float)
            surge = labelled.channel_matrix(run, [settings.surge_channel], name)[:, 0]
            every = []
            for span in spans:  # read where it is allowed, and no further
                every.append(surge[span.first : span.stop])
                channel = [settings.surge_channel]
                labelled.check_finite(every[-1][:, None], channel, name, span.first, time)
            reach = float(np.min(np.concatenate(every))), float(np.max(np.concatenate(every)))
        elevations, offsets = np.flatnonzero(self.carried), self.offsets(run)
        gaps = np.flatnonzero(~np.all(np.isfinite(values), axis=1))
        by_pair: dict[tuple[int, int], list[CarriedElevation]] = {}
        out = values.copy()
        out[:, elevations] = np.nan
        for first, stop in _merged(spans):
            begin = int(max(gaps[gaps < first], default=-1)) + 1
            end = int(min(gaps[gaps >= stop], default=len(values)))
            if (begin, end) not in by_pair:
                by_pair[begin, end] = [
                    self._carrier(run, values[begin:end, column], dt, reach, offsets[column])
                    for column in elevations
                ]
            inside = slice(first - begin, stop - begin)
            for column, carrier in zip(elevations, by_pair[begin, end], strict=True):
                at = surge[first:stop] + offsets[column]
                out[first:stop, column] = carrier.at(at, inside)[:, 0]
        return out

    def _carrier(
        self,
        run: xr.Dataset,
        series: FloatArray,
        dt: float,
        reach: tuple[float, float],
        offset: float,
    ) -> CarriedElevation:
        """An elevation that can be read at surge + offset."""
        places = (reach[0] + offset, reach[1] + offset)
        if self.settings.mode == "effective":
            return carry_by_celerity(series, dt, places, self._speed(run))
        depth = depth_of(run, labelled.run_name(run, "the run"), self.water_depth)
        return carry_by_dispersion(series, dt, places, depth, self.highest_frequency)


def _merged(spans: Sequence[Span]) -> list[tuple[int, int]]:
    """Samples of spans as stretches that do not overlap."""
    out: list[tuple[int, int]] = []
    for first, _, stop in sorted(spans):
        if out and first <= out[-1][1]:
            out[-1] = (out[-1][0], max(out[-1][1], stop))
        else:
            out.append((first, stop))
    return out


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
) -> float:
    """Celerity from the mean slowness over the runs."""
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
            celerity = effective_celerity(
                values[:, 0], values[:, 1], labelled.run_step(run, name), apart, depth
            )
        except DataError as error:
            raise DataError(f"{name}, '{first}' and '{last}': {error}") from None
        slowness.append(celerity.lag / apart)
    return float(1.0 / np.mean(slowness))
