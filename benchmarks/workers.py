"""Members on one worker, on threads and on processes: ``python benchmarks/workers.py``."""

from __future__ import annotations

import argparse
import dataclasses
import statistics
import time

from problem import DT, STEPS, as_run, linear_system, names

import seakeep


def main() -> None:
    """Print seconds and the gain over one worker; the start of processes counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--members", type=int, default=200)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    problem = linear_system()
    run, stop = as_run(problem), problem.stop * DT
    paper = seakeep.BayesianHankelDMDc.paper(
        encounter_period=32 * DT, dt=DT, n_members=arguments.members
    )
    for delay_rows in ("ridge", "exact"):
        spec = dataclasses.replace(paper, delay_rows=delay_rows)
        ensemble = spec.fit(run, *names(), stop=stop)
        ways = [(1, "threads"), (arguments.workers, "threads"), (arguments.workers, "processes")]
        taken: dict = {way: [] for way in ways}
        for _ in range(arguments.rounds):
            for workers, backend in ways:
                begin = time.perf_counter()
                ensemble.forecast_summary(
                    run, start=stop, steps=STEPS, workers=workers, backend=backend
                )
                taken[workers, backend].append(time.perf_counter() - begin)
        for (workers, backend), seconds in taken.items():
            gains = [a / b for a, b in zip(taken[ways[0]], seconds, strict=True)]
            print(
                f"{delay_rows:6} {workers} {backend:10} {statistics.median(seconds):7.2f} s  "
                f"{statistics.median(gains):.2f} × one ({min(gains):.2f}–{max(gains):.2f})"
            )


if __name__ == "__main__":
    main()
