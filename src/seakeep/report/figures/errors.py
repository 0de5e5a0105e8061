"""Errors over the age of a forecast, and against the hyperparameters of the draws."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from seakeep.arrays import FloatArray
from seakeep.report.figures.common import judged_models, line_of, model_colour, model_words
from seakeep.report.style import figure_style, new_figure
from seakeep.study import StudyResult
from seakeep.study.judge import average_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["BAND_WORDS", "error_over_time_figure", "hyperparameter_figure", "member_errors"]


BAND_WORDS = {"all": "all frequencies", "low": "low frequencies", "wave": "wave frequencies"}
"""Bands of ε(t)."""

HYPERPARAMETERS = {
    "window": "training length",
    "state_delays": "state delay",
    "input_delays": "input delay",
    "ridge": "ridge λ",
}


def error_over_time_figure(result: StudyResult) -> Figure:
    """ε(t) of each test set, whole and in bands: mean over all cells with its quartiles."""
    from matplotlib.lines import Line2D

    with figure_style():
        tests = list(result.tests)
        figure = new_figure(8.5, 0.7 + 2.1 * len(tests))
        grid = figure.subplots(len(tests), len(BAND_WORDS), squeeze=False, sharey="row")
        for row, test in zip(grid, tests, strict=True):
            trend = result.groups[f"statistics/trend/{test}"]
            tallest = 0.0
            for each, (band, words) in zip(row, BAND_WORDS.items(), strict=True):
                tallest = max(tallest, _draw_band(each, result, trend.sel(band=band)))
                each.set_title(words, loc="left", fontsize=8)
                each.legend(fontsize=6.5, loc="upper left")
            row[0].set_ylim(0, 1.6 * tallest if tallest else None)
            row[0].set_ylabel(f"{result.label_of(test)}\nε [measured SD]")
        for each in grid[-1]:
            each.set_xlabel("time in encounter periods")
        handles = [
            Line2D([], [], **line_of(result, m), label=model_words(m))
            for m in judged_models(result)
        ]
        figure.legend(handles=handles, loc="outside upper right", ncols=min(len(handles), 5))
        return figure


def _draw_band(axes: Any, result: StudyResult, trend: Any) -> float:
    """Draw ε(t) of a band for all models; return the largest mean."""
    time = trend["time"].values / float(result.attrs["encounter_period"])
    tallest = 0.0
    for model in judged_models(result):
        at = trend.sel(model=model)
        style = line_of(result, model)
        lower, upper = at["lower_quartile"].values, at["upper_quartile"].values
        axes.fill_between(time, lower, upper, color=style["color"], alpha=0.15, lw=0)
        p = float(at["p_value"])
        words = "trend p < 0.01" if p < 0.01 else f"trend p = {p:.2f}"
        axes.plot(time, at["error_mean"].values, label=words, **style)
        tallest = max(tallest, float(np.nanmax(at["error_mean"].values, initial=0.0)))
    return tallest


def member_errors(result: StudyResult, test: str, model: str) -> FloatArray:
    """Median ANRMSE of each member over all cells of a test set."""
    data = result.tests[test]
    cells = data[f"{model}_member_nrmse"].values[data["judged"].values].astype(float)
    averages = np.stack([average_of(each) for each in cells])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a member that is lost everywhere
        out: FloatArray = np.nanmedian(averages, axis=0)
    return out


def hyperparameter_figure(result: StudyResult, model: str) -> Figure:
    """Error of each member against what was drawn for it, a row per test set."""
    with figure_style():
        draws = result.groups[f"draws/{model}"]
        drawn = [name for name in HYPERPARAMETERS if np.ptp(draws[name].values) > 0]
        tests = list(result.tests)
        figure = new_figure(8.5, 0.5 + 1.9 * len(tests))
        axes = figure.subplots(len(tests), max(len(drawn), 1), squeeze=False, sharey="row")
        for row, test in zip(axes, tests, strict=True):
            errors = member_errors(result, test, model)
            for each, name in zip(row, drawn, strict=False):
                _scatter(each, draws[name].values, errors, model_colour(result, model))
            row[0].set_ylabel(f"{result.label_of(test)}\nANRMSE")
        for each, name in zip(axes[-1], drawn, strict=False):
            unit = "" if name == "ridge" else f" [{draws[name].attrs['units']}]"
            each.set_xlabel(HYPERPARAMETERS[name] + unit)
        return figure


def _scatter(axes: Any, drawn: FloatArray, errors: FloatArray, colour: str) -> None:
    axes.scatter(drawn, errors, s=9, color=colour, alpha=0.6, linewidths=0)
    known = np.isfinite(errors)
    if known.sum() > 2 and np.ptp(errors[known]) > 0:
        rank = float(scipy.stats.spearmanr(drawn[known], errors[known]).statistic)
        axes.set_title(f"rank correlation {rank:+.2f}", loc="right", fontsize=7, pad=2)
