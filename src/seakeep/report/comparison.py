"""Tables for the terminal and for files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr
from rich import box
from rich.table import Table

from seakeep.files import MARK, replacing, write_netcdf

__all__ = [
    "band_findings",
    "forecast_header",
    "forecast_words",
    "rich_bands",
    "rich_comparison",
    "write_csv",
    "write_forecast",
]

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
_BAND_HEADINGS = {
    "coverage": ("in band %", "{:.1f}"),
    "band_width": ("mean width", "{:.4g}"),
    "relative_band_width": ("width in SD", "{:.3f}"),
}
_OF_RUNS = ("start", "status", "anrmse", "conditional_on", "probe_offset", "probe_offset_spread")
_OF_BANDS = ("band", "level", "members", "diverged")
_OF_SCALE = ("scale", "scale_factor")


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
    title = "Forecast against measurement"
    if "scale" in table:
        title += f", full scale (1:{float(table['scale_factor'][0]):g})"
    out = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
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


def rich_bands(table: xr.Dataset) -> Table:
    """Coverage and width of an ensemble's bands as a table for the terminal.

    Parameters
    ----------
    table : Dataset
        From :func:`seakeep.study.comparison_table`, of an ensemble.

    Returns
    -------
    rich.table.Table
        A row a run and channel, and the average of the channels that are judged below each run.
    """
    level = 100.0 * float(table["level"].values[0])
    title = f"{level:g} % {_kind(str(table['band'].values[0]))}band against measurement"
    out = Table(box=box.SIMPLE_HEAD, title=title, title_justify="left")
    for heading in ("run", "channel", "unit"):
        out.add_column(heading, no_wrap=True)
    for heading, _ in _BAND_HEADINGS.values():
        out.add_column(heading, justify="right", no_wrap=True)
    for run in table["run"].values:
        rows = table.sel(run=run)
        for channel in table["channel"].values:
            at = rows.sel(channel=channel)
            numbers = [_shown(float(at[name]), form) for name, (_, form) in _BAND_HEADINGS.items()]
            out.add_row(str(run), str(channel), str(at["channel_units"].values), *numbers)
        mean = _shown(float(rows["mean_coverage"]), "{:.1f}")
        out.add_row(str(run), "average", "", mean, style="bold")
        out.add_section()
    return out


def band_findings(table: xr.Dataset) -> list[str]:
    """Sentences on the bands of an ensemble, one a run; none for a single model.

    Parameters
    ----------
    table : Dataset
        From :func:`seakeep.study.comparison_table`.

    Returns
    -------
    list of str
        How much of the measurement the band holds, and of how many members it is made.
    """
    if "coverage" not in table:
        return []
    said = []
    for run in table["run"].values:
        rows = table.sel(run=run)
        level, found = 100.0 * float(rows["level"]), float(rows["mean_coverage"])
        lost, members = int(rows["diverged"]), int(rows["members"])
        left_out = f"; {lost} of {members} members diverged and are left out" if lost else ""
        if not np.isfinite(found):
            said.append(f"{run}: there is no band to judge{left_out}.")
            continue
        words = "as it claims" if abs(found - level) <= 5.0 else "not what it claims"
        if found < level - 20.0:
            words = "far too little"
        kind = str(rows["band"].values)
        said.append(
            f"{run}: the {level:g} % {_kind(kind)}band of {members - lost} members holds "
            f"{found:.0f} % of the measured instants, {words}. {_CARRIES[kind]}{left_out}."
        )
    return said


def _kind(band: str) -> str:
    """Word before a band that is not that of the members."""
    return "calibrated " if band == "calibrated" else ""


_CARRIES = {
    "members": "It carries the spread of the members, and no noise or model error",
    "calibrated": "It carries the errors of the sea and the horizon that it was calibrated on",
}


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
    columns = [name for name in (*_HEADINGS, *_BAND_HEADINGS) if name in table]
    frame = table[columns].to_dataframe().reset_index()
    for name in (*_OF_RUNS, *(each for each in (*_OF_BANDS, *_OF_SCALE) if each in table)):
        frame[name] = frame["run"].map(table[name].to_series())
    front = ["run", "channel", "channel_units"]
    frame = frame[front + [name for name in frame.columns if name not in front]]
    with replacing(path) as temporary:
        frame.to_csv(temporary, index=False)
    return path


def forecast_header(states: Sequence[str]) -> str:
    """Pattern of the first line of a CSV file that :func:`write_forecast` writes."""
    one = rf"({'|'.join(map(re.escape, states))})( (std|lower|upper|member \d+))? \[[^]]*\]"
    return rf'time \[s\](,"?{one}"?)+(,scale_factor)?\r?'


def write_forecast(forecast: xr.Dataset, path: Path) -> Path:
    """Write a forecast as NetCDF, or as CSV with a column a channel, full precision.

    Parameters
    ----------
    forecast : Dataset
        Of a model, or of an ensemble: statistics, whose columns are ``heave [m]`` (the mean),
        ``heave std [m]``, ``heave lower [m]`` and ``heave upper [m]``, or members, whose columns
        are ``heave member 0 [m]`` and so on. At full scale a last column, ``scale_factor``, says
        so.
    path : Path
        The file; its suffix, ``.nc`` or ``.csv``, decides the format.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If the file cannot be written.
    """
    with replacing(path) as temporary:
        if path.suffix == ".nc":
            write_netcdf(temporary, forecast.assign_attrs({MARK: "forecast"}))
        else:
            # Instants are multiples of a step; nine decimals hide the rounding of the product.
            time = pd.Index(forecast["time"].values.round(9), name="time [s]")
            pd.DataFrame(_columns(forecast), index=time).to_csv(temporary)
    return path


def _columns(forecast: xr.Dataset) -> dict[str, npt.NDArray[np.float64]]:
    columns = {}
    for name, variable in forecast.data_vars.items():
        if "time" not in variable.dims:
            continue
        units = variable.attrs.get("units", "")
        for dim, words in (("statistic", "{}"), ("member", "member {}")):
            if dim in variable.dims:
                for each in variable[dim].values:
                    what = "" if each == "mean" else f" {words.format(each)}"
                    columns[f"{name}{what} [{units}]"] = variable.sel({dim: each}).values
                break
        else:
            columns[f"{name} [{units}]"] = variable.values
    if forecast.attrs.get("scale") == "full":
        scale = float(forecast.attrs["scale_factor"])
        columns["scale_factor"] = np.full(forecast.sizes["time"], scale)
    return columns


def forecast_words(forecast: xr.Dataset) -> str:
    """What a forecast of an ensemble holds, for a message; empty for a single model's."""
    if "statistic" in forecast.dims:
        level = 100.0 * float(forecast.attrs["level"])
        kept = int(forecast.attrs["members"]) - int(forecast.attrs["diverged"])
        kind = _kind(str(forecast.attrs.get("band", "members")))
        return f"mean, std and {level:g} % {kind}band of {kept} members at "
    return f"{forecast.sizes['member']} members at " if "member" in forecast.dims else ""
