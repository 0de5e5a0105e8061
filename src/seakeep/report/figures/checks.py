"""Figures of checks: each draws a labelled result, on Axes that it is given or on a new figure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from seakeep.conventions import displayed
from seakeep.errors import RequestError
from seakeep.report.figures.common import grid_of_axes, legend_outside, short_label
from seakeep.report.style import COLOURS, LINES, PALETTE, figure_style, new_figure, shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    Places = Sequence[Axes] | Axes | None

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
    axes: Places, count: int, most: int, size: tuple[float, float]
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


def by_state(
    found: xr.Dataset,
    states: Sequence[str] | None,
    axes: Places,
    size: tuple[float, float],
    draw: Callable[..., None],
    each: int = 1,
    most: int = 3,
    side: str = "lower center",
) -> Figure:
    """Draw panels for each state: `draw` takes the results of one, and its Axes, `each` of them."""
    known = [str(name) for name in found["state"].values]
    for name in states or ():
        if name not in known:
            raise RequestError(f"there is no state '{name}'. States: {', '.join(known)}.")
    chosen = known if states is None else states
    with figure_style():
        figure, places = panels(axes, each * len(chosen), most, size)
        for number, name in enumerate(chosen):
            draw(found.sel(state=name), *places[each * number :][:each])
        if axes is None:
            legend_outside(figure, *places[:each], side=side)
    return figure


def _shown(own: xr.Dataset) -> tuple[float, str, str]:
    """Factor and unit in which a state is shown, and its short label."""
    factor, units = displayed(str(own["units"].values))
    return factor, shown_unit(units) or "?", short_label(str(own["state"].values))


def _end(spectrum: xr.DataArray) -> float:
    """Frequency above which no state holds energy."""
    energy = spectrum.sum("state").values
    return float(spectrum["frequency"][np.flatnonzero(energy > 1e-3 * energy.max())[-1]])


def response(
    found: xr.Dataset,
    measured: xr.Dataset | None = None,
    *,
    states: Sequence[str] | None = None,
    axes: Places = None,
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
    if states is None:
        answers = found["amplitude"].notnull().any(["input", "frequency"])
        states = [str(name) for name in found["state"].values[answers]]
    entry = "wave" if "wave" in found["input"] else str(found.attrs["reference"])

    def draw(own: xr.Dataset, gain: Any, turn: Any) -> None:
        factor, units, label = _shown(own)
        frequency, trained = own["frequency"].values, own["trained"].values
        for place in (gain, turn):
            across = {"transform": place.get_xaxis_transform(), "step": "mid", **UNTRAINED}
            words = "no energy in training"
            place.fill_between(frequency, 0, 1, where=~trained, label=words, **across)
            place.set(xlim=frequency[[0, -1]], xlabel="frequency [Hz]")
        line = {**LINES["forecast"], "label": "model"}
        gain.plot(frequency, factor * own["amplitude"], **line)
        turn.plot(frequency, _broken(own["phase"].values), **line)
        if "amplitude_lower" in own:
            bounds = (factor * own[f"amplitude_{each}"] for each in ("lower", "upper"))
            band = {"color": LINES["forecast"]["color"], "alpha": 0.25, "linewidth": 0}
            gain.fill_between(frequency, *bounds, **band, label="95 % of the members")
        if measured is not None:
            _points(gain, turn, measured.sel(state=own["state"]), factor)
        inside = own["amplitude"].values[trained]
        gain.set_ylim(0, 1.25 * factor * inside.max() if inside.size else None)
        gain.set_ylabel(f"{label} [{units}]")
        turn.set(ylabel=f"phase of {label} [°]", ylim=(-190, 190), yticks=range(-180, 181, 90))

    most = 2 + 2 * (len(states) % 2 == 0)
    at = found.sel(input=entry)
    return by_state(at, states, axes, (2.9, 1.75), draw, 2, most, "upper center")


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


def coherence(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Places = None,
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
    top = _end(found["spectrum"])

    def draw(own: xr.Dataset, place: Any) -> None:
        frequency, power = own["frequency"].values, own["spectrum"].values
        light = {"color": PALETTE["light"], "linewidth": 0, "label": "spectrum of the state"}
        place.fill_between(frequency, power / max(power.max(), 1e-300), **light)
        for ordinary in own["ordinary"]:
            style = {"color": COLOURS["input"], "linewidth": 0.7, "alpha": 0.8}
            place.plot(frequency, ordinary, **style, label="with one input")
        place.plot(frequency, own["multiple"], **LINES["measured"], label="with all inputs")
        if "multiple_observables" in own:
            line = {**LINES["forecast"], "label": "with observables too"}
            place.plot(frequency, own["multiple_observables"], **line)
        place.set(xlim=(0, top), ylim=(0, 1.02), xlabel="frequency [Hz]")
        place.set_ylabel(f"coherence, {short_label(str(own['state'].values))} [1]")

    return by_state(found, states, axes, (3.0, 1.9), draw)


def modes(found: xr.Dataset, *, most: int = 12, axes: Places = None) -> Figure:
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


def decay(found: xr.Dataset, *, axes: Places = None) -> Figure:
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

    def draw(own: xr.Dataset, place: Any) -> None:
        left = own["displacement"].values
        place.axhline(0.0, color=COLOURS["input"], linewidth=0.6)
        place.plot(own["time"], left, **{**LINES["forecast"], "linestyle": "-"})
        moving = np.flatnonzero(np.abs(left) > 0.01)
        place.set_xlim(0, float(own["time"][min(moving[-1] + 2, left.size - 1)]))
        place.set_xlabel("time after the release [s]")
        place.set_ylabel(f"{short_label(str(own['state'].values))} over offset [1]")

    return by_state(found.rename(motion="state"), None, axes, (3.0, 1.8), draw)


def residuals(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Places = None,
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
    dark = {"color": COLOURS["measured"], "linewidth": 1.0}
    end = 1.5 * _end(found["measured_spectrum"])

    def draw(own: xr.Dataset, white: Any, past: Any, spectrum: Any, age: Any) -> None:
        limit = float(own["limit"])
        white.axhspan(-limit, limit, **UNTRAINED)
        white.plot(own["lag"][1:], own["autocorrelation"][1:], **LINES["measured"])
        white.set(xlabel="lag [s]", ylabel="autocorrelation [1]")
        label = short_label(str(own["state"].values))
        white.set_title(f"{label}: errors of one step", loc="left", fontsize=8)
        dashes = ("-", (0, (4, 1.5)), ":") * 9
        for each, dash in zip(own.get("input_correlation", ()), dashes, strict=False):
            name = str(each["input"].values)
            wide = float(own["input_limit"].sel(input=name))
            past.axhspan(-wide, wide, **UNTRAINED)
            past.plot(own["lag"], each, **dark, linestyle=dash, label=name)
        past.set(xlabel="lag of the input [s]", ylabel="correlation [1]")
        past.set_title("with past inputs", loc="left", fontsize=8)
        frequency, power = own["frequency"][1:], own["measured_spectrum"].values
        top = power.max() if power.max() > 0 else 1.0
        grey = {"color": PALETTE["pale"], "linewidth": 0.8, "label": "measured"}
        spectrum.semilogy(frequency, power[1:] / top, **grey)
        error = own["error_spectrum"].values[1:] / top
        spectrum.semilogy(frequency, error, **LINES["forecast"], label="error")
        spectrum.set(xlim=(0, end), xlabel="frequency [Hz]", ylabel="power over peak [1]")
        spectrum.set_ylim(bottom=1e-6)
        spectrum.set_title("free runs", loc="left", fontsize=8)
        age.plot(own["age"], own["age_nrmse"], **LINES["forecast"])
        age.set_ylim(bottom=0)
        age.set(xlabel="age of the forecast [s]", ylabel="error [SD]")
        if axes is not None:
            for place in (past, spectrum):
                place.legend(fontsize=6)

    return by_state(found, states, axes, (2.6, 1.75), draw, 4, 4, "upper center")


def exceedance(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Places = None,
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
    return by_state(found, states, axes, (3.0, 2.0), _exceedance)


def _exceedance(own: xr.Dataset, place: Any) -> None:
    factor, unit, label = _shown(own)
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
    place.set_xlabel(f"peak of {label} [{unit}]")
    place.set_ylabel("exceeded by [1]")


def density(
    found: xr.Dataset,
    *,
    states: Sequence[str] | None = None,
    axes: Places = None,
) -> Figure:
    """Draw the densities of states, measured and forecast; arguments as :func:`exceedance`."""
    return by_state(found, states, axes, (3.0, 1.9), _density)


def _density(own: xr.Dataset, place: Any) -> None:
    factor, unit, label = _shown(own)
    for kind in ("measured", "forecast"):
        height = own["density"].sel(kind=kind) / factor
        place.plot(factor * own["deviation"], height, **LINES[kind], label=kind)
    place.set_ylim(bottom=0)
    place.set_xlabel(f"{label} from its mean [{unit}]")
    place.set_ylabel(f"density [1/{unit}]")


def validity(found: xr.Dataset, *, axes: Places = None) -> Figure:
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
    axes: Places = None,
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
    if states is None:
        answers = found["slow_response"].notnull().any(["difference", "frequency"])
        states = [str(name) for name in found["state"].values[answers]]

    def draw(own: xr.Dataset, place: Any) -> None:
        factor, unit, label = _shown(own)
        place.axhline(0.0, color=COLOURS["input"], linewidth=0.5)
        line = {**LINES["forecast"], "linestyle": "-", "label": "model, mean"}
        place.plot(own["frequency"], factor * own["slow_response"][0], **line)
        dashes = ((0, (4, 1.5)), (0, (1, 1)), (0, (5, 1, 1, 1)), (0, (8, 2)))
        for slow, dash in zip(own["slow_response"][1:], dashes, strict=False):
            style = {"color": COLOURS["ensemble"], "linewidth": 0.9, "linestyle": dash}
            words = f"model, difference {float(slow['difference']):.3g} Hz"
            place.plot(own["frequency"], factor * slow, **style, label=words)
        if "offset" in own:
            style = {**MARKS["regular"], "linestyle": "none", "elinewidth": 0.8}
            offsets = (factor * own[key] for key in ("offset", "offset_uncertainty"))
            words = "measured, regular waves"
            place.errorbar(own["point_frequency"], *offsets, **style, label=words)
        place.set(xlabel="frequency [Hz]", ylabel=f"{label} [{unit}]")

    return by_state(found, states, axes, (3.0, 2.0), draw)
