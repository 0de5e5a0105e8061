"""The page over the acts of ``seakeep reproduce``: side by side, and against the paper's words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from seakeep.arrays import Progress
from seakeep.report.claims import (
    ENSEMBLE,
    REGULAR,
    SEA,
    SINGLE,
    Interval,
    claims_table,
    error_of,
)
from seakeep.report.figures.histories import acts_figure
from seakeep.report.page import Section, drawing, section, write_page
from seakeep.report.sections.data import finished, wave_tables
from seakeep.report.sections.errors import divergence_table
from seakeep.report.style import model_words
from seakeep.report.tables import Number, Table, number, numbers, percent, short, table
from seakeep.study import StudyResult
from seakeep.study.describe import words_of_repeats
from seakeep.study.judge import average_of
from seakeep.study.reproduce import ACTS, NOTE, SLOW, Act

Results = Mapping[str, StudyResult]


def write_reproduction(folder: Path, results: Results, progress: Progress | None = None) -> Path:
    """Write the page over the acts; each act's own page is written by itself.

    Parameters
    ----------
    folder : Path
        Folder of the reproduction.
    results : mapping of str to StudyResult
        By act.
    progress : callable, optional
        Called as ``progress(done, total, what)``.

    Returns
    -------
    Path
        The page.
    """
    every = list(results.values())
    first, last = every[0], every[-1]
    stamp = {
        "description": "A study of linear models with delays that forecast a moored vessel in head "
        "seas, on data of a virtual towing tank: six runs, three procedures.",
        "preset": "",
        "seed": str(last.attrs["seed"]),
        "digest": "",
        "finished": finished(last),
    }
    sections = [_summary(results)]
    if {"paper", "raw"} <= set(results):
        sections.append(section("claims", tables=(claims_table(results),)))
    divergence, beside = divergence_table(first, "bayesian", "paper"), ", beside the paper's"
    links = [(f"{act.name}/report.html", act.title) for act in _played(results)]
    sections += [
        section("channels", tables=[acts_table(results)]),
        Section("densities", f"Divergence of the densities{beside}", tables=(divergence,)),
        section("waves", tables=wave_tables(first)),
        section("studies", links=links),
    ]
    return write_page(folder, "The paper's study on the virtual tank", stamp, sections, progress)


def _played(results: Results) -> list[Act]:
    return [act for act in ACTS if act.name in results]


def _summary(results: Results) -> Section:
    """What the acts found: one sentence, one figure, one short table."""
    short = short_table(results)
    repeats = [result.groups.get("repeats") for result in results.values()]
    return section(
        "summary",
        more=(finding(results), against_filter(results), NOTE),
        points=[f"{act.title}. {act.sentence}" for act in _played(results)],
        figures=(drawing("acts", partial(acts_figure, results)),),
        tables=(replace(short, note=f"{short.note} {still_water(results)}"),),
        # Once what several studies warn of.
        notices=list(dict.fromkeys(words_of_repeats(each) for each in repeats if each is not None)),
    )


ROWS = (
    ("raw", "deterministic", "(b) the paper's model"),
    ("raw", "fir", "(b) FIR beside it"),
    ("recommended", "deterministic", "(c) recommended"),
    ("recommended", "bayesian", "(c) its ensemble"),
    ("recommended", "fir", "(c) FIR beside it"),
)
"""Rows of the short table, besides that of the last measured state."""


def short_table(results: Results) -> Table:
    """Median errors on the channels as measured: the models, and the best that compare with them.

    Parameters
    ----------
    results : mapping of str to StudyResult
        By act.

    Returns
    -------
    Table
        At most six rows; a cell holds the error of the wave channels and of the slow ones.
    """
    last = list(results)[-1]
    rows = [
        (words, *(" / ".join(pair) for pair in _pairs(results[act], model)))
        for act, model, words in (*ROWS, (last, "hold_last", "last measured state"))
        if act in results
    ]
    first = results[last]
    seas = [first.label_of(test).removeprefix("regular, ") for test in first.tests]
    return table("short", rows, columns=("model", *seas), numeric=range(1, 1 + len(seas)))


def finding(results: Results) -> str:
    """The conclusion on irregular waves in one sentence, with 95 % intervals."""
    errors = {act: error_of(results[act], SEA, model=SINGLE).text() for act in results}
    still = error_of(list(results.values())[-1], SEA, model="hold_last").text()
    words = {
        "recommended": "the recommended model errs {} SD of the measurement",
        "raw": "the paper's procedure errs {} on the channels as measured",
        "paper": "and {} without the slow drift",
    }
    parts = [each.format(errors[act]) for act, each in words.items() if act in errors]
    return f"In irregular waves {', '.join(parts)}; the last measured state errs {still}."


def against_filter(results: Results) -> str:
    """How the error differs between models and the filter beside them, in one sentence."""
    parts = []
    for act in _played(results):
        at = (
            results[act.name]
            .groups["statistics/differences"]
            .sel(test=SEA[0], model=SINGLE, other="fir", measure="nrmse", channel="average")
        )
        ratio = Interval(*(1.0 + float(at[key]) for key in ("change", "lower", "upper")))
        parts.append(f"{ratio.change()} in {act.letter}")
    return (
        "From the filter with the same data, look-ahead and input map (FIR, its length and λ "
        "chosen by validation) to the single model, the median error there changes by "
        f"{', '.join(parts)}."
    )


def band_sentence(results: Results) -> str:
    """How much the calibrated band of the recommended ensemble holds; empty without one."""
    if (result := results.get("recommended")) is None:
        return ""
    table = result.groups["statistics/coverage"]["inside"]
    at = table.sel(model=ENSEMBLE, band="calibrated", against="measured", channel="average")
    seas = (f"{percent(at.sel(test=test))} % ({result.label_of(test)})" for test in result.tests)
    level = short(100 * float(result.settings["statistics"]["level"]))
    return f"Of the instants, the calibrated {level} % band of (c) holds {', '.join(seas)}."


def still_water(results: Results) -> str:
    """Errors of surge in regular waves in metres: there the window's SD says little."""
    if (result := results.get("recommended")) is None:
        return ""
    parts = []
    for test in REGULAR:
        at = result.tests[test].sel(channel="surge")
        spread = float(at["measured"].std("time", ddof=1).median())
        error = at["error"].sel(model=SINGLE, measure="training_nrmse").where(at["judged"])
        metres = float(error.median()) * float(at["training_std"].median())
        parts.append(f"{number(metres, 3)} m ({number(spread, 3)} m)")
    trained = number(float(at["training_std"].median()), 3)
    return (
        "In regular waves drift stands nearly still, at a mean far from that of the training. "
        f"There the recommended model errs by {', '.join(parts)} in surge at λ/L 1.5, 2 and 3; in "
        f"parentheses the SD of the window, by which NRMSE divides. In training surge has an SD of "
        f"{trained} m."
    )


def _pairs(result: StudyResult, model: str) -> list[list[Number]]:
    """Median errors of a model per sea, of the wave channels and of the slow ones."""
    pairs = []
    for data in result.tests.values():
        cells = data["error"].sel(model=model, measure="nrmse").values[data["judged"].values]
        slow = np.isin(data["channel"].values.astype(str), SLOW)
        pairs.append(numbers([np.nanmedian(average_of(cells[:, k])) for k in (~slow, slow)], 2))
    return pairs


def acts_table(results: Results) -> Table:
    """Median errors of every model of every act, per sea, of wave-frequency and slow channels."""
    rows, first = [], next(iter(results.values()))
    for act in _played(results):
        result = results[act.name]
        for model in result.models:
            pairs = _pairs(result, model)
            rows.append(
                (act.letter, model_words(model), *(each for pair in pairs for each in pair))
            )
    seas = [first.label_of(test).removeprefix("regular, ") for test in first.tests]
    reading = [a.letter for a in _played(results) if results[a.name].attrs["conditional_on"]]
    conditions = ""
    if reading:
        conditions = (
            f"{' and '.join(reading)}: conditional on measured surge, which the alignment reads."
        )
    columns = ("act", "model", *(f"{sea}: {part}" for sea in seas for part in ("waves", "slow")))
    return table("acts", rows, more=conditions, columns=columns)
