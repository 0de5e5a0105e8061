"""Errors of cells: averages, channels, scales, age, bands, densities, members, service."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import xarray as xr

from seakeep.report.figures.errors import (
    BAND_WORDS,
    FEWEST,
    LOWEST,
    average_boxes,
    channel_boxes,
    density_figure,
    eigenvalue_figure,
    error_over_time_figure,
    growth_text,
)
from seakeep.report.page import Section, drawing, section
from seakeep.report.sections.summary import by_channel, conditional, overview_table
from seakeep.report.style import HEADING, judged_models, model_words
from seakeep.report.tables import (
    MISSING,
    Number,
    Table,
    beside,
    entries,
    number,
    percent,
    row,
    short,
    signed,
    small_number,
    table,
)
from seakeep.report.tables import (
    words as known_words,
)
from seakeep.study import StudyResult
from seakeep.study.judge import VARIANTS

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
    tables = [overview_table(result), *(error_table(result, test) for test in tests)]
    return section("errors", figures=figures, tables=tables)


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
    judged = response.sel(channel=result.channels, model=judged_models(result))
    for of_model in entries(judged, "channel", "model"):
        cells = [result.words_of(str(of_model["channel"].values)), _model_of(of_model)]
        for at in entries(of_model, "test"):
            offset, *others = (float(at[f"error_{key}"]) for key in ("offset", "wave", "rest"))
            total = float(np.sum(np.square([offset, *others])))
            share = Number(f"{percent(offset**2 / total)} %") if total > 0 else MISSING
            cells += [*row(at, amplitude_ratio=2, phase_lead=signed, error_offset=2), share]
        rows.append(tuple(cells))
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


def _model_of(at: xr.Dataset) -> str:
    """Words of the model of an entry."""
    return model_words(str(at["model"].values))


def _test_of(result: StudyResult, at: xr.Dataset) -> str:
    """Words of the test set of an entry."""
    return result.label_of(str(at["test"].values))


def bands(result: StudyResult) -> Section | None:
    """Return coverage and scores of bands by wave height, horizon and channel."""
    if "statistics/bands" not in result.groups:
        return None
    groups, tables = result.groups["statistics/bands"], []
    level = short(100 * float(result.settings["statistics"]["level"]))
    for model in filter(result.is_ensemble, result.models):
        for at in entries(groups.sel(model=model), "band"):
            at = at.sel(test=at["inside"].notnull().any(["part", "channel"]))
            if at.sizes["test"]:
                band = str(at["band"].values)
                kind = "calibrated " * (band == "calibrated")
                title = f"{kind}{level} % band of the {model_words(model)} model".capitalize()
                name = f"bands_{band}_{model}"
                tables += [_by_part(result, at, name, title), _of_all(result, at, name, title)]
    return section("bands", tables=tables) if tables else None


def _by_part(result: StudyResult, at: xr.Dataset, name: str, title: str) -> Table:
    """Averages over the channels, a row per test set and part."""
    scale = at["relative_width"] / at["width"]  # one over the measured SD
    scores = at[["winkler", "crps"]] * scale
    at = at.assign(scores)
    rows = []
    for one in entries(at, "test", "part"):
        inside = one["inside"]
        if inside.isnull().all():
            continue
        least = inside[int(np.nanargmin(inside.values))]
        named = result.words_of(str(least["channel"].values))
        moving = one[["relative_width", "winkler", "crps"]].map(lambda x: x.where(np.isfinite(x)))
        means = row(moving.mean("channel"), relative_width=2, winkler=2, crps=2)
        covered = (number(inside.mean(), 2), f"{number(least, 2)} ({named})")
        rows.append((_test_of(result, one), *row(one, "part"), *covered, *means))
    return table("bands", rows, {"band": title}, conditional(result), name=name)


def _of_all(result: StudyResult, at: xr.Dataset, name: str, title: str) -> Table:
    """All instants, a row per test set and channel."""
    units, three = result.groups["channels"]["units"], partial(short, digits=3)
    rows = [
        (
            _test_of(result, one),
            f"{result.words_of(channel)} [{units.sel(name=channel).item()}]",
            *row(one, inside=2, relative_width=2, winkler=three, crps=three),
        )
        for one in entries(at.sel(part="all"), "test", "channel")
        for channel in row(one, "channel")
    ]
    words = {"band": title}
    return table("bands_by_channel", rows, words, conditional(result), name=f"{name}_channels")


def age(result: StudyResult) -> Section:
    """Return the error over the age of a forecast."""
    split = float(result.settings["statistics"]["split_period"])
    figure = drawing("error_over_time", partial(error_over_time_figure, result), {"split": split})
    trend = result.groups["statistics/trend"].sel(model=judged_models(result))
    rows = [
        (
            _test_of(result, at),
            BAND_WORDS[str(at["band"].values)],
            _model_of(at),
            number(at["error_mean"].mean()),
            Number(growth_text(at)),
        )
        for at in entries(trend, "test", "band", "model")
    ]
    words = {"split": split, "seconds": split * float(result.attrs["encounter_period"])}
    return section(
        "time", figures=[figure], tables=[table("trend", rows, words, conditional(result))]
    )


def coverage(result: StudyResult) -> Section | None:
    """Return coverage and width of the bands of ensembles."""
    kinds = (False, True) if result.is_calibrated else (False,)
    ensembles = filter(result.is_ensemble, result.models)
    tables = [coverage_table(result, model, kind) for model in ensembles for kind in kinds]
    return section("coverage", tables=tables) if tables else None


def coverage_table(result: StudyResult, model: str, calibrated: bool = False) -> Table:
    """Coverage and width of the members' band, or of the calibrated one, per test and channel."""
    prefix, band = "calibrated_" * calibrated, "calibrated" if calibrated else "members"
    shares = result.groups["statistics/coverage"].sel(model=model, band=band)
    true = "truth" in shares["against"].values
    kinds, two = ("inside" + " [of the truth]" * true, "width [SD]"), partial(number, digits=2)

    def cells(name: str) -> Iterator[str]:
        for test in result.tests:
            at = shares.sel(test=test, channel=name)
            yield beside(*at["inside"], form=two) if true else two(*at["inside"])
            yield two(at["relative_width"].sel(against="measured"))

    level = float(result.settings["statistics"]["level"])
    more = _calibrated_words(result, model, level) if calibrated else ""
    if true:
        more += (
            " In brackets, of the true instants. The truth is the virtual tank's, without noise or "
            "slap; rates are not filtered."
        )
    heads = [f"{result.label_of(test)}: {each}" for test in result.tests for each in kinds]
    words = {"kind": prefix.replace("_", " "), "level": short(100 * level), "part": level}
    return by_channel(
        result,
        "coverage",
        cells,
        {**words, "model": model_words(model)},
        columns=heads,
        name=f"coverage_{prefix}{model}",
        more=more + conditional(result),
    )


def _calibrated_words(result: StudyResult, model: str, level: float) -> str:
    """How the calibrated band is made, what it rests on, and where it is of no use."""
    group = result.groups["calibration"].sel(ensemble=model)
    words = "these quantiles, moved outwards by a margin found"
    if "floor" in group:
        learnt = "law" in group
        scale = (
            "a scale learnt from spread, horizon and waves"
            if learnt
            else "the spread of the members"
        )
        words = (
            f"the mean, and a factor times {scale} (with a "
            "floor of a quarter of the root mean square error) to either side, found"
        )
    said = (
        f" Calibrated: {words} on training data that the members had not read, in windows as long "
        "as the first test set's. "
    )
    lengths = {test: float(each["length"]) for test, each in result.settings["tests"].items()}
    first = lengths[next(iter(result.tests))]
    others = [f"{result.label_of(k)} ({n:g} T̂)" for k, n in lengths.items() if n != first]
    if others:
        said += f"Those are {first:g} T̂ long; the margin is not made for {', '.join(others)}. "
    if not group["windows"].all():
        said += "Some training sets hold no such window. "
    else:
        windows, blocks = (
            " to ".join(dict.fromkeys(f"{each:.0f}" for each in (values.min(), values.max())))
            for values in (group["windows"].values, group["blocks"].values)
        )
        said += (
            f"A training set had {windows} of them; allowing for their dependence, their "
            f"scores are worth {blocks} independent ones. "
        )
        if (warranted := float(group["warranted"].min())) < level:
            said += f"Of some channels that is too few: {warranted:.2f} is guaranteed there. "
    return said + "The margin guarantees nothing in another kind of sea."


def densities(result: StudyResult) -> Section:
    """Return densities of measurement and forecasts, and their divergence."""
    ensembles = [model for model in result.models if result.is_ensemble(model)]
    figures = []
    for model in ensembles or result.models[:1]:
        draw, words = partial(density_figure, result, model), {"model": model_words(model)}
        figures.append(drawing("densities", draw, words, f"densities_{model}"))
    order = sorted(judged_models(result), key=lambda model: model not in ensembles)
    tables = [divergence_table(result, m, variant) for m in order for variant in VARIANTS]
    return section("densities", figures=figures, tables=tables)


def divergence_table(result: StudyResult, model: str, variant: str) -> Table:
    """Jensen–Shannon divergence per channel beside its noise floor and, if asked, the paper's."""
    data = result.groups["statistics/divergence"]
    at = data.sel(model=model, variant=variant)
    keys = ("mean", "lower", "upper", "uncertainty", "noise_floor")
    comparable = result.is_ensemble(model) and result.shows_paper

    def cells(name: str) -> Iterator[str]:
        of_all = name == "average"
        one = at.mean("channel", skipna=False) if of_all else at.sel(channel=name)
        yield from (small_number(one[key]) for key in keys)
        yield "" if of_all else number(one["block_length"], 0)
        if comparable:
            yield from known_words()["published"].get(name, (MISSING,) * 4)

    quantiles = ("EV", "q0.025", "q0.975", "U")
    heads = [*quantiles, "noise floor", "block (samples)"]
    published = [f"paper: {each}" for each in quantiles] if comparable else []
    how = "blocks may cross joins, block length and bandwidth as printed in the paper"
    if variant == "recommended":
        how = "no block crosses a join, Politis–White blocks, Silverman's bandwidth"
    more = " The paper's columns are of another vessel in another tank." * comparable
    test = result.label_of(str(data.attrs["test"]))
    return by_channel(
        result,
        "jsd",
        cells,
        {"model": model_words(model), "test": test, "variant": variant, "how": how},
        columns=[*heads, *published],
        name=f"jsd_{model}_{variant}",
        more=more + conditional(result),
        elsewhere=range(1 + len(heads), 1 + len(heads) + len(published)),
        folded=not result.is_ensemble(model) and any(map(result.is_ensemble, result.models)),
    )


def eigenvalues(result: StudyResult) -> Section | None:
    """Return the eigenvalues of the models of the first training set."""
    if not any(name.startswith("eigenvalues/") for name in result.groups):
        return None
    figure = drawing("eigenvalues", partial(eigenvalue_figure, result), {"lowest": LOWEST})
    return section("eigenvalues", figures=[figure])
