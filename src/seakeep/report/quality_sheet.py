"""The data-quality sheet: one page with a table per run and a picture of its channels."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from seakeep.arrays import Datasets
from seakeep.campaign.pipeline import redundant_pairs
from seakeep.campaign.settings import CampaignSettings
from seakeep.files import MARK, replacing, write_text
from seakeep.quality import compared, findings_of
from seakeep.quality.faults import FLAGS
from seakeep.report.figures.histories import quality_figure
from seakeep.report.page import Drawing, Section, drawing, inline_picture, rendered, section
from seakeep.report.style import Figure, figure_style, prefixed, shown_unit
from seakeep.report.tables import MISSING, Number, number, short, table
from seakeep.signals.time_axis import ASSUMED, Clock

SHEET = "data-quality sheet"
"""Kind of the files of a sheet, which sets them apart from the user's."""


def channel_rows(run: xr.Dataset) -> Iterator[tuple[str, ...]]:
    """Data quality of each channel of a prepared run; angles and their rates in degrees.

    Statistics (min, max, mean, SD), parts that are flagged, and what was found and done.
    """
    findings = findings_of(run)
    for name, channel in run.data_vars.items():
        factor, unit = prefixed(channel.attrs.get("units", ""), channel.values)
        numbers = pd.Series(factor * channel.values).agg(["min", "max", "mean", "std"])
        flags = run.coords.get(f"{name}_flags", xr.zeros_like(channel)).values.astype(int)
        flagged = ", ".join(
            f"{word} {100 * np.mean((flags & bit) > 0):.2g} %"
            for word, bit in FLAGS.items()
            if (flags & bit).any()
        )
        texts = [each.text for each in findings if each.channel == name]
        if channel.attrs.get("repaired"):
            texts.append(f"repaired: {channel.attrs['repaired']}")
        yield str(name), shown_unit(unit), *map(short, numbers), flagged, "; ".join(texts)


def clock_rows(run: xr.Dataset) -> Iterator[tuple[str, ...]]:
    """Logger, offset, drift and how they were found, of each clock but the reference."""
    for key, method in run.attrs.items():
        if not (clock := re.fullmatch("clock_(.+)_method", key)):
            continue
        logger, texts = clock[1], []
        if method in (Clock.method, ASSUMED):
            yield logger, "", "", method
            continue
        for what, error, factor, digits, unit in (
            ("offset", "offset_error", 1e3, 2, "ms"),
            ("drift_ppm", "drift_error_ppm", 1.0, 1, "ppm"),
        ):
            value, spread = (factor * run.attrs[f"clock_{logger}_{k}"] for k in (what, error))
            known = f" ± {spread:.{digits}f}" if np.isfinite(spread) else ""
            texts.append(f"{value:+z.{digits}f}{known} {unit}")
        yield logger, *texts, f"{method}, n = {run.attrs[f'clock_{logger}_count']}"


def write_quality_sheet(
    runs: Datasets, settings: CampaignSettings, title: str, folder: Path, unread: Mapping[str, str]
) -> None:
    """Write the sheet of prepared runs: one self-contained page, and a PNG per run.

    Pictures that are newer than ``RUN.nc`` beside them are taken as they are.
    """
    rows = [(*row, kinds or "nothing found") for *row, kinds in map(run_row, runs, runs.values())]
    rows += [(n, Number("not prepared"), MISSING, why) for n, why in unread.items()]
    marked = [k for k, row in enumerate(rows) if row[2] != "0"]
    sections, drawn = [section("runs", table("runs", rows, marked=marked))], {}
    for name, run in runs.items():
        figure = drawing("quality", _picture, run, settings, name=f"quality_{name}", run=name)
        path = folder / f"{figure.name}.png"
        if not is_newer(path, folder / f"{name}.nc"):
            mark, small = {"Software": f"{MARK}: {SHEET}"}, {"optimize": True}
            with figure_style(), replacing(path) as temporary:  # all colours: marks are small
                picture = figure.draw()
                picture.savefig(temporary, format="png", dpi=100, metadata=mark, pil_kwargs=small)
        drawn[figure.name] = inline_picture(path.read_bytes(), f"channels of {name}")
        sections.append(_section(name, run, figure))
    content = {"stamp": {}, "sections": sections, "drawn": drawn, "files": False}
    text = rendered(kind=SHEET, title=f"Data quality: {title}", **content)
    write_text(folder / "quality.html", text)


def _picture(run: xr.Dataset, settings: CampaignSettings) -> Figure:
    """Draw the channels of a run, and how its redundant sensors agree."""
    pairs = compared(run, redundant_pairs(settings, run.attrs.get("encounter_period", np.nan)))
    return quality_figure(run, {channel: each for (channel, _), each in pairs.items()})


def run_row(name: str, run: xr.Dataset) -> tuple[str, Number, Number, str]:
    """Run, span, number of findings, and the channels that they concern."""
    span = f"{float(run['time'][0]):.2f} to {float(run['time'][-1]):.2f} s"
    findings = findings_of(run)
    kinds = dict.fromkeys(f"{each.channel} ({each.kind.word})" for each in findings)
    return name, Number(span), number(len(findings), 0), ", ".join(kinds)


def other_findings(run: xr.Dataset) -> list[str]:
    """Findings of loggers, which are no channels."""
    return [f"{e.channel}: {e.text}" for e in findings_of(run) if e.channel not in run.data_vars]


def _section(name: str, run: xr.Dataset, figure: Drawing) -> Section:
    """Clocks, findings, channels and picture of a run."""
    clocks = [f"clock of {key}: {run.attrs[f'clock_{key}']}" for key, *_ in clock_rows(run)]
    rows = list(channel_rows(run))
    marked = [k for k, each in enumerate(rows) if each[-1]]
    shown = table("channels_of_run", rows, name=f"channels_{name}", marked=marked, run=name)
    points = [*clocks, *other_findings(run)]
    return Section(name, name, (steps_of(run),), points, figures=(figure,), tables=(shown,))


def is_newer(path: Path, source: Path) -> bool:
    """Whether a file was written after the one that it is made from."""
    both = path.exists() and source.exists()
    return both and path.stat().st_mtime_ns >= source.stat().st_mtime_ns


def steps_of(run: xr.Dataset) -> str:
    """Step, rate and, where it is known, encounter period of a prepared run, in words."""
    dt, period = run.attrs["dt"], run.attrs.get("encounter_period")
    words = f"time step {dt:.4g} s ({1 / dt:.4g} Hz)"
    if period is None:
        return f"{words}, encounter period not needed"
    return f"{words}, encounter period T {period:.4g} s ({period / dt:.3g} steps)"
