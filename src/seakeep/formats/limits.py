"""How much a file may unpack to, and what it may declare to hold."""

from __future__ import annotations

from pathlib import Path

import h5py

from seakeep.errors import DataError

__all__ = ["check_declared", "most_bytes"]

FREE = 2**28
"""Bytes that a file may unpack to, for any size of the file."""

EXPANSION = 100
"""Times its own size that a larger one may unpack to; tables of numbers reach 10, constants 50."""


def most_bytes(stored: int) -> int:
    """Bytes that so many stored bytes may unpack to."""
    return max(FREE, EXPANSION * stored)


def check_declared(path: Path, file: h5py.File) -> None:
    """Refuse an HDF5 file with a set that declares far more values than it stores."""

    def look(name: str, item: h5py.Dataset | h5py.Group) -> None:
        if not isinstance(item, h5py.Dataset) or item.size is None:
            return
        declared, stored = item.size * item.dtype.itemsize, item.id.get_storage_size()
        if declared > most_bytes(stored):
            raise DataError(
                f"{path}: '{name}' declares {item.size} values ({declared / 2**20:.0f} MiB), and "
                f"{stored / 2**20:.3g} MiB are stored: it was never filled, or is damaged. Save "
                "what was measured alone."
            )

    file.visititems(look)
