"""Data of the study: waves, channels and signs, quality of the runs, clocks."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from seakeep.report.figures.runs import quality_figure, spectrum_figure
from seakeep.report.page import Section, drawing, section
from seakeep.report.quality_sheet import channel_rows, clock_rows, other_findings, run_row
from seakeep.report.style import shown_unit
from seakeep.report.tables import Number, Table, number, percent, short, table
from seakeep.study import StudyResult
from seakeep.waves import phase_speed


def waves(result: StudyResult) -> Section | None:
    """Return the waves that were tested, where they were measured, and their spectra."""
    tables, figures = wave_tables(result), []
    if "spectra" in result.groups:
        regular = bool(np.isfinite(result.groups["runs"]["wave_frequency"].values).any())
        words = " Vertical lines: the regular waves." * regular
        figures.append(drawing("spectrum", partial(spectrum_figure, result), {"regular": words}))
    return section("waves", figures=figures, tables=tables) if tables else None


def wave_tables(result: StudyResult) -> list[Table]:
    """Waves of each run as they were measured, and where, as far as known."""
    tables, run = [], next(iter(result.prepared.values()))
    if "spectra" in result.groups:
        tables.append(_wave_table(result))
    used = {str(name) for name in result.groups["channels"]["name"].values}
    rows = [
        (
            str(name),
            str(channel.attrs.get("long_name", name)),
            number(channel.attrs["x_position"], 2),
            "yes" if name in used else "",
        )
        for name, channel in run.data_vars.items()
        if "x_position" in channel.attrs
    ]
    if rows:
        frame = str(result.groups["channels"].attrs.get("frame", ""))
        tables.append(table("positions", rows, {"frame": frame}))
    return tables


def _wave_table(result: StudyResult) -> Table:
    spectra, rows = result.groups["spectra"], []
    for name in result.prepared:
        at = result.groups["runs"].sel(run=name)
        frequency, depth = float(at["wave_frequency"]), float(at["water_depth"])
        known = bool(np.isfinite(frequency + depth))
        speed = float(phase_speed(2 * np.pi * frequency, depth)) if known else np.nan
        # A sine has a height of 2√2 standard deviations, a sea one of 4.
        factor = np.sqrt(0.5) if np.isfinite(frequency) else 1.0
        spans = ", ".join(
            f"{use} {float(at[f'{use}_begin']):.0f} to {float(at[f'{use}_end']):.0f} s"
            for use in ("train", "test")
            if np.isfinite(at[f"{use}_begin"])
        )
        rows.append(
            (
                name,
                str(at["sea_state"].values) or str(at["waves"].values),
                number(factor * float(spectra["significant_height"].sel(run=name))),
                number(frequency),
                number(speed / frequency, 2),
                number(speed, 2),
                spans or "test",
            )
        )
    return table("waves", rows, spectra.attrs)


def data(result: StudyResult) -> Section:
    """Return channels, and what preparation found in each run."""
    figures = [
        replace(
            drawing("quality", partial(quality_figure, run, {}), {"run": name}, f"quality_{name}"),
            raster=True,
        )
        for name, run in result.prepared.items()
    ]
    tables = [_sign_table(result), _run_table(result)]
    clocks = [(n, *row) for n, run in result.prepared.items() for row in clock_rows(run)]
    if clocks:
        tables.append(table("clocks", clocks))
    tables += [_quality_table(result, name) for name in result.prepared]
    return section("data", figures=figures, tables=tables)


def _sign_table(result: StudyResult) -> Table:
    channels, rows = result.groups["channels"], []
    for name in map(str, channels["name"].values):
        at = channels.sel(name=name)
        use, unit, *others = (str(at[k].values) for k in ("use", "units", "positive", "source"))
        rows.append((result.words_of(name), use, shown_unit(unit), *others))
    frame = channels.attrs.get("frame", "")
    return table("signs", rows, {"frame": frame and f"Frame: {frame}."})


def _run_table(result: StudyResult) -> Table:
    rows = []
    for name, run in result.prepared.items():
        _, span, count, kinds = run_row(name, run)
        sea = str(result.groups["runs"]["sea_state"].sel(run=name).values)
        others = "; ".join(other_findings(run))
        rows.append((name, sea, str(span), count, kinds.replace("_", " ") or "none", others))
    return table("quality_of_runs", rows, name="runs")


def _quality_table(result: StudyResult, name: str) -> Table:
    """Data quality of all channels of a run, those that the study does not use too."""
    runs, rows, channels = result.groups["runs"], [], channel_rows(result.prepared[name])
    for each in channels:
        use, frozen, slack = "", Number(), Number()
        if each.channel in runs["name"].values:
            at = runs.sel(run=name, name=each.channel)
            use, frozen = "yes", percent(at["constant"], 2)
            slack = percent(at["slack"], 1) if np.isfinite(at["slack"]) else slack
        low, high, *others = map(short, each.numbers)
        row = (each.words, use, each.unit, *others, low, high, frozen, slack, each.flagged)
        rows.append((*row, "; ".join(each.found)))
    marked = [k for k, each in enumerate(channels) if each.found]
    return table("quality", rows, {"run": name}, name=f"quality_{name}", marked=marked)
