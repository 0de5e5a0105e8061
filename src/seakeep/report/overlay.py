"""Figure of forecast over measurement."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.campaign.settings import long_name_of
from seakeep.conventions import is_elevation
from seakeep.errors import DataError
from seakeep.report.figures.common import legend_outside
from seakeep.report.style import (
    COLOURS,
    LINES,
    PALETTE,
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

__all__ = ["error_figure", "overlay_figure"]

LONG = 60
"""A record of more periods than this is drawn as an envelope, with a part of it enlarged."""
ENLARGED = 20
MOST_STEPS = 150
"""Steps of an envelope that a panel can show; longer records take several periods per step."""

LABEL = 8
"""Points of a label: the longest line of one fits beside its panel."""

SHADES: tuple[tuple[str, Any], ...] = (
    (PALETTE["slate"], "-"),
    (PALETTE["sky"], (0, (3, 1))),
    (PALETTE["pink"], (0, (5, 1.5, 1, 1.5))),
    (PALETTE["amber"], (0, (1, 1))),
    (PALETTE["black"], (0, (8, 1.5))),
    (PALETTE["green"], (0, (5, 1.5, 1, 1.5, 1, 1.5))),
    (PALETTE["vermilion"], (0, (1, 2.5))),
    (PALETTE["blue"], (0, (2, 2, 6, 2))),
)
"""Colour and dash of each of several inputs: dashes distinguish them in grey print."""
ACROSS = 84
"""Letters of a legend that stand beside each other over a panel."""
BAND: dict[str, Any] = {"color": COLOURS["ensemble"], "alpha": 0.35, "linewidth": 0.6}


SEVERAL: tuple[dict[str, Any], ...] = (
    {**LINES["forecast"], "marker": "o"},
    {**LINES["ensemble"], "marker": "s"},
    *(
        {"color": PALETTE[colour], "linewidth": 1.2, "linestyle": (0, dash), "marker": marker}
        for colour, dash, marker in (
            ("green", (1, 1), "^"),
            ("pink", (8, 2), "D"),
            ("amber", (3, 1, 1, 1, 1, 1), "v"),
            ("sky", (6, 1, 1, 1), "P"),
            ("slate", (2, 2), "X"),
        )
    ),
)
"""Colour, dash and marker of each of several models."""


def overlay_figure(comparison: Comparison | Mapping[str, Comparison]) -> Figure:
    """Time histories of every state, forecasts over measurement, with the inputs below.

    Several comparisons are those of one run by several models, by the models' names.
    """
    compared = comparison if isinstance(comparison, Mapping) else {"": comparison}
    with figure_style():
        return _draw(compared)


def error_figure(table: xr.Dataset) -> Figure:
    """ANRMSE of each model in each run, by wave period; `table` of :func:`difference_table`."""
    order = np.argsort(table["wave_period"].values, kind="stable")
    periods, runs = table["wave_period"].values[order], table["run"].values[order]
    names = [str(name) for name in table["model"].values]
    with figure_style():
        figure = new_figure(max(4.5, 1.5 + 0.8 * len(runs)), 3.2)
        axes = figure.subplots()
        for k, name in enumerate(names):
            style = {**SEVERAL[k % len(SEVERAL)], "linestyle": "", "markersize": 5}
            place = np.arange(len(runs)) + 0.7 * ((k + 0.5) / len(names) - 0.5)
            axes.plot(place, table["anrmse"].values[k, order], label=plain_text(name), **style)
        axes.set_xticks(
            range(len(runs)),
            [
                plain_text(str(run)) + (f"\n{period:.3g} s" if np.isfinite(period) else "")
                for run, period in zip(runs, periods, strict=True)
            ],
        )
        axes.tick_params(axis="x", labelrotation=45 if len(runs) > 8 else 0)
        errors = table["anrmse"].values[np.isfinite(table["anrmse"].values)]
        if errors.size and 0.0 < 10.0 * errors.min() < errors.max():
            axes.set_yscale("log")
        else:
            axes.set_ylim(bottom=0.0)
        axes.set_xlabel("run, and mean period of its waves")
        axes.set_ylabel("ANRMSE [measured SD]")
        legend_outside(figure, axes)
        return figure


def _draw(several: Mapping[str, Comparison]) -> Figure:
    tables = [comparison_table([e], intervals=False).isel(run=0) for e in several.values()]
    compared = dict(zip(several, _with_prefixes(list(several.values())), strict=True))
    comparison = next(iter(compared.values()))
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
            _draw_state(axes[row, 0], compared, name, period)
        _draw_state(axes[row, -1], compared, name)
        axes[row, 0].set_ylabel(_label(comparison.measured[name]), fontsize=LABEL)
        judged = _judgement([table.sel(channel=name) for table in tables])
        axes[row, 0].set_title(judged, loc="right", fontsize=8, pad=2)
    for names, (first, last) in zip(alike, axes[len(states) :, [0, -1]], strict=True):
        if period is not None:
            _draw_inputs(first, comparison.inputs, names, period)
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
    legend_outside(figure, *axes[0])
    figure.suptitle(_title(list(compared.values())), x=0.01, ha="left")
    return figure


def _units(channel: xr.DataArray) -> str:
    return str(channel.attrs.get("units", ""))


def _label(channel: xr.DataArray) -> str:
    return axis_label(str(channel.name), _units(channel), channel.attrs.get("long_name"))


def _input_label(inputs: xr.Dataset) -> str:
    names = [str(name) for name in inputs.data_vars]
    if len(names) == 1:
        return _label(inputs[names[0]])
    waves = all(is_elevation(name) for name in names)
    units = shown_unit(_units(inputs[names[0]])) or "?"
    return f"{'wave elevations' if waves else 'inputs'}\n[{units}]"


def _of_one_unit(inputs: xr.Dataset) -> list[list[str]]:
    """Names of the inputs, those of one unit together."""
    groups: dict[str, list[str]] = {}
    for name, each in inputs.data_vars.items():
        groups.setdefault(_units(each), []).append(str(name))
    return list(groups.values())


def _with_prefixes(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Loads in kN or MN where they are large: one factor per state, and one for alike inputs."""
    parts = ("forecast", "measured", "inputs", "band")
    out = []
    for each in comparisons:
        copies = {part: getattr(each, part) for part in parts}
        out.append(replace(each, **{p: x.copy() for p, x in copies.items() if x is not None}))
    for name in map(str, out[0].measured.data_vars):
        among = [part for each in out for part in (each.measured, each.forecast, each.band)]
        _apply_prefix([(part, name) for part in among if part is not None])
    for each in out:
        for names in _of_one_unit(each.inputs):
            _apply_prefix([(each.inputs, name) for name in names])
    return out


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


def _judgement(rows: Sequence[xr.Dataset]) -> str:
    errors = [float(each["nrmse"]) for each in rows]
    if not np.isfinite(errors).any():
        return "not judged"
    words = "NRMSE " + " · ".join(f"{e:.3f}" if np.isfinite(e) else "lost" for e in errors)
    if len(rows) == 1 and "coverage" in rows[0] and np.isfinite(float(rows[0]["coverage"])):
        words += f", {float(rows[0]['coverage']):.0f} % in the band"
    return words


def _title(comparisons: Sequence[Comparison]) -> str:
    comparison = comparisons[0]
    parts = [comparison.run, comparison.sea_state]
    if len(comparisons) == 1:
        parts.append(f"ANRMSE {comparison.anrmse:.3f}")
    if (scale := comparison.full_scale) is not None:
        told = f"sea state as stated: {comparison.sea_state}" if comparison.sea_state else ""
        parts[1:2] = [f"full scale, λ = {scale:g}", told]
    if len(comparisons) == 1 and comparison.status != "ok":
        parts.append(comparison.status)
    return plain_text(" · ".join(part for part in parts if part))


def _counted(comparison: Comparison) -> xr.DataArray:
    """Series whose periods are counted: a wave elevation, for a state may be a slow motion."""
    waves = [name for name in comparison.inputs.data_vars if is_elevation(str(name))]
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


def _styles(compared: Mapping[str, Comparison]) -> list[tuple[Comparison, str, dict[str, Any]]]:
    """Each comparison with what a legend calls its forecast, and its line."""
    if len(compared) == 1:
        (each,) = compared.values()
        if each.band is None:
            return [(each, "forecast", LINES["forecast"])]
        return [(each, "ensemble mean", LINES["ensemble"])]
    out = []
    for k, (name, each) in enumerate(compared.items()):
        style = {key: value for key, value in SEVERAL[k % len(SEVERAL)].items() if key != "marker"}
        status = "" if each.status == "ok" else f", {each.status}"
        out.append((each, plain_text(f"{name}, ANRMSE {each.anrmse:.3f}{status}"), style))
    return out


def _band_of(comparison: Comparison, name: str) -> tuple[xr.DataArray, xr.DataArray, str] | None:
    """Bounds of a channel's band, and what a legend calls it."""
    if comparison.band is None:
        return None
    lower, upper = (comparison.band[name].sel(statistic=key) for key in ("lower", "upper"))
    attrs = comparison.forecast.attrs
    kind = "calibrated " if attrs.get("band") == "calibrated" else ""
    return lower, upper, f"{100 * float(attrs['level']):g} % {kind}band"


def _fill(styles: Sequence[Any], style: Mapping[str, Any]) -> dict[str, Any]:
    """How a band is filled: in the colour of its line where there are several."""
    return BAND if len(styles) == 1 else {**BAND, "color": style["color"], "alpha": 0.2}


def _draw_state(
    axes: Any, compared: Mapping[str, Comparison], name: str, period: float | None = None
) -> None:
    """Bands, measurement and forecasts of a state; as envelopes where a period is given."""
    styles = _styles(compared)
    measured = styles[0][0].measured[name]
    solid = dict(LINES["measured"])
    if period is not None:
        edges, low, high = _envelope(measured, period)
        pale = {"color": PALETTE["pale"], "linewidth": 0, "label": "measured, envelope"}
        axes.stairs(high, edges, baseline=low, fill=True, **pale)
    for each, _, style in styles:
        if (band := _band_of(each, name)) is None:
            continue
        solid, fill = THIN, _fill(styles, style)
        if period is None:
            axes.fill_between(each.forecast["time"], band[0], band[1], label=band[2], **fill)
            continue
        lower, upper = (_envelope(edge, period) for edge in band[:2])
        for bottom, top in zip(lower[1:], upper[1:], strict=True):
            axes.stairs(top, lower[0], baseline=bottom, fill=True, **fill)
    if period is None:
        axes.plot(measured["time"], measured, label="measured", **solid)
    for each, label, style in styles:
        line = style if period is None else {"color": style["color"]}
        _draw_line(axes, each.forecast[name], period, label, line)


def _draw_line(
    axes: Any, series: xr.DataArray, period: float | None, label: str, style: dict[str, Any]
) -> None:
    """A line, or the two edges of its envelope."""
    if period is None:
        axes.plot(series["time"], series, label=label, **style)
        return
    edges, *reached = _envelope(series, period)
    for each in reached:
        axes.stairs(each, edges, baseline=None, **{**style, "linewidth": 0.8})


def _envelope(series: xr.DataArray, period: float) -> tuple[Any, Any, Any]:
    """Edges of the steps, and the least and greatest value in each."""
    time = series["time"].values
    steps = min(int((time[-1] - time[0]) / period), MOST_STEPS)
    edges = np.linspace(time[0], time[-1], steps + 1)
    parts = np.split(series.values, np.searchsorted(time, edges[1:-1]))
    low, high = (np.array([reach(part) for part in parts]) for reach in (np.min, np.max))
    return edges, low, high


def _draw_inputs(
    axes: Any, inputs: xr.Dataset, names: list[str], period: float | None = None
) -> None:
    for name, style in zip(names, input_styles(len(names)), strict=True):
        stated = inputs[name].attrs.get("long_name")
        label = name if stated in (None, long_name_of(name, None)) else plain_text(str(stated))
        _draw_line(axes, inputs[name], period, label, style)
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
