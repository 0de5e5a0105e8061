"""One window of every act of the reproduction, side by side."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from seakeep.report.figures.common import legend_outside
from seakeep.report.figures.histories import draw_channel
from seakeep.report.style import figure_style, new_figure
from seakeep.study import StudyResult
from seakeep.study.reproduce import ACTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["acts_figure"]

CHANNELS = ("heave", "surge")
"""One that moves with the waves, and one that drifts."""


def acts_figure(results: Mapping[str, StudyResult]) -> Figure:
    """Channels (columns) in the same window of irregular waves, act by act (rows)."""
    with figure_style():
        acts = [act for act in ACTS if act.name in results]
        figure = new_figure(8.5, 0.7 + 1.3 * len(acts))
        grid = figure.subplots(len(acts), len(CHANNELS), sharex=True, squeeze=False)
        for row, act in zip(grid, acts, strict=True):
            result = results[act.name]
            test = result.tests["irregular"]
            training = int(test["judged"].values[:, 0].argmax())
            cell = test.isel(training=training, window=0)
            for axes, name in zip(row, CHANNELS, strict=True):
                draw_channel(axes, result, cell.sel(channel=name), name, {})
                axes.set_title(f"{act.title}: {name}", loc="left", fontsize=8)
        for axes in grid[-1]:
            axes.set_xlabel("time after the last measured state, in encounter periods")
        legend_outside(figure, grid[0, 0], side="upper right")
        figure.supylabel("deviation from the training mean, in training SD", fontsize=8)
        return figure
