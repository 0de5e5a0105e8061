"""Tables for the terminal and for files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from rich import box
from rich.table import Table

from seakeep.files import replacing

__all__ = ["rich_comparison", "write_csv"]

_HEADINGS = {
    "nrmse": ("NRMSE", "{:.3f}"),
    "fit": ("fit %", "{:.1f}"),
    "nammae": ("NAMMAE", "{:.3f}"),
    "sd_ratio": ("SD ratio", "{:.3f}"),
    "measured_min": ("min meas.", "{:.4g}"),
    "predicted_min": ("min pred.", "{:.4g}"),
    "measured_max": ("max meas.", "{:.4g}"),
    "predicted_max": ("max pred.", "{:.4g}"),
}


def rich_comparison(table: xr.Dataset) -> Table:
    """Comparison of forecasts with measurements as a table for the terminal.

    Parameters
    ----------
    table : Dataset
        From :func:`seakeep.study.comparison_table`.

    Returns
    -------
    rich.table.Table
        A row a run and channel, and the averages below each run.
    """
    out = Table(box=box.SIMPLE_HEAD, title="Forecast against measurement", title_justify="left")
    out.add_column("run", no_wrap=True)
    out.add_column("channel", no_wrap=True)
    out.add_column("unit", no_wrap=True)
    for heading, _ in _HEADINGS.values():
        out.add_column(heading, justify="right", no_wrap=True)
    for run in table["run"].values:
        rows = table.sel(run=run)
        for channel in table["channel"].values:
            at = rows.sel(channel=channel)
            out.add_row(
                str(run),
                str(channel),
                str(at["channel_units"].values),
                *(_shown(float(at[name]), form) for name, (_, form) in _HEADINGS.items()),
            )
        slack = int(rows["slack_channels"])
        left_out = f" ({slack} still channel{'s' * (slack > 1)} left out)" if slack else ""
        status = str(rows["status"].values)
        mean = [
            _shown(float(rows["anrmse"]), "{:.3f}"),
            "",
            _shown(float(rows["mean_nammae"]), "{:.3f}"),
        ]
        out.add_row(
            str(run),
            "average" + left_out + ("" if status == "ok" else f" ({status})"),
            "",
            *mean,
            style="bold",
        )
        for note in _notes(rows):
            out.add_row(str(run), note, style="italic")
        out.add_section()
    return out


def _notes(rows: xr.Dataset) -> list[str]:
    notes = []
    condition = str(rows["conditional_on"].values)
    if condition:
        notes.append(f"conditional on measured {condition}")
    offset, spread = float(rows["probe_offset"]), float(rows["probe_offset_spread"])
    if np.isfinite(offset):
        known = f" ± {spread:.2g}" if np.isfinite(spread) else ""
        notes.append(f"probe offset {offset:.3g}{known} m")
    return notes


def _shown(value: float, form: str) -> str:
    return form.format(value) if np.isfinite(value) else "–"


def write_csv(table: xr.Dataset, path: Path) -> Path:
    """Write a comparison table as CSV, a row a run and channel, full precision.

    Parameters
    ----------
    table : Dataset
        From :func:`seakeep.study.comparison_table`.
    path : Path
        The file.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If the file cannot be written.
    """
    frame = table[list(_HEADINGS)].to_dataframe().reset_index()
    added = ("start", "status", "anrmse", "conditional_on", "probe_offset", "probe_offset_spread")
    for name in added:
        frame[name] = frame["run"].map(table[name].to_series())
    front = ["run", "channel", "channel_units"]
    frame = frame[front + [name for name in frame.columns if name not in front]]
    with replacing(path) as temporary:
        frame.to_csv(temporary, index=False)
    return path
