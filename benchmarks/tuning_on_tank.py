"""What `seakeep.tune` costs beside plain fits and forecasts, one after the other.

The three irregular runs of the virtual tank are played and prepared. `seakeep.tune` judges about a
hundred settings by free runs on each run, held out in turn. Every tenth of them is also fitted with
`HankelDMDc.fit` and forecast with `model.forecast`, window by window, in the same process; the cost
of all is taken to be ten times that. Processor seconds are compared, so that other work on the
machine counts for neither.

    OPENBLAS_NUM_THREADS=1 python benchmarks/tuning_on_tank.py [--campaign CAMPAIGN.toml] [--out F]
"""

from __future__ import annotations

import argparse
import platform
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from alignment_on_tank import INPUTS, STATES, irregular_runs
from chain_on_tank import used

import seakeep
from seakeep.models.candidates import default_observables
from seakeep.models.selection import WORST

HORIZONS = (15.0, 45.0)
EVERY = 10
VARY = ("ridge", "observables", "lead", "input_delays", "state_delays")


def clocked(call):
    """What a call returns, and the processor seconds that it took."""
    start = time.process_time()
    found = call()
    return found, time.process_time() - start


def start_of_search(period, dt):
    """Settings that the search starts from."""
    samples = round(period / dt)
    return seakeep.HankelDMDc(
        state_delays=samples,
        input_delays=3 * samples,
        ridge="rollout",
        delay_rows="exact",
        lead=round(0.75 * samples),
        alignment=seakeep.ProbeAlignment(mode="dispersion", surge="predicted"),
    )


def settings_of(base, row, observables):
    """Settings of a row of the table."""
    kinds = str(row["observables"].values).split(", ")
    return replace(
        base,
        ridge=float(row["ridge"]),
        ridge_scale="per_snapshot",
        lead=int(row["lead"]),
        state_delays=int(row["state_delays"]),
        input_delays=int(row["input_delays"]),
        observables=tuple(each for each in observables if each.kind in kinds),
    )


def plain_score(spec, runs, first, horizons):
    """Mean NRMSE by fits and forecasts one after the other."""
    folds = []
    for held, run in runs.items():
        others = {name: each for name, each in runs.items() if name != held}
        model = spec.fit(others, STATES, INPUTS)
        instants, means = run["time"].values, []
        for steps in horizons:
            scores = []
            ahead = max(model.lead_samples - 1, 0)
            for at in range(first, instants.size - ahead - steps, steps):
                forecast = model.forecast(run, float(instants[at]), steps)
                measured = run[STATES].isel(time=slice(at + 1, at + 1 + steps))
                found = seakeep.metrics.nrmse(predicted=forecast, measured=measured)
                values = np.array([float(found[state]) for state in STATES])
                scores.append(np.nanmean(np.minimum(values, WORST)))
            means.append(np.mean(scores))
        folds.append(np.mean(means))
    return float(np.mean(folds))


def main(arguments=None):
    """Print the table, and write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    place = Path(__file__).parent / "results" / "tuning_on_tank.md"
    parser.add_argument("--campaign", type=Path, help="of a tank that was played; by default a new")
    parser.add_argument("--out", type=Path, default=place, help="file for the table")
    asked = parser.parse_args(arguments)
    if asked.campaign is None:
        period, runs = irregular_runs()
    else:
        campaign = seakeep.read_campaign(asked.campaign)
        names = [name for name in campaign.settings.runs if name.startswith("irregular")]
        period, prepared = campaign.encounter_period(), campaign.prepare(names)
        runs = {name: used(run) for name, run in prepared.items()}
    dt = next(iter(runs.values())).attrs["dt"]
    spec, observables = start_of_search(period, dt), default_observables(INPUTS, period)
    result, tuned = clocked(
        lambda: seakeep.tune(spec, runs, STATES, INPUTS, vary=VARY, horizon=HORIZONS)
    )
    recommended = seakeep.HankelDMDc.recommended(period, dt)
    _, chosen = clocked(lambda: recommended.fit(runs, STATES, INPUTS))
    table = result.table
    count = table.sizes["trial"]
    widest = replace(
        spec,
        ridge=1.0,
        observables=observables,
        lead=int(table["lead"].max()),
        state_delays=int(table["state_delays"].max()),
        input_delays=int(table["input_delays"].max() + table["lead"].max() - table["lead"].min()),
    )
    first = widest.fit(runs, STATES, INPUTS).history_samples - 1
    horizons = [round(each * period / dt) for each in HORIZONS]
    seconds, apart, sample = 0.0, 0.0, range(EVERY // 2, count, EVERY)
    for trial in sample:
        row = table.isel(trial=trial)
        made = settings_of(spec, row, observables)
        score, cost = clocked(lambda made=made: plain_score(made, runs, first, horizons))
        seconds += cost
        apart = max(apart, abs(score - float(row["score"])))
        print(f"{trial + 1:4d} of {count}: {cost:6.1f} s, score {score:.4f}", flush=True)
    plain = seconds * count / len(sample)
    text = (
        "# What tuning costs beside plain fits and forecasts\n\n"
        "Made by `python benchmarks/tuning_on_tank.py` on the three irregular runs of the virtual "
        f"tank, {HORIZONS[0]:g} and {HORIZONS[1]:g} encounter periods, one BLAS thread "
        f"({platform.machine()}, Python {platform.python_version()}).\n\n"
        "| | processor seconds |\n|---|---|\n"
        f"| `seakeep.tune`, {count} settings, each run held out in turn | {tuned:.0f} |\n"
        f"| fits and forecasts one after the other ({len(sample)} settings took {seconds:.0f}) | "
        f"{plain:.0f} |\n"
        f"| ratio | **{tuned / plain:.3f}** |\n"
        f"| `recommended`: choice of observables, λ and read-outs, and fit | {chosen:.0f} |\n\n"
        f"The scores of these {len(sample)} settings differ by {apart:.1e} at most: a search "
        "trains all of them on the snapshot pairs of the longest delays, and its alignment learns "
        "the band of the waves from all runs. With the same delays and no alignment they agree to "
        "1e-10 (`tests/test_tuning.py`).\n"
    )
    print(text)
    asked.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
