"""What the virtual tank delivers beside the paper's numbers, and what its vessel answers.

Prints the test matrix, the realised waves of the forward probe beside the paper's, and statistics
of the true motions and loads, each with its unit. With `--out`, it also writes these tables (CSV)
and figures: coefficients, spectrum and true channels of each run. Needs the extra `tank`.

    python benchmarks/tank_figures.py [SETTINGS.toml] [--out FOLDER] [--seed SEED] [--run NAME]
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.cli.console import print_table
from seakeep.errors import RequestError
from seakeep.report.figures.histories import draw_spectra, quality_figure
from seakeep.report.style import COLOURS, PALETTE, SERIES, figure_style, new_figure, save_figure
from seakeep.report.tables import Table, write_csv
from seakeep.signals import (
    encounter_period,
    low_pass,
    significant_height,
    wave_heights,
    wave_spectrum,
)
from seakeep.signals.time_axis import over_gaps
from seakeep.signals.waves import paper_welch
from seakeep.tank.dynamics import Rig, linear_response
from seakeep.tank.hydrodynamics import excitation_at, kernel_coefficients
from seakeep.tank.instruments import Played, record_run
from seakeep.tank.play import check_settings, generator, play_run, truth
from seakeep.tank.seas import spectral_density
from seakeep.tank.settings import TankSettings, default_settings, read_tank, with_waves
from seakeep.waves import group_speed, phase_speed, wavelength_to_frequency, wavenumber

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
SEAS = {"pierson_moskowitz": "Pierson–Moskowitz", "jonswap": "JONSWAP", "table": "as given"}


@dataclass(frozen=True)
class Realised:
    """One run as measured by its forward probe (low-passed elevation), its start-up left out.

    The peak period is by the paper's Welch settings; `height` is the mean of the single waves'.
    `motions` has a row for each true motion and load, with its unit, its mean, its SD, and the part
    of the time for which a line was slack. SI.
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
    true["surge_fast"] = (true["surge"] - true["surge_slow"]).assign_attrs(units="m")
    loads = [f"mooring_{line}" for line in played.settings.moorings]
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
                "unit": {name: true[name].attrs["units"] for name in motions},
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


def realised_tables(settings: TankSettings, realised: list[Realised]) -> list[Table]:
    """Test matrix, realised waves beside the paper's, and statistics of the true channels."""
    cells = [tuple(row.values()) for row in matrix_rows(settings, realised)]
    waves = [
        (name, unit, *(f"{value:.3f}" for value in (here, paper, tolerance)), verdict)
        for name, unit, here, paper, tolerance in comparison(settings, realised).itertuples()
        for verdict in ("within" if abs(here - paper) <= tolerance else "outside",)
    ]
    motions = [
        (each.run, channel, unit, f"{mean:z.4f}", f"{spread:.4f}", share)
        for each in realised
        for channel, unit, mean, spread, slack in each.motions.itertuples()
        for share in ("" if np.isnan(slack) else f"{100 * slack:.0f}",)
    ]
    known = ("", "unit", "here", "paper", "tolerance", "")
    true = ("run", "channel", "unit", "mean", "SD", "slack [%]")
    return [
        Table("matrix", "Test matrix", MATRIX, cells),
        Table("waves", "Realised waves, forward probe", known, waves),
        Table("truth", "True motions and loads", true, motions),
    ]


def run_figure(run: xr.Dataset, channels: Sequence[str] | None = None) -> Figure:
    """All channels of a run of the tank over time but crests, its start-up shaded."""
    names = [str(name) for name in run.data_vars if not str(name).endswith("_crest")]
    return quality_figure(run[names if channels is None else list(channels)], {})


@figure_style()
def tank_spectrum_figure(settings: TankSettings, realised: Sequence[Realised]) -> Figure:
    """Nominal wave spectra of the tank against the measured ones, regular waves marked."""
    seas = [each for each in realised if each.irregular]
    f = np.linspace(0.15, 1.6, 600)
    figure = new_figure(6.4, 3.8)
    axes = figure.subplots()
    stated = {repr(each): each for sea in seas if (each := settings.runs[sea.run].spectrum)}
    for edge in (edge for each in stated.values() for edge in each.band):
        axes.axvline(edge, color=PALETTE["grey"], linewidth=0.8, linestyle=":")
    nominal = [
        (f"nominal ({SEAS[each.kind]})", (f, spectral_density(each, f))) for each in stated.values()
    ]
    fine = [wave_spectrum(each.elevation, each.dt) for each in seas]
    rough = [paper_peak(each.elevation, each.dt)[1:] for each in seas]
    measured = {
        "recommended": ("measured, segments of 60 s", fine),
        "paper": ("measured, paper's Welch settings", rough),
    }
    draw_spectra(axes, nominal, measured, _regular_waves(settings) / (2 * np.pi))
    axes.set(xlim=(0.15, 1.6), xlabel="frequency $f$ [Hz]", ylabel="$E$ [m²/Hz]")
    return figure


def _regular_waves(settings: TankSettings) -> FloatArray:
    """Frequencies of the tank's regular runs, rad/s."""
    lengths = sorted({each.wavelength for each in settings.runs.values() if each.wavelength})
    return np.array([wavelength_to_frequency(n, settings.facility.water_depth) for n in lengths])


@figure_style()
def hydrodynamics_figure(rig: Rig, settings: TankSettings) -> Figure:
    """Added mass, damping, excitation and response amplitude operators over frequency."""
    hydro, omega = rig.hydro, rig.hydro.omega
    fine, waves = np.linspace(max(0.5, omega[0]), omega[-1], 500), np.linspace(1.6, 9.0, 600)
    motion = np.abs(linear_response(rig, waves))
    slope = wavenumber(waves, hydro.attrs["water_depth"])
    diagonal = [np.diagonal(each, axis1=1, axis2=2) for each in (hydro.added_mass, hydro.damping)]
    points = [*diagonal, np.abs(hydro.excitation)]
    kernel = [np.diagonal(x, axis1=1, axis2=2) for x in kernel_coefficients(rig.kernel, fine)]
    lines = [*kernel, np.abs(excitation_at(hydro, fine))]
    labels = (
        "added mass\n[kg, kg m²]",
        "radiation damping\n[kg/s, kg m²/s]",
        "excitation\n[N/m, N m/m]",
        "linear response\n[m/m, pitch rad/(ka)]",
    )
    figure = new_figure(9.0, 8.4)
    grid = figure.subplots(4, len(hydro.names), sharex="row", squeeze=False)
    for i, name in enumerate(hydro.names):
        tint = SERIES[i % len(SERIES)]["color"]
        for axes, point, line in zip(grid[:3, i], points, lines, strict=True):
            axes.plot(omega, point[:, i], ".", color=tint, markersize=3)
            axes.plot(fine, line[:, i], color=tint, linewidth=1.0)
        grid[3, i].plot(waves, motion[:, i] / (slope if name == "pitch" else 1.0), color=tint)
        grid[0, i].set_title(name)
    for axes in grid.flat:
        for frequency in _regular_waves(settings):
            axes.axvline(frequency, color=COLOURS["start"], linewidth=1.0, linestyle=(0, (6, 3)))
        axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4))
    for row, label in zip(grid, labels, strict=True):
        row[0].set_ylabel(label)
    for axes in grid[2:].flat:
        axes.set_xlabel(r"$\omega$ [rad/s]")
    words = (
        "Points: boundary element solver; lines: as the time domain sees it; dashed: regular waves"
    )
    figure.suptitle(words, fontsize=9)
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the tables; write them and the figures into a folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "settings", type=Path, nargs="?", help="tank settings (TOML); by default the CK-14e's"
    )
    parser.add_argument("-o", "--out", type=Path, help="folder for tables and figures")
    parser.add_argument("--seed", type=int, help="seed of waves and noise")
    parser.add_argument("--run", action="append", help="this run only; may be repeated")
    options = parser.parse_args(arguments)
    chosen = default_settings() if options.settings is None else read_tank(options.settings)
    settings = with_waves(chosen, options.seed)
    names = options.run or list(settings.runs)
    rig = check_settings(settings, names)
    played = {name: play_run(settings, name, rig) for name in names}
    realised = [realise(each, name) for name, each in played.items()]
    tables = realised_tables(settings, realised)
    for table in tables:
        print_table(table)
    if (out := options.out) is None:
        return
    out.mkdir(parents=True, exist_ok=True)
    drawn = {"hydrodynamics": hydrodynamics_figure(rig, settings)}
    if any(each.irregular for each in realised):
        drawn["spectrum"] = tank_spectrum_figure(settings, realised)
    for name, each in played.items():
        drawn[f"run_{name}"] = run_figure(truth(each, name, 0.02))
    files = [write_csv(table, out / f"{table.name}.csv") for table in tables]
    files += [save_figure(figure, out / f"{name}.png") for name, figure in drawn.items()]
    print(*(f"Wrote {file}" for file in files), sep="\n")


if __name__ == "__main__":
    main()
