"""Figures of checks: each draws a labelled result, on Axes that it is given or on a new figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.conventions import displayed
from seakeep.errors import RequestError
from seakeep.report.figures.common import grid_of_axes, short_label
from seakeep.report.style import COLOURS, LINES, PALETTE, figure_style, new_figure, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "coherence",
    "decay",
    "density",
    "drift",
    "exceedance",
    "modes",
    "residuals",
    "response",
    "validity",
]

NARROWEST = 7.5
"""Inches: a page stretches figures to its width, and a legend needs room."""
UNTRAINED: dict[str, Any] = {"color": PALETTE["light"], "alpha": 0.6, "linewidth": 0}
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
    if count == 0:
        raise RequestError("there is nothing to draw. Name at least one channel or state.")
    if axes is None:
        columns = -(-count // -(-count // most))
        rows = -(-count // columns)
        figure = new_figure(max(size[0] * columns, NARROWEST), 0.5 + size[1] * rows)
        return figure, grid_of_axes(figure, count, most)
    several = isinstance(axes, Sequence | np.ndarray)
    given: list[Any] = list(np.ravel(np.array(axes, dtype=object))) if several else [axes]
    if len(given) != count:
        raise RequestError(
            f"axes holds {len(given)} Axes and the figure draws {count} panels. Give as many, or "
            "none."
        )
    return given[0].figure, given


def _chosen(found: xr.Dataset, states: Sequence[str] | None) -> list[str]:
    known = [str(name) for name in found["state"].values]
    for name in () if states is None else states:
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
    chosen = _chosen(found, known if states is None else states)
    entry = "wave" if "wave" in found["input"] else str(found.attrs["reference"])
    at = found.sel(input=entry)
    with figure_style():
        figure, places = panels(axes, 2 * len(chosen), 2 + 2 * (len(chosen) % 2 == 0), (2.9, 1.75))
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
            legend_outside(figure, places[0], side="upper")
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
        if not at.sizes["point"]:
            continue
        style = {**mark, "linestyle": "none", "elinewidth": 0.8, "label": f"measured, {kind} waves"}
        for place, key, scale in ((gain, "amplitude", factor), (turn, "phase", 1.0)):
            place.errorbar(
                at["frequency"], scale * at[key], scale * at[f"{key}_uncertainty"], **style
            )


def legend_outside(figure: Any, *places: Any, side: str = "lower") -> None:
    unique: dict[str, Any] = {}
    for place in places:
        handles, labels = place.get_legend_handles_labels()
        unique |= dict(zip(labels, handles, strict=True))
    across = max(1, int(13 * figure.get_figwidth() / (6 + max(map(len, unique)))))  # letters
    figure.legend(
        unique.values(), unique, loc=f"outside {side} center", ncols=min(len(unique), across)
    )


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
                frequency, power / max(power.max(), 1e-300), color=PALETTE["light"], linewidth=0,
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
            legend_outside(figure, places[0])
    return figure


def modes(
    found: xr.Dataset, *, most: int = 12, axes: Sequence[Axes] | Axes | None = None
) -> Figure:
    """Draw the modes that decay slowest: which states take part, with period and damping.

    Parameters
    ----------
    found : Dataset
        From :func:`seakeep.check.modes`.
    most : int, optional
        Number of modes.
    axes : Axes, optional
        One; by default that of a new figure.

    Returns
    -------
    Figure
    """
    at = found.isel(mode=slice(0, most))
    states = [str(name) for name in at["state"].values]
    with figure_style():
        figure, (place,) = panels(
            axes, 1, 1, (2.8 + 0.5 * len(states), 0.9 + 0.24 * at.sizes["mode"])
        )
        shares = at["participation"].values
        picture = place.imshow(shares, cmap="Greys", vmin=0, vmax=1, aspect="auto")
        for (row, column), value in np.ndenumerate(shares):
            if value >= 0.05:
                style = {"ha": "center", "va": "center", "fontsize": 7}
                place.text(column, row, f"{value:.2f}", color="w" if value > 0.5 else "k", **style)
        place.set_xticks(range(len(states)), [short_label(name) for name in states])
        place.set_yticks(
            range(at.sizes["mode"]), [_mode_words(at.isel(mode=k)) for k in range(at.sizes["mode"])]
        )
        place.grid(False)
        place.set_ylabel("mode: period, damping ratio")
        figure.colorbar(picture, ax=place, label="participation [1]")
    return figure


def _mode_words(mode: xr.Dataset) -> str:
    period, ratio = float(mode["period"]), float(mode["damping_ratio"])
    if not np.isfinite(period):
        return f"decays in {float(mode['decay_time']):.3g} s"
    return f"{period:.3g} s, {ratio:.3f}"


def decay(found: xr.Dataset, *, axes: Sequence[Axes] | Axes | None = None) -> Figure:
    """Draw what is left of an offset after its release, motion by motion.

    Parameters
    ----------
    found : Dataset
        From :func:`seakeep.check.decay`.
    axes : Axes or sequence of Axes, optional
        One for each motion; by default those of a new figure.

    Returns
    -------
    Figure
    """
    motions = [str(name) for name in found["motion"].values]
    with figure_style():
        figure, places = panels(axes, len(motions), 3, (3.0, 1.8))
        for name, place in zip(motions, places, strict=True):
            own = found.sel(motion=name)
            left = own["displacement"].values
            place.axhline(0.0, color=COLOURS["input"], linewidth=0.6)
            place.plot(own["time"], left, **{**LINES["forecast"], "linestyle": "-"})
            moving = np.flatnonzero(np.abs(left) > 0.01)
            place.set_xlim(0, float(own["time"][min(moving[-1] + 2, left.size - 1)]))
            place.set_xlabel("time after the release [s]")
            place.set_ylabel(f"{short_label(name)} over offset [1]")
    return figure


def residuals(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Sequence[Axes] | Axes | None = None,
) -> Figure:
    """Draw correlations of one-step errors, the spectrum of free runs' errors, and their age.

    Parameters
    ----------
    found : Dataset
        From :func:`seakeep.check.residuals`.
    states : sequence of str, optional
        States to draw; by default all.
    axes : Axes or sequence of Axes, optional
        Four for each state; by default those of a new figure.

    Returns
    -------
    Figure
    """
    chosen = _chosen(found, states)
    grey = {"color": PALETTE["pale"], "linewidth": 0.8}
    with figure_style():
        figure, places = panels(axes, 4 * len(chosen), 4, (2.6, 1.75))
        for number, name in enumerate(chosen):
            own, (white, past, spectrum, age) = found.sel(state=name), places[4 * number :][:4]
            limit = float(own["limit"])
            white.axhspan(-limit, limit, **UNTRAINED)
            white.plot(own["lag"][1:], own["autocorrelation"][1:], **LINES["measured"])
            white.set(xlabel="lag [s]", ylabel="autocorrelation [1]")
            white.set_title(f"{short_label(name)}: errors of one step", loc="left", fontsize=8)
            if "input_correlation" in own:
                for each, line in zip(
                    own["input"].values, ("-", (0, (4, 1.5)), ":") * 9, strict=False
                ):
                    wide = float(own["input_limit"].sel(input=each))
                    past.axhspan(-wide, wide, **UNTRAINED)
                    style = {"color": COLOURS["measured"], "linewidth": 1.0, "linestyle": line}
                    values = own["input_correlation"].sel(input=each)
                    past.plot(own["lag"], values, **style, label=str(each))
            past.set(xlabel="lag of the input [s]", ylabel="correlation [1]")
            past.set_title("with past inputs", loc="left", fontsize=8)
            power = own["measured_spectrum"].values
            top = power.max() if power.max() > 0 else 1.0
            spectrum.semilogy(own["frequency"][1:], power[1:] / top, **grey, label="measured")
            error = own["error_spectrum"].values[1:] / top
            spectrum.semilogy(own["frequency"][1:], error, **LINES["forecast"], label="error")
            energy = found["measured_spectrum"].sum("state").values
            last = np.flatnonzero(energy > 1e-3 * energy.max())[-1]
            spectrum.set_xlim(0, 1.5 * float(own["frequency"][last]))
            spectrum.set_ylim(bottom=1e-6)
            spectrum.set(xlabel="frequency [Hz]", ylabel="power over peak [1]")
            spectrum.set_title("free runs", loc="left", fontsize=8)
            age.plot(own["age"], own["age_nrmse"], **LINES["forecast"])
            age.set_ylim(bottom=0)
            age.set(xlabel="age of the forecast [s]", ylabel="error [SD]")
        if axes is None:
            legend_outside(figure, *places[1:3], side="upper")
        else:
            for place in (past, spectrum):
                place.legend(fontsize=6)
    return figure


def by_state(
    found: xr.Dataset,
    states: Sequence[str] | None,
    axes: Sequence[Axes] | Axes | None,
    height: float,
    draw: Callable[[Any, xr.Dataset, float, str], None],
) -> Figure:
    """A panel for each state: `draw` takes Axes, the state's results, factor and unit to show."""
    chosen = _chosen(found, states)
    with figure_style():
        figure, places = panels(axes, len(chosen), 3, (3.0, height))
        for name, place in zip(chosen, places, strict=True):
            own = found.sel(state=name)
            factor, units = displayed(str(own["units"].values))
            draw(place, own, factor, shown_unit(units) or "?")
        if axes is None:
            legend_outside(figure, places[0])
    return figure


def exceedance(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Sequence[Axes] | Axes | None = None,
) -> Figure:
    """Draw how often peaks exceed a level, measured and forecast, beside Rayleigh and Weibull.

    Parameters
    ----------
    found : Dataset
        From :func:`seakeep.check.statistics`.
    states : sequence of str, optional
        States to draw; by default all.
    axes : Axes or sequence of Axes, optional
        One for each state; by default those of a new figure.

    Returns
    -------
    Figure
    """
    return by_state(found, states, axes, 2.0, _exceedance)


def _exceedance(place: Any, own: xr.Dataset, factor: float, unit: str) -> None:
    measured = own.sel(kind="measured")
    largest = float(np.nanmax(own["peak"], initial=0.0))
    level = np.linspace(0, 1.1 * largest or 1.0, 200)
    thin = {"color": COLOURS["input"], "linewidth": 0.9}
    if (spread := float(measured["rayleigh_scale"])) > 0:
        rayleigh = np.exp(-0.5 * (level / spread) ** 2)
        place.semilogy(factor * level, rayleigh, **thin, linestyle=":", label="Rayleigh")
    k, b = float(measured["weibull_shape"]), float(measured["weibull_scale"])
    if np.isfinite(k):
        weibull = np.exp(-((level / b) ** k))
        place.semilogy(factor * level, weibull, **thin, label="Weibull of the measured")
    for kind, mark, face in (
        ("measured", "o", "none"),
        ("forecast", "x", LINES["forecast"]["color"]),
    ):
        at = own.sel(kind=kind)
        style = {"marker": mark, "markersize": 3, "linestyle": "none", "markerfacecolor": face}
        peak, colour = factor * at["peak"], LINES[kind]["color"]
        place.semilogy(peak, at["exceedance"], color=colour, **style, label=kind)
    place.set_ylim(0.3 / max(int(own["peaks"].max()), 1), 1.3)
    place.set_xlim(0, factor * level[-1])
    place.set_xlabel(f"peak of {short_label(str(own['state'].values))} [{unit}]")
    place.set_ylabel("exceeded by [1]")


def density(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Sequence[Axes] | Axes | None = None,
) -> Figure:
    """Draw the densities of states, measured and forecast; arguments as :func:`exceedance`."""
    return by_state(found, states, axes, 1.9, _density)


def _density(place: Any, own: xr.Dataset, factor: float, unit: str) -> None:
    for kind in ("measured", "forecast"):
        height = own["density"].sel(kind=kind) / factor
        place.plot(factor * own["deviation"], height, **LINES[kind], label=kind)
    place.set_ylim(bottom=0)
    place.set_xlabel(f"{short_label(str(own['state'].values))} from its mean [{unit}]")
    place.set_ylabel(f"density [1/{unit}]")


def validity(found: xr.Dataset, *, axes: Sequence[Axes] | Axes | None = None) -> Figure:
    """Draw height against period of the waves, and steepness against mean surge where it is known.

    Parameters
    ----------
    found : Dataset
        From :func:`seakeep.check.validity`.
    axes : Axes or sequence of Axes, optional
        One, or two with surge; by default those of a new figure.

    Returns
    -------
    Figure
    """
    maps = [("period", "mean zero-crossing period [s]", "height", "wave height [m]")]
    if (found["drift"].notnull() & found["steepness"].notnull()).any():
        maps.append(("drift", "mean surge [m]", "steepness", "wave steepness [1]"))
    outside = found["outside"].values != ""
    train, test = (found.sel(part=each) for each in ("train", "test"))
    kinds = (
        (train, "trained", {"marker": "o", "markersize": 11, "color": PALETTE["pale"]}),
        (test.isel(run=~outside), "test, inside", {"marker": "s", "color": COLOURS["ensemble"]}),
        (test.isel(run=outside), "test, outside", {"marker": "X", "color": COLOURS["forecast"]}),
    )
    with figure_style():
        figure, places = panels(axes, len(maps), 2, (3.75, 2.8))
        for place, (x, across, y, up) in zip(places, maps, strict=True):
            for at, label, style in kinds:
                if at[y].notnull().any():
                    place.plot(at[x], at[y], linestyle="none", label=label, **style)
            for run in test["run"].values[outside]:
                spot = tuple(float(test[key].sel(run=run)) for key in (x, y))
                if np.isfinite(spot).all():
                    style = {"textcoords": "offset points", "fontsize": 7}
                    place.annotate(str(run), spot, (6, 4), **style)
            place.set(xlabel=across, ylabel=up)
            place.margins(x=0.15)
            place.set_ylim(0, 1.2 * float(found[y].max()))
        if axes is None:
            legend_outside(figure, places[0])
    return figure


def drift(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Sequence[Axes] | Axes | None = None,
) -> Figure:
    """Draw mean drift and slow response per amplitude squared, offsets of regular runs beside.

    Parameters
    ----------
    found : Dataset
        From :func:`seakeep.check.drift`.
    states : sequence of str, optional
        States to draw; by default those that have a response.
    axes : Axes or sequence of Axes, optional
        One for each state; by default those of a new figure.

    Returns
    -------
    Figure
    """
    known = found["state"].values[found["slow_response"].notnull().any(["difference", "frequency"])]
    chosen = _chosen(found, [str(name) for name in known] if states is None else states)
    with figure_style():
        figure, places = panels(axes, len(chosen), 3, (3.0, 2.0))
        for name, place in zip(chosen, places, strict=True):
            own = found.sel(state=name)
            factor, units = displayed(str(own["units"].values))
            place.axhline(0.0, color=COLOURS["input"], linewidth=0.5)
            line = {**LINES["forecast"], "linestyle": "-", "label": "model, mean"}
            place.plot(own["frequency"], factor * own["slow_response"][0], **line)
            dashes = ((0, (4, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)), (0, (8, 2)))
            for number, dash in zip(range(1, own.sizes["difference"]), dashes, strict=False):
                at = own.isel(difference=number)
                style = {"color": COLOURS["ensemble"], "linewidth": 0.9, "linestyle": dash}
                label = f"model, difference {float(at['difference']):.3g} Hz"
                place.plot(at["frequency"], factor * at["slow_response"], **style, label=label)
            if "offset" in own:
                style = {**MARKS["regular"], "linestyle": "none", "elinewidth": 0.8}
                sure = factor * own["offset_uncertainty"]
                offset = factor * own["offset"]
                label = "measured, regular waves"
                place.errorbar(own["point_frequency"], offset, sure, **style, label=label)
            place.set_xlabel("frequency [Hz]")
            place.set_ylabel(f"{short_label(name)} [{shown_unit(units) or '?'}]")
        if axes is None:
            legend_outside(figure, places[0])
    return figure
