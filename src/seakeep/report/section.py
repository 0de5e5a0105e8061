"""Sections of a page: words, figures and tables."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from seakeep.report.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["Drawing", "Section"]


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
    raster : bool, optional
        Too many points for vectors: a PNG file beside the page, which links to it.
    """

    name: str
    caption: str
    draw: Callable[[], Figure]
    raster: bool = False


@dataclass(frozen=True)
class Section:
    """A section of a report, in the order in which a page shows its parts.

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
        Data of an interactive plot, from :func:`seakeep.report.sections.histories.history_data`.
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
