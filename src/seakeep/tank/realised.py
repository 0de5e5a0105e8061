"""Realised waves and line loads of a played campaign, next to the paper's numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from seakeep.arrays import FloatArray
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
from seakeep.tank.instruments import Played, record_run
from seakeep.tank.play import generator
from seakeep.tank.settings import TankSettings
from seakeep.waves import group_speed, phase_speed, wavelength_to_frequency

__all__ = ["PAPER", "Realised", "Row", "comparison", "matrix_rows", "paper_peak", "realise"]


PAPER = {
    "significant height": (0.16, 0.01, "m"),
    "zero-up-crossing period": (1.64, 0.05, "s"),
    "peak period (paper's Welch)": (1.98, 0.15, "s"),
    "height, wavelength 2.10 m": (0.105, 0.01, "m"),
    "height, wavelength 2.80 m": (0.107, 0.01, "m"),
    "height, wavelength 4.20 m": (0.116, 0.01, "m"),
}
"""The paper's realised waves, the tolerance we hold ours to, and the unit."""

HULL_LENGTH = 1.40  # m, by which the paper divides wavelengths


@dataclass(frozen=True)
class Realised:
    """One run as measured by its forward probe (low-passed elevation), its start-up left out.

    The peak period is by the paper's Welch settings; `height` is the mean of the single waves'.
    `slack` is the part of the time for which each line was slack, `spread` and `mean` the
    standard deviation and mean of each true motion and load. SI.
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
    slack: dict[str, float]
    spread: dict[str, float]
    mean: dict[str, float]


@dataclass(frozen=True)
class Row:
    """A realised number beside the paper's."""

    name: str
    unit: str
    ours: float
    paper: float
    tolerance: float

    @property
    def agrees(self) -> bool:
        """Whether ours lies within the tolerance."""
        return abs(self.ours - self.paper) <= self.tolerance


def paper_peak(elevation: npt.ArrayLike, dt: float) -> tuple[float, FloatArray, FloatArray]:
    """Peak period by the paper's Welch settings, with the frequencies and the spectrum."""
    frequency, density = wave_spectrum(elevation, dt, *paper_welch(dt))
    return float(1.0 / frequency[np.argmax(density)]), frequency, density


def _forward_probe(settings: TankSettings) -> str:
    probes = settings.instruments.probes
    if not probes:
        raise RequestError("no wave probe is set. Add a table under [instruments.probes].")
    return min(probes, key=lambda n: (probes[n].position, probes[n].noise))


def realise(played: Played, name: str) -> Realised:
    """Measure one run as the paper measures it."""
    settings, run = played.settings, played.settings.runs[name]
    probe = _forward_probe(settings)
    record = record_run(played, generator(settings, name, "instruments"))[0]
    dt = 1.0 / settings.instruments.clocks["wave_probes"].rate
    values = over_gaps(1e-3 * record.columns[probe].values)
    edges = (10.0, 10.75) if dt < 1 / 22 else (0.4 / dt, 0.45 / dt)
    eta = low_pass(values, dt, *edges)[record.time >= run.startup]
    time = played.rig.step * np.arange(int(played.length / played.rig.step) + 1, dtype=float)
    time = time[time >= run.startup]
    position, _, _ = played.states(time)
    loads = played.loads(time)
    channels = dict(zip(played.rig.names, position, strict=True))
    channels["surge_fast"] = position[0] - np.interp(
        time, played.motion.time, played.motion.slow_surge
    )
    channels |= {f"mooring_{n}": x for n, x in zip(played.rig.line_names, loads, strict=True)}
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
        slack={
            n: float(np.mean(x <= 0.0)) for n, x in zip(played.rig.line_names, loads, strict=True)
        },
        spread={n: float(x.std()) for n, x in channels.items()},
        mean={n: float(x.mean()) for n, x in channels.items()},
    )


def comparison(settings: TankSettings, realised: list[Realised]) -> list[Row]:
    """Numbers that the paper states, ours beside them.

    Means over the irregular runs; the mean height of each regular run whose wavelength is one of
    the paper's.
    """
    rows = []
    seas = [r for r in realised if r.irregular]
    means = {
        "significant height": [r.significant_height for r in seas],
        "zero-up-crossing period": [r.zero_up_period for r in seas],
        "peak period (paper's Welch)": [r.peak_period for r in seas],
    }
    for each in realised:
        length = settings.runs[each.run].wavelength
        if length is not None:
            means[f"height, wavelength {length:.2f} m"] = [each.height]
    for name, values in means.items():
        if values and name in PAPER:
            paper, tolerance, unit = PAPER[name]
            rows.append(Row(name, unit, float(np.mean(values)), paper, tolerance))
    return rows


def matrix_rows(settings: TankSettings, realised: list[Realised]) -> list[dict[str, str]]:
    """Test matrix as in the paper's first table, one row per sea, with realised heights."""
    depth = settings.facility.water_depth
    rows: list[dict[str, str]] = []
    seas: dict[tuple[str, str], list[Realised]] = {}
    for each in realised:
        run = settings.runs[each.run]
        if run.spectrum is not None:
            high = run.nominal_height or run.spectrum.height
            stated = "" if high is None else f"{high:.2f}"
            seas.setdefault((stated, run.spectrum.kind.replace("_", "–").title()), []).append(each)
    for (nominal, kind), runs in seas.items():
        values = np.array([r.significant_height for r in runs])
        spread = values.std(ddof=1) if values.size > 1 else 0.0
        rows.append(
            _row(nominal, f"{kind} spectrum", "", "", f"{values.mean():.3f} ± {spread:.3f}", runs)
        )
    for each in realised:
        run = settings.runs[each.run]
        if run.wavelength is None:
            continue
        omega = wavelength_to_frequency(run.wavelength, depth)
        rows.append(
            _row(
                f"{run.nominal_height or run.height:.2f}",
                f"{run.wavelength / HULL_LENGTH:g}",
                f"{float(phase_speed(omega, depth)):.3f}",
                f"{float(group_speed(omega, depth)):.3f}",
                f"{each.height:.3f} ± {each.height_spread:.3f}",
                [each],
            )
        )
    return rows


def _row(
    nominal: str, ratio: str, phase: str, group: str, height: str, runs: list[Realised]
) -> dict[str, str]:
    return {
        "h [m]": nominal,
        "λ/L": ratio,
        "phase speed [m/s]": phase,
        "group speed [m/s]": group,
        "realised h [m]": height,
        "runs": str(len(runs)),
    }
