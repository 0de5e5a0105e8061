"""Realised waves and line loads of a played campaign, next to the paper's numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import pandas as pd

from seakeep.arrays import FloatArray, Progress
from seakeep.errors import RequestError
from seakeep.signals import (
    encounter_period,
    low_pass,
    significant_height,
    wave_heights,
    wave_spectrum,
)
from seakeep.signals.time_axis import over_gaps
from seakeep.signals.waves import paper_welch
from seakeep.tank.dynamics import Rig
from seakeep.tank.instruments import Played, record_run
from seakeep.tank.play import generator, play_run, truth
from seakeep.tank.settings import TankSettings
from seakeep.waves import group_speed, phase_speed, wavelength_to_frequency

PAPER = {
    "significant height": (0.16, 0.01, "m"),
    "zero-up-crossing period": (1.64, 0.05, "s"),
    "peak period (paper's Welch)": (1.98, 0.15, "s"),
    "height, wavelength 2.10 m": (0.105, 0.01, "m"),
    "height, wavelength 2.80 m": (0.107, 0.01, "m"),
    "height, wavelength 4.20 m": (0.116, 0.01, "m"),
}
"""The paper's realised waves, the tolerance we hold ours to, and the unit."""

MATRIX = ("h [m]", "λ/L", "phase speed [m/s]", "group speed [m/s]", "realised h [m]", "runs")
HULL_LENGTH = 1.40  # m, by which the paper divides wavelengths


@dataclass(frozen=True)
class Realised:
    """One run as measured by its forward probe (low-passed elevation), its start-up left out.

    The peak period is by the paper's Welch settings; `height` is the mean of the single waves'.
    `motions` has a row for each true motion and load, with its mean, its SD, and the part of the
    time for which a line was slack. SI.
    """

    run: str
    irregular: bool
    elevation: FloatArray
    dt: float
    significant_height: float
    zero_up_period: float
    peak_period: float
    height: float
    height_spread: float
    motions: pd.DataFrame


def paper_peak(elevation: npt.ArrayLike, dt: float) -> tuple[float, FloatArray, FloatArray]:
    """Peak period by the paper's Welch settings, with the frequencies and the spectrum."""
    frequency, density = wave_spectrum(elevation, dt, *paper_welch(dt))
    return float(1.0 / frequency[np.argmax(density)]), frequency, density


def realise_runs(
    settings: TankSettings, rig: Rig, names: Sequence[str], progress: Progress
) -> list[Realised]:
    """Play runs, and measure each as the paper measures it; raises as :func:`realise`."""
    measured = []
    for done, name in enumerate(names):
        progress(done, len(names), name)
        measured.append(realise(play_run(settings, name, rig), name))
    progress(len(names), len(names), "done")
    return measured


def realise(played: Played, name: str) -> Realised:
    """Measure one run as the paper measures it.

    Raises RequestError if the settings have no wave probe.
    """
    settings, run = played.settings, played.settings.runs[name]
    probes = settings.instruments.probes
    if not probes:
        raise RequestError("no wave probe is set. Add a table under [instruments.probes].")
    forward = min(probes, key=lambda n: (probes[n].position, probes[n].noise))
    record = record_run(played, generator(settings, name, "instruments"))["wave_probes"]
    dt = 1.0 / settings.instruments.clocks["wave_probes"].rate
    edges = (10.0, 10.75) if dt < 1 / 22 else (0.4 / dt, 0.45 / dt)
    low_passed = low_pass(over_gaps(1e-3 * record[forward].values), dt, *edges)
    eta = low_passed[record["time"].values >= run.startup]
    true = truth(played, name)
    true = true.isel(time=true["time"].values >= run.startup)
    true["surge_fast"] = true["surge"] - true["surge_slow"]
    loads = [f"mooring_{line}" for line in played.rig.line_names]
    motions = true[[*played.rig.names, "surge_fast", *loads]].to_dataframe()
    heights = wave_heights(eta, dt)
    return Realised(
        run=name,
        irregular=run.spectrum is not None,
        elevation=eta,
        dt=dt,
        significant_height=significant_height(eta),
        zero_up_period=encounter_period(eta, dt),
        peak_period=paper_peak(eta, dt)[0],
        height=float(heights.mean()),
        height_spread=float(heights.std(ddof=1)),
        motions=pd.DataFrame(
            {
                "mean": motions.mean(),
                "SD": motions.std(ddof=0),
                "slack": (motions[loads] <= 0.0).mean(),
            }
        ).loc[motions.columns],
    )


def comparison(settings: TankSettings, realised: list[Realised]) -> pd.DataFrame:
    """Numbers that the paper states (index), their unit, ours, the paper's and the tolerance.

    Means over the irregular runs; the mean height of each regular run whose wavelength is one of
    the paper's.
    """
    seas = [each for each in realised if each.irregular]
    ours: dict[str, Any] = {}
    if seas:
        ours["significant height"] = np.mean([each.significant_height for each in seas])
        ours["zero-up-crossing period"] = np.mean([each.zero_up_period for each in seas])
        ours["peak period (paper's Welch)"] = np.mean([each.peak_period for each in seas])
    for each in realised:
        if (length := settings.runs[each.run].wavelength) is not None:
            ours[f"height, wavelength {length:.2f} m"] = each.height
    paper = pd.DataFrame.from_dict(PAPER, orient="index", columns=["paper", "tolerance", "unit"])
    paper.insert(0, "here", pd.Series(ours, dtype=float))
    return paper.dropna()[["unit", "here", "paper", "tolerance"]]


def matrix_rows(settings: TankSettings, realised: list[Realised]) -> list[dict[str, str]]:
    """Test matrix as in the paper's first table, one row per sea, with realised heights."""
    depth = settings.facility.water_depth
    rows: list[tuple[str, ...]] = []
    seas: dict[tuple[str, str], list[float]] = {}
    for each in realised:
        run = settings.runs[each.run]
        if run.spectrum is not None:
            high = run.nominal_height or run.spectrum.height
            stated = "" if high is None else f"{high:.2f}"
            kind = run.spectrum.kind.replace("_", "–").title()
            seas.setdefault((stated, kind), []).append(each.significant_height)
    for (nominal, kind), heights in seas.items():
        spread = np.std(heights, ddof=1) if len(heights) > 1 else 0.0
        height = f"{np.mean(heights):.3f} ± {spread:.3f}"
        rows.append((nominal, f"{kind} spectrum", "", "", height, str(len(heights))))
    for each in realised:
        run = settings.runs[each.run]
        if run.wavelength is not None:
            omega = wavelength_to_frequency(run.wavelength, depth)
            high, ratio = run.nominal_height or run.height, run.wavelength / HULL_LENGTH
            speeds = (f"{float(of(omega, depth)):.3f}" for of in (phase_speed, group_speed))
            height = f"{each.height:.3f} ± {each.height_spread:.3f}"
            rows.append((f"{high:.2f}", f"{ratio:g}", *speeds, height, "1"))
    return [dict(zip(MATRIX, row, strict=True)) for row in rows]
