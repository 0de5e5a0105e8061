"""What each step from the paper's model to the recommended one brings, and to FIR beside it.

The irregular runs of the virtual tank are played, delivered as raw files and prepared by the tank's
campaign file. Each run in turn is forecast, in windows of 15 periods that do not overlap, by models
of the two others. A step adds one thing to the step above it: data, look-ahead, alignment, chosen
ridge and observables, read-outs. FIR gets the same data, look-ahead and input map; its length and
its ridge are those that err least where each training run is forecast by a model of the other.

    python benchmarks/steps_on_tank.py [--losses FACTOR] [--out FILE.md]
"""

from __future__ import annotations

import argparse
import itertools
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
from alignment_on_tank import AHEAD, BEFORE, INPUTS, PERIODS, STATES, irregular_runs, paired
from timing import machine

import seakeep
from seakeep.baselines import FIR
from seakeep.models.settings import periods_to_samples
from seakeep.tank.settings import default_settings

SLOW = ("surge", "mooring_bow", "mooring_stern")
STEPS = (
    "the paper's settings: 20 T̂ of each run, waves up to now",
    "whole runs, exact delay rows, chosen λ",
    "waves .75 T̂ ahead",
    "probes carried to the measured surge ¹",
    "probes carried to the predicted surge instead",
    "observables: slow squares and powers",
    "read-outs of the loads: `recommended`",
)
LENGTHS, RIDGES = (2, 3, 5), (1e-4, 1e-3, 1e-2, 1e-1)
"""Encounter periods and λ per snapshot among which FIR's are chosen."""
MEASURED = seakeep.ProbeAlignment(mode="dispersion", surge="measured")
FOLLOWS = seakeep.ProbeAlignment(mode="dispersion", surge="predicted")


def with_losses(factor):
    """The default tank with viscous damping of the vessel times a factor."""
    settings = default_settings()
    scaled = {
        name: damping.model_copy(update={k: factor * v for k, v in damping})
        for name in ("linear_damping", "quadratic_damping")
        for damping in [getattr(settings.vessel, name)]
    }
    return settings.model_copy(update={"vessel": settings.vessel.model_copy(update=scaled)})


def specs(period, dt):
    """Settings of HDMDc by step."""
    paper = seakeep.HankelDMDc.paper(encounter_period=period, dt=dt)
    whole = seakeep.HankelDMDc.recommended(encounter_period=period, dt=dt)
    fixed = replace(whole.select, observables=False)
    bare = {"alignment": None, "lead": 0, "readouts": (), "select": fixed}
    ahead = bare | {"lead": whole.lead}
    changes = (
        bare,
        ahead,
        ahead | {"alignment": MEASURED},
        {"readouts": (), "select": fixed},
        {"readouts": ()},
        {},
    )
    return [paper, *(replace(whole, **each) for each in changes)]


def spans(run, period, dt):
    """First instants of the windows that are judged, and their length in samples."""
    steps, before, ahead = (periods_to_samples(n, period, dt) for n in (PERIODS, BEFORE, AHEAD))
    time = run["time"].values
    return [float(time[at]) for at in range(before, time.size - steps - ahead, steps)], steps


def errors(model, run, period):
    """NRMSE over (window, state) of the forecasts of a run."""
    starts, steps = spans(run, period, model.dt)
    rows = []
    for start in starts:
        forecast = model.forecast(run, start=start, steps=steps)
        measured = run[STATES].sel(time=forecast["time"])
        each = seakeep.metrics.nrmse(predicted=forecast, measured=measured)
        rows.append([float(each[state]) for state in STATES])
    return np.array(rows)


def fir_beside(spec, model, training, period, dt):
    """FIR with the data, the look-ahead and the input map of a model, length and λ chosen."""
    tried = {}
    shared = {"lead": spec.lead, "alignment": spec.alignment, "window": spec.window}
    shared["observables"] = model.settings.observables
    for length, ridge in itertools.product(LENGTHS, RIDGES):
        fir = FIR(input_delays=periods_to_samples(length, period, dt), ridge=ridge, **shared)
        found = [
            errors(fir.fit([other], STATES, INPUTS), run, period)
            for run, other in (training, training[::-1])
        ]
        tried[fir] = np.mean(np.concatenate(found))
    return min(tried, key=tried.get)


def averages(rows):
    """Means over the wave channels and over the slow ones, each per window."""
    slow = np.isin(STATES, SLOW)
    return [rows[:, which].mean(axis=1) for which in (~slow, slow)]


def cells(groups, before):
    """Medians over the windows, and the change from the step above with its 95 % interval."""
    made = []
    for place, group in enumerate(groups):
        text = f"{np.median(group):.3f}" if np.all(np.isfinite(group)) else "lost"
        if before is not None and np.all(np.isfinite([group, before[place]])):
            middle, low, high = paired(group, before[place], np.random.default_rng(0))
            text += f" ({middle:+.3f} [{low:+.3f}, {high:+.3f}])"
        made.append(text)
    return made


def rows_of(period, runs):
    """A row of the table per step."""
    dt = next(iter(runs.values())).attrs["dt"]
    before = {}
    for step, spec in zip(STEPS, specs(period, dt), strict=True):
        found = {"ours": [], "fir": []}
        for name, run in runs.items():
            training = [other for key, other in runs.items() if key != name]
            model = spec.fit(training, STATES, INPUTS)
            fir = fir_beside(spec, model, training, period, dt).fit(training, STATES, INPUTS)
            found["ours"].append(errors(model, run, period))
            found["fir"].append(errors(fir, run, period))
        groups = {key: averages(np.concatenate(each)) for key, each in found.items()}
        yield [step, *cells(groups["ours"], before.get("ours")), *cells(groups["fir"], None)]
        before = before if step.endswith("¹") else groups


def main(arguments=None):
    """Print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    place = Path(__file__).parent / "results" / "steps_on_tank.md"
    parser.add_argument("--out", type=Path, default=place, help="file for the table")
    parser.add_argument(
        "--losses", type=float, default=1.0, help="factor on the vessel's viscous losses"
    )
    options = parser.parse_args(arguments)
    warnings.simplefilter("ignore", seakeep.SeakeepWarning)
    period, runs = irregular_runs(with_losses(options.losses))
    heads = ("step", "HDMDc: waves", "HDMDc: slow", "FIR: waves", "FIR: slow")
    rows = [heads, ["---"] * len(heads)]
    for row in rows_of(period, runs):
        print(*row, sep="  ", flush=True)
        rows.append(row)
    facts = machine()
    text = f"""# What each step to the recommended model brings

Made by `python benchmarks/steps_on_tank.py --losses {options.losses:g}` with seakeep
{seakeep.__version__}, Python {facts["python"]}, on {facts["cores"]} cores of an
{facts["processor"]}.

Three irregular runs of the virtual tank, each forecast over {PERIODS} T̂ by models of the other two.
NRMSE per window, averaged over the eight channels that follow the waves and over the three that
drift slowly (surge and both mooring loads); medians over the windows. In parentheses the change of
HDMDc from the row above, paired by window, with its 95 % bootstrap interval; the rows after the one
marked ¹ compare with the row before it. FIR has the data, look-ahead and input map of the row;
its length and ridge err least where each training run is forecast by a model of the other.

"""
    text += "".join(f"| {' | '.join(row)} |\n" for row in rows)
    text += '\n¹ conditional on the measured surge, which the forecast reads. "lost": diverged.\n'
    options.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
