"""Files that are not tables, recognised by their first bytes, and what to do about them."""

from __future__ import annotations

from pathlib import Path

from seakeep.errors import DataError

__all__ = ["refuse_foreign", "refuse_text"]

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


def refuse_foreign(path: Path, head: bytes) -> None:
    """Refuse pictures, workbooks, videos and the like by their first bytes."""
    for start, what, mend in _FOREIGN:
        if head.startswith(start):
            raise DataError(f"{path} is {what}, not a table. {mend}")
    if head[4:8] == b"ftyp":
        raise DataError(f"{path} is an MP4 video, not a table. {_TRACK}")


def refuse_text(path: Path, head: bytes, kind: str) -> None:
    """Refuse text under the name of a binary format."""
    printable = all(byte >= 0x20 or byte in b"\t\n\r\f" for byte in head)
    if printable and len(head) >= 8 and b"\x7f" not in head:
        shown = head[:24].decode("latin-1").splitlines()[0] if head.strip() else ""
        raise DataError(
            f"{path} is not a valid {kind} file: it holds text and starts with {shown!r}. If it is "
            "a table, name it .csv or .txt; else copy or export it again."
        )
