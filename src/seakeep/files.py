"""Files that are either written whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from seakeep.errors import RequestError

__all__ = ["replacing"]


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Give a temporary name beside `path`, renamed onto it when all went well.

    Parameters
    ----------
    path : Path
        The file wanted.

    Yields
    ------
    Path
        An empty file in the same folder, to be overwritten.

    Raises
    ------
    RequestError
        If the folder does not exist or cannot be written, or the disk is full. What was at `path`
        before stays as it was.
    """
    if not path.parent.is_dir():
        raise RequestError(
            f"cannot write {path}: the folder {path.parent} does not exist. Create it first."
        )
    try:
        # Opened and not made by tempfile, so that the file gets the permissions the user's umask
        # gives to any other.
        temporary = path.with_name(f".{path.name}.{os.getpid()}.{secrets.token_hex(4)}.tmp")
        temporary.open("xb").close()
        try:
            yield temporary
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise RequestError(
            f"cannot write {path}: {error.strerror or error}. The file that was there before, if "
            "any, is untouched. Free space on the disk or choose another place."
        ) from error
