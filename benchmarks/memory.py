"""Peak memory of long forecasts and of many members: ``python benchmarks/memory.py``.

Each case runs in a process of its own. The peak is set back before the call (Linux), so that what
making the run took does not hide it; what the process held then (the run, the imports) and the size
of the result are printed beside the growth.
"""

from __future__ import annotations

import dataclasses
import json
import multiprocessing
import re
import time
from pathlib import Path

import numpy as np
from problem import DT, Problem, as_run, linear_system, names

import seakeep
from seakeep.executor import one_blas_thread

MIB = 2**20


def long_forecast(steps: int, delay_rows: str) -> dict:
    """One model of the paper's size, a free run of many steps."""
    base = linear_system()
    repeats = -(-(steps + base.stop + 2) // len(base.inputs))
    states, inputs = (np.tile(series, (repeats, 1)) for series in (base.states, base.inputs))
    run = as_run(Problem(states, inputs, base.stop))
    del states, inputs
    paper = seakeep.HankelDMDc.paper(encounter_period=32 * DT, dt=DT)
    spec = dataclasses.replace(paper, delay_rows=delay_rows)
    model = spec.fit(run, *names(), stop=base.stop * DT)
    before, begin = _held(), time.perf_counter()
    result = model.forecast(run, start=base.stop * DT, steps=steps)
    return _report(before, begin, result, f"{steps} steps, delay_rows='{delay_rows}'")


def many_members(members: int, delay_rows: str, small: bool) -> dict:
    """An ensemble's summary over 480 steps."""
    base = linear_system(states=3 if small else 11, inputs=1 if small else 2)
    run = as_run(base)
    paper = seakeep.BayesianHankelDMDc.paper(encounter_period=32 * DT, dt=DT, n_members=members)
    if small:
        delays = {
            "state_delays": seakeep.Uniform("0.1 T", "0.4 T"),
            "input_delays": seakeep.Uniform("0.2 T", "1 T"),
        }
        paper = dataclasses.replace(paper, window=seakeep.Uniform("5 T", "10 T"), **delays)
    spec = dataclasses.replace(paper, delay_rows=delay_rows)
    channels = names(base.states.shape[1], base.inputs.shape[1])
    ensemble = spec.fit(run, *channels, stop=base.stop * DT)
    before, begin = _held(), time.perf_counter()
    result = ensemble.forecast_summary(run, start=base.stop * DT, steps=480)
    size = "3 states, short delays" if small else "11 states, the paper's priors"
    return _report(before, begin, result, f"{members} members, {size}, '{delay_rows}'")


def _held() -> float:
    """Memory that is held now, MiB; the peak begins again here."""
    Path("/proc/self/clear_refs").write_text("5", "ascii")
    return _status("VmRSS")


def _status(name: str) -> float:
    found = re.search(rf"{name}:\s+(\d+) kB", Path("/proc/self/status").read_text("ascii"))
    return int(found[1]) / 1024


def _report(before: float, begin: float, result: object, name: str) -> dict:
    return {
        "case": name,
        "seconds": round(time.perf_counter() - begin, 1),
        "held before, MiB": round(before, 1),
        "growth of the peak, MiB": round(_status("VmHWM") - before, 1),
        "result, MiB": round(result.nbytes / MIB, 1),
    }


def _work(call) -> dict:
    function, *arguments = call
    with one_blas_thread():
        return function(*arguments)


def main() -> None:
    """Run the cases one after the other."""
    cases = [
        (long_forecast, 10_000, "exact"),
        (long_forecast, 1_000_000, "exact"),
        (long_forecast, 100_000, "ridge"),
        (long_forecast, 1_000_000, "ridge"),
        (many_members, 100, "exact", True),
        (many_members, 10_000, "exact", True),
        (many_members, 100, "exact", False),
        (many_members, 1_000, "exact", False),
        (many_members, 10_000, "exact", False),
        (many_members, 10_000, "ridge", False),
    ]
    context = multiprocessing.get_context("spawn")
    for case in cases:
        with context.Pool(1) as pool:
            print(json.dumps(pool.apply(_work, (case,))), flush=True)


if __name__ == "__main__":
    main()
