"""Tables in MATLAB files of every version."""

import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.errors import DataError
from seakeep.formats.columns import Columns, Options, decoding, unique_names

_NAME_KEYS = ("names", "channels", "labels", "channel_names", "name")
_UNIT_KEYS = ("units", "unit")
_RATE_KEYS = ("fs", "Fs", "FS", "sampling_rate", "sample_rate")
_STEP_KEYS = ("dt", "Ts", "DT")
_VERSION_73 = b"MATLAB 7."
"""Older files start with ``MATLAB 5.0 MAT-file``, whichever release wrote them."""
_TIMES = ("time", "Time", "t")
_SAVE = (
    "Save one vector per channel, one struct of vectors (run.time, run.heave, …) without structs "
    "in it, or a matrix (time, channel) with a cell array 'names'."
)


def read_matlab(path: Path, options: Options) -> Columns:
    """Read a MATLAB file: vectors, one struct of vectors, or a matrix with a list of names.

    Units are taken from ``units``: a struct of texts, or a list beside the names. What is not read
    is a fault: a vector of another length than the time, a struct, a list of units without names.
    """
    content = _unwrapped({k: v for k, v in _loaded(path).items() if not k.startswith(("__", "#"))})
    vectors = _channels(path, content)
    sizes = [vector.size for vector in vectors.values()]
    clock = next((name for name in (options.time, *_TIMES) if name in vectors), None)
    length = vectors[clock].size if clock else max(sizes, key=sizes.count)
    names, in_headers = unique_names(vectors)
    said = {name: unit for name, unit in zip(names, in_headers, strict=True) if unit is not None}
    units = said | _units(content)
    values = dict(zip(names, vectors.values(), strict=True))
    faults = {
        name: f"'{name}' has {vector.size} values, and {'the time' if clock else 'most'} {length}. "
        "Save channels of one clock, each as long as the time, or each clock's into its own file."
        for name, vector in values.items()
        if vector.size != length
    }
    for key, value in content.items():
        if key not in _UNIT_KEYS and isinstance(value, dict) and _length(value) > 1:
            faults[key] = f"'{key}' is a struct beside other channels. {_SAVE}"
        elif key in _UNIT_KEYS and not units and np.size(value) > 1:
            faults[key] = (
                f"'{key}' lists {np.size(value)} units, and no list says of which columns. Save a "
                f"cell array 'names' of as many beside it, or a struct: {key}.heave = 'mm'."
            )
    return Columns(
        values={name: vector for name, vector in values.items() if name not in faults},
        units=units,
        faults={name: f"{path}: {words}" for name, words in faults.items()},
        headers=dict(zip(names, vectors, strict=True)),
        sampling_rate=_rate(content),
    )


def _loaded(path: Path) -> dict[str, Any]:
    """Variables of a file; those that MATLAB alone can read are left out."""
    from pymatreader import read_mat  # here, since it takes half a second that few need

    with path.open("rb") as file:
        hdf5 = file.read(len(_VERSION_73)) == _VERSION_73
    what = f"a MATLAB file of version {'7.3' if hdf5 else '5'}: cut off or damaged"
    with decoding(path, what, "Save it again from MATLAB."), warnings.catch_warnings():
        opaque = _opaque(path) if hdf5 else {}
        warnings.simplefilter("ignore")  # of classes: they are not channels
        content = read_mat(path, ignore_fields=[name.rpartition("/")[2] for name in opaque])
    # HDF5 keeps no order, and pymatreader hands names on as a set.
    tidy = _tidy(content, in_order=hdf5)
    if opaque and not tidy:
        listed = ", ".join(f"{name} ({kind})" for name, kind in opaque.items())
        raise DataError(
            f"{path} holds only variables that MATLAB alone can read: {listed}. Save the columns "
            "as a struct of vectors: run = table2struct(T, 'ToScalar', true)."
        )
    return tidy


def _tidy(value: Any, in_order: bool) -> Any:
    """Structs with their fields in an order, cells as arrays of objects."""
    if isinstance(value, dict):
        items = sorted(value.items()) if in_order else value.items()
        return {key: _tidy(each, in_order) for key, each in items}
    if isinstance(value, list):
        cells = np.empty(len(value), object)
        cells[:] = [_tidy(each, in_order) for each in value]
        return cells
    return value


def _opaque(path: Path) -> dict[str, str]:
    """Variables and fields that only MATLAB can read (table, string, sparse …), with their kind."""
    import h5py

    opaque = {}

    def look(name: str, item: Any) -> None:
        if name.startswith("#"):
            return
        if "MATLAB_sparse" in item.attrs:
            opaque[name] = "sparse"
        elif "MATLAB_object_decode" in item.attrs:
            opaque[name] = bytes(item.attrs.get("MATLAB_class", b"object")).decode(
                "ascii", "replace"
            )

    with h5py.File(path) as file:
        file.visititems(look)
    return opaque


def _unwrapped(content: dict[str, Any]) -> dict[str, Any]:
    """What the longest struct of a file holds, with all that is shorter beside it."""
    while True:
        longest = max(map(_length, content.values()), default=0)
        long = [key for key, value in content.items() if _length(value) == longest]
        if len(long) != 1 or not isinstance(content[long[0]], dict):
            return content
        content |= content.pop(long[0])


def _length(value: Any) -> int:
    """Numbers or texts in the longest array of a variable."""
    if isinstance(value, dict):
        return max(map(_length, value.values()), default=0)
    return np.size(value)


def _rate(content: Mapping[str, Any]) -> float | None:
    for key in (*_RATE_KEYS, *_STEP_KEYS):
        value = content.get(key)
        if isinstance(value, int | float | np.number) and value > 0:
            return 1.0 / value if key in _STEP_KEYS else float(value)
    return None


def _first(content: Mapping[str, Any], keys: tuple[str, ...]) -> Any:
    return next((content[key] for key in keys if key in content), None)


def _texts(content: Mapping[str, Any], keys: tuple[str, ...]) -> list[str]:
    """Texts of a list under one of the keys; none where it holds others."""
    value = _first(content, keys)
    cells = [] if isinstance(value, str) else list(np.atleast_1d(np.asarray(value, object)))
    return [cell.strip() for cell in cells] if all(isinstance(c, str) for c in cells) else []


def _units(content: Mapping[str, Any]) -> dict[str, str]:
    units = _first(content, _UNIT_KEYS)
    if isinstance(units, dict):
        return {name: unit for name, unit in units.items() if isinstance(unit, str)}
    names, listed = _texts(content, _NAME_KEYS), _texts(content, _UNIT_KEYS)
    return dict(zip(names, listed, strict=True)) if len(names) == len(listed) else {}


def _channels(path: Path, content: Mapping[str, Any]) -> dict[str, FloatArray]:
    """Vectors of a file, and the columns of a matrix beside which their names stand."""
    arrays = {
        key: array.astype(float)
        for key, value in content.items()
        if (array := np.asarray(value)).dtype.kind in "fiub" and array.size > 1
    }
    vectors = {key: array for key, array in arrays.items() if array.ndim == 1}
    names = _texts(content, _NAME_KEYS)
    if vectors and not names:
        return vectors
    matrices = {key: array for key, array in arrays.items() if array.ndim == 2}
    for key, matrix in matrices.items():
        rows, columns = matrix.shape
        if names and columns == len(names):
            return vectors | dict(zip(names, matrix.T.copy(), strict=True))
        if rows == len(names) or (not names and rows < columns):
            raise DataError(
                f"{path}: '{key}' has shape {matrix.shape}, which looks transposed; expected "
                f"(time, channel) = ({columns}, {rows}). Save it transposed: nothing is turned "
                "silently."
            )
    if names or matrices:
        shapes = ", ".join(f"{key} {value.shape}" for key, value in matrices.items()) or "none"
        raise DataError(
            f"{path} lists {len(names)} channel names, and no matrix has as many columns "
            f"(matrices: {shapes}). A matrix is (time, channel), beside a cell array 'names' with "
            "one name per column."
        )
    raise DataError(f"{path} holds no channels; found {', '.join(content) or 'nothing'}. {_SAVE}")
