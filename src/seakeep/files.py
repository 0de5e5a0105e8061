"""Files that are either written whole or not at all."""

from __future__ import annotations

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from seakeep.errors import RequestError

__all__ = ["check_place", "make_folder", "replacing"]


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
    check_place(path)
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
        mend = "Free space on the disk or choose another place."
        if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
            mend = "Choose a folder that you may write to, or change its permissions."
        raise RequestError(
            f"cannot write {path}: {error.strerror or error}. The file that was there before, if "
            f"any, is untouched. {mend}"
        ) from error


def check_place(path: Path, suffix: str | None = None) -> None:
    """Refuse a path at which no file can be written, before the work and not after it.

    Parameters
    ----------
    path : Path
        The file wanted.
    suffix : str, optional
        What its name must end with, where only one kind of file is written.

    Raises
    ------
    RequestError
        If it is a folder, its own folder does not exist, or its name says another kind.
    """
    if path.is_dir():
        raise RequestError(
            f"cannot write {path}: it is a folder. Name a file in it, such as {path / 'model.nc'}."
        )
    if path.parent.exists() and not path.parent.is_dir():
        raise RequestError(
            f"cannot write {path}: {path.parent} is a file, not a folder. Choose another place."
        )
    if not path.parent.is_dir():
        raise RequestError(
            f"cannot write {path}: the folder {path.parent} does not exist. Create it first."
        )
    if suffix is not None and path.suffix != suffix:
        raise RequestError(
            f"{path} ends in '{path.suffix}', and a file of the kind {suffix} is written. Name it "
            f"{path.with_suffix(suffix)}."
        )


def make_folder(path: Path) -> Path:
    """Make a folder and those above it, if they do not exist.

    Parameters
    ----------
    path : Path
        The folder wanted.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    RequestError
        If it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RequestError(
            f"cannot make the folder {path}: {error.strerror or error}. Choose another place."
        ) from error
    return path
