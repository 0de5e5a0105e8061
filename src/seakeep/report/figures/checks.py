"""Figures of checks: each draws a labelled result, on Axes that it is given or on a new figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.conventions import displayed
from seakeep.errors import RequestError
from seakeep.report.figures.common import grid_of_axes, short_label
from seakeep.report.style import COLOURS, LINES, figure_style, new_figure, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["coherence", "response"]

UNTRAINED: dict[str, Any] = {"color": "#DDDDDD", "alpha": 0.6, "linewidth": 0}
MARKS: dict[str, dict[str, Any]] = {
    "regular": {"color": COLOURS["measured"], "marker": "o", "markersize": 5, "zorder": 4},
    "irregular": {
        "color": COLOURS["input"],
        "marker": "s",
        "markersize": 3,
        "markerfacecolor": "none",
        "zorder": 3,
    },
}
"""Measured points: filled and open, so that grey print tells them apart."""


def panels(
    axes: Sequence[Axes] | Axes | None, count: int, most: int, size: tuple[float, float]
) -> tuple[Figure, list[Any]]:
    """Axes that are given, as many as needed, or those of a new figure; `size` is that of one."""
    if axes is None:
        columns = -(-count // -(-count // most))
        rows = -(-count // columns)
        figure = new_figure(size[0] * columns, 0.5 + size[1] * rows)
        return figure, grid_of_axes(figure, count, most)
    given = list(np.ravel(np.asarray(axes, dtype=object)))
    if len(given) != count:
        raise RequestError(
            f"axes holds {len(given)} Axes and the figure draws {count} panels. Give as many, or "
            "none."
        )
    return given[0].figure, given


def _chosen(found: xr.Dataset, states: Sequence[str] | None) -> list[str]:
    known = [str(name) for name in found["state"].values]
    for name in states or ():
        if name not in known:
            raise RequestError(f"there is no state '{name}'. States: {', '.join(known)}.")
    return known if states is None else list(states)


def response(
    found: xr.Dataset,
    measured: xr.Dataset | None = None,
    *,
    states: Sequence[str] | None = None,
    axes: Sequence[Axes] | Axes | None = None,
) -> Figure:
    """Draw amplitude and phase of the response per wave amplitude, measured points beside.

    Parameters
    ----------
    found : Dataset
        From :func:`seakeep.check.response`.
    measured : Dataset, optional
        From :func:`seakeep.check.measured_response`.
    states : sequence of str, optional
        States to draw; by default those that have a response.
    axes : Axes or sequence of Axes, optional
        Two for each state, amplitude and phase; by default those of a new figure.

    Returns
    -------
    Figure
    """
    known = [
        str(s) for s in found["state"].values if found["amplitude"].sel(state=s).notnull().any()
    ]
    chosen = _chosen(found, states or known)
    entry = "wave" if "wave" in found["input"] else str(found.attrs["reference"])
    at = found.sel(input=entry)
    with figure_style():
        figure, places = panels(axes, 2 * len(chosen), 4, (2.9, 1.75))
        for name, gain, turn in zip(chosen, places[::2], places[1::2], strict=True):
            own = at.sel(state=name)
            factor, units = displayed(str(own["units"].values))
            for place in (gain, turn):
                _shade(place, at["frequency"].values, ~at["trained"].values)
            line = {**LINES["forecast"], "label": "model"}
            gain.plot(own["frequency"], factor * own["amplitude"], **line)
            turn.plot(own["frequency"], _broken(own["phase"].values), **line)
            if "amplitude_lower" in own:
                bounds = (factor * own[f"amplitude_{each}"] for each in ("lower", "upper"))
                band = {"color": LINES["forecast"]["color"], "alpha": 0.25, "linewidth": 0}
                gain.fill_between(own["frequency"], *bounds, **band, label="95 % of the members")
            if measured is not None:
                _points(gain, turn, measured.sel(state=name), factor)
            inside = own["amplitude"].values[at["trained"].values]
            gain.set_ylim(0, 1.25 * factor * inside.max() if inside.size else None)
            gain.set_ylabel(f"{short_label(name)} [{shown_unit(units) or '?'}]")
            turn.set_ylabel(f"phase of {short_label(name)} [°]")
            turn.set_ylim(-190, 190)
            turn.set_yticks([-180, -90, 0, 90, 180])
            for place in (gain, turn):
                place.set_xlim(float(found["frequency"][0]), float(found["frequency"][-1]))
                place.set_xlabel("frequency [Hz]")
        if axes is None:
            _legend_below(figure, places[0])
    return figure


def _shade(place: Any, frequency: Any, untrained: Any) -> None:
    """Grey where the training input holds no energy."""
    transform = place.get_xaxis_transform()
    label = "no energy in training"
    place.fill_between(
        frequency, 0, 1, where=untrained, transform=transform, step="mid", label=label, **UNTRAINED
    )


def _broken(phase: Any) -> Any:
    """Phase in degrees, NaN where it wraps, so that no line runs across."""
    out = phase.copy()
    out[1:][np.abs(np.diff(phase)) > 180] = np.nan
    return out


def _points(gain: Any, turn: Any, measured: xr.Dataset, factor: float) -> None:
    for kind, mark in MARKS.items():
        at = measured.isel(point=np.flatnonzero(measured["kind"].values == kind))
        sure = at["amplitude_uncertainty"].values < at["amplitude"].values
        at = at.isel(point=np.flatnonzero(sure))  # the rest is noise
        style = {**mark, "linestyle": "none", "elinewidth": 0.8, "label": f"measured, {kind} waves"}
        for place, key, scale in ((gain, "amplitude", factor), (turn, "phase", 1.0)):
            place.errorbar(
                at["frequency"], scale * at[key], scale * at[f"{key}_uncertainty"], **style
            )


def _legend_below(figure: Any, place: Any) -> None:
    handles, labels = place.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(unique.values(), unique, loc="outside lower center", ncols=min(len(unique), 5))


def coherence(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Sequence[Axes] | Axes | None = None,
) -> Figure:
    """Draw the coherence of each state with the inputs, over the state's own spectrum.

    Parameters
    ----------
    found : Dataset
        From :func:`seakeep.check.coherence`.
    states : sequence of str, optional
        States to draw; by default all.
    axes : Axes or sequence of Axes, optional
        One for each state; by default those of a new figure.

    Returns
    -------
    Figure
    """
    chosen = _chosen(found, states)
    frequency = found["frequency"].values
    with figure_style():
        figure, places = panels(axes, len(chosen), 3, (3.0, 1.9))
        energy = found["spectrum"].sum("state").values
        top = frequency[np.flatnonzero(energy > 1e-3 * energy.max())[-1]]
        for name, place in zip(chosen, places, strict=True):
            own = found.sel(state=name)
            power = own["spectrum"].values
            place.fill_between(
                frequency, power / max(power.max(), 1e-300), color="#DDDDDD", linewidth=0,
                label="spectrum of the state",
            )  # fmt: skip
            for each in own["input"].values:
                style = {"color": COLOURS["input"], "linewidth": 0.7, "alpha": 0.8}
                ordinary = own["ordinary"].sel(input=each)
                place.plot(frequency, ordinary, **style, label="with one input")
            line = {**LINES["measured"], "label": "with all inputs"}
            place.plot(frequency, own["multiple"], **line)
            if "multiple_observables" in own:
                line = {**LINES["forecast"], "label": "with observables too"}
                place.plot(frequency, own["multiple_observables"], **line)
            place.set(xlim=(0, top), ylim=(0, 1.02), xlabel="frequency [Hz]")
            place.set_ylabel(f"coherence, {short_label(name)} [1]")
        if axes is None:
            _legend_below(figure, places[0])
    return figure
