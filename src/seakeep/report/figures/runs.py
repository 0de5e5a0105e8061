"""Figures of runs: all their channels, and wave spectra."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.quality import findings_of
from seakeep.quality.faults import FLAGS
from seakeep.quality.sensors import LATE, Agreement
from seakeep.report.style import (
    COLOURS,
    DASHED,
    PALETTE,
    figure_style,
    new_figure,
    plain_text,
    shown,
)
from seakeep.signals.time_axis import over_gaps
from seakeep.study import StudyResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWN = 50
"""Channels that a picture shows at most, each in a row of its own; the table lists all."""
MARKS = {
    "missing": (PALETTE["vermilion"], "x"),
    "bridged": (PALETTE["amber"], "+"),
    "outlier": (PALETTE["pink"], "o"),
    "saturated": (PALETTE["blue"], "^"),
    "stuck": (PALETTE["green"], "s"),
    "replaced": (PALETTE["sky"], "d"),
}
"""Colour and shape of each flag: shapes distinguish them in grey print."""
LABELS = -0.06
"""Where labels of the vertical axes stand, in widths of the axes: beyond six figures."""
WELCH: dict[str, tuple[str, Any]] = {
    "paper": (COLOURS["forecast"], DASHED),
    "recommended": (COLOURS["ensemble"], "-"),
}
"""Colour and dash of a measured spectrum, by how it is estimated."""
Curve = tuple[FloatArray, FloatArray]


@figure_style()
def quality_figure(run: xr.Dataset, agreements: Mapping[str, Agreement]) -> Figure:
    """Draw every channel of a run, flagged samples marked; lags of redundant sensors below."""
    names = [str(name) for name in run.data_vars][:DRAWN]
    lagging = {name: each for name, each in agreements.items() if each.lags.size}
    doubtful = {each.channel for each in findings_of(run)}
    rows = len(names) + len(lagging)
    figure = new_figure(9.5, 0.5 + 1.45 * rows)
    axes = figure.subplots(rows, 1, squeeze=False, sharex=True)[:, 0]
    time = run["time"].to_numpy()
    for at, name in zip(axes, names, strict=False):
        factor, label = shown(run[name])
        x = factor * run[name].to_numpy()
        if name in doubtful:  # the style sheet has the same colour for rows
            at.set_facecolor(PALETTE["blush"])
        at.plot(time, x, color=COLOURS["measured"], linewidth=0.6)
        at.set_ylabel(label, fontsize=8)
        if f"{name}_flags" in run.coords:
            _mark(at, time, x, run[f"{name}_flags"].to_numpy().astype(int))
        known = x[np.isfinite(x)]
        if known.size and np.ptp(known) <= 1e-9 * max(np.abs(known).max(), 1e-300):
            value = float(known[0])  # an axis that shows no rounding
            reach = 0.1 * abs(value) or 1.0
            at.set_ylim(value - reach, value + reach)
            place = {"xy": (0.5, 0.8), "xycoords": "axes fraction", "ha": "center"}
            at.annotate(f"constant: {value:.4g}", **place, fontsize=8)
    for at, (name, each) in zip(axes[len(names) :], lagging.items(), strict=True):
        limit = LATE * each.period
        at.axhspan(-limit, limit, color=PALETTE["green"], alpha=0.12)
        apart = np.diff(each.centre)
        usual = np.median(apart) if apart.size else 0.0
        holes = 1 + np.flatnonzero(apart > 1.5 * usual)
        instants = np.insert(each.centre + time[0], holes, np.nan)  # no line across a hole
        lags = np.insert(each.lags, holes, np.nan)
        at.plot(instants, lags, "o-", color=COLOURS["ensemble"], markersize=3)
        reach = max(1.5 * limit, 1.1 * float(np.nanmax(np.abs(each.lags), initial=0.0)))
        at.set_ylim(-reach, reach)
        at.set_ylabel(f"lag of\n{name.replace('_', ' ')} [s]", fontsize=8)
    for at in axes:
        if (startup := float(run.attrs.get("startup", 0.0))) > time[0]:
            at.axvspan(time[0], startup, color=PALETTE["light"], zorder=0)
        at.margins(x=0.005)
        at.tick_params(axis="x", labelbottom=True, labelsize=7)
        at.yaxis.set_label_coords(LABELS, 0.5)  # in line: aligning them takes half of the time
    left_out = len(run.data_vars) - len(names)
    axes[-1].set_xlabel("time [s]" + f" ({left_out} more channels)" * bool(left_out))
    return figure


def _mark(at: Any, time: Any, x: Any, flags: Any) -> None:
    filled = over_gaps(x)  # a sample that is not there stands between its neighbours
    for word, bit in FLAGS.items():
        hit = (flags & bit) > 0
        if hit.any():
            colour, shape = MARKS[word]
            style = {"color": colour, "markersize": 3.5, "zorder": 3, "label": word}
            at.plot(time[hit], filled[hit], shape, **style)
    if flags.any():
        place = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.95)}
        at.legend(**place, fontsize=7, ncols=6, borderpad=0.1)


@figure_style()
def spectrum_figure(result: StudyResult) -> Figure:
    """Mean spectrum of the irregular runs of a study, and the frequencies of the regular ones."""
    spectra, runs = result.groups["spectra"], result.groups["runs"]
    every = runs["run"].values.astype(str)
    # Where no run is irregular the mean over all of them is drawn.
    irregular = every[runs["waves"].values != "regular"]
    names = irregular if irregular.size else every

    def curves(kind: str, of: Iterable[str]) -> list[Curve]:
        """Frequency and density of runs, without the bins beyond their own."""
        chosen = [spectra.sel(run=run, kind=kind).dropna("bin", subset=["density"]) for run in of]
        return [(at["frequency"].values, at["density"].values) for at in chosen if at["bin"].size]

    words = {
        "paper": "measured, segments of 8.2 s (paper)",
        "recommended": "measured, segments of 60 s",
    }
    measured = {kind: (words[kind], curves(kind, names)) for kind in WELCH}
    known = result.groups.get("nominal", xr.Dataset())
    nominal = [
        (str(each.attrs.get("long_name", name)), (known["frequency"].values, each.values))
        for name, each in known.data_vars.items()
    ]
    figure = new_figure(8.5, 4.2)
    axes = figure.subplots()
    draw_spectra(axes, nominal, measured, runs["wave_frequency"].values)
    peaks = [float(f[np.argmax(density)]) for f, density in curves("recommended", every)]
    axes.set_xlim(0, 2.2 * max(peaks, default=1.0))
    channel = plain_text(result.words_of(str(spectra.attrs["channel"])))
    axes.set(xlabel="frequency [Hz]", ylabel=f"spectral density of {channel} [m²/Hz]")
    return figure


def draw_spectra(
    axes: Any,
    nominal: Sequence[tuple[str, Curve]],
    measured: Mapping[str, tuple[str, Sequence[Curve]]],
    regular: FloatArray,
) -> None:
    """Draw nominal spectra, the mean of measured ones, and the frequencies of regular waves."""
    for (label, curve), dash in zip(nominal, ("-", ":") * len(nominal), strict=False):
        axes.plot(*curve, label=label, color=COLOURS["measured"], linestyle=dash)
    for kind, (label, curves) in measured.items():
        if curves:  # at the frequencies of the first: records differ in length
            f, (colour, dash) = curves[0][0], WELCH[kind]
            mean = np.mean([np.interp(f, *each) for each in curves], axis=0)
            axes.plot(f, mean, label=label, color=colour, linestyle=dash)
    known = sorted({round(float(f), 3) for f in regular[np.isfinite(regular)]})
    for number, frequency in enumerate(known):
        style = {"color": COLOURS["start"], "linewidth": 0.9, "linestyle": "--"}
        axes.axvline(frequency, **style, label=None if number else "regular waves")
    axes.set_ylim(bottom=0)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)
