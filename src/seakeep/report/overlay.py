"""Forecast over measurement: the figure everybody asks for first."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.errors import DataError
from seakeep.report.style import (
    COLOURS,
    LINES,
    axis_label,
    figure_style,
    new_figure,
    shown_unit,
)
from seakeep.signals import encounter_period
from seakeep.study import Comparison, comparison_table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["overlay_figure"]

LONG = 60
"""A record of more periods than this is drawn as an envelope, with a part of it enlarged."""
ENLARGED = 20
MOST_STEPS = 150
"""Steps of an envelope that a panel can show; longer records take several periods a step."""

LABEL = 8
"""Points of a label: the longest line of one fits beside its panel."""

SHADES = ("#56606B", "#56B4E9", "#CC79A7", "#E69F00")
"""Of several inputs."""
BAND: dict[str, Any] = {"color": COLOURS["ensemble"], "alpha": 0.35, "linewidth": 0.6}


def overlay_figure(comparison: Comparison) -> Figure:
    """Time histories of every state, forecast over measurement, with the inputs below.

    Parameters
    ----------
    comparison : Comparison
        From :func:`seakeep.study.compare`.

    Returns
    -------
    matplotlib.figure.Figure
        One row a channel. Of a long record the first column shows the envelope, what each series
        reaches in each period, and a second one the last 20 periods. Of an ensemble the members'
        mean is drawn, and their band.
    """
    with figure_style():
        return _draw(comparison)


def _draw(comparison: Comparison) -> Figure:
    states = [str(name) for name in comparison.measured.data_vars]
    inputs = [str(name) for name in comparison.inputs.data_vars]
    units_of = {name: str(comparison.inputs[name].attrs.get("units", "")) for name in inputs}
    alike = [
        [n for n in inputs if units_of[n] == unit] for unit in dict.fromkeys(units_of.values())
    ]
    rows = len(states) + len(alike)
    period = _period_if_long(_counted(comparison))
    columns = 1 if period is None else 2
    figure = new_figure(7.5 if columns == 1 else 11.0, 1.0 + 1.45 * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row")
    table = comparison_table([comparison]).isel(run=0)
    for row, name in enumerate(states):
        if period is not None:
            _draw_envelopes(axes[row, 0], comparison, name, period)
        _draw_state(axes[row, -1], comparison, name)
        units = str(comparison.measured[name].attrs.get("units", ""))
        axes[row, 0].set_ylabel(axis_label(name, units), fontsize=LABEL)
        axes[row, 0].set_title(_judgement(table.sel(channel=name)), loc="right", fontsize=8, pad=2)
    for names, (first, last) in zip(alike, axes[len(states) :, [0, -1]], strict=True):
        if period is not None:
            _draw_input_envelopes(first, comparison.inputs, names, period)
        _draw_inputs(last, comparison.inputs, names)
        first.set_ylabel(_input_label(names, units_of[names[0]]), fontsize=LABEL)
        first.legend(
            *last.get_legend_handles_labels(),
            loc="lower left",
            bbox_to_anchor=(0.0, 0.98),
            borderaxespad=0.0,
            ncols=min(len(names), 4),
            fontsize=LABEL,
        )
    for column in range(columns):
        axes[-1, column].set_xlabel("time [s]")
    if period is not None:
        end = float(comparison.measured["time"][-1])
        axes[0, 0].set_title("whole forecast, envelopes", loc="left")
        axes[0, 1].set_xlim(end - ENLARGED * period, end)
        axes[0, 1].set_title(f"last {ENLARGED} periods", loc="left")
    # Of a band both panels tell; the dictionary keeps one of equal labels.
    keys = {
        label: handle
        for column in range(columns)
        for handle, label in zip(*axes[0, column].get_legend_handles_labels(), strict=True)
    }
    figure.legend(keys.values(), keys.keys(), loc="outside lower center", ncols=len(keys))
    figure.suptitle(_title(comparison), x=0.01, ha="left")
    return figure


def _input_label(names: list[str], units: str) -> str:
    if len(names) == 1:
        return axis_label(names[0], units)
    waves = all(name.startswith("eta") for name in names)
    return f"{'wave elevations' if waves else 'inputs'}\n[{shown_unit(units) or '?'}]"


def _judgement(rows: xr.Dataset) -> str:
    nrmse = float(rows["nrmse"])
    words = f"NRMSE {nrmse:.3f}" if np.isfinite(nrmse) else "not judged"
    if "coverage" in rows and np.isfinite(float(rows["coverage"])):
        words += f", {float(rows['coverage']):.0f} % in the band"
    return words


def _title(comparison: Comparison) -> str:
    parts = [comparison.run, comparison.sea_state, f"ANRMSE {comparison.anrmse:.3f}"]
    if comparison.status != "ok":
        parts.append(comparison.status)
    return " · ".join(part for part in parts if part)


def _counted(comparison: Comparison) -> xr.DataArray:
    """Series whose periods are counted: a wave elevation, for a state may be a slow motion."""
    waves = [name for name in comparison.inputs.data_vars if str(name).startswith("eta")]
    if waves:
        return comparison.inputs[waves[0]]
    return comparison.measured[next(iter(comparison.measured.data_vars))]


def _period_if_long(series: xr.DataArray) -> float | None:
    """Mean period of a record that is too long for lines, s."""
    time = series["time"].values
    dt = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    try:
        period = encounter_period(series.values, dt)
    except DataError:
        return None
    return period if (time[-1] - time[0]) / period >= LONG else None


def _forecast_style(comparison: Comparison) -> tuple[str, dict[str, Any]]:
    if comparison.band is None:
        return "forecast", LINES["forecast"]
    return "ensemble mean", LINES["ensemble"]


def _band_of(comparison: Comparison, name: str) -> tuple[xr.DataArray, xr.DataArray, str] | None:
    """Bounds of a channel's band, and what a legend calls it."""
    if comparison.band is None:
        return None
    lower, upper = (comparison.band[name].sel(statistic=key) for key in ("lower", "upper"))
    attrs = comparison.forecast.attrs
    kind = "calibrated " if attrs.get("band") == "calibrated" else ""
    return lower, upper, f"{100 * float(attrs['level']):g} % {kind}band"


def _draw_state(axes: Any, comparison: Comparison, name: str) -> None:
    measured, forecast = comparison.measured[name], comparison.forecast[name]
    label, style = _forecast_style(comparison)
    solid = dict(LINES["measured"])
    if (band := _band_of(comparison, name)) is not None:
        # A band is often little wider than a line; thinner ones leave it to be seen.
        solid["linewidth"], style = 1.0, {**style, "linewidth": 0.8}
        axes.fill_between(forecast["time"], band[0], band[1], label=band[2], **BAND)
    axes.plot(measured["time"], measured, label="measured", **solid)
    axes.plot(forecast["time"], forecast, label=label, **style)
    axes.margins(x=0.01)


def _envelope(series: xr.DataArray, period: float) -> tuple[Any, Any, Any]:
    """Edges of the steps, and the least and greatest value in each."""
    time = series["time"].values
    steps = min(int((time[-1] - time[0]) / period), MOST_STEPS)
    edges = np.linspace(time[0], time[-1], steps + 1)
    parts = np.split(series.values, np.searchsorted(time, edges[1:-1]))
    low, high = (np.array([reach(part) for part in parts]) for reach in (np.min, np.max))
    return edges, low, high


def _draw_envelopes(axes: Any, comparison: Comparison, name: str, period: float) -> None:
    edges, low, high = _envelope(comparison.measured[name], period)
    style = {"color": "#BDBDBD", "linewidth": 0}
    axes.stairs(high, edges, baseline=low, fill=True, label="measured, envelope", **style)
    if (band := _band_of(comparison, name)) is not None:
        (_, low, high), (_, lifted, topmost) = (_envelope(each, period) for each in band[:2])
        for bottom, top in ((low, lifted), (high, topmost)):
            axes.stairs(top, edges, baseline=bottom, fill=True, **BAND)
    style = _forecast_style(comparison)[1]
    _, low, high = _envelope(comparison.forecast[name], period)
    for reached in (low, high):
        axes.stairs(reached, edges, baseline=None, color=style["color"], linewidth=0.8)
    axes.margins(x=0.01)


def _draw_input_envelopes(axes: Any, inputs: xr.Dataset, names: list[str], period: float) -> None:
    for number, name in enumerate(names):
        edges, low, high = _envelope(inputs[name], period)
        for reached in (low, high):
            axes.stairs(reached, edges, baseline=None, color=SHADES[number % 4], linewidth=0.8)
    axes.axhline(0.0, color=COLOURS["input"], linewidth=0.4)


def _draw_inputs(axes: Any, inputs: xr.Dataset, names: list[str]) -> None:
    dashes = ("-", (0, (3, 1)), "-.", ":")
    for number, name in enumerate(names):
        style = {**LINES["input"], "color": SHADES[number % 4], "linestyle": dashes[number % 4]}
        axes.plot(inputs["time"], inputs[name], label=name, **style)
    axes.axhline(0.0, color=COLOURS["input"], linewidth=0.4)
