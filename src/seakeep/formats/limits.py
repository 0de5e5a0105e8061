"""Opening of HDF5 files of others."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

import h5py

from seakeep.errors import DataError

__all__ = ["open_hdf5"]


@contextlib.contextmanager
def open_hdf5(path: Path) -> Iterator[h5py.File]:
    """Open an HDF5 file to be read; a DataError says where it is cut off or damaged."""
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, RuntimeError, KeyError) as error:
        raise DataError(
            f"{path} cannot be read as HDF5: cut off, damaged or of another kind ({error}). Copy "
            "or download it again."
        ) from None
