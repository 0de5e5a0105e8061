"""Standardised time histories: measured, deterministic, and the ensemble's mean with its band."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from seakeep.report.figures.common import (
    judged_models,
    legend_outside,
    line_of,
    model_words,
    short_label,
)
from seakeep.report.style import LINES, THIN, figure_style, new_figure
from seakeep.study import StudyResult
from seakeep.study.judge import band_of
from seakeep.study.reproduce import ACTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["acts_figure", "draw_channel", "history_figure", "shown_cells"]

EDGE: dict[str, Any] = {"linewidth": 0.7, "linestyle": (0, (1, 1))}
"""Bounds of a calibrated band."""


CHANNELS = ("heave", "surge")
"""One that moves with the waves, and one that drifts."""


def shown_cells(result: StudyResult) -> list[tuple[str, int, int]]:
    """Cells that are drawn: test set, training set and window."""
    count = int(result.settings["output"]["shown_windows"])
    cells = []
    for number, (name, test) in enumerate(result.tests.items()):
        judged = test["judged"].values
        total = judged.shape[1]
        wanted = min(count if number == 0 else min(count, 1), total)
        for place in np.linspace(0, total - 1, wanted).round():
            window = int(place)
            cells.append((name, int(np.argmax(judged[:, window])), window))
    return cells


def history_figure(
    result: StudyResult,
    test: str,
    training: int,
    window: int,
    names: Sequence[str] | None = None,
) -> Figure:
    """Channels of one cell over time; all of them unless `names` are given."""
    with figure_style():
        cell = result.tests[test].isel(training=training, window=window)
        names = result.channels if names is None else names
        figure = new_figure(7.5, 0.9 + (0.95 if len(names) > 1 else 1.4) * len(names))
        axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
        alone = result.tests[test].isel(training=[training], window=[window])
        bands = {}
        if result.is_calibrated:
            found = result.groups["calibration"].isel(training=[training])
            bands = {model: band_of(alone, model, found) for model in found["ensemble"].values}
        for each, name in zip(axes, names, strict=True):
            k = result.channels.index(name)
            edges = {model: [edge[0, 0, :, k] for edge in band] for model, band in bands.items()}
            draw_channel(each, result, cell.sel(channel=name), name, edges)
        figure.supylabel(
            "deviation from the training mean, in training SD" if len(names) > 1 else "training SD",
            fontsize=8,
        )
        axes[-1].set_xlabel(r"time after the last measured state, in encounter periods")
        legend_outside(figure, axes[0], side="upper right")
        run, learnt = str(cell["run"].values), str(cell["training"].values)
        left_out = str(result.groups["training"]["left_out"].values[training])
        axes[0].set_title(
            f"{run}, from {float(cell['start']):.1f} s; trained "
            + (learnt if left_out else f"on {learnt}"),
            loc="left",
            fontsize=8,
        )
        return figure


def draw_channel(
    axes: Any, result: StudyResult, cell: Any, name: str, edges: Mapping[str, Sequence[Any]]
) -> None:
    """Draw what was measured and the forecasts of all models but baselines."""
    mean, spread = float(cell["training_mean"]), float(cell["training_std"])

    def standard(values: Any) -> Any:
        return (values.values - mean) / spread

    time = cell["time"].values / float(result.attrs["encounter_period"])
    level = 100 * float(result.settings["statistics"]["level"])
    banded = any(result.is_ensemble(model) for model in result.models)
    solid = THIN if banded else LINES["measured"]
    axes.plot(time, standard(cell["measured"]), label="measured", **solid)
    for model in judged_models(result):
        style = line_of(result, model)
        if result.is_ensemble(model):
            axes.fill_between(
                time,
                standard(cell["lower"].sel(ensemble=model)),
                standard(cell["upper"].sel(ensemble=model)),
                color=style["color"],
                alpha=0.25,
                linewidth=0,
                label=f"{level:g} % band",
            )
            if np.isfinite(edges.get(model, np.nan)).all():
                for number, bound in enumerate(edges[model]):
                    label = "calibrated" if number == 0 else None
                    axes.plot(time, (bound - mean) / spread, label=label, **{**style, **EDGE})
        words = f"{model_words(model)} mean" if result.is_ensemble(model) else model_words(model)
        axes.plot(time, standard(cell["mean"].sel(model=model)), label=words, **style)
    axes.set_ylabel(short_label(name), rotation=0, ha="right", va="center")
    axes.margins(x=0.005)


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
