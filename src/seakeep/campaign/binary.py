"""Tables in binary files: MATLAB version 5 to 7.3, NetCDF and HDF5."""

from __future__ import annotations

import struct
import warnings
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy
import xarray as xr

from seakeep.campaign.columns import Columns, unique_names
from seakeep.campaign.hdf5_mat import is_version_73, load_version_73
from seakeep.campaign.settings import FileSettings
from seakeep.errors import DataError

__all__ = ["read_matlab", "read_netcdf"]

FloatArray = npt.NDArray[np.float64]

_NAME_KEYS = ("names", "channels", "labels", "channel_names", "name")
_UNIT_KEYS = ("units", "unit")
_RATE_KEYS = ("fs", "Fs", "FS", "sampling_rate", "sample_rate")
_STEP_KEYS = ("dt", "Ts", "DT")


def read_matlab(path: Path, options: FileSettings) -> Columns:
    """Read a MATLAB file: vectors, one struct of vectors, or a matrix with a list of names.

    Parameters
    ----------
    path : Path
        The file, of version 5 to 7.3 (what ``save -v7`` and ``save -v7.3`` write).
    options : FileSettings
        Not used: the file tells all.

    Returns
    -------
    Columns
        Its channels. Units are taken from ``units``: a struct of texts, or a list beside the names.

    Raises
    ------
    DataError
        If the file is damaged, or its channels differ in length.
    """
    content = load_version_73(path) if is_version_73(path) else _load_older(path)
    found = {key: value for key, value in content.items() if not key.startswith("__")}
    found = _unwrapped(found)
    rate = _rate(found)
    named, units = _named_matrix(path, found), _units(found)
    vectors = named or _vectors(path, found)
    _check_lengths(path, vectors)
    names, in_headers = unique_names(vectors)
    for name, unit in zip(names, in_headers, strict=True):
        if unit is not None:
            units.setdefault(name, unit)
    values = dict(zip(names, vectors.values(), strict=True))
    return Columns(
        values=values,
        units={name: unit for name, unit in units.items() if name in values},
        headers=dict(zip(names, vectors, strict=True)),
        sampling_rate=rate,
    )


def _unwrapped(found: dict[str, Any]) -> dict[str, Any]:
    """What the only struct of a file holds, with the numbers and texts that stand beside it."""
    while True:
        structs = [key for key, value in found.items() if isinstance(value, dict)]
        beside = {key: value for key, value in found.items() if not isinstance(value, dict)}
        plain = all(isinstance(value, str) or np.size(value) == 1 for value in beside.values())
        if len(structs) != 1 or structs[0] in _UNIT_KEYS or not plain:
            return found
        found = {**beside, **found[structs[0]]}


def _load_older(path: Path) -> dict[str, Any]:
    try:
        content: dict[str, Any] = scipy.io.loadmat(path, simplify_cells=True)
    except (ValueError, TypeError, OSError, EOFError, NotImplementedError, KeyError, IndexError,
            zlib.error, struct.error, MemoryError) as error:  # fmt: skip
        raise DataError(
            f"{path} cannot be read as a MATLAB file: cut off or damaged ({error}). Save it again "
            "with save(…, '-v7')."
        ) from None
    return content


def _rate(found: Mapping[str, Any]) -> float | None:
    for keys, inverse in ((_RATE_KEYS, False), (_STEP_KEYS, True)):
        for key in keys:
            value = found.get(key)
            if isinstance(value, int | float | np.number) and value > 0:
                return 1.0 / float(value) if inverse else float(value)
    return None


def _texts(value: Any) -> list[str] | None:
    if isinstance(value, str):
        return None
    cells = list(np.atleast_1d(np.asarray(value, dtype=object)))
    return [cell.strip() for cell in cells] if all(isinstance(c, str) for c in cells) else None


def _first(found: Mapping[str, Any], keys: tuple[str, ...]) -> Any:
    return next((found[key] for key in keys if key in found), None)


def _units(found: Mapping[str, Any]) -> dict[str, str]:
    units = _first(found, _UNIT_KEYS)
    if isinstance(units, dict):
        return {name: unit for name, unit in units.items() if isinstance(unit, str)}
    names, listed = _texts(_first(found, _NAME_KEYS)), None if units is None else _texts(units)
    if names and listed and len(names) == len(listed):
        return dict(zip(names, listed, strict=True))
    return {}


def _named_matrix(path: Path, found: Mapping[str, Any]) -> dict[str, FloatArray]:
    """Columns of a matrix beside which their names stand; empty if there is none."""
    raw = _first(found, _NAME_KEYS)
    names = None if raw is None else _texts(raw)
    if not names:
        return {}
    matrices = {k: v for k, v in found.items() if isinstance(v, np.ndarray) and v.ndim == 2}
    for key, matrix in matrices.items():
        if not np.issubdtype(matrix.dtype, np.number):
            continue
        rows, columns = matrix.shape
        if columns == len(names):
            out = {n: matrix[:, i].astype(float) for i, n in enumerate(names)}
            vectors = {
                k: v.astype(float)
                for k, v in found.items()
                if isinstance(v, np.ndarray) and v.dtype.kind in "fiu" and v.shape == (rows,)
            }
            return {**vectors, **out}
        if rows == len(names):
            raise _transposed(path, key, matrix.shape)
    shapes = ", ".join(f"{key} {value.shape}" for key, value in matrices.items()) or "none"
    raise DataError(
        f"{path} lists {len(names)} channel names, and no matrix has as many columns (matrices: "
        f"{shapes}). A matrix is (time, channel), one name a column."
    )


def _transposed(path: Path, key: str, shape: tuple[int, ...]) -> DataError:
    return DataError(
        f"{path}: '{key}' has shape {shape}, which looks transposed; expected (time, channel) = "
        f"({shape[1]}, {shape[0]}). Save it transposed: nothing is turned silently."
    )


def _vectors(path: Path, found: Mapping[str, Any]) -> dict[str, FloatArray]:
    vectors, matrices = {}, {}
    for name, value in found.items():
        array = np.asarray(value) if not isinstance(value, str | dict) else np.empty(0, object)
        if not (np.issubdtype(array.dtype, np.number) or array.dtype == bool) or array.size < 2:
            continue
        if np.iscomplexobj(array) or array.ndim > 2:
            continue
        if array.ndim == 1:
            vectors[name] = array.astype(float)
        else:
            matrices[name] = array
    if vectors:
        return vectors
    for name, matrix in matrices.items():
        if matrix.shape[0] < matrix.shape[1]:
            raise _transposed(path, name, matrix.shape)
        raise DataError(
            f"{path}: the matrix '{name}' {matrix.shape} has no names for its columns. Save a cell "
            "array 'names' beside it, or one vector a channel."
        )
    raise DataError(
        f"{path} holds no channels; found {', '.join(found) or 'nothing'}. Save one vector a "
        "channel, a struct of vectors, or a matrix (time, channel) with a cell array 'names'."
    )


def _check_lengths(path: Path, vectors: Mapping[str, FloatArray]) -> None:
    lengths = {name: vector.size for name, vector in vectors.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise DataError(
            f"{path}: the channels differ in length ({listed}). Save channels of one clock, each "
            "as long as the time."
        )


def read_netcdf(path: Path, options: FileSettings) -> Columns:
    """Read a NetCDF or HDF5 file: one variable a channel, all along one dimension.

    Parameters
    ----------
    path : Path
        The file.
    options : FileSettings
        Only `group` is used.

    Returns
    -------
    Columns
        Its channels, with the units of their attributes.

    Raises
    ------
    DataError
        If the file is damaged, holds no channels, or holds them transposed.
    """
    dataset = _opened(path, options.group)
    flat: dict[str, xr.DataArray] = {}
    tables: dict[str, xr.DataArray] = {}
    for name, variable in dataset.variables.items():
        array = dataset[name] if name in dataset else xr.DataArray(variable)
        if array.dtype.kind not in "fiub":
            continue
        if array.ndim == 1 and array.size > 1:
            flat[str(name)] = array
        elif array.ndim == 2:
            tables[str(name)] = array
    faults: dict[str, str] = {}
    axes = {array.dims[0] for array in flat.values()}
    if len(axes) > 1:
        axis = _time_axis(flat, options.time)
        length = next(array.size for array in flat.values() if array.dims == (axis,))
        faults = {
            name: f"{path}: '{name}' has {array.size} values along '{array.dims[0]}', and the time "
            f"{length} along '{axis}'. Save channels of one clock, each as long as the time, or "
            "put each clock's channels into a file of its own."
            for name, array in flat.items()
            if array.dims != (axis,)
        }
        flat = {name: array for name, array in flat.items() if array.dims == (axis,)}
    for name, table in tables.items():
        flat.update(_split_table(path, name, table))
    if not flat:
        raise DataError(
            f"{path} holds no channels; found variables {', '.join(map(str, dataset.variables))} . "
            "Expected one variable a channel along one dimension; state 'group' in [files] if they "
            "are in a group."
        )
    values = {name: array.to_numpy().astype(float) for name, array in flat.items()}
    _check_lengths(path, values)
    units = {
        name: _text(array.attrs["units"]) for name, array in flat.items() if "units" in array.attrs
    }
    headers = {name: name for name in [*values, *faults]}
    return Columns(values=values, units=units, faults=faults, headers=headers)


def _text(attribute: Any) -> str:
    """Text of an attribute, which HDF5 may hold as bytes of any encoding."""
    if not isinstance(attribute, bytes):
        return str(attribute)
    try:
        return attribute.decode("utf-8")
    except UnicodeDecodeError:
        return attribute.decode("latin-1")


def _opened(path: Path, group: str | None) -> xr.Dataset:
    with path.open("rb") as file:
        classic = file.read(3) == b"CDF"
    how: dict[str, Any] = {"engine": "scipy"}
    if not classic:
        how = {"engine": "h5netcdf", "group": group, "phony_dims": "sort"}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UnicodeWarning)  # units in another encoding: see _text
            with xr.open_dataset(path, decode_times=False, **how) as opened:
                return opened.load()
    except (OSError, ValueError, TypeError, KeyError, IndexError, EOFError, RuntimeError,
            AttributeError, struct.error, zlib.error) as error:  # fmt: skip
        if group is not None and isinstance(error, OSError) and "group" in str(error).lower():
            raise DataError(f"{path} has no group '{group}'. Correct 'group' in [files].") from None
        raise DataError(
            f"{path} cannot be read as NetCDF or HDF5: cut off, damaged or of another kind "
            f"({str(error).splitlines()[0] if str(error) else type(error).__name__}). "
            "Copy or download it again."
        ) from None


def _time_axis(flat: Mapping[str, xr.DataArray], time: str | None) -> object:
    if time is not None and time in flat:
        return flat[time].dims[0]
    dims = [array.dims[0] for array in flat.values()]
    return "time" if "time" in dims else max(set(dims), key=dims.count)


def _split_table(path: Path, name: str, table: xr.DataArray) -> dict[str, xr.DataArray]:
    """Columns of a two-dimensional variable whose second dimension has names."""
    first, second = table.dims
    shape = tuple(table.shape)
    if second == "time" or (first != "time" and shape[0] < shape[1]):
        raise DataError(
            f"{path}: '{name}' has dimensions ({first}: {shape[0]}, {second}: {shape[1]}), which "
            "looks transposed; expected time first, (time, channel). Save it transposed: nothing "
            "is turned silently."
        )
    labels = table.coords.get(second)
    if labels is None or labels.dtype.kind not in "UOST":
        return {}
    return {str(label): table[:, i] for i, label in enumerate(labels.to_numpy())}
