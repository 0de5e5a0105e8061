"""Time histories: forecasts over measurement, of runs, of cells of a study, and act by act."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.conventions import is_elevation
from seakeep.errors import DataError, RequestError
from seakeep.models import summarize
from seakeep.report.style import (
    COLOURS,
    DOTTED,
    LINES,
    PALETTE,
    SERIES,
    THIN,
    axis_label,
    figure_style,
    judged_models,
    legend_outside,
    line_of,
    model_words,
    new_figure,
    panels,
    plain_text,
    prefixed,
    short_label,
    shown,
    shown_unit,
)
from seakeep.signals import encounter_period
from seakeep.study import Comparison, StudyResult, comparison_table
from seakeep.study.judge import band_of
from seakeep.study.reproduce import ACTS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from seakeep.report.style import Places

LONG = 60
"""A record of more periods than this is drawn as an envelope, with a part of it enlarged."""
ENLARGED = 20
MOST_STEPS = 150
"""Steps of an envelope that a panel can show; longer records take several periods per step."""
LABEL = 8
"""Points of a label: the longest line of one fits beside its panel."""
ACROSS = 84
"""Letters of a legend that stand beside each other over a panel."""
CHANNELS = ("surge", "mooring_bow")
"""What drifts, and the load that this makes."""

Values = npt.ArrayLike | xr.DataArray


class Curve(NamedTuple):
    """A forecast as a panel shows it.

    Attributes
    ----------
    label : str
        What a legend calls it.
    line : dict
        Style of its line.
    values : array-like, shape (n_times,)
        Forecast.
    band : sequence of array-like
        Lower and upper bound; empty without a band.
    words : str
        What a legend calls the band.
    calibrated : sequence of array-like
        Bounds of the calibrated band beside that of the members; empty without one.
    """

    label: str
    line: dict[str, Any]
    values: Values
    band: Sequence[Values] = ()
    words: str = ""
    calibrated: Sequence[Values] = ()


def draw_history(
    axes: Any, time: Any, measured: Values, curves: Sequence[Curve], period: float | None = None
) -> None:
    """Draw bands, the measurement and forecasts over time; as envelopes where a period is given."""
    if period is not None:
        pale = {"color": PALETTE["pale"], "linewidth": 0, "label": "measured, envelope"}
        _envelope(axes, time, (measured, measured), period, fill=True, **pale)
    alpha = 0.3 if len(curves) == 1 else 0.2
    for each in (each for each in curves if len(each.band)):
        edge = {"color": each.line["color"], "linewidth": 0.6, "label": each.words}
        if period is None:
            axes.fill_between(time, *each.band, alpha=alpha, **edge)
        else:
            _envelope(axes, time, each.band, period, alpha=2 * alpha, **edge | {"label": None})
    if period is None:
        banded = any(len(each.band) for each in curves)
        axes.plot(time, measured, label="measured", **(THIN if banded else LINES["measured"]))
    for each in curves:
        if period is not None:
            edge = {"color": each.line["color"], "linewidth": 0.8}
            _envelope(axes, time, (each.values, each.values), period, **edge)
            continue
        for bound, label in zip(each.calibrated, ("calibrated", None), strict=False):
            style = {**each.line, "linewidth": 0.7, "linestyle": DOTTED}
            axes.plot(time, bound, label=label, **style)
        axes.plot(time, each.values, label=each.label, **each.line)


def _envelope(axes: Any, time: Any, bounds: Sequence[Values], period: float, **style: Any) -> None:
    """Draw the least and the greatest value in steps of a period, or of several."""
    instants = np.asarray(time)
    steps = min(int((instants[-1] - instants[0]) / period), MOST_STEPS)
    edges = np.linspace(instants[0], instants[-1], steps + 1)
    first = np.searchsorted(instants, edges[:-1])
    low = np.minimum.reduceat(np.asarray(bounds[0]), first)
    high = np.maximum.reduceat(np.asarray(bounds[1]), first)
    axes.stairs(high, edges, baseline=low, **style)


@figure_style()
def overlay_figure(comparison: Comparison | Mapping[str, Comparison]) -> Figure:
    """Time histories of every state, forecasts over measurement, with the inputs below.

    Several comparisons are those of one run by several models, by the models' names.
    """
    several = comparison if isinstance(comparison, Mapping) else {"": comparison}
    compared = list(several.values())
    tables = [comparison_table([each], intervals=False).isel(run=0) for each in compared]
    first = compared[0]
    states, time = list(map(str, first.measured.data_vars)), first.measured["time"].values
    groups: dict[str, list[str]] = {}
    for name, each in first.inputs.data_vars.items():
        groups.setdefault(str(each.attrs.get("units", "")), []).append(str(name))
    period = _period_if_long(first)
    spans = [None] if period is None else [period, None]
    rows = len(states) + len(groups)
    figure = new_figure(7.5 if len(spans) == 1 else 11.0, 1.0 + 1.45 * rows)
    axes = figure.subplots(rows, len(spans), squeeze=False, sharex="col", sharey="row")
    for each in axes.flat:
        each.use_sticky_edges = False  # an envelope would lie on the frame
        each.margins(x=0.01)
    for row, name in zip(axes, states, strict=False):
        parts = [part for each in compared for part in (each.measured, each.forecast, each.band)]
        largest = max(float(np.abs(part[name]).max()) for part in parts if part is not None)
        attrs = first.measured[name].attrs
        factor, units = prefixed(str(attrs.get("units", "")), largest)
        curves = [_curve(each, key, name, factor, several) for key, each in several.items()]
        for place, span in zip(row, spans, strict=True):
            draw_history(place, time, factor * first.measured[name], curves, span)
        row[0].set_ylabel(axis_label(name, units, attrs.get("long_name")), fontsize=LABEL)
        judged = _judgement([table.sel(channel=name) for table in tables])
        row[0].set_title(judged, loc="right", fontsize=8, pad=2)
    for row, names in zip(axes[len(states) :], groups.values(), strict=True):
        for place, span in zip(row, spans, strict=True):
            _draw_inputs(place, first.inputs[names], span)
        row[0].set_ylabel(_input_label(first.inputs[names]), fontsize=LABEL)
        handles, labels = row[-1].get_legend_handles_labels()
        columns = max(1, min(4, len(labels), ACROSS // (6 + max(map(len, labels)))))
        above = {"loc": "lower left", "bbox_to_anchor": (0.0, 0.98), "borderaxespad": 0.0}
        row[0].legend(handles, labels, **above, ncols=columns, fontsize=LABEL, handlelength=3.5)
    figure.align_ylabels(axes[:, 0])
    for each in axes[-1]:
        each.set_xlabel("time [s]")
    if period is not None:
        axes[0, 0].set_title("whole forecast, envelopes", loc="left")
        axes[0, 1].set_xlim(time[-1] - ENLARGED * period, time[-1])
        axes[0, 1].set_title(f"last {ENLARGED} periods", loc="left")
    legend_outside(figure, *axes[0])
    figure.suptitle(_title(compared), x=0.01, ha="left")
    return figure


def _curve(
    each: Comparison, key: str, name: str, factor: float, several: Mapping[str, Comparison]
) -> Curve:
    """Forecast of a state as a panel shows it; named where there are several."""
    line, label, band, words = LINES["forecast"], "forecast", [], ""
    if each.band is not None:
        line, label = LINES["ensemble"], "ensemble mean"
        band = [factor * each.band[name].sel(statistic=key) for key in ("lower", "upper")]
        attrs = each.forecast.attrs
        kind = "calibrated " if attrs.get("band") == "calibrated" else ""
        words = f"{100 * float(attrs['level']):g} % {kind}band"
    if len(several) > 1:
        style = SERIES[list(several).index(key) % len(SERIES)]
        line = {what: value for what, value in style.items() if what != "marker"}
        status = "" if each.status == "ok" else f", {each.status}"
        label = plain_text(f"{key}, ANRMSE {each.anrmse:.3f}{status}")
    return Curve(label, line, factor * each.forecast[name], band, words)


def _judgement(rows: Sequence[xr.Dataset]) -> str:
    errors = [float(each["nrmse"]) for each in rows]
    if not np.isfinite(errors).any():
        return "not judged"
    words = "NRMSE " + " · ".join(f"{e:.3f}" if np.isfinite(e) else "lost" for e in errors)
    if len(rows) == 1 and "coverage" in rows[0] and np.isfinite(float(rows[0]["coverage"])):
        words += f", {float(rows[0]['coverage']):.0f} % in the band"
    return words


def _title(comparisons: Sequence[Comparison]) -> str:
    first = comparisons[0]
    parts = [first.run, first.sea_state]
    if first.full_scale is not None:
        stated = f"sea state as stated: {first.sea_state}" if first.sea_state else ""
        parts[1:] = [f"full scale, λ = {first.full_scale:g}", stated]
    if len(comparisons) == 1:
        parts += [f"ANRMSE {first.anrmse:.3f}", first.status if first.status != "ok" else ""]
    return plain_text(" · ".join(filter(None, parts)))


def _period_if_long(comparison: Comparison) -> float | None:
    """Mean period of a record that is too long for lines, s; counted in an elevation if there is.

    A state may be a slow motion.
    """
    inputs = comparison.inputs
    waves = [each for name, each in inputs.data_vars.items() if is_elevation(str(name))]
    series = [*waves, *comparison.measured.data_vars.values()][0]
    time = series["time"].values
    dt = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    try:
        period = encounter_period(series.values, dt)
    except DataError:
        return None
    return period if (time[-1] - time[0]) / period >= LONG else None


def _draw_inputs(axes: Any, inputs: xr.Dataset, period: float | None) -> None:
    """Inputs of one unit; beyond the first, colours and dashes set them apart."""
    time = inputs["time"].values
    for number, (name, each) in enumerate(inputs.data_vars.items()):
        line = {**LINES["input"], "label": plain_text(str(each.attrs.get("long_name", name)))}
        if number:
            other = SERIES[(number + 1) % len(SERIES)]
            line |= {"color": other["color"], "linestyle": other["linestyle"]}
        if period is None:
            axes.plot(time, each, **line)
        else:
            _envelope(axes, time, (each, each), period, **line)
    axes.axhline(0.0, color=COLOURS["input"], linewidth=0.4)


def _input_label(inputs: xr.Dataset) -> str:
    first, *others = inputs.data_vars.values()
    units = str(first.attrs.get("units", ""))
    if not others:
        return axis_label(str(first.name), units, first.attrs.get("long_name"))
    waves = all(is_elevation(str(name)) for name in inputs.data_vars)
    return f"{'wave elevations' if waves else 'inputs'}\n[{shown_unit(units) or '?'}]"


def overlay(
    forecast: xr.Dataset,
    measured: xr.Dataset,
    *,
    axes: Places = None,
) -> Figure:
    """Draw a forecast over the measurement.

    Parameters
    ----------
    forecast : Dataset
        From :meth:`seakeep.HankelDMDcModel.forecast`.
    measured : Dataset
        The run; the instants of the forecast are drawn.
    axes : Axes or sequence of Axes, optional
        One for each channel; by default those of a new figure.

    Returns
    -------
    Figure
    """
    return _histories(forecast, None, measured, axes)


def band(
    forecast: xr.Dataset,
    measured: xr.Dataset,
    *,
    level: float = 0.95,
    axes: Places = None,
) -> Figure:
    """Draw the band of an ensemble and its mean over the measurement.

    Parameters
    ----------
    forecast : Dataset
        From :meth:`seakeep.models.HankelEnsemble.forecast` (its members) or ``forecast_summary``.
    measured, axes
        As for :func:`overlay`.
    level : float, optional
        Probability between the bounds, where members are given.

    Returns
    -------
    Figure

    Raises
    ------
    RequestError
        If the forecast has neither members nor statistics.
    """
    if "member" in forecast.dims and "statistic" not in forecast.dims:
        forecast = summarize(forecast, level=level)
    if "statistic" not in forecast.dims:
        raise RequestError(
            "the forecast has no members and no statistics, so that it has no band. Draw it with "
            "seakeep.plot.overlay."
        )
    return _histories(forecast.sel(statistic="mean"), forecast, measured, axes)


@figure_style()
def _histories(
    forecast: xr.Dataset,
    bounds: xr.Dataset | None,
    measured: xr.Dataset,
    axes: Places,
) -> Figure:
    chosen = [str(name) for name, each in forecast.data_vars.items() if "time" in each.dims]
    for what, data in (("forecast", forecast), ("measured", measured)):
        known = [n for n in data.data_vars if data[n].dims == ("time",) and "time" in data.coords]
        for name in chosen:
            if name not in known:
                raise RequestError(
                    f"{what} has no channel '{name}' over instants in a coordinate 'time'. "
                    f"Channels: {', '.join(map(str, known)) or 'none'}. Draw an ensemble with "
                    "seakeep.plot.band, and windows one by one."
                )
    time = forecast["time"].values
    at = measured.sel(time=slice(time[0] - 1e-6, time[-1] + 1e-6))
    figure, places = panels(axes, len(chosen), 1, (7.5, 1.45))
    for name, place in zip(chosen, places, strict=True):
        factor, label = shown(measured[name])
        curve = Curve("forecast", LINES["forecast"], factor * forecast[name])
        if bounds is not None:
            sides = [factor * bounds[name].sel(statistic=each) for each in ("lower", "upper")]
            curve = Curve("mean", LINES["ensemble"], curve.values, sides, "band")
        draw_history(place, at["time"], factor * at[name], [curve])
        place.set_ylabel(label, fontsize=8)
        place.margins(x=0.01)
    places[-1].set_xlabel("time [s]")
    if axes is None:
        figure.align_ylabels(places)
        legend_outside(figure, places[0])
    return figure


def shown_cells(result: StudyResult) -> list[tuple[str, int, int]]:
    """Cells that are drawn: test set, training set and window."""
    count = int(result.settings["output"]["shown_windows"])
    cells = []
    for number, (name, test) in enumerate(result.tests.items()):
        judged = test["judged"].values
        total = judged.shape[1]
        wanted = min(count if number == 0 else min(count, 1), total)
        for window in np.linspace(0, total - 1, wanted).round().astype(int).tolist():
            cells.append((name, int(np.argmax(judged[:, window])), window))
    return cells


@figure_style()
def history_figure(
    result: StudyResult,
    test: str,
    training: int,
    window: int,
    names: Sequence[str] | None = None,
) -> Figure:
    """Channels of one cell over time; all of them unless `names` are given."""
    names = result.channels if names is None else names
    figure = new_figure(7.5, 0.9 + (0.95 if len(names) > 1 else 1.4) * len(names))
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    cell = result.tests[test].isel(training=[training], window=[window])
    calibration = result.groups.get("calibration")
    calibration = calibration if calibration is None else calibration.isel(training=[training])
    for each, name in zip(axes, names, strict=True):
        _draw_channel(each, result, cell, name, calibration)
    words = "deviation from the training mean, in training SD" if len(names) > 1 else "training SD"
    figure.supylabel(words, fontsize=8)
    axes[-1].set_xlabel("time after the last measured state, in encounter periods")
    legend_outside(figure, axes[0], side="upper right")
    run, learnt, start = (cell[key].item() for key in ("run", "training", "start"))
    left_out = str(result.groups["training"]["left_out"].values[training])
    title = f"{run}, from {start:.1f} s; trained {'' if left_out else 'on '}{learnt}"
    axes[0].set_title(title, loc="left", fontsize=8)
    return figure


def _draw_channel(
    axes: Any,
    result: StudyResult,
    cell: xr.Dataset,
    name: str,
    calibration: xr.Dataset | None = None,
) -> None:
    """Draw what was measured and the forecasts of all models but baselines."""
    level = 100 * float(result.settings["statistics"]["level"])
    at = cell.isel(training=0, window=0).sel(channel=name)
    curves = []
    for model in judged_models(result):
        mean, words, line = at["mean"].sel(model=model), model_words(model), line_of(result, model)
        if not result.is_ensemble(model):
            curves.append(Curve(words, line, _standard(at, mean)))
            continue
        band = [_standard(at, at[side].sel(ensemble=model)) for side in ("lower", "upper")]
        wider: list[Any] = []
        if calibration is not None:
            edges = (each[0, 0, :, result.channels.index(name)]
                     for each in band_of(cell, model, calibration))  # fmt: skip
            wider = [_standard(at, each) for each in edges]
            wider = wider if np.isfinite(wider).all() else []
        title = f"{words} mean"
        curves.append(Curve(title, line, _standard(at, mean), band, f"{level:g} % band", wider))
    time = cell["time"].values / float(result.attrs["encounter_period"])
    draw_history(axes, time, _standard(at, at["measured"]), curves)
    axes.set_ylabel(short_label(name), rotation=0, ha="right", va="center")
    axes.margins(x=0.005)


def _standard(at: xr.Dataset, values: Any) -> Any:
    """Deviation from the training mean in training SDs."""
    return (np.asarray(values) - float(at["training_mean"])) / float(at["training_std"])


@figure_style()
def acts_figure(results: Mapping[str, StudyResult]) -> Figure:
    """Channels as measured (columns) in one window of irregular waves, act by act (rows)."""
    acts = [act for act in ACTS if act.name in results and not act.without_drift]
    figure = new_figure(8.5, 0.7 + 1.3 * len(acts))
    grid = figure.subplots(len(acts), len(CHANNELS), sharex=True, squeeze=False)
    for row, act in zip(grid, acts, strict=True):
        result = results[act.name]
        test = result.tests["irregular"]
        training = int(test["judged"].values[:, 0].argmax())
        for axes, name in zip(row, CHANNELS, strict=True):
            _draw_channel(axes, result, test.isel(training=[training], window=[0]), name)
            axes.set_title(f"{act.title}: {name}", loc="left", fontsize=8)
    for axes in grid[-1]:
        axes.set_xlabel("time after the last measured state, in encounter periods")
    legend_outside(figure, grid[0, 0], side="upper right")
    figure.supylabel("deviation from the training mean, in training SD", fontsize=8)
    return figure
