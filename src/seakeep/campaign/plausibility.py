"""Whether a run can be what it claims: whole records, and values that a vessel can reach."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from statistics import median_high, median_low

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.campaign.checks import Finding
from seakeep.campaign.guesses import MOTIONS
from seakeep.campaign.instruments import channels_of
from seakeep.campaign.settings import CampaignSettings, PreparationSettings, RunSettings
from seakeep.campaign.survey import used_span
from seakeep.errors import SeakeepWarning
from seakeep.signals.filters import PASSBAND
from seakeep.signals.quality import energy_above

__all__ = [
    "WARNED",
    "check_rates",
    "check_records",
    "check_step",
    "check_values",
    "implausible",
    "warn_of",
]

LOST = 0.05
"""Part of a run's used span that a logger may miss: they are started and stopped by hand, seconds
apart, and runs last minutes."""

LOST_ENERGY = 0.05
"""Part of the waves' energy that a step may cost: 2.5 % of their standard deviation, more than a
calibrated probe leaves open (1 to 2 %)."""

FINER = 2.0
"""Times finer than the fastest logger that a step may be: one of 32 to a period is so where the
loggers take 16, the fewest that show a wave's shape."""


def check_records(groups: Mapping[str, xr.Dataset], settings: RunSettings) -> list[Finding]:
    """Loggers that begin well after the others of their run, or end well before them.

    The others are judged by their median, so that one that was left running speaks against none.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Channels by logger, on the reference's time.
    settings : RunSettings
        The run; what lies outside its span does no harm.

    Returns
    -------
    list of Finding
        Of kind ``record``, one a logger and end: the run is cut to what all recorded.
    """
    if len(groups) < 2:
        return []
    spans = {n: (float(g["time"][0]), float(g["time"][-1])) for n, g in groups.items()}
    used = used_span(settings)
    first = max(median_low(begin for begin, _ in spans.values()), used[0])
    last = min(median_high(end for _, end in spans.values()), used[1])
    limit = LOST * (last - first)
    out = []
    for name, (begin, end) in spans.items():
        if begin - first > limit:
            text = f"begins at {begin:.4g} s, the other loggers at {first:.4g} s"
            out.append(Finding(name, "record", f"{text}: the run is cut to what all recorded"))
        if last - end > limit:
            text = f"ends at {end:.4g} s, the other loggers at {last:.4g} s"
            out.append(Finding(name, "record", f"{text}: the run is cut to what all recorded"))
    return out


def check_values(run: xr.Dataset, depth: float | None) -> list[Finding]:
    """Values that no floating vessel and no wave reach, and a wrong unit does.

    Parameters
    ----------
    run : Dataset
        All channels on one axis, in SI units.
    depth : float or None
        Water depth, m.

    Returns
    -------
    list of Finding
        Of kind ``impossible``: roll or pitch beyond a right angle; waves or heave that leave
        their mean by more than the water is deep. One sample in a hundred may, as spikes do.
    """
    out = []
    for name in map(str, run.data_vars):
        x = run[name].to_numpy()
        x = x[np.isfinite(x)]
        if not x.size:
            continue
        if name in ("roll", "pitch") and (far := _reached(x)) > np.pi / 2:
            text = f"reaches {far:.3g} rad, more than a right angle"
        elif (
            depth is not None
            and (name == "heave" or name.startswith("eta_"))
            and (far := _reached(x - x.mean())) > depth
        ):
            text = f"leaves its mean by {far:.3g} m in water of {depth:g} m"
        else:
            continue
        out.append(Finding(name, "impossible", text))
    return out


def check_step(
    groups: Mapping[str, xr.Dataset], dt: float, preparation: PreparationSettings
) -> list[Finding]:
    """Steps that are too coarse for the waves, or finer than any logger's.

    Parameters
    ----------
    groups : mapping of str to Dataset
        Channels by logger, each at its own rate.
    dt : float
        The common step, s.
    preparation : PreparationSettings
        How it is reached.

    Returns
    -------
    list of Finding
        Of kind ``step``: of the run's time, and of each wave elevation and motion.
    """
    out = []
    steps = {name: float(g["time"][1] - g["time"][0]) for name, g in groups.items()}
    if round(min(steps.values()) / dt, 3) > FINER:
        text = (
            f"put on {1 / dt:.4g} Hz, and no logger records more than "
            f"{1 / min(steps.values()):.4g} Hz: nothing is gained, and models take longer"
        )
        out.append(Finding("time", "step", text))
    # A filter halves amplitudes in the middle between its pass band and the Nyquist frequency.
    edge = (0.5 * (PASSBAND + 1.0) if preparation.anti_alias else 1.0) * 0.5 / dt
    fate = "is damped or lost" if preparation.anti_alias else "is folded into slower waves"
    for logger, group in groups.items():
        for name in map(str, group.data_vars):
            wanted = name.startswith("eta_") or name in MOTIONS
            if not wanted or "derived_from" in group[name].attrs or steps[logger] >= dt:
                continue
            x = group[name].to_numpy()
            share, period = energy_above(x, steps[logger], edge)
            if share > LOST_ENERGY and not is_noise(x):
                text = (
                    f"{100 * share:.2g} % of the energy of its waves (peak at {period:.3g} s) lies "
                    f"above {edge:.3g} Hz and {fate} at {1 / dt:.4g} Hz; take a finer step"
                )
                out.append(Finding(name, "step", text))
    return out


def _in(unit: str | None) -> str:
    return "without a unit" if unit == "-" else f"in {unit}"


def check_rates(groups: Mapping[str, xr.Dataset], settings: CampaignSettings) -> list[Finding]:
    """Loggers whose rate is a guess, of kind ``rate``; the reference of one file is "time"."""
    out = []
    for name in groups:
        own = settings.instruments[name] if name else settings.files
        counted = own.sampling_rate is not None and own.time is None
        if counted and own.sampling_rate_assumed:
            text = f"at {own.sampling_rate:g} Hz, which is assumed: no file tells its rate"
            out.append(Finding(name or "time", "rate", text))
    return out


def _reached(x: npt.NDArray[np.float64]) -> float:
    return float(np.percentile(np.abs(x), 99))


def implausible(
    name: str,
    groups: Mapping[str, xr.Dataset],
    whole: xr.Dataset,
    settings: CampaignSettings,
    doubts: Mapping[str, str],
) -> list[Finding]:
    """All that makes it doubtful whether a run is what it claims.

    Parameters
    ----------
    name : str
        Name of the run.
    groups : mapping of str to Dataset
        Channels by logger.
    whole : Dataset
        All channels on one axis.
    settings : CampaignSettings
        The campaign.
    doubts : mapping of str to str
        By run, what speaks against its period.

    Returns
    -------
    list of Finding
        Records, values, assumed units and rates, the step, and the period.
    """
    run = settings.runs[name]
    found = check_records(groups, run) + check_values(whole, settings.rig.water_depth)
    found += [
        Finding(channel, "unit", f"{_in(each.unit)}, which is assumed: no file states its unit")
        for channel, each in channels_of(settings, run).items()
        if each.unit_assumed and channel in whole
    ]
    found += check_rates(groups, settings)
    step = float(whole["time"][1] - whole["time"][0])
    found += check_step(groups, step, settings.preparation)
    if name in doubts and settings.wave_channel is not None:
        found.append(Finding(settings.wave_channel, "period", doubts[name]))
    return found


_UNIT = "Check unit and column in [channels.{channel}]."
_MENDS = {
    "record": "Check whether its file is whole; if it is, state span = [begin, end] in [runs.{run}]"
    " to say which part is meant.",
    "scale": _UNIT,
    "impossible": _UNIT,
}
"""What to do about each kind of finding of which a warning is given."""
WARNED = frozenset({"unit", "rate", "position", "period", "left out", *_MENDS})
"""Kinds of findings that warnings tell while a campaign is prepared."""


def warn_of(findings: Iterable[Finding], run: str, told: set[tuple[str, str]]) -> None:
    """Warn of findings that make a run another one than the campaign says.

    Parameters
    ----------
    findings : iterable of Finding
        Of the run.
    run : str
        Its name.
    told : set of (str, str)
        Channels and kinds of which a warning was given; grows. Records are told for each run.

    Warns
    -----
    SeakeepWarning
        One a channel and kind; one for all units that are assumed.
    """
    every = list(findings)
    assumed = [each.channel for each in every if each.kind == "unit"]
    if assumed and (assumed[0], "unit") not in told:
        told.update((channel, "unit") for channel in assumed)
        warnings.warn(
            f"{run}: no file states the unit of {', '.join(assumed)}, and the campaign's is "
            f"assumed. Correct it in [channels.{assumed[0]}], and remove unit_assumed there.",
            SeakeepWarning,
            stacklevel=3,
        )
    for each in every:
        if each.kind == "rate" and (each.channel, "rate") not in told:
            table = "files" if each.channel == "time" else f"instruments.{each.channel}"
            told.add((each.channel, "rate"))
            warnings.warn(
                f"{run}: sampled {each.text}. All periods and rates follow from it. Correct "
                f"sampling_rate in [{table}], and remove sampling_rate_assumed there.",
                SeakeepWarning,
                stacklevel=3,
            )
        if each.kind not in _MENDS or (each.channel, each.kind) in told:
            continue
        if each.kind != "record":
            told.add((each.channel, each.kind))
        mend = _MENDS[each.kind].format(run=run, channel=each.channel)
        warnings.warn(f"{run}: {each.channel} {each.text}. {mend}", SeakeepWarning, 3)


def is_noise(series: FloatArray) -> bool:
    """Whether most of a series' variance has no memory from one sample to the next."""
    series = series[np.isfinite(series)]
    if series.size < 64:
        return False
    # Second differences of white noise have six times its variance, and know no slope.
    noise = 1.4826 * float(np.median(np.abs(np.diff(series, 2)))) / float(np.sqrt(6.0))
    return bool(noise > np.sqrt(0.5) * float(series.std()) > 0)
