"""Forecast over measurement: the figure everybody asks for first."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.errors import DataError
from seakeep.report.style import COLOURS, LINES, axis_label, figure_style, new_figure
from seakeep.signals import encounter_period
from seakeep.study import Comparison, comparison_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["overlay_figure"]

LONG = 60
"""A record of more periods than this gets a second column with a part of it enlarged."""
ENLARGED = 20


def overlay_figure(comparison: Comparison) -> Figure:
    """Time histories of every state, forecast over measurement, with the inputs below.

    Parameters
    ----------
    comparison : Comparison
        From :func:`seakeep.study.compare`.

    Returns
    -------
    matplotlib.figure.Figure
        One row a channel; for long records a second column shows the last 20 periods.
    """
    with figure_style():
        return _draw(comparison)


def _draw(comparison: Comparison) -> Figure:
    states = [str(name) for name in comparison.measured.data_vars]
    inputs = [str(name) for name in comparison.inputs.data_vars]
    rows = len(states) + bool(inputs)
    zoom = _enlarged_span(comparison.measured[states[0]])
    columns = 1 if zoom is None else 2
    figure = new_figure(7.5 if columns == 1 else 11.0, 1.0 + 1.35 * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row")
    table = comparison_table([comparison]).isel(run=0)
    for row, name in enumerate(states):
        for column in range(columns):
            _draw_state(axes[row, column], comparison, name, thin=columns > column + 1)
        nrmse = float(table["nrmse"].sel(channel=name))
        units = str(comparison.measured[name].attrs.get("units", ""))
        axes[row, 0].set_ylabel(axis_label(name, units))
        judged = f"NRMSE {nrmse:.3f}" if np.isfinite(nrmse) else "not judged"
        axes[row, 0].set_title(judged, loc="right", fontsize=8, pad=2)
    if inputs:
        for column in range(columns):
            _draw_inputs(axes[-1, column], comparison.inputs, inputs, thin=columns > column + 1)
        units = str(comparison.inputs[inputs[0]].attrs.get("units", ""))
        axes[-1, 0].set_ylabel(f"input\n[{units}]")
        axes[-1, -1].legend(
            loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=min(len(inputs), 4), fontsize=7
        )
    for column in range(columns):
        axes[-1, column].set_xlabel("time [s]")
    if zoom is not None:
        axes[0, 0].set_title("whole forecast", loc="left")
        axes[0, 1].set_xlim(*zoom)
        axes[0, 1].set_title(f"last {ENLARGED} periods", loc="left")
    handles, labels = axes[0, -1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=len(handles))
    figure.suptitle(_title(comparison), x=0.01, ha="left")
    return figure


def _title(comparison: Comparison) -> str:
    parts = [comparison.run, comparison.sea_state, f"ANRMSE {comparison.anrmse:.3f}"]
    if comparison.status != "ok":
        parts.append(comparison.status)
    return " · ".join(part for part in parts if part)


def _enlarged_span(series: xr.DataArray) -> tuple[float, float] | None:
    time = series["time"].values
    dt = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    try:
        period = encounter_period(series.values, dt)
    except DataError:
        return None
    if (time[-1] - time[0]) / period < LONG:
        return None
    return float(time[-1] - ENLARGED * period), float(time[-1])


def _draw_state(axes: Any, comparison: Comparison, name: str, thin: bool) -> None:
    measured, forecast = comparison.measured[name], comparison.forecast[name]
    width = 0.5 if thin else 1.0
    for series, key in ((measured, "measured"), (forecast, "forecast")):
        style = {**LINES[key], "linewidth": width * LINES[key]["linewidth"]}
        axes.plot(series["time"], series, label=key, **style)
    axes.margins(x=0.01)


def _draw_inputs(axes: Any, inputs: xr.Dataset, names: list[str], thin: bool) -> None:
    shades = ("#56606B", "#56B4E9", "#CC79A7", "#E69F00")
    dashes = ("-", (0, (3, 1)), "-.", ":")
    for number, name in enumerate(names):
        style = {**LINES["input"], "color": shades[number % 4], "linestyle": dashes[number % 4]}
        style["linewidth"] *= 0.6 if thin else 1.0
        axes.plot(inputs["time"], inputs[name], label=name, **style)
    axes.axhline(0.0, color=COLOURS["input"], linewidth=0.4)
