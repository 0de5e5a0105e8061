"""From a file's columns to channels: names, SI units, signs, and what is derived from them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.campaign.readers import read_table
from seakeep.campaign.settings import (
    CampaignSettings,
    ChannelSettings,
    DerivedSettings,
    RunSettings,
    long_name_of,
)
from seakeep.campaign.validation import derivation_order
from seakeep.conventions import canonical_channel, conversion, si_unit
from seakeep.errors import DataError, RequestError, SeakeepError
from seakeep.signals import (
    band_pass,
    differentiate,
    envelope_squared,
    integrate,
    low_pass,
    uniform_step,
)
from seakeep.signals.expressions import parse

__all__ = ["read_channels"]

FloatArray = npt.NDArray[np.float64]


def read_channels(path: Path, settings: CampaignSettings, run: str) -> xr.Dataset:
    """Read the mapped channels of a run and derive the others, at the file's own rate.

    Parameters
    ----------
    path : Path
        The run's file.
    settings : CampaignSettings
        The campaign.
    run : str
        Name of the run.

    Returns
    -------
    xarray.Dataset
        Dimension ``time`` (s); every channel of the campaign in SI units and radians.

    Raises
    ------
    RequestError
        If the file or a column does not exist, or a unit is missing or does not fit.
    DataError
        If the file is damaged, its times are not uniform, or a channel has gaps.
    """
    chosen = _channels_of(settings, settings.runs[run])
    columns = [each.column or name for name, each in chosen.items()]
    table = _cut(read_table(path, settings.files, columns), settings.runs[run], run)
    variables = {name: ("time", *_mapped(table, name, each, path)) for name, each in chosen.items()}
    dataset = xr.Dataset(variables, {"time": table["time"]})
    _refuse_gaps(dataset, run, path)
    dt = uniform_step(dataset["time"].to_numpy(), f"run '{run}' ({path})")
    for name in derivation_order(settings.derived):
        try:
            dataset[name] = _derived(dataset, name, settings.derived[name], dt)
        except SeakeepError as error:
            raise type(error)(f"run '{run}', derived channel '{name}': {error}") from None
    dataset = dataset[list(settings.channel_names)]
    for name, position in settings.rig.positions.items():
        dataset[name].attrs["x_position"] = float(position)
    return dataset


def _channels_of(settings: CampaignSettings, run: RunSettings) -> dict[str, ChannelSettings]:
    """Channel map of a run: the campaign's, with the keys that the run states in their place."""
    chosen = dict(settings.channels)
    for name, own in run.channels.items():
        stated = {key: getattr(own, key) for key in own.model_fields_set}
        chosen[name] = chosen[name].model_copy(update=stated)
    return chosen


def _cut(table: xr.Dataset, settings: RunSettings, run: str) -> xr.Dataset:
    if settings.record is None:
        return table
    begin, end = settings.record
    time = table["time"].to_numpy()
    kept = (time >= begin) & (time <= end)
    if kept.sum() < 2:
        raise RequestError(
            f"runs.{run}.record: received [{begin:g}, {end:g}] s, and the file runs from "
            f"{time[0]:g} to {time[-1]:g} s: nothing is left. Correct the two times."
        )
    return table.isel(time=kept)


def _mapped(
    table: xr.Dataset, name: str, settings: ChannelSettings, path: Path
) -> tuple[FloatArray, dict[str, str]]:
    wanted = settings.column or name
    column = table.get(wanted)
    if column is None:
        column = next(c for c in table.data_vars.values() if c.attrs["long_name"] == wanted)
    unit = settings.unit if settings.unit is not None else column.attrs.get("units")
    if unit is None:
        raise RequestError(
            f"channels.{name}: the column '{wanted}' of {path} states no unit. Add unit = '…' to "
            f"[channels.{name}] ('-' for none)."
        )
    canonical = canonical_channel(name)
    target = canonical.units if canonical else si_unit(unit)
    factor = conversion(unit, target, f"channel '{name}' (column '{wanted}' of {path})")
    values = settings.sign * factor * (column.to_numpy().astype(float) + settings.offset)
    return values, {"units": target, "long_name": long_name_of(name, settings.long_name)}


def _refuse_gaps(dataset: xr.Dataset, run: str, path: Path) -> None:
    time = dataset["time"].to_numpy()
    gapped = [str(n) for n, each in dataset.items() if not np.isfinite(each.to_numpy()).all()]
    if not gapped:
        return
    missing = ~np.isfinite(dataset[gapped[0]].to_numpy())
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2]
    step = float(np.median(np.diff(time)))
    lengths = ends - begins
    longest = int(np.argmax(lengths))
    others = f" (also in {', '.join(gapped[1:])})" if gapped[1:] else ""
    raise DataError(
        f"run '{run}' ({path}): channel '{gapped[0]}' has {int(missing.sum())} missing values of "
        f"{missing.size} in {begins.size} gap(s), the first at t = {time[begins[0]]:g} s "
        f"({lengths[0]} samples, {lengths[0] * step:g} s), the longest at t = "
        f"{time[begins[longest]]:g} s ({lengths[longest]} samples, {lengths[longest] * step:g} s)"
        f"{others}. Repair the file, leave the channel out, or cut the gap off with record = "
        f"[begin, end] in [runs.{run}]."
    )


def _derived(dataset: xr.Dataset, name: str, settings: DerivedSettings, dt: float) -> xr.DataArray:
    canonical = canonical_channel(name)
    label = f"the derived channel '{name}'"
    if settings.expression is not None:
        arrays: Mapping[str, FloatArray] = {str(n): each.to_numpy() for n, each in dataset.items()}
        values = parse(settings.expression).evaluate(arrays)
        unit = settings.unit or (canonical.units if canonical else "-")
        origin = settings.expression
    else:
        source = dataset[str(settings.source)]
        values, unit, origin = _step(source, settings, dt)
        if settings.unit is not None:
            conversion(unit, settings.unit, label)
    target = canonical.units if canonical else si_unit(unit)
    values = values * conversion(unit, target, label)
    attributes = {
        "units": target,
        "long_name": long_name_of(name, settings.long_name),
        "derived_from": origin,
    }
    return xr.DataArray(values, dims="time", attrs=attributes)


def _step(
    source: xr.DataArray, settings: DerivedSettings, dt: float
) -> tuple[FloatArray, str, str]:
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
