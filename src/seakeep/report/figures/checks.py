"""Figures of checks: each draws a labelled result, on Axes that it is given or on a new figure."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import RequestError
from seakeep.report.style import (
    COLOURS,
    LINES,
    MARKS,
    PALETTE,
    SERIES,
    TESTS,
    Figure,
    Places,
    figure_style,
    legend_outside,
    panels,
    plain_text,
    prefixed,
    short_label,
    shown_unit,
)

SHADE = {"color": PALETTE["light"], "alpha": 0.6, "linewidth": 0}
POINTS = {"linestyle": "none", "elinewidth": 0.8}
INPUTS = ("-", ":", "-.") * 99
"""Lines of one input after the other; dashes are those of a forecast."""


def by_state(
    result: xr.Dataset, axes: Places, size: tuple[float, float], each: int = 1, most: int = 3
) -> Iterator[tuple[Any, ...]]:
    """Results of each state in turn, and its Axes; a new figure has its legend after the last."""
    chosen = result["state"].values
    figure, places = panels(axes, each * len(chosen), most, size)
    for number, name in enumerate(chosen):
        yield result.sel(state=name), *places[each * number :][:each]
    if axes is None:
        side = "upper center" if each > 1 else "lower center"
        legend_outside(*places[:each], side=side)
        figure.align_ylabels()


def _shown(own: xr.Dataset, values: npt.ArrayLike) -> tuple[float, str, str]:
    """Factor and unit in which values of a state are shown, and its short label."""
    factor, units = prefixed(own["units"].item(), values)
    return factor, shown_unit(units) or "?", short_label(own["state"].item())


def _end(spectrum: xr.DataArray) -> float:
    """Frequency above which no state holds energy."""
    energy = spectrum.sum("state").values
    return float(spectrum["frequency"][np.flatnonzero(energy > 1e-3 * energy.max())[-1]])


@figure_style()
def response(
    result: xr.Dataset, measured: xr.Dataset | None = None, *, axes: Places = None
) -> Figure:
    """Draw amplitude and phase of the response per wave amplitude, measured points beside.

    Parameters
    ----------
    result : Dataset
        From :func:`seakeep.check.response`.
    measured : Dataset, optional
        From :func:`seakeep.check.measured_response`.
    axes : Axes or sequence of Axes, optional
        Two for each state, amplitude and phase; by default those of a new figure.

    Returns
    -------
    Figure
    """
    entry = "wave" if "wave" in result["input"] else result.attrs["reference"]
    answering = result.dropna("state", how="all", subset=["amplitude"]).sel(input=entry)
    most = 2 + 2 * (answering.sizes["state"] % 2 == 0)
    for own, gain, turn in by_state(answering, axes, (2.9, 1.75), 2, most):
        factor, units, label = _shown(own, own["amplitude"])
        frequency, trained, phase = (own[k].values for k in ("frequency", "trained", "phase"))
        for place in (gain, turn):
            place.fill_between(
                frequency,
                0,
                1,
                where=~trained,
                label="no energy in training",
                transform=place.get_xaxis_transform(),
                step="mid",
                **SHADE,
            )
            place.set(xlim=frequency[[0, -1]], xlabel="frequency [Hz]")
        gain.plot(frequency, factor * own["amplitude"], **LINES["solid"], label="model")
        wraps = 1 + np.flatnonzero(np.abs(np.diff(phase)) > 180)  # no line runs across
        turn.plot(*np.insert([frequency, phase], wraps, np.nan, axis=1), **LINES["solid"])
        if "amplitude_lower" in own:
            bounds = (factor * own[f"amplitude_{each}"] for each in ("lower", "upper"))
            gain.fill_between(
                frequency,
                *bounds,
                color=COLOURS["forecast"],
                alpha=0.25,
                linewidth=0,
                label="95 % of the members",
            )
        if measured is not None:
            at = measured.sel(state=own["state"])
            at = at.where(at["amplitude_uncertainty"] < at["amplitude"])  # the rest is noise
            for kind, mark in MARKS.items():
                one = at.isel(point=measured["kind"].values == kind)
                if one["amplitude"].notnull().any():
                    style = {**mark, **POINTS, "label": f"measured, {kind} waves"}
                    for place, key, scale in ((gain, "amplitude", factor), (turn, "phase", 1.0)):
                        both = (scale * one[each] for each in (key, f"{key}_uncertainty"))
                        place.errorbar(one["frequency"], *both, **style)
        inside = own["amplitude"].values[trained]
        gain.set_ylim(0, 1.25 * factor * inside.max() if inside.size else None)
        gain.set_ylabel(f"{label} [{units}]")
        turn.set(ylabel=f"phase of {label} [°]", ylim=(-190, 190), yticks=range(-180, 181, 90))
    return gain.figure


@figure_style()
def coherence(result: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw the coherence of each state with the inputs, over the state's own spectrum.

    Parameters
    ----------
    result : Dataset
        From :func:`seakeep.check.coherence`.
    axes : Axes or sequence of Axes, optional
        One for each state; by default those of a new figure.

    Returns
    -------
    Figure
    """
    top = _end(result["spectrum"])

    for own, place in by_state(result, axes, (3.0, 1.9)):
        frequency, power = own["frequency"].values, own["spectrum"].values
        place.fill_between(
            frequency,
            power / max(power.max(), 1e-300),
            color=PALETTE["light"],
            linewidth=0,
            label="spectrum of the state",
        )
        for each, dash in zip(own["ordinary"], INPUTS, strict=False):
            line = {**LINES["input"], "linestyle": dash}
            place.plot(frequency, each, **line, label=plain_text(f"with {each['input'].item()}"))
        place.plot(frequency, own["multiple"], **LINES["measured"], label="with all inputs")
        if "multiple_observables" in own:
            place.plot(
                frequency,
                own["multiple_observables"],
                **LINES["forecast"],
                label="with observables too",
            )
        place.set(xlim=(0, top), ylim=(0, 1.02), xlabel="frequency [Hz]")
        place.set_ylabel(f"coherence, {short_label(own['state'].item())} [1]")
    return place.figure


@figure_style()
def modes(result: xr.Dataset, *, most: int = 12, axes: Places = None) -> Figure:
    """Draw the modes that decay slowest: which states take part, with period and damping.

    Parameters
    ----------
    result : Dataset
        From :func:`seakeep.check.modes`.
    most : int, optional
        Number of modes.
    axes : Axes, optional
        One; by default that of a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    RequestError
        If the result has no ``participation``, as that of a model's own ``modes``.
    """
    if "participation" not in result:
        raise RequestError(
            "the result does not say which states take part in a mode. Draw that of "
            "seakeep.check.modes(model)."
        )
    at = result.head(mode=most)
    states, shares = at["state"].values.tolist(), at["participation"].values
    words = [
        f"{period:.3g} s, {ratio:.3f}" if np.isfinite(period) else f"decays in {time:.3g} s"
        for period, ratio, time in zip(
            at["period"], at["damping_ratio"], at["decay_time"], strict=True
        )
    ]
    figure, (place,) = panels(axes, 1, 1, (2.8 + 0.5 * len(states), 0.9 + 0.24 * len(words)))
    picture = place.imshow(shares, cmap="Greys", vmin=0, vmax=1, aspect="auto")
    for (row, column), value in np.ndenumerate(shares):
        if value >= 0.05:
            place.text(
                column,
                row,
                f"{value:.2f}",
                color="w" if value > 0.5 else "k",
                ha="center",
                va="center",
                fontsize=7,
            )
    place.set_xticks(range(len(states)), list(map(short_label, states)))
    place.set_yticks(range(len(words)), words)
    place.grid(False)
    place.set_ylabel("mode: period, damping ratio")
    figure.colorbar(picture, ax=place, label="participation [1]")
    return figure


@figure_style()
def decay(result: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw what is left of an offset after its release, motion by motion.

    Parameters
    ----------
    result : Dataset
        From :func:`seakeep.check.decay`.
    axes : Axes or sequence of Axes, optional
        One for each motion; by default those of a new figure.

    Returns
    -------
    Figure
    """
    for own, place in by_state(result.rename(motion="state"), axes, (3.0, 1.8)):
        left = own["displacement"].values
        place.axhline(0.0, **LINES["zero"])
        place.plot(own["time"], left, **LINES["solid"])
        moving = np.flatnonzero(np.abs(left) > 0.01)
        place.set_xlim(0, float(own["time"][min(moving[-1] + 2, left.size - 1)]))
        place.set_xlabel("time after the release [s]")
        place.set_ylabel(f"{short_label(own['state'].item())} over offset [1]")
    return place.figure


@figure_style()
def residuals(result: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw correlations of one-step errors, the spectrum of free runs' errors, and their age.

    Parameters
    ----------
    result : Dataset
        From :func:`seakeep.check.residuals`.
    axes : Axes or sequence of Axes, optional
        Four for each state; by default those of a new figure.

    Returns
    -------
    Figure
    """
    end = 1.5 * _end(result["measured_spectrum"])

    for own, white, past, spectrum, age in by_state(result, axes, (2.6, 1.75), 4, 4):
        limit = float(own["limit"])
        white.axhspan(-limit, limit, **SHADE)
        white.plot(own["lag"][1:], own["autocorrelation"][1:], **LINES["measured"])
        white.set(xlabel="lag [s]", ylabel="autocorrelation [1]")
        white.set_title(f"{short_label(own['state'].item())}: errors of one step")
        for each, dash in zip(own.get("input_correlation", ()), INPUTS, strict=False):
            wide = float(own["input_limit"].sel(input=each["input"]))
            past.axhspan(-wide, wide, **SHADE)
            past.plot(
                own["lag"],
                each,
                color=COLOURS["measured"],
                linewidth=1.0,
                linestyle=dash,
                label=plain_text(each["input"].item()),
            )
        past.set(xlabel="lag of the input [s]", ylabel="correlation [1]")
        past.set_title("with past inputs")
        frequency, power = own["frequency"][1:], own["measured_spectrum"].values
        top = power.max() if power.max() > 0 else 1.0
        spectrum.semilogy(
            frequency, power[1:] / top, color=PALETTE["grey"], linewidth=0.9, label="measured"
        )
        error = own["error_spectrum"].values[1:] / top
        spectrum.semilogy(frequency, error, **LINES["forecast"], label="error")
        spectrum.set(xlim=(0, end), xlabel="frequency [Hz]", ylabel="power over peak [1]")
        spectrum.set_ylim(bottom=1e-6)
        for place in (spectrum, age):
            place.set_title("free runs")
        age.plot(own["age"], own["age_nrmse"], **LINES["solid"])
        age.set_ylim(bottom=0)
        age.set(xlabel="age of the forecast [s]", ylabel="error [SD]")
        if axes is not None:
            for place in (past, spectrum):
                place.legend(fontsize=6)
    return white.figure


@figure_style()
def exceedance(result: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw how often peaks exceed a level, measured and forecast, beside Rayleigh and Weibull.

    Parameters
    ----------
    result : Dataset
        From :func:`seakeep.check.statistics`.
    axes : Axes or sequence of Axes, optional
        One for each state; by default those of a new figure.

    Returns
    -------
    Figure
    """
    for own, place in by_state(result, axes, (3.0, 2.0)):
        factor, unit, label = _shown(own, own["peak"])
        level = np.linspace(0, 1.1 * np.nanmax(own["peak"], initial=0.0) or 1.0, 200)
        scale, shape, width = (
            float(own[key].sel(kind="measured"))
            for key in ("rayleigh_scale", "weibull_shape", "weibull_scale")
        )
        if scale > 0:
            rayleigh = {**LINES["input"], "linestyle": ":", "label": "Rayleigh"}
            place.semilogy(factor * level, np.exp(-0.5 * (level / scale) ** 2), **rayleigh)
        if np.isfinite(shape):
            place.semilogy(
                factor * level,
                np.exp(-((level / width) ** shape)),
                **LINES["input"],
                label="Weibull of the measured",
            )
        for kind, mark in (("measured", "o"), ("forecast", "x")):
            at, style = own.sel(kind=kind), {"markersize": 3, "markerfacecolor": "none"}
            style |= {"color": LINES[kind]["color"], "label": kind}
            place.semilogy(factor * at["peak"], at["exceedance"], mark, **style)
        place.set_ylim(0.3 / max(int(own["peaks"].max()), 1), 1.3)
        place.set_xlim(0, factor * level[-1])
        place.set(xlabel=f"peak of {label} [{unit}]", ylabel="share of peaks above [1]")
        place.locator_params("x", nbins=5)
    return place.figure


@figure_style()
def density(result: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw the densities of states, measured and forecast; arguments as :func:`exceedance`."""
    for own, place in by_state(result, axes, (3.0, 1.9)):
        factor, unit, label = _shown(own, own["deviation"])
        for kind in ("measured", "forecast"):
            height = own["density"].sel(kind=kind) / factor
            place.plot(factor * own["deviation"], height, **LINES[kind], label=kind)
        place.set_ylim(bottom=0)
        place.set(xlabel=f"{label} from its mean [{unit}]", ylabel=f"density [1/{unit}]")
    return place.figure


@figure_style()
def validity(result: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw height against period of the waves, and steepness against mean surge where it is known.

    Parameters
    ----------
    result : Dataset
        From :func:`seakeep.check.validity`.
    axes : Axes or sequence of Axes, optional
        One, or two with surge; by default those of a new figure.

    Returns
    -------
    Figure
    """
    maps = [("period", "mean zero-crossing period [s]", "height", "wave height [m]")]
    if (result["drift"].notnull() & result["steepness"].notnull()).any():
        maps.append(("drift", "mean surge [m]", "steepness", "wave steepness [1]"))
    outside = result["outside"].values != ""
    train, test = (result.sel(part=each) for each in ("train", "test"))
    beyond = test.isel(run=outside)
    kinds = {"trained": train, "test, inside": test.isel(run=~outside), "test, outside": beyond}
    figure, places = panels(axes, len(maps), 2, (3.75, 2.8))
    for place, (x, across, y, up) in zip(places, maps, strict=True):
        for kind, at in kinds.items():
            if at[y].notnull().any():
                place.plot(at[x], at[y], linestyle="none", label=kind, **TESTS[kind])
        for run, *spot in beyond[[x, y]].to_dataframe()[[x, y]].dropna().itertuples():
            place.annotate(run, spot, (6, 4), textcoords="offset points", fontsize=7)
        place.set(xlabel=across, ylabel=up)
        place.margins(x=0.15)
        place.set_ylim(0, 1.2 * float(result[y].max()))
    if axes is None:
        legend_outside(places[0])
    return figure


@figure_style()
def drift(result: xr.Dataset, *, axes: Places = None) -> Figure:
    """Draw mean drift and slow response per amplitude squared, offsets of regular runs beside.

    Parameters
    ----------
    result : Dataset
        From :func:`seakeep.check.drift`.
    axes : Axes or sequence of Axes, optional
        One for each state; by default those of a new figure.

    Returns
    -------
    Figure
    """
    answering = result.dropna("state", how="all", subset=["slow_response"])
    for own, place in by_state(answering, axes, (3.0, 2.0)):
        factor, unit, label = _shown(own, own["slow_response"])
        mean, *slow = factor * own["slow_response"]
        place.axhline(0.0, **LINES["zero"])
        place.plot(own["frequency"], mean, **LINES["solid"], label="model, mean")
        for each, line in zip(slow, SERIES, strict=False):
            style = {**line, "color": COLOURS["ensemble"], "marker": None}
            words = f"model, difference {float(each['difference']):.3g} Hz"
            place.plot(own["frequency"], each, **style, label=words)
        if "offset" in own:
            style = {**MARKS["regular"], **POINTS, "label": "measured, regular waves"}
            offsets = (factor * own[key] for key in ("offset", "offset_uncertainty"))
            place.errorbar(own["point_frequency"], *offsets, **style)
        place.set(xlabel="frequency [Hz]", ylabel=f"{label} [{unit}]")
    return place.figure
