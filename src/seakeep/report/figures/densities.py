"""Densities of measurement and forecast with the bands of their bootstrap."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from seakeep.report.figures.common import (
    grid_of_axes,
    legend_outside,
    model_colour,
    model_words,
    short_label,
)
from seakeep.report.style import COLOURS, figure_style, new_figure
from seakeep.study import StudyResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["density_figure"]


def density_figure(result: StudyResult, model: str) -> Figure:
    """Density of each channel, measured and predicted, each with its 95 % band."""
    with figure_style():
        data = result.groups["statistics/densities"].sel(model=model)
        names = result.channels
        figure = new_figure(8.5, 0.5 + 1.75 * -(-len(names) // 4))
        axes = grid_of_axes(figure, len(names), 4)
        sides = (
            ("measured", "measured", COLOURS["measured"], "-"),
            ("predicted", model_words(model), model_colour(result, model), (0, (4, 1.5))),
        )
        for each, name in zip(axes, names, strict=True):
            _draw(each, data.sel(channel=name), name, sides)
        legend_outside(figure, axes[0], side="upper right")
        return figure


def _draw(axes: Any, curves: Any, name: str, sides: Any) -> None:
    x = curves["value"].values
    centre, spread = np.nan, np.nan
    weight = curves["measured_mean"].values
    if np.isfinite(x).all():
        weight = weight / weight.sum()
        centre = float((x * weight).sum())
        spread = float(np.sqrt((weight * (x - centre) ** 2).sum()))
    for key, words, colour, dash in sides:
        z = (x - centre) / spread
        lower, mean, upper = (
            curves[f"{key}_{k}"].values * spread for k in ("lower", "mean", "upper")
        )
        axes.fill_between(z, lower, upper, color=colour, alpha=0.22, linewidth=0)
        axes.plot(z, mean, color=colour, linestyle=dash, linewidth=1.3, label=words)
    axes.set_title(short_label(name), loc="left", pad=2)
    axes.set_yticks([])
    axes.set_ylim(bottom=0)
    axes.set_xlabel("measured SD from the mean", fontsize=7)
    axes.tick_params(labelsize=7)
