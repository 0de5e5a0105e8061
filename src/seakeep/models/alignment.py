"""Alignment of measured elevations to a moving vessel.

The elevation is carried by

    distance = surge + offset + (position of the probe in training − its position in the run) + the
    run's own ``attrs["probe_offset"]``,

positive downstream, so that one linear model holds wherever the vessel has drifted to.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np
import xarray as xr

from seakeep.arrays import (
    TINY,
    Datasets,
    FloatArray,
    check_choice,
    check_flag,
    names_of,
    number,
)
from seakeep.conventions import is_elevation
from seakeep.errors import DataError, RequestError
from seakeep.models import labelled
from seakeep.models.labelled import Span
from seakeep.signals.propagation import (
    band_limit,
    carry_by_celerity,
    carry_by_dispersion,
    effective_celerity,
)
from seakeep.signals.time_axis import stretches
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
        paper, or linear dispersion, frequency by frequency, which does not hold at forward speed.
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
        number(self.offset, "alignment: offset", "a number (m, positive downstream)")
        if self.celerity is not None:
            if self.celerity != "common":
                meant = "a positive number, 'common' or None (m/s)"
                number(self.celerity, "alignment: celerity", meant, TINY)
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

    def fit(
        self,
        runs: Datasets,
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
        windows = labelled.last_samples(runs, window)
        depth, dt = _common_depth(runs), labelled.run_step(first, first_name)
        celerity = None if self.celerity == "common" else self.celerity
        limit = None
        elevations = [channel for channel, yes in zip(inputs, carried, strict=True) if yes]
        if self.mode == "dispersion":
            if depth is None:
                raise RequestError(
                    f"alignment: mode = 'dispersion' needs the water depth and {first_name} has no "
                    "attribute 'water_depth'. State water_depth (m, inf for deep water) in [rig], "
                    "or set run.attrs['water_depth']."
                )
            limits = [
                band_limit(labelled.sound_matrix(run, elevations, name), dt)
                for name, run in windows.items()
            ]
            limit = float(np.median(limits))
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

    def missing(self, runs: Datasets, states: Sequence[str], inputs: Sequence[str]) -> str:
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


class Rig(NamedTuple):
    """Distances by which inputs are carried, positions of their probes, and depth, m.

    A position that is not stated is None, a depth NaN.
    """

    offsets: tuple[float, ...]
    positions: tuple[float | None, ...]
    depth: float


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

    def look_ahead(self, run: xr.Dataset) -> float:
        """Time that the slowest waves take over the constant distance they are carried upstream, s.

        A surge upstream reads nothing more: the record is continued by linear prediction there.
        """
        places = zip(self.rig(run).offsets, self.carried, strict=True)
        farthest = min(distance for distance, yes in places if yes)
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
        return float(group_speed(2 * np.pi * self.highest_frequency, self.rig(run).depth))

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

    def rig(self, run: xr.Dataset | None = None) -> Rig:
        """Offsets, positions and depth of a run; what it does not state is as in training."""
        attrs = {} if run is None else run.attrs
        stated = [None if run is None else _position(run, each) for each in self.inputs]
        places = tuple(
            trained if here is None else here
            for here, trained in zip(stated, self.positions, strict=True)
        )
        depth = attrs.get("water_depth", self.water_depth)
        offset = self.settings.offset + float(attrs.get("probe_offset", 0.0))
        offsets = [
            offset if trained is None or here is None else offset + (trained - here)
            for here, trained in zip(places, self.positions, strict=True)
        ]
        return Rig(tuple(offsets), places, math.nan if depth is None else float(depth))

    def carries_in(self, run: xr.Dataset) -> bool:
        """Whether waves are carried at all in a run."""
        return self.settings.carries or any(self.rig(run).offsets)

    def carry(self, run: xr.Dataset, spans: Sequence[Span]) -> FloatArray:
        """Inputs of a run, elevations carried to the vessel where spans read them.

        What surrounds a span without a gap counts, up to the look-ahead of the last instant.

        Returns
        -------
        ndarray, shape (time, Q)
            Elevations are NaN where no span reads them.
        """
        name, settings, rig = labelled.run_name(run, "the run"), self.settings, self.rig(run)
        dt = labelled.run_step(run, name)
        last = max(span.stop for span in spans) + math.ceil(self.look_ahead(run) / dt)
        values = labelled.channel_matrix(run, self.inputs, name)[:last]
        wanted = np.zeros(len(values), dtype=bool)
        for span in spans:
            wanted[span.first : span.stop] = True
        surge, reach = np.zeros(len(values)), (0.0, 0.0)
        if settings.surge != "none":  # read where it is allowed, and no further
            channel = [settings.surge_channel]
            surge = labelled.channel_matrix(run, channel, name)[:last, 0]
            for span in spans:
                known = surge[span.first : span.stop, None]
                labelled.check_finite(known, channel, run, name, span.first)
            reach = float(surge[wanted].min()), float(surge[wanted].max())
        out, elevations = values.copy(), np.flatnonzero(self.carried)
        out[:, elevations] = np.nan
        for begin, end in stretches(np.all(np.isfinite(values), axis=1)):
            read = begin + np.flatnonzero(wanted[begin:end])
            if not read.size:
                continue
            for column in elevations:
                series, offset = values[begin:end, column], rig.offsets[column]
                given = series, dt, (reach[0] + offset, reach[1] + offset)
                if settings.mode == "effective":
                    carrier = carry_by_celerity(*given, self._speed(run))
                else:
                    carrier = carry_by_dispersion(*given, rig.depth, self.highest_frequency)
                out[read, column] = carrier.at(surge[read] + offset, read - begin)[:, 0]
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


def _common_depth(runs: Datasets) -> float | None:
    stated = [run.attrs["water_depth"] for run in runs.values() if "water_depth" in run.attrs]
    return float(stated[0]) if stated else None


def _celerity(runs: Datasets, elevations: Sequence[str], depth: float | None) -> float:
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
        values = labelled.sound_matrix(run, [first, last], name)
        try:
            celerity = effective_celerity(
                values[:, 0], values[:, 1], labelled.run_step(run, name), apart, depth
            )
        except DataError as error:
            raise DataError(f"{name}, '{first}' and '{last}': {error}") from None
        slowness.append(celerity.lag / apart)
    return float(1.0 / np.mean(slowness))
