"""Input of the checks: the channels of a run, and what the campaign says about them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.quality.faults import OUTLIER, STUCK
from seakeep.signals import Clock
from seakeep.signals.time_axis import over_gaps


@dataclass(frozen=True)
class Redundant:
    """Channels that measure one quantity, the trusted one first, and the windows compared (s)."""

    channels: tuple[str, ...]
    window: float | None = None


@dataclass(frozen=True)
class Rate:
    """Stated rate of a logger (Hz): whether times are counted with it, whether it is a guess."""

    stated: float
    counted: bool = True
    assumed: bool = False


@dataclass(frozen=True, eq=False)
class Record:
    """A run before it is cut to its span.

    Parameters
    ----------
    run : str
        Its name.
    whole : Dataset
        All channels on one axis, in SI units, with ``NAME_flags``.
    groups : mapping of str to Dataset, optional
        Channels by logger, each at its own rate on the reference's time; "" where one file holds
        all.
    clocks : mapping of str to Clock, optional
        Clock of each logger.
    span : (float, float), optional
        The part that is used, s.
    waves : str, optional
        "regular", "irregular" or None.
    water_depth : float, optional
        m.
    wave_channel : str, optional
        Channel on which the encounter period is counted.
    period : (float, float), optional
        Counted period and energy period of the spectrum, s, where they disagree.
    redundant : tuple of Redundant, optional
        Sensors that are compared.
    rates : mapping of str to Rate, optional
        Stated rates by logger.
    assumed_units : mapping of str to str, optional
        Units that are guesses, by channel.
    wave_columns : mapping of str to str, optional
        Columns that are called as wave probes are, by the motion that is read from them.
    bridged : float, optional
        Longest gap that is bridged, s; None where gaps are masked.
    anti_alias : bool, optional
        Whether a filter damps what lies near the new Nyquist frequency.
    left_out : mapping of str to str, optional
        Runs left out of what is pooled, and why.
    """

    run: str
    whole: xr.Dataset
    groups: Mapping[str, xr.Dataset] = field(default_factory=dict)
    clocks: Mapping[str, Clock] = field(default_factory=dict)
    span: tuple[float, float] = (-np.inf, np.inf)
    waves: str | None = None
    water_depth: float | None = None
    wave_channel: str | None = None
    period: tuple[float, float] | None = None
    redundant: tuple[Redundant, ...] = ()
    rates: Mapping[str, Rate] = field(default_factory=dict)
    assumed_units: Mapping[str, str] = field(default_factory=dict)
    wave_columns: Mapping[str, str] = field(default_factory=dict)
    bridged: float | None = None
    anti_alias: bool = True
    left_out: Mapping[str, str] = field(default_factory=dict)

    def recorded(self) -> Iterator[tuple[str, xr.Dataset, str, xr.Variable]]:
        """Logger, its channels, and each of them by its name: those that were not derived."""
        for logger, group in self.groups.items():
            for name, channel in channels_of(group).items():
                if "derived_from" not in channel.attrs:
                    yield logger, group, name, channel


def step_of(data: xr.Dataset) -> float:
    """First time step of channels on one axis, s."""
    return float(data["time"][1] - data["time"][0])


def channels_of(data: xr.Dataset) -> dict[str, xr.Variable]:
    """Channels by name; ``data[name]`` would look at all others each time, for coordinates."""
    return {str(name): data.variables[name] for name in data.data_vars}


def filled(channel: xr.DataArray) -> FloatArray:
    """Values of a channel, straight lines across gaps."""
    return over_gaps(channel.to_numpy())


def sound(data: xr.Dataset, name: str) -> FloatArray:
    """Values of a channel from the first to the last that is neither missing, wrong nor stuck.

    Straight lines lead across what is missing, wrong or stuck between them.
    """
    x, flags = data.variables[name].to_numpy(), data.variables.get(f"{name}_flags")
    right = np.isfinite(x)
    if flags is not None:
        right &= (flags.to_numpy() & (OUTLIER | STUCK)) == 0
    at = np.flatnonzero(right)
    return over_gaps(x, right)[at[0] : at[-1] + 1] if at.size else x[:0]
