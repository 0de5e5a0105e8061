"""Time seakeep against the paper's formula and other packages: ``python benchmarks/run.py``."""

from __future__ import annotations

import argparse
import dataclasses
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

    def package(delay_rows, precision="double"):
        spec = seakeep.HankelDMDc(
            state_delays=STATE_DELAYS,
            input_delays=INPUT_DELAYS,
            ridge=RIDGE,
            window=SNAPSHOTS,
            history=history,
            delay_rows=delay_rows,
            precision=precision,
        )

        def call():
            model = spec.fit(run, states, inputs, stop=problem.stop * DT)
            return model.forecast(run, start=start * DT, steps=STEPS)

        return call

    contenders = {
        "plain NumPy, the paper's formula": plain,
        "seakeep, delay_rows='ridge'": package("ridge"),
        "seakeep, delay_rows='exact'": package("exact"),
        "seakeep, delay_rows='ridge', single precision": package("ridge", "single"),
        "seakeep, delay_rows='exact', single precision": package("exact", "single"),
    }
    if with_peers:
        contenders |= peers.contenders(problem, history)
    return contenders, problem


def members(
    count: int, windows: int, workers: tuple[int, ...] = (1,), ridge=None, single: bool = False
):
    """Contenders of an ensemble: the same draws, forecast from one or several starts.

    `ridge` replaces the paper's prior of 50 to 150, where single precision is refused.
    """
    problem = linear_system(samples=4608)
    run = as_run(problem)
    states, inputs = names()
    stop = problem.stop * DT
    first = problem.stop + 400
    starts = np.linspace(first, len(problem.states) - STEPS - 2, windows).astype(int)
    paper = seakeep.BayesianHankelDMDc.paper(encounter_period=32 * DT, dt=DT, n_members=count)
    paper = paper if ridge is None else dataclasses.replace(paper, ridge=ridge)
    draws = paper.fit(run, states, inputs, stop=stop).draws

    def plain():
        for k in range(count):
            model = reference.fit(
                problem.states,
                problem.inputs,
                problem.stop,
                m=int(draws.train_length_samples[k]),
                s=int(draws.state_delay_samples[k]),
                z=int(draws.input_delay_samples[k]),
                ridge=float(draws.ridge[k]),
            )
            for start in starts:
                reference.forecast(model, problem.states, problem.inputs, start, STEPS)

    def package(delay_rows, number, precision="double"):
        spec = dataclasses.replace(paper, delay_rows=delay_rows, precision=precision)

        def call():
            ensemble = spec.fit(run, states, inputs, stop=stop)
            return ensemble.summarize_windows(run, starts * DT, STEPS, workers=number)

        return call

    contenders = {"plain NumPy, loops over the same cells": plain}
    for delay_rows in ("ridge", "exact"):
        for number in workers:
            text = f"seakeep, delay_rows='{delay_rows}'"
            text += "" if number == 1 else f", {number} workers"
            contenders[text] = package(delay_rows, number)
        if single:
            text = f"seakeep, delay_rows='{delay_rows}', single precision"
            contenders[text] = package(delay_rows, 1, "single")
    return contenders


def accuracy(contenders, problem) -> dict[str, float]:
    """ANRMSE of each contender over the forecast."""
    measured = problem.states[problem.stop + 1 : problem.stop + 1 + STEPS]
    out = {}
    for name, call in contenders.items():
        result = call()
        if not isinstance(result, np.ndarray):
            result = np.stack([result[state].values for state in names()[0]], axis=1)
        error = np.sqrt(np.mean((result - measured) ** 2, axis=0))
        out[name] = float(np.mean(error / measured.std(axis=0, ddof=1)))
    return out


def precision(arguments: argparse.Namespace) -> dict[str, list[timing.Timing]]:
    """Single beside double precision, with draws of λ where both are allowed."""
    out = {}
    for windows, count in ((1, arguments.members), (10, arguments.study_members)):
        title = f"Precision: {count} draws with λ of 100 to 200, forecasts a draw: {windows}"
        contenders = members(count, windows, ridge=seakeep.Uniform(100, 200), single=True)
        out[title] = timing.interleave(contenders, arguments.many_rounds)
    return out


def read_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=31, help="repetitions of one model")
    parser.add_argument("--many-rounds", type=int, default=7, help="repetitions of ensembles")
    parser.add_argument("--members", type=int, default=100, help="members of the ensemble")
    parser.add_argument(
        "--study-members",
        type=int,
        default=10,
        help="draws of the study's cells timed (one training window, ten test windows)",
    )
    parser.add_argument("--workers", type=int, default=2, help="workers compared with one")
    parser.add_argument("--out", type=Path, default=Path("benchmarks/results"))
    parser.add_argument(
        "--figures", type=Path, help="copy the figures of the scaling here, such as docs/figures"
    )
    parser.add_argument("--no-peers", action="store_true", help="leave other packages out")
    parts = ["one", "ensemble", "study", "single", "scaling"]
    parser.add_argument("--only", choices=parts, help="one part alone")
    return parser.parse_args()


def main() -> None:
    """Run what the command line asks for."""
    arguments = read_arguments()
    if arguments.only == "scaling":
        print(scaling.run(arguments.out, arguments.figures))
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
    numbers = (1,) if arguments.workers == 1 else (1, arguments.workers)
    if arguments.only in (None, "ensemble"):
        title = f"Ensemble of {arguments.members}, one forecast each"
        contenders = members(arguments.members, 1, numbers)
        sections[title] = timing.interleave(contenders, arguments.many_rounds)
        if arguments.members == 100:
            survey[title] = peers.SURVEY_ENSEMBLE
    if arguments.only in (None, "study"):
        title = f"Study: {arguments.study_members} draws, ten test windows each"
        contenders = members(arguments.study_members, 10, numbers)
        sections[title] = timing.interleave(contenders, arguments.many_rounds)
    if arguments.only in (None, "single"):
        sections |= precision(arguments)
    print(timing.write(arguments.out, sections, notes, survey))
    if arguments.only is None:
        print(scaling.run(arguments.out, arguments.figures))


if __name__ == "__main__":
    main()
