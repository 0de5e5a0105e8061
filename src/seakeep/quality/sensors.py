"""Checks of sensors against one another: redundant ones, and probes by the waves that pass them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
import xarray as xr

from seakeep.quality.agreement import (
    FEWEST_STEPS,
    LARGEST_GAIN,
    LARGEST_NRMSE,
    LATE,
    LEAST_CORRELATION,
    RUN_AWAY,
    Agreement,
    compare_sensors,
)
from seakeep.quality.faults import STUCK, find_held
from seakeep.quality.findings import Finding, Kind, Record, Redundant, channels_of, filled, step_of
from seakeep.signals import misplaced_probes


class SensorsKind(Kind):
    """Findings from the comparison of two sensors."""

    STILL = "against {other}: constant while the other sensor moves"
    UNSEEN = "against {other}: no motion seen"
    RESOLUTION = (
        "against {other}: motion below the resolution: from crest to trough it spans "
        "{spanned:.1f} of the steps in which the sensor reads ({value:.2g})"
    )
    AGREEMENT = (
        "against {other}: agrees poorly (correlation {correlation:.2f} at its best lag), {so}"
    )
    LAG_GROWS = "against {other}: lag runs away by {value:+.2f} over the record, {so}"
    LAG = "against {other}: lag {value:+.2f} (± {spread:.2f} s), {so}"
    DIFFERENCE = "against {other}: differs beyond a lag, {so}"
    SCALE = (
        "against {other}: scale: its standard deviation is {value:.3g} times as large; the unit or "
        "the calibration of one of them is wrong",
        "Check unit and column in [channels.{channel}].",
    )
    HELD = "holds still for {value:.3g} while {other} moves, from {place:.4g} s"
    POSITION = (
        "is stated to stand {limit:+.3f} from {other}, and the phases of the waves fit "
        "{value:+.3f} (± {spread:.3f} m){unsure}; an elevation carried by the stated distance is "
        "wrong by {error:.2f} of its standard deviation",
        "Check [rig.positions] of the campaign, the water depth and the probes' clocks.",
    )


def compared(run: xr.Dataset, pairs: Iterable[Redundant]) -> dict[tuple[str, str], Agreement]:
    """Compare the channels of each group with its first, which is trusted.

    Parameters
    ----------
    run : Dataset
        All channels on one axis.
    pairs : iterable of Redundant
        Groups of sensors of one quantity.

    Returns
    -------
    dict of (str, str) to Agreement
        By channel and trusted channel.
    """
    out = {}
    dt = step_of(run)
    for pair in pairs if run.sizes["time"] >= 16 else ():
        trusted = filled(run[pair.channels[0]])
        for name in pair.channels[1:]:
            stuck = None
            if f"{name}_flags" in run.coords:
                stuck = (run[f"{name}_flags"].to_numpy() & STUCK) > 0
            step = float(run[name].attrs.get("reading_step", np.nan))
            out[name, pair.channels[0]] = compare_sensors(
                filled(run[name]), trusted, dt, pair.window, stuck, step
            )
    return out


def redundant(record: Record) -> Iterator[Finding]:
    """Redundant sensors that disagree by more than a model may err, or hold still alone."""
    run = record.whole
    for (name, other), agreement in compared(run, record.redundant).items():
        unit = str(run[name].attrs["units"])
        for kind, value, limit, its_unit in _faults(agreement, unit):
            details = {
                "other": other,
                "correlation": agreement.correlation,
                "spread": agreement.lag_spread,
                "spanned": agreement.spanned,
                "so": f"so that the NRMSE between the two is {agreement.nrmse:.2f}",
            }
            yield Finding(kind, record.run, name, value, limit, its_unit, details=details)
        x, dt = filled(run[name]), step_of(run)
        stuck = find_held(x, dt, filled(run[other]))
        if stuck.any() and np.isfinite(agreement.period):
            start, length = float(run["time"][int(np.argmax(stuck))]), float(stuck.sum()) * dt
            yield Finding(
                SensorsKind.HELD, record.run, name, length, agreement.period, "s", start,
                {"other": other},
            )  # fmt: skip


def _faults(agreement: Agreement, unit: str) -> Iterator[tuple[SensorsKind, float, float, str]]:
    """Evidence against a sensor: kind, value, limit, unit."""
    if not np.isfinite(agreement.correlation):
        kind = SensorsKind.STILL if agreement.gain == 0 else SensorsKind.UNSEEN
        yield kind, agreement.gain, np.nan, "1"
        return
    if agreement.spanned < FEWEST_STEPS:
        yield SensorsKind.RESOLUTION, agreement.step, agreement.motion, unit
    scaled = not 1 / LARGEST_GAIN <= agreement.gain <= LARGEST_GAIN
    if agreement.correlation >= LEAST_CORRELATION and scaled:
        yield SensorsKind.SCALE, agreement.gain, LARGEST_GAIN, "1"
    if scaled or agreement.nrmse > LARGEST_NRMSE:
        growth, late = RUN_AWAY * agreement.period, LATE * agreement.period
        if agreement.correlation < LEAST_CORRELATION:
            yield SensorsKind.AGREEMENT, agreement.nrmse, LARGEST_NRMSE, "1"
        elif abs(agreement.growth) > growth:
            yield SensorsKind.LAG_GROWS, agreement.growth, growth, "s"
        elif abs(agreement.lag) > late:
            yield SensorsKind.LAG, agreement.lag, late, "s"
        elif not scaled:
            yield SensorsKind.DIFFERENCE, agreement.nrmse, LARGEST_NRMSE, "1"


def positions(record: Record) -> Iterator[Finding]:
    """Stated positions of wave probes against the phases of the waves that passed them.

    Nothing can be said without a water depth, nor of regular waves.
    """
    run, depth = record.whole, record.water_depth
    places = {
        name: float(channel.attrs["x_position"])
        for name, channel in channels_of(run).items()
        if "x_position" in channel.attrs
    }
    if depth is None or record.waves == "regular" or len(places) < 2:
        return
    series = {name: filled(run[name]) for name in places}
    for each in misplaced_probes(series, places, step_of(run), depth):
        separation = each.separation
        details = {
            "other": each.other,
            "spread": separation.spread,
            "error": separation.input_error,
            "unsure": "" if each.certain else ", or the other probe is misplaced",
        }
        yield Finding(
            SensorsKind.POSITION, record.run, each.probe, separation.separation,
            separation.stated, "m",            details=details,
        )  # fmt: skip
