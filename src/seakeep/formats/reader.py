"""Readers, and what may be known about a file before it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from seakeep.errors import DataError, SeakeepError
from seakeep.formats.columns import Columns

__all__ = ["Options", "Reader", "decoding"]


@dataclass(frozen=True)
class Options:
    r"""What is known about a file; what is left out is recognised.

    Parameters
    ----------
    time : str, optional
        Name of the time column.
    delimiter, decimal : str, optional
        Of a text file: ``","``, ``";"``, ``"\\t"`` or ``" "`` for any number of blanks; ``"."`` or
        ``","``.
    comment : str, optional
        Mark of comment lines; ``#`` and ``%`` are known.
    skip_rows : int
        Lines to leave out at the head of a text file.
    encoding : str, optional
        Encoding of a text file.
    group : str, optional
        The part that is read where a file holds several: a group of TDMS or HDF5, a topic of ROS.
    """

    time: str | None = None
    delimiter: Literal[",", ";", "\t", " "] | None = None
    decimal: Literal[".", ","] | None = None
    comment: str | None = None
    skip_rows: int = 0
    encoding: str | None = None
    group: str | None = None


@dataclass(frozen=True)
class Reader:
    """A kind of file and the function that reads it.

    Parameters
    ----------
    kind : str
        Name of the kind, for messages.
    read : callable
        Called as ``read(path, options)``; returns :class:`Columns`, or raises DataError.
    signatures : tuple of bytes
        What such files start with.
    suffixes : tuple of str
        What their names end with, in lower case.
    folder_mark : str
        Name of a file that marks a folder as one recording.
    """

    kind: str
    read: Callable[[Path, Options], Columns]
    signatures: tuple[bytes, ...] = ()
    suffixes: tuple[str, ...] = ()
    folder_mark: str = ""


@contextmanager
def decoding(path: Path, what: str, mend: str) -> Iterator[None]:
    """Report what a library raises on a damaged file: errors of all its dependencies."""
    try:
        yield
    except SeakeepError:
        raise
    except Exception as error:
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        said = "structs and cells nest without end" if isinstance(error, RecursionError) else said
        raise DataError(f"{path} cannot be read as {what} ({said}). {mend}") from None
