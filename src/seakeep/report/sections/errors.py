"""Errors of all cells: averages, and channel by channel."""

from __future__ import annotations

from functools import partial

import xarray as xr

from seakeep.report.figures.boxes import FEWEST, average_boxes, channel_boxes
from seakeep.report.figures.common import HEADING, judged_models, model_words
from seakeep.report.section import Drawing, Section
from seakeep.report.sections.summary import conditional, overview_table
from seakeep.report.tables import Table, number, signed
from seakeep.study import StudyResult
from seakeep.study.judge import verdict

__all__ = ["error_table", "errors"]

BOX = (
    "Boxes: quartiles; whiskers: furthest values within 1.5 inter-quartile ranges; violins: "
    f"density, from {FEWEST} cells on; dots: single cells, outliers included."
)


def errors(result: StudyResult) -> Section:
    """Return the errors of every model in every test set."""
    tests = list(result.tests)
    groups = [tests[:1], tests[1:]] if len(tests) <= 9 else [tests]
    averages = [
        Drawing(
            f"errors_{group[0] if len(group) == 1 else 'others'}",
            f"ANRMSE and NAMMAE of all cells ({', '.join(map(result.label_of, group))}). {BOX}",
            partial(average_boxes, result, group),
        )
        for group in groups
        if group
    ]
    channels = [
        Drawing(
            f"errors_{test}_by_channel",
            f"NRMSE and NAMMAE channel by channel, {result.label_of(test)}. {BOX}",
            partial(channel_boxes, result, test),
        )
        for test in tests
    ]
    tables = [overview_table(result), *(error_table(result, test) for test in tests)]
    if "statistics/skill" in result.groups:
        tables.insert(1, _skill_table(result))
    return Section("errors", "Errors", figures=(*averages, *channels), tables=tuple(tables))


def _skill_table(result: StudyResult) -> Table:
    """By how much each model beats the baselines among the models, or does not."""
    rows = []
    skill = result.groups["statistics/skill"]
    for test in map(str, skill["test"].values):
        data = skill.sel(test=test).dropna("reference", how="all", subset=["change"])
        names = [str(each) for each in data["reference_model"].values]
        for reference, name in zip(data["reference"].values, names, strict=True):
            for model in result.models:
                at = data.sel(model=model, reference=reference)
                if model != name:
                    cells = (_with_interval(at.sel(measure=key)) for key in HEADING)
                    what = str(reference).replace("_", " ")
                    against = what if name == reference else f"{what} ({model_words(name)})"
                    rows.append((result.label_of(test), against, model_words(model), *cells))
    return Table(
        "skill",
        "Models against the baselines",
        ("test set", "baseline", "model", *(f"{each} [%], 95 %" for each in HEADING.values())),
        rows,
        "Change of the median error against the baseline's: −20 % is an error smaller by a fifth; "
        "intervals by a two-way block bootstrap over training sets and windows. "
        "Best linear: the linear baseline of least median ANRMSE in the test set.",
        (3, 4),
        folded=True,
    )


def _with_interval(at: xr.Dataset) -> str:
    """Relative change with its interval, in percent; undecided where the interval holds zero."""
    change, low, high = (signed(100 * float(at[k]), 0) for k in ("change", "lower", "upper"))
    if verdict(float(at["lower"]), float(at["upper"])) == "cannot tell":
        return f"{change} [{low}, {high}] cannot tell"
    return f"{change} [{low}, {high}]"


def error_table(result: StudyResult, test: str) -> Table:
    """Medians and inter-quartile ranges of both measures, average and per channel."""
    boxes = result.groups["statistics/boxes"].sel(test=test)
    models = judged_models(result)
    columns = ["channel"]
    for measure in HEADING:
        columns += [f"{measure.upper()} {model_words(m)}: median [IQR]" for m in models]
    rows, left_out = [], 0
    names = [str(name) for name in boxes["channel"].values]
    for name in [*names[1:], names[0]]:
        row = ["average" if name == "average" else result.words_of(name)]
        for measure in HEADING:
            for model in models:
                at = boxes.sel(model=model, measure=measure, channel=name)
                spread = float(at["upper_quartile"] - at["lower_quartile"])
                row.append(f"{number(at['median'])} [{number(spread)}]")
                left_out += int(at["left_out"]) if measure == "nrmse" else 0
        rows.append(tuple(row))
    note = (
        f"Over {int(result.tests[test]['judged'].sum())} cells (training set × test window). "
        "Errors in measured standard deviations of the window, k = 1. The average row is the "
        "paper's ANRMSE and NAMMAE: the average of each cell over its channels, then the median "
        "over the cells."
    )
    if left_out:
        note += (
            f" {left_out} values were left out: a channel whose measured SD is below 1 % of its "
            "training SD (a slack line), or more than half of whose variance is noise, is not "
            "judged, nor is a forecast that diverged."
        )
    return Table(
        f"errors_{test}",
        f"ANRMSE and NAMMAE, {result.label_of(test)}",
        columns,
        rows,
        note + conditional(result),
        range(1, len(columns)),
        averages=[len(rows) - 1],
        folded=test != next(iter(result.tests)),
    )
