"""Wave spectra: nominal, where it is known, and measured, as the paper and as recommended."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.report.style import PALETTE, figure_style, new_figure, plain_text
from seakeep.study import StudyResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["mean_spectrum", "spectrum_figure"]

KINDS: dict[str, tuple[str, str, Any]] = {
    "paper": ("measured, segments of 8.2 s (paper)", PALETTE["vermilion"], (0, (4, 1.5))),
    "recommended": ("measured, segments of 60 s", PALETTE["blue"], "-"),
}


def spectrum_figure(result: StudyResult) -> Figure:
    """Mean spectrum of the irregular runs, and the peaks of the regular ones."""
    with figure_style():
        spectra, runs = result.groups["spectra"], result.groups["runs"]
        figure = new_figure(8.5, 4.2)
        axes = figure.subplots()
        waves = {
            str(n): str(w) for n, w in zip(runs["run"].values, runs["waves"].values, strict=True)
        }
        # Where no run is irregular the mean over all of them is drawn.
        irregular = [name for name, kind in waves.items() if kind != "regular"] or list(waves)
        if "nominal" in result.groups:
            nominal = result.groups["nominal"]
            f = nominal["frequency"].values
            for name, dash in zip(nominal.data_vars, ("-", ":"), strict=False):
                label = str(nominal[name].attrs.get("long_name", name))
                axes.plot(f, nominal[name].values, label=label, color="black", linestyle=dash)
        for kind, (words, colour, dash) in KINDS.items():
            curves = _mean(spectra, irregular, kind)
            if curves is not None:
                axes.plot(*curves, label=words, color=colour, linestyle=dash)
        _mark_regular(axes, runs["wave_frequency"].values)
        peak = max((_peak(spectra, n) for n in waves), default=1.0)
        axes.set_xlim(0, 2.2 * peak)
        axes.set_ylim(bottom=0)
        words = plain_text(result.words_of(str(spectra.attrs["channel"])))
        axes.set(xlabel="frequency [Hz]", ylabel=f"spectral density of {words} [m²/Hz]")
        if axes.get_legend_handles_labels()[0]:
            axes.legend(fontsize=8)
        return figure


def _curve(spectra: Any, run: str, kind: str) -> Any:
    """Frequency and density of a run, without the bins beyond its own."""
    at = spectra.sel(run=run, kind=kind).dropna("bin", subset=["density"])
    return at["frequency"].values, at["density"].values


def _mean(spectra: Any, names: list[str], kind: str) -> Any:
    curves = [_curve(spectra, name, kind) for name in names]
    known = [each for each in curves if each[0].size]
    return (known[0][0], mean_spectrum(known)) if known else None


def mean_spectrum(spectra: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Mean of spectra at the frequencies of the first: records differ in length."""
    mean: FloatArray = np.mean([np.interp(spectra[0][0], *each) for each in spectra], axis=0)
    return mean


def _peak(spectra: Any, name: str) -> float:
    frequency, density = _curve(spectra, name, "recommended")
    return float(frequency[np.argmax(density)]) if density.size else 0.0


def _mark_regular(axes: Any, frequencies: FloatArray) -> None:
    """Mark the regular waves where text and tables have them, not at a bin of the spectrum."""
    known = sorted({round(float(f), 3) for f in frequencies[np.isfinite(frequencies)]})
    for number, frequency in enumerate(known):
        label = "regular waves" if number == 0 else None
        axes.axvline(frequency, color=PALETTE["green"], linewidth=0.9, linestyle="--", label=label)
