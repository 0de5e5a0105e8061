"""Readers of measured files, one per format, chosen by the first bytes of a file, then its suffix.

A reader takes a path and :class:`Options` and returns :class:`Columns`. :data:`READERS` lists the
readers.
"""

from __future__ import annotations

from pathlib import Path

from seakeep.errors import DataError
from seakeep.files import reading
from seakeep.formats.columns import Columns
from seakeep.formats.foreign import refuse_foreign, refuse_text
from seakeep.formats.matlab import read_matlab
from seakeep.formats.netcdf import read_netcdf
from seakeep.formats.reader import Options, Reader
from seakeep.formats.rosbag import read_recording
from seakeep.formats.tdms import read_tdms
from seakeep.formats.text import read_text

__all__ = ["READERS", "Columns", "Options", "Reader", "is_recording_folder", "read_columns"]

READERS = [
    Reader("NetCDF", read_netcdf, (b"CDF", b"\x89HDF"), (".nc", ".nc4")),
    Reader("HDF5", read_netcdf, (b"\x89HDF",), (".h5", ".hdf", ".hdf5")),
    Reader("MATLAB", read_matlab, (b"MATLAB",), (".mat",)),
    Reader("TDMS", read_tdms, (b"TDSm",), (".tdms",)),
    Reader("MCAP", read_recording, (b"\x89MCAP0\r\n",), (".mcap",)),
    Reader("ROS 2 bag", read_recording, (b"SQLite format 3\0",), (".db3",), "metadata.yaml"),
]
"""Readers of all kinds of files but text; the first one that fits is used."""

TEXT = Reader("text", read_text)
"""Reader of what no other one knows."""

HEAD = 600
"""Bytes from which a kind is recognised."""


def read_columns(path: Path | str, options: Options | None = None) -> Columns:
    """Read the columns of a file, without a look at its time axis.

    Parameters
    ----------
    path : Path or str
        The file; its kind is recognised by its first bytes, then by its suffix.
    options : Options, optional
        What is known about the file.

    Returns
    -------
    Columns
        Its columns.

    Raises
    ------
    MissingFileError
        If there is no such file, or it cannot be read.
    DataError
        If it is empty, damaged or of no kind that is read.
    """
    options = options or Options()
    if (folder := _folder_reader(Path(path))) is not None:
        return folder.read(Path(path), options)
    with reading(path) as place:
        with place.open("rb") as file:
            head = file.read(HEAD)
        if not head:
            raise DataError(f"{path} is empty (0 bytes). Export the run again.")
        return _reader_of(place, head).read(place, options)


def is_recording_folder(path: Path) -> bool:
    """Whether a folder is read as one recording."""
    return _folder_reader(path) is not None


def _folder_reader(path: Path) -> Reader | None:
    try:
        marked = (r for r in READERS if r.folder_mark and (path / r.folder_mark).is_file())
        return next(marked, None)
    except OSError:  # `reading` reports it
        return None


def _reader_of(path: Path, head: bytes) -> Reader:
    for reader in READERS:
        if head.startswith(reader.signatures):
            return reader
    refuse_foreign(path, head)
    for reader in READERS:
        if path.suffix.lower() in reader.suffixes:
            refuse_text(path, head, reader.kind)
            return reader
    return TEXT
