"""Records over time and their spectra: forecasts over measurement, of runs, cells and acts."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.conventions import is_elevation
from seakeep.errors import RequestError
from seakeep.models import summarize
from seakeep.models.labelled import check_run
from seakeep.quality import findings_of
from seakeep.quality.faults import FLAGS
from seakeep.quality.sensors import LATE, Agreement
from seakeep.report.style import (
    COLOURS,
    DASHED,
    FLAGGED,
    LINES,
    PALETTE,
    SERIES,
    Figure,
    Places,
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
from seakeep.report.tables import band_words, entries
from seakeep.signals.time_axis import over_gaps
from seakeep.study import Comparison, StudyResult, comparison_table
from seakeep.study.comparison import wave_period
from seakeep.study.judge import band_of
from seakeep.study.reproduce import ACTS

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
    axes: Any, time: Any, measured: Values, curves: Sequence[Curve], at: Any = None
) -> None:
    """Draw bands, the measurement and forecasts over time; `at` are other instants measured."""
    banded = [each for each in curves if each.band]
    band = {"alpha": 0.3 if len(curves) == 1 else 0.2, "linewidth": 0.6}
    for each in banded:
        axes.fill_between(time, *each.band, label=each.words, color=each.line["color"], **band)
    line = LINES["thin" if banded else "measured"]
    axes.plot(time if at is None else at, measured, label="measured", **line)
    for each in curves:
        edge = {**each.line, "linewidth": 0.7, "linestyle": "-", "alpha": 0.6}
        for bound, label in zip(each.calibrated, ("calibrated", None), strict=False):
            axes.plot(time, bound, label=label, **edge)
        axes.plot(time, each.values, label=each.label, **each.line)


def _draw_envelopes(envelope: Any, measured: Values, curves: Sequence[Curve]) -> None:
    """Draw the measurement, bands and forecasts, each by what draws its envelope."""
    envelope(measured, fill=True, label="measured, envelope", color=PALETTE["pale"], linewidth=0)
    band = {"alpha": 0.6 if len(curves) == 1 else 0.4, "linewidth": 0.6}
    for each in curves:
        if each.band:
            envelope(*each.band, color=each.line["color"], **band)
    for each in curves:
        envelope(each.values, color=each.line["color"], linewidth=0.8)


def _envelope(axes: Any, time: FloatArray, period: float, *bounds: Values, **style: Any) -> None:
    """Draw the least and the greatest value in steps of a period, or of several."""
    steps = min(int((time[-1] - time[0]) / period), MOST_STEPS)
    edges = np.linspace(time[0], time[-1], steps + 1)
    first = np.searchsorted(time, edges[:-1])
    bottom = np.minimum.reduceat(np.asarray(bounds[0]), first)
    top = np.maximum.reduceat(np.asarray(bounds[-1]), first)
    axes.stairs(top, edges, baseline=bottom, **style)


@figure_style()
def overlay_figure(several: Mapping[str, Comparison]) -> Figure:
    """Time histories of every state, forecasts over measurement, with the inputs below.

    The comparisons are those of one run by one model or several, by the models' names.
    """
    compared = list(several.values())
    tables = [comparison_table([each], intervals=False).isel(run=0) for each in compared]
    first = compared[0]
    states, time = list(map(str, first.measured.data_vars)), first.measured["time"].values
    groups = defaultdict(list)
    for name, each in first.inputs.data_vars.items():
        groups[each.attrs.get("units", "")].append(str(name))
    period = wave_period(first.inputs, first.measured[states[0]])
    is_long = (time[-1] - time[0]) / period >= LONG
    rows = len(states) + len(groups)
    figure = new_figure(11.0 if is_long else 7.5, 1.0 + 1.45 * rows)
    axes = figure.subplots(rows, 1 + is_long, squeeze=False, sharex="col", sharey="row")
    for each in axes.flat:
        each.use_sticky_edges = False  # an envelope would lie on the frame
        each.margins(x=0.01)
    for row, name in zip(axes, states, strict=False):
        parts = [part for each in compared for part in (each.measured, each.forecast, each.band)]
        largest = max(float(np.abs(part[name]).max()) for part in parts if part is not None)
        attrs = first.measured[name].attrs
        factor, units = prefixed(attrs.get("units", ""), largest)
        curves = [_curve(each, key, name, factor, several) for key, each in several.items()]
        measured = factor * first.measured[name]
        draw_history(row[-1], time, measured, curves)
        if is_long:
            _draw_envelopes(partial(_envelope, row[0], time, period), measured, curves)
        row[0].set_ylabel(axis_label(name, units, attrs.get("long_name")), fontsize=LABEL)
        judged = _judgement([table.sel(channel=name) for table in tables])
        row[0].set_title(judged, loc="right", fontsize=8, pad=2)
    for row, (units, names) in zip(axes[len(states) :], groups.items(), strict=True):
        inputs = first.inputs[names]
        _draw_inputs(row[-1], partial(row[-1].plot, time), inputs)
        if is_long:
            _draw_inputs(row[0], partial(_envelope, row[0], time, period), inputs)
        waves = "wave elevations" if all(map(is_elevation, names)) else "inputs"
        label = f"{waves}\n[{shown_unit(units) or '?'}]"
        if len(names) == 1:
            label = axis_label(names[0], units, inputs[names[0]].attrs.get("long_name"))
        row[0].set_ylabel(label, fontsize=LABEL)
        handles, labels = row[-1].get_legend_handles_labels()
        columns = max(1, min(4, len(labels), ACROSS // (6 + max(map(len, labels)))))
        row[0].legend(
            handles,
            labels,
            loc="lower left",
            bbox_to_anchor=(0.0, 0.98),
            borderaxespad=0.0,
            ncols=columns,
            fontsize=LABEL,
        )
    figure.align_ylabels(axes[:, 0])
    for each in axes[-1]:
        each.set_xlabel("time [s]")
    if is_long:
        axes[0, 0].set_title("whole forecast, envelopes", fontsize=10)
        axes[0, 1].set_xlim(time[-1] - ENLARGED * period, time[-1])
        axes[0, 1].set_title(f"last {ENLARGED} periods", fontsize=10)
    legend_outside(*axes[0])
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
        words = band_words(attrs["level"], attrs.get("band"))
    if len(several) > 1:
        line = {**SERIES[list(several).index(key) % len(SERIES)], "marker": None}
        status = "" if each.status == "ok" else f", {each.status}"
        label = plain_text(f"{key}, ANRMSE {each.anrmse:.3f}{status}")
    return Curve(label, line, factor * each.forecast[name], band, words)


def _judgement(rows: Sequence[xr.Dataset]) -> str:
    errors = [float(each["nrmse"]) for each in rows]
    if not np.isfinite(errors).any():
        return "not judged"
    words = "NRMSE " + " · ".join(f"{e:.3f}" if np.isfinite(e) else "lost" for e in errors)
    if len(rows) == 1 and "coverage" in rows[0] and np.isfinite(rows[0]["coverage"]):
        words += f", {float(rows[0]['coverage']):.0f} % in the band"
    return words


def _title(comparisons: Sequence[Comparison]) -> str:
    first = comparisons[0]
    parts = [first.run, first.sea_state]
    if first.full_scale:
        stated = f"sea state as stated: {first.sea_state}" if first.sea_state else ""
        parts[1:] = [f"full scale, λ = {first.full_scale:g}", stated]
    if len(comparisons) == 1:
        parts += [f"ANRMSE {first.anrmse:.3f}", first.status if first.status != "ok" else ""]
    return plain_text(" · ".join(filter(None, parts)))


def _draw_inputs(axes: Any, draw: Callable[..., Any], inputs: xr.Dataset) -> None:
    """Inputs of one unit; beyond the first, colours and dashes set them apart."""
    for number, (name, each) in enumerate(inputs.data_vars.items()):
        line = dict(LINES["input"])
        if number:
            other = SERIES[(number + 1) % len(SERIES)]
            line |= {key: other[key] for key in ("color", "linestyle")}
        draw(each, **line, label=plain_text(str(each.attrs.get("long_name", name))))
    axes.axhline(0.0, color=COLOURS["input"], linewidth=0.4)


def overlay(forecast: xr.Dataset, measured: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw a forecast over the measurement.

    Parameters
    ----------
    forecast : Dataset
        From :meth:`seakeep.HankelDMDcModel.forecast`.
    measured : Dataset
        The run, drawn from the first instant of the forecast to its last, or as far as it goes.
    axes : Axes or sequence of Axes, optional
        One for each channel; by default those of a new figure.

    Returns
    -------
    Figure
    """
    return _histories(forecast, None, measured, axes)


def band(
    forecast: xr.Dataset, measured: xr.Dataset, *, level: float = 0.95, axes: Places = None
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
    forecast: xr.Dataset, bounds: xr.Dataset | None, measured: xr.Dataset, axes: Places
) -> Figure:
    check_run(forecast, "forecast")
    check_run(measured, "measured")
    chosen = [str(name) for name, each in forecast.data_vars.items() if "time" in each.dims]
    for what, data in (("forecast", forecast), ("measured", measured)):
        known = [name for name, each in data.data_vars.items() if each.dims == ("time",)]
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
        draw_history(place, time, factor * at[name], [curve], at["time"])
        place.set_ylabel(label, fontsize=8)
        place.margins(x=0.01)
    places[-1].set_xlabel("time [s]")
    if axes is None:
        figure.align_ylabels(places)
        legend_outside(places[0])
    return figure


def shown_cells(result: StudyResult) -> list[tuple[str, int, int]]:
    """Cells that are drawn: test set, training set and window."""
    count = result.settings["output"]["shown_windows"]
    cells = []
    for name, test in result.tests.items():
        judged = test["judged"].values
        last, wanted = judged.shape[1] - 1, min(count, judged.shape[1])
        for window in np.linspace(0, last, wanted).round().astype(int).tolist():
            cells.append((name, int(np.argmax(judged[:, window])), window))
        count = min(count, 1)  # of each other test set
    return cells


def history_figure(
    result: StudyResult, test: str, training: int, window: int, names: Sequence[str] | None = None
) -> Figure:
    """Channels of one cell over time; all of them unless `names` are given."""
    names = names or result.channels
    figure = new_figure(7.5, 0.9 + (0.95 if len(names) > 1 else 1.4) * len(names))
    axes = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    calibration = result.groups.get("calibration")
    for each, name in zip(axes, names, strict=True):
        _draw_channel(each, result, (test, training, window), name, calibration)
    words = "deviation from the training mean, in training SD" if len(names) > 1 else "training SD"
    figure.supylabel(words, fontsize=8)
    axes[-1].set_xlabel("time after the last measured state, in encounter periods")
    legend_outside(axes[0], side="upper right")
    cell = result.tests[test].isel(training=training, window=window)
    run, learnt, start = (cell[key].item() for key in ("run", "training", "start"))
    left_out = result.groups["training"]["left_out"].values[training]
    axes[0].set_title(f"{run}, from {start:.1f} s; trained {'' if left_out else 'on '}{learnt}")
    return figure


def _draw_channel(
    axes: Any,
    result: StudyResult,
    place: tuple[str, int, int],
    name: str,
    calibration: xr.Dataset | None = None,
) -> None:
    """Draw what was measured and the forecasts of all models but baselines."""
    test, training, window = place
    part = {"training": [training], "channel": [result.channels.index(name)]}
    cell = result.tests[test].isel({**part, "window": [window]})

    def standard(values: npt.ArrayLike) -> FloatArray:
        """Return deviations from the training mean in training SDs."""
        return (np.ravel(values) - cell["training_mean"].item()) / cell["training_std"].item()

    curves = []
    for model in judged_models(result):
        words, band, wider = model_words(model), [], []
        if model in result.ensembles:
            words = f"{words} mean"
            band = [standard(bound) for bound in band_of(cell, model, None)]
            if calibration:
                bounds = band_of(cell, model, calibration.isel(part))
                wider = [standard(bound) for bound in bounds if np.isfinite(bound).all()]
        mean, share = standard(cell["mean"].sel(model=model)), f"{100 * result.level:g} % band"
        curves.append(Curve(words, line_of(result, model), mean, band, share, wider))
    time = cell["time"].values / result.encounter_period
    draw_history(axes, time, standard(cell["measured"]), curves)
    axes.set_ylabel(short_label(name), rotation=0, ha="right", va="center")
    axes.margins(x=0.005)


def acts_figure(results: Mapping[str, StudyResult]) -> Figure:
    """Channels as measured (columns) in one window of irregular waves, act by act (rows)."""
    acts = [act for act in ACTS if act.name in results and not act.without_drift]
    figure = new_figure(8.5, 0.7 + 1.3 * len(acts))
    grid = figure.subplots(len(acts), len(CHANNELS), sharex=True, squeeze=False)
    for row, act in zip(grid, acts, strict=True):
        result = results[act.name]
        training = int(result.tests["irregular"]["judged"].values[:, 0].argmax())
        for axes, name in zip(row, CHANNELS, strict=True):
            _draw_channel(axes, result, ("irregular", training, 0), name)
            axes.set_title(f"{act.title}: {plain_text(result.words_of(name))}")
    for axes in grid[-1]:
        axes.set_xlabel("time after the last measured state, in encounter periods")
    legend_outside(grid[0, 0], side="upper right")
    figure.supylabel("deviation from the training mean, in training SD", fontsize=8)
    return figure


DRAWN = 50
"""Channels that a picture shows at most, each in a row of its own; the table lists all."""
LABELS = -0.06
"""Where labels of the vertical axes stand, in widths of the axes: beyond six figures."""
WELCH = {"paper": (COLOURS["forecast"], DASHED), "recommended": (COLOURS["ensemble"], "-")}
"""Colour and dash of a measured spectrum, by how it is estimated."""
Spectrum = tuple[FloatArray, FloatArray]
"""Frequencies and densities."""


@figure_style()
def quality_figure(run: xr.Dataset, agreements: Mapping[str, Agreement]) -> Figure:
    """Draw every channel of a run, flagged samples marked; lags of redundant sensors below."""
    names = [str(name) for name in run.data_vars][:DRAWN]
    lagging = {name: each for name, each in agreements.items() if each.lags.size}
    doubtful = {each.channel for each in findings_of(run)}
    rows = len(names) + len(lagging)
    figure = new_figure(9.5, 0.5 + 1.45 * rows)
    axes = figure.subplots(rows, 1, squeeze=False, sharex=True)[:, 0]
    time = run["time"].values
    for at, name in zip(axes, names, strict=False):
        factor, label = shown(run[name])
        x = factor * run[name].values
        if name in doubtful:  # the style sheet has the same colour for rows
            at.set_facecolor(PALETTE["blush"])
        at.plot(time, x, color=COLOURS["measured"], linewidth=0.6)
        at.set_ylabel(label, fontsize=8)
        if f"{name}_flags" in run.coords and (flags := run[f"{name}_flags"].values).any():
            filled = over_gaps(x)  # a sample that is not there stands between its neighbours
            for word, bit in FLAGS.items():
                if (hit := (flags & bit) > 0).any():
                    style = {"linestyle": "none", "markersize": 3.5, "zorder": 3, **FLAGGED[word]}
                    at.plot(time[hit], filled[hit], label=word, **style)
            at.legend(
                loc="lower right", bbox_to_anchor=(1.0, 0.95), fontsize=7, ncols=6, borderpad=0.1
            )
        known = x[np.isfinite(x)]
        if known.size and np.ptp(known) <= 1e-9 * np.abs(known).max():
            value = known[0]  # an axis that shows no rounding
            reach = 0.1 * abs(value) or 1.0
            at.set_ylim(value - reach, value + reach)
            words = f"constant: {value:.4g}"
            at.text(0.5, 0.8, words, transform=at.transAxes, ha="center", fontsize=8)
    for at, (name, each) in zip(axes[len(names) :], lagging.items(), strict=True):
        limit = LATE * each.period
        at.axhspan(-limit, limit, color=PALETTE["green"], alpha=0.12)
        apart = np.diff(each.centre)
        usual = np.median(apart) if apart.size else 0.0
        holes = 1 + np.flatnonzero(apart > 1.5 * usual)
        trace = each.centre + time[0], each.lags
        lags = np.insert(trace, holes, np.nan, axis=1)  # no line across a hole
        at.plot(*lags, "o-", color=COLOURS["ensemble"], markersize=3)
        reach = max(1.5 * limit, 1.1 * np.nanmax(np.abs(each.lags), initial=0.0))
        at.set_ylim(-reach, reach)
        at.set_ylabel(f"lag of\n{name.replace('_', ' ')} [s]", fontsize=8)
    for at in axes:
        if (startup := float(run.attrs.get("startup", 0.0))) > time[0]:
            at.axvspan(time[0], startup, color=PALETTE["light"], zorder=0)
        at.margins(x=0.005)
        at.tick_params(labelbottom=True, labelsize=7)
        at.yaxis.set_label_coords(LABELS, 0.5)  # in line: aligning them takes half of the time
    left_out = len(run.data_vars) - len(names)
    axes[-1].set_xlabel("time [s]" + f" ({left_out} more channels)" * bool(left_out))
    return figure


def spectrum_figure(result: StudyResult) -> Figure:
    """Mean spectrum of the irregular runs of a study, and the frequencies of the regular ones."""
    spectra, runs = result.groups["spectra"], result.groups["runs"]
    figure = new_figure(8.5, 4.2)
    axes = figure.subplots()
    nominal = [
        (each.attrs["long_name"], (each["frequency"].values, each.values))
        for each in result.groups.get("nominal", xr.Dataset()).values()
    ]
    # Where no run is irregular the mean over all of them is drawn.
    drawn = runs["run"][runs["waves"] != "regular"]
    of_drawn = spectra.sel(run=drawn if drawn.size else runs["run"])
    measured = {}
    for kind, length in (("paper", "8.2 s (paper)"), ("recommended", "60 s")):
        records = of_drawn.sel(kind=kind)
        of_runs = (at.dropna("bin", subset=["density"]) for at in entries(records, "run"))
        curves = [
            (at["frequency"].values, at["density"].values) for at in of_runs if at["bin"].size
        ]
        measured[kind] = f"measured, segments of {length}", curves
    draw_spectra(axes, nominal, measured, runs["wave_frequency"].dropna("run").values)
    long = spectra.sel(kind="recommended")
    peaks = long["frequency"].where(long["density"] == long["density"].max("bin"))
    axes.set_xlim(0, 2.2 * float(peaks.max().fillna(1.0)))
    channel = plain_text(result.words_of(spectra.attrs["channel"]))
    axes.set(xlabel="frequency [Hz]", ylabel=f"spectral density of {channel} [m²/Hz]")
    return figure


def draw_spectra(
    axes: Any,
    nominal: Sequence[tuple[str, Spectrum]],
    measured: Mapping[str, tuple[str, Sequence[Spectrum]]],
    regular: FloatArray,
) -> None:
    """Draw nominal spectra, the mean of measured ones, and the frequencies of regular waves."""
    for (label, curve), dash in zip(nominal, cycle("-:"), strict=False):
        axes.plot(*curve, label=label, color=COLOURS["measured"], linestyle=dash)
    for kind, (label, curves) in measured.items():
        if curves:  # at the frequencies of the first: records differ in length
            f, (colour, dash) = curves[0][0], WELCH[kind]
            mean = np.mean([np.interp(f, *each) for each in curves], axis=0)
            axes.plot(f, mean, label=label, color=colour, linestyle=dash)
    for number, frequency in enumerate(np.unique(regular.round(3))):
        axes.axvline(
            frequency,
            color=COLOURS["start"],
            linewidth=0.9,
            linestyle="--",
            label=None if number else "regular waves",
        )
    axes.set_ylim(bottom=0)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)
