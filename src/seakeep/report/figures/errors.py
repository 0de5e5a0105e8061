"""Errors over the age of a forecast, and against the hyperparameters of the draws."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from scipy.stats import spearmanr

from seakeep.report.figures.common import grid_of_axes, line_of, model_colour, model_words
from seakeep.report.style import figure_style, new_figure
from seakeep.study import StudyResult
from seakeep.study.statistics import average_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["error_over_time_figure", "hyperparameter_figure", "member_errors"]

FloatArray = npt.NDArray[np.float64]

HYPERPARAMETERS = {
    "train_length": "training length [periods]",
    "state_delay": "state delay [periods]",
    "input_delay": "input delay [periods]",
    "ridge": "ridge λ",
}


def error_over_time_figure(result: StudyResult) -> Figure:
    """ε(t) of each test set: mean over all cells with its quartiles.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    matplotlib.figure.Figure
    """
    with figure_style():
        tests = list(result.tests)
        columns = min(2, len(tests))
        figure = new_figure(4.2 * columns, 0.4 + 2.5 * -(-len(tests) // columns))
        axes = grid_of_axes(figure, len(tests), columns)
        for each, test in zip(axes, tests, strict=True):
            trend = result.groups[f"statistics/trend/{test}"]
            time = trend["time"].values / float(result.attrs["encounter_period"])
            tallest = 0.0
            for model in result.models:
                at = trend.sel(model=model)
                style = line_of(result, model)
                upper = at["upper_quartile"].values
                each.fill_between(
                    time, at["lower_quartile"].values, upper, color=style["color"], alpha=0.15, lw=0
                )
                p = float(at["p_value"])
                shown = "p < 0.01" if p < 0.01 else f"p = {p:.2f}"
                words = f"{model_words(model)} (trend {shown})"
                each.plot(time, at["error_mean"].values, label=words, **style)
                tallest = max(tallest, float(np.nanmax(at["error_mean"].values, initial=0.0)))
            each.set_title(result.label_of(test), loc="left")
            each.set_ylim(0, 1.6 * tallest if tallest else None)
            each.set_xlabel("time in encounter periods")
            each.set_ylabel("ε [measured SD]")
            each.legend(fontsize=7, loc="upper left")
        return figure


def member_errors(result: StudyResult, test: str, model: str) -> FloatArray:
    """Median ANRMSE of each member over all cells of a test set.

    Parameters
    ----------
    result : StudyResult
        The study.
    test, model : str
        Test set and ensemble.

    Returns
    -------
    ndarray, shape (member,)
        NaN for a member that diverged in most of them.
    """
    data = result.tests[test]
    cells = data[f"{model}_member_nrmse"].values[data["judged"].values].astype(float)
    averages = np.stack([average_of(each) for each in cells])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a member that is lost everywhere
        out: FloatArray = np.nanmedian(averages, axis=0)
    return out


def hyperparameter_figure(result: StudyResult, model: str) -> Figure:
    """Error of each member against what was drawn for it, a row a test set.

    Parameters
    ----------
    result : StudyResult
        The study.
    model : str
        An ensemble.

    Returns
    -------
    matplotlib.figure.Figure
    """
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
            each.set_xlabel(HYPERPARAMETERS[name])
        return figure


def _scatter(axes: Any, drawn: FloatArray, errors: FloatArray, colour: str) -> None:
    axes.scatter(drawn, errors, s=9, color=colour, alpha=0.6, linewidths=0)
    known = np.isfinite(errors)
    if known.sum() > 2 and np.ptp(errors[known]) > 0:
        rank = float(spearmanr(drawn[known], errors[known]).statistic)
        axes.set_title(f"rank correlation {rank:+.2f}", loc="right", fontsize=7, pad=2)
