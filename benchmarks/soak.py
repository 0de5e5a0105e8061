"""What long use and large requests cost: ``python benchmarks/soak.py [--part 1] [CASE ...]``.

Each case runs in a process of its own, with the seed 0. Times are of the processor. The table, with
machine and command, goes to ``results/soak.md`` where all cases run whole.
"""

from __future__ import annotations

import argparse
import multiprocessing
import platform
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from memory import _held, _status
from problem import DT, as_run, linear_system, names

import seakeep
from seakeep.executor import one_blas_thread
from seakeep.formats import read_columns

RESULT = Path(__file__).parent / "results" / "soak.md"
HEAD = "| case | CPU, s | held before, MiB | peak beyond it, MiB | growth in the last half, MiB |"
CAMPAIGN = """
[campaign]
name = "Wide"
encounter_period = 2.0

[model]
states = ["x0", "x1", "x2"]
inputs = ["x3"]
state_delays = 8
input_delays = 32
ridge = 1.0

[preparation]
sampling_rate = 10.0

[runs.wide]
file = "wide.h5"
train = [0, inf]
"""


def _model(members: int = 0) -> tuple:
    base = linear_system(states=3, inputs=1)
    run, channels = as_run(base), names(3, 1)
    if members:
        spec = seakeep.BayesianHankelDMDc(
            window=seakeep.Uniform("5 T", "10 T"),
            state_delays=seakeep.Uniform("0.1 T", "0.4 T"),
            input_delays=seakeep.Uniform("0.2 T", "1 T"),
            ridge=seakeep.LogUniform(0.1, 1),
            encounter_period=32 * DT,
            n_members=members,
            seed=0,
        )
    else:
        spec = seakeep.HankelDMDc(state_delays=8, input_delays=32, ridge=1.0)
    return base, run, spec.fit(run, *channels, stop=base.stop * DT)


def live_steps(part: float) -> tuple:
    """10^6 steps of a live model."""
    base, _, model = _model()
    live, count, held = model.live(), int(1e6 * part), _held()
    for number in range(count):
        at = number % len(base.inputs)
        live.step(base.inputs[at], base.states[at] if number % 1000 else None)
        if number == count // 2:
            half = _status("VmRSS")
    return f"{count} live steps, 3 states", held, half


def array_forecasts(part: float) -> tuple:
    """10^5 calls of `forecast_arrays`."""
    base, _, model = _model()
    past, steps = model.history_samples, 60
    known, coming = base.inputs[:past], base.inputs[past : past + steps]
    count, held = int(1e5 * part), _held()
    for number in range(count):
        model.forecast_arrays(base.states[:past], known, coming, steps)
        if number == count // 2:
            half = _status("VmRSS")
    return f"{count} calls of forecast_arrays, {steps} steps", held, half


def wide_campaign(part: float) -> tuple:
    """A run of 10^6 samples and 50 channels, prepared and fitted."""
    count, rng = int(1e6 * part), np.random.default_rng(0)
    with tempfile.TemporaryDirectory() as folder:
        with h5py.File(Path(folder, "wide.h5"), "w") as file:
            file["time"] = t = np.arange(count) * 0.1
            for number in range(50):
                wave = np.sin(2 * np.pi * 0.5 * t * rng.uniform(0.8, 1.2) + number)
                file[f"x{number}"] = wave + 0.1 * rng.standard_normal(count)
        tables = "".join(f'[channels.x{number}]\nunit = "m"\n' for number in range(50))
        path = Path(folder, "campaign.toml")
        path.write_text(CAMPAIGN + tables, encoding="utf-8")
        held = _held()
        run = seakeep.read_campaign(path).prepare()["wide"]
        spec = seakeep.HankelDMDc(state_delays=8, input_delays=32, ridge=1.0)
        spec.fit(run, ["x0", "x1", "x2"], ["x3"])
    return f"{count} samples of 50 channels: prepare and fit", held, None


def large_text(part: float) -> tuple:
    """A text file of 200 MB."""
    row = ("%.3f" + ",%+.4e" * 9 + "\n") % (0.1, *np.random.default_rng(0).standard_normal(9))
    with tempfile.TemporaryDirectory() as folder:
        path, rows = Path(folder, "large.csv"), int(200e6 * part / len(row))
        with path.open("w", encoding="ascii") as file:
            file.write("time," + ",".join(f"x{number}" for number in range(9)) + "\n")
            tail = row.partition(",")[2]
            file.writelines(f"{0.1 * number:.1f},{tail}" for number in range(rows))
        held, size = _held(), path.stat().st_size
        columns = read_columns(path)
    return f"text of {size / 1e6:.0f} MB, {len(columns.names)} columns", held, None


def many_members(part: float) -> tuple:
    """10^4 members: fit and summary."""
    held, count = _held(), int(1e4 * part)
    base, run, ensemble = _model(count)
    ensemble.forecast_summary(run, start=base.stop * DT, steps=480)
    return f"{count} members: fit, and forecast_summary of 480 steps", held, None


def long_forecast(part: float) -> tuple:
    """10^6 forecast steps."""
    base, _, model = _model()
    past, steps = model.history_samples, int(1e6 * part)
    coming = np.tile(base.inputs, (steps // len(base.inputs) + 1, 1))[:steps]
    held = _held()
    model.forecast_arrays(base.states[:past], base.inputs[:past], coming, steps)
    return f"{steps} forecast steps, 3 states", held, None


CASES: dict[str, Callable[[float], tuple]] = {
    "live_steps": live_steps,
    "array_forecasts": array_forecasts,
    "wide_campaign": wide_campaign,
    "large_text": large_text,
    "many_members": many_members,
    "long_forecast": long_forecast,
}


def _row(name: str, part: float) -> str:
    with one_blas_thread():
        begin = time.process_time()
        what, held, half = CASES[name](part)
        spent, peak, now = time.process_time() - begin, _status("VmHWM"), _status("VmRSS")
    growth = "" if half is None else f"{now - half:.1f}"
    return f"| {what} | {spent:.0f} | {held:.0f} | {peak - held:.0f} | {growth} |"


def main() -> None:
    """Run the cases one after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("cases", nargs="*", default=list(CASES))
    parser.add_argument("--part", type=float, default=1.0, help="of the counts, to try it")
    asked = parser.parse_args()
    rows = [HEAD, "|---|---:|---:|---:|---:|"]
    print(*rows, sep="\n", flush=True)
    for name in asked.cases:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            rows.append(pool.apply(_row, (name, asked.part)))
        print(rows[-1], flush=True)
    if asked.part == 1 and asked.cases == list(CASES):
        words = (
            "`python benchmarks/soak.py`, seed 0, on one core of an AMD EPYC with one BLAS thread; "
            f"Python {platform.python_version()}, NumPy {np.__version__}."
        )
        RESULT.write_text("\n".join([words, "", *rows, ""]), encoding="utf-8")


if __name__ == "__main__":
    main()
