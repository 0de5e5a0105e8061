"""Errors of all cells: averages, channels, scales, regular waves, and bands of ensembles."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from seakeep.report.figures.errors import FEWEST, average_boxes, channel_boxes
from seakeep.report.page import Section, drawing, section
from seakeep.report.sections.summary import by_channel, conditional, overview_table
from seakeep.report.style import HEADING, judged_models, model_words
from seakeep.report.tables import Number, Table, beside, number, percent, short, signed, table
from seakeep.study import StudyResult
from seakeep.study.judge import average_of, verdict

SELDOM = 0.01
"""Part of a run's samples below which a slack line is not worth a word."""


def errors(result: StudyResult) -> Section:
    """Return the errors of every model in every test set."""
    tests = list(result.tests)
    groups = [tests[:1], tests[1:]] if len(tests) <= 9 else [tests]
    figures = []
    for group in filter(None, groups):
        words = {"tests": ", ".join(map(result.label_of, group)), "fewest": FEWEST}
        name = f"errors_{group[0] if len(group) == 1 else 'others'}"
        figures.append(drawing("errors", partial(average_boxes, result, group), words, name))
    for test in tests:
        words, name = (
            {"tests": result.label_of(test), "fewest": FEWEST},
            f"errors_{test}_by_channel",
        )
        draw = partial(channel_boxes, result, test)
        figures.append(drawing("errors_by_channel", draw, words, name))
    skill = [_skill_table(result)] if "statistics/skill" in result.groups else []
    tables = [overview_table(result), *skill, *(error_table(result, test) for test in tests)]
    return section("errors", figures=figures, tables=tables)


def _skill_table(result: StudyResult) -> Table:
    """By how much each model beats the baselines among the models, or does not."""
    rows, skill = [], result.groups["statistics/skill"]
    for test in map(str, skill["test"].values):
        data = skill.sel(test=test).dropna("reference", how="all", subset=["change"])
        for reference in data["reference"].values:
            at = data.sel(reference=reference)
            name, what = str(at["reference_model"].values), str(reference).replace("_", " ")
            against = what if name == reference else f"{what} ({model_words(name)})"
            for model in (each for each in result.models if each != name):
                cells = (_change(at.sel(model=model, measure=key)) for key in HEADING)
                rows.append((result.label_of(test), against, model_words(model), *cells))
    return table("skill", rows)


def _change(at: xr.Dataset) -> Number:
    """Relative change with its interval, in percent; undecided where the interval holds zero."""
    change, *bounds = (float(at[key]) for key in ("change", "lower", "upper"))
    text = beside(100 * change, *(100 * each for each in bounds), form=signed)
    return Number(f"{text} cannot tell") if verdict(*bounds) == "cannot tell" else text


def error_table(result: StudyResult, test: str) -> Table:
    """Medians and inter-quartile ranges of both measures, average and per channel."""
    boxes, models = result.groups["statistics/boxes"].sel(test=test), judged_models(result)
    places = [(measure, model) for measure in HEADING for model in models]
    spread = boxes["upper_quartile"] - boxes["lower_quartile"]

    def cells(name: str) -> Iterator[Number]:
        for measure, model in places:
            at = {"channel": name, "measure": measure, "model": model}
            yield beside(boxes["median"].sel(at), spread.sel(at))

    more = ""
    if left_out := int(boxes["left_out"].sel(model=models, measure="nrmse").sum()):
        more = (
            f" {left_out} values were left out: a channel whose measured SD is below 1 % of its "
            "training SD (a slack line), or more than half of whose variance is noise, is not "
            "judged, nor is a forecast that diverged."
        )
    heads = [f"{key.upper()} {model_words(model)}: median [IQR]" for key, model in places]
    count = int(result.tests[test]["judged"].sum())
    return by_channel(
        result,
        "errors",
        cells,
        {"test": result.label_of(test), "count": count},
        columns=heads,
        name=f"errors_{test}",
        more=more + conditional(result),
        folded=test != next(iter(result.tests)),
    )


def scales(result: StudyResult) -> Section:
    """Return errors counted in both standard deviations."""
    return section("scales", tables=[_scales_table(result, test) for test in result.tests])


def _scales_table(result: StudyResult, test: str) -> Table:
    data = result.tests[test]
    median = result.groups["statistics/boxes"]["median"].sel(test=test)
    spread = data["measured"].std("time", ddof=1) / data["training_std"]
    size = spread.where(data["judged"]).median(["training", "window"])

    def cells(name: str) -> Iterator[str]:
        yield "" if name == "average" else number(size.sel(channel=name), 2)
        for model in result.models:
            at = median.sel(channel=name, model=model)
            both = (number(at.sel(measure=key)) for key in ("nrmse", "training_nrmse"))
            yield "{} ({})".format(*both)

    heads = ("SD of the window [training SD]", *map(model_words, result.models))
    return by_channel(
        result,
        "scales",
        cells,
        {"test": result.label_of(test)},
        columns=heads,
        name=f"scales_{test}",
        more=conditional(result),
        folded=test != next(iter(result.tests)),
    )


def regular(result: StudyResult) -> Section | None:
    """Return the errors in regular waves, taken apart."""
    if "statistics/response" not in result.groups:
        return None
    tests = [str(test) for test in result.groups["statistics/response"]["test"].values]
    words = [_slack_words(result, tests)]
    return section("regular", more=words, tables=[_response_table(result, tests)])


def _response_table(result: StudyResult, tests: list[str]) -> Table:
    """Amplitude ratio, phase lead and offset of each channel, test set by test set."""
    rows, columns, response = [], ["channel", "model"], result.groups["statistics/response"]
    for test in tests:
        label = result.label_of(test).removeprefix("regular, ")
        columns += [f"{label}: {key}" for key in ("amplitude", "phase [°]", "offset [SD]", "share")]
    for name in result.channels:
        for model in judged_models(result):
            row = [result.words_of(name), model_words(model)]
            for test in tests:
                at = response.sel(test=test, channel=name, model=model)
                offset, *others = (float(at[f"error_{key}"]) for key in ("offset", "wave", "rest"))
                total = float(np.sum(np.square([offset, *others])))
                share = Number(f"{percent(offset**2 / total)} %") if total > 0 else number(np.nan)
                row += [number(at["amplitude_ratio"], 2), signed(at["phase_lead"])]
                row += [number(offset, 2), share]
            rows.append(tuple(row))
    return table("response", rows, columns=columns, more=conditional(result))


def _slack_words(result: StudyResult, tests: list[str]) -> str:
    """Name the lines that lose their load, run by run."""
    runs = dict.fromkeys(str(run) for test in tests for run in result.tests[test]["run"].values)
    slack = result.groups["runs"]["slack"].sel(run=list(runs), name=result.channels)
    listed = [
        f"{result.words_of(str(line['name'].values))} in {percent(line)} % of {run}"
        for run in runs
        for line in slack.sel(run=run)
        if line >= SELDOM
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
    found, tables = result.groups["statistics/bands"], []
    for model in filter(result.is_ensemble, result.models):
        for band in (each for each in ("members", "calibrated") if each in found["band"].values):
            at = found.sel(model=model, band=band)
            parts = {
                str(test): at.sel(test=test).dropna("part", how="all", subset=["inside"])
                for test in at["test"].values
            }
            parts = {test: data for test, data in parts.items() if data.sizes["part"]}
            if parts:
                level = short(100 * float(result.settings["statistics"]["level"]))
                kind = "calibrated " * (band == "calibrated")
                title = f"{kind}{level} % band of the {model_words(model)} model".capitalize()
                name = f"bands_{band}_{model}"
                tables += [
                    _by_part(result, parts, name, title),
                    _of_all(result, parts, name, title),
                ]
    return section("bands", tables=tables) if tables else None


def _by_part(result: StudyResult, parts: dict[str, xr.Dataset], name: str, title: str) -> Table:
    """Averages over the channels, a row per test set and part."""
    rows = []
    for test, data in parts.items():
        scale = data["relative_width"] / data["width"]  # one over the measured SD
        scores = [data["relative_width"], *(data[key] * scale for key in ("winkler", "crps"))]
        scores = [each.where(np.isfinite(each)) for each in scores]  # of channels that move
        for part in data["part"].values:
            inside = data["inside"].sel(part=part)
            least = inside[int(np.nanargmin(inside.values))]
            named = result.words_of(str(least["channel"].values))
            means = (average_of(each.sel(part=part).values) for each in scores)
            row = (number(inside.mean(), 2), f"{number(least, 2)} ({named})")
            rows.append((result.label_of(test), str(part), *row, *(number(m, 2) for m in means)))
    return table("bands", rows, {"band": title}, conditional(result), name=name)


def _of_all(result: StudyResult, parts: dict[str, xr.Dataset], name: str, title: str) -> Table:
    """All instants, a row per test set and channel."""
    units = result.groups["channels"]["units"]
    rows = [
        (
            result.label_of(test),
            f"{result.words_of(channel)} [{units.sel(name=channel).item()}]",
            *(number(one[key], 2) for key in ("inside", "relative_width")),
            *(short(one[key], 3) for key in ("winkler", "crps")),
        )
        for test, data in parts.items()
        for channel in result.channels
        for one in [data.sel(part="all", channel=channel)]
    ]
    words = {"band": title}
    return table("bands_by_channel", rows, words, conditional(result), name=f"{name}_channels")
