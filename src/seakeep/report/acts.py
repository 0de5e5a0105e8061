"""The page over the acts of ``seakeep reproduce``: side by side, and against the paper's words."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np

from seakeep.arrays import Progress
from seakeep.report.claims import claims_table
from seakeep.report.figures.common import judged_models, model_words
from seakeep.report.figures.histories import acts_figure
from seakeep.report.page import write_page
from seakeep.report.section import Drawing, Section
from seakeep.report.sections.data import position_table, wave_table
from seakeep.report.sections.judgements import divergence_table
from seakeep.report.sections.settings import finished
from seakeep.report.tables import Table, number
from seakeep.study import StudyResult
from seakeep.study.describe import words_of_repeats
from seakeep.study.judge import average_of
from seakeep.study.reproduce import ACTS, NOTE, SLOW, Act

__all__ = ["acts_table", "write_reproduction"]

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
    all_of_them = list(results.values())
    first, last = all_of_them[0], all_of_them[-1]
    stamp = {
        "description": "A study of linear models with delays that forecast a moored vessel in head "
        "seas, on data of a virtual towing tank: six runs, three procedures.",
        "preset": "",
        "seed": str(last.attrs["seed"]),
        "digest": "",
        "finished": finished(last),
    }
    claims = []
    if {"paper", "raw"} <= set(results):
        words = "What the paper says, and what this tank says"
        claims = [Section("claims", words, tables=(claims_table(results),))]
    heat = tuple(_heat_table(results, test) for test in first.tests)
    waves = tuple(filter(None, (wave_table(first), position_table(first))))
    links = tuple((f"{act.name}/report.html", act.title) for act in _played(results))
    told = "Errors, histories, bands, data and settings of each act have a page of their own:"
    sections = [
        _summary(results),
        *claims,
        Section("channels", "Channel by channel", tables=heat),
        Section(
            "densities",
            "Divergence of the densities, beside the paper's",
            tables=(divergence_table(first, "bayesian", "paper"),),
        ),
        Section("waves", "Waves and probes", tables=waves),
        Section("studies", "The studies", words=(told,), links=links),
    ]
    return write_page(folder, "The paper's study on the virtual tank", stamp, sections, progress)


def _played(results: Results) -> list[Act]:
    return [act for act in ACTS if act.name in results]


def _summary(results: Results) -> Section:
    return Section(
        "summary",
        "Results",
        words=(NOTE,),
        points=tuple(f"{act.title}. {act.sentence}" for act in _played(results)),
        figures=(
            Drawing(
                "acts",
                "Heave and surge in one window of irregular waves, measured and forecast in each "
                "act, with the ensemble's 95 % band.",
                partial(acts_figure, results),
            ),
        ),
        tables=(acts_table(results),),
        notices=tuple(_warnings(results)),
    )


def _warnings(results: Results) -> list[str]:
    """What a study of the acts warns of: once where several do."""
    repeats = [result.groups.get("repeats") for result in results.values()]
    return list(dict.fromkeys(words_of_repeats(each) for each in repeats if each is not None))


def acts_table(results: Results) -> Table:
    """Median errors of every model of every act, per sea, of wave-frequency and slow channels."""
    rows = []
    tests = next(iter(results.values())).tests
    for act in _played(results):
        result = results[act.name]
        for model in result.models:
            row = [act.letter, model_words(model)]
            for test in tests:
                row += [number(value, 2) for value in _split(result, test, model)]
            rows.append(tuple(row))
    columns = ["act", "model"]
    for test in tests:
        label = next(iter(results.values())).label_of(test).removeprefix("regular, ")
        columns += [f"{label}: waves", f"{label}: slow"]
    numeric = range(2, len(columns))
    return Table(
        "acts",
        "Median NRMSE of three acts and their baselines",
        columns,
        rows,
        "Average over channels, median over training sets and windows, in measured SDs: 1 is no "
        "better than the mean of the window. Slow: surge and both mooring loads; waves: the eight "
        "others. Mean, hold last: the training mean, and the last measured state; FIR: "
        "a linear filter of the waves without states, which reads them 2 T̂ ahead, "
        "further than the recommended model (0.75 T̂) and the paper's (none). "
        + _conditions(results),
        numeric,
        heat=numeric,
    )


def _conditions(results: Results) -> str:
    """Which acts read a measured output after the start."""
    reading = [act for act in _played(results) if results[act.name].attrs["conditional_on"]]
    read = [act.letter for act in reading]
    if not read:
        return ""
    return f"{' and '.join(read)}: conditional on measured surge, which the alignment reads."


def _split(result: StudyResult, test: str, model: str) -> list[float]:
    """Median error of the wave-frequency and of the slow channels."""
    data = result.tests[test]
    cells = data["error"].sel(model=model, measure="nrmse").values[data["judged"].values]
    slow = np.isin(data["channel"].values.astype(str), SLOW)
    return [float(np.nanmedian(average_of(cells[:, part]))) for part in (~slow, slow)]


def _heat_table(results: Results, test: str) -> Table:
    """Median error of each channel in a test set, act beside act."""
    places = [
        (act, results[act.name], model)
        for act in _played(results)
        for model in judged_models(results[act.name])
    ]
    rows = []
    first = next(iter(results.values()))
    for name in [*first.channels, "average"]:
        cells = []
        for _, result, model in places:
            at = result.groups["statistics/boxes"]["median"].sel(test=test)
            cells.append(number(at.sel(model=model, measure="nrmse", channel=name), 2))
        rows.append((name.replace("_", " "), *cells))
    heads = [f"{act.title.partition(' ')[0]} {model_words(model)}" for act, _, model in places]
    numeric = range(1, len(heads) + 1)
    return Table(
        f"channels_{test}",
        f"Median NRMSE, {first.label_of(test)}",
        ("channel", *heads),
        rows,
        "",
        numeric,
        averages=[len(rows) - 1],
        heat=numeric,
    )
