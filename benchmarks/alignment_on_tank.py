"""What alignment brings on the virtual tank: measured, predicted, none; dispersion, effective.

The three irregular runs are played, delivered as raw files of four loggers, and prepared by the
tank's campaign file (32 samples a mean encounter period); what is used begins after the start-up.
Each run in turn is forecast, in windows of 15 periods that do not overlap, by models that were
identified from the two others. The alignments see the same windows, so that their errors are
compared in pairs. A predicted surge takes exact delay rows and dispersion, so that it stands in the
table of `recommended` alone.

    python benchmarks/alignment_on_tank.py [--preset paper|recommended] [--out FILE.md]
"""

from __future__ import annotations

import argparse
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from chain_on_tank import deliver, used

import seakeep
from seakeep.models.settings import periods_to_samples

STATES = [
    *("surge", "heave", "pitch", "surge_rate", "heave_rate", "pitch_rate"),
    *("surge_acceleration", "heave_acceleration", "pitch_acceleration"),
    *("mooring_bow", "mooring_stern"),
]
INPUTS = ["eta_fwd", "eta_cog"]
PERIODS = 15
BEFORE, AHEAD = 12, 3
"""Periods at either end of a run that hold the history and the look-ahead of all models."""
ALIGNMENTS = {
    f"measured, {mode}": seakeep.ProbeAlignment(mode=mode) for mode in ("dispersion", "effective")
}
ALIGNMENTS["predicted, dispersion"] = seakeep.ProbeAlignment(mode="dispersion", surge="predicted")
ALIGNMENTS["none"] = None


def irregular_runs(settings=None):
    """Mean encounter period, and the irregular runs of a tank as `seakeep prepare` makes them."""
    with tempfile.TemporaryDirectory() as folder:
        runs = deliver(Path(folder), settings).campaign.prepare()
    period = next(iter(runs.values())).attrs["encounter_period"]
    return period, {name: used(run) for name, run in runs.items()}


def window_errors(runs, period, preset, alignment, forecast_runs=None):
    """NRMSE a channel of every window of the runs forecast, from models of the others."""
    dt = next(iter(runs.values())).attrs["dt"]
    make = getattr(seakeep.HankelDMDc, preset)
    base = make(encounter_period=period, dt=dt)
    spec = replace(base, alignment=alignment)
    steps, before, ahead = (periods_to_samples(n, period, dt) for n in (PERIODS, BEFORE, AHEAD))
    rows = []
    for name in runs if forecast_runs is None else forecast_runs:
        run = runs[name]
        model = spec.fit([other for key, other in runs.items() if key != name], STATES, INPUTS)
        time = run["time"].values
        for at in range(before, time.size - steps - ahead, steps):
            forecast = model.forecast(run, start=float(time[at]), steps=steps)
            measured = run[STATES].sel(time=forecast["time"])
            each = seakeep.metrics.nrmse(predicted=forecast, measured=measured)
            rows.append([float(each[state]) for state in STATES])
    return np.array(rows)


def paired(values, reference, rng, resamples=2000):
    """Median of the paired differences and its 95 % bootstrap interval."""
    difference = values - reference
    drawn = rng.integers(0, difference.size, (resamples, difference.size))
    medians = np.median(difference[drawn], axis=1)
    return float(np.median(difference)), *np.quantile(medians, [0.025, 0.975])


def table(preset, period, runs):
    """Text of the table of one preset."""
    errors = {
        name: window_errors(runs, period, preset, alignment)
        for name, alignment in ALIGNMENTS.items()
        if preset == "recommended" or not name.startswith("predicted")
    }
    none = errors["none"].mean(axis=1)
    lines = [
        f"## Preset {preset}",
        "",
        f"T = {period:.3f} s, {none.size} windows of {PERIODS} periods, each forecast by a model "
        "of the other two runs.",
        "",
        "| alignment | ANRMSE | less none, 95 % interval | " + " | ".join(STATES) + " |",
        "|---" * (3 + len(STATES)) + "|",
    ]
    for name, each in errors.items():
        mean = each.mean(axis=1)
        middle, low, high = paired(mean, none, np.random.default_rng(0))
        mark = " ¹" if name.startswith("measured") else ""
        gained = "" if name == "none" else f"{middle:+.3f} [{low:+.3f}, {high:+.3f}]"
        cells = [f"{value:.2f}" for value in np.median(each, axis=0)]
        lines.append(
            f"| {name}{mark} | {np.median(mean):.3f} | {gained} | " + " | ".join(cells) + " |"
        )
    return "\n".join([*lines, "", "¹ conditional on measured surge", ""])


def main(arguments=None):
    """Print the tables, and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--preset", choices=["paper", "recommended"], help="by default both")
    place = Path(__file__).parent / "results" / "alignment_on_tank.md"
    parser.add_argument("--out", type=Path, default=place, help="file for the tables")
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", seakeep.SeakeepWarning)
    period, runs = irregular_runs()
    presets = ["paper", "recommended"] if options.preset is None else [options.preset]
    head = (
        "# What alignment brings on the virtual tank\n\nMade by `python benchmarks/"
        "alignment_on_tank.py` from the tank's raw files: medians over the same windows.\n"
    )
    tables = [table(preset, period, runs) for preset in presets]
    text = "\n".join([head, *tables])
    print(text)
    options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
