"""Checks of one channel: flagged samples, constant values, levels, values that cannot be."""

import numpy as np
import scipy

from seakeep.arrays import FloatArray
from seakeep.conventions import is_elevation
from seakeep.quality.faults import (
    BRIDGED,
    MISSING,
    OUTLIER,
    REPLACED,
    SATURATED,
    STUCK,
    noise_share,
)
from seakeep.quality.findings import Findings, Kind, Record, channels_of, sound, step_of
from seakeep.signals.time_axis import stretches
from seakeep.signals.waves import dominant_period
from seakeep.waves import GRAVITY

FLATTEST, STEEPEST = 5e-5, 1 / 7
"""Heights of waves over their lengths in deep water, between which all that is measured lies."""
FEWEST = 5
"""Waves in a record whose period its spectrum shows."""
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
    JUMPS = "jumps by a whole turn {count} times: taken without, within half a turn of zero"
    CONSTANT = "constant at {value:.6g}"
    NOISE = "is noise: {share:.0f} % of its variance has no memory from one sample to the next"
    DRIFT = "level drifts by {value:+.3g} over the record"
    IMPOSSIBLE = "reaches {value:.3g}, more than {limit:.3g}", _UNIT
    OUT_OF_WATER = "leaves its mean by {value:.3g} in water of {limit:g}", _UNIT
    STILL_WATER = (
        "has its mean {value:+.3g} from zero, farther than its waves are high ({limit:.3g})",
        "Elevations count upwards from still water: state sign = -1 in [channels.{channel}] if the "
        "gauge measures the distance down to the water, and its offset.",
        True,
    )
    WAVES = (
        "shows waves of {value:.3g} and {period:.3g} s: no sea and no basin has them (heights are "
        "1/20 000 to 1/7 of the length in deep water)",
        "Check unit in [channels.{channel}], and the unit of the times (time_unit in [files]). A "
        "ship at speed in head waves meets them so fast that they may be right.",
        True,
    )
    STATED_PERIOD = (
        "shows waves of {value:.3g}, and encounter_period is stated as {limit:.3g}",
        "Correct encounter_period (s) in [campaign], at the scale of the files, or leave it out: "
        "it is measured then.",
        True,
    )
    WAVE_COLUMN = (
        "is read from the column '{column}', which is called as wave probes are",
        "Correct column in [channels.{channel}], or rename it in the files.",
    )
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


def flagged(record: Record) -> Findings:
    """Samples that carry a flag."""
    for _, group, name, _ in record.recorded():
        if f"{name}_flags" not in group.coords:
            continue
        flags, dt = group.variables[f"{name}_flags"].values, step_of(group)
        for bit, kind in _FLAGS.items():
            hit = (flags & bit) > 0
            if not (parts := stretches(hit)):
                continue
            inner = [(end - begin) * dt for begin, end in parts if begin > 0 and end < hit.size]
            done = ""
            if bit == OUTLIER and (flags & REPLACED).any():
                done = "; replaced by interpolation"
            elif bit == MISSING and record.bridged:
                limit = f"longest_gap = {record.bridged:g} s in [preparation]"
                longer = f"a gap of {max(inner, default=0):.3g} s is longer than {limit}"
                why = longer if inner else "it stands at an end of the record"
                done = f"; not bridged: {why}"
            yield record.finding(
                kind,
                name,
                place=float(group["time"][parts[0][0]]),
                samples=int(hit.sum()),
                places=len(parts),
                share=100 * float(hit.mean()),
                longest=max(end - begin for begin, end in parts) * dt,
                done=done,
            )


def jumps(record: Record) -> Findings:
    """Angles that were read with jumps of a whole turn."""
    for _, _, name, channel in record.recorded():
        if "jumps" in channel.attrs:
            yield record.finding(SamplesKind.JUMPS, name, count=channel.attrs["jumps"])


def constant(record: Record) -> Findings:
    """Channels that never change."""
    for _, _, name, channel in record.recorded():
        if not np.ptp(channel.values):
            unit = channel.attrs["units"]
            yield record.finding(SamplesKind.CONSTANT, name, float(channel[0]), unit=unit)


def noise(record: Record) -> Findings:
    """Channels most of whose variance has no memory, such as a record of random readings."""
    for _, group, name, _ in record.recorded():
        if (share := noise_share(sound(group, name))) > 0.5:
            yield record.finding(SamplesKind.NOISE, name, share=100 * share)


def levels(record: Record) -> Findings:
    """Levels that drift, of channels that have no slow motion of their own."""
    dt = step_of(record.whole)
    for name, channel in channels_of(record.whole).items():
        if not (is_elevation(name) or name in NO_SLOW_MOTION):
            continue
        x = sound(record.whole, name)  # a sensor that dies has no drift besides
        if x.size < 16 or not np.ptp(x):
            continue
        change, ratio = level_drift(x, dt, dominant_period(x, dt))
        # A level that moves by half the waves' spread shifts means and standardisation visibly.
        limit = 0.5 * x.std()
        if abs(change) > limit and ratio > 5:
            yield record.finding(SamplesKind.DRIFT, name, change, limit, channel.attrs["units"])


def impossible(record: Record) -> Findings:
    """Values that no floating vessel and no wave reach, and a wrong unit does.

    Roll or pitch beyond a right angle; waves or heave that leave their mean by more than the water
    is deep. One sample in a hundred may, as spikes do.
    """
    depth = record.water_depth
    for name, channel in channels_of(record.whole).items():
        x, turns = channel.values, name in ("roll", "pitch")
        x, limit = x[np.isfinite(x)], np.pi / 2 if turns else depth
        if x.size and limit and (turns or name == "heave" or is_elevation(name)):
            reached = float(np.percentile(np.abs(x if turns else x - x.mean()), 99))
            kind = SamplesKind.IMPOSSIBLE if turns else SamplesKind.OUT_OF_WATER
            if reached > limit:
                yield record.finding(kind, name, reached, limit, "rad" if turns else "m")


def waves(record: Record) -> Findings:
    """Waves that none of their period is, as times and heights in wrong units are; a wrong period.

    Waves break at a seventh of their length. An encounter period may differ from that of the
    highest waves, but not by a factor of three.
    """
    dt = step_of(record.whole)
    for name, channel in channels_of(record.whole).items():
        if not is_elevation(name) or channel.attrs["units"] != "m" or record.waves == "still":
            continue
        x = sound(record.whole, name)
        period = dominant_period(x, dt) if x.size > 1 else np.nan
        if not FEWEST * period <= x.size * dt or noise_share(x) > 0.5:
            continue
        height, length = 4 * float(x.std()), GRAVITY * period**2 / (2 * np.pi)
        if record.water_depth and height > record.water_depth:  # which `impossible` reports
            continue
        if abs(mean := float(x.mean())) > height:
            yield record.finding(SamplesKind.STILL_WATER, name, mean, height, "m")
        if not FLATTEST < height / length < STEEPEST:
            yield record.finding(SamplesKind.WAVES, name, height, unit="m", period=period)
        elif record.stated_period and not 1 / 3 < record.stated_period / period < 3:
            yield record.finding(SamplesKind.STATED_PERIOD, name, period, record.stated_period, "s")


def units(record: Record) -> Findings:
    """Units that are guesses, and motions that are read from columns of waves."""
    for name, column in record.wave_columns.items():
        yield record.finding(SamplesKind.WAVE_COLUMN, name, column=column)
    for name, unit in record.assumed_units.items():
        if name in record.whole:
            stated = "a number without a unit" if unit == "-" else unit
            yield record.finding(SamplesKind.UNIT, name, stated=stated)


def level_drift(x: FloatArray, dt: float, period: float) -> tuple[float, float]:
    """Change of a sensor's level over a record, and how sure it is.

    Parameters
    ----------
    x : ndarray, shape (time,)
        Uniformly sampled, without gaps, of a quantity that has no slow motion of its own.
    dt : float
        Time step, s.
    period : float
        Period of the waves, s.

    Returns
    -------
    (float, float)
        End minus start of the straight line through the means of windows of four periods, and
        that change in standard errors of the line.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 200, 0.1)
    >>> change, sure = level_drift(np.sin(4 * t) + 0.005 * t, 0.1, 1.57)
    >>> round(change, 1), bool(sure > 10)
    (1.0, True)
    """
    length = max(2, round(4 * period / dt))
    windows = x.size // length
    if windows < 4:
        return 0.0, 0.0
    means = x[: windows * length].reshape(windows, length).mean(axis=1)
    line = scipy.stats.linregress(np.arange(windows), means)
    ratio = abs(line.slope) / line.stderr if line.stderr > 0 else 0.0
    return float(line.slope * x.size / length), float(ratio)
