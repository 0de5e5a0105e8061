"""Readers of measured files, one per format, chosen by the first bytes of a file, then its suffix.

A reader takes a path and :class:`Options` and returns :class:`Columns`. :data:`READERS` lists the
readers.
"""

from pathlib import Path

from seakeep.errors import DataError
from seakeep.files import reading
from seakeep.formats.columns import Columns, Options, Reader
from seakeep.formats.matlab import read_matlab
from seakeep.formats.netcdf import read_netcdf
from seakeep.formats.rosbag import read_recording
from seakeep.formats.tdms import read_tdms
from seakeep.formats.text import read_text

__all__ = ["READERS", "Columns", "Options", "Reader", "folder_reader", "read_columns"]

READERS = [
    Reader("NetCDF", read_netcdf, (b"CDF", b"\x89HDF"), (".nc", ".nc4")),
    Reader("HDF5", read_netcdf, (b"\x89HDF",), (".h5", ".hdf", ".hdf5")),
    Reader("MATLAB", read_matlab, (b"MATLAB",), (".mat",)),
    Reader("TDMS", read_tdms, (b"TDSm",), (".tdms",)),
    Reader("MCAP", read_recording, (b"\x89MCAP0\r\n",), (".mcap",)),
    Reader("ROS 2 bag", read_recording, (b"SQLite format 3\0",), (".db3",), "metadata.yaml"),
]
"""Readers of kinds known by their first bytes or suffix; the first one that fits is used."""

TEXT = Reader("text", read_text)
"""Reader of what no other one knows."""

_DATA = "Name the file that holds the run's samples."
_SHEET = "Save its sheet as CSV and name that file."
_TRACK = "Track the panel first, with `seakeep track`, and name the table that it writes."
_FOREIGN = (
    (b"\x89PNG\r\n", "a PNG picture", _DATA),
    (b"\xff\xd8\xff", "a JPEG picture", _DATA),
    (b"GIF8", "a GIF picture", _DATA),
    (b"%PDF-", "a PDF document", _DATA),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook of the old kind (or another Office file)", _SHEET),
    (b"PK\x03\x04", "an Excel workbook (or another ZIP archive)", _SHEET),
    (b"RIFF", "a recording in AVI or WAV", _TRACK),
    (b"\x1aE\xdf\xa3", "a video in Matroska", _TRACK),
)
"""Files that are not tables: what they start with, what they are, and what to do about them."""

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
    if folder := folder_reader(Path(path)):
        return folder.read(Path(path), options)
    with reading(path) as place:
        with place.open("rb") as file:
            head = file.read(HEAD)
        if not head:
            raise DataError(f"{path} is empty (0 bytes). Export the run again.")
        return _reader_of(place, head).read(place, options)


def folder_reader(path: Path) -> Reader | None:
    """Reader of a folder that is one recording; None for any other folder or file."""
    try:
        marked = (r for r in READERS if r.folder_mark and (path / r.folder_mark).is_file())
        return next(marked, None)
    except OSError:  # `reading` reports it
        return None


def _reader_of(path: Path, head: bytes) -> Reader:
    for reader in READERS:
        if head.startswith(reader.signatures):
            return reader
    for start, what, mend in _FOREIGN:
        if head.startswith(start):
            raise DataError(f"{path} is {what}, not a table. {mend}")
    if head[4:8] == b"ftyp":
        raise DataError(f"{path} is an MP4 video, not a table. {_TRACK}")
    reader = next((each for each in READERS if path.suffix.lower() in each.suffixes), TEXT)
    printable = all(byte >= 0x20 or byte in b"\t\n\r\f" for byte in head) and b"\x7f" not in head
    if reader is not TEXT and printable and len(head) >= 8:
        shown = head[:24].decode("latin-1").splitlines()[0] if head.strip() else ""
        raise DataError(
            f"{path} is not a valid {reader.kind} file: it holds text and starts with {shown!r}. "
            "If it is a table, name it .csv or .txt; else copy or export it again."
        )
    return reader
