"""Checks of one channel: flagged samples, constant values, levels, values that cannot be."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.conventions import is_elevation
from seakeep.quality.findings import Finding, Kind
from seakeep.quality.record import Record, channels_of, filled, step_of
from seakeep.signals.quality import (
    BRIDGED,
    MISSING,
    OUTLIER,
    REPLACED,
    SATURATED,
    STUCK,
    dominant_period,
    level_drift,
)
from seakeep.signals.time_axis import stretches

__all__ = ["SamplesKind", "constant", "flagged", "impossible", "levels", "units"]

NO_SLOW_MOTION = ("heave", "roll", "pitch")
"""Besides wave elevations, channels whose level has no reason to change within a run."""

_COUNTED = (
    ": {samples} samples in {places} place(s), {share:.3g} % of the record, the longest "
    "{longest:.3g} s, the first at {place:.4g} s{done}"
)
_UNIT = "Check unit and column in [channels.{channel}]."


class SamplesKind(Kind):
    """Findings about the samples of a channel."""

    MISSING = "missing" + _COUNTED
    BRIDGED = "bridged" + _COUNTED
    OUTLIERS = "outlier" + _COUNTED
    SATURATED = "saturated" + _COUNTED
    STUCK = "stuck" + _COUNTED
    CONSTANT = "constant at {value:.6g}"
    DRIFT = "level drifts by {value:+.3g} over the record"
    IMPOSSIBLE = "reaches {value:.3g}, more than {limit:.3g}", _UNIT
    OUT_OF_WATER = "leaves its mean by {value:.3g} in water of {limit:g}", _UNIT
    UNIT = (
        "is taken as {stated}, which is assumed: no file states its unit",
        "Correct the unit in [channels.{channel}], and remove unit_assumed there.",
        True,
    )


_FLAGS = {
    MISSING: SamplesKind.MISSING,
    BRIDGED: SamplesKind.BRIDGED,
    OUTLIER: SamplesKind.OUTLIERS,
    SATURATED: SamplesKind.SATURATED,
    STUCK: SamplesKind.STUCK,
}


def flagged(record: Record) -> Iterator[Finding]:
    """Samples that carry a flag."""
    for group in record.groups.values():
        time, dt = group["time"].to_numpy(), step_of(group)
        for name, channel in channels_of(group).items():
            if "derived_from" in channel.attrs or f"{name}_flags" not in group.coords:
                continue
            flags = group.variables[f"{name}_flags"].to_numpy()
            for bit, kind in _FLAGS.items():
                hit = (flags & bit) > 0
                if not hit.any():
                    continue
                parts = stretches(hit)
                done = ""
                if bit == OUTLIER and (flags & REPLACED).any():
                    done = "; replaced by interpolation"
                if bit == MISSING and record.bridged is not None:
                    done = f"; not bridged: {_why_open(parts, hit.size, dt, record.bridged)}"
                details = {
                    "samples": int(hit.sum()),
                    "places": len(parts),
                    "share": 100 * float(hit.mean()),
                    "longest": max(end - begin for begin, end in parts) * dt,
                    "done": done,
                }
                start = float(time[parts[0][0]])
                yield Finding(kind, record.run, name, place=start, details=details)


def _why_open(parts: Sequence[tuple[int, int]], size: int, dt: float, longest: float) -> str:
    inner = [(end - begin) * dt for begin, end in parts if begin > 0 and end < size]
    if not inner:
        return "it stands at an end of the record"
    limit = f"longest_gap = {longest:g} s in [preparation]"
    return f"a gap of {max(inner):.3g} s is longer than {limit}"


def constant(record: Record) -> Iterator[Finding]:
    """Channels that never change."""
    for group in record.groups.values():
        for name, channel in channels_of(group).items():
            if "derived_from" not in channel.attrs and not np.ptp(channel.to_numpy()):
                value, unit = float(channel[0]), str(channel.attrs["units"])
                yield Finding(SamplesKind.CONSTANT, record.run, name, value, unit=unit)


def levels(record: Record) -> Iterator[Finding]:
    """Levels that drift, of channels that have no slow motion of their own."""
    dt = step_of(record.whole)
    for name, channel in channels_of(record.whole).items():
        if not (is_elevation(name) or name in NO_SLOW_MOTION):
            continue
        x = filled(channel)
        if x.size < 16 or not np.ptp(x):
            continue
        change, sure = level_drift(x, dt, dominant_period(x, dt))
        # A level that moves by half the waves' spread shifts means and standardisation visibly.
        limit = 0.5 * float(x.std())
        if abs(change) > limit and sure > 5:
            unit = str(channel.attrs["units"])
            yield Finding(SamplesKind.DRIFT, record.run, name, change, limit, unit)


def impossible(record: Record) -> Iterator[Finding]:
    """Values that no floating vessel and no wave reach, and a wrong unit does.

    Roll or pitch beyond a right angle; waves or heave that leave their mean by more than the water
    is deep. One sample in a hundred may, as spikes do.
    """
    depth = record.water_depth
    for name, channel in channels_of(record.whole).items():
        x = channel.to_numpy()
        x = x[np.isfinite(x)]
        if not x.size:
            continue
        vertical = depth is not None and (name == "heave" or is_elevation(name))
        if name in ("roll", "pitch") and (far := _reached(x)) > np.pi / 2:
            yield Finding(SamplesKind.IMPOSSIBLE, record.run, name, far, np.pi / 2, "rad")
        elif vertical and depth is not None and (far := _reached(x - x.mean())) > depth:
            yield Finding(SamplesKind.OUT_OF_WATER, record.run, name, far, depth, "m")


def _reached(x: FloatArray) -> float:
    return float(np.percentile(np.abs(x), 99))


def units(record: Record) -> Iterator[Finding]:
    """Units that are guesses."""
    for name, unit in record.assumed_units.items():
        if name in record.whole:
            stated = "a number without a unit" if unit == "-" else unit
            yield Finding(SamplesKind.UNIT, record.run, name, details={"stated": stated})
