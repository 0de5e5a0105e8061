"""Results of a study: their summary in sentences, errors, bands and densities, and a glossary."""

import re
import unicodedata
from collections.abc import Iterable, Sequence
from itertools import chain
from typing import Any

import numpy as np
import xarray as xr

from seakeep.conventions import canonical_channel
from seakeep.report.figures.errors import (
    BAND_WORDS,
    FEWEST,
    LOWEST,
    average_boxes,
    channel_boxes,
    density_figure,
    eigenvalue_figure,
    error_over_time_figure,
)
from seakeep.report.figures.histories import history_figure, shown_cells
from seakeep.report.page import Section, drawing, section
from seakeep.report.sections.data import (
    not_chosen,
    test_overlap,
    training_overlap,
    unequal_look_ahead,
    unequal_training,
)
from seakeep.report.style import HEADING, judged_models, listed, model_words
from seakeep.report.tables import (
    MISSING,
    WORDS,
    Number,
    Table,
    band_verdict,
    beside,
    by_channel,
    entries,
    number,
    numbers,
    percent,
    ratio_of,
    reach,
    row,
    short,
    signed,
    small_number,
    table,
    to,
)
from seakeep.study import StudyResult
from seakeep.study.describe import words_of_repeats
from seakeep.study.judge import VARIANTS, words_of_lost


def summary(result: StudyResult) -> Section:
    """Return what was tested and the results, on one screen."""
    shares, words = training_overlap(result)
    lost, repeats = (result.groups.get(key) for key in ("statistics/lost", "repeats"))
    notices = [
        result.attrs.get("preparation_note"),
        words_of_lost(lost) if lost else "",
        words_of_repeats(repeats) if repeats else "",
        words * shares,
        test_overlap(result),
    ]
    name = "heave" if "heave" in result.channels else result.channels[0]
    figures = [
        drawing(
            "first_history",
            history_figure,
            result,
            *place,
            (name,),
            channel=result.words_of(name).capitalize(),
            test=result.label_of(place[0]),
        )
        for place in shown_cells(result)[:1]
    ]
    return section(
        "summary",
        *figures,
        _heat(result),
        more=(_tested(result),),
        points=findings(result),
        notices=tuple(filter(None, notices)),
    )


def _tested(result: StudyResult) -> str:
    """What was tested, in one sentence or two."""
    period = result.encounter_period
    judged = {test: data["judged"].any("window") for test, data in result.tests.items()}
    sets = int(np.any([*judged.values()], axis=0).sum())
    seas = []
    for test, data in result.tests.items():
        used = int(judged[test].sum())
        some = f", models of {used} set{'s' * (used > 1)}" if used < sets else ""
        seas.append(
            f"{result.label_of(test)} ({data.sizes['window']} windows of "
            f"{data['time'].values[-1] / period:.3g} T̂{some})"
        )
    return (
        f"Tested: {listed(result.models)}, each learnt from {sets} training "
        f"set{'s' * (sets > 1)} and run freely through {', '.join(seas)}; {len(result.channels)} "
        "channels. Errors are in measured SDs of the window: 0 is perfect, 1 is no better than its "
        "mean."
    )


def _by_channel(
    result: StudyResult,
    key: str,
    columns: Iterable[Iterable[str]],
    more: str,
    test: str = "",
    **given: Any,
) -> Table:
    """Table of numbers with a row per channel, and one of averages; columns start with headings.

    One of several test sets is named after it; that of the first is not folded away.
    """
    if test:
        of_test = {"name": f"{key}_{test}", "folded": test != next(iter(result.tests))}
        given = {"test": result.label_of(test), **of_test, **given}
    names = map(result.words_of, result.channels)
    shown = by_channel(names, (map(Number, column) for column in columns))
    return table(key, more=more, **shown, **given)


def _rows(result: StudyResult, statistic: str, **at: Any) -> xr.Dataset:
    """A statistic over the rows of :func:`_by_channel`."""
    data = result.groups[f"statistics/{statistic}"]
    return data.sel(channel=[*result.channels, "average"], **at)


def _heat(result: StudyResult) -> Table:
    """Median error of each channel in each test set, of the models that are not baselines."""
    median = _rows(result, "boxes", measure="nrmse")["median"]
    columns = [
        [
            f"{result.label_of(test)}: {model_words(model)}",
            *numbers(median.sel(test=test, model=model), 2),
        ]
        for test in result.tests
        for model in judged_models(result)
    ]
    return _by_channel(result, "heat", columns, of_judged(result))


def overview_table(result: StudyResult) -> Table:
    """Both measures of each model in each test set, averages over the channels."""
    rows = []
    boxes = _labelled(result, result.groups["statistics/boxes"].sel(channel="average"))
    boxes["spread"] = boxes["upper_quartile"] - boxes["lower_quartile"]
    for at in entries(boxes, "test", "model"):
        cells = [text for key in HEADING for text in row(at.sel(measure=key), median=3, spread=3)]
        cells += row(at.sel(measure="training_nrmse"), median=3)
        cells += row(at.sel(measure="nrmse"), count=0)
        rows.append((*row(at, "test"), model_words(at["model"].item()), *cells))
    return table("overview", rows, conditional(result, result.models))


def difference_table(result: StudyResult, test: str) -> Table:
    """Change of both measures from the first model to each other one, and whether it is better."""
    first, *others = result.models
    at = result.groups["statistics/differences"].sel(test=test, other=first, channel="average")
    rows = []
    for model in others:
        pairs = [ratio_of(at.sel(model=model, measure=key)).cells() for key in HEADING]
        rows.append((model_words(model), *chain(*pairs)))
    return table(
        "differences",
        rows,
        conditional(result, result.models),
        name=f"differences_{test}",
        test=result.label_of(test),
        first=model_words(first),
    )


def conditional(result: StudyResult, models: Sequence[str]) -> str:
    """Sentence on those of some models that read a measured output after the start."""
    read = {m: result.conditional_on[m] for m in models if m in result.conditional_on}
    words = ", ".join(dict.fromkeys(read.values())).replace("_", " ")
    return f" Conditional on measured {words}: {listed(read)}." if read else ""


def of_judged(result: StudyResult) -> str:
    """Sentences on references, which tables and figures by channel leave out, and on the others."""
    judged, where = judged_models(result), WORDS["sections"]["scales"]["title"]
    gone = [model for model in result.models if model not in judged]
    words = f" References are left out: {listed(gone)}; see “{where}”." * bool(gone)
    return words + conditional(result, judged)


def findings(result: StudyResult) -> list[str]:
    """Results, one sentence each."""
    said = []
    ensembles = result.ensembles
    singles = [model for model in result.models if model not in ensembles]
    for test in result.tests:
        parts = []
        for measure, heading in HEADING.items():
            at = {"test": test, "measure": measure, "channel": "average"}
            errors = result.groups["statistics/boxes"]["median"].sel(at)
            each = (f"{model_words(m)} {number(errors.sel(model=m))}" for m in result.models)
            words = f"median {heading} {', '.join(each)}"
            if singles and ensembles:
                at |= {"model": ensembles[0], "other": singles[0]}
                changes = ratio_of(result.groups["statistics/differences"].sel(at))
                value, bounds, word = changes.cells()
                within = ", too few cells" if bounds == MISSING else f" [{bounds}]"
                words += f" (the ensemble's mean: {word}, {value}{within})"
            parts.append(words)
        label = result.label_of(test)
        said.append(f"{label[:1].upper()}{label[1:]}: {'; '.join(parts)}.")
    said += [unequal_training(result), unequal_look_ahead(result)]
    if words := conditional(result, result.models).strip():
        said.append(
            f"{words} The alignment of the waves reads it after the start of a forecast, which is "
            "none in the strict sense."
        )
    for model in ensembles:
        said += _coverage_findings(result, model)
    # Of which windows, placed without overlap, fewer fit than were asked for.
    settings, places = result.settings, []
    if settings["training"]["scheme"] == "halves":
        used = result.groups["training"].sizes["training"]
        places.append(("training windows", settings["training"]["windows"], used))
    for name, data in result.tests.items():
        asked = settings["tests"][name]["windows"]
        places.append((f"test windows of {result.label_of(name)}", asked, data.sizes["window"]))
    said += [
        f"{used} {what} were used of the {asked} asked for: no more fit without overlap."
        for what, asked, used in places
        if asked is not None and used < asked
    ]
    said += [not_chosen(result), _few_cells(result)]
    return list(filter(None, said))


def _coverage_findings(result: StudyResult, model: str) -> list[str]:
    first = next(iter(result.tests))
    level = result.level
    at = {"test": first, "model": model, "against": "measured", "channel": "average"}
    row = result.groups["statistics/coverage"].sel(at)
    inside = row["inside"].sel(band="members").item()
    words = band_verdict(inside, level)
    calibrated = ""
    if "calibrated" in row["band"]:
        if np.isfinite(held := row["inside"].sel(band="calibrated")):
            width, wider = row["relative_width"]
            calibrated = (
                f" Calibrated on training data it holds {percent(held)} %, "
                f"{number(wider, '.2g')} measured SD wide instead of {number(width, '.2g')}."
            )
        calibrated += infinite_bands(result, model)
    each = [test["lost"].sel(ensemble=model) for test in result.tests.values()]
    lost, total = (int(sum((test >= least).sum() for test in each)) for least in (0, -1))
    return [
        f"The {short(100 * level)} % band of the {model_words(model)} model holds "
        f"{percent(inside)} % of the measured instants of {result.label_of(first)}, {words}: "
        f"it carries the spread of the hyperparameters, and no noise or model error.{calibrated}",
        f"{lost} of {total} member forecasts diverged and were left out of mean and band.",
    ]


def infinite_bands(result: StudyResult, model: str) -> str:
    """Sentence on calibrated bands that are infinite; empty where none is."""
    margins = result.groups["calibration"]["margin"].sel(ensemble=model)
    endless = margins.where(np.isinf(margins), drop=True)
    if not endless.size:
        return ""
    return (
        f" The calibrated band is infinite in {endless.count():d} of {margins.size} cases "
        f"(training set × channel; {', '.join(endless['training'].values)}), where too many "
        "forecasts of the windows that calibrate it diverged. It would hold everything there, and "
        "is left out."
    )


def _few_cells(result: StudyResult) -> str:
    """Sentence where a test set has too few cells for its statistics; else empty."""
    small = [
        f"{result.label_of(test)}: n = {count}"
        for test, data in result.tests.items()
        if (count := int(data["judged"].sum())) < FEWEST
    ]
    return (
        f"Few cells ({'; '.join(small)}): medians, quartiles and differences between models say "
        f"little below about {FEWEST}. Ask for more training or test windows before a conclusion."
    ) * bool(small)


_ACCENTS = {"dot": "\N{COMBINING DOT ABOVE}", "ddot": "\N{COMBINING DIAERESIS}"}


def plain_symbol(channel: str) -> str:
    """Symbol of a channel as figures print it, in plain letters; its name where it has none.

    Examples
    --------
    >>> plain_symbol("mooring_bow"), plain_symbol("heave"), plain_symbol("torque")
    ('M_bow', 'z', 'torque')
    """
    known = canonical_channel(channel)
    if known is None:
        return channel.replace("_", " ")
    text = re.sub(r"\\mathrm\{([^}]*)\}", r"\1", known.symbol)
    greek = r"\\(theta|phi|psi|eta)"
    text = re.sub(greek, lambda m: unicodedata.lookup(f"GREEK SMALL LETTER {m[1]}"), text)
    return re.sub(r"\\(d?dot)\{(\w)\}", lambda m: m[2] + _ACCENTS[m[1]], text)


def glossary(result: StudyResult) -> Section:
    """Return terms and symbols with what they mean."""
    symbols = ((plain_symbol(name), result.words_of(name)) for name in result.channels)
    explained = "; ".join(" ".join(dict.fromkeys(each)) for each in symbols)
    regular = "statistics/response" in result.groups
    same = (
        " It is that of the irregular sea and counts lengths in regular waves too: 5 T̂ may hold "
        "more or fewer than five regular waves."
    )
    if any(name.startswith("mooring_") for name in result.channels):
        explained += ". M is a mooring load, a force in N."
    given = {"period": result.encounter_period, "same": same * regular, "symbols": explained}
    known = {"λ/L": regular, "slap": any("truth" in data for data in result.tests.values())}
    terms = [
        (term, meaning.format(**given))
        for term, meaning in WORDS["terms"].items()
        if known.get(term, True)
    ]
    return section("words", terms=terms)


SELDOM = 0.01
"""Part of a run's samples below which a slack line is not worth a word."""


def errors(result: StudyResult) -> Section:
    """Return the errors of every model in every test set."""
    tests = list(result.tests)
    groups = [tests[:1], tests[1:]] if len(tests) <= 9 else [tests]
    figures = [
        drawing(
            "errors",
            average_boxes,
            result,
            group,
            tests=", ".join(map(result.label_of, group)),
            fewest=FEWEST,
            more=conditional(result, result.models),
            name=f"errors_{group[0] if len(group) == 1 else 'others'}",
        )
        for group in filter(None, groups)
    ]
    figures += [
        drawing(
            "errors_by_channel",
            channel_boxes,
            result,
            test,
            tests=result.label_of(test),
            fewest=FEWEST,
            more=of_judged(result),
            name=f"errors_{test}_by_channel",
        )
        for test in tests
    ]
    tables = (make(result, test) for make in (difference_table, error_table) for test in tests)
    return section("errors", *figures, overview_table(result), *tables)


def error_table(result: StudyResult, test: str) -> Table:
    """Medians and inter-quartile ranges of both measures, average and per channel."""
    models = judged_models(result)
    boxes = _rows(result, "boxes", test=test, measure=[*HEADING], model=models)
    columns = []
    for at in entries(boxes, "measure", "model"):
        measure, model = row(at, "measure", "model")
        spread = at["upper_quartile"] - at["lower_quartile"]
        head = f"{measure.upper()} {model_words(model)}: median [IQR]"
        columns.append([head, *map(beside, at["median"], spread)])
    more = of_judged(result)
    if lost := int(boxes["left_out"].sel(measure="nrmse").sum()):
        more += (
            f" {lost} values were left out: a channel whose measured SD is below 1 % of its "
            "training SD (a slack line), or more than half of whose variance is noise, is not "
            "judged."
        )
    count = int(result.tests[test]["judged"].sum())
    return _by_channel(result, "errors", columns, more, test, count=count)


def scales(result: StudyResult) -> Section:
    """Return errors counted in both standard deviations."""
    return section("scales", *(_scales_table(result, test) for test in result.tests))


def _scales_table(result: StudyResult, test: str) -> Table:
    data = result.tests[test]
    spread = data["measured"].std("time", ddof=1) / data["training_std"]
    size = spread.where(data["judged"]).median(["training", "window"])
    sizes = numbers(size.sel(channel=result.channels), 2)
    columns = [["SD of the window [training SD]", *sizes, ""]]
    for at in entries(_rows(result, "boxes", test=test), "model"):
        both = (numbers(at["median"].sel(measure=key)) for key in ("nrmse", "training_nrmse"))
        columns.append([model_words(at["model"].item()), *map("{} ({})".format, *both)])
    return _by_channel(result, "scales", columns, conditional(result, result.models), test)


def regular(result: StudyResult) -> Section:
    """Return the errors in regular waves, taken apart, and the lines that lose their load."""
    if (response := result.groups.get("statistics/response")) is None:
        return section("regular")
    rows, columns, tests = [], ["channel", "model"], response["test"].values.tolist()
    for sea in map(result.sea_of, tests):
        columns += [f"{sea}: {key}" for key in ("amplitude", "phase [°]", "offset [SD]", "share")]
    judged = response.sel(channel=result.channels, model=judged_models(result))
    for of_model in entries(judged, "channel", "model"):
        cells = [result.words_of(of_model["channel"].item()), model_words(of_model["model"].item())]
        for at in entries(of_model, "test"):
            squares = [float(at[f"error_{key}"]) ** 2 for key in ("offset", "wave", "rest")]
            share = 100 * squares[0] / total if (total := sum(squares)) else np.nan
            cells += row(at, amplitude_ratio=2, phase_lead=signed, error_offset=2)
            cells.append(to([share], 0, " %"))
        rows.append(tuple(cells))
    runs = dict.fromkeys(run for test in tests for run in result.tests[test]["run"].values)
    slack = result.groups["runs"]["slack"].sel(run=list(runs), name=result.channels)
    lines = [
        f"{result.words_of(line['name'].item())} in {percent(line)} % of {line['run'].item()}"
        for of_run in slack
        for line in of_run
        if line >= SELDOM
    ]
    words = (
        f"Slack line (a load within the SD of its noise): {', '.join(lines)}. A slack line does "
        "not respond linearly; where it is slack throughout, only noise is left to be forecast."
    ) * bool(lines)
    shown = table("response", rows, columns=columns, more=of_judged(result))
    return section("regular", shown, more=(words,))


def bands(result: StudyResult) -> Section:
    """Return coverage and scores of bands by wave height, horizon and channel."""
    if (groups := result.groups.get("statistics/bands")) is None:
        return section("bands")
    tables, level = [], short(100 * result.level)
    for at in entries(groups.sel(model=result.ensembles), "model", "band"):
        model, band = row(at, "model", "band")
        kind = "calibrated " * (band == "calibrated")
        title = f"{kind}{level} % band of the {model_words(model)} model".capitalize()
        more = (infinite_bands(result, model) if kind else "") + conditional(result, [model])
        at = _labelled(result, at.sel(test=at["inside"].notnull().any(["part", "channel"])))
        scale = at["relative_width"] / at["width"]  # one over the measured SD
        of_parts = []
        for one in entries(at.assign(at[["winkler", "crps"]] * scale), "test", "part"):
            if one["inside"].notnull().any():
                least = one["inside"][np.nanargmin(one["inside"].values)]
                named = f"{number(least, 2)} ({result.words_of(least['channel'].item())})"
                of_parts.append(one.mean("channel").assign(least=named))
        units = result.groups["channels"]["units"].sel(name=at["channel"].values)
        labels = [f"{result.words_of(each['name'].item())} [{each.item()}]" for each in units]
        of_channels = entries(at.assign_coords(channel=labels).sel(part="all"), "test", "channel")
        name = f"bands_{band}_{model}"
        tables += [
            table("bands", of_parts, more, name=name, band=title),
            table("bands_by_channel", of_channels, more, name=f"{name}_channels", band=title),
        ]
    return section("bands", *tables)


def _labelled(result: StudyResult, data: xr.Dataset) -> xr.Dataset:
    """Statistics with the words for test sets in place of their names."""
    return data.assign_coords(test=[*map(result.label_of, data["test"].values)])


def age(result: StudyResult) -> Section:
    """Return the error over the age of a forecast."""
    split = result.settings["statistics"]["split_period"]
    trend = result.groups["statistics/trend"].sel(model=judged_models(result))
    trend = _labelled(result, trend.mean("time"))
    trend["band"] = [BAND_WORDS[band] for band in trend["band"].values]
    seconds = split * result.encounter_period
    rows = entries(trend, "test", "band", "model")
    return section(
        "time",
        drawing("error_over_time", error_over_time_figure, result, split=split),
        table("trend", rows, of_judged(result), split=split, seconds=seconds),
    )


def coverage(result: StudyResult) -> Section:
    """Return coverage and width of the bands of ensembles."""
    tables = (
        coverage_table(result, model, band)
        for model in result.ensembles
        for band in result.groups["statistics/coverage"]["band"].values
    )
    return section("coverage", *tables)


def coverage_table(result: StudyResult, model: str, band: str) -> Table:
    """Coverage and width of a band, "members" or "calibrated", per test and channel."""
    prefix = "calibrated_" * (band == "calibrated")
    shares = _rows(result, "coverage", model=model, band=band)
    true, columns = "truth" in shares["against"].values, []
    for at in entries(_labelled(result, shares), "test"):
        (label,), inside = row(at, "test"), at["inside"].transpose("channel", "against")
        parts = [beside(*each, form=2) if true else number(each[0], 2) for each in inside.values]
        columns.append([f"{label}: inside" + " [of the truth]" * true, *parts])
        widths = numbers(at["relative_width"].sel(against="measured"), 2)
        columns.append([f"{label}: width [SD]", *widths])
    level = result.level
    more = _calibrated_words(result, model) if prefix else ""
    if true:
        more += (
            " In brackets, of the true instants. The truth is the virtual tank's, without noise or "
            "slap; rates are not filtered."
        )
    more += conditional(result, [model])
    return _by_channel(
        result,
        "coverage",
        columns,
        more,
        name=f"coverage_{prefix}{model}",
        kind=prefix.replace("_", " "),
        level=short(100 * level),
        part=level,
        model=model_words(model),
    )


def _calibrated_words(result: StudyResult, model: str) -> str:
    """How the calibrated band is made, what it rests on, and where it is of no use."""
    group = result.groups["calibration"].sel(ensemble=model)
    words = "these quantiles, moved outwards by a margin found"
    if "floor" in group:
        scale = "the spread of the members"
        if "law" in group:
            scale = "a scale learnt from spread, horizon and waves"
        words = (
            f"the mean, and a factor times {scale} (with a "
            "floor of a quarter of the root mean square error) to either side, found"
        )
    said = (
        f" Calibrated: {words} on training data that the members had not read, in windows as long "
        "as the first test set's. "
    )
    lengths = {test: each["length"] for test, each in result.settings["tests"].items()}
    first = lengths[next(iter(result.tests))]
    others = [f"{result.label_of(k)} ({n:g} T̂)" for k, n in lengths.items() if n != first]
    if others:
        said += f"Those are {first:g} T̂ long; the margin is not made for {', '.join(others)}. "
    if not group["windows"].all():
        said += "Some training sets hold no such window. "
    else:
        said += (
            f"A training set had {reach(group['windows'])} of them; allowing for their dependence, "
            f"their scores are worth {reach(group['blocks'])} independent ones. "
        )
        if (warranted := float(group["warranted"].min())) < result.level:
            said += f"Of some channels that is too few: {warranted:.2f} is guaranteed there. "
    said += "The margin guarantees nothing in another kind of sea."
    return said + infinite_bands(result, model)


def densities(result: StudyResult) -> Section:
    """Return densities of measurement and forecasts, and their divergence."""
    figures = [
        drawing(
            "densities",
            density_figure,
            result,
            model,
            name=f"densities_{model}",
            model=model_words(model),
        )
        for model in result.ensembles or result.models[:1]
    ]
    order = sorted(judged_models(result), key=lambda model: model not in result.ensembles)
    tables = (divergence_table(result, m, variant) for m in order for variant in VARIANTS)
    return section("densities", *figures, *tables)


def divergence_table(result: StudyResult, model: str, variant: str) -> Table:
    """Jensen–Shannon divergence per channel beside its noise floor and, if asked, the paper's."""
    data = result.groups["statistics/divergence"]
    at = data.sel(model=model, variant=variant, channel=result.channels)
    quantiles = {"mean": "EV", "lower": "q0.025", "upper": "q0.975", "uncertainty": "U"}
    own = [
        [head, *map(small_number, at[key]), small_number(at[key].mean(skipna=False))]
        for key, head in (*quantiles.items(), ("noise_floor", "noise floor"))
    ]
    own.append(["block (samples)", *numbers(at["block_length"], 0), ""])
    published = []
    if model in result.ensembles and result.settings["output"]["paper"]:
        heads = [f"paper: {each}" for each in quantiles.values()]
        names = (*result.channels, "average")
        cells = (WORDS["published"].get(name, (MISSING,) * 4) for name in names)
        published = [*zip(heads, *cells, strict=True)]
    how = "blocks may cross joins, block length and bandwidth as printed in the paper"
    if variant == "recommended":
        how = "no block crosses a join, Politis–White blocks, Silverman's bandwidth"
    return _by_channel(
        result,
        "jsd",
        [*own, *published],
        " The paper's columns are of another vessel in another tank." * bool(published)
        + conditional(result, [model]),
        test=data.attrs["test"],
        name=f"jsd_{model}_{variant}",
        elsewhere=range(1 + len(own), 1 + len(own) + len(published)),
        folded=model not in (result.ensembles or [model]),
        model=model_words(model),
        variant=variant,
        how=how,
    )


def eigenvalues(result: StudyResult) -> Section:
    """Return the eigenvalues of the models of the first training set."""
    figure = None
    if any(name.startswith("eigenvalues/") for name in result.groups):
        figure = drawing("eigenvalues", eigenvalue_figure, result, lowest=LOWEST)
    return section("eigenvalues", figure)
