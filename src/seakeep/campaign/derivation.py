"""Derived channels, made by expressions and named steps."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.campaign.settings import (
    CampaignSettings,
    DerivedSettings,
    long_name_of,
    sources_of,
    units_of,
)
from seakeep.conventions import TURNS, conversion, si_unit
from seakeep.errors import DataError, RequestError, naming
from seakeep.quality.faults import BRIDGED, MISSING, flag_attributes
from seakeep.signals import (
    band_pass,
    complementary_filter,
    differentiate,
    envelope_squared,
    integrate,
    low_pass,
    remove_gravity,
    rotation_matrix,
    transfer_acceleration,
    transfer_position,
    transfer_velocity,
)
from seakeep.signals.calculus import expected_in_gaps
from seakeep.signals.expressions import parse
from seakeep.waves import GRAVITY

AXES = {"surge": 0, "sway": 1, "heave": 2, "x": 0, "y": 1, "z": 2}


Channels = Mapping[Any, xr.Variable]


def derive(
    channels: Channels, name: str, settings: CampaignSettings, dt: float, run: str
) -> dict[str, xr.Variable]:
    """Make a derived channel from channels on one axis, with its flags if its sources have any."""
    own, label = settings.derived[name], f"the derived channel '{name}'"
    with naming(f"run '{run}', derived channel '{name}'"):
        if own.expression is not None:
            expression = parse(own.expression)
            values = expression.evaluate({n: channels[n].values for n in expression.channels})
            unit = own.unit or units_of(name, "-")
            origin = own.expression
        else:
            values, unit, words = _step(channels, name, own, dt)
            origin = f"{own.source}, {words}"
            if own.step == "envelope_squared":
                origin = f"squared envelope of {own.source}"
            if own.unit is not None:
                conversion(unit, own.unit, label)
        target = units_of(name, unit)
        factor = conversion(unit, target, label)
        sources = sources_of(name, own, channels)
        units = [channels[source].attrs["units"] for source in sources]
        if own.expression and factor != 1 and target in units:
            raise RequestError(
                f"{own.expression!r} is computed from channels in SI units, some in '{target}', so "
                f"that its result can hardly be in '{unit}'. State unit = '{target}', and leave "
                "out of the expression what converts units."
            )
        values = values * factor
    attributes = {
        "units": target,
        "long_name": long_name_of(name, own.long_name),
        "derived_from": origin,
    }
    if own.step in ("low_pass", "band_pass") and "accuracy" in channels[sources[0]].attrs:
        attributes["accuracy"] = channels[sources[0]].attrs["accuracy"]  # the same, in a band
    out = {name: xr.Variable("time", values, attributes)}
    flags = np.zeros(values.size, np.int16)
    for source in sources:
        if (known := channels.get(f"{source}_flags")) is not None:
            flags |= known.values & (MISSING | BRIDGED)
    if flags.any():
        out[f"{name}_flags"] = xr.Variable("time", flags, flag_attributes(name))
    return out


def _series(channels: Channels, name: str | None) -> FloatArray:
    """Values of a channel; those expected in its gaps, because a filter reaches beyond them."""
    values = channels[str(name)].values
    if (flags := channels.get(f"{name}_flags")) is None:
        return values
    return expected_in_gaps(values, (flags.values & (MISSING | BRIDGED)) > 0)


def _step(
    dataset: Channels, name: str, settings: DerivedSettings, dt: float
) -> tuple[FloatArray, str, str]:
    """Values and unit of a named step, and what it does to its source."""
    series = _series(dataset, settings.source)
    unit = str(dataset[str(settings.source)].attrs["units"])
    times, band = settings.times or 1, settings.band or (0.0, 0.0)
    passband, crossover = settings.passband or 0.0, settings.crossover or 0.0
    integrated = f"({unit}) * s^{times}"
    match settings.step:
        case "integrate":
            words = f"integrated {times} time(s) in {band[0]:g} to {band[1]:g} Hz"
            return integrate(series, dt, band, times), si_unit(integrated), words
        case "differentiate":
            return differentiate(series, dt), si_unit(f"({unit}) / s"), "differentiated"
        case "band_pass":
            return band_pass(series, dt, band), unit, f"{band[0]:g} to {band[1]:g} Hz"
        case "low_pass":
            low = low_pass(series, dt, passband, settings.stopband)
            return low, unit, f"low-passed at {passband:g} Hz"
        case "envelope_squared":
            return envelope_squared(series, dt), si_unit(f"({unit})^2"), ""
        case "complementary_filter":
            slow = _series(dataset, settings.position)
            both = complementary_filter(slow, series, dt, crossover, times)
            words = f"integrated {times} time(s) above {crossover:g} Hz, {settings.position} below"
            return both, si_unit(integrated), words
        case _:
            return _body_step(dataset, name, settings, series, unit)


def _body_step(
    dataset: Channels, name: str, settings: DerivedSettings, series: FloatArray, unit: str
) -> tuple[FloatArray, str, str]:
    """Result of a step that depends on how the body turns: the transfer, or gravity removed."""
    axis = _axis(name, settings)
    angles = _three(dataset)
    if settings.step == "remove_gravity":
        words = f"gravity removed by {', '.join(name for name in TURNS if name in dataset)}"
        if settings.components:
            force = np.column_stack([dataset[each].values for each in settings.components])
            series = remove_gravity(force, angles, zeroed=bool(settings.zeroed))[:, axis]
        else:
            # One accelerometer alone: what gravity adds along its axis; that it turns is left out.
            felt = GRAVITY * rotation_matrix(angles)[:, 2, axis]
            at_rest = GRAVITY if settings.zeroed and axis == 2 else 0.0
            series = series + at_rest - felt
        mean = float(np.mean(series))
        if axis == 2 and abs(mean) > 0.5 * GRAVITY:  # gravity was counted wrongly
            raise DataError(
                f"without gravity the mean upward acceleration is {mean:.3g} m/s^2, which no "
                f"floating body keeps up. An accelerometer along z reads +{GRAVITY} m/s^2 at rest: "
                "where its readings were set to zero there, or hold no gravity, state zeroed = "
                "true; where they are reversed, sign = -1 in its [channels.NAME]."
            )
        return series, unit, words
    offset = settings.offset or (0.0, 0.0, 0.0)
    vector = np.zeros((series.size, 3))
    vector[:, axis] = series
    if unit == "m":
        moved = transfer_position(vector, angles, offset)
    elif unit == "m/s":
        moved = transfer_velocity(vector, angles, _three(dataset, "_rate"), offset)
    elif unit == "m/s^2":
        rates, turning = _three(dataset, "_rate"), _three(dataset, "_acceleration")
        moved = transfer_acceleration(vector, angles, rates, turning, offset)
    else:
        raise RequestError(
            f"'{settings.source}' is measured in '{unit}'; positions (m), velocities (m/s) and "
            "accelerations (m/s^2) are transferred. Choose another channel."
        )
    return moved[:, axis], unit, f"{offset} m from where it was measured"


def _axis(name: str, settings: DerivedSettings) -> int:
    for word in (settings.axis, str(settings.source).split("_")[0], name.split("_")[0]):
        if word in AXES:
            return AXES[word]
    raise RequestError(
        f"neither '{settings.source}' nor '{name}' says along which axis it is measured. State "
        "axis = 'x', 'y' or 'z'."
    )


def _three(dataset: Channels, kind: str = "") -> FloatArray:
    """Angles, or their rates, side by side; zeros where one is not measured, but one must be."""
    names = [each + kind for each in TURNS]
    if not any(name in dataset for name in names):
        raise RequestError(
            f"none of the channels {', '.join(names)} is measured. Map or derive those in which "
            "the body turns."
        )
    zero = np.zeros(next(iter(dataset.values())).size)
    return np.column_stack([dataset[n].values if n in dataset else zero for n in names])
