"""What alignment brings on the virtual tank: measured, predicted, none; dispersion, effective.

The three irregular runs are played with ideal instruments (stated noise, no clock errors), cut
after the start-up and sampled 32 times a mean encounter period. Each run in turn is forecast, in
windows of 15 periods that do not overlap, by models that were identified from the two others. The
alignments see the same windows, so that their errors are compared in pairs.

    python benchmarks/alignment_on_tank.py [--preset paper|recommended] [--csv FILE]
"""

from __future__ import annotations

import argparse
import csv
import warnings
from pathlib import Path

import numpy as np

import seakeep
from seakeep.models.settings import periods_to_samples
from seakeep.signals import encounter_period, low_pass
from seakeep.tank.play import check_settings, noisy_truth
from seakeep.tank.settings import default_settings

STATES = [
    *("surge", "heave", "pitch", "surge_rate", "heave_rate", "pitch_rate"),
    *("surge_acceleration", "heave_acceleration", "pitch_acceleration"),
    *("mooring_bow", "mooring_stern"),
]
INPUTS = ["eta_kn_fwd", "eta_kn_cog"]
PERIODS = 15
ALIGNMENTS = {
    f"{surge}, {mode}": seakeep.ProbeAlignment(mode=mode, surge=surge)
    for surge in ("measured", "predicted")
    for mode in ("dispersion", "effective")
}
ALIGNMENTS["none"] = None


def irregular_runs():
    """Mean encounter period, and irregular runs of the virtual tank at 32 samples a period."""
    settings = default_settings()
    rig = check_settings(settings)
    names = [name for name, run in settings.runs.items() if run.spectrum is not None]
    begin = {name: settings.runs[name].startup for name in names}
    fine = {name: noisy_truth(settings, name, 0.01, rig) for name in names}
    period = float(
        np.mean(
            [
                encounter_period(
                    low_pass(run["eta_kn_fwd"].values, 0.01, 2.0, 3.0)[round(begin[name] / 0.01) :],
                    0.01,
                )
                for name, run in fine.items()
            ]
        )
    )
    dt = period / 32
    runs = {}
    for name in names:
        run = noisy_truth(settings, name, dt, rig).sel(time=slice(begin[name], None))
        runs[name] = run.assign_attrs(dt=dt)
    return period, runs


def window_errors(runs, period, preset, alignment, forecast_runs=None):
    """NRMSE a channel of every window of the runs forecast, from models of the others."""
    dt = next(iter(runs.values())).attrs["dt"]
    make = getattr(seakeep.HankelDMDc, preset)
    base = make(encounter_period=period, dt=dt)
    fields = {name: getattr(base, name) for name in base.__dataclass_fields__}
    spec = seakeep.HankelDMDc(**{**fields, "alignment": alignment})
    steps = periods_to_samples(PERIODS, period, dt)
    rows = []
    for name in runs if forecast_runs is None else forecast_runs:
        run = runs[name]
        model = spec.fit([other for key, other in runs.items() if key != name], STATES, INPUTS)
        time = run["time"].values
        for at in range(model.history_samples - 1, time.size - steps, steps):
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


def main(arguments=None):
    """Print the table, and write it if asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--preset", choices=["paper", "recommended"], default="paper")
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", seakeep.SeakeepWarning)
    period, runs = irregular_runs()
    errors = {
        name: window_errors(runs, period, options.preset, alignment)
        for name, alignment in ALIGNMENTS.items()
    }
    none = errors["none"].mean(axis=1)
    print(f"preset {options.preset}, T = {period:.3f} s, {none.size} windows of {PERIODS} periods")
    print("median ANRMSE; paired difference to none with 95 % interval; median NRMSE a channel")
    table = []
    for name, each in errors.items():
        mean = each.mean(axis=1)
        middle, low, high = paired(mean, none, np.random.default_rng(0))
        conditional = "surge" if name.startswith("measured") else ""
        channels = {
            state: float(m) for state, m in zip(STATES, np.median(each, axis=0), strict=True)
        }
        table.append(
            {
                "alignment": name,
                "conditional_on": conditional,
                "anrmse": float(np.median(mean)),
                "difference": middle,
                "low": low,
                "high": high,
                **channels,
            }
        )
        shown = " ".join(f"{key} {value:.2f}" for key, value in channels.items())
        mark = " (conditional on measured surge)" if conditional else ""
        print(f"{name:24s} {np.median(mean):.3f}  {middle:+.3f} [{low:+.3f}, {high:+.3f}]{mark}")
        print(f"    {shown}")
    if options.csv is not None:
        with options.csv.open("w", newline="", encoding="utf-8") as stream:
            writer = csv.DictWriter(stream, list(table[0]))
            writer.writeheader()
            writer.writerows(table)


if __name__ == "__main__":
    main()
