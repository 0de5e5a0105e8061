"""Growth of time and memory against the count of operations and bytes: ``run.py --only scaling``.

One length at a time is varied around the problem of the paper's size, on one BLAS thread. Times are
the least processor time of a few repetitions; memory is the peak of what Python and NumPy hold,
Beside each measured line stands its model:
operations at the rate of a large matrix product on this machine, the limit of the core, and numbers
held times eight bytes.
"""

from __future__ import annotations

import dataclasses
import json
import time
import tracemalloc
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import timing
from problem import DT, RIDGE, STEPS, as_run, linear_system, names
from threadpoolctl import threadpool_limits

import seakeep
from seakeep.core import identify, rollout, training_window
from seakeep.core.embedding import BLOCK_WIDTH
from seakeep.core.rollout import _doublings as doublings
from seakeep.core.rollout import _shifting_steps as shifting_steps
from seakeep.report.style import COLOURS, figure_style, new_figure, save_figure

PIECE = 4_000_000
"""Numbers, about, that a piece of a long run holds at once (``seakeep.core.rollout``)."""


@dataclass(frozen=True)
class Size:
    """Lengths of a problem: N, Q, s, z, m, windows and steps of the forecast, members."""

    states: int = 11
    inputs: int = 2
    s: int = 32
    z: int = 160
    m: int = 640
    windows: int = 1
    steps: int = STEPS
    members: int = 1

    @property
    def extended(self) -> int:
        """Rows of the extended state, a."""
        return self.states * (self.s + 1)

    @property
    def regressors(self) -> int:
        """Regressors, p."""
        return self.extended + self.inputs * (self.z + 1)


AXES: dict[str, tuple[str, str, tuple[int, ...]]] = {
    "m": ("training length m [samples]", "fit", (320, 640, 1280, 2560, 5120)),
    "s": ("state delays s [samples]", "fit", (8, 16, 32, 64, 96)),
    "z": ("input delays z [samples]", "fit", (40, 80, 160, 320, 640)),
    "states": ("states N", "fit", (3, 6, 11, 22, 33)),
    "members": ("members", "ensemble", (5, 10, 20, 40)),
    "steps": ("horizon [steps]", "forecast", (120, 480, 1920, 7680, 30720)),
    "windows": ("windows side by side", "forecast", (1, 3, 10, 30, 100)),
}


def fit_operations(size: Size, rows: str) -> float:
    """Additions and multiplications of a fit (benchmarks/README.md)."""
    p, a, n, width = size.regressors, size.extended, size.m - 1, size.states + size.inputs
    primal = 2 * width * p * n + 3 * p * p + p**3 / 3
    if rows == "ridge":
        rank = 2 * width + 2
        return primal + 2 * p * p * (rank + size.states) + 2 * rank * p * a + a * p
    dual = 2 * width * n * n + n**3 / 3 + 2 * size.states * n * n + 2 * size.states * p * n
    return dual if p > n else primal + 2 * size.states * p * p


def forecast_operations(size: Size, rows: str) -> float:
    """Additions and multiplications of the free runs (benchmarks/README.md)."""
    a, b, w, steps = size.extended, size.inputs * (size.z + 1), size.windows, size.steps
    if rows == "exact":
        return 2 * size.states * (a + b) * steps * w
    if w == 1:
        times = doublings(a, b, 1, steps)
        once = 2 * a * (a + b) / 2**times + 2 * size.states * (a + b)
        powers = times * 2 * a * a * (a + b)
        return min(2 * a * (a + b) * steps, powers + once * steps)
    times = doublings(a, b, w, steps)
    blocks = steps / 2**times
    powers = times * 2 * a * a * (a + b)
    return powers + 2 * a * (a + b) * w * blocks + 2 * size.states * (a + b) * w * steps


def fit_bytes(size: Size, rows: str) -> float:
    """What a fit holds: a Gram matrix, coefficients, and the solutions that H is made of."""
    p, a, n, width = size.regressors, size.extended, size.m - 1, size.states + size.inputs
    lags = n * (2 * BLOCK_WIDTH + 2 * width)
    if rows == "ridge":
        return 8 * (p * p + (a + size.states) * p + a * p + 4 * (2 * width + 2) * p + lags)
    return 8 * (min(p, n) ** 2 + 4 * size.states * p + lags)


def forecast_bytes(size: Size, rows: str) -> float:
    """What free runs hold: the result twice over, and what propagates it."""
    a, b = size.extended, size.inputs * (size.z + 1)
    result = 2 * size.steps * size.windows * size.states
    if rows == "exact":
        K = shifting_steps(size.states, size.steps)
        block = (K + 1) * size.states
        rows = size.steps * size.windows / K
        return 8 * (result + block * (a + b) + rows * (b + K * size.states))
    times = doublings(a, b, size.windows, size.steps)
    whole = size.windows * size.steps * (a + b) / 2**times
    return 8 * (result + 2 * a * (a + b) + min(whole, PIECE))


class Case:
    """A problem of some size: its series, its model, and the calls to be measured."""

    def __init__(self, size: Size, rows: str) -> None:
        self.size, self.rows = size, rows
        reach = max(size.s, size.z)
        length = size.m + reach + size.steps + 2 * size.windows + 8
        # The series of members are those of the paper's size, long enough for its priors.
        self.problem = linear_system(max(2 * length, 4608), size.states, size.inputs)
        self.x, self.u = self.problem.states, self.problem.inputs

    def fit(self) -> np.ndarray:
        """[Â B̂] from the window of m snapshots."""
        size = self.size
        window = training_window(self.problem.stop, size.m, size.s, size.z, "before")
        return identify(
            [self.x],
            [self.u],
            [window],
            state_delays=size.s,
            input_delays=size.z,
            ridge=RIDGE,
            all_rows=self.rows == "ridge",
        ).coefficients

    def forecast(self) -> Callable[[], np.ndarray]:
        """Free runs of a model that is already there."""
        size, coefficients = self.size, self.fit()
        a, b = coefficients[:, : size.extended], coefficients[:, size.extended :]
        starts = self.problem.stop + np.arange(size.windows)
        histories = np.stack([self.x[k - size.s : k + 1] for k in starts])
        inputs = np.stack([self.u[k - size.z : k + size.steps] for k in starts])

        def call() -> np.ndarray:
            return rollout(a, b, histories, inputs, n_states=size.states)

        return call

    def ensemble(self) -> Callable[[], object]:
        """Members of the paper's priors, identified and forecast."""
        stop = self.problem.stop * DT
        paper = seakeep.BayesianHankelDMDc.paper(32 * DT, DT, n_members=self.size.members)
        run = as_run(self.problem)
        spec = dataclasses.replace(paper, delay_rows=self.rows)
        fitted = spec.fit(run, *names(), stop=stop)
        return lambda: fitted.forecast_summary(run, start=stop, steps=self.size.steps)

    def call(self, kind: str) -> Callable[[], object]:
        """What is measured."""
        return self.fit if kind == "fit" else getattr(self, kind)()

    def model(self, kind: str) -> tuple[float, float]:
        """Operations and bytes."""
        size, rows = self.size, self.rows
        if kind == "fit":
            return fit_operations(size, rows), fit_bytes(size, rows)
        if kind == "forecast":
            return forecast_operations(size, rows), forecast_bytes(size, rows)
        one = fit_operations(size, rows) + forecast_operations(size, rows)
        held = max(fit_bytes(size, rows), forecast_bytes(size, rows))
        # All members' series, and a copy that is put in order for the quantiles.
        return size.members * one, held + 2 * 8 * size.members * size.steps * size.states


@dataclass(frozen=True)
class Point:
    """One measured length.

    Parameters
    ----------
    value : int
        The length.
    seconds, mebibytes : float
        Measured.
    limit, held : float
        The model's: operations at the rate of the core, s, and bytes, MiB.
    """

    value: int
    seconds: float
    mebibytes: float
    limit: float
    held: float


def measure(axis: str, rows: str, rate: float, repeats: int) -> list[Point]:
    """Vary one length.

    Parameters
    ----------
    axis : str
        A key of ``AXES``.
    rows : {"ridge", "exact"}
        Delay rows.
    rate : float
        Operations a second of a large matrix product.
    repeats : int
        Repetitions; the least counts.
    """
    _, kind, values = AXES[axis]
    points = []
    for value in values:
        case = Case(dataclasses.replace(Size(), **{axis: value}), rows)
        call = case.call(kind)
        call()
        taken = []
        for _ in range(repeats):
            begin = time.process_time()
            call()
            taken.append(time.process_time() - begin)
        operations, held = case.model(kind)
        peak = _peak(case, kind)
        points.append(Point(value, min(taken), peak, operations / rate, held / 2**20))
    return points


def _peak(case: Case, kind: str) -> float:
    call = case.call(kind)
    tracemalloc.start()
    call()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 2**20


def exponent(points: list[Point], what: str) -> float:
    """Slope of the line through the upper half of the points, both scales logarithmic."""
    upper = points[len(points) // 2 :]
    x = np.log([point.value for point in upper])
    return float(np.polyfit(x, np.log([getattr(point, what) for point in upper]), 1)[0])


def run(out: Path, repeats: int = 7) -> str:
    """Measure all lengths, write ``scaling.json``, ``scaling.md`` and the figures.

    Parameters
    ----------
    out : Path
        Folder of the results.
    repeats : int, optional
        Repetitions; the least counts.

    Returns
    -------
    str
        The Markdown.
    """
    with threadpool_limits(1):
        facts = timing.machine()
        rate = 1e9 * facts["gemm_gflops"]
        found = {
            axis: {rows: measure(axis, rows, rate, repeats) for rows in ("ridge", "exact")}
            for axis in AXES
        }
    out.mkdir(parents=True, exist_ok=True)
    plain = {
        axis: {k: [asdict(p) for p in v] for k, v in each.items()} for axis, each in found.items()
    }
    (out / "scaling.json").write_text(
        json.dumps({"machine": facts, "points": plain}, indent=1), "utf-8"
    )
    for what, model, label in (
        ("seconds", "limit", "time [ms]"),
        ("mebibytes", "held", "peak memory [MiB]"),
    ):
        draw(found, what, model, label, out / f"scaling_{what}")
    text = table(found, facts)
    (out / "scaling.md").write_text(text, "utf-8")
    return text


def table(found: dict[str, dict[str, list[Point]]], facts: dict[str, object]) -> str:
    """Exponents and the part of the core's limit that is reached, as Markdown."""
    lines = [
        timing.describe(facts),
        "",
        "Exponents over the upper half of each range; in brackets those of the model. Reached: "
        "operations of the model at the rate of a large matrix product, over the time, at the "
        "largest length.",
        "",
        "| what grows | range | delay rows | time | memory | reached |",
        "|---|---|---|---|---|---|",
    ]
    for axis, (label, kind, values) in AXES.items():
        for rows, points in found[axis].items():
            slopes = [
                f"{exponent(points, measured):.2f} ({exponent(points, model):.2f})"
                for measured, model in (("seconds", "limit"), ("mebibytes", "held"))
            ]
            lines.append(
                f"| {label.split(' [')[0]} ({kind}) | {values[0]}–{values[-1]} | {rows} | "
                f"{' | '.join(slopes)} | {100 * points[-1].limit / points[-1].seconds:.0f} % |"
            )
    return "\n".join(lines) + "\n"


def draw(
    found: dict[str, dict[str, list[Point]]], what: str, model: str, label: str, path: Path
) -> None:
    """One panel a length; lines differ in colour, mark and dash."""
    looks = {
        "ridge": {"color": COLOURS["forecast"], "marker": "o"},
        "exact": {"color": COLOURS["ensemble"], "marker": "s"},
    }
    factor = 1e3 if what == "seconds" else 1.0
    with figure_style():
        figure = new_figure(10.0, 5.4)
        panels = figure.subplots(2, 4).ravel()
        for panel, (axis, (name, kind, _)) in zip(panels, AXES.items(), strict=False):
            for rows, points in found[axis].items():
                x = [point.value for point in points]
                look = looks[rows]
                measured = [factor * getattr(point, what) for point in points]
                panel.loglog(x, measured, **look, markersize=4, linewidth=1.4)
                panel.loglog(
                    x,
                    [factor * getattr(point, model) for point in points],
                    color=look["color"],
                    linewidth=1.0,
                    linestyle=(0, (4, 2)),
                )
            panel.set_title(kind)
            panel.set_xlabel(name)
            panel.set_xticks(x, [str(value) for value in x])
            low, high = panel.get_ylim()
            steps = (1, 10, 100) if high / low > 100 else (1, 2, 5)
            steps = (1, 1.5, 2, 3, 4, 5, 7) if high / low < 4 else steps
            decades = 10.0 ** np.arange(-2, 5)
            ticks = sorted({d * k for d in decades for k in steps if low <= d * k <= high})
            panel.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
            panel.minorticks_off()
        for panel in panels[::4]:
            panel.set_ylabel(label)
        last = panels[-1]
        last.axis("off")
        for rows, look in looks.items():
            last.plot([], [], **look, markersize=4, label=f"delay rows '{rows}', measured")
        for rows, look in looks.items():
            limit = "at the core's peak" if what == "seconds" else "numbers held"
            last.plot(
                [], [], color=look["color"], linestyle=(0, (4, 2)), label=f"'{rows}', {limit}"
            )
        last.legend(loc="center", fontsize=9)
        for suffix in (".png", ".svg"):
            save_figure(figure, path.with_suffix(suffix))


if __name__ == "__main__":
    print(run(Path("benchmarks/results")))
