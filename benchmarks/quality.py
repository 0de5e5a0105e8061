"""Recall and false alarms of the quality checks, on faults put into runs of the virtual tank.

    python benchmarks/quality.py [--seeds 5] [--out FILE.md]

Each fault is put into the heave of the motion reference unit (50 Hz), at a random place and with
a random size from the range printed; the heave integrated from its accelerometer is the trusted
one. A fault counts as found if a finding of its own kind names the channel. Lags and coarse
readings are drawn from both sides of the limits that follow from a largest NRMSE of 0.2 and
from five steps a motion, and both sides are stated: what lies below a limit is not to be flagged.
False alarms are findings of any kind in the same runs without a fault.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.campaign.pipeline import flag_samples
from seakeep.campaign.settings import PreparationSettings
from seakeep.quality.faults import MISSING, flag_attributes
from seakeep.quality.findings import Record
from seakeep.quality.samples import constant, flagged, levels
from seakeep.quality.sensors import FEWEST_STEPS, LATE, RUN_AWAY, compare_sensors, redundant
from seakeep.signals import bridge, integrate
from seakeep.signals.waves import dominant_period
from seakeep.tank.instruments import record_run
from seakeep.tank.play import check_settings, generator, play_run
from seakeep.tank.settings import default_settings

Range = tuple[float, float]
Fault = Callable[[np.ndarray, float, np.random.Generator, Range], np.ndarray]


def late(x: np.ndarray, dt: float, rng: np.random.Generator, size: Range) -> np.ndarray:
    """Shift the whole series by a part of its period."""
    lag = rng.uniform(*size) * dominant_period(x, dt) * rng.choice([-1, 1])
    t = dt * np.arange(x.size)
    return np.interp(t - lag, t, x)


def running_away(x: np.ndarray, dt: float, rng: np.random.Generator, size: Range) -> np.ndarray:
    """Let the clock run away by so many periods over the record."""
    t = dt * np.arange(x.size)
    grown = rng.uniform(*size) * dominant_period(x, dt) * rng.choice([-1, 1])
    return np.interp(t - grown * (t / t[-1] - 0.5), t, x)  # on time in the middle


def coarse(x: np.ndarray, dt: float, rng: np.random.Generator, size: Range) -> np.ndarray:
    """Round to a step of which the motion spans so many from crest to trough."""
    step = 2 * np.sqrt(2) * x.std() / rng.uniform(*size)
    return step * np.round(x / step)


def frozen(x: np.ndarray, dt: float, rng: np.random.Generator, size: Range) -> np.ndarray:
    """Hold one value."""
    out, length = x.copy(), int(rng.uniform(*size) / dt)
    at = rng.integers(x.size // 10, x.size - length)
    out[at : at + length] = out[at]
    return out


def spiked(x: np.ndarray, dt: float, rng: np.random.Generator, size: Range) -> np.ndarray:
    """Add single samples that are far off."""
    out = x.copy()
    at = rng.choice(x.size, 5, replace=False)
    out[at] += rng.uniform(*size, 5) * x.std() * rng.choice([-1, 1], 5)
    return out


def drifting(x: np.ndarray, dt: float, rng: np.random.Generator, size: Range) -> np.ndarray:
    """Tilt the level."""
    return x + rng.uniform(*size) * x.std() * rng.choice([-1, 1]) * np.linspace(0, 1, x.size)


def clipped(x: np.ndarray, dt: float, rng: np.random.Generator, size: Range) -> np.ndarray:
    """Cut the crests off."""
    edge = rng.uniform(*size) * np.abs(x).max()
    return np.clip(x, -edge, edge)


def dropped(x: np.ndarray, dt: float, rng: np.random.Generator, size: Range) -> np.ndarray:
    """Lose samples."""
    out = x.copy()
    for at in rng.integers(0, x.size - 20, 8):
        out[at : at + round(rng.uniform(*size) / dt)] = np.nan
    return out


FAULTS: dict[str, tuple[Fault, str, Range, str]] = {
    "lag": (late, "lag", (LATE, 0.4), "periods"),
    "lag below the limit": (late, "lag", (0.0, LATE), "periods"),
    "lag that grows": (running_away, "lag", (RUN_AWAY, 1.2), "periods over the record"),
    "growth below the limit": (running_away, "lag", (0.0, RUN_AWAY), "periods over the record"),
    "coarse readings": (coarse, "resolution", (0.8, FEWEST_STEPS), "steps a motion"),
    "finer readings": (coarse, "resolution", (FEWEST_STEPS, 40), "steps a motion"),
    "freeze": (frozen, "stuck", (2.5, 20), "s"),
    "spikes": (spiked, "outliers", (1, 4), "SD, five of them"),
    "level drift": (drifting, "drift", (0.7, 2), "SD over the record"),
    "saturation": (clipped, "saturated", (0.4, 0.9), "of the range"),
    "drop-outs": (dropped, "missing", (0.02, 0.4), "s, eight of them"),
}
PAIRS = {("trusted", "heave"): None}
SAME = {"lag grows": "lag", "difference": "lag", "agreement": "lag", "held": "stuck"}
"""Kinds of findings that count as one here."""


def kinds(x: np.ndarray, trusted: np.ndarray, dt: float) -> set[str]:
    """Kinds of findings against ``heave``."""
    filled = bridge(x, dt, 0.0)
    time = dt * np.arange(x.size)
    group = xr.Dataset({"heave": ("time", filled.values, {"units": "m"})}, {"time": ("time", time)})
    if filled.long.any():
        flags = (MISSING * filled.long).astype(np.int16)
        group.coords["heave_flags"] = ("time", flags, flag_attributes("heave"))
    group = flag_samples(group, PreparationSettings())
    both = group.assign(trusted=("time", trusted, {"units": "m"}))[["trusted", "heave"]]
    record = Record("run", both, {"": group}, redundant=PAIRS)
    checks = (flagged, constant, levels, redundant)
    found = {each.kind.word for one in checks for each in one(record) if each.channel == "heave"}
    return {SAME.get(word, word) for word in found}


def heaves(settings, rig, name: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Heave of a run as measured, as integrated from the accelerometer, and the step (s)."""
    played = play_run(settings, name, rig)
    mru = record_run(played, generator(settings, name, "instruments"))["mru"]
    dt = float(mru["time"][1])
    trusted = integrate(mru["acceleration_z"].values, dt, (0.2, 5.0), 2)
    return mru["heave"].values, trusted, dt


def table(seeds: int, names: list[str] | None = None) -> str:
    """Text of the tables."""
    settings = default_settings()
    rig = check_settings(settings)
    hits = dict.fromkeys(FAULTS, 0)
    tried, alarms, sound = 0, {}, {}
    for name in names or settings.runs:
        heave, trusted, dt = heaves(settings, rig, name)
        alarms[name] = kinds(heave, trusted, dt)
        sound[name] = compare_sensors(heave, trusted, dt)
        for seed in range(seeds):
            tried += 1
            for fault, (put, kind, size, _) in FAULTS.items():
                x = put(heave, dt, np.random.default_rng([seed, len(fault)]), size)
                hits[fault] += kind in kinds(x, trusted, dt)
    lines = [
        "# Recall and false alarms of the quality checks",
        "",
        "Made by `python benchmarks/quality.py`: faults put into heave in runs of the tank.",
        "",
        "| fault | size | flagged |",
        "|---|---|---|",
    ]
    for fault, (_, _, (low, high), unit) in FAULTS.items():
        lines.append(f"| {fault} | {low:.3g} to {high:.3g} {unit} | {hits[fault]} of {tried} |")
    wrong = {name: sorted(found) for name, found in alarms.items() if found}
    lines += ["", f"False alarms in {len(alarms)} sound runs: {wrong or 'none'}.", ""]
    lines += ["Lags of the sound runs, in periods (limits: "]
    lines[-1] += f"{LATE:.3f} for a lag, {RUN_AWAY:.2f} for its growth):"
    lines += ["", "| run | median lag | scatter of windows | growth | correlation |"]
    lines += ["|---|---|---|---|---|"]
    for name, each in sound.items():
        parts = [value / each.period for value in (each.lag, each.lag_spread, each.growth)]
        cells = " | ".join(f"{part:.4f}" for part in parts)
        lines.append(f"| {name} | {cells} | {each.correlation:.4f} |")
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the tables, and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5, help="faults of each kind a run")
    place = Path(__file__).parent / "results" / "quality.md"
    parser.add_argument("--out", type=Path, default=place, help="file for the tables")
    options = parser.parse_args()
    text = table(options.seeds)
    print(text)
    options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
