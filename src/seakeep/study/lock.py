"""One process at a time in the folder of a study."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

from seakeep.errors import RequestError

__all__ = ["LOCK", "alone_in"]

LOCK = "study.lock"


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Keep other processes out of a folder; the system lets go of it however this one ends.

    Parameters
    ----------
    folder : Path
        A folder that exists. Where its file system knows no locks, nobody is kept out.

    Raises
    ------
    RequestError
        If another process works there.
    """
    path = folder / LOCK
    with path.open("a+b") as file:
        try:
            _take(file.fileno())
        except (BlockingIOError, PermissionError):
            raise RequestError(
                f"another process works on the study in {folder}. Wait until it has finished, or "
                "choose another folder (-o)."
            ) from None
        except OSError:
            yield
            return
        try:
            yield
        finally:
            with contextlib.suppress(OSError):  # Windows does not remove a file that is open
                path.unlink()


def _take(descriptor: int) -> None:
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(descriptor, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
