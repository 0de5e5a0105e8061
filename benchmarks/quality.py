"""Recall and false alarms of the quality checks, on faults put into runs of the virtual tank.

python benchmarks/quality.py [--seeds 5]

Each fault is put into the heave of the motion reference unit (50 Hz), at a random place and with
a random size from the range printed; the heave integrated from its accelerometer is the trusted
one. A fault counts as found if a finding of its own kind names the channel. False alarms are
findings of any kind in the same runs without a fault.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np
import xarray as xr

from seakeep.campaign.chain_settings import RedundantSettings
from seakeep.campaign.channels import Group
from seakeep.campaign.checks import check_levels, check_pairs, check_samples, told_samples
from seakeep.campaign.settings import CampaignSettings
from seakeep.signals import bridge, integrate
from seakeep.signals.quality import MISSING, flag_attributes
from seakeep.tank.instruments import record_run
from seakeep.tank.play import check_settings, generator, play_run
from seakeep.tank.settings import default_settings

Fault = Callable[[np.ndarray, float, np.random.Generator], np.ndarray]


def late(x: np.ndarray, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Shift the whole series."""
    lag = rng.uniform(0.25, 0.7) * rng.choice([-1, 1])
    t = dt * np.arange(x.size)
    return np.interp(t - lag, t, x)


def running_away(x: np.ndarray, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Let the clock run away."""
    t = dt * np.arange(x.size)
    return np.interp(t * (1 - rng.uniform(0.6, 2.0) * rng.choice([-1, 1]) / t[-1]), t, x)


def frozen(x: np.ndarray, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Hold one value."""
    out, length = x.copy(), int(rng.uniform(2.5, 20) / dt)
    at = rng.integers(x.size // 10, x.size - length)
    out[at : at + length] = out[at]
    return out


def spiked(x: np.ndarray, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Add single samples that are far off."""
    out = x.copy()
    at = rng.choice(x.size, 5, replace=False)
    out[at] += rng.uniform(1.0, 4.0, 5) * x.std() * rng.choice([-1, 1], 5)
    return out


def drifting(x: np.ndarray, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Tilt the level."""
    return x + rng.uniform(0.7, 2.0) * x.std() * rng.choice([-1, 1]) * np.linspace(0, 1, x.size)


def clipped(x: np.ndarray, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Cut the crests off."""
    edge = rng.uniform(0.4, 0.9) * np.abs(x).max()
    return np.clip(x, -edge, edge)


def dropped(x: np.ndarray, dt: float, rng: np.random.Generator) -> np.ndarray:
    """Lose samples."""
    out = x.copy()
    for at in rng.integers(0, x.size - 20, 8):
        out[at : at + rng.integers(1, 20)] = np.nan
    return out


FAULTS: dict[str, tuple[Fault, str, str]] = {
    "lag": (late, "lag", "0.25 to 0.7 s"),
    "lag that grows": (running_away, "lag", "0.6 to 2 s over the record"),
    "freeze": (frozen, "stuck", "2.5 to 20 s"),
    "spikes": (spiked, "outliers", "5 of 1 to 4 SD"),
    "level drift": (drifting, "drift", "0.7 to 2 SD over the record"),
    "saturation": (clipped, "saturated", "at 0.4 to 0.9 of the range"),
    "drop-outs": (dropped, "missing", "8 of 20 to 400 ms"),
}
TABLE = RedundantSettings(channels=("trusted", "heave"))
SETTINGS = CampaignSettings.model_construct(redundant={"heave": TABLE})


def kinds(x: np.ndarray, trusted: np.ndarray, dt: float) -> set[str]:
    """Kinds of findings against ``heave``."""
    filled = bridge(x, dt, 0.0)
    time = dt * np.arange(x.size)
    group = xr.Dataset({"heave": ("time", filled.values, {"units": "m"})}, {"time": ("time", time)})
    if filled.long.any():
        flags = (MISSING * filled.long).astype(np.int16)
        group.coords["heave_flags"] = ("time", flags, flag_attributes("heave"))
    group = check_samples(group, replace=False)
    both = group.assign(trusted=("time", trusted, {"units": "m"}))[["trusted", "heave"]]
    found = told_samples(Group({"": group})) + check_levels(both[["heave"]])
    return {each.kind for each in found + check_pairs(both, SETTINGS)[0]}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5, help="faults of each kind a run")
    seeds = parser.parse_args().seeds
    settings = default_settings()
    rig = check_settings(settings)
    hits = dict.fromkeys(FAULTS, 0)
    tried, alarms = 0, {}
    for name in settings.runs:
        played = play_run(settings, name, rig)
        records = {r.name: r for r in record_run(played, generator(settings, name, "instruments"))}
        mru = records["mru"]
        dt = float(mru.time[1])
        heave = mru.columns["heave"].values
        trusted = integrate(mru.columns["acceleration_z"].values, dt, (0.2, 5.0), 2)
        alarms[name] = kinds(heave, trusted, dt)
        for seed in range(seeds):
            tried += 1
            for fault, (put, kind, _) in FAULTS.items():
                x = put(heave, dt, np.random.default_rng([seed, len(fault)]))
                hits[fault] += kind in kinds(x, trusted, dt)
    print(f"{'fault':16s} {'size':28s} found")
    for fault, (_, _, size) in FAULTS.items():
        print(f"{fault:16s} {size:28s} {hits[fault]}/{tried}")
    wrong = {name: sorted(found) for name, found in alarms.items() if found}
    print(f"false alarms in {len(alarms)} sound runs: {wrong or 'none'}")


if __name__ == "__main__":
    main()
