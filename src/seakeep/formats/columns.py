"""Output of a reader: named columns of numbers, with the units the file states.

Readers, and what may be known about a file before it is read.
"""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from seakeep.arrays import FloatArray
from seakeep.conventions import si_unit
from seakeep.errors import DataError, RequestError, SeakeepError, did_you_mean
from seakeep.toml import Table, packaged

_BRACKETS = re.compile(r"(?P<name>.*?)\s*\[(?P<unit>[^\[\]]*)\]\s*\Z")
_PARENTHESES = re.compile(r"(?P<name>.*?)\s*\((?P<unit>[^()]*)\)\s*\Z")

DAY_0 = "1899-12-30"
"""Day from which Excel counts."""
UNITS = packaged("formats/units.toml")
"""Units that names say: ends of names, and fields of messages."""


@dataclass(frozen=True)
class Columns:
    """Columns of a file.

    Parameters
    ----------
    values : dict of str to ndarray, shape (row,)
        Numbers by column name, without the unit.
    units : dict of str to str
        Units that the file states, by column name.
    faults : dict of str to str
        Columns that are there but cannot be used, and why: raised when one is asked for.
    headers : dict of str to str
        The full header of a column where it differs from its name.
    sampling_rate : float or None
        Samples per second, where the file holds it apart from a time column.
    """

    values: dict[str, FloatArray]
    units: dict[str, str] = field(default_factory=dict)
    faults: dict[str, str] = field(default_factory=dict)
    headers: dict[str, str] = field(default_factory=dict)
    sampling_rate: float | None = None

    @property
    def names(self) -> list[str]:
        """Names of all columns, usable or not, in the file's order."""
        return list(dict.fromkeys([*self.headers, *self.values, *self.faults]))

    def find(self, wanted: str) -> str | None:
        """Name of a column, given by name or by full header; None if there is none."""
        if wanted in self.values or wanted in self.faults:
            return wanted
        return {header: name for name, header in self.headers.items()}.get(wanted.strip())


def meant_column(wanted: str, tables: Iterable[Columns]) -> str:
    """Say which column may be meant by one that no table has.

    Parameters
    ----------
    wanted : str
        Name or full header that was asked for.
    tables : iterable of Columns
        Where it was looked for.

    Returns
    -------
    str
        A sentence with a leading space, or ``""``.

    Examples
    --------
    >>> import numpy as np
    >>> table = Columns({"heave": np.zeros(2)}, {"heave": "mm"}, headers={"heave": "heave [mm]"})
    >>> meant_column("heave [m]", [table])
    " There is a column 'heave [mm]', in another unit."
    """
    names = [(name, each.headers.get(name, name)) for each in tables for name in each.names]
    bare, unit = split_unit(wanted)
    for _, header in names:
        if unit is not None and split_unit(header)[0] == bare and header != bare:
            return f" There is a column '{header}', in another unit."
    return did_you_mean(wanted, [name for name, _ in names])


def is_unit(text: str) -> bool:
    """Whether `text` is a unit that we understand."""
    try:
        si_unit(text)
    except RequestError:
        return False
    return True


def split_unit(header: str) -> tuple[str, str | None]:
    """Split a header into a name and a unit.

    Parameters
    ----------
    header : str
        Such as ``"Heave [mm]"``.

    Returns
    -------
    (str, str or None)
        Name and unit. What stands in square brackets is a unit; what stands in parentheses is
        one if it is a unit we understand.

    Examples
    --------
    >>> split_unit("Heave [mm]"), split_unit("Pitch (deg)"), split_unit("Heave (bow)")
    (('Heave', 'mm'), ('Pitch', 'deg'), ('Heave (bow)', None))
    """
    header = header.strip()
    match = _BRACKETS.match(header)
    if not match:
        match = _PARENTHESES.match(header)
        if not match or not match["unit"].strip() or not is_unit(match["unit"]):
            return header, None
    return match["name"].strip(), match["unit"].strip()


def named_unit(name: str) -> tuple[str, str | None]:
    """Split the unit off that a name ends on, as where a format has no other place for it.

    Parameters
    ----------
    name : str
        Such as ``"Heave_mm"``.

    Returns
    -------
    (str, str or None)
        Name and unit.

    Examples
    --------
    >>> named_unit("Heave_mm"), named_unit("pitch_deg_s"), named_unit("WP_1")
    (('Heave', 'mm'), ('pitch', 'deg/s'), ('WP_1', None))
    """
    words = re.split(r"[_ ]+", name.strip())
    for count in (3, 2, 1):
        unit = UNITS["endings"].get("_".join(words[-count:]))
        if unit and any(words[:-count]):
            return "_".join(words[:-count]), unit
    return name, None


def unique_names(headers: Iterable[str]) -> tuple[list[str], list[str | None]]:
    """Names and units of headers; the unit stays in a name that would not be unique without it."""
    full = [header.strip() for header in headers]
    pairs = [split_unit(header) for header in full]
    count = Counter(name for name, _ in pairs)
    names = [
        name if count[name] == 1 or not name else header
        for (name, _), header in zip(pairs, full, strict=True)
    ]
    return names, [unit for _, unit in pairs]


class Options(Table):
    """What is known about a file; what is left out is recognised."""

    time: str | None = None
    """the name of the time column"""
    delimiter: Literal[",", ";", "\t", " "] | None = None
    """',' or ';' or '\\t', or ' ' for any number of blanks"""
    decimal: Literal[".", ","] | None = None
    """'.' or ','"""
    comment: Annotated[str, Field(min_length=1)] | None = None
    """the mark that starts a comment line; '#' and '%' are known"""
    skip_rows: Annotated[int, Field(ge=0)] = 0
    """lines to leave out at the head of the file"""
    missing: float | None = None
    """number that stands for no reading of a channel, such as -999"""
    encoding: str | None = None
    """of a text file, such as 'utf-8', 'cp1252' or 'utf-16-le'; left out, UTF-8, UTF-16 with its
    mark, or Windows-1252 (Latin-1)"""
    group: str | None = None
    """the part of a file that is read, where it holds several: the group of a TDMS, HDF5 or NetCDF
    file, the topic of a ROS 2 bag or MCAP file"""


WHICH = (
    "State which one with group = 'NAME' in [files] or [instruments.LOGGER], or give --group NAME "
    "to seakeep init."
)
"""Remedy where a file holds several groups."""


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
        said = (str(error) or type(error).__name__).splitlines()[0]
        if isinstance(error, RecursionError):
            said = "structs and cells nest without end"
        raise DataError(f"{path} cannot be read as {what} ({said}). {mend}") from None
