"""Tables in text files: CSV and its relatives, as loggers and spreadsheets write them."""

import codecs
import csv
import gzip
import io
import re
import warnings
import zlib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from seakeep.arrays import FloatArray
from seakeep.conventions import same_unit
from seakeep.errors import DataError, warn
from seakeep.formats.columns import DAY_0, Columns, Options, is_unit, unique_names

HEAD = 40
"""Lines that may stand above a header, and from which the layout is recognised."""

SHORT_END = 100
"""Rows at the end of a text whose last cells are compared with that of a line that has no end."""

_NUMBER = re.compile(r"[+-]?(\d+[.,]?\d*|[.,]\d+)([eEdD][+-]?\d+)?\Z", re.ASCII)
_INSTANT = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:", re.ASCII)
"""How an instant of ISO 8601 starts."""
_ZONE = re.compile(r"(Z|[+-]\d\d:?(\d\d)?)\Z", re.ASCII)
"""How it ends if it states a zone."""
_MISSING = {"", "nan", "na", "n/a", "#n/a", "null", "none", "inf", "-inf", "+inf"}
_OPENED = "[", "("
_NO_THOUSANDS = re.compile(r"(?<!\d)0\d*,|(?<!\d),|\d{4},|,(?!\d{3}(?!\d))", re.ASCII)
"""A comma that divides no thousands: behind a zero or four digits, or not before three digits."""
_RULE = re.compile(
    r"(?=.*[-=_*~]{2})[-=_*~+.:|\s,;]+\Z|(\s*[+-]?[\d.]+\s+:\s+[+-]?[\d.]+\s*[,;]?)+\Z", re.ASCII
)
"""A row below a header that holds no data: dashes, or ranges such as ``0 : -0``."""


@dataclass(frozen=True)
class _Layout:
    """How a text is divided, and its rows of numbers: the number of a line, and what it holds."""

    delimiter: str
    decimal: str
    headers: list[str]
    units: list[str] | None
    rows: list[tuple[int, str]]


def read_text(path: Path, options: Options) -> Columns:
    """Read a table from a text file, compressed by gzip or not.

    Empty cells and ``nan`` are NaN. The body is parsed once, by pandas.
    """
    raw = path.read_bytes()
    if raw.startswith(b"\x1f\x8b"):
        try:
            raw = gzip.decompress(raw)
        except (EOFError, OSError, zlib.error) as error:
            raise DataError(
                f"{path} is cut off or damaged (gzip: {error}). Copy or download it again."
            ) from None
    lines = _decoded(path, raw, options.encoding).split("\n")
    try:
        layout = _layout(path, lines, options)
    except csv.Error as error:
        raise DataError(
            f"{path}: its head cannot be divided into cells ({error}). If it is a table, state "
            "delimiter or skip_rows in [files]; else export the run as CSV."
        ) from None
    frame = _frame(path, lines, layout)
    if lines[-1]:  # the last line has no end: is its last cell shorter than those above?
        *above, last = (_cells(row, layout.delimiter)[-1] for _, row in layout.rows[-SHORT_END:])
        if len(above) > 1 and len(last) < min(map(len, above)):
            warn(
                f"{path} ends within line {len(lines)}, at {last!r}: it seems to be cut off. "
                "Export it again, or end the last line if it is whole."
            )
    return _columns(path, frame, layout)


def _decoded(path: Path, raw: bytes, encoding: str | None) -> str:
    """Text with plain ends of lines, from any encoding."""
    if not raw.strip():
        raise DataError(f"{path} is empty. Export the run again.")
    if encoding is None and raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        encoding = "utf-16"
    if encoding is None and b"\x00" in raw[:4096]:
        raise DataError(
            f"{path} holds binary data of a kind that is not known, or UTF-16 without its mark. "
            "Export the run as CSV, or state encoding = 'utf-16-le' in [files]."
        )
    try:
        text = raw.decode(encoding or "utf-8")
    except UnicodeError as error:
        if encoding is not None:
            where = f"byte {error.start}" if isinstance(error, UnicodeDecodeError) else str(error)
            raise DataError(
                f"{path} is not {encoding}: {where} does not fit. Correct 'encoding' in [files], "
                "or leave it out."
            ) from None
        letters = {byte for byte in set(raw) if byte >= 0x80}
        if not letters <= _SIGNS:
            warn(
                f"{path} is not UTF-8 and was read as Windows-1252 (Latin-1); check the letters of "
                "its header, or state encoding in [files]."
            )
        # Five bytes are not letters of Windows-1252; Latin-1 has control characters there.
        text = raw.decode("latin-1" if _UNUSED & letters else "cp1252")
    except (LookupError, ValueError):
        raise DataError(
            f"{path}: the encoding {encoding!r} is not known. Write 'utf-8', 'latin-1' or 'cp1252'."
        ) from None
    return text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")


_UNUSED = {0x81, 0x8D, 0x8F, 0x90, 0x9D}
_SIGNS = frozenset("°µ²³·".encode("latin-1"))
"""Signs of units that are the same byte in Latin-1, its relatives and Windows-1252."""


def _layout(path: Path, lines: list[str], options: Options) -> _Layout:
    marks = (options.comment,) if options.comment else ("#", "%")
    rows = [
        (number, line)
        for number, line in enumerate(lines[options.skip_rows :], options.skip_rows + 1)
        if line.strip(" \t,;") and not line.lstrip().startswith(marks)
    ]
    rows = _below_words(rows, options.delimiter)
    text = next((line for _, line in rows[:HEAD] if not _RULE.match(line)), None)
    if not text:
        raise DataError(
            f"{path} holds no rows, only comments and blank lines. Export the run again."
        )
    delimiter = options.delimiter or _delimiter(text)
    numeric = (i for i, (_, line) in enumerate(rows[:HEAD]) if _numeric(_cells(line, delimiter)))
    first = next(numeric, HEAD)
    rows = [row for row in rows[:first] if not _RULE.match(row[1])] + rows[first:]
    top, *below = (_cells(line, delimiter) for _, line in rows[:2])
    above = (line.strip() for line in lines[options.skip_rows : rows[0][0] - 1])
    # Comment lines above the first row that may be a header: as many words as it has cells.
    bare = [line.lstrip("".join(marks)).strip() for line in above if line.startswith(marks)]
    for mark in dict.fromkeys((delimiter, "\t", ";", ",")):
        cells = [_cells(line, mark) for line in bare if not _RULE.match(line)]
        if titles := [each for each in cells if len(each) == len(top) and not _numeric(each)]:
            break
    at = 0
    if not _numeric(top):
        if len(top) > 2 and not _NUMBER.match(top[0]) and _numeric(top[1:]):
            words = f"the first line is '{top[0]}' and {len(top) - 1} numbers, which looks"
            raise _transposed(path, words, len(rows), len(top))
        titles += [top, *(each for each in below if _units(each, top))]
        at = 1 + (titles[-1] is not top)
    elif not titles:
        if len(rows) < min(len(top), HEAD):
            words = "no header and more columns than rows, which looks"
            raise _transposed(path, words, len(rows), len(top))
        titles = [[str(i + 1) for i in range(len(top))]]
    # The last line above the numbers is the header, or its row of units.
    units = _units(titles[-1], titles[-2]) if len(titles) > 1 else None
    headers = titles[-2] if units else titles[-1]
    if at >= len(rows):
        raise DataError(f"{path} has a header and no rows of numbers. Export the run again.")
    decimal = options.decimal or _decimal(path, [line for _, line in rows[at:]], delimiter)
    return _Layout(delimiter, decimal, headers, units, rows[at:])


def _below_words(rows: list[tuple[int, str]], delimiter: str | None) -> list[tuple[int, str]]:
    """Rows from the header on: the lines right above the numbers that have as many cells."""
    cells = list[list[str]]()
    for _, line in rows[:HEAD]:
        cells.append(_cells(line, delimiter or _delimiter(line)))
        if _numeric(cells[-1]):
            break
    else:
        return rows
    at = first = len(cells) - 1
    while at and len(cells[at - 1]) == len(cells[first]) and rows[at - 1][0] == rows[at][0] - 1:
        at -= 1
    return rows[at:] if 0 < at < first and _may_head(rows[at][1], cells[at]) else rows


def _may_head(line: str, cells: list[str]) -> bool:
    """Whether a row may be a header: no rule, no units, and no data of which a cell is damaged."""
    is_data = any(_NUMBER.match(cell) or cell.lower() in _MISSING - {""} for cell in cells)
    is_units = any(cell.startswith(_OPENED) for cell in cells) or _units(cells, cells) is not None
    return not (is_data or is_units or _RULE.match(line))


def _decimal(path: Path, body: list[str], delimiter: str) -> str:
    """The mark of decimals: a comma if cells are numbers with a comma and none has a point."""
    if delimiter == "," or "," not in "".join(body):
        return "."
    for line in body:
        cells = [cell for cell in _cells(line, delimiter) if _NUMBER.match(cell)]
        if any("." in cell for cell in cells):
            return "."
        if commas := [cell for cell in cells if "," in cell]:
            if not any(map(_NO_THOUSANDS.search, body)):
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
            # In a row of units each is a cell of its own.
            behind = token.startswith(_OPENED) and joined and not joined[-1].startswith(_OPENED)
            if behind or opened:
                joined[-1] += f" {token}"
            elif token:
                joined.append(token)
        return joined
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _numeric(cells: list[str]) -> bool:
    """Whether these are the cells of a row of data: numbers, or nothing where one is missing."""
    data = [cell for cell in cells if cell.lower() not in _MISSING]
    return bool(data) and all(_NUMBER.match(cell) or _INSTANT.match(cell) for cell in data)


def _units(cells: list[str], headers: list[str]) -> list[str] | None:
    """Units of a row below the header, if it is one: texts, most of which are known units."""
    stripped = [cell.strip("[]() ") for cell in cells]
    if len(cells) != len(headers) or any(_NUMBER.match(cell) for cell in cells):
        return None
    named = [text for text in stripped if text]
    if not named or 2 * sum(is_unit(text) for text in named) < len(named):
        return None
    return stripped


def _frame(path: Path, lines: list[str], layout: _Layout) -> pd.DataFrame:
    """Cells of the body, as pandas parses them, with as many in each row as the header has."""
    # Rows with more or fewer cells than the header, which pandas would fill or cut.
    wanted, mark = len(layout.headers), layout.delimiter
    between = None if mark == " " else mark
    counts = [
        len(_cells(row, mark) if '"' in row else row.split(between)) for _, row in layout.rows
    ]
    if wrong := [i for i, count in enumerate(counts) if count != wanted]:
        first = wrong[0]
        shown = {" ": "blanks", "\t": "tabs"}.get(mark, f"'{mark}'")
        mend = "It is the last line: the file was cut off. Export it again, or remove the line."
        if first < len(counts) - 1:
            mend = _widths_mend(wanted, counts, mark, lines)
        raise DataError(
            f"{path}, line {layout.rows[first][0]}: {counts[first]} cells where the header "
            f"has {wanted} ({len(wrong)} such line(s), columns divided by {shown}). {mend}"
        )
    body = "\n".join([line for _, line in layout.rows])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # columns of several kinds: each cell is looked at here
            frame = pd.read_csv(  # type: ignore[call-overload]
                io.StringIO(body),
                sep=r"\s+" if mark == " " else mark,
                decimal=layout.decimal,
                header=None,
                names=range(wanted),
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=" " in body,
                **_EXACT,
            )
            said = "fewer rows than lines"
    except ValueError as error:
        frame, said = pd.DataFrame(), str(error).strip()
    if len(frame) != len(layout.rows):
        raise DataError(
            f"{path} cannot be divided into cells ({said}). Look for a quotation mark that is not "
            "closed."
        )
    return frame


def _widths_mend(wanted: int, counts: list[int], mark: str, lines: list[str]) -> str:
    """What to do about lines of another width, as far as the file itself shows."""
    if mark == "," and set(counts) <= {2 * wanted, 2 * wanted - 1}:
        return (
            "This looks like decimal commas in a file divided by commas; they cannot be "
            "distinguished: export it with decimal points, or divided by semicolons or tabs."
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
        "Correct the lines, or state in [files]: delimiter, decimal, or skip_rows where words "
        "stand above the header; seakeep init takes them as --delimiter, --decimal and --skip-rows."
    )


# To the last bit: what pandas does by itself from 3.1 on, and deprecates to ask for.
_RELEASE = tuple(int(part) for part in pd.__version__.split(".")[:2])
_EXACT = {"float_precision": "round_trip"} if _RELEASE < (3, 1) else {}


def _columns(path: Path, frame: pd.DataFrame, layout: _Layout) -> Columns:
    """Columns by name, with the units that header and row of units state."""
    names, units = unique_names(layout.headers)
    if layout.units:
        for name, row, unit in zip(names, layout.units, units, strict=True):
            if row and unit and is_unit(unit) and not same_unit(row, unit):
                raise DataError(
                    f"{path}: the header says '{unit}' for the column '{name}', and the row of "
                    f"units below it '{row}'. Correct the wrong one of them in the file."
                )
        units = [row or unit for row, unit in zip(layout.units, units, strict=True)]
    count, out = Counter(names), Columns({})
    for i, name in enumerate(names):
        if not name:
            continue
        out.headers[name] = layout.headers[i]
        if count[name] > 1:
            out.faults[name] = (
                f"{path}: {count[name]} columns have the name '{name}'. Rename them in the file's "
                "header, so that it is plain which one is meant."
            )
            continue
        if (unit := units[i]) is not None:
            out.units[name] = unit
        column = frame[i]
        first = str(column.get(column.first_valid_index())).strip()
        if _INSTANT.match(first):
            zone = " in UTC" if _ZONE.search(first) else ""
            out.units[name] = f"days since {DAY_0}{zone}"
            text = column.str.replace(",", ".")
            instants = pd.to_datetime(text, format="ISO8601", utc=True, errors="coerce")
            others = column.where(instants.isna())
            days = (instants - pd.Timestamp(DAY_0, tz="UTC")) / pd.Timedelta("1D")
            column = others if others.count() else days  # a column of both has a fault
        try:
            out.values[name] = _numbers(path, name, column, layout)
        except DataError as error:
            out.faults[name] = str(error)
    return out


def _numbers(path: Path, name: str, column: pd.Series, layout: _Layout) -> FloatArray:
    """Values of a column; an error names the first cell that is no number."""
    if column.dtype.kind in "fiu":
        return column.to_numpy(dtype=float)
    out = np.empty(len(column))
    for row, cell in enumerate(column):
        number = _number(str(cell).strip(), layout.decimal)
        if number is None:
            raise DataError(
                f"{path}, line {layout.rows[row][0]}, column '{name}': {cell!r} is not a number. "
                f"{_mend(str(cell))}"
            )
        out[row] = number
    return out


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
        return (
            "Write instants as in 2024-05-03T10:00:00.1 (ISO 8601), or as seconds. Or, only where "
            "no row is lost, leave time out and state sampling_rate (Hz): in [files], or of one "
            "logger of several in [instruments.NAME]."
        )
    if re.search(r"\d([.,' ])\d{3}(\1\d{3}|[.,]\d)*\b", cell):
        return "If its mark divides thousands, export the file without such marks."
    return (
        "Correct the cell, leave it empty where the value is missing, or state decimal and "
        "delimiter in [files]."
    )
