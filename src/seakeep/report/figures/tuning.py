"""The error of free runs against λ, for each choice of the other settings."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

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
    figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    keys = ("observables", "lead", "state_delays", "input_delays")
    varied = [key for key in keys if len(np.unique(table[key].values)) > 1]
    names = np.array(
        [
            ", ".join(f"{key.replace('_', ' ')} {table[key].values[row]}" for key in varied)
            or "error"
            for row in range(table.sizes["trial"])
        ]
    )
    for number, name in enumerate(dict.fromkeys(names.tolist())):
        part = table.isel(trial=np.flatnonzero(names == name))
        marker = MARKERS[number % len(MARKERS)]
        (line,) = axes.semilogx(
            part["ridge"], part["score"], marker=marker, markersize=4, label=name
        )
        axes.fill_between(
            part["ridge"], part["lower"], part["upper"], color=line.get_color(), alpha=0.12
        )
    best = table.isel(trial=np.flatnonzero(table["chosen"].values))
    axes.semilogx(
        *(best["ridge"], best["score"], "o"),
        markersize=11,
        fillstyle="none",
        color="k",
        label="chosen",
    )
    axes.set_xlabel("ridge per snapshot pair (1)")
    axes.set_ylabel("mean NRMSE of free runs (1)")
    axes.set_ylim(bottom=0.0)
    axes.grid(alpha=0.3)
    axes.legend(fontsize="small")
    return figure
