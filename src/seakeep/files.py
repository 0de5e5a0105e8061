"""Files that are either written whole or not at all."""

from __future__ import annotations

import os
import tempfile
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
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", suffix=".tmp", dir=path.parent)
        os.close(handle)
        temporary = Path(name)
        try:
            yield temporary
            temporary.chmod(0o644)
            temporary.replace(path)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        raise RequestError(
            f"cannot write {path}: {error.strerror or error}. The file that was there before, if "
            "any, is untouched. Free space on the disk or choose another place."
        ) from error
