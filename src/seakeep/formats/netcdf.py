"""Tables in NetCDF and HDF5 files."""

import io
import warnings
from pathlib import Path
from typing import Any

import xarray as xr

from seakeep.errors import DataError, did_you_mean
from seakeep.formats.columns import WHICH, Columns, Options, decoding

WIDEST = 64
"""Columns of a two-dimensional set beyond which it is a picture or a field, not channels."""


def read_netcdf(path: Path, options: Options) -> Columns:
    """Read a NetCDF or HDF5 file: one variable per channel, all along one dimension.

    A set of shape (time, n) is split: by the labels of its second dimension, or ``NAME_1`` to
    ``NAME_n``; a vector may have the shape (1, time), as MATLAB writes it. `group` may be left out
    where one group alone holds channels.
    """
    dataset = opened_netcdf(path, options.group)
    flat: dict[str, xr.DataArray] = {}
    faults = {}
    for name in dataset.variables:
        array = dataset[name]
        if array.dtype.kind in "fiub" and array.size > 1:
            try:
                flat |= _split(path, str(name), array)
            except DataError as error:
                faults[str(name)] = str(error)
    if not flat and not faults:
        raise DataError(
            f"{path} holds no channels; found variables {', '.join(map(str, dataset.variables))}. "
            "Expected one variable per channel along one dimension."
        )
    dims = [array.dims[0] for array in flat.values()]
    axis = "time" if "time" in dims else max(dims, key=dims.count, default="time")
    if options.time in flat:
        axis = flat[options.time].dims[0]
    values, units = {}, {}
    for name, array in flat.items():
        if array.dims != (axis,):
            faults[name] = (
                f"{path}: '{name}' has {array.size} values along '{array.dims[0]}', and the time "
                f"{dataset.sizes[axis]} along '{axis}'. Save channels of one clock, each as long "
                "as the time, or put each clock's channels into a file of its own."
            )
            continue
        values[name] = array.values.astype(float)
        if (said := array.attrs.get("units", array.attrs.get("unit"))) is not None:
            units[name] = _text(said)
    return Columns(values, units, faults)


def _text(attribute: Any) -> str:
    """Text of an attribute, which HDF5 may hold as bytes of any encoding."""
    if not isinstance(attribute, bytes):
        return str(attribute)
    try:
        return attribute.decode()
    except UnicodeDecodeError:
        return attribute.decode("latin-1")


def opened_netcdf(path: Path, group: str | None) -> xr.Dataset:
    """Variables of a NetCDF or HDF5 file; a DataError says where it is cut off or damaged."""
    with path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    what = "NetCDF or HDF5: cut off, damaged or of another kind"
    with decoding(path, what, "Copy or download it again."), warnings.catch_warnings():
        warnings.simplefilter("ignore", UnicodeWarning)  # units in another encoding: see _text
        if classic:  # of a damaged file that it maps, scipy leaves the file open
            content = io.BytesIO(path.read_bytes())
            return xr.load_dataset(content, decode_times=False, engine="scipy")
        return xr.load_dataset(
            path,
            decode_times=False,
            engine="h5netcdf",
            group=_group(path, group),
            phony_dims="sort",
        )


def _group(path: Path, wanted: str | None) -> str | None:
    """Group of an HDF5 file that is read: the one stated, the root, or the only one with sets."""
    import h5py  # here, so that files of other kinds are read without HDF5

    holding: dict[str, int] = {}

    def look(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and item.ndim and item.dtype.kind in "fiub":
            parent = name.rpartition("/")[0]
            holding[parent] = holding.get(parent, 0) + 1

    with h5py.File(path) as file:
        file.visititems(look)
        listed = ", ".join(f"'{name}' ({count} sets)" for name, count in holding.items() if name)
        if wanted is not None and not isinstance(file.get(wanted), h5py.Group):
            raise DataError(
                f"{path} has no group '{wanted}'.{did_you_mean(wanted, filter(None, holding))} "
                f"Its groups: {listed or 'none'}. Correct 'group' in [files]."
            )
    if wanted is not None or "" in holding or not holding:
        return wanted
    if len(holding) > 1:
        raise DataError(f"{path} holds no channels outside its groups: {listed}. {WHICH}")
    return next(iter(holding))


def _split(path: Path, name: str, array: xr.DataArray) -> dict[str, xr.DataArray]:
    """Channels of a variable: itself, or its columns where it has two dimensions."""
    if array.ndim == 2 and array.shape[0] == 1:
        array = array[0]
    if array.ndim == 1:
        return {name: array}
    if array.ndim > 2:
        raise DataError(
            f"{path}: '{name}' has {array.ndim} dimensions {tuple(array.shape)}, and a channel has "
            "one. Save its parts as variables of their own."
        )
    (first, second), (rows, count) = array.dims, array.shape
    if second == "time" or (first != "time" and rows < count):
        raise DataError(
            f"{path}: '{name}' has dimensions ({first}: {rows}, {second}: {count}), which "
            "looks transposed; expected time first, (time, channel). Save it transposed: nothing "
            "is turned silently."
        )
    labels = array.coords.get(second)
    if labels is not None and labels.dtype.kind in "UOST":
        return {str(label): array[:, i] for i, label in enumerate(labels.values)}
    if count > WIDEST:
        raise DataError(
            f"{path}: '{name}' has {count} columns without names; beyond {WIDEST} it is taken for "
            "a field, not for channels. Save its columns as variables of their own."
        )
    return {f"{name}_{i + 1}": array[:, i] for i in range(count)}
