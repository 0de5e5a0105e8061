"""Readers, and what may be known about a file before it is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from seakeep.errors import DataError, SeakeepError
from seakeep.formats.columns import Columns
from seakeep.toml import Table, optional


class Options(Table):
    """What is known about a file; what is left out is recognised."""

    time: str | None = optional("the name of the time column")
    delimiter: Literal[",", ";", "\t", " "] | None = optional(
        "',' or ';' or '\\t', or ' ' for any number of blanks"
    )
    decimal: Literal[".", ","] | None = optional("'.' or ','")
    comment: Annotated[str, Field(min_length=1)] | None = optional(
        "the mark that starts a comment line; '#' and '%' are known"
    )
    skip_rows: Annotated[int, Field(ge=0)] = optional(
        "lines to leave out at the head of the file", 0
    )
    encoding: str | None = optional(
        "of a text file, such as 'utf-8', 'cp1252' or 'utf-16-le'; left out, UTF-8, "
        "UTF-16 with its mark, or Windows-1252 (Latin-1)"
    )
    group: str | None = optional(
        "the part of a file that is read, where it holds several: the group of a TDMS, "
        "HDF5 or NetCDF file, the topic of a ROS 2 bag or MCAP file"
    )


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
