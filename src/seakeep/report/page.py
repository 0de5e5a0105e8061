"""The report: one HTML file that holds everything and asks the network for nothing."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from seakeep.arrays import Progress
from seakeep.files import MARK, check_output, replacing
from seakeep.report.html import inline_svg, rendered
from seakeep.report.section import Drawing, Section
from seakeep.report.sections import SECTIONS
from seakeep.report.sections.histories import write_histories
from seakeep.report.sections.settings import finished
from seakeep.report.style import figure_style, save_figure
from seakeep.report.tables import write_csv, write_latex
from seakeep.study import StudyResult
from seakeep.study.store import storing

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

__all__ = ["write_page", "write_report"]

SHORT = re.compile(r"(\.\d)\d+")
RASTER_DPI = 80
"""Of pictures without vectors: as wide as the page."""
UNFINISHED = f"""<!DOCTYPE html>
<meta name="generator" content="{MARK}: report">
<p>This report was not finished. Run its command again.</p>
"""


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
        The page.

    Raises
    ------
    RequestError
        If matplotlib is not installed.
    StorageError
        If the disk is full or cannot be written.
    """
    sections = [section for make in SECTIONS if (section := make(result)) is not None]
    if not pictures:
        drawn = [tuple(each for each in one.figures if not each.raster) for one in sections]
        sections = [replace(one, figures=f) for one, f in zip(sections, drawn, strict=True)]
    stamp = {key: str(result.attrs[key]) for key in ("preset", "seed", "digest", "description")}
    stamp["finished"] = finished(result)
    title = f"{result.attrs['study']}: study report"
    with storing(result.folder):
        write_histories(result)
    return write_page(result.folder, title, stamp, sections, progress)


def write_page(
    folder: Path,
    title: str,
    stamp: Mapping[str, str],
    sections: Sequence[Section],
    progress: Progress | None = None,
) -> Path:
    """Write a page of sections into a folder, with its figures and tables; errors as above.

    Parameters
    ----------
    folder : Path
        Folder for ``report.html``, ``figures/`` and ``tables/``.
    title : str
        Heading.
    stamp : mapping of str to str
        ``description``, ``preset``, ``seed``, ``digest`` and ``finished``, as far as known.
    sections : sequence of Section
        What it holds.
    progress : callable, optional
        Called as ``progress(done, total, what)``.

    Returns
    -------
    Path
        The page.
    """
    tell = progress or (lambda done, total, what: None)
    page = folder / "report.html"
    check_output(page, "report")
    drawings = [each for section in sections for each in section.figures]
    drawn: dict[str, Markup | None] = {}
    with storing(folder), figure_style():
        if not page.exists():  # figures of an interrupted report are known as ours
            with replacing(page) as temporary:
                temporary.write_text(UNFINISHED, encoding="utf-8")
        for each in ("figures", "tables"):
            (folder / each).mkdir(exist_ok=True)
        for table in (each for section in sections for each in section.tables):
            write_csv(table, folder / "tables" / f"{table.name}.csv")
            write_latex(table, folder / "tables" / f"{table.name}.tex")
        for number, drawing in enumerate(drawings):
            tell(number, len(drawings), f"drawing {drawing.name.replace('_', ' ')}")
            drawn[drawing.name] = _drawn(drawing, folder / "figures")
        text = rendered(
            "report.html",
            kind="report",
            title=title,
            stamp=stamp,
            sections=sections,
            drawn=drawn,
        )
        with replacing(page) as temporary:
            temporary.write_text(text, encoding="utf-8")
    tell(len(drawings), len(drawings), "report written")
    return page


def _drawn(drawing: Drawing, folder: Path) -> Markup | None:
    """Draw a figure, write its files, and return it as an element of the page."""
    figure = drawing.draw()
    if drawing.raster:
        figure.set_dpi(RASTER_DPI)
    engine = figure.get_layout_engine()
    if engine is not None:  # laid out once, not again for each file
        engine.execute(figure)
        # Without any engine; "none" stands for one, for which each file would be drawn twice.
        figure.set_layout_engine(None)
    picture = folder / f"{drawing.name}.png"
    save_figure(figure, picture, figure.dpi)
    if drawing.raster:  # a link
        return None
    text = _svg_text(figure, drawing.name)
    with replacing(folder / f"{drawing.name}.svg") as temporary:
        temporary.write_text(text, encoding="utf-8")
    return inline_svg(text, drawing.name, drawing.caption)


def _svg_text(figure: Figure, name: str) -> str:
    """SVG of a figure, letters as shapes, so that it looks the same wherever it is opened."""
    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    # A tenth of a point is all that can be seen, and half of the file.
    return re.sub(r' d="[^"]*"', lambda path: SHORT.sub(r"\1", path[0]), buffer.getvalue())
