"""Variables of a MATLAB file of version 7.3, which is HDF5 with conventions of its own.

MATLAB stores an array with its dimensions in the opposite order, a struct as a group, a cell array
as references, a text as UTF-16 code units, and says which by the attribute ``MATLAB_class``.
Source: the layout that ``save -v7.3`` writes; MathWorks documents that it is HDF5, and no more.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

from seakeep.errors import DataError

__all__ = ["is_version_73", "load_version_73"]

HEADER = b"MATLAB 7."
"""Older files begin with ``MATLAB 5.0 MAT-file``, whichever release wrote them."""
DEEPEST = 16
"""Structs and cells one in another beyond this are no measurement."""


def is_version_73(path: Path) -> bool:
    """Whether a file begins as MATLAB's files of version 7.3 do."""
    with path.open("rb") as file:
        return file.read(len(HEADER)) == HEADER


def load_version_73(path: Path) -> dict[str, Any]:
    """Load the variables of a MATLAB file of version 7.3.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    dict of str to object
        As ``scipy.io.loadmat(…, simplify_cells=True)`` gives those of older versions: arrays
        squeezed, structs as dictionaries, cell arrays as object arrays, texts as str. Variables
        of classes that HDF5 alone does not explain (table, timetable, string …) are left out.

    Raises
    ------
    DataError
        If the file is cut off or damaged, or holds nothing but such classes.
    """
    opaque: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:
            found = {
                name: _value(file, item, opaque, name, 0)
                for name, item in file.items()
                if not name.startswith("#")
            }
    except (OSError, KeyError, ValueError, RuntimeError, TypeError, IndexError) as error:
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise DataError(
            f"{path} cannot be read as a MATLAB file of version 7.3: cut off or damaged ({said}). "
            "Save it again with save(…, '-v7.3')."
        ) from None
    found = {name: value for name, value in found.items() if value is not None}
    if opaque and not found:
        listed = ", ".join(f"{name} ({kind})" for name, kind in opaque.items())
        raise DataError(
            f"{path} holds only variables that MATLAB alone can read: {listed}. Save the columns "
            "as a struct of vectors: run = table2struct(T, 'ToScalar', true)."
        )
    return found


def _class(item: h5py.Dataset | h5py.Group) -> str:
    kind = item.attrs.get("MATLAB_class", b"")
    return kind.decode("ascii", "replace") if isinstance(kind, bytes) else str(kind)


def _value(
    file: h5py.File, item: h5py.Dataset | h5py.Group, opaque: dict[str, str], name: str, depth: int
) -> Any:
    """Value of a variable, a field or a cell; None if it cannot be understood."""
    if depth > DEEPEST:
        raise ValueError("structs and cells nest without end")
    kind = _class(item)
    if "MATLAB_sparse" in item.attrs or "MATLAB_object_decode" in item.attrs:
        opaque[name] = "sparse" if "MATLAB_sparse" in item.attrs else kind
        return None
    if isinstance(item, h5py.Group):
        fields = {
            key: _value(file, field, opaque, f"{name}.{key}", depth + 1)
            for key, field in item.items()
        }
        return {key: value for key, value in fields.items() if value is not None}
    if "MATLAB_empty" in item.attrs:
        return "" if kind == "char" else np.empty(0)
    raw = item[()]
    if item.dtype == h5py.ref_dtype:
        # Row by row as HDF5 has it is column by column as MATLAB has it.
        cells = np.empty(raw.size, dtype=object)
        for i, reference in enumerate(raw.ravel()):
            cells[i] = _value(file, file[reference], opaque, f"{name}{{{i + 1}}}", depth + 1)
        return cells
    if kind == "char":
        return _text(raw)
    return _number(np.asarray(raw), kind)


def _text(raw: Any) -> Any:
    rows = [
        row.astype("<u2").tobytes().decode("utf-16-le", "replace").rstrip()
        for row in np.atleast_2d(np.asarray(raw).T)
    ]
    return rows[0] if len(rows) == 1 else np.array(rows, dtype=object)


def _number(raw: np.ndarray[Any, Any], kind: str) -> Any:
    if raw.dtype.names == ("real", "imag"):
        raw = raw["real"] + 1j * raw["imag"]
    array = raw.T.squeeze()
    if kind == "logical":
        array = array.astype(bool)
    return array[()] if array.ndim == 0 else array
