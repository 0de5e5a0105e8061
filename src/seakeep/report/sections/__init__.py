"""The report of a study: its sections, each a function of the result, in their order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from seakeep.arrays import Progress
from seakeep.report.page import Section, write_page
from seakeep.report.sections import data, errors, histories, summary
from seakeep.study import StudyResult
from seakeep.study.store import storing

SECTIONS: list[Callable[[StudyResult], Section | None]] = [
    summary.summary,
    errors.errors,
    errors.scales,
    errors.regular,
    histories.explorer,
    histories.histories,
    errors.age,
    errors.coverage,
    errors.bands,
    errors.densities,
    errors.members,
    data.waves,
    data.data,
    data.chosen,
    data.settings,
    data.versions,
    summary.glossary,
]
"""A section is one function here; where it has nothing to show it returns None."""


def write_report(
    result: StudyResult, progress: Progress | None = None, pictures: bool = True
) -> Path:
    """Write ``report.html`` with its ``figures/``, ``tables/`` and ``histories/``.

    Figures are PNG and SVG, tables CSV and LaTeX; histories are what the interactive plot loads.

    Parameters
    ----------
    result : StudyResult
        The study; all is written into its folder.
    progress : callable, optional
        Called as ``progress(done, total, what)``.
    pictures : bool, optional
        Whether all channels of each run are drawn too: what takes longest.

    Returns
    -------
    Path
        The page; errors as of :func:`seakeep.report.page.write_page`.
    """
    sections = [section for make in SECTIONS if (section := make(result)) is not None]
    if not pictures:
        drawn = [[each for each in one.figures if not each.raster] for one in sections]
        sections = [replace(one, figures=f) for one, f in zip(sections, drawn, strict=True)]
    stamp = {key: str(result.attrs[key]) for key in ("preset", "seed", "digest", "description")}
    stamp["finished"] = data.finished(result)
    with storing(result.folder):
        histories.write_histories(result)
    title = f"{result.attrs['study']}: study report"
    return write_page(result.folder, title, stamp, sections, progress)
