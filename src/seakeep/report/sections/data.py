"""Data of the study: waves, channels and signs, quality of the runs, clocks."""

from __future__ import annotations

from functools import partial

import numpy as np

from seakeep.quality import findings_of
from seakeep.report.figures.spectra import spectrum_figure
from seakeep.report.quality_sheet import channel_rows, clock_rows, quality_figure
from seakeep.report.section import Drawing, Section
from seakeep.report.style import shown_unit
from seakeep.report.tables import Table, number
from seakeep.study import StudyResult
from seakeep.waves import phase_speed

__all__ = ["data", "position_table", "wave_table", "waves"]


def waves(result: StudyResult) -> Section | None:
    """Return the waves that were tested, where they were measured, and their spectra."""
    tables = [wave_table(result)] if "spectra" in result.groups else []
    tables += [positions] if (positions := position_table(result)) is not None else []
    figures = []
    if "spectra" in result.groups:
        regular = bool(np.isfinite(result.groups["runs"]["wave_frequency"].values).any())
        figures.append(
            Drawing(
                "spectrum",
                "Power spectral density of the wave elevation: nominal where it is known, and "
                "measured (mean over the irregular runs, or over all where none is) with the "
                "paper's Welch segments and with long ones."
                + (" Vertical lines: the regular waves." if regular else ""),
                partial(spectrum_figure, result),
            )
        )
    if not (tables or figures):
        return None
    return Section("waves", "Waves", figures=tuple(figures), tables=tuple(tables))


def wave_table(result: StudyResult) -> Table:
    """Waves of each run as they were measured, and what they are used for."""
    runs, heights = result.groups["runs"], result.groups["spectra"]["significant_height"]
    rows = []
    for name in result.prepared:
        at = runs.sel(run=name)
        frequency, depth = float(at["wave_frequency"]), float(at["water_depth"])
        speed = np.nan
        if np.isfinite(frequency + depth):
            speed = float(phase_speed(2 * np.pi * frequency, depth))
        height = float(heights.sel(run=name))
        # A sine has a height of 2√2 standard deviations, a sea one of 4.
        height *= np.sqrt(0.5) if np.isfinite(frequency) else 1.0
        spans = [
            f"{use} {float(at[f'{use}_begin']):.0f} to {float(at[f'{use}_end']):.0f} s"
            for use in ("train", "test")
            if np.isfinite(at[f"{use}_begin"])
        ]
        rows.append(
            (
                name,
                str(at["sea_state"].values) or str(at["waves"].values),
                number(height),
                number(frequency),
                number(speed / frequency, 2),
                number(speed, 2),
                ", ".join(spans) or "test",
            )
        )
    return Table(
        "waves",
        "Waves tested, as measured",
        ("run", "sea", "height [m]", "frequency [Hz]", "length [m]", "phase speed [m/s]", "used"),
        rows,
        f"From {result.groups['spectra'].attrs['channel']}. Height: of regular waves 2√2, of a sea "
        "4 standard deviations of the elevation. Length and speed: linear theory at the depth of "
        "the campaign.",
        (2, 3, 4, 5),
    )


def position_table(result: StudyResult) -> Table | None:
    """Where the waves were measured; None where no position is known."""
    run = next(iter(result.prepared.values()))
    used = {str(name) for name in result.groups["channels"]["name"].values}
    rows = [
        (
            str(name),
            str(channel.attrs.get("long_name", name)),
            f"{float(channel.attrs['x_position']):.2f}",
            "yes" if name in used else "",
        )
        for name, channel in run.data_vars.items()
        if "x_position" in channel.attrs
    ]
    if not rows:
        return None
    return Table(
        "positions",
        "Positions of the wave probes",
        ("channel", "words", "x [m]", "used"),
        rows,
        str(result.groups["channels"].attrs.get("frame", "")),
        (2,),
    )


def data(result: StudyResult) -> Section:
    """Return channels, and what preparation found in each run."""
    figures = tuple(
        Drawing(
            f"quality_{name}",
            f"All channels of {name} after preparation, flagged samples marked; "
            "tinted: a channel in which something was found.",
            partial(quality_figure, run, {}),
            raster=True,
        )
        for name, run in result.prepared.items()
    )
    tables = [_sign_table(result), _run_table(result)]
    tables += [clocks] if (clocks := _clock_table(result)) is not None else []
    tables += [_quality_table(result, name) for name in result.prepared]
    return Section("data", "Data", figures=figures, tables=tuple(tables))


def _sign_table(result: StudyResult) -> Table:
    channels = result.groups["channels"]
    rows = []
    for name in map(str, channels["name"].values):
        use, unit, positive, source = (
            str(channels[key].sel(name=name).values)
            for key in ("use", "units", "positive", "source")
        )
        rows.append((result.words_of(name), use, shown_unit(unit), positive, source))
    frame = str(channels.attrs.get("frame", ""))
    return Table(
        "signs",
        "Channels and signs",
        ("channel", "use", "unit", "positive", "source"),
        rows,
        f"Frame: {frame}." if frame else "",
    )


def _run_table(result: StudyResult) -> Table:
    runs, rows = result.groups["runs"], []
    for name, run in result.prepared.items():
        found = findings_of(run)
        others = [
            f"{each.channel}: {each.text}" for each in found if each.channel not in run.data_vars
        ]
        words = dict.fromkeys(
            f"{each.channel.replace('_', ' ')} ({each.kind.word})" for each in found
        )
        rows.append(
            (
                name,
                str(runs["sea_state"].sel(run=name).values),
                f"{float(run['time'][0]):.2f} to {float(run['time'][-1]):.2f} s",
                str(len(found)),
                ", ".join(words) or "none",
                "; ".join(others),
            )
        )
    return Table(
        "runs",
        "Data quality of the runs, as preparation found it",
        ("run", "sea state", "part used", "findings", "channel (kind)", "findings of loggers"),
        rows,
        "Checks flag and report; nothing is repaired unless the campaign asks for it, and what was "
        "repaired is in the tables below. A finding concerns the whole record, the part that is "
        "cut off too.",
        (3,),
    )


def _clock_table(result: StudyResult) -> Table | None:
    rows = [(n, *row) for n, run in result.prepared.items() for row in clock_rows(run)]
    if not rows:
        return None
    return Table(
        "clocks",
        "Clocks of the loggers against the reference",
        ("run", "logger", "offset", "drift", "from"),
        rows,
        "Offset: what the logger's clock reads when the reference reads zero. n: pulses, windows "
        "or samples that it rests on. ±: one standard error.",
        folded=True,
    )


def _quality_table(result: StudyResult, name: str) -> Table:
    """Data quality of all channels of a run, those that the study does not use too."""
    runs, used = result.groups["runs"], set(result.groups["runs"]["name"].values)
    rows = []
    for each in channel_rows(result.prepared[name]):
        frozen = slack = ""
        if each.channel in used:
            at = runs.sel(run=name, name=each.channel)
            frozen = f"{100 * float(at['constant']):.2f}"
            part = float(at["slack"])
            slack = f"{100 * part:.1f}" if np.isfinite(part) else ""
        low, high, mean, spread = (f"{value:.4g}" for value in each.numbers)
        row = (each.words, "yes" if each.channel in used else "", each.unit, mean, spread)
        rows.append((*row, low, high, frozen, slack, each.flagged, "; ".join(each.found)))
    return Table(
        f"quality_{name}",
        f"Data quality of {name}, channel by channel (SI units)",
        ("channel", "used", "unit", "mean", "SD", "min", "max", "frozen %", "slack %", "flagged",
         "found, and done about it"),
        rows,
        "After preparation; no value that the study uses is missing, or it would have refused the "
        "run. Frozen: samples equal to both neighbours. Slack: a load within the SD of its noise. "
        "Flagged: fraction of the samples.",
        (3, 4, 5, 6, 7, 8),
        folded=True,
    )  # fmt: skip
