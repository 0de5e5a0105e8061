"""Tables of a study: as text cells, for the page, as CSV and as LaTeX."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from seakeep.files import replacing
from seakeep.report.figures.common import HEADING, model_words
from seakeep.report.figures.errors import BAND_WORDS
from seakeep.report.published import JSD_MEAN, PUBLISHED
from seakeep.study import StudyResult

__all__ = [
    "ReportTable",
    "coverage_table",
    "divergence_table",
    "error_table",
    "overview_table",
    "trend_table",
    "write_csv_table",
]

MISSING = "–"


@dataclass(frozen=True)
class ReportTable:
    """A table.

    Parameters
    ----------
    name : str
        Name of its files.
    title : str
        Caption.
    columns : tuple of str
        Headings.
    rows : tuple of tuple of str
        Cells.
    note : str
        What a reader must know about it.
    numeric : tuple of int
        Columns of numbers.
    elsewhere : tuple of int
        Columns that come from another data set.
    averages : tuple of int
        Rows that are averages of others.
    folded : bool
        Whether a page folds it away until it is wanted.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    numeric: tuple[int, ...] = ()
    elsewhere: tuple[int, ...] = ()
    averages: tuple[int, ...] = ()
    folded: bool = False


def number(value: float, digits: int = 3) -> str:
    """Text of a number; a dash for one that is not finite."""
    if not np.isfinite(value):
        return MISSING
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def small_number(value: float) -> str:
    """Text of a number of four decimals, or as many more as two digits of it need.

    Examples
    --------
    >>> small_number(0.0186), small_number(0.00023), small_number(-1.4e-5), small_number(3e-9)
    ('0.0186', '0.00023', '-0.000014', '3.0e-09')
    """
    if not np.isfinite(value) or value == 0:
        return number(value, 0)
    decimals = max(4, 1 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{decimals}f}" if decimals <= 7 else f"{value:.1e}"


def probability(value: float) -> str:
    """Text of a p-value."""
    return "< 0.001" if value < 0.001 else number(value)


def error_table(result: StudyResult, test: str) -> ReportTable:
    """Medians and inter-quartile ranges of both measures, average and per channel.

    Parameters
    ----------
    result : StudyResult
        The study.
    test : str
        Test set.

    Returns
    -------
    ReportTable
    """
    boxes = result.groups[f"statistics/boxes/{test}"]
    columns = ["channel"]
    for measure in HEADING:
        name = "NRMSE" if measure == "nrmse" else "NAMMAE"
        columns += [f"{name} {model_words(model)}: median [IQR]" for model in result.models]
    rows, left_out = [], 0
    names = [str(name) for name in boxes["channel"].values]
    for name in [*names[1:], names[0]]:
        row = ["average" if name == "average" else result.words_of(name)]
        for measure in HEADING:
            for model in result.models:
                at = boxes.sel(model=model, measure=measure, channel=name)
                spread = float(at["upper_quartile"] - at["lower_quartile"])
                row.append(f"{number(float(at['median']))} [{number(spread)}]")
                left_out += int(at["left_out"]) if measure == "nrmse" else 0
        rows.append(tuple(row))
    judged = int(result.tests[test]["judged"].sum())
    note = (
        f"Over {judged} cells (training set × test window). Errors in measured standard deviations "
        "of the window, k = 1. The average row is the paper's ANRMSE and NAMMAE: the average of "
        "each cell over its channels, then the median over the cells."
    )
    if left_out:
        note += (
            f" {left_out} values were left out: a channel whose measured SD is below 1 % of its "
            "training SD (a slack line) is not judged, nor is a forecast that diverged."
        )
    return ReportTable(
        f"errors_{test}",
        f"ANRMSE and NAMMAE, {result.label_of(test)}",
        tuple(columns),
        tuple(rows),
        note + conditional(result),
        tuple(range(1, len(columns))),
        averages=(len(rows) - 1,),
    )


def overview_table(result: StudyResult) -> ReportTable:
    """Both measures of each model in each test set, averages over the channels.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    ReportTable
    """
    rows = []
    for test in result.tests:
        boxes = result.groups[f"statistics/boxes/{test}"].sel(channel="average")
        for model in result.models:
            row = [result.label_of(test), model_words(model)]
            for measure in HEADING:
                at = boxes.sel(model=model, measure=measure)
                spread = float(at["upper_quartile"] - at["lower_quartile"])
                row += [number(float(at["median"])), number(spread)]
            count = boxes.sel(model=model, measure="nrmse")["count"]
            rows.append((*row, str(int(count))))
    heads = [f"{words} {k}" for words in HEADING.values() for k in ("median", "IQR")]
    return ReportTable(
        "overview",
        "ANRMSE and NAMMAE",
        ("test set", "model", *heads, "cells"),
        tuple(rows),
        "Medians and inter-quartile ranges over all cells (training set × test window) of the "
        "average over the channels that are judged; in measured standard deviations."
        + conditional(result),
        (2, 3, 4, 5, 6),
    )


def conditional(result: StudyResult) -> str:
    """Sentence for tables whose forecasts read a measured output after the start."""
    words = str(result.attrs.get("conditional_on", ""))
    return f" Conditional on measured {words}." if words else ""


def divergence_table(result: StudyResult, model: str, variant: str) -> ReportTable:
    """Jensen–Shannon divergence of all channels beside its noise floor and, if asked, the paper's.

    Parameters
    ----------
    result : StudyResult
        The study.
    model : str
        The model.
    variant : {"paper", "recommended"}
        Settings of the bootstrap.

    Returns
    -------
    ReportTable
    """
    data = result.groups["statistics/divergence"]
    at = data.sel(model=model, variant=variant)
    numbers = ("mean", "lower", "upper", "uncertainty", "noise_floor")
    comparable = result.is_ensemble(model) and result.shows_paper
    rows = []
    for name in result.channels:
        one = at.sel(channel=name)
        row = [result.words_of(name), *(small_number(float(one[key])) for key in numbers)]
        row.append(str(int(one["block_length"])) if np.isfinite(one["block_length"]) else MISSING)
        rows.append((*row, PUBLISHED.get(name, MISSING)) if comparable else tuple(row))
    means = [small_number(float(at[key].mean())) for key in numbers]
    rows.append(("average", *means, "", *((JSD_MEAN,) if comparable else ())))
    columns = ("channel", "EV", "q0.025", "q0.975", "U", "noise floor", "block (samples)")
    test = result.label_of(str(data.attrs["test"]))
    how = "blocks may cross joins, block length and bandwidth as printed in the paper"
    if variant == "recommended":
        how = "no block crosses a join, Politis–White blocks, Silverman's bandwidth"
    return ReportTable(
        f"jsd_{model}_{variant}",
        f"Divergence of the densities, {model_words(model)}, {test}: {variant} variant",
        (*columns, "paper: EV, another data set") if comparable else columns,
        tuple(rows),
        f"Nats, 0 to ln 2; {how}. The noise floor is the divergence of the measurement from "
        "itself under two independent bootstraps: what a record of this length cannot tell from "
        "none." + conditional(result),
        tuple(range(1, len(columns) + int(comparable))),
        elsewhere=(len(columns),) if comparable else (),
        averages=(len(rows) - 1,),
    )


def coverage_table(result: StudyResult, model: str, calibrated: bool = False) -> ReportTable:
    """Coverage and width of a band of an ensemble, each test set, each channel.

    Parameters
    ----------
    result : StudyResult
        The study.
    model : str
        An ensemble.
    calibrated : bool, optional
        Its calibrated band, where the study has one, in place of the members' own.

    Returns
    -------
    ReportTable
    """
    prefix, words = ("calibrated_", "calibrated ") if calibrated else ("", "")
    columns = ["channel"]
    tables = {test: result.groups[f"statistics/coverage/{test}"].sel(model=model)
              for test in result.tests}  # fmt: skip
    true = any("truth" in data["against"].values for data in tables.values())
    for test in tables:
        columns.append(f"{result.label_of(test)}: inside" + (" [of the truth]" if true else ""))
        columns.append(f"{result.label_of(test)}: width [SD]")
    names = [*result.channels, "average"]
    rows = []
    for name in names:
        row = ["average" if name == "average" else result.words_of(name)]
        for data in tables.values():
            at = data.sel(channel=name)
            first, *others = (number(float(v), 2) for v in at[f"{prefix}inside"].values)
            row.append(first + "".join(f" [{each}]" for each in others))
            width = at[f"{prefix}relative_width"].sel(against="measured")
            row.append(number(float(width), 2))
        rows.append(tuple(row))
    level = float(result.settings["statistics"]["level"])
    note = (
        f"Part of the measured instants inside the band of nominally {level:g} (quantiles of the "
        "members), and its mean width in measured SD; means over all cells."
    )
    if calibrated:
        note += (
            " Calibrated: these quantiles, moved outwards by a margin found on training data that "
            "the members had not read, in windows as long as the first test set's. "
            + _other_lengths(result)
            + _calibrated_on(result.groups[f"calibration/{model}"], level)
            + "The margin warrants nothing in a sea of another kind."
        )
    if true:
        note += (
            " In brackets, of the true instants. The truth is the virtual tank's, without noise or "
            "slap; rates are not filtered."
        )
    return ReportTable(
        f"coverage_{prefix}{model}",
        f"Coverage of the {words}{100 * level:g} % band, {model_words(model)}",
        tuple(columns),
        tuple(rows),
        note + conditional(result),
        tuple(range(1, len(columns))),
        averages=(len(rows) - 1,),
    )


def _other_lengths(result: StudyResult) -> str:
    """Sentence on test sets whose windows are not as long as those that the margin is for."""
    lengths = {test: float(each["length"]) for test, each in result.settings["tests"].items()}
    first = next(iter(result.tests))
    others = [
        f"{result.label_of(test)} ({lengths[test]:g} T̂)"
        for test in result.tests
        if lengths[test] != lengths[first]
    ]
    if not others:
        return ""
    return f"Those are {lengths[first]:g} T̂ long; the margin is not made for {', '.join(others)}. "


def _calibrated_on(found: xr.Dataset, level: float) -> str:
    """Sentence on how much the calibration of a study rests on."""
    windows = found["windows"].values
    if not windows.all():
        return "Some training sets hold no such window. "
    worth = found["blocks"].values
    said = (
        f"A training set had {_span_of(windows)} of them; allowing for their dependence, their "
        f"scores are worth {_span_of(worth)} independent ones. "
    )
    warranted = float(found["warranted"].min())
    if warranted < level:
        said += f"Of some channels that is too few: {warranted:.2f} is warranted there. "
    return said


def _span_of(values: np.ndarray[Any, Any]) -> str:
    low, high = (f"{float(each):.0f}" for each in (values.min(), values.max()))
    return low if low == high else f"{low} to {high}"


def trend_table(result: StudyResult) -> ReportTable:
    """Trend of ε(t) for each test set, band and model.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    ReportTable
    """
    rows = []
    for test in result.tests:
        data: xr.Dataset = result.groups[f"statistics/trend/{test}"]
        for band, words in BAND_WORDS.items():
            for model in result.models:
                at = data.sel(model=model, band=band)
                interval = ", ".join(small_number(float(at[key])) for key in ("lower", "upper"))
                rows.append(
                    (
                        result.label_of(test),
                        words,
                        model_words(model),
                        number(float(at["error_mean"].mean())),
                        number(float(at["change"])),
                        f"{small_number(float(at['slope']))} [{interval}]",
                        number(float(at["kendall_tau"]), 2),
                        probability(float(at["p_value"])),
                    )
                )
    period = float(result.settings["statistics"]["split_period"])
    seconds = period * float(result.attrs["encounter_period"])
    return ReportTable(
        "trend",
        "Trend of ε(t), whole and in bands",
        (
            "test set", "band", "model", "mean ε", "change over the window",
            "slope [1/s] with 95 %", "Kendall's τ", "p",
        ),
        tuple(rows),
        "Block-bootstrap Mann–Kendall test of ε(t) averaged over all cells. A p below 0.05 says "
        "that the error changes with the age of the forecast; blocks break some of the "
        "dependence, so slow series are called trends too often (10 to 15 %). The error is parted "
        f"at a period of {period:g} T̂ ({seconds:.2f} s) into slow drift and waves; both are "
        "counted in SDs of the whole measured channel." + conditional(result),
        (3, 4, 5, 6, 7),
    )  # fmt: skip


def write_csv_table(table: ReportTable, path: Path) -> Path:
    """Write a table as CSV (UTF-8).

    Parameters
    ----------
    table : ReportTable
        The table.
    path : Path
        The file.

    Returns
    -------
    Path
        The file.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(table.rows)
    with replacing(path) as temporary:
        temporary.write_text(buffer.getvalue(), encoding="utf-8")
    return path
