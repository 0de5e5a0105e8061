"""Figures of the virtual tank: coefficients and responses, spectra, a run's channels."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from seakeep.report.figures.spectra import mean_spectrum
from seakeep.report.style import (
    COLOURS,
    PALETTE,
    axis_label,
    figure_style,
    new_figure,
    save_figure,
)
from seakeep.signals import wave_spectrum
from seakeep.tank.dynamics import Rig, linear_response
from seakeep.tank.hydrodynamics import excitation_at, kernel_coefficients
from seakeep.tank.play import play_run, truth
from seakeep.tank.realised import Realised, paper_peak
from seakeep.tank.seas import spectral_density
from seakeep.tank.settings import TankSettings
from seakeep.waves import wavelength_to_frequency, wavenumber

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["hydrodynamics_figure", "run_figure", "spectrum_figure", "write_tank_figures"]

SYMBOLS = {
    "surge": "x",
    "heave": "z",
    "pitch": r"\theta",
    "piston": r"\zeta_p",
    "slosh": r"\zeta_s",
}
KINDS = {"pierson_moskowitz": "Pierson–Moskowitz", "jonswap": "JONSWAP", "table": "as given"}
SHADES = {
    "surge": PALETTE["blue"], "heave": PALETTE["vermilion"], "pitch": PALETTE["green"],
    "piston": PALETTE["pink"], "slosh": PALETTE["slate"],
}  # fmt: skip


def _mark_waves(axes: Axes, settings: TankSettings, unit: float = 1.0) -> None:
    """Vertical lines at the frequencies of the regular runs."""
    depth = settings.facility.water_depth
    lengths = {r.wavelength for r in settings.runs.values() if r.wavelength is not None}
    for length in sorted(lengths):
        omega = float(wavelength_to_frequency(length, depth))
        axes.axvline(omega / unit, color=COLOURS["start"], linewidth=1.0, linestyle=(0, (6, 3)))


def hydrodynamics_figure(rig: Rig, settings: TankSettings) -> Figure:
    """Added mass, damping, excitation and response amplitude operators over frequency."""
    hydro = rig.hydro
    omega = hydro.omega
    fine = np.linspace(max(0.5, omega[0]), omega[-1], 500)
    added, damping = kernel_coefficients(rig.kernel, fine)
    force = np.abs(excitation_at(hydro, fine))
    waves = np.linspace(1.6, 9.0, 600)
    motion = np.abs(linear_response(rig, waves))
    slope = wavenumber(waves, hydro.water_depth)
    with figure_style():
        figure = new_figure(9.0, 8.4)
        grid = figure.subplots(4, len(hydro.names), sharex="row", squeeze=False)
        for i, name in enumerate(hydro.names):
            colour, symbol = SHADES[name], SYMBOLS[name]
            top: list[Axes] = list(grid[:, i])
            top[0].set_title(f"{name} ${symbol}$")
            pairs = (
                (hydro.added_mass[:, i, i], added[:, i, i]),
                (hydro.damping[:, i, i], damping[:, i, i]),
                (np.abs(hydro.excitation[:, i]), force[:, i]),
            )
            for axes, (points, line) in zip(top, pairs, strict=False):
                axes.plot(omega, points, ".", color=colour, markersize=3)
                axes.plot(fine, line, color=colour, linewidth=1.0)
            top[3].plot(waves, motion[:, i] / (slope if name == "pitch" else 1.0), color=colour)
            for axes in top:
                _mark_waves(axes, settings)
                axes.set_ylim(bottom=min(0.0, axes.get_ylim()[0]))
        labels = (
            "added mass\n[kg, kg m²]",
            "radiation damping\n[kg/s, kg m²/s]",
            "excitation\n[N/m, N m/m]",
            "linear response\n[m/m, pitch rad/(ka)]",
        )
        for row, label in zip(grid, labels, strict=True):
            row[0].set_ylabel(label)
            for axes in row:
                axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4))
        for axes in (*grid[2], *grid[3]):
            axes.set_xlabel(r"$\omega$ [rad/s]")
        figure.suptitle(
            "Points: boundary element solver; lines: as the time domain sees it; "
            "dashed: regular waves",
            fontsize=9,
        )
    return figure


def spectrum_figure(settings: TankSettings, realised: Sequence[Realised]) -> Figure:
    """Nominal wave spectrum against the measured one, regular waves' frequencies marked."""
    seas = [r for r in realised if r.irregular]
    with figure_style():
        figure = new_figure(6.4, 3.8)
        axes = figure.subplots()
        f = np.linspace(0.15, 1.6, 600)
        for number, each in enumerate(seas):
            spectrum = settings.runs[each.run].spectrum
            if spectrum is None or (number and spectrum == settings.runs[seas[0].run].spectrum):
                continue
            axes.plot(
                f, 1e4 * spectral_density(spectrum, f), color="black", linewidth=1.6,
                label=f"nominal ({KINDS[spectrum.kind]})",
            )  # fmt: skip
            for edge in spectrum.band:
                axes.axvline(edge, color=PALETTE["grey"], linewidth=0.8, linestyle=":")
        if seas:
            rough = [paper_peak(r.elevation, r.dt)[1:] for r in seas]
            fine = [wave_spectrum(r.elevation, r.dt) for r in seas]
            axes.plot(
                fine[0][0], 1e4 * mean_spectrum(fine), color=COLOURS["ensemble"],
                linewidth=0.9, label="measured, segments of 60 s",
            )  # fmt: skip
            axes.plot(
                rough[0][0], 1e4 * mean_spectrum(rough),
                color=COLOURS["forecast"], linewidth=1.4, linestyle=(0, (4, 1.5)),
                label="measured, paper's Welch settings",
            )  # fmt: skip
        _mark_waves(axes, settings, 2 * np.pi)
        axes.plot([], [], color=COLOURS["start"], linestyle=(0, (6, 3)), label="regular waves")
        axes.set(xlim=(0.15, 1.6), xlabel="frequency $f$ [Hz]", ylabel="$E$ [cm²/Hz]")
        axes.set_ylim(bottom=0.0)
        axes.legend()
    return figure


def run_figure(data: xr.Dataset, channels: Sequence[str] | None = None) -> Figure:
    """All channels of a run over time, its start-up shaded."""
    names = list(channels) if channels is not None else _distinct(data)
    time = data["time"].values
    with figure_style():
        figure = new_figure(9.0, 0.85 * len(names) + 0.6)
        stack = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        for axes, name in zip(stack, names, strict=True):
            units = str(data[name].attrs.get("units", ""))
            axes.plot(time, data[name].values, color="black", linewidth=0.6)
            label = axis_label(name, units)
            axes.set_ylabel(label, rotation=0, ha="right", va="center", fontsize=7)
            startup = float(data.attrs.get("startup", 0.0))
            if startup > 0:
                axes.axvspan(time[0], startup, color=PALETTE["light"], zorder=0)
            axes.locator_params(axis="y", nbins=3)
        stack[-1].set(xlabel="time [s]", xlim=(time[0], time[-1]))
        figure.align_ylabels(list(stack))
        title = str(data.attrs.get("run", ""))
        figure.suptitle(f"{title} (start-up shaded)" if title else "", fontsize=10)
    return figure


def _distinct(data: xr.Dataset) -> list[str]:
    """Channels without crests and without second probes at the same place."""
    first: dict[object, str] = {}
    for name in map(str, data.data_vars):
        if not name.endswith("_crest"):
            first.setdefault(data[name].attrs.get("x_position", name), name)
    return list(first.values())


def write_tank_figures(
    settings: TankSettings, rig: Rig, realised: Sequence[Realised], folder: Path
) -> list[Path]:
    """Draw coefficients, spectrum (where a sea is irregular) and each run into a folder."""
    written = [save_figure(hydrodynamics_figure(rig, settings), folder / "hydrodynamics.png")]
    if any(each.irregular for each in realised):
        written.append(save_figure(spectrum_figure(settings, realised), folder / "spectrum.png"))
    for each in realised:
        data = truth(play_run(settings, each.run, rig), each.run, 0.02)
        written.append(save_figure(run_figure(data), folder / f"run_{each.run}.png"))
    return written
