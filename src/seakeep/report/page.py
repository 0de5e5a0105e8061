"""Pages of sections: one HTML file that holds everything and asks the network for nothing."""

import base64
import io
import re
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

from markupsafe import Markup, escape

from seakeep.arrays import Progress
from seakeep.executor import in_order, on_this_machine
from seakeep.files import MARK, check_output, templates, write_text
from seakeep.report.style import Figure, figure_style, save_figure
from seakeep.report.tables import WORDS, Table, parts_of, shade, with_minus, write_csv, write_latex
from seakeep.study.store import storing

UNFINISHED = f"""<!DOCTYPE html>
<meta name="generator" content="{MARK}: report">
<p>This report was not finished. Run its command again.</p>
"""


@dataclass(frozen=True)
class Drawing:
    """A figure that is drawn when the page is written.

    Parameters
    ----------
    name : str
        Name of its files.
    caption : str
        What it shows.
    draw : callable
        Draws it.
    """

    name: str
    caption: str
    draw: Callable[[], Figure]


@dataclass(frozen=True)
class Section:
    """A section of a page, in the order in which the page shows its parts.

    Parameters
    ----------
    key : str
        Name of its place on the page.
    title : str
        Heading.
    words : sequence of str
        Paragraphs.
    points : sequence of str
        Results, as a list.
    links : sequence of (str, str)
        Addresses of other files, and words for them.
    notices : sequence of str
        Paragraphs that stand out.
    terms : sequence of (str, str)
        Words and what they mean.
    histories : dict, optional
        Data of an interactive plot, from :func:`seakeep.report.sections.histories.explorer`.
    figures : sequence of Drawing
        Figures.
    tables : sequence of Table
        Tables.
    """

    key: str
    title: str
    words: Sequence[str] = ()
    points: Sequence[str] = ()
    links: Sequence[tuple[str, str]] = ()
    notices: Sequence[str] = ()
    terms: Sequence[tuple[str, str]] = ()
    histories: dict[str, Any] | None = None
    figures: Sequence[Drawing] = ()
    tables: Sequence[Table] = ()

    @property
    def is_empty(self) -> bool:
        """Whether it shows nothing but its paragraphs."""
        parts = (self.points, self.links, self.terms, self.histories, self.figures, self.tables)
        return not any(parts)


def drawing(key: str, draw: Callable[..., Figure], *given: Any, **values: Any) -> Drawing:
    """Figure with the caption of ``words.toml``, and the values that it holds in braces.

    `draw` takes what is `given`; the value ``name`` is that of its files, by default the key.
    """
    caption = WORDS["figures"][key].format(**values)
    return Drawing(values.get("name", key), caption, partial(draw, *given))


def section(
    key: str, *parts: Drawing | Table | None, more: Sequence[str] = (), **given: Any
) -> Section:
    """Section with the title and paragraphs of ``words.toml``, and `more` paragraphs.

    `parts` are its figures and tables; a table without rows is left out. Of what is `given`, parts
    of a :class:`Section` are its own, and the rest is what the paragraphs hold in braces.
    """
    entry = WORDS["sections"][key]
    paragraphs = [each.format(**given) for each in entry.get("words", ())]
    return Section(
        key,
        entry["title"],
        [*paragraphs, *filter(None, more)],
        figures=[each for each in parts if isinstance(each, Drawing)],
        tables=[each for each in parts if isinstance(each, Table) and each.rows],
        **parts_of(Section, given),
    )


def write_page(
    folder: Path,
    title: str,
    stamp: Mapping[str, str],
    sections: Sequence[Section],
    progress: Progress | None = None,
    executor: Executor | None = None,
) -> Path:
    """Write a page of sections into a folder, with its figures and tables.

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
    executor : concurrent.futures.Executor, optional
        Draws figures side by side, if its workers are on this machine.

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
    page = folder / "report.html"
    check_output(page, "report")
    drawings = [each for section in sections for each in section.figures]
    drawn = {}
    with storing(folder):
        if not page.exists():  # figures of an interrupted report are known as ours
            write_text(page, UNFINISHED)
        for kind in ("figures", "tables"):
            (folder / kind).mkdir(exist_ok=True)
        for each in sections:
            for table in each.tables:
                write_csv(table, folder / "tables" / f"{table.name}.csv")
                write_latex(table, folder / "tables" / f"{table.name}.tex")
        numbers, near = range(len(drawings)), on_this_machine(executor)
        pictures = in_order(_drawn, (drawings, folder / "figures"), numbers, near)
        for number, name in enumerate(each.name for each in drawings):
            tell(number, len(drawings), f"drawing {name.replace('_', ' ')}")
            drawn[name] = next(pictures)
        content = {"stamp": stamp, "sections": sections, "drawn": drawn, "files": True}
        write_text(page, rendered(kind="report", title=title, **content))
    tell(len(drawings), len(drawings), "report written")
    return page


def rendered(**content: Any) -> str:
    """Text of a page; what is not ours is escaped."""
    folder = resources.files("seakeep.report").joinpath("templates")
    environment = templates("report")
    environment.globals["source"] = lambda name: Markup(folder.joinpath(name).read_text("utf-8"))
    environment.filters["shade"] = shade
    environment.filters["breakable"] = lambda text: escape(_set(text)).replace(
        "_", Markup("_<wbr>")
    )
    environment.finalize = lambda each: each if isinstance(each, Markup) else _set(str(each))
    return environment.get_template("report.html").render(**content)


def _set(text: str) -> str:
    """Words as they are set: with signs of minus, and no line that begins with a percent sign."""
    return with_minus(text).replace(" %", "\u00a0%")


def inline_picture(png: bytes, words: str) -> Markup:
    """Element ``<img>`` that holds a picture."""
    encoded = base64.b64encode(png).decode("ascii")
    return Markup(f'<img alt="{escape(words)}" src="data:image/png;base64,{encoded}">')


@figure_style()
def _drawn(page: tuple[Sequence[Drawing], Path], number: int) -> Markup:
    """Draw a figure, write its files, and return it as an element of the page."""
    import matplotlib as mpl

    drawings, folder = page
    drawing = drawings[number]
    figure = drawing.draw()
    engine = figure.get_layout_engine()
    if engine:  # laid out once, not again for each file
        engine.execute(figure)
        # Without any engine; "none" stands for one, for which each file would be drawn twice.
        figure.set_layout_engine(None)
    save_figure(figure, folder / f"{drawing.name}.png")
    name, label, buffer = drawing.name, f"title-{drawing.name}", io.StringIO()
    # Letters are shapes, so that it looks the same wherever it is opened.
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    # A tenth of a point is all that can be seen, and half of the file.
    shorten = re.compile(r"(\.\d)\d+")
    text = re.sub(r' d="[^"]*"', lambda path: shorten.sub(r"\1", path[0]), buffer.getvalue())
    write_text(folder / f"{name}.svg", text)
    # Inside a page it stands beside others.
    text = re.sub(r"<(metadata|title)>.*?</\1>", "", text[text.index("<svg") :], flags=re.S)
    text = re.sub(r'(\bid="|href="#|url\(#)', rf"\1{name}-", text)
    words = f'<title id="{label}">{escape(drawing.caption)}</title>'
    return Markup(text.replace(">", f' role="img" aria-labelledby="{label}">{words}', 1))
