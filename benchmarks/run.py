"""Time seakeep against the paper's formula and other packages: ``python benchmarks/run.py``."""

from __future__ import annotations

import argparse
import dataclasses
import itertools
from pathlib import Path

import numpy as np
import peers
import reference
import scaling
import timing
from problem import (
    DT,
    INPUT_DELAYS,
    RIDGE,
    SNAPSHOTS,
    STATE_DELAYS,
    STEPS,
    as_run,
    linear_system,
    names,
)

import seakeep


def one_model(history: str, with_peers: bool):
    """Contenders of fit + forecast of 480 steps, and their accuracy."""
    problem = linear_system()
    run = as_run(problem)
    states, inputs = names()
    start = problem.stop

    def plain():
        model = reference.fit(
            problem.states,
            problem.inputs,
            problem.stop,
            m=SNAPSHOTS,
            s=STATE_DELAYS,
            z=INPUT_DELAYS,
            ridge=RIDGE,
            history=history,
        )
        return reference.forecast(model, problem.states, problem.inputs, start, STEPS)

    after = slice(start + 1, start + STEPS)

    def package(delay_rows, arrays=False):
        spec = seakeep.HankelDMDc(
            state_delays=STATE_DELAYS,
            input_delays=INPUT_DELAYS,
            ridge=RIDGE,
            window=SNAPSHOTS,
            history=history,
            delay_rows=delay_rows,
        )

        def call():
            model = spec.fit(run, states, inputs, stop=problem.stop * DT)
            if arrays:
                x, u = problem.states[: start + 1], problem.inputs[: start + 1]
                return model.forecast_arrays(x, u, problem.inputs[after], STEPS)
            return model.forecast(run, start=start * DT, steps=STEPS)

        return call

    contenders = {
        "plain NumPy, the paper's formula": plain,
        "seakeep, delay_rows='ridge'": package("ridge"),
        "seakeep, delay_rows='exact'": package("exact"),
        "seakeep, delay_rows='ridge', forecast_arrays": package("ridge", arrays=True),
        "seakeep, delay_rows='exact', forecast_arrays": package("exact", arrays=True),
    }
    if with_peers:
        contenders |= peers.contenders(problem, history)
    return contenders, problem


def plain_cells(draws, deterministic: bool, problem, stops, starts):
    """Plain NumPy over all training windows, models and test windows."""
    chosen = [
        draws[f"{name}_samples"].values.tolist()
        for name in ("window", "state_delays", "input_delays")
    ]
    settings = [*zip(*chosen, draws.ridge.values.tolist(), strict=True)]
    if deterministic:
        settings.append((SNAPSHOTS, STATE_DELAYS, INPUT_DELAYS, RIDGE))

    def call():
        for stop, (m, s, z, ridge) in itertools.product(stops, settings):
            model = reference.fit(problem.states, problem.inputs, stop, m=m, s=s, z=z, ridge=ridge)
            for start in starts:
                reference.forecast(model, problem.states, problem.inputs, start, STEPS)

    return call


def forecast_cells(ensemble, model, run, stops, starts) -> None:
    """The same with the package: an ensemble, and perhaps a model, per training window."""
    for stop in stops:
        fitted = ensemble.fit(run, *names(), stop=stop)
        fitted.summarize_windows(run, starts, STEPS)
        if model is not None:
            one = model.fit(run, *names(), stop=stop)
            one.forecast_windows(run, starts, STEPS)


def members(
    count: int,
    windows: int,
    trainings: int = 1,
    deterministic: bool = False,
):
    """Contenders of ensembles: the same draws, forecast from one or several starts.

    With several training windows and the deterministic model beside the draws these are the cells
    of the paper's study; plain NumPy also identifies once per training window and draw.
    """
    spacing = SNAPSHOTS // 4
    problem = linear_system(samples=4608 + 2 * (trainings - 1) * spacing)
    run = as_run(problem)
    stops = problem.stop - spacing * np.arange(trainings)[::-1]
    first = problem.stop + 400
    starts = np.linspace(first, len(problem.states) - STEPS - 2, windows).astype(int)
    paper = seakeep.BayesianHankelDMDc.paper(encounter_period=32 * DT, dt=DT, n_members=count)
    one = seakeep.HankelDMDc.paper(encounter_period=32 * DT, dt=DT) if deterministic else None

    def package(delay_rows):
        changes = {"delay_rows": delay_rows}
        spec = dataclasses.replace(paper, **changes)
        single_model = None if one is None else dataclasses.replace(one, **changes)
        return lambda: forecast_cells(spec, single_model, run, stops * DT, starts * DT)

    draws = paper.fit(run, *names(), stop=stops[0] * DT).draws
    plain = plain_cells(draws, deterministic, problem, stops, starts)
    contenders = {"plain NumPy, loops over the same cells": plain}
    for delay_rows in ("ridge", "exact"):
        contenders[f"seakeep, delay_rows='{delay_rows}'"] = package(delay_rows)
    return contenders


def accuracy(contenders, problem) -> dict[str, float]:
    """ANRMSE of each contender over the forecast."""
    measured = problem.states[problem.stop + 1 : problem.stop + 1 + STEPS]
    out = {}
    for name, call in contenders.items():
        error = np.sqrt(np.mean((as_array(call()) - measured) ** 2, axis=0))
        out[name] = float(np.mean(error / measured.std(axis=0, ddof=1)))
    return out


def as_array(result) -> np.ndarray:
    """States of a forecast side by side, shape (steps, N)."""
    if isinstance(result, np.ndarray):
        return result
    return np.stack([result[state].values for state in names()[0]], axis=1)


def read_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    parser.add_argument("--rounds", type=int, default=31, help="repetitions of one model")
    parser.add_argument("--many-rounds", type=int, default=7, help="repetitions of ensembles")
    parser.add_argument("--members", type=int, default=100, help="members of the ensemble")
    parser.add_argument(
        "--study-members", type=int, default=10, help="draws of the study; the paper's is 100"
    )
    parser.add_argument(
        "--trainings", type=int, default=1, help="training windows of the study; the paper's is 10"
    )
    parser.add_argument("--study-rounds", type=int, default=3, help="repetitions of the study")
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("benchmarks/results"),
        help="folder of the tables and figures; the default holds those that are published",
    )
    parser.add_argument("--no-peers", action="store_true", help="leave other packages out")
    parts = ["one", "ensemble", "study", "scaling"]
    parser.add_argument("--only", choices=parts, help="one part alone; the others are kept")
    return parser.parse_args()


def main() -> None:
    """Run what the command line asks for."""
    arguments = read_arguments()
    if arguments.only == "scaling":
        print(scaling.run(arguments.out))
        return
    sections, notes, survey = {}, {}, {}
    if arguments.only in (None, "one"):
        for history in ("inside", "before"):
            contenders, problem = one_model(history, not arguments.no_peers)
            title = f"Fit and forecast of {STEPS} steps, history {history}"
            sections[title] = timing.interleave(contenders, arguments.rounds)
            notes[title] = accuracy(contenders, problem)
            if history == "inside":
                survey[title] = peers.SURVEY
    if arguments.only in (None, "ensemble"):
        title = f"Ensemble of {arguments.members}, one forecast each"
        contenders = members(arguments.members, 1)
        sections[title] = timing.interleave(contenders, arguments.many_rounds)
        if arguments.members == 100:
            survey[title] = peers.SURVEY_ENSEMBLE
    if arguments.only in (None, "study"):
        title = (
            f"Study: {arguments.trainings} training x 10 test windows x (1 + "
            f"{arguments.study_members}) models"
        )
        contenders = members(
            arguments.study_members,
            10,
            trainings=arguments.trainings,
            deterministic=True,
        )
        sections[title] = timing.interleave(contenders, arguments.study_rounds, memory=False)
    part = arguments.only is not None
    print(timing.write(arguments.out, sections, notes, survey, part))
    if arguments.only is None:
        print(scaling.run(arguments.out))


if __name__ == "__main__":
    main()
