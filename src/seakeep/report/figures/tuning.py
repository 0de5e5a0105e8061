"""The error of free runs against λ, for each choice of the other settings."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from seakeep.report.style import figure_style, new_figure

__all__ = ["Figure", "tuning_figure"]

MARKERS = "os^vDPX*"


def tuning_figure(table: xr.Dataset) -> Figure:
    """Draw the table of :func:`seakeep.tune`.

    Parameters
    ----------
    table : Dataset
        Over ``trial``: settings, ``ridge``, ``score``, ``lower``, ``upper``, ``chosen``.

    Returns
    -------
    Figure
        One line per candidate with its 95 % intervals; the choice is marked.
    """
    truncated = table["rank"].values > 0
    shown = [("ridge", "ridge per snapshot pair (1)", ~truncated)]
    if truncated.any():
        shown.append(("rank", "singular values kept (1)", truncated))
    keys = ("observables", "lead", "state_delays", "input_delays", "alignment")
    varied = [key for key in keys if len(np.unique(table[key].values)) > 1]
    names = np.array(
        [
            ", ".join(f"{key.replace('_', ' ')} {table[key].values[row]}" for key in varied)
            or "error"
            for row in range(table.sizes["trial"])
        ]
    )
    numbers = {name: number for number, name in enumerate(dict.fromkeys(names.tolist()))}
    with figure_style():
        figure = new_figure(7.0, 4.2)
        panels = figure.subplots(
            1, len(shown), sharey=True, squeeze=False, width_ratios=[2, 1][: len(shown)]
        )
        for axes, (key, words, rows) in zip(panels[0], shown, strict=True):
            for name, number in numbers.items():
                part = table.isel(trial=np.flatnonzero((names == name) & rows))
                if not part.sizes["trial"]:
                    continue
                colour, marker = f"C{number % 10}", MARKERS[number % len(MARKERS)]
                axes.semilogx(
                    part[key], part["score"], color=colour, marker=marker, markersize=4, label=name
                )
                axes.fill_between(part[key], part["lower"], part["upper"], color=colour, alpha=0.12)
            best = table.isel(trial=np.flatnonzero(table["chosen"].values & rows))
            if best.sizes["trial"]:
                axes.semilogx(
                    *(best[key], best["score"], "o"),
                    markersize=11,
                    fillstyle="none",
                    color="k",
                    label="chosen",
                )
            if key == "rank":  # few octaves, each with its number
                axes.xaxis.set_major_locator(LogLocator(base=2))
                axes.xaxis.set_major_formatter("{x:g}")
                axes.xaxis.set_minor_formatter(NullFormatter())
            axes.set_xlabel(words)
            axes.set_ylim(bottom=0.0)
            axes.legend(fontsize="small")
        panels[0, 0].set_ylabel("mean NRMSE of free runs (1)")
    return figure
