"""One worker and several, of every kind: ``python benchmarks/workers.py``.

Members (an ensemble of the paper's size and its summary over 480 steps) and the cells of a study,
in interleaved rounds: one worker, threads, warm processes, and a Dask cluster of this machine's
own. The first call of a kind, which starts its workers, is told apart. Other work on the machine
spoils the gains in wall time, so its load is printed beside them, and a gain that it cannot spoil:
the processor time of one worker against that of this process and of the busiest worker together,
what free cores would give at least (not for threads, which share one interpreter).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import multiprocessing
import os
import pickle
import platform
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from problem import DT, STEPS, as_run, linear_system, names

import seakeep
from seakeep.models.workers import Crew, side_by_side
from seakeep.study import read_study, run_study

TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorial"
STUDY = """
[study]
campaign = "campaign.toml"
preset = "paper"
[training]
windows = 6
[models.bayesian]
kind = "bayesian_hankel_dmdc"
n_members = 60
train_length = { uniform = [10, 20] }
[tests.unseen]
runs = ["unseen"]
windows = 4
length = 8
[statistics]
n_series = 8
[output]
eigenvalues = false
"""


def nothing(data: object, item: int) -> int:
    """The smallest piece of work."""
    return item


@contextmanager
def dask_cluster(workers: int) -> Iterator[tuple[str, list[int]]]:
    """A scheduler and workers of one thread each, on loopback."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        here = ["--host", "127.0.0.1", "--no-dashboard"]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}

        def start(*words: str) -> subprocess.Popen:
            command = [sys.executable, "-m", "dask", *words, *here]
            with log.open("a") as file:
                return subprocess.Popen(
                    command, stderr=file, stdout=file, cwd=folder, env=environment
                )

        started = [start("scheduler", "--port", "0", "--dashboard-address", "127.0.0.1:0")]
        try:
            address = wait_for(log, r"Scheduler at:\s+(tcp://\S+)", 1)
            started += [
                start("worker", address, "--nthreads", "1", "--no-nanny") for _ in range(workers)
            ]
            wait_for(log, r"(Registered to)", workers)
            yield address, [process.pid for process in started[1:]]
        finally:
            for process in started:
                process.kill()
                process.wait()


def processor_time(processes: list[int]) -> dict[int, float]:
    """Seconds of processor time that processes have had so far (Linux)."""
    tick = os.sysconf("SC_CLK_TCK")
    found = {}
    for process in processes:
        fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
        found[process] = (int(fields[11]) + int(fields[12])) / tick
    return found


def wait_for(log: Path, pattern: str, times: int) -> str:
    """First match, once there are so many."""
    for _ in range(600):
        found = re.findall(pattern, log.read_text("utf-8"))
        if len(found) >= times:
            return found[0]
        time.sleep(0.1)
    raise RuntimeError(log.read_text("utf-8"))


def crews(workers: int, scheduler: str) -> dict[str, Crew]:
    """Who is compared; the first is the reference."""
    return {
        "1 worker": Crew(),
        f"{workers} threads": Crew(workers, "threads"),
        f"{workers} processes": Crew(workers, "processes"),
        f"{workers} Dask workers": Crew(scheduler=scheduler),
    }


def compare(
    what: str,
    kinds: dict[str, Crew],
    rounds: int,
    work: Callable[[Crew], object],
    on_dask: list[int],
) -> list[dict]:
    """Seconds of the first call and of the rounds after it, and the gains in each round."""
    first, taken, loads = {}, {name: [] for name in kinds}, []
    path = {name: [] for name in kinds}
    for name, crew in kinds.items():
        first[name] = seconds(work, crew)
    for _ in range(rounds):
        loads.append(os.getloadavg()[0])
        for name, crew in kinds.items():
            others = (
                on_dask if crew.scheduler else [c.pid for c in multiprocessing.active_children()]
            )
            before = processor_time([os.getpid(), *others])
            taken[name].append(seconds(work, crew))
            after = processor_time([os.getpid(), *others])
            own, *their = [after[process] - before[process] for process in before]
            path[name].append(own + max(their, default=0.0))
    rows = []
    for name, each in taken.items():
        gains = [a / b for a, b in zip(taken["1 worker"], each, strict=True)]
        rows.append(
            {
                "work": what,
                "crew": name,
                "first call, s": round(first[name], 2),
                "median, s": round(statistics.median(each), 3),
                "least, s": round(min(each), 3),
                "gain, median": round(statistics.median(gains), 2),
                "gain, least times": round(min(taken["1 worker"]) / min(each), 2),
                "gain, processor time": None
                if crew_has_no_processes(kinds[name])
                else round(statistics.median(path["1 worker"]) / statistics.median(path[name]), 2),
                "load": round(statistics.median(loads), 1),
            }
        )
        print(json.dumps(rows[-1]), flush=True)
    return rows


def crew_has_no_processes(crew: Crew) -> bool:
    """Whether all work is done in this process."""
    return crew.scheduler is None and (crew.workers == 1 or crew.backend == "threads")


def seconds(work: Callable[[Crew], object], crew: Crew) -> float:
    """Wall time of one call."""
    begin = time.perf_counter()
    work(crew)
    return time.perf_counter() - begin


def members(
    kinds: dict[str, Crew], delay_rows: str, count: int, rounds: int, on_dask: list[int]
) -> tuple[list[dict], int]:
    """An ensemble's summary; and the bytes that reach each worker."""
    problem = linear_system()
    run, stop = as_run(problem), problem.stop * DT
    paper = seakeep.BayesianHankelDMDc.paper(encounter_period=32 * DT, dt=DT, n_members=count)
    ensemble = dataclasses.replace(paper, delay_rows=delay_rows).fit(run, *names(), stop=stop)

    def work(crew: Crew) -> object:
        return ensemble.forecast_summary(run, stop, STEPS, **dataclasses.asdict(crew))

    sent = len(pickle.dumps(ensemble.arrays, protocol=5))
    return compare(f"{count} members, {delay_rows}", kinds, rounds, work, on_dask), sent


def cells(kinds: dict[str, Crew], rounds: int, on_dask: list[int]) -> list[dict]:
    """Cells of a small study of the tutorial's campaign, with all that comes before and after."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        for path in TUTORIAL.glob("*"):
            if path.suffix in (".toml", ".csv"):
                shutil.copy(path, place)
        (place / "study.toml").write_text(STUDY, "utf-8")
        study = read_study(place / "study.toml")

        def work(crew: Crew) -> None:
            shutil.rmtree(place / "out", ignore_errors=True)
            run_study(study, place / "out", workers=crew.workers, scheduler=crew.scheduler)

        own = {name: crew for name, crew in kinds.items() if crew.backend == "processes"}
        return compare("study, 6 ensembles of 60 on 4 windows", own, rounds, work, on_dask)


def overhead(kinds: dict[str, Crew]) -> dict[str, float]:
    """Milliseconds of a small item beyond its work."""
    count, out = 400, {}
    for name, crew in kinds.items():
        list(side_by_side(nothing, None, range(8), crew))
        begin = time.perf_counter()
        list(side_by_side(nothing, None, range(count), crew))
        long = time.perf_counter() - begin
        begin = time.perf_counter()
        list(side_by_side(nothing, None, range(1), crew))
        out[name] = round(1e3 * (long - (time.perf_counter() - begin)) / count, 3)
    return out


def main() -> None:
    """Print the rows and write them to ``results/workers.json``."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--members", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--rounds", type=int, default=5)
    arguments = parser.parse_args()
    with dask_cluster(arguments.workers) as (scheduler, on_dask):
        kinds = crews(arguments.workers, scheduler)
        rows, sent = [], 0
        for delay_rows in ("ridge", "exact"):
            more, sent = members(kinds, delay_rows, arguments.members, arguments.rounds, on_dask)
            rows += more
        rows += cells(kinds, arguments.rounds, on_dask)
        found = {
            "machine": platform.processor() or platform.machine(),
            "cores": os.cpu_count(),
            "python": platform.python_version(),
            "rows": rows,
            "overhead of a small item, ms": overhead(kinds),
            "training data, bytes a worker": sent,
        }
    print(json.dumps({key: each for key, each in found.items() if key != "rows"}))
    out = Path(__file__).parent / "results" / "workers.json"
    out.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
