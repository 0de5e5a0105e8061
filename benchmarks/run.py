"""Time seakeep against the paper's formula and other packages: ``python benchmarks/run.py``."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import reference
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

    def package(delay_rows):
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
            return model.forecast(run, start=start * DT, steps=STEPS)

        return call

    contenders = {
        "plain NumPy, the paper's formula": plain,
        "seakeep, delay_rows='ridge'": package("ridge"),
        "seakeep, delay_rows='exact'": package("exact"),
    }
    if with_peers:
        import peers

        contenders |= peers.contenders(problem, history)
    return contenders, problem


def accuracy(contenders, problem) -> dict[str, float]:
    """ANRMSE of each contender over the forecast."""
    measured = problem.states[problem.stop + 1 : problem.stop + 1 + STEPS]
    out = {}
    for name, call in contenders.items():
        result = call()
        if not isinstance(result, np.ndarray):
            result = np.stack([result[state].values for state in names()[0]], axis=1)
        error = np.sqrt(np.mean((result - measured) ** 2, axis=0))
        out[name] = round(float(np.mean(error / measured.std(axis=0, ddof=1))), 4)
    return out


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=31, help="repetitions (default 31)")
    parser.add_argument("--out", type=Path, default=Path("benchmarks/results"))
    parser.add_argument("--no-peers", action="store_true", help="leave other packages out")
    arguments = parser.parse_args()
    sections, notes = {}, {}
    for history in ("inside", "before"):
        contenders, problem = one_model(history, not arguments.no_peers)
        title = f"Fit and forecast of {STEPS} steps, history {history}"
        sections[title] = timing.interleave(contenders, arguments.rounds)
        notes[f"ANRMSE, history {history}"] = accuracy(contenders, problem)
    print(timing.write(arguments.out, sections, notes))


if __name__ == "__main__":
    main()
