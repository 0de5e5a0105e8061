"""Summary of results in sentences, with the words and symbols of the report."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any

import numpy as np

from seakeep.conventions import canonical_channel
from seakeep.report.figures.boxes import FEWEST
from seakeep.report.figures.common import HEADING, judged_models, model_words
from seakeep.report.figures.histories import history_figure, shown_cells
from seakeep.report.section import Drawing, Section
from seakeep.report.sections.settings import test_overlap, training_overlap, unequal_training
from seakeep.report.tables import Table, number
from seakeep.study import StudyResult
from seakeep.study.describe import words_of_repeats
from seakeep.study.judge import verdict, words_of_lost

__all__ = [
    "by_channel",
    "conditional",
    "findings",
    "glossary",
    "heat_table",
    "overview_table",
    "summary",
]


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
    return Section(
        "summary",
        "Results",
        words=(_tested(result),),
        points=tuple(findings(result)),
        notices=tuple(filter(None, notices)),
        figures=tuple(_first_history(result)),
        tables=(heat_table(result),),
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
    condition = str(result.attrs.get("conditional_on", "")).replace("_", " ")
    told = (
        f"Tested: {', '.join(map(model_words, result.models))}, each learnt from {sets} training "
        f"set{'s' * (sets > 1)} and run freely through {', '.join(seas)}; {len(result.channels)} "
        "channels. Errors are in measured SDs of the window: 0 is perfect, 1 is no better than its "
        "mean."
    )
    if condition:
        told += (
            f" Every number is conditional on measured {condition}: the alignment of the waves "
            "reads it after the start of a forecast. It is no forecast in the strict sense."
        )
    return told


def heat_table(result: StudyResult) -> Table:
    """Median error of each channel in each test set, of the models that are not baselines."""
    models = judged_models(result)
    places = [(test, model) for test in result.tests for model in models]
    median = result.groups["statistics/boxes"]["median"].sel(measure="nrmse")
    return by_channel(
        result,
        "heat",
        "Median NRMSE, channel by channel",
        [f"{result.label_of(test)}: {model_words(model)}" for test, model in places],
        lambda name: [
            number(median.sel(test=test, model=model, channel=name), 2) for test, model in places
        ],
        "The darker, the worse; average: the paper's ANRMSE.",
        heat=range(1, len(places) + 1),
    )


def by_channel(
    result: StudyResult,
    name: str,
    title: str,
    heads: Sequence[str],
    cells: Callable[[str], Iterable[str]],
    note: str,
    **options: Any,
) -> Table:
    """Table of numbers with a row per channel, and one of averages; `cells` takes a channel."""
    rows = [(result.words_of(each), *cells(each)) for each in result.channels]
    rows.append(("average", *cells("average")))
    note, numeric = note + conditional(result), range(1, len(heads) + 1)
    columns, last = ("channel", *heads), [len(rows) - 1]
    return Table(name, title, columns, rows, note, numeric, averages=last, **options)


def _first_history(result: StudyResult) -> list[Drawing]:
    """One channel of the first cell that is shown: heave, or the first."""
    name = "heave" if "heave" in result.channels else result.channels[0]
    return [
        Drawing(
            "first_history",
            f"{result.words_of(name).capitalize()} in {result.label_of(place[0])}, the first of "
            "the windows shown below: measured and forecast.",
            partial(history_figure, result, *place, names=(name,)),
        )
        for place in shown_cells(result)[:1]
    ]


def overview_table(result: StudyResult) -> Table:
    """Both measures of each model in each test set, averages over the channels."""
    rows = []
    for test in result.tests:
        boxes = result.groups["statistics/boxes"].sel(test=test, channel="average")
        for model in result.models:
            row = [result.label_of(test), model_words(model)]
            for measure in HEADING:
                at = boxes.sel(model=model, measure=measure)
                spread = float(at["upper_quartile"] - at["lower_quartile"])
                row += [number(at["median"]), number(spread)]
            scaled = boxes["median"].sel(model=model, measure="training_nrmse")
            count = boxes.sel(model=model, measure="nrmse")["count"]
            rows.append((*row, number(scaled), str(int(count))))
    heads = [f"{words} {k}" for words in HEADING.values() for k in ("median", "IQR")]
    return Table(
        "overview",
        "ANRMSE and NAMMAE",
        ("test set", "model", *heads, "in training SD", "cells"),
        rows,
        "Medians and inter-quartile ranges over all cells (training set × test window) of the "
        "average over the channels that are judged; in measured standard deviations, and ANRMSE "
        "in those of the training set too." + conditional(result),
        range(2, 8),
    )


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
        boxes = result.groups["statistics/boxes"].sel(test=test, channel="average")
        parts = []
        for measure, heading in HEADING.items():
            at = boxes["median"].sel(measure=measure)
            medians = {m: float(at.sel(model=m)) for m in result.models}
            listed = ", ".join(f"{model_words(m)} {v:.3f}" for m, v in medians.items())
            told = ""
            if singles and ensembles:
                told = _verdict(result, test, ensembles[0], singles[0], measure)
            parts.append(f"median {heading} {listed}{told}")
        label = result.label_of(test)
        said.append(f"{label[:1].upper()}{label[1:]}: {'; '.join(parts)}.")
    said += [unequal] if (unequal := unequal_training(result)) else []
    for model in ensembles:
        said += _coverage_findings(result, model)
    return said + _fewer_windows(result)


def _verdict(result: StudyResult, test: str, ensemble: str, single: str, measure: str) -> str:
    """Whether the ensemble's mean is better than the single model, if the study can decide."""
    at = result.groups["statistics/differences"].sel(
        test=test, model=ensemble, other=single, measure=measure, channel="average"
    )
    change, low, high = (100 * float(at[key]) for key in ("change", "lower", "upper"))
    if not np.isfinite(change):
        return ""
    words = {
        "better": "the ensemble's mean is better",
        "worse": "the ensemble's mean is worse",
        "cannot tell": "cannot tell whether the ensemble's mean is better",
    }[verdict(low, high)]
    interval = f"[{low:+.0f}, {high:+.0f}]" if np.isfinite(low) else "with too few cells"
    return f" ({words}: {change:+.0f} % {interval})".replace("-", "−")


def _coverage_findings(result: StudyResult, model: str) -> list[str]:
    first = next(iter(result.tests))
    level = float(result.settings["statistics"]["level"])
    table = result.groups["statistics/coverage"].sel(test=first, model=model, against="measured")
    row = table.sel(channel="average")
    inside = float(row["inside"])
    words = "which is what it claims"
    if abs(inside - level) > 0.05:
        words = "far too little" if inside < level - 0.2 else "not what it claims"
    calibrated = ""
    if "calibrated_inside" in row and np.isfinite(row["calibrated_inside"]):
        calibrated = (
            f" Calibrated on training data it holds {100 * float(row['calibrated_inside']):.0f} %, "
            f"{float(row['calibrated_relative_width']):.2g} measured SD wide instead of "
            f"{float(row['relative_width']):.2g}."
        )
    each = [test["lost"].sel(ensemble=model) for test in result.tests.values()]
    lost, total = (int(sum((test >= least).sum() for test in each)) for least in (0, -1))
    return [
        f"The {100 * level:g} % band of the {model_words(model)} model holds "
        f"{100 * inside:.0f} % of the measured instants of {result.label_of(first)}, {words}: "
        f"it carries the spread of the hyperparameters, and no noise or model error.{calibrated}",
        f"{lost} of {total} member forecasts diverged and were left out of mean and band.",
    ]


def _fewer_windows(result: StudyResult) -> list[str]:
    """Say of which windows, placed without overlap, fewer fit than were asked for."""
    settings = result.settings
    places = {
        f"test windows of {result.label_of(name)}": (settings["tests"][name], data.sizes["window"])
        for name, data in result.tests.items()
    }
    if settings["training"]["scheme"] == "halves":
        used = result.groups["training"].sizes["training"]
        places = {"training windows": (settings["training"], used), **places}
    return [
        f"{used} {what} were used of the {each['windows']} asked for: no more fit without overlap."
        for what, (each, used) in places.items()
        if each["windows"] is not None and used < each["windows"]
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


def _explained(result: StudyResult, channel: str) -> str:
    """Symbol and words of a channel; once where they are the same."""
    symbol, words = plain_symbol(channel), result.words_of(channel)
    return words if symbol == words else f"{symbol} {words}"


def glossary(result: StudyResult) -> Section:
    """Return terms and symbols with what they mean."""
    return Section("words", "Words and symbols", terms=tuple(_terms(result)))


def _terms(result: StudyResult) -> list[tuple[str, str]]:
    period = float(result.attrs["encounter_period"])
    symbols = "; ".join(_explained(result, name) for name in result.channels)
    loads = any(name.startswith("mooring_") for name in result.channels)
    regular = "statistics/response" in result.groups
    same = (
        " It is that of the irregular sea and counts lengths in regular waves too: 5 T̂ may hold "
        "more or fewer than five regular waves."
    )
    terms = [
        ("cell", "one training set × one test window: one forecast of each model"),
        ("judged", "counted: not a cell whose run was trained on, nor a channel that hardly moves "
         "in the window"),
        ("T̂", f"mean encounter period, {period:.3f} s; lengths are counted in it."
         + (same if regular else "")),
        ("NRMSE, ANRMSE", "root mean square error over the measured SD of the window; ANRMSE: "
         "averaged over the channels"),
        ("NAMMAE", "mean absolute error of the smallest and the largest value in the window, over "
         "k measured SDs, k = 1; averaged over the channels"),
        ("SD, IQR", "standard deviation; inter-quartile range, upper quartile − lower quartile"),
        ("HDMDc, BHDMDc", "Hankel dynamic mode decomposition with control: a linear model with "
         "delays; its ensemble over hyperparameters, here 'Bayesian'"),
        ("EV, U", "of a bootstrapped divergence: mean, and q0.975 − q0.025"),
        ("ε(t)", "absolute error at an age of the forecast, averaged over the channels, in "
         "measured SDs"),
        ("in figures", symbols + (". M is a mooring load, a force in N." if loads else "")),
    ]  # fmt: skip
    if regular:
        terms.append(("λ/L", "length of the regular waves over that of the vessel"))
    if any("truth" in data for data in result.tests.values()):
        terms.append(("slap", "decaying pulses in a load as its line dips into the water and out"))
    return terms
