"""Box-violin plots of the error measures: box, whiskers to 1.5 IQR, violin, single values."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from seakeep.arrays import FloatArray
from seakeep.report.figures.common import (
    HEADING,
    judged_models,
    model_colour,
    model_words,
    short_label,
)
from seakeep.report.style import figure_style, new_figure
from seakeep.statistics import box_statistics
from seakeep.study import StudyResult
from seakeep.study.judge import average_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["average_boxes", "channel_boxes", "draw_box_violin"]


NARROW = 14
"""Letters of a test set's label on one line."""

FEWEST = 10
"""Values from which on a density is drawn; of fewer, points and box alone."""

HATCHES = ("", "////", "----", "xxxx", "\\\\\\\\")
"""Of the boxes of one model after the other."""

JITTER = np.random.default_rng(7).uniform(-1, 1, 4096)
"""Sideways places of the single values; the same in every figure."""


DECADE = 10.0
"""Ratio of the channels' medians from which on an axis is logarithmic."""


def draw_box_violin(
    axes: Any,
    values: npt.ArrayLike,
    place: float,
    width: float,
    colour: str,
    hatch: str = "",
) -> None:
    """Draw one box-violin; the hatch distinguishes models in grey print.

    A logarithmic axis has no place for values that are not positive.
    """
    logarithmic = axes.get_yscale() == "log"
    x = np.asarray(values, dtype=float).ravel()
    x = x[np.isfinite(x) & (not logarithmic or x > 0)]
    if x.size == 0:
        return
    # Before the violin, whose logarithms a logarithmic axis would be scaled to.
    sideways = place + 0.16 * width * np.resize(JITTER, x.size)
    axes.scatter(sideways, x, s=7, color=colour, alpha=0.5, linewidths=0, rasterized=True, zorder=2)
    if x.size >= FEWEST and np.ptp(x) > 0:
        spread = np.log10(x) if logarithmic else x
        violin = axes.violinplot([spread], [place], widths=width, showextrema=False, points=120)
        for body in violin["bodies"]:
            if logarithmic:
                vertices = body.get_paths()[0].vertices
                vertices[:, 1] = 10.0 ** vertices[:, 1]
            body.set(facecolor=colour, edgecolor=colour, alpha=0.18, linewidth=0.6)
    box = box_statistics(x)
    half = 0.13 * width
    axes.fill_between(
        [place - half, place + half],
        box.lower_quartile,
        box.upper_quartile,
        facecolor="white",
        edgecolor=colour,
        hatch=hatch,
        linewidth=1.0,
        alpha=0.75,
        zorder=3,
    )
    axes.plot([place - half, place + half], [box.median] * 2, color=colour, lw=1.8, zorder=4)
    for quartile, whisker in (
        (box.lower_quartile, box.lower_whisker),
        (box.upper_quartile, box.upper_whisker),
    ):
        axes.plot([place, place], [quartile, whisker], color=colour, linewidth=0.9, zorder=3)
        cap = [place - 0.6 * half, place + 0.6 * half]
        axes.plot(cap, [whisker] * 2, color=colour, linewidth=0.9, zorder=3)


def _cells(result: StudyResult, test: str, model: str, measure: str) -> FloatArray:
    """Errors of all judged cells, shape (cell, channel)."""
    data = result.tests[test]
    errors = data["error"].sel(model=model, measure=measure).values
    cells: FloatArray = errors[data["judged"].values]
    return cells


def average_boxes(result: StudyResult, tests: Sequence[str]) -> Figure:
    """ANRMSE and NAMMAE of all cells of some test sets, a box-violin per model."""
    with figure_style():
        figure = new_figure(max(8.5, 2.0 + 1.7 * len(tests)), 3.6)
        for axes, (measure, heading) in zip(figure.subplots(1, 2), HEADING.items(), strict=True):
            for place, test in enumerate(tests):
                for number, model in enumerate(result.models):
                    values = average_of(_cells(result, test, model, measure))
                    _draw_beside(axes, result, values, place, number, result.models)
            labels = [_narrow(result.label_of(test)) for test in tests]
            _finish(axes, labels, heading)
            axes.set_xlim(-0.6, len(tests) - 0.4)
        _legend(figure, result, result.models)
        return figure


def channel_boxes(result: StudyResult, test: str) -> Figure:
    """NRMSE and NAMMAE of all cells of a test set, channel by channel."""
    with figure_style():
        figure = new_figure(8.5, 5.6)
        logarithmic, models = _span_decades(result, test), judged_models(result)
        for axes, measure in zip(figure.subplots(2, 1, sharex=True), HEADING, strict=True):
            tallest = 0.0
            if logarithmic:
                axes.set_yscale("log")
            for number, model in enumerate(models):
                cells = _cells(result, test, model, measure)
                for place in range(cells.shape[1]):
                    _draw_beside(axes, result, cells[:, place], place, number, models)
                    column = cells[:, place][np.isfinite(cells[:, place])]
                    if column.size:
                        tallest = max(tallest, box_statistics(column).upper_whisker)
            if logarithmic:
                shown = [_cells(result, test, model, measure) for model in models]
                axes.set_ylim(0.8 * np.nanmin(shown), 1.25 * np.nanmax(shown))
            heading = "NRMSE" if measure == "nrmse" else "NAMMAE"
            _finish(axes, [short_label(name) for name in result.channels], heading)
            if logarithmic:
                axes.set_title("logarithmic axis", loc="right", fontsize=7)
            elif tallest > 0 and axes.get_ylim()[1] > 3 * tallest:
                axes.set_ylim(0, 1.15 * tallest)
                axes.set_title("values above the axis are not shown", loc="right", fontsize=7)
        axes.set_xlim(-0.6, len(result.channels) - 0.4)
        _legend(figure, result, models)
        return figure


def _span_decades(result: StudyResult, test: str) -> bool:
    """Whether the channels' medians differ by so much that a common axis would hide most."""
    far = False
    for measure in HEADING:
        cells = np.concatenate(
            [_cells(result, test, model, measure) for model in judged_models(result)]
        )
        known = cells[:, np.isfinite(cells).any(axis=0)]
        if not known.size or np.nanmin(known) <= 0:
            return False
        medians = np.nanmedian(known, axis=0)
        far |= bool(medians.max() > DECADE * np.median(medians))
    return far


def _draw_beside(
    axes: Any,
    result: StudyResult,
    values: FloatArray,
    place: int,
    number: int,
    models: Sequence[str],
) -> None:
    """Draw the box-violin of the model of a number beside those of the others."""
    width = 0.84 / len(models)
    centre = place + width * (number - 0.5 * (len(models) - 1))
    colour = model_colour(result, models[number])
    draw_box_violin(axes, values, centre, 0.92 * width, colour, HATCHES[number % len(HATCHES)])


def _narrow(label: str) -> str:
    """A label in lines, parted behind its commas first."""
    if len(label) <= NARROW:
        return label
    return "\n".join(textwrap.fill(part, NARROW) for part in label.replace(", ", ",\n").split("\n"))


def _finish(axes: Any, labels: Sequence[str], heading: str) -> None:
    axes.set_xticks(range(len(labels)), labels)
    axes.set_ylabel(f"{heading} [measured SD]")
    if axes.get_yscale() == "log":
        _plain_decades(axes)
    else:
        axes.set_ylim(bottom=0)
    axes.grid(axis="x", visible=False)


def _plain_decades(axes: Any) -> None:
    """Ticks of a logarithmic axis as numbers, not as powers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axes.get_ylim()
    if high < 100.0 * low:
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())


def _legend(figure: Figure, result: StudyResult, models: Sequence[str]) -> None:
    from matplotlib.patches import Patch

    handles = [
        Patch(
            facecolor="white",
            edgecolor=model_colour(result, model),
            hatch=HATCHES[number % len(HATCHES)],
            label=model_words(model),
        )
        for number, model in enumerate(models)
    ]
    figure.legend(handles=handles, loc="outside upper right", ncols=min(len(handles), 5))
