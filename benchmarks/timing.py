"""Interleaved timing: every contender once a round, in turning order; ratios within rounds."""

from __future__ import annotations

import json
import platform
import statistics
import time
import tracemalloc
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
import threadpoolctl

PACKAGES = ("seakeep", "numpy", "scipy", "xarray", "scikit-learn", "pykoop", "nfoursid")


@dataclass(frozen=True)
class Timing:
    """What one contender took.

    Parameters
    ----------
    name : str
        The contender.
    milliseconds : float
        Median over the rounds.
    fastest : float
        Least of the rounds, ms.
    ratio, ratio_low, ratio_high : float
        Median, least and largest ratio to the reference of the same round.
    peak_mib : float or None
        Peak of what Python and NumPy allocated in one call, MiB, if it was measured.
    """

    name: str
    milliseconds: float
    fastest: float
    ratio: float
    ratio_low: float
    ratio_high: float
    peak_mib: float | None


def interleave(
    contenders: Mapping[str, Callable[[], object]], rounds: int, memory: bool = True
) -> list[Timing]:
    """Time the contenders against the first of them.

    Parameters
    ----------
    contenders : mapping of str to callable
        The first is the reference.
    rounds : int
        Repetitions.
    memory : bool, optional
        Whether to measure peak memory too, in one further call each.

    Returns
    -------
    list of Timing
        One a contender.
    """
    names = list(contenders)
    taken: dict[str, list[float]] = {name: [] for name in names}
    with threadpoolctl.threadpool_limits(1):
        for name in names:
            contenders[name]()
        for turn in range(rounds):
            shift = turn % len(names)
            for name in names[shift:] + names[:shift]:
                begin = time.perf_counter()
                contenders[name]()
                taken[name].append(1e3 * (time.perf_counter() - begin))
        peaks = {name: _peak(contenders[name]) if memory else None for name in names}
    reference = taken[names[0]]
    out = []
    for name in names:
        ratios = [own / base for own, base in zip(taken[name], reference, strict=True)]
        out.append(
            Timing(
                name,
                statistics.median(taken[name]),
                min(taken[name]),
                statistics.median(ratios),
                min(ratios),
                max(ratios),
                peaks[name],
            )
        )
    return out


def _peak(call: Callable[[], object]) -> float:
    tracemalloc.start()
    call()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 2**20


def machine() -> dict[str, object]:
    """Processor, BLAS and versions."""
    versions = {}
    for name in PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "not installed"
    processor = platform.processor() or platform.machine()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        processor = next(line.split(":")[1].strip() for line in lines if "model name" in line)
        cores = sum(line.startswith("processor") for line in lines)
    except (OSError, StopIteration):
        cores = 0
    blas = [
        f"{pool['internal_api']} {pool.get('version')} ({pool.get('architecture')})"
        for pool in threadpoolctl.threadpool_info()
        if pool["user_api"] == "blas"
    ]
    return {
        "processor": processor,
        "cores": cores,
        "blas": blas,
        "python": platform.python_version(),
        "versions": versions,
        "gemm_gflops": round(_rate(np.float64), 1),
        "gemm_gflops_single": round(_rate(np.float32), 1),
    }


def _rate(dtype: type) -> float:
    a = np.ones((768, 768), dtype)
    best = float("inf")
    with threadpoolctl.threadpool_limits(1):
        for _ in range(10):
            begin = time.perf_counter()
            a @ a
            best = min(best, time.perf_counter() - begin)
    return 2 * 768**3 / best / 1e9


def write(
    path: Path,
    sections: Mapping[str, list[Timing]],
    notes: Mapping[str, Mapping[str, float]],
    survey: Mapping[str, Mapping[str, float]],
    part: bool = False,
) -> str:
    """Write the tables as JSON and Markdown beside each other, and return the Markdown.

    Parameters
    ----------
    path : Path
        Folder.
    sections : mapping of str to list of Timing
        Tables by title.
    notes : mapping of str to mapping of str to float
        A number more a contender, by the title of its table: the accuracy.
    survey : mapping of str to mapping of str to float
        Milliseconds on another machine, by the title of their table.
    part : bool, optional
        Whether the other tables of the folder are kept.

    Returns
    -------
    str
        The Markdown.
    """
    facts = machine()
    path.mkdir(parents=True, exist_ok=True)
    if part and (path / "benchmark.json").exists():
        before = json.loads((path / "benchmark.json").read_text("utf-8"))
        old = {name: [Timing(**row) for row in rows] for name, rows in before["tables"].items()}
        sections = old | dict(sections)
        notes, survey = before["accuracy"] | dict(notes), before["survey"] | dict(survey)
    data = {name: [asdict(row) for row in rows] for name, rows in sections.items()}
    everything = {"machine": facts, "accuracy": dict(notes), "survey": dict(survey)}
    everything["tables"] = data
    (path / "benchmark.json").write_text(json.dumps(everything, indent=1), "utf-8")
    text = [describe(facts)]
    for name, rows in sections.items():
        beside, accuracy = survey.get(name, {}), notes.get(name, {})
        heads = ["", "ms (median)", "ms (least)", "ratio (median)", "range", "peak MiB"]
        heads += ["survey, ms"] * bool(beside) + ["ANRMSE"] * bool(accuracy)
        text += ["", f"### {name}", "", f"| {' | '.join(heads)} |", "|---" * len(heads) + "|"]
        for r in rows:
            peak = "–" if r.peak_mib is None else f"{r.peak_mib:.1f}"
            cells = [
                *(r.name, f"{r.milliseconds:.2f}", f"{r.fastest:.2f}", f"{r.ratio:.3f}"),
                *(f"{r.ratio_low:.3f}–{r.ratio_high:.3f}", peak),
            ]
            if beside:
                cells.append(f"{beside[r.name]:.0f}" if r.name in beside else "–")
            if accuracy:
                cells.append(f"{accuracy[r.name]:.3f}" if r.name in accuracy else "–")
            text.append(f"| {' | '.join(cells)} |")
    text += [
        "",
        "Peak: what Python and NumPy took in the process that calls; that of workers is their own.",
    ]
    if survey:
        text += [
            "",
            "Survey: milliseconds of an earlier comparison on another machine (54 GFLOP/s "
            "double); those of seakeep are of its prototype. Compare ratios, not times.",
        ]
    markdown = "\n".join(text) + "\n"
    (path / "benchmark.md").write_text(markdown, "utf-8")
    return markdown


def describe(facts: Mapping[str, object]) -> str:
    """One paragraph: processor, rates, versions."""
    versions = ", ".join(f"{name} {version}" for name, version in facts["versions"].items())
    return (
        f"Processor {facts['processor']}, {facts['cores']} cores; {', '.join(facts['blas'])}; one "
        f"BLAS thread: {facts['gemm_gflops']} GFLOP/s double, {facts['gemm_gflops_single']} "
        f"single; Python {facts['python']}; {versions}."
    )
