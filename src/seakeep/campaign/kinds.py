"""What kind of file a file is, by its first bytes; and what to do about one that is no table."""

from __future__ import annotations

from pathlib import Path

from seakeep.errors import DataError

__all__ = ["refuse_foreign"]

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
_BINARY = {
    ".mat": "a MATLAB file",
    ".nc": "a NetCDF file",
    ".nc4": "a NetCDF file",
    ".h5": "an HDF5 file",
    ".hdf": "an HDF5 file",
    ".hdf5": "an HDF5 file",
    ".tdms": "a TDMS file",
    ".mcap": "an MCAP file",
    ".db3": "a ROS 2 bag",
}
_OURS = (b"MATLAB", b"\x89HDF", b"CDF", b"TDSm", b"\x89MCAP", b"SQLite format 3")


def refuse_foreign(path: Path, head: bytes) -> None:
    """Refuse pictures, workbooks and the like, and text under the name of a binary format.

    Parameters
    ----------
    path : Path
        The file.
    head : bytes
        Its first bytes, a few hundred.

    Raises
    ------
    DataError
        If it is none of the kinds that are read; the message says what it is instead.
    """
    for begin, what, mend in _FOREIGN:
        if head.startswith(begin):
            raise DataError(f"{path} is {what}, and no table. {mend}")
    if head[4:8] == b"ftyp":
        raise DataError(f"{path} is a video in MP4, and no table. {_TRACK}")
    kind = _BINARY.get(path.suffix.lower())
    if kind is not None and not head.startswith(_OURS) and _is_text(head):
        shown = head[:24].decode("latin-1").splitlines()[0] if head.strip() else ""
        raise DataError(
            f"{path} is no {kind.partition(' ')[2]}: it holds text and begins with {shown!r}. If "
            "it is a table, name it .csv or .txt; else copy or export it again."
        )


def _is_text(head: bytes) -> bool:
    """Whether bytes are printable: no control characters but white space."""
    plain = all(byte >= 0x20 or byte in b"\t\n\r\f" for byte in head)
    return plain and len(head) >= 8 and b"\x7f" not in head
