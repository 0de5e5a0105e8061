"""Pairs of channels: those of one Dataset, each with that of the same name in others."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, Groups
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.signals.time_axis import check_order, instant_text, usual_step

INSTANT_TOLERANCE = 0.01
"""Part of a step by which an instant of one Dataset may differ from that of another."""


@dataclass(frozen=True, eq=False)
class Paired:
    """Arrays of Datasets that fit together.

    Parameters
    ----------
    names : list of str
        Channels.
    lead : tuple of str
        Dimensions of the first Dataset before ``time``.
    arrays : dict of str to ndarray
        One per Dataset, at the instants of the first: (…, time, channel) of the first; the others
        the same shape, or (time, channel) where they have no further dimension.
    """

    names: list[str]
    lead: tuple[str, ...]
    arrays: dict[str, FloatArray]


def named_sides(**sides: Any) -> Groups:
    """Datasets of all sides, none where no side names its channels; names on some are refused.

    A DataFrame whose columns have names is one over its index, a DataArray one where a single
    dimension, but for ``statistic``, holds names.
    """
    found = {side: each for side, value in sides.items() if (each := _named(value)) is not None}
    if found and len(found) < len(sides):
        words = ", ".join(f"{side}: {type(each).__name__}" for side, each in sides.items())
        raise RequestError(f"give Datasets throughout, or arrays throughout; received {words}.")
    return found


def _named(value: Any) -> xr.Dataset | None:
    if isinstance(value, xr.DataArray):
        words = [dim for dim, index in value.indexes.items() if index.dtype.kind in "OU"]
        names = [dim for dim in words if dim != "statistic"]
        return value.to_dataset(names[0]) if len(names) == 1 else None
    if hasattr(value, "columns") and all(isinstance(each, str) for each in value.columns):
        return xr.Dataset.from_dataframe(value)
    return value if isinstance(value, xr.Dataset) else None


def channel_names(data: xr.Dataset, name: str) -> list[str]:
    """Variables that hold numbers; words, such as the status of a forecast, are not channels."""
    names = [str(key) for key, each in data.data_vars.items() if each.dtype.kind not in "OUST"]
    if not names:
        raise RequestError(f"{name} holds no channel; there is nothing to judge.")
    for channel in names:
        if data[channel].dtype.kind not in "iufb":
            raise DataError(
                f"channel '{channel}' of {name} is of type {data[channel].dtype}, not a real "
                "number. Convert it, or select the channels to judge."
            )
        if "time" not in data[channel].dims:
            raise DataError(
                f"{name} has no coordinate 'time' in channel '{channel}' (dimensions: "
                f"{', '.join(map(str, data[channel].dims)) or 'none'}). Give every channel the "
                "dimension 'time' and the instants in seconds, or select the channels to judge."
            )
    return names


def pair(**sides: xr.Dataset) -> Paired:
    """Take the channels of the first Dataset, at its instants, out of all.

    Instants are matched within a hundredth of a step; samples are matched one by one where a
    Dataset states no instants.
    """
    (first, reference), *others = sides.items()
    names = channel_names(reference, first)
    reference = reference[names]
    lead = tuple(str(dim) for dim in reference[names[0]].dims if dim != "time")
    arrays = {first: _stacked(reference, names, (*lead, "time"), first)}
    for side, data in others:
        known = [str(key) for key in data.data_vars]
        for name in names:
            if name not in known:
                raise RequestError(
                    f"{side} has no channel '{name}'.{did_you_mean(name, known)} It has: "
                    f"{', '.join(known)}. Select the channels to judge: {first}[['heave']]."
                )
            if data[name].dtype.kind not in "iufb":
                raise DataError(
                    f"channel '{name}' of {side} is of type {data[name].dtype}, not a real number. "
                    "Convert it."
                )
            units = [each[name].attrs.get("units") for each in (reference, data)]
            if all(units) and units[0] != units[1]:
                raise DataError(
                    f"channel '{name}' is in '{units[0]}' in {first} and in '{units[1]}' in "
                    f"{side}. Convert one of them and its units attribute."
                )
        channel_names(data[names], side)
        matched = _at_instants(data[names], reference, side, first)
        further = {str(dim) for dim in matched.dims} - {"time"}
        if strange := sorted(further - set(lead)):
            raise RequestError(
                f"{side} has the dimension '{strange[0]}' and {first} has not. Select one of it: "
                f"{side}.isel({strange[0]}=0)."
            )
        xr.align(reference, matched, join="exact", exclude={"time"})  # the same windows, members …
        values = _stacked(matched, names, (*(dim for dim in lead if dim in further), "time"), side)
        if further:
            missing = [axis for axis, dim in enumerate(lead) if dim not in further]
            values = np.broadcast_to(np.expand_dims(values, missing), arrays[first].shape)
        arrays[side] = values
    return Paired(names, lead, arrays)


def _stacked(data: xr.Dataset, names: list[str], order: tuple[str, ...], side: str) -> FloatArray:
    for name in names:
        if set(data[name].dims) != set(order):
            raise RequestError(
                f"channel '{name}' of {side} has the dimensions {data[name].dims}, and others have "
                f"{order}. Judge channels of the same dimensions together."
            )
    columns = [data[name].transpose(*order).values.astype(float, copy=False) for name in names]
    return np.stack(columns, axis=-1)


def _at_instants(data: xr.Dataset, reference: xr.Dataset, side: str, first: str) -> xr.Dataset:
    if "time" not in data.coords or "time" not in reference.coords:
        if data.sizes["time"] != reference.sizes["time"]:
            raise RequestError(
                f"{side} has {data.sizes['time']} samples along time and {first} "
                f"{reference.sizes['time']}; judge where both exist."
            )
        return data
    wanted = check_order(reference["time"].values, first)
    given = check_order(data["time"].values, side)
    if np.array_equal(wanted, given):
        return data
    step = usual_step(wanted)
    try:
        return data.sel(time=wanted, method="nearest", tolerance=INSTANT_TOLERANCE * step)
    except KeyError as error:
        raise DataError(
            f"{first} runs from {instant_text(wanted[0], step)} to "
            f"{instant_text(wanted[-1], step)} s and {side} from {instant_text(given[0], step)} to "
            f"{instant_text(given[-1], step)} s, and not every instant of the first is one of the "
            "second. Judge where both exist, on one time axis."
        ) from error
