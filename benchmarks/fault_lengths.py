"""What the quality checks report of faults of every length: channel, kind of fault, length.

    python benchmarks/fault_lengths.py [--places 8] [--out FILE.md]

Faults are put into the channels of a run of the tutorial and of the virtual tank, each at its own
rate, at random places. A fault counts as reported if the checks of samples name its channel.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.campaign import read_table
from seakeep.campaign.pipeline import flag_samples
from seakeep.campaign.settings import PreparationSettings
from seakeep.quality.findings import Record
from seakeep.quality.samples import constant, flagged, noise
from seakeep.signals.time_axis import over_gaps
from seakeep.tank.instruments import record_run
from seakeep.tank.play import check_settings, generator, play_run
from seakeep.tank.settings import default_settings

LENGTHS = (1, 2, 3, 4, 5, 8, 15, 50, 300, 1000)
PARTS = (0.25, 0.5, 0.75, 1.0)
"""Lengths of faults, in samples and in parts of the record."""

TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorial" / "run1.csv"
LONGEST = 30_000
"""Samples taken of a record at 500 Hz."""

WAVES_FROM = 60.0
"""Instant at which the tank's waves have grown, s: before it readings repeat in calm water."""

TANK = {"mru": ("heave", "pitch"), "loads": ("mooring_bow",), "video": ("surge",)}


def held(x: np.ndarray, at: slice, rng: np.random.Generator) -> np.ndarray:
    """Repeat the reading before the fault; a fault of n samples makes a run of n + 1."""
    out = x.copy()
    out[at] = x[max(at.start - 1, 0)]
    return out


def filled(value: float):
    """Write one value."""

    def fault(x: np.ndarray, at: slice, rng: np.random.Generator) -> np.ndarray:
        out = x.copy()
        out[at] = value
        return out

    return fault


def wild(least: float, most: float):
    """Write random values so many standard deviations from the mean, to either side."""

    def fault(x: np.ndarray, at: slice, rng: np.random.Generator) -> np.ndarray:
        out, shape = x.copy(), at.stop - at.start
        away = rng.uniform(least, most, shape) * rng.choice([-1, 1], shape)
        out[at] = x.mean() + x.std() * away
        return out

    return fault


FAULTS = {"held": held, "zero": filled(0.0), "-99.9": filled(-99.9), "-999": filled(-999.0),
          "5 to 15 SD": wild(5, 15), "to 100 SD": wild(0, 100)}  # fmt: skip


def reported(x: np.ndarray, dt: float) -> set[str]:
    """Kinds of findings of the checks of samples."""
    time = dt * np.arange(x.size)
    group = xr.Dataset({"x": ("time", x, {"units": "1"})}, {"time": ("time", time)})
    record = Record("run", group, {"": flag_samples(group, PreparationSettings())})
    return {found.kind.word for check in (flagged, constant, noise) for found in check(record)}


def hits(x: np.ndarray, dt: float, kind: str, length: int, places: int) -> int:
    """Places at which a fault of a length is reported.

    A short one of zeros is put where the reading is not near zero, which it would be without it.
    """
    count = 0
    for seed in range(places):
        rng = np.random.default_rng([seed, length])
        starts = np.arange(x.size - length + 1)
        if kind == "zero" and length < x.size // 4:
            starts = starts[np.abs(x[starts]) > 1.5 * x.std()]
        start = int(rng.choice(starts))
        count += bool(reported(FAULTS[kind](x, slice(start, start + length), rng), dt))
    return count


def channels() -> dict[str, tuple[np.ndarray, float]]:
    """Channels and their time steps, in the units of their files."""
    raw = read_table(TUTORIAL)
    step = float(raw["time"][1] - raw["time"][0])
    out = {f"tutorial, {name}": (raw[name].to_numpy(), step) for name in map(str, raw.data_vars)}
    settings = default_settings()
    played = play_run(settings, "irregular_1", check_settings(settings))
    records = record_run(played, generator(settings, "irregular_1", "instruments"))
    for logger, names in TANK.items():
        time = records[logger]["time"].values
        for name in names:
            values = records[logger][name].values[time >= WAVES_FROM][:LONGEST]
            out[f"tank, {name}"] = over_gaps(values), float(time[1] - time[0])
    return out


def table(places: int) -> str:
    """Text of the table."""
    heads = [*map(str, LENGTHS), *(f"{part:.0%}" for part in PARTS)]
    lines = [
        "# What the quality checks report of faults of every length",
        "",
        f"Made by `python benchmarks/fault_lengths.py`: of {places} random places, those at which "
        "the fault is reported, by its length in samples or in parts of the record.",
        "",
        "- held: readings repeat the one before. Three equal readings, two repetitions, may be "
        "chance in a record of this length, and four where readings repeat now and then.",
        "- zero: where readings are further from zero than 1.5 standard deviations. Beside them it "
        "is a plausible reading, as are two or three of them on a steep flank.",
        "- -99.9 and -999, in the unit of the file.",
        "- SD: random readings so many standard deviations from the mean, to either side. Four to "
        "eight of 5 to 15 SD that happen to lie on one side pass for the snap of a line.",
        "",
        f"| channel | fault | {' | '.join(heads)} |",
        "|---|---|" + "---|" * len(heads),
    ]
    alarms = []
    for name, (x, dt) in channels().items():
        alarms += [f"{name}: {word}" for word in reported(x, dt)]
        lengths = [*LENGTHS, *(int(part * x.size) for part in PARTS)]
        for kind in FAULTS:
            counts = [str(hits(x, dt, kind, length, places)) for length in lengths]
            lines.append(f"| {name} | {kind} | {' | '.join(counts)} |")
    lines += ["", f"Findings without a fault: {', '.join(alarms) or 'none'}."]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--places", type=int, default=8, help="places of each fault")
    place = Path(__file__).parent / "results" / "fault_lengths.md"
    parser.add_argument("--out", type=Path, default=place, help="file for the table")
    options = parser.parse_args()
    text = table(options.places)
    print(text)
    options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
