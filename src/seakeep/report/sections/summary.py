"""Summary of results in sentences, with the words and symbols of the report."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from seakeep.conventions import canonical_channel
from seakeep.report.figures.errors import FEWEST
from seakeep.report.figures.histories import history_figure, shown_cells
from seakeep.report.page import Section, drawing, section
from seakeep.report.sections.data import test_overlap, training_overlap, unequal_training
from seakeep.report.style import HEADING, judged_models, model_words
from seakeep.report.tables import (
    Number,
    Table,
    band_verdict,
    entries,
    number,
    percent,
    row,
    short,
    signed,
    table,
    words,
)
from seakeep.study import StudyResult
from seakeep.study.describe import words_of_repeats
from seakeep.study.judge import verdict, words_of_lost


def summary(result: StudyResult) -> Section:
    """Return what was tested and the results, on one screen."""
    shares, words = training_overlap(result)
    lost, repeats = (result.groups.get(key) for key in ("statistics/lost", "repeats"))
    notices = [
        str(result.attrs.get("preparation_note", "")),
        words_of_lost(lost) if lost is not None else "",
        words_of_repeats(repeats) if repeats is not None else "",
        _few_cells(result),
        words if shares else "",
        test_overlap(result),
    ]
    name = "heave" if "heave" in result.channels else result.channels[0]
    figures = [
        drawing(
            "first_history",
            partial(history_figure, result, *place, names=(name,)),
            {"channel": result.words_of(name).capitalize(), "test": result.label_of(place[0])},
        )
        for place in shown_cells(result)[:1]
    ]
    return section(
        "summary",
        more=(_tested(result),),
        points=findings(result),
        notices=tuple(filter(None, notices)),
        figures=figures,
        tables=(_heat(result),),
    )


def _tested(result: StudyResult) -> str:
    """What was tested, in one sentence or two."""
    period = float(result.attrs["encounter_period"])
    sets = result.groups["training"].sizes["training"]
    seas = [
        f"{result.label_of(test)} ({data.sizes['window']} windows of "
        f"{float(data['time'].values[-1]) / period:.3g} T̂)"
        for test, data in result.tests.items()
    ]
    words = (
        f"Tested: {', '.join(map(model_words, result.models))}, each learnt from {sets} training "
        f"set{'s' * (sets > 1)} and run freely through {', '.join(seas)}; {len(result.channels)} "
        "channels. Errors are in measured SDs of the window: 0 is perfect, 1 is no better than its "
        "mean."
    )
    if condition := str(result.attrs.get("conditional_on", "")).replace("_", " "):
        words += (
            f" Every number is conditional on measured {condition}: the alignment of the waves "
            "reads it after the start of a forecast. It is no forecast in the strict sense."
        )
    return words


def by_channel(
    result: StudyResult,
    key: str,
    cells: Callable[[str], Iterable[str]],
    values: Mapping[str, Any] | None = None,
    *,
    columns: Iterable[str],
    **options: Any,
) -> Table:
    """Table of numbers with a row per channel, and one of averages; `cells` takes a channel."""
    rows = [(result.words_of(name), *map(Number, cells(name))) for name in result.channels]
    rows.append(("average", *map(Number, cells("average"))))
    last = [len(rows) - 1]
    return table(key, rows, values, columns=("channel", *columns), averages=last, **options)


def _heat(result: StudyResult) -> Table:
    """Median error of each channel in each test set, of the models that are not baselines."""
    places = {
        f"{result.label_of(test)}: {model_words(model)}": {"test": test, "model": model}
        for test in result.tests
        for model in judged_models(result)
    }
    median = result.groups["statistics/boxes"]["median"].sel(measure="nrmse")

    def cells(channel: str) -> Iterator[str]:
        return (number(median.sel({**at, "channel": channel}), 2) for at in places.values())

    return by_channel(result, "heat", cells, columns=places, more=conditional(result))


def overview_table(result: StudyResult) -> Table:
    """Both measures of each model in each test set, averages over the channels."""
    rows = []
    boxes = result.groups["statistics/boxes"].sel(channel="average")
    boxes["spread"] = boxes["upper_quartile"] - boxes["lower_quartile"]
    for at in entries(boxes, "test", "model"):
        test, model = row(at, "test", "model")
        measures = (row(at.sel(measure=key), median=3, spread=3) for key in HEADING)
        scaled = row(at.sel(measure="training_nrmse"), median=3)
        count = row(at.sel(measure="nrmse"), count=0)
        errors = chain(*measures, scaled, count)
        rows.append((result.label_of(test), model_words(model), *errors))
    return table("overview", rows, more=conditional(result))


def conditional(result: StudyResult) -> str:
    """Sentence for tables whose forecasts read a measured output after the start."""
    words = str(result.attrs.get("conditional_on", "")).replace("_", " ")
    return f" Conditional on measured {words}." if words else ""


def findings(result: StudyResult) -> list[str]:
    """Results, one sentence each."""
    said = []
    singles = [m for m in result.models if not result.is_ensemble(m)]
    ensembles = [m for m in result.models if result.is_ensemble(m)]
    for test in result.tests:
        median = result.groups["statistics/boxes"]["median"].sel(test=test, channel="average")
        parts = []
        for measure, heading in HEADING.items():
            errors = median.sel(measure=measure)
            listed = [f"{model_words(m)} {number(errors.sel(model=m))}" for m in result.models]
            words = f"median {heading} {', '.join(listed)}"
            if singles and ensembles:
                words += _verdict(result, test, ensembles[0], singles[0], measure)
            parts.append(words)
        label = result.label_of(test)
        said.append(f"{label[:1].upper()}{label[1:]}: {'; '.join(parts)}.")
    said += filter(None, [unequal_training(result)])
    for model in ensembles:
        said += _coverage_findings(result, model)
    return said + _fewer_windows(result)


def _verdict(result: StudyResult, test: str, ensemble: str, single: str, measure: str) -> str:
    """Whether the ensemble's mean is better than the single model, if the study can decide."""
    at = result.groups["statistics/differences"].sel(
        test=test, model=ensemble, other=single, measure=measure, channel="average"
    )
    change, *bounds = (100 * float(at[key]) for key in ("change", "lower", "upper"))
    if not np.isfinite(change):
        return ""
    outcome = "as good" if np.abs(bounds).max() < 0.5 else verdict(*bounds)
    words = f"the ensemble's mean is {outcome}"
    if outcome == "cannot tell":
        words = "cannot tell whether the ensemble's mean is better"
    interval = f"[{', '.join(map(signed, bounds))}]"
    interval = interval if np.isfinite(bounds[0]) else "with too few cells"
    return f" ({words}: {signed(change)} % {interval})".replace("-", "−")


def _coverage_findings(result: StudyResult, model: str) -> list[str]:
    first = next(iter(result.tests))
    level = float(result.settings["statistics"]["level"])
    at = {"test": first, "model": model, "against": "measured", "channel": "average"}
    row = result.groups["statistics/coverage"].sel(at)
    inside = float(row["inside"].sel(band="members"))
    words = band_verdict(inside, level)
    calibrated = ""
    if "calibrated" in row["band"] and np.isfinite(held := row["inside"].sel(band="calibrated")):
        width, wider = row["relative_width"]
        calibrated = (
            f" Calibrated on training data it holds {percent(held)} %, "
            f"{short(wider, 2)} measured SD wide instead of {short(width, 2)}."
        )
    each = [test["lost"].sel(ensemble=model) for test in result.tests.values()]
    lost, total = (int(sum((test >= least).sum() for test in each)) for least in (0, -1))
    return [
        f"The {short(100 * level)} % band of the {model_words(model)} model holds "
        f"{percent(inside)} % of the measured instants of {result.label_of(first)}, {words}: "
        f"it carries the spread of the hyperparameters, and no noise or model error.{calibrated}",
        f"{lost} of {total} member forecasts diverged and were left out of mean and band.",
    ]


def _fewer_windows(result: StudyResult) -> list[str]:
    """Say of which windows, placed without overlap, fewer fit than were asked for."""
    settings, places = result.settings, []
    if settings["training"]["scheme"] == "halves":
        used = result.groups["training"].sizes["training"]
        places.append(("training windows", settings["training"]["windows"], used))
    for name, data in result.tests.items():
        asked = settings["tests"][name]["windows"]
        places.append((f"test windows of {result.label_of(name)}", asked, data.sizes["window"]))
    return [
        f"{used} {what} were used of the {asked} asked for: no more fit without overlap."
        for what, asked, used in places
        if asked is not None and used < asked
    ]


def _few_cells(result: StudyResult) -> str:
    """Sentence where a test set has too few cells for its statistics; else empty."""
    counts = {test: int(data["judged"].sum()) for test, data in result.tests.items()}
    small = [f"{result.label_of(test)}: n = {n}" for test, n in counts.items() if n < FEWEST]
    if not small:
        return ""
    return (
        f"Few cells ({'; '.join(small)}): medians, quartiles and differences between models say "
        f"little below about {FEWEST}. Ask for more training or test windows before a conclusion."
    )


_LETTERS = {r"\theta": "θ", r"\phi": "φ", r"\psi": "ψ", r"\eta": "η"}
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
    text = re.sub(r"\\mathrm\{([^}]*)\}|\\mathrm ?(\w+)", r"\1\2", known.symbol)
    for tex, letter in _LETTERS.items():
        text = text.replace(tex, letter)
    return re.sub(r"\\(d?dot)\{(\w)\}", lambda m: m[2] + _ACCENTS[m[1]], text)


def glossary(result: StudyResult) -> Section:
    """Return terms and symbols with what they mean."""
    symbols = {name: (plain_symbol(name), result.words_of(name)) for name in result.channels}
    explained = "; ".join(" ".join(dict.fromkeys(each)) for each in symbols.values())
    loads = any(name.startswith("mooring_") for name in result.channels)
    regular = "statistics/response" in result.groups
    same = (
        " It is that of the irregular sea and counts lengths in regular waves too: 5 T̂ may hold "
        "more or fewer than five regular waves."
    )
    slap = any("truth" in data for data in result.tests.values())
    left_out = {"λ/L": not regular, "slap": not slap}
    values = {
        "period": float(result.attrs["encounter_period"]),
        "same": same * regular,
        "symbols": explained + ". M is a mooring load, a force in N." * loads,
    }
    terms = [
        (term, meaning.format(**values))
        for term, meaning in words()["terms"].items()
        if not left_out.get(term)
    ]
    return section("words", terms=terms)
