"""Tables in text files: CSV and its relatives, as loggers and spreadsheets write them."""

from __future__ import annotations

import codecs
import csv
import gzip
import io
import re
import warnings
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from seakeep.campaign.columns import Columns, is_unit, unique_names
from seakeep.campaign.settings import FileSettings
from seakeep.errors import DataError, SeakeepWarning

__all__ = ["read_text"]

_COMMENTS = ("#", "%")
_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+-]?\d+)?\Z", re.ASCII)
_TRUTH = re.compile(r"\b(true|false)\b", re.IGNORECASE)
_MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "inf", "-inf", "+inf"}


@dataclass(frozen=True)
class _Layout:
    delimiter: str
    decimal: str
    headers: list[str]
    units: list[str] | None
    body: list[tuple[int, str]]  # line numbers count from one


def read_text(path: Path, options: FileSettings) -> Columns:
    """Read a table from a text file, compressed by gzip or not.

    Parameters
    ----------
    path : Path
        The file.
    options : FileSettings
        What is known about it; the rest is recognised.

    Returns
    -------
    Columns
        Its columns. Empty cells and ``nan`` are NaN.

    Raises
    ------
    DataError
        If the file is empty, damaged, or its rows differ in length.
    """
    text = _text(path, options)
    # Not splitlines: it would break lines at form feeds and other marks inside a cell.
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    layout = _layout(path, lines if lines[-1] else lines[:-1], options)
    _check_widths(path, layout, lines)
    if lines[-1]:
        _warn_of_a_short_end(path, layout)
    names, units = unique_names(layout.headers)
    if layout.units is not None:
        units = [row or unit for row, unit in zip(layout.units, units, strict=True)]
    keep = [i for i, name in enumerate(names) if name and names.count(name) == 1]
    numbers, faults = _numbers(path, layout, names, keep)
    for name in names:
        if name and names.count(name) > 1:
            faults[name] = (
                f"{path}: {names.count(name)} columns are called '{name}'. Rename them in the "
                "file's header, so that it is plain which one is meant."
            )
    return Columns(
        values=numbers,
        units={names[i]: str(units[i]) for i in keep if units[i] is not None},
        faults=faults,
        headers={name: full for name, full in zip(names, layout.headers, strict=True) if name},
    )


def _warn_of_a_short_end(path: Path, layout: _Layout) -> None:
    """Warn where the last line has no end and its last cell is shorter than those above."""
    cells = [_cells(line, layout.delimiter)[-1] for _, line in layout.body[-50:]]
    if len(cells) > 2 and len(cells[-1]) < min(map(len, cells[:-1])):
        warnings.warn(
            f"{path} ends within line {layout.body[-1][0]}, at {cells[-1]!r}: it seems to be cut "
            "off. Export it again, or end the last line if it is whole.",
            SeakeepWarning,
            stacklevel=3,
        )


def _text(path: Path, options: FileSettings) -> str:
    raw = path.read_bytes()
    if raw[:2] == b"\x1f\x8b":
        try:
            raw = gzip.decompress(raw)
        except (EOFError, OSError, zlib.error) as error:
            raise DataError(
                f"{path} is cut off or damaged (gzip: {error}). Copy or download it again."
            ) from None
    if not raw.strip():
        raise DataError(f"{path} is empty. Export the run again.")
    _refuse_binary(path, raw, options.encoding)
    return _decode(path, raw, options.encoding)


def _refuse_binary(path: Path, raw: bytes, encoding: str | None) -> None:
    """Refuse zero bytes, which no text has but one of two or four bytes a letter."""
    wide = raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    if b"\x00" not in raw[:4096] or wide or encoding is not None:
        return
    for form, zeros, letters in (("utf-16-le", raw[1:200:2], raw[0:200:2]),
                                 ("utf-16-be", raw[0:200:2], raw[1:200:2])):  # fmt: skip
        if not any(zeros) and all(letters):
            raise DataError(
                f"{path} seems to be UTF-16 without the mark that says so. State encoding = "
                f"'{form}' in [files]."
            )
    raise DataError(
        f"{path} holds binary data that are no text table. Readable are CSV and text tables "
        "(plain or gzip), MATLAB .mat (version 5 to 7.3), NetCDF and HDF5, TDMS, ROS 2 bags and "
        "MCAP; export to one of these."
    )


_UNUSED = {0x81, 0x8D, 0x8F, 0x90, 0x9D}
_SIGNS = frozenset("°µ²³·".encode("latin-1"))
"""Signs of units that are the same byte in Latin-1, its relatives and Windows-1252."""


def _decode(path: Path, raw: bytes, encoding: str | None) -> str:
    if encoding is None and raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    try:
        return raw.decode(encoding or "utf-8-sig").removeprefix("\ufeff")
    except LookupError:
        raise DataError(
            f"{path}: the encoding {encoding!r} is not known. Write 'utf-8', 'latin-1' or 'cp1252'."
        ) from None
    except UnicodeDecodeError as error:
        if encoding is not None:
            raise DataError(
                f"{path} is not {encoding}: byte {error.start} does not fit. Correct 'encoding' in "
                "[files], or leave it out."
            ) from None
    if not {byte for byte in raw if byte >= 0x80} <= _SIGNS:
        warnings.warn(
            f"{path} is not UTF-8 and was read as Windows-1252 (Latin-1); check the letters of its "
            "header, or state encoding in [files].",
            SeakeepWarning,
            stacklevel=2,
        )
    # Five bytes are no letter of Windows-1252; Latin-1 has control characters in their place.
    return raw.decode("cp1252" if not _UNUSED & set(raw) else "latin-1")


def _layout(path: Path, lines: list[str], options: FileSettings) -> _Layout:
    marks = (options.comment,) if options.comment else _COMMENTS
    rows: list[tuple[int, str]] = []
    remark: tuple[str, int] | None = None  # the last comment line and how many rows precede it
    for number, line in enumerate(lines[options.skip_rows :], options.skip_rows + 1):
        if line.lstrip().startswith(marks):
            if not rows:
                remark = line.lstrip().lstrip("".join(marks)).strip(), number
        elif line.strip(" \t,;"):
            rows.append((number, line))
    if not rows:
        raise DataError(
            f"{path} holds no rows, only comments and blank lines. Export the run again."
        )
    delimiter = options.delimiter or _delimiter([line for _, line in rows[:20]])
    head = _cells(rows[0][1], delimiter)
    if _numeric(head):
        named = [] if remark is None else _cells(remark[0], delimiter)
        headers = named if len(named) == len(head) and not _numeric(named) else []
        if not headers and len(rows) < len(head):
            raise _transposed(
                path, "no header and more columns than rows, which looks", len(rows), len(head)
            )
        headers = headers or [str(i + 1) for i in range(len(head))]
        body = rows
    else:
        _refuse_transposed(path, head, len(rows))
        headers, body = head, rows[1:]
    units = None
    if body and body is not rows and (second := _units(_cells(body[0][1], delimiter), headers)):
        units, body = second, body[1:]
    if not body:
        raise DataError(f"{path} has a header and no rows of numbers. Export the run again.")
    decimal = options.decimal or _decimal([line for _, line in body], delimiter)
    return _Layout(delimiter, decimal, headers, units, body)


def _decimal(lines: list[str], delimiter: str) -> str:
    """The mark of decimals: a comma if cells are numbers with a comma and none has a point."""
    if delimiter == ",":
        return "."
    found = ""
    for line in lines:
        if "," in line or "." in line:
            for cell in _cells(line, delimiter):
                if _NUMBER.match(cell) and "." in cell:
                    return "."
                if _NUMBER.match(cell) and "," in cell:
                    found = ","
        if found:
            break
    return found or "."


def _refuse_transposed(path: Path, head: list[str], rows: int) -> None:
    if len(head) > 2 and not _NUMBER.match(head[0]) and _numeric(head[1:]):
        words = f"the first line is '{head[0]}' and {len(head) - 1} numbers, which looks"
        raise _transposed(path, words, rows, len(head))


def _transposed(path: Path, words: str, rows: int, columns: int) -> DataError:
    return DataError(
        f"{path}: {words} transposed ({rows} rows, {columns} columns); expected a header, then one "
        "row an instant and one column a channel. Save it transposed: nothing is turned silently."
    )


def _delimiter(lines: list[str]) -> str:
    for candidate in ("\t", ";"):
        if candidate in lines[0]:
            return candidate
    # With a decimal comma, lines of numbers hold commas and the header does not.
    if "," in lines[0] and not (_numeric(_cells(lines[0], " ")) and " " in lines[0].strip()):
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
    numbers = [bool(_NUMBER.match(cell)) for cell in cells]
    known = [
        number or cell.lower() in _MISSING for number, cell in zip(numbers, cells, strict=True)
    ]
    return any(numbers) and all(known)


def _units(cells: list[str], headers: list[str]) -> list[str] | None:
    """Units of a row below the header, if it is one: texts, most of which are known units."""
    stripped = [cell.strip("[]() ") for cell in cells]
    if len(cells) != len(headers) or any(_NUMBER.match(cell) for cell in cells):
        return None
    named = [text for text in stripped if text]
    if not named or 2 * sum(is_unit(text) for text in named) < len(named):
        return None
    return stripped


def _check_widths(path: Path, layout: _Layout, lines: list[str]) -> None:
    wanted, mark = len(layout.headers), layout.delimiter
    if mark == " ":
        counts = [len(line.split()) for _, line in layout.body]
    else:
        counts = [
            line.count(mark) + 1 if '"' not in line else len(_cells(line, mark))
            for _, line in layout.body
        ]
    wrong = [i for i, count in enumerate(counts) if count != wanted]
    if not wrong:
        return
    first = wrong[0]
    shown = {" ": "blanks", "\t": "tabs"}.get(mark, f"'{mark}'")
    last = len(wrong) == 1 and first == len(counts) - 1
    raise DataError(
        f"{path}, line {layout.body[first][0]}: {counts[first]} cells where the header has "
        f"{wanted} ({len(wrong)} such line(s), columns divided by {shown}). "
        + (
            "It is the last line: the file was cut off. Export it again, or remove the line."
            if last
            else _widths_mend(wanted, counts, mark, lines)
        )
    )


HEAD = 40
"""Lines that may stand above a header."""


def _widths_mend(wanted: int, counts: list[int], mark: str, lines: list[str]) -> str:
    """What to do about lines of another width, with what the file itself tells."""
    if mark == "," and all(count in (2 * wanted, 2 * wanted - 1) for count in counts):
        return (
            "This looks like decimal commas in a file divided by commas, which cannot be told "
            "apart: export it with decimal points, or divided by semicolons or tabs."
        )
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
        "Mend the lines, or state in [files]: delimiter, decimal, or skip_rows where words stand "
        "above the header; seakeep init takes them as --delimiter, --decimal and --skip-rows."
    )


# To the last bit: what pandas does by itself from 3.1 on, and deprecates to ask for.
_RELEASE = tuple(int(part) for part in pd.__version__.split(".")[:2])
_EXACT = {"float_precision": "round_trip"} if _RELEASE < (3, 1) else {}


def _numbers(
    path: Path, layout: _Layout, names: list[str], keep: list[int]
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    text = "\n".join(line for _, line in layout.body)
    form = {
        "sep": r"\s+" if layout.delimiter == " " else layout.delimiter,
        "header": None,
        "names": list(range(len(names))),
        "index_col": False,
        "skip_blank_lines": False,
        "usecols": keep,
        "skipinitialspace": True,
    }
    try:
        if _has_truth(text):
            raise ValueError("truth values are no numbers")
        frame = pd.read_csv(
            io.StringIO(text),
            dtype=float,
            decimal=layout.decimal,
            **_EXACT,
            **form,  # type: ignore[call-overload]
        )
        return {names[i]: frame[i].to_numpy(dtype=float) for i in keep}, {}
    except ValueError:
        # Some cell is no number: read as text, column by column, to say which.
        frame = pd.read_csv(io.StringIO(text), dtype=str, **form)  # type: ignore[call-overload]
    values, faults = {}, {}
    for i in keep:
        cells = [None if pd.isna(cell) else str(cell).strip() for cell in frame[i]]
        out = np.full(len(cells), np.nan)
        for row, cell in enumerate(cells):
            try:
                out[row] = np.nan if cell is None else _number(cell, layout.decimal)
            except ValueError:
                faults[names[i]] = (
                    f"{path}, line {layout.body[row][0]}, column '{names[i]}': {cell!r} is not a "
                    f"number. {_mend(str(cell))}"
                )
                break
        else:
            values[names[i]] = out
    return values, faults


def _has_truth(text: str) -> bool:
    """Whether a cell says true or false, which pandas would take for 1 and 0."""
    # Numbers have no u and no s: without them the slow search is spared.
    return any(letter in text for letter in "uUsS") and _TRUTH.search(text) is not None


def _number(cell: str, decimal: str) -> float:
    if decimal == ",":
        # A point would divide thousands, or the file mixes both marks: neither is guessed at.
        cell = cell.replace(".", "?").replace(",", ".")
    if not _NUMBER.match(cell) and cell.lower() not in _MISSING:
        raise ValueError(cell)  # Python would take 1_0 and digits of other scripts
    return float(cell)


def _mend(cell: str) -> str:
    if re.search(r"\d[-/:]\d", cell):
        return "Write dates and clock times as seconds from the start of the run."
    return (
        "Correct the cell, leave it empty where the value is missing, or state decimal and "
        "delimiter in [files]."
    )
