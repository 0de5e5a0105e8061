"""Alignment of the wave input to a vessel that moves: settings, fit, and application to runs.

Prepared runs keep the elevation where it was measured. A model with a :class:`ProbeAlignment`
carries it, in fit and forecast alike, by the distance

    surge + offset + (position of the probe in training − its position in the run) + the run's own
    ``attrs["probe_offset"]``,

positive downstream, so that one linear model holds wherever the vessel has drifted to.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Self

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.models import labelled
from seakeep.models.checks import check_choice
from seakeep.signals import effective_celerity
from seakeep.signals.propagation import (
    CarriedElevation,
    band_limit,
    carry_by_celerity,
    carry_by_dispersion,
)

__all__ = ["FittedAlignment", "ProbeAlignment", "fit_alignment"]

FloatArray = npt.NDArray[np.float64]
Mode = Literal["effective", "dispersion"]
Surge = Literal["measured", "predicted", "none"]

BEYOND = 0.5
"""A predicted surge is followed this part of the trained range beyond either end of it."""


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
        forecast, which is then conditional on it), the surge that the model itself predicts, or
        none, the place at rest.
    celerity : float, optional
        c of mode "effective", m/s; by default estimated at fit from the two probes among the
        inputs that stand farthest apart.
    offset : float, optional
        Constant distance, m, by which the elevation is carried in all runs, positive downstream;
        the paper's :math:`-x_0` where surge does not count from the place at rest.
    surge_channel : str, optional
        Name of the surge channel, m, positive downstream.
    channels : sequence of str, optional
        Inputs that are elevations; by default those with an ``attrs["x_position"]``, else those
        whose name begins with "eta".
    highest_frequency : float, optional
        Highest frequency of the waves in mode "dispersion", Hz; by default the one below which
        99.9 % of the variance of the training input lies.

    Raises
    ------
    RequestError
        If a setting is out of range or does not go with the mode.
    """

    mode: Mode = "effective"
    surge: Surge = "measured"
    celerity: float | None = None
    offset: float = 0.0
    surge_channel: str = "surge"
    channels: tuple[str, ...] | None = None
    highest_frequency: float | None = None

    def __post_init__(self) -> None:
        check_choice("alignment: mode", self.mode, ("effective", "dispersion"))
        check_choice("alignment: surge", self.surge, ("measured", "predicted", "none"))
        _check_number("celerity", self.celerity, "m/s", "a positive number or None")
        _check_number(
            "highest_frequency", self.highest_frequency, "Hz", "a positive number or None"
        )
        if not _is_number(self.offset):
            raise RequestError(
                f"alignment: offset must be a number (m, positive downstream); received "
                f"{self.offset!r}."
            )
        for key, mode in (("celerity", "effective"), ("highest_frequency", "dispersion")):
            if getattr(self, key) is not None and self.mode != mode:
                raise RequestError(
                    f"alignment: {key} = {getattr(self, key)!r} belongs to mode = '{mode}'; "
                    f"received mode = '{self.mode}'. Leave it out, or change the mode."
                )
        if isinstance(self.channels, str):
            raise RequestError(
                f"alignment: channels must be a list of names; received the string "
                f"'{self.channels}'. Write channels=['{self.channels}']."
            )
        if self.channels is not None:
            object.__setattr__(self, "channels", tuple(self.channels))

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
        if value is None or isinstance(value, cls):
            return value
        if not isinstance(value, Mapping):
            raise RequestError(
                f"alignment must be a seakeep.ProbeAlignment or None; received {value!r}. Write "
                "alignment=seakeep.ProbeAlignment(mode='effective', surge='measured')."
            )
        known = list(cls.__dataclass_fields__)
        for key in value:
            if key not in known:
                raise RequestError(
                    f"alignment: unknown key '{key}'.{did_you_mean(str(key), known)} Keys: "
                    f"{', '.join(known)}."
                )
        return cls(**value)


def _is_number(value: object) -> bool:
    real = isinstance(value, numbers.Real) and not isinstance(value, bool)
    return real and math.isfinite(value)  # type: ignore[arg-type]


def _check_number(name: str, value: object, unit: str, meant: str) -> None:
    if value is not None and not (_is_number(value) and value > 0):  # type: ignore[operator]
        raise RequestError(f"alignment: {name} must be {meant} ({unit}); received {value!r}.")


@dataclass(frozen=True)
class FittedAlignment:
    """What a model keeps of its alignment.

    Parameters
    ----------
    settings : ProbeAlignment
        As it was asked for.
    carried : tuple of bool
        Which inputs are elevations.
    positions : tuple of float or None
        Position of each input's probe in training, m; None where the run did not state it.
    celerity : float or None
        The one given, or the one estimated from the training windows, m/s (mode "effective").
    celerity_spread : float or None
        Standard deviation of its estimates over the training runs, m/s.
    water_depth : float or None
        m, of the training runs.
    highest_frequency : float or None
        Hz (mode "dispersion").
    surge_range : (float, float)
        Range within which a predicted surge is followed, m.
    """

    settings: ProbeAlignment
    carried: tuple[bool, ...]
    positions: tuple[float | None, ...]
    celerity: float | None = None
    celerity_spread: float | None = None
    water_depth: float | None = None
    highest_frequency: float | None = None
    surge_range: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def from_dict(cls, table: Mapping[str, Any]) -> Self:
        """Rebuild from what ``dataclasses.asdict`` made, as a file keeps it."""
        content: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in table.items()
        }
        content["settings"] = ProbeAlignment(**table["settings"])
        return cls(**content)

    def surge_of(self, run: xr.Dataset, name: str) -> FloatArray:
        """Measured surge of a run, m; zeros where it is not used."""
        if self.settings.surge == "none":
            return np.zeros(run.sizes["time"])
        return labelled.channel_matrix(run, [self.settings.surge_channel], name)[:, 0]

    def offsets(self, run: xr.Dataset, inputs: Sequence[str]) -> FloatArray:
        """Constant distance by which each input of a run is carried, m."""
        own = float(run.attrs.get("probe_offset", 0.0))
        out = np.full(len(inputs), self.settings.offset + own)
        for column, channel in enumerate(inputs):
            here, reference = run[channel].attrs.get("x_position"), self.positions[column]
            if here is not None and reference is not None:
                out[column] += reference - float(here)
        return out

    def carry(
        self,
        run: xr.Dataset,
        inputs: Sequence[str],
        name: str,
        values: FloatArray,
        surges: tuple[float, float],
    ) -> list[CarriedElevation | None]:
        """Prepare the elevations of a stretch of a run; None for inputs that are none.

        Parameters
        ----------
        run : Dataset
            The run.
        inputs : sequence of str
            Inputs of the model.
        name : str
            What messages call the run.
        values : ndarray, shape (time, Q)
            Inputs over a stretch without gaps.
        surges : (float, float)
            Range of surge that may be asked for, m.

        Returns
        -------
        list of CarriedElevation or None
            To be read at offset + surge.
        """
        dt = labelled.run_step(run, name)
        out: list[CarriedElevation | None] = []
        for column, offset in enumerate(self.offsets(run, inputs)):
            reach = (surges[0] + offset, surges[1] + offset)
            if not self.carried[column]:
                out.append(None)
            elif self.settings.mode == "effective":
                assert self.celerity is not None
                out.append(carry_by_celerity(values[:, column], dt, reach, self.celerity))
            else:
                depth = _depth(run, name, self.water_depth)
                limit = self.highest_frequency
                out.append(carry_by_dispersion(values[:, column], dt, reach, depth, limit))
        return out

    def aligned(
        self, run: xr.Dataset, inputs: Sequence[str], name: str, samples: slice
    ) -> FloatArray:
        """Inputs of a run carried to the measured position.

        Parameters
        ----------
        run : Dataset
            The run.
        inputs : sequence of str
            Inputs of the model.
        name : str
            What messages call the run.
        samples : slice
            Samples wanted; inputs and surge are without gaps there.

        Returns
        -------
        ndarray, shape (samples, Q)
            Aligned inputs. Elevation from before and after the samples is used where there is
            some without a gap, since a wave that is carried takes its time.
        """
        surge = self.surge_of(run, name)[samples]
        stretch = self.stretch(run, inputs, name, samples)
        values = labelled.channel_matrix(run, inputs, name, stretch)
        carriers = self.carry(run, inputs, name, values, (surge.min(), surge.max()))
        out = labelled.channel_matrix(run, inputs, name, samples)
        begin = samples.start - stretch.start
        offsets = self.offsets(run, inputs)
        for column, carrier in enumerate(carriers):
            if carrier is not None:
                inside = slice(begin, begin + surge.size)
                out[:, column] = carrier.at(surge + offsets[column], inside)[:, 0]
        return out

    def stretch(self, run: xr.Dataset, inputs: Sequence[str], name: str, samples: slice) -> slice:
        """Longest stretch without gaps in the inputs around samples that have none."""
        sound = np.all(np.isfinite(labelled.channel_matrix(run, inputs, name)), axis=1)
        gaps = np.flatnonzero(~sound)
        before, after = gaps[gaps < samples.start], gaps[gaps >= samples.stop]
        return slice(
            int(before[-1]) + 1 if before.size else 0, int(after[0]) if after.size else sound.size
        )


def fit_alignment(
    settings: ProbeAlignment,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    window: int | None,
) -> FittedAlignment:
    """Complete settings from training runs that end where training ends.

    Parameters
    ----------
    settings : ProbeAlignment
        What was asked for.
    runs : mapping of str to Dataset
        Training runs, cut at the end of their training windows.
    states, inputs : sequence of str
        Channels of the model.
    window : int or None
        Samples of the training windows; None for all of the runs.

    Returns
    -------
    FittedAlignment
        With celerity, depth, band and positions.

    Raises
    ------
    RequestError
        If the runs do not carry what the settings need.
    DataError
        If a record has gaps in the window, is constant, or the probes' records do not correlate.
    """
    first_name, first = next(iter(runs.items()))
    labelled.channel_matrix(first, inputs, first_name, slice(0, 0))  # refuses unknown names
    carried = _elevations(settings, first, inputs)
    if settings.surge == "predicted" and settings.surge_channel not in states:
        raise RequestError(
            f"alignment: surge = 'predicted' needs '{settings.surge_channel}' among the states; "
            f"received {', '.join(states)}. Add it, or choose surge = 'measured' or 'none'."
        )
    last = slice(None if window is None else -window, None)
    windows = {name: run.isel(time=last) for name, run in runs.items()}
    positions = tuple(_position(first, channel) for channel in inputs)
    depth = _common_depth(runs)
    celerity, spread, limit = settings.celerity, None, settings.highest_frequency
    elevations = [channel for channel, yes in zip(inputs, carried, strict=True) if yes]
    if settings.mode == "dispersion":
        depth = _depth(first, first_name, depth)
        if limit is None:
            limit = float(
                np.median([_band(run, name, elevations) for name, run in windows.items()])
            )
    elif celerity is None:
        celerity, spread = _celerity(windows, elevations, depth)
    reach = (0.0, 0.0)
    if settings.surge != "none":
        reach = _surge_range(windows, settings.surge_channel)
    return FittedAlignment(settings, carried, positions, celerity, spread, depth, limit, reach)


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
            chosen = tuple(channel.startswith("eta") for channel in inputs)
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


def _depth(run: xr.Dataset, name: str, otherwise: float | None) -> float:
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


def _surge_range(windows: Mapping[str, xr.Dataset], channel: str) -> tuple[float, float]:
    surges = np.concatenate([_sound(run, name, [channel])[:, 0] for name, run in windows.items()])
    low, high = float(surges.min()), float(surges.max())
    return low - BEYOND * (high - low), high + BEYOND * (high - low)


def _celerity(
    windows: Mapping[str, xr.Dataset], elevations: Sequence[str], depth: float | None
) -> tuple[float, float | None]:
    """Celerity from the mean lag over the runs, and its standard deviation over them."""
    lags, apart = [], 0.0
    for name, run in windows.items():
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
        lags.append(found.lag / apart)
    speeds = 1.0 / np.array(lags)
    spread = float(speeds.std(ddof=1)) if len(lags) > 1 else None
    return float(1.0 / np.mean(lags)), spread
