"""Findings as data; their sentences are rendered from them.

Input of the checks: the channels of a run, and what the campaign says about them.
"""

import json
import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, FloatArray
from seakeep.conventions import displayed
from seakeep.errors import warn
from seakeep.quality.faults import OUTLIER, STUCK
from seakeep.signals import Clock
from seakeep.signals.time_axis import over_gaps


class Kind(Enum):
    """Base of the kinds of findings; a member holds its sentence and its remedy.

    Names of members are unique over all kinds, since prepared runs store findings by them.

    A sentence is a format string over the fields of :class:`Finding` and its details; `value` and
    `limit` come with their unit, angles in degrees. Kinds with a remedy are those that make a run
    another one than the campaign says: `prepare` warns of them, of those that come `together` in
    one warning for all channels.
    """

    def __init__(self, sentence: str, remedy: str = "", together: bool = False) -> None:
        self.sentence, self.remedy, self.together = sentence, remedy, together

    @property
    def word(self) -> str:
        """Name of the kind as tables show it."""
        return self.name.lower().replace("_", " ")


class _Foreign(Kind):
    OTHER = "{words}"


@dataclass(frozen=True)
class Finding:
    """One thing that a check found.

    Parameters
    ----------
    kind : Kind
        Member of a kind's Enum.
    run : str
        Name of the run.
    channel : str
        Channel; or the logger, "time" where the run has only one.
    value, limit : float, optional
        What was found, and the limit that it exceeds, in SI units.
    unit : str, optional
        Unit of both.
    place : float, optional
        Instant at which it starts, s; None where it concerns the whole record.
    details : dict, optional
        What else the sentence says: numbers and words.
    """

    kind: Kind
    run: str
    channel: str
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    place: float | None = None
    details: dict[str, Any] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The sentence: what, how much, and what was done about it."""
        both = {key: _Quantity(getattr(self, key), self.unit) for key in ("value", "limit")}
        return self.kind.sentence.format(**vars(self) | both | self.details)

    @property
    def remedy(self) -> str:
        """What to do about it; empty where nothing is wrong with the campaign file."""
        return self.kind.remedy.format(**vars(self) | self.details)


class _Quantity:
    """A number that is formatted with its unit, angles in degrees."""

    def __init__(self, value: float | None, unit: str) -> None:
        factor, shown = displayed(unit)
        self.value = math.nan if value is None else factor * value
        self.unit = "" if shown in ("1", "-") else shown

    def __format__(self, form: str) -> str:
        return f"{self.value:{form}} {self.unit}".rstrip()


def as_json(findings: Iterable[Finding]) -> str:
    """Findings as a text that an attribute of a prepared run can hold."""
    return json.dumps(
        [
            vars(each)
            | {"kind": each.kind.name, "text": each.text}
            | {key: _finite(getattr(each, key)) for key in ("value", "limit", "place")}
            for each in findings
        ],
        ensure_ascii=False,
    )


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None


def findings_of(run: xr.Dataset) -> list[Finding]:
    """Findings of a prepared run, from its attribute ``quality``."""
    known = {kind.name: kind for kinds in Kind.__subclasses__() for kind in kinds}
    out = []
    for each in json.loads(str(run.attrs.get("quality", "[]"))):
        text = each.pop("text")
        if (name := each["kind"]) not in known:  # of a check that is not loaded
            each |= {"kind": _Foreign.OTHER, "details": {"words": text}}
        else:
            each["kind"] = known[name]
        out.append(Finding(**each))
    return out


def warn_of(
    findings: Iterable[Finding],
    reported: set[tuple[str, str]],
    channels: Collection[str] | None = None,
) -> None:
    """Warn of findings, of each channel and kind once.

    Parameters
    ----------
    findings : iterable of Finding
        What was found. Without `channels`, only kinds with a remedy are warned of.
    reported : set of (str, str)
        Channels and kinds that were warned of already; grows.
    channels : collection of str, optional
        Channels of which every finding is warned of, such as those of a model.

    Warns
    -----
    SeakeepWarning
        One per channel and kind.
    """
    every = list(findings)
    for each in every:
        wanted = each.kind.remedy if channels is None else each.channel in channels
        if not wanted or (each.channel, each.kind.name) in reported:
            continue
        alike = [e for e in every if each.kind.together and e.kind is each.kind]
        reported |= {(other.channel, each.kind.name) for other in (each, *alike)}
        names = dict.fromkeys(name for e in alike for name in (e.run, e.channel))
        more = [name for name in names if name not in (each.run, each.channel)]
        others = f" ({', '.join(more)} likewise)" if more else ""
        warn(f"{each.run}: {each.channel} {each.text}{others}. {each.remedy}".rstrip())


Findings = Iterator[Finding]
"""What a check yields."""
Redundant = Mapping[tuple[str, ...], float | None]
"""Channels that measure one quantity, the trusted one first: the windows compared, s."""


@dataclass(frozen=True)
class Rate:
    """Stated rate of a logger (Hz), and whether it is a guess with which times are counted."""

    stated: float
    assumed: bool = False


@dataclass(frozen=True, eq=False)
class Record:
    """A run, cut to its span.

    Parameters
    ----------
    run : str
        Its name.
    whole : Dataset
        All channels on one axis, in SI units, with ``NAME_flags``.
    groups : mapping of str to Dataset, optional
        Channels by logger, each at its own rate on the reference's time; "" where one file holds
        all. :meth:`recorded` yields their channels: nothing without groups.
    clocks : mapping of str to Clock, optional
        Clocks of loggers of `groups`; the others run on the reference's.
    span : (float, float), optional
        The part that is used, s.
    waves : str, optional
        "regular", "irregular" or None.
    water_depth : float, optional
        m.
    stated_period : float, optional
        Encounter period that the campaign states, s.
    redundant : mapping of tuple of str to float, optional
        Sensors that are compared, the trusted one first, and the windows (s).
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
    groups: Datasets = field(default_factory=dict)
    clocks: Mapping[str, Clock] = field(default_factory=dict)
    span: tuple[float, float] = (-np.inf, np.inf)
    waves: str | None = None
    water_depth: float | None = None
    stated_period: float | None = None
    redundant: Redundant = field(default_factory=dict)
    rates: Mapping[str, Rate] = field(default_factory=dict)
    assumed_units: Mapping[str, str] = field(default_factory=dict)
    wave_columns: Mapping[str, str] = field(default_factory=dict)
    bridged: float | None = None
    anti_alias: bool = True
    left_out: Mapping[str, str] = field(default_factory=dict)

    def finding(
        self,
        kind: Kind,
        channel: str,
        value: float | None = None,
        limit: float | None = None,
        unit: str = "",
        place: float | None = None,
        **details: Any,
    ) -> Finding:
        """Return a :class:`Finding` about this run."""
        return Finding(kind, self.run, channel, value, limit, unit, place, details)

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
    return over_gaps(channel.values)


def sound(data: xr.Dataset, name: str) -> FloatArray:
    """Values of a channel from the first to the last that is neither missing, wrong nor stuck.

    Straight lines lead across what is missing, wrong or stuck between them.
    """
    x, flags = data.variables[name].values, data.variables.get(f"{name}_flags")
    right = np.isfinite(x)
    if flags is not None:
        right &= (flags.values & (OUTLIER | STUCK)) == 0
    at = np.flatnonzero(right)
    return over_gaps(x, right)[at[0] : at[-1] + 1] if at.size else x[:0]
