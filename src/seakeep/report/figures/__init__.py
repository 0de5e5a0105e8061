"""Figures of a study: one module a group, and the list of all that a report shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from seakeep.report.figures.boxes import FEWEST, average_boxes, channel_boxes
from seakeep.report.figures.common import model_words
from seakeep.report.figures.densities import density_figure
from seakeep.report.figures.eigenvalues import LOWEST, eigenvalue_figure
from seakeep.report.figures.errors import error_over_time_figure, hyperparameter_figure
from seakeep.report.figures.histories import history_figure, shown_cells
from seakeep.report.figures.spectra import spectrum_figure
from seakeep.report.quality_sheet import quality_figure
from seakeep.study import StudyResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["ReportFigure", "report_figures"]


@dataclass(frozen=True)
class ReportFigure:
    """A figure of the report.

    Parameters
    ----------
    name : str
        Name of its files.
    section : str
        Section of the report it stands in.
    caption : str
        What it shows.
    draw : callable
        Draws it.
    raster : bool, optional
        Too many points for vectors: PNG alone, folded away on the page until it is wanted.
    """

    name: str
    section: str
    caption: str
    draw: Callable[[], Figure]
    raster: bool = False


def report_figures(result: StudyResult) -> list[ReportFigure]:
    """All figures of a study, in the order of the report.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    list of ReportFigure
        Not drawn yet.
    """
    figures = []
    if "spectra" in result.groups:
        figures.append(
            ReportFigure(
                "spectrum",
                "waves",
                "Power spectral density of the wave elevation: nominal where it is known, and "
                "measured (mean over the irregular runs, or over all where none is) with the "
                "paper's Welch segments and with long ones." + _regular_words(result),
                partial(spectrum_figure, result),
            )
        )
    return [*figures, *_boxes(result), *_histories(result), *_judgements(result), *_data(result)]


def _regular_words(result: StudyResult) -> str:
    regular = bool(np.isfinite(result.groups["runs"]["wave_frequency"].values).any())
    return " Vertical lines: the regular waves." if regular else ""


def _data(result: StudyResult) -> list[ReportFigure]:
    return [
        ReportFigure(
            f"quality_{name}",
            "data",
            f"All channels of {name} after preparation, flagged samples marked; "
            "tinted: a channel in which something was found.",
            partial(quality_figure, run, {}),
            raster=True,
        )
        for name, run in result.prepared.items()
    ]


def _boxes(result: StudyResult) -> list[ReportFigure]:
    tests = list(result.tests)
    box = (
        "Boxes: quartiles; whiskers: furthest values within 1.5 inter-quartile ranges; violins: "
        f"density, from {FEWEST} cells on; dots: single cells, outliers included."
    )
    groups = [tests[:1], tests[1:]] if len(tests) <= 9 else [tests]
    figures = [
        ReportFigure(
            f"errors_{'_'.join(group) if len(group) == 1 else 'others'}",
            "errors",
            f"ANRMSE and NAMMAE of all cells ({', '.join(map(result.label_of, group))}). {box}",
            partial(average_boxes, result, group),
        )
        for group in groups
        if group
    ]
    figures += [
        ReportFigure(
            f"errors_{test}_by_channel",
            "errors",
            f"NRMSE and NAMMAE channel by channel, {result.label_of(test)}. {box}",
            partial(channel_boxes, result, test),
        )
        for test in tests
    ]
    return figures


def _histories(result: StudyResult) -> list[ReportFigure]:
    level = 100 * float(result.settings["statistics"]["level"])
    edges = ", and that band calibrated (dotted)" if result.is_calibrated else ""
    return [
        ReportFigure(
            f"history_{test}_{window:03d}",
            "histories",
            f"Time histories, {result.label_of(test)}: deviations from the training mean in "
            "training standard deviations; measured, deterministic forecast, and the ensemble's "
            f"mean with its {level:g} % band{edges}.",
            partial(history_figure, result, test, training, window),
        )
        for test, training, window in shown_cells(result)
    ]


def _judgements(result: StudyResult) -> list[ReportFigure]:
    ensembles = [model for model in result.models if result.is_ensemble(model)]
    split = float(result.settings["statistics"]["split_period"])
    figures = [
        ReportFigure(
            "error_over_time",
            "time",
            "ε(t): mean over all cells (lines) and quartiles (shaded), with the p-value of its "
            f"trend test; the error as a whole, and parted at a period of {split:g} T̂ into slow "
            "drift and waves. Rows have scales of their own.",
            partial(error_over_time_figure, result),
        )
    ]
    figures += [
        ReportFigure(
            f"densities_{model}",
            "densities",
            f"Densities of measurement and {model_words(model)} forecast with the 95 % bands of "
            "their moving-block bootstrap (paper's settings); area 1 each, no common height.",
            partial(density_figure, result, model),
        )
        for model in (ensembles or result.models[:1])
    ]
    figures += [
        ReportFigure(
            f"hyperparameters_{model}",
            "members",
            f"Median ANRMSE of each member of the {model_words(model)} ensemble over all cells, "
            "against what was drawn for it, with Spearman's rank correlation.",
            partial(hyperparameter_figure, result, model),
        )
        for model in ensembles
    ]
    if any(name.startswith("eigenvalues/") for name in result.groups):
        figures.append(
            ReportFigure(
                "eigenvalues",
                "members",
                "Eigenvalues of the models of the first training set: upper half of the complex "
                "plane, and modulus against frequency. A modulus of 1 neither grows nor decays; "
                f"those below {LOWEST:g} are left out on the right.",
                partial(eigenvalue_figure, result),
            )
        )
    return figures
