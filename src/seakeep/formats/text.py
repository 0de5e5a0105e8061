"""Tables in text files: CSV and its relatives, as loggers and spreadsheets write them."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import re
import warnings
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from seakeep.arrays import FloatArray
from seakeep.errors import DataError, warn
from seakeep.formats.columns import Columns, is_unit, same_unit, unique_names
from seakeep.formats.reader import Options

__all__ = ["read_text"]

HEAD = 40
"""Lines that may stand above a header, and from which the layout is recognised."""

SHORT_END = 8192
"""Bytes at the end of a text that are searched for a last line that was cut off."""

_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+-]?\d+)?\Z", re.ASCII)
_MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "inf", "-inf", "+inf"}
_NO_THOUSANDS = re.compile(rb"(?<!\d)0\d*,|(?<!\d),|\d{4},|,(?!\d{3}(?!\d))")
"""A comma that divides no thousands: behind a zero or four digits, or not before three digits."""
_RULE = re.compile(
    r"(?=.*[-=_*~]{2})[-=_*~+.:|\s,;]+\Z|(\s*[+-]?[\d.]+\s+:\s+[+-]?[\d.]+\s*[,;]?)+\Z", re.ASCII
)
"""A row below a header that holds no data: dashes, or ranges such as ``0 : -0``."""


@dataclass(frozen=True)
class _Layout:
    """How a text is divided: `start` is the offset of the first row of numbers."""

    delimiter: str
    decimal: str
    headers: list[str]
    units: list[str] | None
    start: int
    marks: tuple[str, ...]


def read_text(path: Path, options: Options) -> Columns:
    """Read a table from a text file, compressed by gzip or not.

    Empty cells and ``nan`` are NaN. The body is parsed once, by pandas.
    """
    raw = _utf8(path, _unpacked(path), options.encoding)
    try:
        layout = _layout(path, raw, options)
    except csv.Error as error:
        raise DataError(
            f"{path}: its head cannot be divided into cells ({error}). If it is a table, state "
            "delimiter or skip_rows in [files]; else export the run as CSV."
        ) from None
    frame = _frame(path, raw, layout)
    if not raw.endswith(b"\n"):
        _warn_of_a_short_end(path, raw, layout)
    names, units = unique_names(layout.headers)
    if layout.units is not None:
        for name, row, unit in zip(names, layout.units, units, strict=True):
            if row and unit and is_unit(unit) and not same_unit(row, unit):
                raise DataError(
                    f"{path}: the header says '{unit}' for the column '{name}', and the row of "
                    f"units below it '{row}'. Correct the wrong one of them in the file."
                )
        units = [row or unit for row, unit in zip(layout.units, units, strict=True)]
    count = Counter(names)
    keep = [i for i, name in enumerate(names) if name and count[name] == 1]
    numbers, faults = _numbers(path, raw, frame, layout, {i: names[i] for i in keep})
    faults |= {
        name: f"{path}: {count[name]} columns have the name '{name}'. Rename them in the file's "
        "header, so that it is plain which one is meant."
        for name in count
        if name and count[name] > 1
    }
    return Columns(
        values=numbers,
        units={names[i]: str(units[i]) for i in keep if units[i] is not None},
        faults=faults,
        headers={name: full for name, full in zip(names, layout.headers, strict=True) if name},
    )


def _warn_of_a_short_end(path: Path, raw: bytes, layout: _Layout) -> None:
    """Warn where the last line has no end and its last cell is shorter than those above."""
    start = max(layout.start, raw.rfind(b"\n", 0, max(0, len(raw) - SHORT_END)) + 1)
    cells = [_cells(row, layout.delimiter)[-1] for _, row in _rows(raw, start, layout.marks)]
    if len(cells) > 2 and len(cells[-1]) < min(map(len, cells[:-1])):
        line = raw.count(b"\n") + 1
        warn(
            f"{path} ends within line {line}, at {cells[-1]!r}: it seems to be cut "
            "off. Export it again, or end the last line if it is whole."
        )


def _unpacked(path: Path) -> bytes:
    raw = path.read_bytes()
    if not raw.startswith(b"\x1f\x8b"):
        return raw
    try:
        return gzip.decompress(raw)
    except (EOFError, OSError, zlib.error) as error:
        raise DataError(
            f"{path} is cut off or damaged (gzip: {error}). Copy or download it again."
        ) from None


def _utf8(path: Path, raw: bytes, encoding: str | None) -> bytes:
    """Text in UTF-8 with plain ends of lines, from any encoding."""
    if not raw or raw.isspace():
        raise DataError(f"{path} is empty. Export the run again.")
    if encoding is None and raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    if encoding is None and b"\x00" in raw[:4096]:
        raise _binary(path, raw)
    try:
        if encoding is not None or not raw.isascii():
            text = raw.decode(encoding or "utf-8")
            raw = text.encode() if encoding is not None else raw
    except UnicodeError as error:
        if encoding is not None:
            where = f"byte {error.start}" if isinstance(error, UnicodeDecodeError) else str(error)
            raise DataError(
                f"{path} is not {encoding}: {where} does not fit. Correct 'encoding' in [files], "
                "or leave it out."
            ) from None
        raw = _western(path, raw).encode()
    except (LookupError, ValueError):
        raise DataError(
            f"{path}: the encoding {encoding!r} is not known. Write 'utf-8', 'latin-1' or 'cp1252'."
        ) from None
    raw = raw.removeprefix(codecs.BOM_UTF8)
    return raw.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in raw else raw


def _binary(path: Path, raw: bytes) -> DataError:
    """Error for zero bytes, which no text has but one of two or four bytes per letter."""
    for form, zeros, letters in (("utf-16-le", raw[1:200:2], raw[0:200:2]),
                                 ("utf-16-be", raw[0:200:2], raw[1:200:2])):  # fmt: skip
        if not any(zeros) and all(letters):
            return DataError(
                f"{path} seems to be UTF-16 without the mark that says so. State encoding = "
                f"'{form}' in [files]."
            )
    return DataError(
        f"{path} holds binary data of a kind that is not known. Export the run as CSV, or see the "
        "documentation of [files] for the kinds that are read."
    )


_UNUSED = {0x81, 0x8D, 0x8F, 0x90, 0x9D}
_SIGNS = frozenset("°µ²³·".encode("latin-1"))
"""Signs of units that are the same byte in Latin-1, its relatives and Windows-1252."""


def _western(path: Path, raw: bytes) -> str:
    letters = {byte for byte in set(raw) if byte >= 0x80}
    if not letters <= _SIGNS:
        warn(
            f"{path} is not UTF-8 and was read as Windows-1252 (Latin-1); check the letters of its "
            "header, or state encoding in [files]."
        )
    # Five bytes are not letters of Windows-1252; Latin-1 has control characters there.
    return raw.decode("latin-1" if _UNUSED & letters else "cp1252")


def _rows(raw: bytes, at: int, marks: tuple[str, ...]) -> Iterator[tuple[int, str]]:
    """Offset and content of each line that is neither a comment nor blank."""
    # Not splitlines: it would break lines at form feeds and other marks inside a cell.
    while at < len(raw):
        end = raw.find(b"\n", at)
        end = len(raw) if end < 0 else end
        line = raw[at:end].decode("utf-8", "replace")
        if line.strip(" \t,;") and not line.lstrip().startswith(marks):
            yield at, line
        at = end + 1


def _line_number(raw: bytes, layout: _Layout, row: int) -> int:
    """Number of the line, from one, that holds a row of the body."""
    offset, _ = next(islice(_rows(raw, layout.start, layout.marks), row, None))
    return raw.count(b"\n", 0, offset) + 1


def _layout(path: Path, raw: bytes, options: Options) -> _Layout:
    marks = (options.comment,) if options.comment else ("#", "%")
    begin, skip = 0, options.skip_rows
    while skip and begin < len(raw):
        begin, skip = raw.find(b"\n", begin) + 1 or len(raw), skip - 1
    rows = list(islice(_rows(raw, begin, marks), HEAD))
    text = [line for _, line in rows if not _RULE.match(line)]
    if not text:
        raise DataError(
            f"{path} holds no rows, only comments and blank lines. Export the run again."
        )
    delimiter = options.delimiter or _delimiter(text[0])
    numeric = (i for i, (_, line) in enumerate(rows) if _numeric(_cells(line, delimiter)))
    first = next(numeric, HEAD)
    rows = [row for i, row in enumerate(rows) if i > first or not _RULE.match(row[1])]
    cells = [_cells(line, delimiter) for _, line in rows[:2]]
    said = _remarks(raw[begin : rows[0][0]], marks, delimiter, len(cells[0]))
    headers, units, at = cells[0], None, 1
    if _numeric(headers):
        if not said and len(rows) < min(len(headers), HEAD):
            words = "no header and more columns than rows, which looks"
            raise _transposed(path, words, len(rows), len(headers))
        at = 0
        units = _units(said[-1], said[-2]) if len(said) > 1 else None
        numbered = [str(i + 1) for i in range(len(headers))]
        headers = said[-2] if units else said[-1] if said else numbered
    elif said and (units := _units(headers, said[-1])):
        headers = said[-1]
    else:
        if len(headers) > 2 and not _NUMBER.match(headers[0]) and _numeric(headers[1:]):
            words = f"the first line is '{headers[0]}' and {len(headers) - 1} numbers, which looks"
            raise _transposed(path, words, len(list(_rows(raw, begin, marks))), len(headers))
        units = _units(cells[1], headers) if len(cells) > 1 else None
        at += units is not None
    if at >= len(rows):
        raise DataError(f"{path} has a header and no rows of numbers. Export the run again.")
    start = rows[at][0]
    decimal = options.decimal or _decimal(path, raw, start, marks, delimiter)
    return _Layout(delimiter, decimal, headers, units, start, marks)


def _remarks(above: bytes, marks: tuple[str, ...], delimiter: str, width: int) -> list[list[str]]:
    """Comment lines above the first row that may be a header: as many words as it has cells."""
    lines = [line.lstrip() for line in above.decode("utf-8", "replace").split("\n")]
    bare = [line.lstrip("".join(marks)).strip() for line in lines if line.startswith(marks)]
    for mark in dict.fromkeys((delimiter, "\t", ";", ",")):
        cells = [_cells(line, mark) for line in bare if not _RULE.match(line)]
        if found := [each for each in cells if len(each) == width and not _numeric(each)]:
            return found
    return []


def _decimal(path: Path, raw: bytes, start: int, marks: tuple[str, ...], delimiter: str) -> str:
    """The mark of decimals: a comma if cells are numbers with a comma and none has a point."""
    if delimiter == "," or raw.find(b",", start) < 0:
        return "."
    for _, line in _rows(raw, start, marks):
        cells = [cell for cell in _cells(line, delimiter) if _NUMBER.match(cell)]
        if any("." in cell for cell in cells):
            return "."
        if commas := [cell for cell in cells if "," in cell]:
            if _NO_THOUSANDS.search(raw, start) is None:
                raise DataError(
                    f"{path}: the comma of {commas[0]!r} may divide thousands or decimals, and so "
                    "may all others of the file. Export it without marks of thousands; or, if the "
                    "comma is the decimal mark, state decimal = ',' in [files] (--decimal , of "
                    "seakeep init)."
                )
            return ","
    return "."


def _transposed(path: Path, words: str, rows: int, columns: int) -> DataError:
    return DataError(
        f"{path}: {words} transposed ({rows} rows, {columns} columns); expected a header, then "
        "one row per instant and one column per channel. Save it transposed: nothing is turned "
        "silently."
    )


def _delimiter(line: str) -> str:
    for candidate in ("\t", ";"):
        if candidate in line:
            return candidate
    # With a decimal comma, lines of numbers hold commas and the header does not.
    if "," in line and not (_numeric(_cells(line, " ")) and " " in line.strip()):
        return ","
    return " "


def _cells(line: str, delimiter: str) -> list[str]:
    if delimiter == " ":
        joined: list[str] = []
        for token in next(csv.reader([line.strip()], delimiter=" ", skipinitialspace=True)):
            # "Heave [m]": a unit that stands behind a blank belongs to the name before it.
            opened = joined and joined[-1].count("[") > joined[-1].count("]")
            if joined and (token.startswith(("[", "(")) or opened):
                joined[-1] += f" {token}"
            elif token:
                joined.append(token)
        return joined
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _numeric(cells: list[str]) -> bool:
    """Whether these are the cells of a row of data: numbers, or nothing where one is missing."""
    return any(map(_NUMBER.match, cells)) and all(
        _NUMBER.match(cell) or cell.lower() in _MISSING for cell in cells
    )


def _units(cells: list[str], headers: list[str]) -> list[str] | None:
    """Units of a row below the header, if it is one: texts, most of which are known units."""
    stripped = [cell.strip("[]() ") for cell in cells]
    if len(cells) != len(headers) or any(_NUMBER.match(cell) for cell in cells):
        return None
    named = [text for text in stripped if text]
    if not named or 2 * sum(is_unit(text) for text in named) < len(named):
        return None
    return stripped


def _frame(path: Path, raw: bytes, layout: _Layout) -> pd.DataFrame:
    """Cells of the body, as pandas parses them, with as many in each row as the header has."""
    body = _plain(raw, layout)
    _check_widths(path, raw, body, layout)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # columns of several kinds: each cell is looked at here
            frame: pd.DataFrame = pd.read_csv(  # type: ignore[call-overload]
                io.BytesIO(body),
                sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                decimal=layout.decimal,
                header=None,
                names=list(range(len(layout.headers))),
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=b" " in body,
                **_EXACT,
            )
            said = "fewer rows than lines"
    except ValueError as error:
        frame, said = pd.DataFrame(), str(error).strip()
    if len(frame) != body.count(b"\n") + 1:
        raise DataError(
            f"{path} cannot be divided into cells ({said}). Look for a quotation mark that is not "
            "closed."
        )
    return frame


def _plain(raw: bytes, layout: _Layout) -> bytes:
    """Body without comments and blank lines."""
    body = raw[layout.start :].rstrip(b"\n")
    marks = "|".join(map(re.escape, layout.marks)).encode()
    if re.search(rb"\n[ \t,;]*(?:\n|\Z|" + marks + rb")", body) is None:
        return body
    return b"\n".join(line.encode() for _, line in _rows(raw, layout.start, layout.marks))


def _check_widths(path: Path, raw: bytes, body: bytes, layout: _Layout) -> None:
    """Refuse rows with more or fewer cells than the header, which pandas would fill or cut."""
    wanted, mark = len(layout.headers), layout.delimiter
    letters = np.frombuffer(body, np.uint8)
    ends = letters == ord("\n")
    if mark == " ":
        blank = (letters == ord(" ")) | (letters == ord("\t")) | ends
        firsts = ~blank & np.append(True, blank[:-1])
    else:
        firsts = letters == ord(mark)
    starts = np.append(0, np.flatnonzero(ends[:-1]) + 1)
    counts = np.add.reduceat(firsts, starts, dtype=np.intp) + (mark != " ")
    if b'"' in body:
        for i, line in enumerate(body.decode().split("\n")):
            counts[i] = len(_cells(line, mark)) if '"' in line else counts[i]
    wrong = np.flatnonzero(counts != wanted)
    if not wrong.size:
        return
    first = int(wrong[0])
    shown = {" ": "blanks", "\t": "tabs"}.get(mark, f"'{mark}'")
    last = wrong.size == 1 and first == counts.size - 1
    raise DataError(
        f"{path}, line {_line_number(raw, layout, first)}: {counts[first]} cells where the header "
        f"has {wanted} ({wrong.size} such line(s), columns divided by {shown}). "
        + (
            "It is the last line: the file was cut off. Export it again, or remove the line."
            if last
            else _widths_mend(wanted, counts, mark, raw)
        )
    )


def _widths_mend(wanted: int, counts: npt.NDArray[np.intp], mark: str, raw: bytes) -> str:
    """What to do about lines of another width, as far as the file itself shows."""
    if mark == "," and np.isin(counts, (2 * wanted, 2 * wanted - 1)).all():
        return (
            "This looks like decimal commas in a file divided by commas; they cannot be "
            "distinguished: export it with decimal points, or divided by semicolons or tabs."
        )
    lines = raw.decode("utf-8", "replace").split("\n")
    rows = [(number, line) for number, line in enumerate(lines, 1) if line.strip()]
    for name, each in (("tabs", "\t"), ("semicolons", ";"), ("commas", ",")):
        widths = [line.count(each) + 1 for _, line in rows]
        first = next((i for i in range(min(HEAD, len(rows))) if len(set(widths[i:])) == 1), 0)
        if first and widths[-1] > 1 and len(rows) - first > 2:
            above = rows[first][0] - 1
            return (
                f"From line {above + 1} on, every line has {widths[-1]} cells divided by {name}: "
                f"state skip_rows = {above} in [files] of the campaign, or give --skip-rows "
                f"{above} to seakeep init."
            )
    return (
        "Correct the lines, or state in [files]: delimiter, decimal, or skip_rows where words "
        "stand above the header; seakeep init takes them as --delimiter, --decimal and --skip-rows."
    )


# To the last bit: what pandas does by itself from 3.1 on, and deprecates to ask for.
_RELEASE = tuple(int(part) for part in pd.__version__.split(".")[:2])
_EXACT = {"float_precision": "round_trip"} if _RELEASE < (3, 1) else {}


def _numbers(
    path: Path, raw: bytes, frame: pd.DataFrame, layout: _Layout, names: dict[int, str]
) -> tuple[dict[str, FloatArray], dict[str, str]]:
    """Columns by name, and those that are not all numbers, with the first cell at fault."""
    values, faults = {}, {}
    for i, name in names.items():
        column = frame[i]
        if column.dtype.kind in "fiu":
            values[name] = column.to_numpy(dtype=float)
            continue
        out = np.empty(len(column))
        for row, cell in enumerate(column):
            number = np.nan if pd.isna(cell) else _number(str(cell).strip(), layout.decimal)
            if number is None:
                faults[name] = (
                    f"{path}, line {_line_number(raw, layout, row)}, column '{name}': {cell!r} is "
                    f"not a number. {_mend(str(cell))}"
                )
                break
            out[row] = number
        else:
            values[name] = out
    return values, faults


def _number(cell: str, decimal: str) -> float | None:
    """Value of a cell; None if it is not a number."""
    if cell.lower() in _MISSING:
        return float(cell) if "inf" in cell.lower() else np.nan
    # The other mark would divide thousands, or the file mixes both: neither is guessed at.
    if (".,"[decimal == "."]) in cell or not _NUMBER.match(cell):
        return None
    return float(cell.lower().replace(",", ".").replace("d", "e"))


def _mend(cell: str) -> str:
    if re.search(r"\d[-/:]\d", cell):
        return "Write dates and clock times as seconds from the start of the run."
    if re.search(r"\d([.,' ])\d{3}(\1\d{3}|[.,]\d)*\b", cell):
        return "If its mark divides thousands, export the file without such marks."
    return (
        "Correct the cell, leave it empty where the value is missing, or state decimal and "
        "delimiter in [files]."
    )
