"""The report of a study: its sections, each a function of the result, in their order."""

from concurrent.futures import Executor
from pathlib import Path

from seakeep.arrays import Progress
from seakeep.report.page import write_page
from seakeep.report.sections import data, histories, results
from seakeep.study import StudyResult
from seakeep.study.store import storing

SECTIONS = [
    results.summary,
    results.errors,
    results.scales,
    results.regular,
    histories.explorer,
    histories.histories,
    results.age,
    results.coverage,
    results.bands,
    results.densities,
    results.eigenvalues,
    data.waves,
    data.data,
    data.chosen,
    data.settings,
    data.versions,
    results.glossary,
]
"""A section is one function here; one that has nothing to show is left out."""


def write_report(
    result: StudyResult, progress: Progress | None = None, executor: Executor | None = None
) -> Path:
    """Write ``report.html`` with its ``figures/``, ``tables/`` and ``histories/``.

    Figures are PNG and SVG, tables CSV and LaTeX; histories are what the interactive plot loads.

    Parameters
    ----------
    result : StudyResult
        The study; all is written into its folder.
    progress : callable, optional
        Called as ``progress(done, total, what)``.
    executor : concurrent.futures.Executor, optional
        As of :func:`seakeep.report.page.write_page`.

    Returns
    -------
    Path
        The page; errors as of :func:`seakeep.report.page.write_page`.
    """
    sections = [each for make in SECTIONS if not (each := make(result)).is_empty]
    stamp = {key: result.attrs[key] for key in ("preset", "seed", "digest", "description")}
    stamp["finished"] = data.finished(result)
    with storing(result.folder):
        histories.write_histories(result)
    title = f"{result.attrs['study']}: study report"
    return write_page(result.folder, title, stamp, sections, progress, executor)
