"""The data-quality sheet: one page with a table per run and a picture of its channels."""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.campaign.pipeline import redundant_pairs
from seakeep.campaign.settings import CampaignSettings, long_name_of
from seakeep.conventions import displayed
from seakeep.files import MARK, replacing
from seakeep.quality import compared, findings_of
from seakeep.quality.agreement import LATE, Agreement
from seakeep.quality.faults import FLAGS
from seakeep.report.html import inline_picture, rendered
from seakeep.report.style import COLOURS, PALETTE, axis_label, figure_style, new_figure, shown_unit
from seakeep.signals.synchronisation import ASSUMED, Clock
from seakeep.signals.time_axis import over_gaps

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "ChannelRow",
    "channel_rows",
    "clock_rows",
    "quality_figure",
    "steps_of",
    "write_quality_sheet",
]

SHEET = "data-quality sheet"
"""Kind of the files of a sheet, which sets them apart from the user's."""

DRAWN = 50
"""Channels that a picture shows at most, each in a row of its own; the table lists all."""

_MARKS = {
    "missing": (PALETTE["vermilion"], "x"),
    "bridged": (PALETTE["amber"], "+"),
    "outlier": (PALETTE["pink"], "o"),
    "saturated": (PALETTE["blue"], "^"),
    "stuck": (PALETTE["green"], "s"),
    "replaced": (PALETTE["sky"], "d"),
}
"""Colour and shape of each flag: shapes distinguish them in grey print."""
FOUND = PALETTE["blush"]
"""Ground of a panel in which something was found; the style sheet has the same for rows."""


@dataclass(frozen=True)
class ChannelRow:
    """Data quality of a channel: statistics (min, max, mean, SD), flagged parts, what was found."""

    channel: str
    words: str
    unit: str
    numbers: tuple[float, ...]
    flagged: str
    found: tuple[str, ...]


def channel_rows(run: xr.Dataset) -> list[ChannelRow]:
    """Data quality of each channel of a prepared run; angles and their rates in degrees."""
    findings = findings_of(run)
    rows = []
    for name in map(str, run.data_vars):
        attrs, flags = run[name].attrs, _flags(run, name)
        factor, unit = displayed(str(attrs.get("units", "")))
        x = factor * run[name].to_numpy()
        numbers = [np.nan] * 4
        if np.isfinite(x).any():
            found_in = (np.nanmin(x), np.nanmax(x), np.nanmean(x), np.nanstd(x, ddof=1))
            numbers = [float(each) for each in found_in]
        shares = [
            f"{word} {100 * np.mean((flags & bit) > 0):.2g} %"
            for word, bit in FLAGS.items()
            if (flags & bit).any()
        ]
        found = [each.text for each in findings if each.channel == name]
        if attrs.get("repaired"):
            found.append(f"repaired: {attrs['repaired']}")
        words = long_name_of(name, attrs.get("long_name"))
        flagged = ", ".join(shares)
        rows.append(
            ChannelRow(name, words, shown_unit(unit), tuple(numbers), flagged, tuple(found))
        )
    return rows


def clock_rows(run: xr.Dataset) -> list[tuple[str, str, str, str]]:
    """Logger, offset, drift and how they were found, of each clock but the reference."""
    rows = []
    for key in run.attrs:
        if not (key.startswith("clock_") and key.endswith("_method")):
            continue
        clock = key.removesuffix("_method")
        at = {k: run.attrs[f"{clock}_{k}"] for k in ("offset", "offset_error", "drift_ppm",
              "drift_error_ppm", "method", "count")}  # fmt: skip
        numbers = ("", "")
        if at["method"] not in (Clock.method, ASSUMED):
            offset = _with_error(1e3 * float(at["offset"]), 1e3 * float(at["offset_error"]), 2)
            drift = _with_error(float(at["drift_ppm"]), float(at["drift_error_ppm"]), 1)
            numbers = (f"{offset} ms", f"{drift} ppm")
        origin = f"{at['method']}, n = {int(at['count'])}" if numbers[0] else str(at["method"])
        rows.append((clock.removeprefix("clock_"), *numbers, origin))
    return rows


def _with_error(value: float, error: float, digits: int) -> str:
    known = f" ± {error:.{digits}f}" if np.isfinite(error) else ""
    return f"{value:+z.{digits}f}{known}"


def _flags(run: xr.Dataset, name: str) -> Any:
    key = f"{name}_flags"
    if key in run.coords:
        return run[key].to_numpy().astype(int)
    return np.zeros(run.sizes["time"], dtype=int)


LABELS = -0.06
"""Where labels of the vertical axes stand, in widths of the axes: beyond six figures."""


def quality_figure(run: xr.Dataset, agreements: Mapping[str, Agreement]) -> Figure:
    """Draw every channel of a run, flagged samples marked; lags of redundant sensors below."""
    names = [str(name) for name in run.data_vars][:DRAWN]
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
            _show_constant(at, x)
        for at, name in zip(axes[len(names) :], lagging, strict=True):
            each = agreements[name]
            limit = LATE * each.period
            at.axhspan(-limit, limit, color=PALETTE["green"], alpha=0.12)
            instants = each.centre + time[0]
            at.plot(*_broken(instants, each.lags), "o-", color=COLOURS["ensemble"], markersize=3)
            reach = max(1.5 * limit, 1.1 * float(np.nanmax(np.abs(each.lags), initial=0.0)))
            at.set_ylim(-reach, reach)
            at.set_ylabel(f"lag of\n{name.replace('_', ' ')} [s]", fontsize=8)
        for at in axes:
            at.margins(x=0.005)
            at.tick_params(axis="x", labelbottom=True, labelsize=7)
            at.yaxis.set_label_coords(LABELS, 0.5)  # in line: aligning them takes half of the time
        left_out = len(run.data_vars) - len(names)
        axes[-1].set_xlabel("time [s]" + f" ({left_out} more channels)" * bool(left_out))
    return figure


def _show_constant(at: Any, x: Any) -> None:
    """Say that a channel is constant, and keep its axis from showing rounding."""
    known = x[np.isfinite(x)]
    if known.size and np.ptp(known) <= 1e-9 * max(np.abs(known).max(), 1e-300):
        value = float(known[0])
        reach = 0.1 * abs(value) or 1.0
        at.set_ylim(value - reach, value + reach)
        words = {"xy": (0.5, 0.8), "xycoords": "axes fraction", "ha": "center", "fontsize": 8}
        at.annotate(f"constant: {value:.4g}", **words)


def _broken(instants: Any, lags: Any) -> tuple[Any, Any]:
    """Split a line by NaN where windows are missing, so that it does not run across them."""
    apart = np.diff(instants)
    holes = 1 + np.flatnonzero(apart > 1.5 * np.median(apart)) if apart.size else apart.astype(int)
    return np.insert(instants, holes, instants[holes - 1]), np.insert(lags, holes, np.nan)


def _mark(at: Any, time: Any, x: Any, flags: Any) -> None:
    seen = False
    filled = over_gaps(x)  # a sample that is not there stands between its neighbours
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
    """Write the sheet of prepared runs: one self-contained page, and a PNG per run.

    Pictures that are newer than ``RUN.nc`` beside them are taken as they are.
    """
    told, written = [], []
    for name, run in runs.items():
        path, source = folder / f"quality_{name}.png", folder / f"{name}.nc"
        if is_newer(path, source):
            picture = path.read_bytes()
        else:
            pairs = compared(run, redundant_pairs(settings, run.attrs.get("encounter_period")))
            agreements = {channel: each for (channel, _), each in pairs.items()}
            picture = _png(quality_figure(run, agreements))
            with replacing(path) as temporary:
                temporary.write_bytes(picture)
        written.append(path)
        told.append(_told(name, run) | {"picture": inline_picture(picture, f"channels of {name}")})
    page = folder / "quality.html"
    with replacing(page) as temporary:
        text = rendered(
            "quality.html",
            kind=SHEET,
            title=f"Data quality: {title}",
            runs=told,
            unread=unread or {},
        )
        temporary.write_text(text, encoding="utf-8")
    return [page, *written]


def _told(name: str, run: xr.Dataset) -> dict[str, Any]:
    """What the page shows for a run."""
    found, rows = findings_of(run), channel_rows(run)
    known = {row.channel for row in rows}
    clocks = [
        f"clock of {logger}: {', '.join(filter(None, (offset, drift)))}"
        f"{f' ({origin})' if offset else origin}"
        for logger, offset, drift, origin in clock_rows(run)
    ]
    others = [f"{each.channel}: {each.text}" for each in found if each.channel not in known]
    return {
        "name": name,
        "span": f"{float(run['time'][0]):.2f} to {float(run['time'][-1]):.2f} s",
        "count": len(found),
        "kinds": ", ".join(dict.fromkeys(f"{each.channel} ({each.kind.word})" for each in found)),
        "steps": steps_of(run),
        "items": [*clocks, *others],
        "rows": rows,
    }


def is_newer(path: Path, source: Path) -> bool:
    """Whether a file was written after the one that it is made from."""
    both = path.exists() and source.exists()
    return both and path.stat().st_mtime_ns >= source.stat().st_mtime_ns


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    with figure_style():
        mark = {"Software": f"{MARK}: {SHEET}"}
        figure.savefig(buffer, format="png", dpi=100, metadata=mark, pil_kwargs={"optimize": True})
    return buffer.getvalue()


def steps_of(run: xr.Dataset) -> str:
    """Step, rate and, where it is known, encounter period of a prepared run, in words."""
    dt, period = float(run.attrs["dt"]), run.attrs.get("encounter_period")
    words = f"time step {dt:.4g} s ({1 / dt:.4g} Hz)"
    if period is None:
        return f"{words}, encounter period not needed"
    return f"{words}, encounter period T {period:.4g} s ({period / dt:.3g} steps)"
