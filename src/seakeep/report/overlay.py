"""Figure of forecast over measurement."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.campaign.settings import long_name_of
from seakeep.errors import DataError
from seakeep.report.style import (
    COLOURS,
    LINES,
    THIN,
    axis_label,
    figure_style,
    new_figure,
    plain_text,
    prefixed,
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
"""Steps of an envelope that a panel can show; longer records take several periods per step."""

LABEL = 8
"""Points of a label: the longest line of one fits beside its panel."""

SHADES: tuple[tuple[str, Any], ...] = (
    ("#56606B", "-"),
    ("#56B4E9", (0, (3, 1))),
    ("#CC79A7", (0, (5, 1.5, 1, 1.5))),
    ("#E69F00", (0, (1, 1))),
    ("#000000", (0, (8, 1.5))),
    ("#009E73", (0, (5, 1.5, 1, 1.5, 1, 1.5))),
    ("#D55E00", (0, (1, 2.5))),
    ("#0072B2", (0, (2, 2, 6, 2))),
)
"""Colour and dash of each of several inputs: dashes distinguish them in grey print."""
ACROSS = 84
"""Letters of a legend that stand beside each other over a panel."""
BAND: dict[str, Any] = {"color": COLOURS["ensemble"], "alpha": 0.35, "linewidth": 0.6}


def overlay_figure(comparison: Comparison) -> Figure:
    """Time histories of every state, forecast over measurement, with the inputs below."""
    with figure_style():
        return _draw(comparison)


def _draw(comparison: Comparison) -> Figure:
    table = comparison_table([comparison]).isel(run=0)
    comparison = _with_prefixes(comparison)
    states = [str(name) for name in comparison.measured.data_vars]
    alike = _of_one_unit(comparison.inputs)
    rows = len(states) + len(alike)
    period = _period_if_long(_counted(comparison))
    columns = 1 if period is None else 2
    figure = new_figure(7.5 if columns == 1 else 11.0, 1.0 + 1.45 * rows)
    axes = figure.subplots(rows, columns, squeeze=False, sharex="col", sharey="row")
    for each in axes.flat:
        each.use_sticky_edges = False  # an envelope would lie on the frame
        each.margins(x=0.01)
    for row, name in enumerate(states):
        if period is not None:
            _draw_envelopes(axes[row, 0], comparison, name, period)
        _draw_state(axes[row, -1], comparison, name)
        axes[row, 0].set_ylabel(_label(comparison.measured[name]), fontsize=LABEL)
        axes[row, 0].set_title(_judgement(table.sel(channel=name)), loc="right", fontsize=8, pad=2)
    for names, (first, last) in zip(alike, axes[len(states) :, [0, -1]], strict=True):
        if period is not None:
            _draw_input_envelopes(first, comparison.inputs, names, period)
        _draw_inputs(last, comparison.inputs, names)
        first.set_ylabel(_input_label(comparison.inputs[names]), fontsize=LABEL)
        _legend_over(first, *last.get_legend_handles_labels())
    figure.align_ylabels(axes[:, 0])
    for column in range(columns):
        axes[-1, column].set_xlabel("time [s]")
    if period is not None:
        end = float(comparison.measured["time"][-1])
        axes[0, 0].set_title("whole forecast, envelopes", loc="left")
        axes[0, 1].set_xlim(end - ENLARGED * period, end)
        axes[0, 1].set_title(f"last {ENLARGED} periods", loc="left")
    # Both panels label the band; the dictionary keeps one of equal labels.
    keys = {
        label: handle
        for column in range(columns)
        for handle, label in zip(*axes[0, column].get_legend_handles_labels(), strict=True)
    }
    figure.legend(keys.values(), keys.keys(), loc="outside lower center", ncols=len(keys))
    figure.suptitle(_title(comparison), x=0.01, ha="left")
    return figure


def _units(channel: xr.DataArray) -> str:
    return str(channel.attrs.get("units", ""))


def _label(channel: xr.DataArray) -> str:
    return axis_label(str(channel.name), _units(channel), channel.attrs.get("long_name"))


def _input_label(inputs: xr.Dataset) -> str:
    names = [str(name) for name in inputs.data_vars]
    if len(names) == 1:
        return _label(inputs[names[0]])
    waves = all(name.startswith("eta") for name in names)
    units = shown_unit(_units(inputs[names[0]])) or "?"
    return f"{'wave elevations' if waves else 'inputs'}\n[{units}]"


def _of_one_unit(inputs: xr.Dataset) -> list[list[str]]:
    """Names of the inputs, those of one unit together."""
    groups: dict[str, list[str]] = {}
    for name, each in inputs.data_vars.items():
        groups.setdefault(_units(each), []).append(str(name))
    return list(groups.values())


def _with_prefixes(comparison: Comparison) -> Comparison:
    """Loads in kN or MN where they are large: one factor per state, and one for alike inputs."""
    forecast, measured, inputs = (
        each.copy() for each in (comparison.forecast, comparison.measured, comparison.inputs)
    )
    band = None if comparison.band is None else comparison.band.copy()
    for name in map(str, measured.data_vars):
        among = [each for each in (measured, forecast, band) if each is not None]
        _apply_prefix([(each, name) for each in among])
    for names in _of_one_unit(inputs):
        _apply_prefix([(inputs, name) for name in names])
    return replace(comparison, forecast=forecast, measured=measured, inputs=inputs, band=band)


def _apply_prefix(channels: Iterable[tuple[xr.Dataset, str]]) -> None:
    chosen = [(each, name, each[name]) for each, name in channels]
    largest = max(float(np.abs(each).max()) for _, _, each in chosen)
    factor, units = prefixed(_units(chosen[0][2]), largest)
    for data, name, each in chosen:
        data[name] = factor * each
        data[name].attrs = {**each.attrs, "units": units}
        for key in {"training_std", "noise_std"} & set(each.attrs):
            data[name].attrs[key] = factor * float(each.attrs[key])


def _legend_over(axes: Any, handles: list[Any], labels: list[str]) -> None:
    """Legend above the left end of a panel, in rows of about equal lengths."""
    across = max(1, min(4, len(labels), ACROSS // (6 + max(map(len, labels)))))
    columns = -(-len(labels) // -(-len(labels) // across))
    # matplotlib fills columns; a reader goes along rows.
    order = [k for column in range(columns) for k in range(column, len(labels), columns)]
    axes.legend(
        [handles[k] for k in order],
        [labels[k] for k in order],
        loc="lower left",
        bbox_to_anchor=(0.0, 0.98),
        borderaxespad=0.0,
        ncols=columns,
        fontsize=LABEL,
        handlelength=3.5,
    )


def _judgement(rows: xr.Dataset) -> str:
    nrmse = float(rows["nrmse"])
    words = f"NRMSE {nrmse:.3f}" if np.isfinite(nrmse) else "not judged"
    if "coverage" in rows and np.isfinite(float(rows["coverage"])):
        words += f", {float(rows['coverage']):.0f} % in the band"
    return words


def _title(comparison: Comparison) -> str:
    parts = [comparison.run, comparison.sea_state, f"ANRMSE {comparison.anrmse:.3f}"]
    if (scale := comparison.full_scale) is not None:
        told = f"sea state as stated: {comparison.sea_state}" if comparison.sea_state else ""
        parts[1:2] = [f"full scale, λ = {scale:g}", told]
    if comparison.status != "ok":
        parts.append(comparison.status)
    return plain_text(" · ".join(part for part in parts if part))


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
        solid = THIN
        axes.fill_between(forecast["time"], band[0], band[1], label=band[2], **BAND)
    axes.plot(measured["time"], measured, label="measured", **solid)
    axes.plot(forecast["time"], forecast, label=label, **style)


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


def _draw_input_envelopes(axes: Any, inputs: xr.Dataset, names: list[str], period: float) -> None:
    for name, style in zip(names, input_styles(len(names)), strict=True):
        edges, low, high = _envelope(inputs[name], period)
        for reached in (low, high):
            axes.stairs(reached, edges, baseline=None, **{**style, "linewidth": 0.8})
    axes.axhline(0.0, color=COLOURS["input"], linewidth=0.4)


def _draw_inputs(axes: Any, inputs: xr.Dataset, names: list[str]) -> None:
    for name, style in zip(names, input_styles(len(names)), strict=True):
        stated = inputs[name].attrs.get("long_name")
        label = name if stated in (None, long_name_of(name, None)) else plain_text(str(stated))
        axes.plot(inputs["time"], inputs[name], label=label, **style)
    axes.axhline(0.0, color=COLOURS["input"], linewidth=0.4)


def input_styles(count: int) -> list[dict[str, Any]]:
    """Styles of inputs in one panel; beyond the eighth, colours meet other dashes."""
    size = len(SHADES)
    return [
        {
            **LINES["input"],
            "color": SHADES[number % size][0],
            "linestyle": SHADES[(number + number // size) % size][1],
        }
        for number in range(count)
    ]
