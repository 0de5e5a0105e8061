"""The report: one HTML file that holds everything and asks the network for nothing."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from seakeep.files import replacing
from seakeep.report.html import inline_picture, inline_svg, rendered
from seakeep.report.section import Drawing
from seakeep.report.sections import SECTIONS
from seakeep.report.sections.settings import finished
from seakeep.report.style import figure_style, save_figure
from seakeep.report.tables import write_csv, write_latex
from seakeep.study import StudyResult
from seakeep.study.store import storing

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

__all__ = ["write_report"]

RASTER_DPI = 80
"""Of pictures without vectors: as wide as the page."""


def write_report(
    result: StudyResult, progress: Callable[[int, int, str], None] | None = None
) -> Path:
    """Write ``report.html``, ``figures/`` (PNG and SVG) and ``tables/`` (CSV and LaTeX).

    Parameters
    ----------
    result : StudyResult
        The study; all is written into its folder.
    progress : callable, optional
        Called as ``progress(done, total, what)``.

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
    tell = progress or (lambda done, total, what: None)
    sections = [section for make in SECTIONS if (section := make(result)) is not None]
    drawings = [each for section in sections for each in section.figures]
    drawn: dict[str, Markup] = {}
    with storing(result.folder), figure_style():
        for folder in ("figures", "tables"):
            (result.folder / folder).mkdir(exist_ok=True)
        for table in (each for section in sections for each in section.tables):
            write_csv(table, result.folder / "tables" / f"{table.name}.csv")
            write_latex(table, result.folder / "tables" / f"{table.name}.tex")
        for number, each in enumerate(drawings):
            tell(number, len(drawings), f"drawing {each.name.replace('_', ' ')}")
            drawn[each.name] = _drawn(each, result.folder / "figures")
        page = result.folder / "report.html"
        text = rendered(
            "report.html",
            kind="report",
            title=f"{result.attrs['study']}: study report",
            study=result.attrs,
            finished=finished(result),
            sections=sections,
            drawn=drawn,
        )
        with replacing(page) as temporary:
            temporary.write_text(text, encoding="utf-8")
    tell(len(drawings), len(drawings), "report written")
    return page


def _drawn(drawing: Drawing, folder: Path) -> Markup:
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
    if drawing.raster:
        return inline_picture(picture.read_bytes(), drawing.name.replace("_", " "))
    text = _svg_text(figure, drawing.name)
    with replacing(folder / f"{drawing.name}.svg") as temporary:
        temporary.write_text(text, encoding="utf-8")
    return inline_svg(text, drawing.name)


def _svg_text(figure: Figure, name: str) -> str:
    """SVG of a figure, letters as shapes, so that it looks the same wherever it is opened."""
    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()
