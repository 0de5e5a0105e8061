"""Quality checks of a run: samples flagged channel by channel, redundant sensors compared."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.campaign.settings import CampaignSettings, PreparationSettings
from seakeep.conventions import displayed
from seakeep.errors import SeakeepWarning
from seakeep.signals import Clock, bridge, misplaced_probes
from seakeep.signals.quality import (
    BRIDGED,
    FLAGS,
    MISSING,
    OUTLIER,
    REPLACED,
    SATURATED,
    STUCK,
    Agreement,
    compare_sensors,
    dominant_period,
    find_outliers,
    find_saturation,
    find_stuck,
    flag_attributes,
    level_drift,
    reading_step,
)
from seakeep.signals.synchronisation import ASSUMED
from seakeep.signals.time_axis import stretches
from seakeep.toml import number

__all__ = [
    "Finding",
    "as_attribute",
    "check_clocks",
    "check_levels",
    "check_pairs",
    "check_positions",
    "check_samples",
    "checked",
    "findings_of",
    "warn_of_positions",
]

FloatArray = npt.NDArray[np.float64]

RATE_TOLERANCE = 0.01
"""Part by which a stated rate may differ from the times: rates are written with two digits or more,
and quartzes keep theirs a thousand times better."""

NO_SLOW_MOTION = ("heave", "roll", "pitch")
"""Besides wave elevations, channels whose level has no reason to change within a run."""


@dataclass(frozen=True)
class Finding:
    """One thing that a check found.

    Parameters
    ----------
    channel : str
        Channel, or the logger for a clock.
    kind : str
        ``constant``, ``missing``, ``outliers``, ``saturated``, ``stuck``, ``drift``, ``lag``,
        ``resolution``, ``agreement``, ``scale``, ``position``, ``clock``, ``record``, ``period``,
        ``rate``, ``step``, ``impossible``, ``unit`` or ``left out``.
    text : str
        What, how much, and what was done about it.
    """

    channel: str
    kind: str
    text: str


def findings_of(run: xr.Dataset) -> list[Finding]:
    """Read what the checks found in a prepared run from its attributes."""
    return [Finding(**each) for each in json.loads(str(run.attrs.get("quality", "[]")))]


def as_attribute(findings: list[Finding]) -> str:
    """Findings as a text that an attribute can hold."""
    return json.dumps([asdict(each) for each in findings], ensure_ascii=False)


def check_samples(dataset: xr.Dataset, replace: bool) -> xr.Dataset:
    """Flag samples of a logger's channels; outliers are replaced only if that is asked for.

    Parameters
    ----------
    dataset : Dataset
        Channels at the logger's rate; samples that were missing are filled and flagged.
    replace : bool
        Whether outliers are replaced by what a monotone cubic puts there.

    Returns
    -------
    Dataset
        The same with ``NAME_flags`` where there is something to flag, and the attribute
        ``reading_step`` (in the channel's unit) where a sensor reads in steps.
    """
    time = dataset["time"].to_numpy()
    dt = float(time[1] - time[0])
    for name in list(dataset.data_vars):
        x = dataset[name].to_numpy()
        key = f"{name}_flags"
        flags = (
            dataset[key].to_numpy().copy()
            if key in dataset.coords
            else np.zeros(x.size, dtype=np.int16)
        )
        if x.size < 16 or not np.ptp(x):
            continue
        there = (flags & (MISSING | BRIDGED)) == 0
        if np.isfinite(step := reading_step(x)):
            dataset[name].attrs["reading_step"] = step
        outlier = find_outliers(x) & there
        stuck = find_stuck(x, dt, max(dominant_period(x, dt), 5 * dt)) & there
        flags[outlier] |= OUTLIER
        flags[find_saturation(x) & there & ~stuck] |= SATURATED
        flags[stuck] |= STUCK
        if replace and outlier.any():
            filled = bridge(np.where(outlier, np.nan, x), dt, np.inf).values
            dataset[name] = dataset[name].copy(data=filled)
            flags[outlier] |= REPLACED
            _repaired(dataset[name], f"{int(outlier.sum())} outliers replaced by monotone cubics")
        if flags.any():
            dataset.coords[key] = ("time", flags, flag_attributes(str(name)))
    return dataset


def _repaired(channel: xr.DataArray, words: str) -> None:
    before = channel.attrs.get("repaired")
    channel.attrs["repaired"] = f"{before}; {words}" if before else words


def checked(
    run: str,
    groups: Mapping[str, xr.Dataset],
    whole: xr.Dataset,
    clocks: Mapping[str, Clock],
    settings: CampaignSettings,
    left_out: Mapping[str, str],
) -> list[Finding]:
    """All findings of a run."""
    pairs, _ = check_pairs(whole, settings)
    every = told_samples(groups, settings.preparation) + check_levels(whole) + pairs
    every += check_positions(whole, settings.rig.water_depth, settings.runs[run].waves)
    others = [Finding("other runs", "left out", words) for words in left_out.values()]
    return every + check_clocks(clocks, groups, settings) + others


_KINDS = {MISSING: "missing", OUTLIER: "outliers", SATURATED: "saturated", STUCK: "stuck",
          BRIDGED: "missing"}  # fmt: skip


def told_samples(
    groups: Mapping[str, xr.Dataset], preparation: PreparationSettings | None = None
) -> list[Finding]:
    """Put flagged samples, and channels that are constant, into words."""
    out = []
    for group in groups.values():
        time = group["time"].to_numpy()
        dt = float(time[1] - time[0])
        for name in group.data_vars:
            if "derived_from" in group[name].attrs:
                continue
            if not np.ptp(group[name].to_numpy()):
                value = _in_words(group[name], float(group[name][0]), ".6g")
                out.append(Finding(str(name), "constant", f"constant at {value}"))
            if f"{name}_flags" not in group.coords:
                continue
            flags = group[f"{name}_flags"].to_numpy()
            for word, bit in FLAGS.items():
                hit = (flags & bit) > 0
                if not hit.any() or bit == REPLACED:
                    continue
                parts = stretches(hit)
                longest = max(end - begin for begin, end in parts) * dt
                text = (
                    f"{word}: {int(hit.sum())} samples in {len(parts)} place(s), "
                    f"{100 * hit.mean():.3g} % of the record, the longest {longest:.3g} s, the "
                    f"first at {time[parts[0][0]]:.4g} s"
                )
                if bit == OUTLIER and (flags & REPLACED).any():
                    text += "; replaced by interpolation"
                if bit == MISSING and preparation is not None and preparation.gaps == "bridge":
                    text += f"; not bridged: {_why_open(parts, hit.size, dt, preparation)}"
                out.append(Finding(str(name), _KINDS[bit], text))
    return out


def _in_words(channel: xr.DataArray, value: float, form: str) -> str:
    """Write a value of a channel with its unit, angles in degrees."""
    factor, unit = displayed(str(channel.attrs["units"]))
    return f"{factor * value:{form}}" + (f" {unit}" if unit not in ("1", "-") else "")


def _why_open(
    parts: Sequence[tuple[int, int]], size: int, dt: float, preparation: PreparationSettings
) -> str:
    inner = [(end - begin) * dt for begin, end in parts if begin > 0 and end < size]
    if not inner:
        return "it stands at an end of the record"
    limit = f"longest_gap = {float(preparation.longest_gap):g} s in [preparation]"
    return f"a gap of {max(inner):.3g} s is longer than {limit}"


def check_levels(run: xr.Dataset) -> list[Finding]:
    """Drift of the level of channels that have no slow motion of their own."""
    out = []
    dt = float(run["time"][1] - run["time"][0])
    for name in map(str, run.data_vars):
        if not (name.startswith("eta_") or name in NO_SLOW_MOTION):
            continue
        x = _filled(run[name])
        if x.size < 16 or not np.ptp(x):
            continue
        change, sure = level_drift(x, dt, dominant_period(x, dt))
        # A level that moves by half the waves' spread shifts means and standardisation visibly.
        if abs(change) > 0.5 * x.std() and sure > 5:
            text = f"level drifts by {_in_words(run[name], change, '+.3g')} over the record"
            out.append(Finding(name, "drift", text))
    return out


def _filled(channel: xr.DataArray) -> FloatArray:
    x = channel.to_numpy()
    there = np.isfinite(x)
    if there.all() or not there.any():
        return np.where(there, x, 0.0)
    at = np.arange(x.size)
    filled: FloatArray = np.interp(at, at[there], x[there])
    return filled


def check_pairs(
    run: xr.Dataset, settings: CampaignSettings
) -> tuple[list[Finding], dict[str, Agreement]]:
    """Compare the channels of ``[redundant]`` with the first of each, which is trusted.

    Parameters
    ----------
    run : Dataset
        All channels on one axis, the whole record.
    settings : CampaignSettings
        The campaign.

    Returns
    -------
    (list of Finding, dict of str to Agreement)
        What speaks against a channel, and the comparison by channel.
    """
    out, compared = [], {}
    dt = float(run["time"][1] - run["time"][0])
    for pair in settings.redundant.values() if run.sizes["time"] >= 16 else ():
        trusted = _filled(run[pair.channels[0]])
        window = None if pair.window is None else number(pair.window)
        for name in pair.channels[1:]:
            x = _filled(run[name])
            held = None
            if f"{name}_flags" in run.coords:
                held = (run[f"{name}_flags"].to_numpy() & STUCK) > 0
            step = float(run[name].attrs.get("reading_step", np.nan))
            agreement = compare_sensors(x, trusted, dt, window, held, step)
            compared[name] = agreement
            for fault in agreement.faults():
                text = f"against {pair.channels[0]}: {fault}"
                if (kind := _kind(fault)) == "resolution":
                    text += f" ({_in_words(run[name], step, '.2g')})"
                out.append(Finding(name, kind, text))
            if not np.isfinite(agreement.period):
                continue
            stuck = find_stuck(x, dt, agreement.period, trusted)
            if stuck.any() and np.ptp(x):
                text = (
                    f"holds still for {stuck.sum() * dt:.3g} s while {pair.channels[0]} moves, "
                    f"from {float(run['time'][int(np.argmax(stuck))]):.4g} s"
                )
                out.append(Finding(name, "stuck", text))
    return out, compared


def _kind(fault: str) -> str:
    """Kind of finding that a fault of :meth:`Agreement.faults` is."""
    starts = {
        "lag": "lag",
        "constant": "constant",
        "motion below": "resolution",
        "scale": "scale",
    }
    return next((kind for start, kind in starts.items() if fault.startswith(start)), "agreement")


def check_positions(run: xr.Dataset, depth: float | None, waves: str | None) -> list[Finding]:
    """Stated positions of wave probes against the phases of the waves that passed them.

    Parameters
    ----------
    run : Dataset
        All channels on one axis; elevations have the attribute ``x_position``.
    depth : float or None
        Water depth, m; without it nothing can be said.
    waves : str or None
        What the campaign says the waves are; regular ones say nothing of positions.

    Returns
    -------
    list of Finding
        See :func:`seakeep.signals.misplaced_probes`.
    """
    places = {
        str(name): float(run[name].attrs["x_position"])
        for name in run.data_vars
        if "x_position" in run[name].attrs
    }
    if depth is None or waves == "regular" or len(places) < 2:
        return []
    dt = float(run["time"][1] - run["time"][0])
    found = misplaced_probes({name: _filled(run[name]) for name in places}, places, dt, depth)
    return [Finding(each.probe, "position", each.describe()) for each in found]


def warn_of_positions(findings: list[Finding], run: str, told: set[str]) -> None:
    """Warn of probes that stand elsewhere than stated, of each only in the first run.

    Parameters
    ----------
    findings : list of Finding
        Of the run.
    run : str
        Its name.
    told : set of str
        Probes of which a warning was given; grows.

    Warns
    -----
    SeakeepWarning
        One for each probe that is not in `told`.
    """
    for each in findings:
        if each.kind == "position" and each.channel not in told:
            told.add(each.channel)
            warnings.warn(
                f"{run}: {each.channel} is {each.text}. Check [rig.positions] of the campaign, the "
                "water depth and the probes' clocks.",
                SeakeepWarning,
                stacklevel=3,
            )


def check_clocks(
    clocks: Mapping[str, Clock], groups: Mapping[str, xr.Dataset], settings: CampaignSettings
) -> list[Finding]:
    """Trouble of clocks: gaps, jitter, wrong rates, offsets that are not certain."""
    out = []
    for name, group in groups.items():
        label = name or "time"
        clock = clocks[name]
        step = float(group["time"][1] - group["time"][0])
        if (gaps := int(group.attrs.get("time_gaps", 0))) > 0:
            missing = int(group.attrs["time_missing"])
            out.append(Finding(label, "clock", f"{gaps} gap(s): {missing} samples are missing"))
        if (jitter := float(group.attrs.get("time_jitter_rms", 0.0))) > 0:
            text = f"jitter of {1e3 * jitter:.3g} ms RMS; interpolated onto a uniform step"
            out.append(Finding(label, "clock", text))
        out += [Finding(label, "clock", text) for text in _other_rate(name, group, settings)]
        if clock.method == ASSUMED:
            text = (
                f"{ASSUMED}: state trigger, shared, correlated or offset (0 where the two run on "
                f"one clock) in [instruments.{name}]"
            )
            out.append(Finding(label, "clock", text))
        if clock.offset_error > 0.25 * step or clock.residual > 0.5 * step:
            out.append(Finding(label, "clock", f"poorly known: {clock.describe()}"))
        if abs(clock.drift) > 2e-4:
            out.append(Finding(label, "clock", f"drifts by {1e6 * clock.drift:+.0f} ppm"))
    return out


def _other_rate(name: str, group: xr.Dataset, settings: CampaignSettings) -> list[str]:
    """Say that a rate is stated and the times tell another one."""
    step = float(group["time"][1] - group["time"][0])
    stated = settings.instruments[name].sampling_rate if name else settings.files.sampling_rate
    aside = group.attrs.get("time_column_step")
    if stated is None:
        return []
    if aside is not None and abs(aside * stated - 1) > RATE_TOLERANCE:
        return [
            f"counted at the {stated:g} Hz stated; the file's own times, which are left aside, "
            f"tell {1 / aside:.5g} Hz. Leave sampling_rate out, or correct it"
        ]
    if abs(step * stated - 1) > RATE_TOLERANCE:
        return [f"samples at {1 / step:.5g} Hz, as its times tell; {stated:g} Hz are stated"]
    return []
