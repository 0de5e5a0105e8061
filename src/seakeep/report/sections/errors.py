"""Errors of all cells: averages, channels, scales, regular waves, and bands of ensembles."""

from __future__ import annotations

from functools import partial

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.report.figures.boxes import FEWEST, average_boxes, channel_boxes
from seakeep.report.figures.common import HEADING, judged_models, model_words
from seakeep.report.section import Drawing, Section
from seakeep.report.sections.summary import by_channel, conditional, overview_table
from seakeep.report.tables import Table, number, signed
from seakeep.study import StudyResult
from seakeep.study.judge import verdict

__all__ = ["bands", "error_table", "errors", "regular", "response_table", "scales"]

SELDOM = 0.01
"""Part of a run's samples below which a slack line is not worth a word."""

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
    heads = [
        f"{measure.upper()} {model_words(m)}: median [IQR]" for measure in HEADING for m in models
    ]

    def cells(name: str) -> list[str]:
        at = boxes.sel(channel=name)
        spread = at["upper_quartile"] - at["lower_quartile"]
        return [
            "{} [{}]".format(*(number(x.sel(model=m, measure=k)) for x in (at["median"], spread)))
            for k in HEADING
            for m in models
        ]

    note = (
        f"Over {int(result.tests[test]['judged'].sum())} cells (training set × test window). "
        "Errors in measured standard deviations of the window, k = 1. The average row is the "
        "paper's ANRMSE and NAMMAE: the average of each cell over its channels, then the median "
        "over the cells."
    )
    if left_out := int(boxes["left_out"].sel(model=models, measure="nrmse").sum()):
        note += (
            f" {left_out} values were left out: a channel whose measured SD is below 1 % of its "
            "training SD (a slack line), or more than half of whose variance is noise, is not "
            "judged, nor is a forecast that diverged."
        )
    folded = test != next(iter(result.tests))
    title = f"ANRMSE and NAMMAE, {result.label_of(test)}"
    return by_channel(result, f"errors_{test}", title, heads, cells, note, folded=folded)


def scales(result: StudyResult) -> Section:
    """Return errors counted in both standard deviations."""
    words = (
        "A window may hold little of a channel's motion: in regular waves drift stands still, at a "
        "mean far from that of the training, and an error that is small beside the motions of the "
        "training is many SD of the window."
    )
    tables = tuple(_scales_table(result, test) for test in result.tests)
    return Section("scales", "Errors in SD of the training", words=(words,), tables=tables)


def _scales_table(result: StudyResult, test: str) -> Table:
    data = result.tests[test]
    median = result.groups["statistics/boxes"]["median"].sel(test=test)
    spread = data["measured"].std("time", ddof=1) / data["training_std"]
    size = spread.where(data["judged"]).median(["training", "window"])

    def cells(name: str) -> list[str]:
        at = median.sel(channel=name)
        part = "" if name == "average" else number(size.sel(channel=name), 2)
        both = [
            [number(at.sel(model=m, measure=key)) for key in ("nrmse", "training_nrmse")]
            for m in result.models
        ]
        return [part, *(f"{window} ({training})" for window, training in both)]

    return by_channel(
        result,
        f"scales_{test}",
        f"Errors in SD of the window, and in SD of the training, {result.label_of(test)}",
        ("SD of the window [training SD]", *map(model_words, result.models)),
        cells,
        "Medians over the cells of the root mean square error, in SD of the window, and in "
        "parentheses in SD of the training set. A channel that barely moves in the window is not "
        "judged in the first, and counts in the second.",
        folded=test != next(iter(result.tests)),
    )


def regular(result: StudyResult) -> Section | None:
    """Return the errors in regular waves, taken apart."""
    if "statistics/response" not in result.groups:
        return None
    tests = [str(test) for test in result.groups["statistics/response"]["test"].values]
    return Section(
        "regular",
        "Regular waves: where the error comes from",
        words=[*filter(None, [_slack_words(result, tests)])],
        tables=(response_table(result, tests),),
    )


def response_table(result: StudyResult, tests: list[str]) -> Table:
    """Amplitude ratio, phase lead and offset of each channel, test set by test set."""
    rows, columns = [], ["channel", "model"]
    for test in tests:
        label = result.label_of(test).removeprefix("regular, ")
        columns += [f"{label}: {key}" for key in ("amplitude", "phase [°]", "offset [SD]", "share")]
    for name in result.channels:
        for model in judged_models(result):
            row = [result.words_of(name), model_words(model)]
            for test in tests:
                at = result.groups["statistics/response"].sel(test=test, channel=name, model=model)
                parts = [float(at[f"error_{key}"]) for key in ("offset", "wave", "rest")]
                total = float(np.sum(np.square(parts)))
                share = 100 * parts[0] ** 2 / total if total > 0 else np.nan
                row += [
                    number(at["amplitude_ratio"], 2),
                    signed(at["phase_lead"], 0),
                    number(parts[0], 2),
                    f"{number(share, 0)} %" if np.isfinite(share) else number(share),
                ]
            rows.append(tuple(row))
    return Table(
        "response",
        "Forecast against measurement at the wave's frequency",
        columns,
        rows,
        "Amplitude: ratio of forecast to measurement; phase: positive where the forecast is early; "
        "offset: root mean square over the cells of the difference of means, in measured SDs; "
        "share: the offset's part of the mean square error." + conditional(result),
        range(2, len(columns)),
    )


def _slack_words(result: StudyResult, tests: list[str]) -> str:
    """Name the lines that lose their load, run by run."""
    tested = {str(run): test for test in tests for run in result.tests[test]["run"].values}
    slack = result.groups["runs"]["slack"].sel(run=list(tested), name=result.channels)
    listed = [
        f"{result.words_of(str(name))} in {100 * float(part):.0f} % of {run}"
        for run in tested
        for name, part in zip(slack["name"].values, slack.sel(run=run).values, strict=True)
        if part >= SELDOM
    ]
    if not listed:
        return ""
    return (
        f"Slack line (a load within the SD of its noise): {', '.join(listed)}. A slack line does "
        "not respond linearly; where it is slack throughout, only noise is left to be forecast."
    )


def bands(result: StudyResult) -> Section | None:
    """Return coverage and scores of bands by wave height, horizon and channel."""
    if "statistics/bands" not in result.groups:
        return None
    found = result.groups["statistics/bands"]
    groups = {
        str(test): found.sel(test=test).dropna("part", how="all") for test in found["test"].values
    }
    tables = [
        make(result, groups, model, band)
        for model in (m for m in result.models if result.is_ensemble(m))
        for band in ("members", "calibrated")
        for make in (_by_part, _by_channel)
        if any(_known(data, model, band) for data in groups.values())
    ]
    if not tables:
        return None
    words = (
        "Thirds of the instants by the height of the waves around them, and by the age of the "
        "forecast. The Winkler score is the width of the band and 2/(1 − level) times what "
        "lies outside of it; the CRPS is that of the normal distribution that the band stands "
        "for. Less is better in both: a band that is wide without need scores badly, and so does "
        "a narrow one that misses."
    )
    return Section(
        "bands", "Bands by waves, horizon and channel", words=(words,), tables=(*tables,)
    )


def _known(data: xr.Dataset, model: str, band: str) -> bool:
    """Whether a test set has that band."""
    here = band in data["band"].values and model in data["model"].values
    return here and bool(data["inside"].sel(model=model, band=band).notnull().any())


def _by_part(result: StudyResult, groups: dict[str, xr.Dataset], model: str, band: str) -> Table:
    """Averages over the channels, a row per test set and part."""
    rows = []
    for test, data in groups.items():
        if not _known(data, model, band):
            continue
        at = data.sel(model=model, band=band)
        for part in data["part"].values:
            one = at.sel(part=part)
            scale = one["relative_width"] / one["width"]  # one over the measured SD
            least = one["channel"].values[int(np.nanargmin(one["inside"].values))]
            rows.append(
                (
                    result.label_of(test),
                    str(part),
                    number(one["inside"].mean(), 2),
                    f"{number(one['inside'].min(), 2)} ({result.words_of(str(least))})",
                    number(_mean(one["relative_width"].values), 2),
                    *(number(_mean((one[key] * scale).values), 2) for key in ("winkler", "crps")),
                )
            )
    return Table(
        f"bands_{band}_{model}",
        f"{_title(result, model, band)}, in parts",
        ("test set", "instants", "inside", "least covered", "width", "Winkler", "CRPS"),
        rows,
        "Averages over the channels; width and scores in measured SD of the test set."
        + conditional(result),
        (2, 4, 5, 6),
    )


def _by_channel(result: StudyResult, groups: dict[str, xr.Dataset], model: str, band: str) -> Table:
    """All instants, a row per test set and channel."""
    units = result.groups["channels"]
    rows = []
    for test, data in groups.items():
        if not _known(data, model, band):
            continue
        at = data.sel(model=model, band=band, part="all")
        for name in result.channels:
            one = at.sel(channel=name)
            rows.append(
                (
                    result.label_of(test),
                    f"{result.words_of(name)} [{units['units'].sel(name=name).item()}]",
                    number(one["inside"], 2),
                    number(one["relative_width"], 2),
                    *(f"{float(one[key]):.3g}" for key in ("winkler", "crps")),
                )
            )
    return Table(
        f"bands_{band}_{model}_channels",
        f"{_title(result, model, band)}, by channel",
        ("test set", "channel", "inside", "width [SD]", "Winkler", "CRPS"),
        rows,
        "Scores in the unit of the channel (SI)." + conditional(result),
        (2, 3, 4, 5),
        folded=True,
    )


def _title(result: StudyResult, model: str, band: str) -> str:
    level = 100 * float(result.settings["statistics"]["level"])
    kind = "calibrated " if band == "calibrated" else ""
    return f"{kind}{level:g} % band of the {model_words(model)} model".capitalize()


def _mean(values: FloatArray) -> float:
    """Mean over the channels that move; NaN if there are none."""
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else np.nan
