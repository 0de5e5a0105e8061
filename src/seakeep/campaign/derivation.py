"""Derived channels: expressions and named steps, from ``[derived]`` to arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.campaign.settings import CampaignSettings, DerivedSettings, long_name_of
from seakeep.campaign.validation import sources_of
from seakeep.conventions import TURNS, canonical_channel, conversion, si_unit
from seakeep.errors import DataError, RequestError, SeakeepError
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
from seakeep.signals.expressions import parse
from seakeep.waves import GRAVITY

AXES = {"surge": 0, "sway": 1, "heave": 2, "x": 0, "y": 1, "z": 2}


Channels = Mapping[Any, xr.Variable]


def derive(
    channels: Channels, name: str, settings: CampaignSettings, dt: float, run: str
) -> dict[str, xr.Variable]:
    """Make a derived channel from channels on one axis, with its flags if its sources have any."""
    own = settings.derived[name]
    try:
        channel = _derived(channels, name, own, dt)
    except SeakeepError as error:
        raise type(error)(f"run '{run}', derived channel '{name}': {error}") from None
    if name in settings.rig.positions:
        channel.attrs["x_position"] = float(settings.rig.positions[name])
    flags = np.zeros(channel.size, dtype=np.int16)
    for source in sources_of(name, own, channels):
        if (known := channels.get(f"{source}_flags")) is not None:
            flags |= known.to_numpy() & (MISSING | BRIDGED)
    if not flags.any():
        return {name: channel}
    return {name: channel, f"{name}_flags": xr.Variable("time", flags, flag_attributes(name))}


def _derived(dataset: Channels, name: str, settings: DerivedSettings, dt: float) -> xr.Variable:
    canonical = canonical_channel(name)
    label = f"the derived channel '{name}'"
    if settings.expression is not None:
        expression = parse(settings.expression)
        values = expression.evaluate({n: dataset[n].to_numpy() for n in expression.channels})
        unit = settings.unit or (canonical.units if canonical else "-")
        origin = settings.expression
    else:
        if settings.step in ("transfer", "remove_gravity", "complementary_filter"):
            values, unit, origin = _body_step(dataset, name, settings, dt)
        else:
            values, unit, origin = _step(dataset[str(settings.source)], settings, dt)
        if settings.unit is not None:
            conversion(unit, settings.unit, label)
    target = canonical.units if canonical else si_unit(unit)
    values = values * conversion(unit, target, label)
    attributes = {
        "units": target,
        "long_name": long_name_of(name, settings.long_name),
        "derived_from": origin,
    }
    if settings.step in ("low_pass", "band_pass"):  # the same reading, in a band
        source = dataset[str(settings.source)].attrs
        attributes |= {key: source[key] for key in ("accuracy",) if key in source}
    return xr.Variable("time", values, attributes)


def _step(source: xr.Variable, settings: DerivedSettings, dt: float) -> tuple[FloatArray, str, str]:
    """Values, unit and description of a named step."""
    series, unit, name = source.to_numpy(), source.attrs["units"], settings.source
    if settings.step == "integrate":
        times, band = settings.times or 1, settings.band or (0.0, 0.0)
        described = f"{name}, integrated {times} time(s) in {band[0]:g} to {band[1]:g} Hz"
        return integrate(series, dt, band, times), si_unit(f"({unit}) * s^{times}"), described
    if settings.step == "differentiate":
        return differentiate(series, dt), si_unit(f"({unit}) / s"), f"{name}, differentiated"
    if settings.step == "band_pass":
        band = settings.band or (0.0, 0.0)
        return band_pass(series, dt, band), unit, f"{name}, {band[0]:g} to {band[1]:g} Hz"
    if settings.step == "low_pass":
        passband = settings.passband or 0.0
        described = f"{name}, low-passed at {passband:g} Hz"
        return low_pass(series, dt, passband, settings.stopband), unit, described
    squared = envelope_squared(series, dt)
    return squared, si_unit(f"({unit})^2"), f"squared envelope of {name}"


def _body_step(
    dataset: Channels, name: str, settings: DerivedSettings, dt: float
) -> tuple[FloatArray, str, str]:
    """Values, unit and description of a step that needs several channels."""
    source = dataset[str(settings.source)]
    series, unit = source.to_numpy(), str(source.attrs["units"])
    if settings.step == "complementary_filter":
        times, crossover = settings.times or 1, settings.crossover or 0.0
        slow = dataset[str(settings.position)].to_numpy()
        described = (
            f"{settings.source}, integrated {times} time(s) above {crossover:g} Hz, "
            f"{settings.position} below"
        )
        return (
            complementary_filter(slow, series, dt, crossover, times),
            si_unit(f"({unit}) * s^{times}"),
            described,
        )
    axis = _axis(name, settings)
    angles = _three(dataset)
    if settings.step == "remove_gravity":
        measured = [name for name in TURNS if name in dataset]
        described = f"{settings.source}, gravity removed by {', '.join(measured)}"
        if settings.components is not None:
            force = np.column_stack([dataset[each].to_numpy() for each in settings.components])
            moved = remove_gravity(force, angles, zeroed=bool(settings.zeroed))
            return _afloat(moved[:, axis], axis), unit, described
        # One accelerometer alone: what gravity adds along its axis; that it turns is left out.
        felt = GRAVITY * rotation_matrix(angles)[:, 2, axis]
        at_rest = GRAVITY if settings.zeroed and axis == 2 else 0.0
        return _afloat(series + at_rest - felt, axis), unit, described
    offset = settings.offset or (0.0, 0.0, 0.0)
    described = f"{settings.source}, {offset} m from where it was measured"
    vector = np.zeros((series.size, 3))
    vector[:, axis] = series
    if unit == "m":
        return transfer_position(vector, angles, offset)[:, axis], unit, described
    rates = _three(dataset, "_rate")
    if unit == "m/s":
        return transfer_velocity(vector, angles, rates, offset)[:, axis], unit, described
    if unit != "m/s^2":
        raise RequestError(
            f"'{settings.source}' is measured in '{unit}'; positions (m), velocities (m/s) and "
            "accelerations (m/s^2) are transferred. Choose another channel."
        )
    turning = _three(dataset, "_acceleration")
    moved = transfer_acceleration(vector, angles, rates, turning, offset)
    return moved[:, axis], unit, described


def _afloat(acceleration: FloatArray, axis: int) -> FloatArray:
    """Refuse a mean upward acceleration that no floating body has: gravity was counted wrongly."""
    mean = float(np.mean(acceleration))
    if axis == 2 and abs(mean) > 0.5 * GRAVITY:
        raise DataError(
            f"without gravity the mean upward acceleration is {mean:.3g} m/s^2, which no floating "
            f"body keeps up. An accelerometer along z reads +{GRAVITY} m/s^2 at rest: where its "
            "readings were set to zero there, or hold no gravity, state zeroed = true; where they "
            "are reversed, sign = -1 in its [channels.NAME]."
        )
    return acceleration


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
    return np.column_stack([dataset[n].to_numpy() if n in dataset else zero for n in names])
