"""Errors over the age of a forecast and against what was drawn; densities; eigenvalues."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy

from seakeep.arrays import FloatArray
from seakeep.report.figures.common import (
    grid_of_axes,
    judged_models,
    legend_outside,
    line_of,
    model_colour,
    model_words,
    short_label,
)
from seakeep.report.style import COLOURS, PALETTE, figure_style, new_figure
from seakeep.study import StudyResult
from seakeep.study.judge import average_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "BAND_WORDS",
    "LOWEST",
    "density_figure",
    "eigenvalue_figure",
    "error_over_time_figure",
    "hyperparameter_figure",
    "member_errors",
]


BAND_WORDS = {"all": "all frequencies", "low": "low frequencies", "wave": "wave frequencies"}
"""Bands of ε(t)."""

HYPERPARAMETERS = {
    "window": "training length",
    "state_delays": "state delay",
    "input_delays": "input delay",
    "ridge": "ridge λ",
}


LOWEST = 0.8
"""Modulus at which the axis ends; what lies below dies out within a few samples."""


def error_over_time_figure(result: StudyResult) -> Figure:
    """ε(t) of each test set, whole and in bands: mean over all cells with its quartiles."""
    from matplotlib.lines import Line2D

    with figure_style():
        tests = list(result.tests)
        figure = new_figure(8.5, 0.7 + 2.1 * len(tests))
        grid = figure.subplots(len(tests), len(BAND_WORDS), squeeze=False, sharey="row")
        for row, test in zip(grid, tests, strict=True):
            trend = result.groups["statistics/trend"].sel(test=test)
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
    errors = data["member_nrmse"].sel(ensemble=model).values[..., : result.members_of(model), :]
    cells = errors[data["judged"].values].astype(float)
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
            _draw_density(each, data.sel(channel=name), name, sides)
        legend_outside(figure, axes[0], side="upper right")
        return figure


def _draw_density(axes: Any, curves: Any, name: str, sides: Any) -> None:
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


def eigenvalue_figure(result: StudyResult) -> Figure:
    """Eigenvalues of each model of the first training set, for an ensemble those of all members."""
    with figure_style():
        figure = new_figure(8.5, 3.0)
        plane, decay = figure.subplots(1, 2)
        circle = np.exp(1j * np.linspace(0, np.pi, 400))
        plane.plot(circle.real, circle.imag, color=PALETTE["slate"], linewidth=0.8)
        order = sorted(judged_models(result), key=lambda model: not result.is_ensemble(model))
        for model in order:
            data = result.groups[f"eigenvalues/{model}"]
            values = (data["real"].values + 1j * data["imag"].values).ravel()
            values = values[np.isfinite(values) & (values.imag >= 0)]
            _draw_eigenvalues(plane, decay, values, result, model)
        plane.set_aspect("equal")
        plane.set_ylim(0, 1.05)
        plane.set_xticks([-1.0, -0.5, 0.0, 0.5, 1.0])
        plane.set(xlabel="real part", ylabel="imaginary part")
        decay.axhline(1.0, color=PALETTE["slate"], linewidth=0.8)
        decay.set(xlabel="frequency [Hz]", ylabel="modulus")
        decay.set_xlim(0, 3 / float(result.attrs["encounter_period"]))
        decay.set_ylim(LOWEST, 1.01)
        legend = legend_outside(figure, decay, side="upper right", markerscale=2)
        for handle in filter(None, legend.legend_handles):
            handle.set_alpha(0.9)
        return figure


def _draw_eigenvalues(plane: Any, decay: Any, values: Any, result: StudyResult, model: str) -> None:
    single = not result.is_ensemble(model)
    members = result.groups[f"eigenvalues/{model}"].sizes["member"]
    style = {
        "s": 9 if single else 5,
        "color": model_colour(result, model),
        "alpha": 0.9 if single else float(np.clip(12 / members, 0.12, 0.6)),
        "linewidths": 0,
        "rasterized": True,
        "label": model_words(model),
    }
    plane.scatter(values.real, values.imag, **style)
    frequency = np.angle(values) / (2 * np.pi * float(result.attrs["dt"]))
    decay.scatter(frequency, np.abs(values), **style)
