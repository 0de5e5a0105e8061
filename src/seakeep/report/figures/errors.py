"""Errors: of cells, runs, members and settings, over the age of a forecast, and densities."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from seakeep.arrays import Datasets, FloatArray
from seakeep.report.style import (
    COLOURS,
    DASHED,
    HEADING,
    PALETTE,
    SERIES,
    WIDEST,
    Figure,
    Places,
    figure_style,
    judged_models,
    legend_outside,
    line_of,
    model_words,
    new_figure,
    panels,
    plain_text,
    short_label,
    wrapped,
)
from seakeep.report.tables import ratio_of
from seakeep.study import StudyResult
from seakeep.study.judge import average_of

FEWEST = 10
"""Values from which on a density is drawn; of fewer, points and box alone."""
HATCHES = ("", "////", "----", "xxxx", "\\\\\\\\", "....", "||||", "++++")
"""Of the boxes of one model after the other."""
JITTER = np.random.default_rng(7).uniform(-1, 1, 4096)
"""Sideways places of the single values; the same in every figure."""
DECADE = 10.0
"""Ratio of the channels' medians from which on an axis is logarithmic."""
BAND_WORDS = {"all": "all frequencies", "low": "low frequencies", "wave": "wave frequencies"}
"""Bands of ε(t)."""
LOWEST = 0.8
"""Modulus at which the axis ends; what lies below dies out within a few samples."""


def average_boxes(result: StudyResult, tests: Sequence[str]) -> Figure:
    """Averages (ANRMSE, NAMMAE) of all cells of some test sets, a box-violin per model."""
    figure = new_figure(max(8.5, 2.0 + 1.7 * len(tests)), 3.6)
    places = figure.subplots(1, len(HEADING))
    labels = [plain_text(wrapped(result.label_of(test))) for test in tests]
    for axes, (measure, heading) in zip(places, HEADING.items(), strict=True):
        columns = {
            model: [average_of(result.errors(test, model, measure)) for test in tests]
            for model in result.models
        }
        _draw_boxes(axes, result, columns, labels, heading)
    legend_outside(axes, side="upper right")
    return figure


def channel_boxes(result: StudyResult, test: str) -> Figure:
    """Measures (NRMSE, NAMMAE) of all cells of a test set, channel by channel."""
    figure = new_figure(8.5, 2.8 * len(HEADING))
    models, labels = judged_models(result), list(map(short_label, result.channels))
    errors = [[result.errors(test, model, measure) for model in models] for measure in HEADING]
    scale = "log" if any(_spans_decades(np.concatenate(cells)) for cells in errors) else "linear"
    for axes, measure, cells in zip(
        figure.subplots(len(HEADING), 1, sharex=True), HEADING, errors, strict=True
    ):
        axes.set_yscale(scale)
        columns = {model: [*each.T] for model, each in zip(models, cells, strict=True)}
        _draw_boxes(axes, result, columns, labels, measure.upper())
    legend_outside(axes, side="upper right")
    return figure


def _spans_decades(cells: FloatArray) -> bool:
    """Whether the channels' medians differ by so much that a common axis would hide most."""
    medians = pd.DataFrame(cells).where(np.isfinite(cells)).median()
    return bool(medians.max() > DECADE * medians.median())


def _draw_boxes(
    axes: Any,
    result: StudyResult,
    columns: Mapping[str, Sequence[FloatArray]],
    labels: Sequence[str],
    heading: str,
) -> None:
    """Draw the box-violins of models beside each other at each label.

    Hatches set models apart in grey print. A logarithmic axis shows no violin, and no values that
    are not positive.
    """
    logarithmic, tallest, whole = axes.get_yscale() == "log", 0.0, 0.84 / len(columns)
    width = 0.92 * whole
    for number, (model, of_model) in enumerate(columns.items()):
        colour = line_of(result, model)["color"]
        line = {"color": colour, "linewidth": 0.9}
        box = {"facecolor": "white", "edgecolor": colour, "alpha": 0.75}
        box |= {"hatch": HATCHES[number % len(HATCHES)], "label": model_words(model)}
        for column, values in enumerate(of_model):
            place = column + whole * (number - 0.5 * (len(columns) - 1))
            x = values[np.isfinite(values) & (not logarithmic or values > 0)]
            if x.size == 0:
                continue
            sideways = place + 0.16 * width * np.resize(JITTER, x.size)
            axes.scatter(
                sideways, x, s=7, color=colour, alpha=0.5, linewidths=0, rasterized=True, zorder=2
            )
            if x.size >= FEWEST and np.ptp(x) > 0 and not logarithmic:
                violin = axes.violinplot([x], [place], widths=width, showextrema=False, points=120)
                for body in violin["bodies"]:
                    body.set(facecolor=colour, edgecolor=colour, alpha=0.18, linewidth=0.6)
            drawn = axes.boxplot(
                [x], positions=[place], widths=0.26 * width, capwidths=0.16 * width,
                showfliers=False, patch_artist=True, manage_ticks=False, zorder=3, boxprops=box,
                whiskerprops=line, capprops=line,
                medianprops={"color": colour, "linewidth": 1.8, "solid_capstyle": "butt"},
            )  # fmt: skip
            tallest = max(tallest, drawn["whiskers"][1].get_ydata()[1])
    axes.set_xticks(range(len(labels)), labels)
    axes.set_xlim(-0.6, len(labels) - 0.4)
    axes.set_ylabel(f"{heading} [measured SD]")
    axes.grid(axis="x", visible=False)
    if logarithmic:
        _logarithmic(axes)
    elif 0 < 3 * tallest < axes.get_ylim()[1]:
        axes.set_ylim(0, 1.15 * tallest)
        axes.set_title("values above the axis are not shown", loc="right", fontsize=7)
    else:
        axes.set_ylim(bottom=0)


def _logarithmic(axes: Any) -> None:
    """Make the axis of errors logarithmic, with numbers that can be read, and say so."""
    from matplotlib.ticker import LogLocator, NullFormatter

    axes.set_yscale("log")
    low, high = axes.dataLim.intervaly * (0.8, 1.25)
    axes.set_ylim(low, high)
    if high < 100.0 * low:
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_title("logarithmic axis", loc="right", fontsize=7)


def error_over_time_figure(result: StudyResult) -> Figure:
    """ε(t) of each test set, whole and in bands: mean over all cells with its quartiles."""
    tests, models = list(result.tests), judged_models(result)
    lines = {model: line_of(result, model) for model in models}
    figure = new_figure(8.5, 0.7 + 2.1 * len(tests))
    grid = figure.subplots(len(tests), len(BAND_WORDS), squeeze=False, sharey="row")
    for row, test in zip(grid, tests, strict=True):
        trend = result.groups["statistics/trend"].sel(test=test)
        time = trend["time"].values / result.encounter_period
        tallest = float(trend["error_mean"].sel(model=models).max())
        for axes, (band, words) in zip(row, BAND_WORDS.items(), strict=True):
            for model, line in lines.items():
                at = trend.sel(band=band, model=model)
                quartiles = (at[f"{side}_quartile"] for side in ("lower", "upper"))
                axes.fill_between(time, *quartiles, color=line["color"], alpha=0.15, linewidth=0)
                label = f"{model_words(model)}, growth {ratio_of(at).growth()}"
                axes.plot(time, at["error_mean"], label=label, **line)
            axes.set_title(words)
            axes.legend(fontsize=6.5, loc="upper left")
        row[0].set_ylim(0, 1.6 * tallest if tallest > 0 else None)
        label = plain_text(wrapped(result.label_of(test), WIDEST))
        row[0].set_ylabel(f"{label}\nε [measured SD]")
    for axes in grid[-1]:
        axes.set_xlabel("time in encounter periods")
    return figure


def density_figure(result: StudyResult, model: str) -> Figure:
    """Density of each channel, measured and predicted, each with its 95 % band."""
    data = result.groups["statistics/densities"].sel(model=model)
    colour = line_of(result, model)["color"]
    sides = (
        ("measured", "measured", COLOURS["measured"], "-"),
        ("predicted", model_words(model), colour, DASHED),
    )
    figure, places = panels(None, len(result.channels), 4, (2.125, 1.75))
    for axes, name in zip(places, result.channels, strict=True):
        curves = data.sel(channel=name)
        weighted = curves["value"].weighted(curves["measured_mean"])
        spread = weighted.std()
        z = (curves["value"] - weighted.mean()) / spread
        highest = np.fmax(curves["measured_upper"], curves["predicted_upper"])
        seen = z[highest > 1e-3 * highest.max()]  # of all models, one may have run away
        axes.set_xlim(seen[0], seen[-1])
        for key, words, tint, dash in sides:
            lower, mean, upper = (spread * curves[f"{key}_{k}"] for k in ("lower", "mean", "upper"))
            axes.fill_between(z, lower, upper, color=tint, alpha=0.22, linewidth=0)
            axes.plot(z, mean, color=tint, linestyle=dash, linewidth=1.3, label=words)
        axes.set_title(short_label(name), fontsize=10, pad=2)
        axes.set_yticks([])
        axes.set_ylim(bottom=0)
        axes.set_xlabel("measured SD from the mean", fontsize=7)
        axes.tick_params(labelsize=7)
    legend_outside(places[0], side="upper right")
    return figure


def eigenvalue_figure(result: StudyResult) -> Figure:
    """Eigenvalues of each model of the first training set, for an ensemble those of its members."""
    figure = new_figure(8.5, 3.0)
    plane, decay = figure.subplots(1, 2)
    circle = np.exp(1j * np.linspace(0, np.pi, 400))
    plane.plot(circle.real, circle.imag, color=PALETTE["slate"], linewidth=0.8)
    for model in sorted(judged_models(result), key=lambda model: model not in result.ensembles):
        data, single = result.groups[f"eigenvalues/{model}"], model not in result.ensembles
        values = (data["real"].values + 1j * data["imag"].values).ravel()
        values = values[np.isfinite(values) & (values.imag >= 0)]
        style = {
            "s": 9 if single else 5,
            "color": line_of(result, model)["color"],
            "alpha": 0.9 if single else np.clip(12 / data.sizes["member"], 0.12, 0.6),
            "linewidths": 0,
            "rasterized": True,
            "label": model_words(model),
        }
        plane.scatter(values.real, values.imag, **style)
        decay.scatter(np.angle(values) / (2 * np.pi * result.dt), np.abs(values), **style)
    plane.set(aspect="equal", ylim=(0, 1.05), xticks=[-1.0, -0.5, 0.0, 0.5, 1.0])
    plane.set(xlabel="real part", ylabel="imaginary part")
    decay.axhline(1.0, color=PALETTE["slate"], linewidth=0.8)
    decay.set(xlabel="frequency [Hz]", ylabel="modulus", ylim=(LOWEST, 1.01))
    decay.set_xlim(0, 3 / result.encounter_period)
    legend = legend_outside(decay, side="upper right", markerscale=2)
    for handle in legend.legend_handles:
        handle.set_alpha(0.9)
    return figure


@figure_style()
def errors(table: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw the NRMSE of each channel with its interval, run by run.

    Parameters
    ----------
    table : Dataset
        From :func:`seakeep.study.comparison_table`.
    axes : Axes, optional
        One; by default that of a new figure.

    Returns
    -------
    Figure
    """
    labels = list(map(short_label, table["channel"].values))
    figure, (place,) = panels(axes, 1, 1, (max(4.0, 1.2 + 0.9 * len(labels)), 2.8))
    _draw_points(place, table.transpose("run", ...), "run", "nrmse", labels)
    place.set_ylim(bottom=0)
    place.set_ylabel("NRMSE [SD], 95 %")
    if axes is None and table.sizes["run"] > 1:
        legend_outside(place)
    return figure


@figure_style()
def error_figure(table: xr.Dataset) -> Figure:
    """ANRMSE of each model in each run with its interval, by wave period.

    The table is that of :func:`seakeep.study.difference_table`.
    """
    table = table.sortby("wave_period")
    labels = [
        plain_text(wrapped(str(run))) + (f"\n{period:.3g} s" if np.isfinite(period) else "")
        for run, period in table["wave_period"].to_series().items()
    ]
    figure = new_figure(max(4.5, 1.5 + 0.9 * len(labels)), 3.4)
    axes = figure.subplots()
    _draw_points(axes, table, "model", "anrmse", labels)
    if 0.0 < 10.0 * table["anrmse"].min() < table["anrmse"].max():
        _logarithmic(axes)
    else:
        axes.set_ylim(bottom=0.0)
    where = " at full scale" * ("scale_factor" in table)
    axes.set(xlabel=f"run, and mean period of its waves{where}", ylabel="ANRMSE [SD], 95 %")
    legend_outside(axes)
    return figure


def _draw_points(axes: Any, table: xr.Dataset, dim: str, key: str, labels: Sequence[str]) -> None:
    """Draw an error with its interval at each label, entries of a dimension beside each other."""
    names = table[dim].values.tolist()
    for number, name in enumerate(names):
        at = table.sel({dim: name})
        reach = [np.abs(at[f"{key}_{bound}"] - at[key]) for bound in ("lower", "upper")]
        place = np.arange(len(labels)) + 0.7 * ((number + 0.5) / len(names) - 0.5)
        again, kind = divmod(number, len(SERIES))
        style = {**SERIES[kind], "linestyle": "none", "elinewidth": 0.9}
        style["fillstyle"] = "none" if again else "full"
        axes.errorbar(place, at[key], reach, label=plain_text(name), markersize=4, **style)
    axes.set_xticks(range(len(labels)), labels, fontsize=7)


@figure_style()
def nowcast_figure(nowcasts: Datasets, run: str) -> Figure:
    """Error, and the model's own estimate of it, against lead time, a panel per channel."""
    first = next(iter(nowcasts.values()))
    names, share = first["channel"].values, first.attrs["share"]
    figure, places = panels(None, len(names), 4, (2.125, 1.7))
    for axes, name in zip(places, names, strict=True):
        for number, (model, of_model) in enumerate(nowcasts.items()):
            at, style = of_model.sel(run=run, channel=name), SERIES[1 + number % (len(SERIES) - 1)]
            lines: dict[str, dict[str, Any]] = {
                "error": {"linestyle": style["linestyle"] if number else "-"},
                "claimed": {"linewidth": 0.7, "alpha": 0.7},
            }
            for key, line in lines.items():
                label = plain_text(f"{model}: {key}")
                axes.plot(at["lead"], at[key], color=style["color"], label=label, **line)
        axes.axhline(share, color="0.4", linewidth=0.8, linestyle=":", label=f"{share:g} SD")
        axes.set_title(short_label(name))
        axes.set(xlim=(0, first["lead"].max()), xlabel="lead time [s]")
        axes.set_ylim(bottom=0)
        if axes.get_subplotspec().is_first_col():
            axes.set_ylabel("error [training SD]")
    legend_outside(places[0], side="upper right")
    figure.suptitle(plain_text(run), x=0.01, ha="left")
    return figure


@figure_style()
def tuning_figure(table: xr.Dataset) -> Figure:
    """Draw the table of :func:`seakeep.tune`.

    Parameters
    ----------
    table : Dataset
        Over ``trial``: settings, ``ridge``, ``score``, ``lower``, ``upper``, ``chosen``.

    Returns
    -------
    Figure
        One line per candidate with its 95 % intervals; the choice is marked.
    """
    keys = ("kind", "observables", "lead", "state_delays", "input_delays", "alignment", "memory")
    varied = [key for key in keys if len(np.unique(table[key].values)) > 1]
    names = [
        ", ".join(f"{key.replace('_', ' ')} {table[key].values[row]}" for key in varied) or "error"
        for row in range(table.sizes["trial"])
    ]
    figure = new_figure(7.0, 4.2)
    axes = figure.subplots()
    for number, name in enumerate(dict.fromkeys(names)):
        part = table.isel(trial=np.array(names) == name)
        line = {**SERIES[number % len(SERIES)], "linestyle": "-"}
        axes.semilogx(part["ridge"], part["score"], **line, markersize=4, label=name)
        axes.fill_between(
            part["ridge"], part["lower"], part["upper"], color=line["color"], alpha=0.12
        )
    best = table.isel(trial=table["chosen"].values)
    axes.semilogx(
        best["ridge"],
        best["score"],
        "o",
        markersize=11,
        fillstyle="none",
        color="k",
        label=f"chosen: {names[table['chosen'].values.argmax()]}" if varied else "chosen",
    )
    axes.set(xlabel="ridge per snapshot pair [1]", ylabel="mean NRMSE of free runs [SD], 95 %")
    legend_outside(axes)
    return figure
