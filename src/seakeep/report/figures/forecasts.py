"""Figures of forecasts: each draws a labelled result, on Axes that it is given or a new figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.conventions import displayed
from seakeep.errors import RequestError
from seakeep.models import summarize
from seakeep.report.figures.checks import panels
from seakeep.report.figures.common import FURTHER, legend_outside, short_label
from seakeep.report.style import COLOURS, LINES, THIN, axis_label, figure_style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from seakeep.report.figures.checks import Places

__all__ = ["band", "errors", "overlay"]


def overlay(
    forecast: xr.Dataset,
    measured: xr.Dataset,
    *,
    channels: Sequence[str] | None = None,
    axes: Places = None,
) -> Figure:
    """Draw a forecast over the measurement.

    Parameters
    ----------
    forecast : Dataset
        From :meth:`seakeep.HankelDMDcModel.forecast`.
    measured : Dataset
        The run; the instants of the forecast are drawn.
    channels : sequence of str, optional
        Channels to draw; by default all of the forecast.
    axes : Axes or sequence of Axes, optional
        One for each channel; by default those of a new figure.

    Returns
    -------
    Figure
    """
    return _histories(forecast, None, measured, channels, axes)


def band(
    forecast: xr.Dataset,
    measured: xr.Dataset,
    *,
    level: float = 0.95,
    channels: Sequence[str] | None = None,
    axes: Places = None,
) -> Figure:
    """Draw the band of an ensemble and its mean over the measurement.

    Parameters
    ----------
    forecast : Dataset
        From :meth:`seakeep.models.HankelEnsemble.forecast` (its members) or ``forecast_summary``.
    measured, channels, axes
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
    return _histories(forecast.sel(statistic="mean"), forecast, measured, channels, axes)


def _histories(
    forecast: xr.Dataset,
    bounds: xr.Dataset | None,
    measured: xr.Dataset,
    channels: Sequence[str] | None,
    axes: Places,
) -> Figure:
    for data, what in ((forecast, "forecast"), (measured, "measured")):
        if (
            "time" not in data.coords
            or data["time"].dtype.kind not in "fiu"
            or not data["time"].size
        ):
            raise RequestError(
                f"{what} has no instants in seconds in a coordinate 'time'. Coordinates: "
                f"{', '.join(map(str, data.coords)) or 'none'}."
            )
    known = [str(name) for name, each in forecast.data_vars.items() if "time" in each.dims]
    chosen = known if channels is None else list(channels)
    for name in chosen:
        for data, what in ((forecast, "forecast"), (measured, "measured")):
            if name not in data:
                listed = ", ".join(map(str, data.data_vars))
                raise RequestError(f"{what} has no channel '{name}'. Channels: {listed}.")
            if data[name].dims != ("time",) or data[name].dtype.kind not in "fiub":
                raise RequestError(
                    f"channel '{name}' of {what} holds {data[name].dtype} over "
                    f"({', '.join(map(str, data[name].dims))}), and numbers over time are drawn. "
                    "Draw an ensemble with seakeep.plot.band, and windows one by one."
                )
    time = forecast["time"].values
    at = measured.sel(time=slice(time[0] - 1e-6, time[-1] + 1e-6))
    key = "forecast" if bounds is None else "ensemble"
    with figure_style():
        figure, places = panels(axes, len(chosen), 1, (7.5, 1.45))
        for name, place in zip(chosen, places, strict=True):
            attrs = measured[name].attrs
            factor, units = displayed(str(attrs.get("units", "")))
            if bounds is not None:
                sides = (factor * bounds[name].sel(statistic=each) for each in ("lower", "upper"))
                style: dict[str, Any] = {"color": COLOURS["ensemble"], "alpha": 0.35}
                place.fill_between(time, *sides, linewidth=0, **style, label="band")
            line = LINES["measured"] if bounds is None else THIN
            place.plot(at["time"], factor * at[name], **line, label="measured")
            label = "forecast" if bounds is None else "mean"
            place.plot(time, factor * forecast[name], **LINES[key], label=label)
            place.set_ylabel(axis_label(name, units, attrs.get("long_name")), fontsize=8)
            place.margins(x=0.01)
            place.set_xlabel("time [s]" if place is places[-1] else "")
        if axes is None:
            figure.align_ylabels(places)
            legend_outside(figure, places[0])
    return figure


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
    channels = [str(name) for name in table["channel"].values]
    runs = [str(run) for run in table["run"].values]
    width = 0.6 / max(len(runs), 1)
    with figure_style():
        figure, (place,) = panels(axes, 1, 1, (max(4.0, 1.2 + 0.8 * len(channels)), 2.8))
        for number, run in enumerate(runs):
            at = table.sel(run=run)
            middle = at["nrmse"].values
            bounds = [at[f"nrmse_{each}"].values for each in ("lower", "upper")]
            reach = np.abs(np.stack(bounds) - middle)
            x = np.arange(len(channels)) + width * (number - 0.5 * (len(runs) - 1))
            style = {"marker": "osD^vP*X"[number % 8], "markersize": 4, "linestyle": "none"}
            colour = FURTHER[number % len(FURTHER)]
            place.errorbar(x, middle, reach, color=colour, elinewidth=0.9, **style, label=run)
        place.set_xticks(range(len(channels)), [short_label(name) for name in channels])
        place.set_ylim(bottom=0)
        place.set_ylabel("NRMSE [SD], 95 % intervals")
        if axes is None and len(runs) > 1:
            legend_outside(figure, place)
    return figure
