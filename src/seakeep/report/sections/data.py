"""Data of the study: waves, channels and signs, quality of the runs, clocks."""

from __future__ import annotations

from functools import partial

import numpy as np

from seakeep.report.figures.runs import quality_figure, spectrum_figure
from seakeep.report.page import Drawing, Section
from seakeep.report.quality_sheet import channel_rows, clock_rows, other_findings, run_row
from seakeep.report.style import shown_unit
from seakeep.report.tables import Number, Table, number, percent, short
from seakeep.study import StudyResult
from seakeep.waves import phase_speed


def waves(result: StudyResult) -> Section | None:
    """Return the waves that were tested, where they were measured, and their spectra."""
    tables, figures = wave_tables(result), []
    if "spectra" in result.groups:
        regular = bool(np.isfinite(result.groups["runs"]["wave_frequency"].values).any())
        caption = (
            "Power spectral density of the wave elevation: nominal where it is known, and "
            "measured (mean over the irregular runs, or over all where none is) with the "
            "paper's Welch segments and with long ones."
        ) + " Vertical lines: the regular waves." * regular
        figures.append(Drawing("spectrum", caption, partial(spectrum_figure, result)))
    return Section("waves", "Waves", figures=figures, tables=tables) if tables else None


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
        heads = ("channel", "words", "x [m]", "used")
        tables.append(Table("positions", "Positions of the wave probes", heads, rows, frame))
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
    return Table(
        "waves",
        "Waves tested, as measured",
        ("run", "sea", "height [m]", "frequency [Hz]", "length [m]", "phase speed [m/s]", "used"),
        rows,
        f"From {spectra.attrs['channel']}. Height: of regular waves 2√2, of a sea "
        "4 standard deviations of the elevation. Length and speed: linear theory at the depth of "
        "the campaign.",
    )


def data(result: StudyResult) -> Section:
    """Return channels, and what preparation found in each run."""
    figures = [
        Drawing(
            f"quality_{name}",
            f"All channels of {name} after preparation, flagged samples marked; "
            "tinted: a channel in which something was found.",
            partial(quality_figure, run, {}),
            raster=True,
        )
        for name, run in result.prepared.items()
    ]
    tables = [_sign_table(result), _run_table(result)]
    clocks = [(n, *row) for n, run in result.prepared.items() for row in clock_rows(run)]
    if clocks:
        tables.append(
            Table(
                "clocks",
                "Clocks of the loggers against the reference",
                ("run", "logger", "offset", "drift", "from"),
                clocks,
                "Offset: what the logger's clock reads when the reference reads zero. n: pulses, "
                "windows or samples that it rests on. ±: one standard error.",
                folded=True,
            )
        )
    tables += [_quality_table(result, name) for name in result.prepared]
    return Section("data", "Data", figures=figures, tables=tables)


def _sign_table(result: StudyResult) -> Table:
    channels, rows = result.groups["channels"], []
    for name in map(str, channels["name"].values):
        at = channels.sel(name=name)
        use, unit, *others = (str(at[k].values) for k in ("use", "units", "positive", "source"))
        rows.append((result.words_of(name), use, shown_unit(unit), *others))
    frame, heads = channels.attrs.get("frame", ""), ("channel", "use", "unit", "positive", "source")
    return Table("signs", "Channels and signs", heads, rows, f"Frame: {frame}." if frame else "")


def _run_table(result: StudyResult) -> Table:
    rows = []
    for name, run in result.prepared.items():
        _, span, count, kinds = run_row(name, run)
        sea = str(result.groups["runs"]["sea_state"].sel(run=name).values)
        others = "; ".join(other_findings(run))
        rows.append((name, sea, str(span), count, kinds.replace("_", " ") or "none", others))
    return Table(
        "runs",
        "Data quality of the runs, as preparation found it",
        ("run", "sea state", "part used", "findings", "channel (kind)", "findings of loggers"),
        rows,
        "Checks flag and report; nothing is repaired unless the campaign asks for it, and what was "
        "repaired is in the tables below. A finding concerns the whole record, the part that is "
        "cut off too.",
    )


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
    return Table(
        f"quality_{name}",
        f"Data quality of {name}, channel by channel (SI units)",
        ("channel", "used", "unit", "mean", "SD", "min", "max", "frozen %", "slack %", "flagged",
         "found, and done about it"),
        rows,
        "After preparation; no value that the study uses is missing, or it would have refused the "
        "run. Frozen: samples equal to both neighbours. Slack: a load within the SD of its noise. "
        "Flagged: fraction of the samples.",
        folded=True,
        marked=[k for k, each in enumerate(channels) if each.found],
    )  # fmt: skip
