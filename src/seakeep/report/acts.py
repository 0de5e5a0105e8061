"""The page over the acts of ``seakeep reproduce``: side by side, and against the paper's words."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from seakeep.arrays import Progress
from seakeep.report.claims import claims_table
from seakeep.report.figures.histories import acts_figure
from seakeep.report.page import Section, drawing, section, write_page
from seakeep.report.sections.data import finished, wave_tables
from seakeep.report.sections.errors import divergence_table
from seakeep.report.sections.summary import heat_table
from seakeep.report.style import judged_models, model_words
from seakeep.report.tables import Table, numbers, table
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
    heat = []
    for test in first.tests:
        places = {
            f"{act.letter} {model_words(model)}": (results[act.name], test, model)
            for act in _played(results)
            for model in judged_models(results[act.name])
        }
        words = {"test": first.label_of(test)}
        heat.append(heat_table(first, "channels", places, words, name=f"channels_{test}"))
    sections = [_summary(results)]
    if {"paper", "raw"} <= set(results):
        sections.append(section("claims", tables=(claims_table(results),)))
    divergence, beside = divergence_table(first, "bayesian", "paper"), ", beside the paper's"
    links = [(f"{act.name}/report.html", act.title) for act in _played(results)]
    sections += [
        section("channels", tables=heat),
        Section("densities", f"Divergence of the densities{beside}", tables=(divergence,)),
        section("waves", tables=wave_tables(first)),
        section("studies", links=links),
    ]
    return write_page(folder, "The paper's study on the virtual tank", stamp, sections, progress)


def _played(results: Results) -> list[Act]:
    return [act for act in ACTS if act.name in results]


def _summary(results: Results) -> Section:
    repeats = [result.groups.get("repeats") for result in results.values()]
    return section(
        "summary",
        more=(NOTE,),
        points=[f"{act.title}. {act.sentence}" for act in _played(results)],
        figures=(drawing("acts", partial(acts_figure, results)),),
        tables=(acts_table(results),),
        # Once what several studies warn of.
        notices=list(dict.fromkeys(words_of_repeats(each) for each in repeats if each is not None)),
    )


def acts_table(results: Results) -> Table:
    """Median errors of every model of every act, per sea, of wave-frequency and slow channels."""
    rows, first = [], next(iter(results.values()))
    for act in _played(results):
        result = results[act.name]
        for model in result.models:
            row: list[str] = [act.letter, model_words(model)]
            for data in result.tests.values():
                cells = (
                    data["error"].sel(model=model, measure="nrmse").values[data["judged"].values]
                )
                slow = np.isin(data["channel"].values.astype(str), SLOW)
                row += numbers([np.nanmedian(average_of(cells[:, k])) for k in (~slow, slow)], 2)
            rows.append(tuple(row))
    seas = [first.label_of(test).removeprefix("regular, ") for test in first.tests]
    reading = [a.letter for a in _played(results) if results[a.name].attrs["conditional_on"]]
    conditions = ""
    if reading:
        conditions = (
            f"{' and '.join(reading)}: conditional on measured surge, which the alignment reads."
        )
    columns = ("act", "model", *(f"{sea}: {part}" for sea in seas for part in ("waves", "slow")))
    return table("acts", rows, more=conditions, columns=columns)
