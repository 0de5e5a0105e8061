"""The data-quality sheet: one page with a picture a channel and a table a run."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.campaign.pipeline import redundant_pairs
from seakeep.campaign.settings import CampaignSettings, long_name_of
from seakeep.conventions import displayed
from seakeep.files import replacing
from seakeep.quality import Finding, compared, findings_of
from seakeep.report.style import COLOURS, axis_label, figure_style, new_figure, shown_unit
from seakeep.signals.quality import FLAGS, LATE, Agreement

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["channel_rows", "quality_figure", "steps_of", "write_quality_sheet"]

_MARKS = {
    "missing": ("#D55E00", "x"),
    "bridged": ("#E69F00", "+"),
    "outlier": ("#CC79A7", "o"),
    "saturated": ("#0072B2", "^"),
    "stuck": ("#009E73", "s"),
    "replaced": ("#56B4E9", "d"),
}
"""Colour and shape of each flag: shapes tell them apart in grey print."""
FOUND = "#FDEEE4"
"""Ground of a panel, and of a row, in which something was found."""
_STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; color: #1b2430; max-width: 1080px;
       margin: 2em auto; padding: 0 1em; }
h1 { font-size: 1.5em; } h2 { margin-top: 2em; border-top: 1px solid #ccd; padding-top: 1em; }
table { border-collapse: collapse; font-size: 13px; width: 100%; }
th, td { text-align: left; padding: 3px 8px; border-bottom: 1px solid #e4e7ec;
         vertical-align: top; }
td.n, th.n { text-align: right; white-space: nowrap; }
td.n { font-variant-numeric: tabular-nums; } table.short { width: auto; }
.bad { background: FOUND; } .ok { color: #5b6770; } img { width: 100%; height: auto; }
.scroll { overflow-x: auto; } li { margin: 2px 0; }
""".replace("FOUND", FOUND)


def _flags(run: xr.Dataset, name: str) -> Any:
    key = f"{name}_flags"
    if key in run.coords:
        return run[key].to_numpy().astype(int)
    return np.zeros(run.sizes["time"], dtype=int)


def channel_rows(run: xr.Dataset) -> list[dict[str, Any]]:
    """Rows of a run's table: statistics, flagged shares and findings of each channel.

    Angles and their rates are in degrees.

    Parameters
    ----------
    run : Dataset
        A prepared run.

    Returns
    -------
    list of dict
        One a channel, in the run's order.
    """
    found = findings_of(run)
    rows = []
    for name in map(str, run.data_vars):
        x, flags = run[name].to_numpy(), _flags(run, name)
        some = bool(np.isfinite(x).any())
        factor, units = displayed(str(run[name].attrs.get("units", "")))
        x = factor * x
        numbers = [np.nanmin(x), np.nanmax(x), np.nanmean(x), np.nanstd(x, ddof=1)] if some else []
        shares = [
            f"{word} {100 * np.mean((flags & bit) > 0):.2g} %"
            for word, bit in FLAGS.items()
            if (flags & bit).any()
        ]
        rows.append(
            {
                "channel": name,
                "words": long_name_of(name, run[name].attrs.get("long_name")),
                "units": units,
                "numbers": [float(each) for each in numbers] or [float("nan")] * 4,
                "flagged": ", ".join(shares),
                "repaired": str(run[name].attrs.get("repaired", "")),
                "findings": [each for each in found if each.channel == name],
            }
        )
    return rows


def quality_figure(run: xr.Dataset, agreements: Mapping[str, Agreement]) -> Figure:
    """Draw every channel of a run, flagged samples marked; lags of redundant sensors below.

    Parameters
    ----------
    run : Dataset
        A prepared run.
    agreements : mapping of str to Agreement
        Comparison with a trusted sensor, by channel.

    Returns
    -------
    matplotlib.figure.Figure
        One panel a channel, and one a compared channel.
    """
    names = [str(name) for name in run.data_vars]
    lagging = [name for name in agreements if agreements[name].lags.size]
    rows = len(names) + len(lagging)
    found = {each.channel for each in findings_of(run)}
    with figure_style():
        figure = new_figure(9.5, 0.5 + 1.45 * rows)
        axes = figure.subplots(rows, 1, squeeze=False, sharex=True)[:, 0]
        time = run["time"].to_numpy()
        for at, name in zip(axes, names, strict=False):
            factor, units = displayed(str(run[name].attrs.get("units", "")))
            x, flags = factor * run[name].to_numpy(), _flags(run, name)
            if name in found:
                at.set_facecolor(FOUND)
            at.plot(time, x, color=COLOURS["measured"], linewidth=0.6)
            _mark(at, time, x, flags)
            at.set_ylabel(axis_label(name, units, run[name].attrs.get("long_name")), fontsize=8)
        for at, name in zip(axes[len(names) :], lagging, strict=True):
            each = agreements[name]
            limit = LATE * each.period
            at.axhspan(-limit, limit, color="#009E73", alpha=0.12)
            instants = each.centre + time[0]
            at.plot(*_broken(instants, each.lags), "o-", color=COLOURS["ensemble"], markersize=3)
            reach = max(1.5 * limit, 1.1 * float(np.nanmax(np.abs(each.lags), initial=0.0)))
            at.set_ylim(-reach, reach)
            at.set_ylabel(f"lag of\n{name.replace('_', ' ')} [s]", fontsize=8)
        for at in axes:
            at.margins(x=0.005)
            at.tick_params(axis="x", labelbottom=True, labelsize=7)
        figure.align_ylabels(axes)
        axes[-1].set_xlabel("time [s]")
    return figure


def _broken(instants: Any, lags: Any) -> tuple[Any, Any]:
    """Split a line by NaN where windows are missing, so that it does not run across them."""
    apart = np.diff(instants)
    holes = 1 + np.flatnonzero(apart > 1.5 * np.median(apart)) if apart.size else apart.astype(int)
    return np.insert(instants, holes, instants[holes - 1]), np.insert(lags, holes, np.nan)


def _mark(at: Any, time: Any, x: Any, flags: Any) -> None:
    seen = False
    there = np.isfinite(x)
    # A sample that is not there stands between its neighbours.
    filled = np.interp(time, time[there], x[there]) if there.any() else np.zeros_like(time)
    for word, bit in FLAGS.items():
        hit = (flags & bit) > 0
        if hit.any():
            colour, shape = _MARKS[word]
            style = {"color": colour, "marker": shape, "markersize": 3.5, "linestyle": "none"}
            at.plot(time[hit], filled[hit], **style, zorder=3, label=word)
            seen = True
    if seen:
        place = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.95)}
        at.legend(**place, fontsize=7, ncols=6, borderpad=0.1)


def write_quality_sheet(
    runs: Mapping[str, xr.Dataset],
    settings: CampaignSettings,
    title: str,
    folder: Path,
    unread: Mapping[str, str] | None = None,
) -> list[Path]:
    """Write the sheet of prepared runs: one self-contained page, and a PNG a run.

    Parameters
    ----------
    runs : mapping of str to Dataset
        Prepared runs by name.
    settings : CampaignSettings
        The campaign.
    title : str
        Name of the campaign.
    folder : Path
        Where to; it exists.
    unread : mapping of str to str, optional
        Runs that could not be prepared, and why.

    Returns
    -------
    list of Path
        ``quality.html`` and ``quality_RUN.png``.

    Raises
    ------
    RequestError
        If matplotlib is not installed, or a file cannot be written.
    """
    parts, written = [], []
    for name, run in runs.items():
        pairs = compared(run, redundant_pairs(settings, run.attrs.get("encounter_period")))
        agreements = {channel: each for (channel, _), each in pairs.items()}
        picture = _png(quality_figure(run, agreements))
        path = folder / f"quality_{name}.png"
        with replacing(path) as temporary:
            temporary.write_bytes(picture)
        written.append(path)
        parts.append(_section(name, run, picture))
    page = folder / "quality.html"
    with replacing(page) as temporary:
        temporary.write_text(_page(title, runs, parts, unread or {}), encoding="utf-8")
    return [page, *written]


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    with figure_style():
        figure.savefig(buffer, format="png", dpi=100, pil_kwargs={"optimize": True})
    return buffer.getvalue()


def _page(
    title: str,
    runs: Mapping[str, xr.Dataset],
    parts: Sequence[str],
    unread: Mapping[str, str],
) -> str:
    lines = []
    for name, run in runs.items():
        found = findings_of(run)
        words = ", ".join(dict.fromkeys(f"{each.channel} ({each.kind.word})" for each in found))
        mark = "bad" if found else "ok"
        lines.append(
            f'<tr class="{mark}"><td><a href="#{html.escape(name)}">{html.escape(name)}</a></td>'
            f'<td class="n">{float(run["time"][0]):.2f} to {float(run["time"][-1]):.2f} s</td>'
            f'<td class="n">{len(found)}</td><td>{html.escape(words) or "nothing found"}</td></tr>'
        )
    lines += [
        f'<tr class="bad"><td>{html.escape(name)}</td><td>not prepared</td><td class="n">–</td>'
        f"<td>{html.escape(why)}</td></tr>"
        for name, why in unread.items()
    ]
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        f"<title>Data quality: {html.escape(title)}</title><style>{_STYLE}</style></head><body>"
        f"<h1>Data quality: {html.escape(title)}</h1>"
        "<p>Checks flag and tell; nothing is repaired unless the campaign asks for it, and what "
        "was repaired is listed. A lag is positive where a sensor is late against the trusted one "
        "of its group; inside the green band it does no harm. Findings count over the whole "
        "record that was read; the shares flagged, the statistics and the pictures show "
        "the span used.</p>"
        '<div class="scroll"><table class="short"><tr><th>run</th><th class="n">span used</th>'
        '<th class="n">findings</th>'
        f"<th>channels</th></tr>{''.join(lines)}</table></div>{''.join(parts)}</body></html>"
    )


def _section(name: str, run: xr.Dataset, picture: bytes) -> str:
    rows = channel_rows(run)
    known = {row["channel"] for row in rows}
    others = [each for each in findings_of(run) if each.channel not in known]
    clocks = [
        f"<li>clock of {html.escape(key.removeprefix('clock_'))}: {html.escape(value)}</li>"
        for key, value in run.attrs.items()
        if key.startswith("clock_") and isinstance(value, str)
    ]
    items = "".join(clocks + [_item(each) for each in others])
    body = "".join(_row(row) for row in rows)
    encoded = base64.b64encode(picture).decode("ascii")
    return (
        f'<h2 id="{html.escape(name)}">{html.escape(name)}</h2><p>{html.escape(steps_of(run))}</p>'
        + (f"<ul>{items}</ul>" if items else "")
        + '<div class="scroll"><table><tr><th>channel</th><th>unit</th><th class="n">min</th>'
        '<th class="n">max</th><th class="n">mean</th><th class="n">SD</th>'
        "<th>flagged in the span</th>"
        "<th>found in the record, and done about it</th></tr>"
        f'{body}</table></div><img alt="channels of {html.escape(name)}" '
        f'src="data:image/png;base64,{encoded}">'
    )


def steps_of(run: xr.Dataset) -> str:
    """Step, rate and, where it is known, encounter period of a prepared run, in words."""
    dt, period = float(run.attrs["dt"]), run.attrs.get("encounter_period")
    words = f"time step {dt:.4g} s ({1 / dt:.4g} Hz)"
    if period is None:
        return f"{words}, encounter period not needed"
    return f"{words}, encounter period T {period:.4g} s ({period / dt:.3g} steps)"


def _item(finding: Finding) -> str:
    return f"<li>{html.escape(finding.channel)}: {html.escape(finding.text)}</li>"


def _row(row: Mapping[str, Any]) -> str:
    numbers = "".join(f'<td class="n">{value:.4g}</td>' for value in row["numbers"])
    words = [html.escape(each.text) for each in row["findings"]]
    if row["repaired"]:
        words.append(f"repaired: {html.escape(row['repaired'])}")
    mark = ' class="bad"' if row["findings"] else ""
    return (
        f"<tr{mark}><td>{html.escape(row['channel'])}</td><td>{html.escape(shown_unit(row['units']))}</td>"
        f"{numbers}<td>{html.escape(row['flagged'])}</td><td>{'<br>'.join(words)}</td></tr>"
    )
