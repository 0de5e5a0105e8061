"""Findings as data; their sentences are rendered from them."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any

import xarray as xr

from seakeep.conventions import displayed
from seakeep.errors import warn


class Kind(Enum):
    """Base of the kinds of findings; a member holds its sentence and its remedy.

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
    details : mapping, optional
        What else the sentence says: numbers and words.
    """

    kind: Kind
    run: str
    channel: str
    value: float | None = None
    limit: float | None = None
    unit: str = ""
    place: float | None = None
    details: Mapping[str, Any] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The sentence: what, how much, and what was done about it."""
        return self.kind.sentence.format(
            value=_Quantity(self.value, self.unit),
            limit=_Quantity(self.limit, self.unit),
            place=self.place,
            channel=self.channel,
            run=self.run,
            **self.details,
        )

    @property
    def remedy(self) -> str:
        """What to do about it; empty where nothing is wrong with the campaign file."""
        return self.kind.remedy.format(run=self.run, channel=self.channel, **self.details)


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
            | {"kind": each.kind.name, "details": dict(each.details), "text": each.text}
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
        wanted = bool(each.kind.remedy) if channels is None else each.channel in channels
        if not wanted or (each.channel, each.kind.name) in reported:
            continue
        alike = [e for e in every if each.kind.together and e.kind is each.kind]
        reported |= {(other.channel, each.kind.name) for other in (each, *alike)}
        names = dict.fromkeys(name for e in alike for name in (e.run, e.channel))
        more = [name for name in names if name not in (each.run, each.channel)]
        others = f" ({', '.join(more)} likewise)" if more else ""
        remedy = f" {each.remedy}" if each.remedy else ""
        words = f"{each.run}: {each.channel} {each.text}{others}.{remedy}"
        warn(words)
