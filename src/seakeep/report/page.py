"""The report: one HTML file that holds everything and asks the network for nothing."""

from __future__ import annotations

import base64
import html
import io
import re
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from seakeep.campaign.prepare import Progress
from seakeep.files import replacing
from seakeep.report.deviations import (
    deviations,
    test_overlap,
    training_overlap,
    training_windows_overlap,
)
from seakeep.report.figures import ReportFigure, report_figures
from seakeep.report.glossary import few_cells, glossary
from seakeep.report.interactive import history_data
from seakeep.report.latex import write_latex_table
from seakeep.report.regular import response_table, response_words
from seakeep.report.study_tables import (
    ReportTable,
    coverage_table,
    divergence_table,
    error_table,
    overview_table,
    trend_table,
    write_csv_table,
)
from seakeep.report.study_words import (
    clock_table,
    findings,
    finished,
    quality_table,
    run_table,
    settings_table,
    sign_table,
    training_table,
    versions_table,
)
from seakeep.report.style import figure_style, save_figure
from seakeep.study import StudyResult
from seakeep.study.judge import VARIANTS
from seakeep.study.store import storing

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["report_tables", "write_report"]

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:"
"""What the page may load: nothing that is not in it."""

RASTER_DPI = 80
"""Of pictures without vectors: as wide as the page."""

SECTIONS = {
    "summary": "What came out",
    "deviations": "Deviations in effect",
    "errors": "Errors",
    "regular": "Regular waves: where the error comes from",
    "explore": "Time histories, interactive",
    "histories": "Time histories",
    "time": "Error over the age of a forecast",
    "coverage": "Coverage of the band",
    "densities": "Densities and their divergence",
    "members": "Members of the ensemble",
    "waves": "Waves",
    "data": "Data",
    "settings": "Settings and windows",
    "versions": "Versions and digest",
}


def headings(result: StudyResult) -> dict[str, str]:
    """Headings of the sections, in their order.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    dict of str to str
        Where the paper is not asked for, what it leaves open is a matter of settings.
    """
    if result.shows_paper:
        return SECTIONS
    others = {
        key: words for key, words in SECTIONS.items() if key not in ("deviations", "versions")
    }
    return {**others, "deviations": "Method in effect", "versions": SECTIONS["versions"]}


def report_tables(result: StudyResult) -> dict[str, list[ReportTable]]:
    """All tables of a study, by section.

    Parameters
    ----------
    result : StudyResult
        The study.

    Returns
    -------
    dict of str to list of ReportTable
    """
    ensembles = [model for model in result.models if result.is_ensemble(model)]
    return {
        "summary": [overview_table(result)],
        "deviations": [deviations(result)],
        "errors": [error_table(result, test) for test in result.tests],
        "regular": [
            table for test in result.tests if (table := response_table(result, test)) is not None
        ],
        "time": [trend_table(result)],
        "coverage": [
            coverage_table(result, model, calibrated)
            for model in ensembles
            for calibrated in (False, True)
            if not calibrated or f"calibration/{model}" in result.groups
        ],
        "densities": [
            divergence_table(result, model, variant)
            for model in (*ensembles, *(m for m in result.models if m not in ensembles))
            for variant in VARIANTS
        ],
        "data": [
            sign_table(result),
            run_table(result),
            *([clocks] if (clocks := clock_table(result)) is not None else []),
            *(quality_table(result, name) for name in result.prepared),
        ],
        "settings": [settings_table(result), training_table(result)],
        "versions": [versions_table(result)],
    }


def write_report(result: StudyResult, progress: Progress | None = None) -> Path:
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
    tables = report_tables(result)
    figures = report_figures(result)
    drawn: dict[str, list[tuple[ReportFigure, str]]] = {}
    with storing(result.folder), figure_style():
        for folder in ("figures", "tables"):
            (result.folder / folder).mkdir(exist_ok=True)
        for table in (table for group in tables.values() for table in group):
            write_csv_table(table, result.folder / "tables" / f"{table.name}.csv")
            write_latex_table(table, result.folder / "tables" / f"{table.name}.tex")
        for number, each in enumerate(figures):
            tell(number, len(figures), f"drawing {each.name.replace('_', ' ')}")
            figure = each.draw()
            if each.raster:
                figure.set_dpi(RASTER_DPI)
            _lay_out(figure)
            picture = result.folder / "figures" / f"{each.name}.png"
            save_figure(figure, picture, figure.dpi)
            if each.raster:
                drawn.setdefault(each.section, []).append((each, inline_png(picture, each.name)))
                continue
            text = svg_text(figure, each.name)
            with replacing(result.folder / "figures" / f"{each.name}.svg") as temporary:
                temporary.write_text(text, encoding="utf-8")
            drawn.setdefault(each.section, []).append((each, inline_svg(text, each.name)))
        page = result.folder / "report.html"
        with replacing(page) as temporary:
            temporary.write_text(_page(result, tables, drawn), encoding="utf-8")
    tell(len(figures), len(figures), "report written")
    return page


def _lay_out(figure: Figure) -> None:
    """Lay a figure out once, not again for each file."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        # Without any engine; "none" stands for one, for which each file would be drawn twice.
        figure.set_layout_engine(None)


def svg_text(figure: Figure, name: str) -> str:
    """SVG of a figure, letters as shapes, so that it looks the same wherever it is opened."""
    import matplotlib as mpl

    buffer = io.StringIO()
    with mpl.rc_context({"svg.fonttype": "path", "svg.hashsalt": name}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return buffer.getvalue()


def inline_svg(text: str, name: str) -> str:
    """Turn an SVG file into an element that may stand inside a page beside others.

    Parameters
    ----------
    text : str
        The file.
    name : str
        Prefix of all ids, so that figures of one page do not share any.

    Returns
    -------
    str
        The element ``<svg>``.
    """
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r'\bid="', f'id="{name}-', text)
    text = re.sub(r'href="#', f'href="#{name}-', text)
    return re.sub(r"url\(#", f"url(#{name}-", text)


def inline_png(path: Path, name: str) -> str:
    """Element ``<img>`` that holds a picture.

    Parameters
    ----------
    path : Path
        The file.
    name : str
        Of the figure.

    Returns
    -------
    str
    """
    encoded = base64.b64encode(path.read_bytes()).decode("ascii")
    words = html.escape(name.replace("_", " "))
    return f'<img alt="{words}" src="data:image/png;base64,{encoded}">'


def _asset(name: str) -> str:
    return resources.files("seakeep.report").joinpath("assets", name).read_text("utf-8")


def _page(
    result: StudyResult,
    tables: dict[str, list[ReportTable]],
    drawn: dict[str, list[tuple[ReportFigure, str]]],
) -> str:
    titles = headings(result)
    bodies = {key: _section(result, key, tables, drawn) for key in titles}
    shown = {key: body for key, body in bodies.items() if body}
    contents = "".join(f'<li><a href="#{key}">{html.escape(titles[key])}</a></li>' for key in shown)
    sections = "\n".join(
        f'<section id="{key}"><h2>{html.escape(titles[key])}</h2>\n{body}</section>'
        for key, body in shown.items()
    )
    title = html.escape(f"{result.attrs['study']}: study report")
    lead = html.escape(str(result.attrs.get("description", "")))
    digest = html.escape(str(result.attrs["digest"])[:16])
    return f"""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
  content="{POLICY}">
<link rel="icon" href="data:,">
<title>{title}</title>
<style>
{_asset("report.css")}</style>
</head>
<body>
<div class="page">
<nav aria-label="Contents"><ol>{contents}</ol></nav>
<main>
<h1>{title}</h1>
<p class="lead">{lead}</p>
<p class="lead">Preset <strong>{html.escape(str(result.attrs["preset"]))}</strong>, seed
{int(result.attrs["seed"])}, digest <code>{digest}</code>, finished
<span class="whole">{html.escape(finished(result))}</span>.</p>
{sections}
</main>
</div>
<script>
{_asset("report.js")}</script>
</body>
</html>
"""


def _section(
    result: StudyResult,
    key: str,
    tables: dict[str, list[ReportTable]],
    drawn: dict[str, list[tuple[ReportFigure, str]]],
) -> str:
    parts = []
    if key == "summary":
        parts.append(_summary(result))
    if key == "explore":
        parts.append(_explorer(result))
    if key == "regular":
        parts.append(_paragraphs(response_words(result)))
    if key == "settings":
        parts.append(_paragraphs([training_overlap(result), test_overlap(result)]))
    figures = [(each.raster, _figure(each, drawing)) for each, drawing in drawn.get(key, [])]
    parts += [text for raster, text in figures if not raster]
    parts += [_table(table) for table in tables.get(key, [])]
    parts += [text for raster, text in figures if raster]
    return "\n".join(part for part in parts if part)


def _paragraphs(texts: Sequence[str], kind: str = "") -> str:
    attribute = f' class="{kind}"' if kind else ""
    return "\n".join(f"<p{attribute}>{html.escape(text)}</p>" for text in texts if text)


def _summary(result: StudyResult) -> str:
    items = "".join(f"<li>{html.escape(text)}</li>" for text in findings(result))
    notices = [
        str(result.attrs.get("preparation_note", "")),
        few_cells(result),
        training_overlap(result) if training_windows_overlap(result) else "",
        test_overlap(result),
    ]
    conditional = str(result.attrs.get("conditional_on", ""))
    if conditional:
        notices.append(
            f"Every number here is conditional on measured {conditional}: the alignment of the "
            "waves reads it after the start of a forecast. It is no forecast in the strict sense."
        )
    return f"<ul>{items}</ul>\n" + _paragraphs(notices, "notice") + _glossary(result)


def _glossary(result: StudyResult) -> str:
    terms = "".join(
        f"<dt>{html.escape(term)}</dt><dd>{html.escape(words)}</dd>"
        for term, words in glossary(result)
    )
    return (
        '<details class="glossary" open><summary>Words and symbols</summary>'
        f"<dl>{terms}</dl></details>"
    )


def _explorer(result: StudyResult) -> str:
    if not int(result.settings["output"]["shown_windows"]):
        return ""
    boxes = {
        "measured": "measured",
        "models": "forecasts",
        "band": "band",
        "members": "members",
    }
    checks = " ".join(
        f'<label><input type="checkbox" value="{key}"{"" if key == "members" else " checked"}> '
        f"{words}</label>"
        for key, words in boxes.items()
    )
    return f"""<div class="controls only-screen">
<label>window <select id="pick-cell"></select></label>
<label>channel <select id="pick-channel"></select></label>
<span id="history-show">{checks}</span>
</div>
<div class="plot"><canvas id="history" tabindex="0" role="img"
  aria-label="Time history of the chosen channel; plus, minus, 0 and the arrows zoom and move">
</canvas></div>
<div class="controls only-screen">
<button id="zoom-in">Zoom in</button> <button id="zoom-out">Zoom out</button>
<button id="zoom-left">Earlier</button> <button id="zoom-right">Later</button>
<button id="zoom-reset">Whole window</button>
</div>
<div class="readout" id="history-readout" aria-live="polite"></div>
<p class="note only-screen">Drag over the plot to zoom, double-click for the whole window; with
Ctrl or Shift the wheel zooms too. Physical units, angles in degrees.</p>
<script type="application/json" id="history-data">{history_data(result)}</script>
"""


def _figure(figure: ReportFigure, drawing: str) -> str:
    caption = html.escape(figure.caption)
    if figure.raster:
        return (
            f'<details class="only-screen"><summary>{caption}</summary>\n'
            f'<figure id="figure-{figure.name}">{drawing}<figcaption>File: '
            f"figures/{figure.name}.png.</figcaption></figure></details>"
        )
    return (
        f'<figure id="figure-{figure.name}">\n{drawing}\n<figcaption>{caption} '
        f"<span class='only-screen'>Files: figures/{figure.name}.png, .svg.</span></figcaption>"
        "</figure>"
    )


def _table(table: ReportTable) -> str:
    def cell(tag: str, text: str, column: int) -> str:
        kinds = ["number"] if column in table.numeric else []
        kinds += ["elsewhere"] if column in table.elsewhere else []
        attribute = f' class="{" ".join(kinds)}"' if kinds else ""
        if column in table.numeric:
            text = re.sub(r"(?<![\w)])-(?=\d)", "−", text)
        return f"<{tag}{attribute}>{html.escape(text)}</{tag}>"

    head = "".join(cell("th", text, k) for k, text in enumerate(table.columns))
    rows = []
    for number, row in enumerate(table.rows):
        attribute = ' class="average"' if number in table.averages else ""
        cells = "".join(cell("td", text, k) for k, text in enumerate(row))
        rows.append(f"<tr{attribute}>{cells}</tr>")
    note = f'<p class="note">{html.escape(table.note)}</p>' if table.note else ""
    text = (
        f'<div class="table" id="table-{table.name}"><button class="copy">Copy table</button>'
        f'<p class="caption" id="caption-{table.name}">{html.escape(table.title)}</p>'
        f'<div class="scroll"><table aria-labelledby="caption-{table.name}">'
        f"<thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table></div>{note}"
        f"<p class='note only-screen'>Files: tables/{table.name}.csv, .tex.</p></div>"
    )
    if not table.folded:
        return text
    title = html.escape(table.title)
    return f'<details class="only-screen"><summary>{title}</summary>\n{text}</details>'
