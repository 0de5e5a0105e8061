"""Checksums of files; a file is read again only after it has changed."""

from __future__ import annotations

import hashlib
import os
import time
from pathlib import Path

__all__ = ["sha256_of"]

SETTLED = 2.0
"""Seconds for which a file must have been left alone before its checksum is remembered.

Within the resolution of a file system's clock, 2 s at worst (FAT), a second change leaves the times
of a file as they were.
"""

_KNOWN: dict[Path, tuple[tuple[int, ...], str]] = {}


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's content, in hexadecimal digits.

    Parameters
    ----------
    path : Path
        The file; it is read in pieces, and once as long as size and times stay the same.

    Returns
    -------
    str
        The checksum.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    with path.open("rb") as file:
        found = os.fstat(file.fileno())
        state = found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns
        known = _KNOWN.get(path)
        if known is not None and known[0] == state:
            return known[1]
        begun = time.time_ns()
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    if max(found.st_mtime_ns, found.st_ctime_ns) < begun - SETTLED * 1e9:
        _KNOWN[path] = state, digest
    return digest
