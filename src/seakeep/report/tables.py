"""Tables as data, and their output as CSV, LaTeX and text (pages have a template)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, SupportsFloat

import numpy as np
import numpy.typing as npt
import pandas as pd
import xarray as xr

from seakeep.files import replacing, templates, write_text
from seakeep.report.style import model_words
from seakeep.toml import packaged

if TYPE_CHECKING:
    from rich.table import Table as RichTable


class Number(str):
    """Text of a number: a table sets a column of them to the right."""

    __slots__ = ()


MISSING = Number("–")
Form = int | str | Callable[[SupportsFloat], Number]
"""How a number is written: its decimals, a format of Python, or a function."""


@dataclass(frozen=True)
class Table:
    """A table.

    Parameters
    ----------
    name : str
        Name of its files.
    title : str
        Caption.
    columns : sequence of str
        Headings.
    rows : sequence of sequence of str
        Cells.
    note : str
        What a reader must know about it.
    elsewhere : sequence of int
        Columns that come from another data set.
    averages : sequence of int
        Rows that are averages of others.
    marked : sequence of int
        Rows that a page sets apart.
    folded : bool
        Whether a page folds it away until it is wanted.
    heat : int
        Column of numbers from which on a page shows errors as shades, where it is not 0; such a
        table stands before figures.
    """

    name: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    elsewhere: Sequence[int] = ()
    averages: Sequence[int] = ()
    marked: Sequence[int] = ()
    folded: bool = False
    heat: int = 0

    @cached_property
    def numbers(self) -> frozenset[int]:
        """Columns that hold numbers: those whose cells are :class:`Number`."""
        columns = enumerate(zip(*self.rows, strict=True))
        return frozenset(k for k, cells in columns if {*map(type, filter(None, cells))} == {Number})


WORDS = packaged("report/templates/words.toml")
"""Words of the pages: sections, figures and tables by name."""


def table(
    key: str, rows: Iterable[Sequence[str] | xr.Dataset], more: str = "", **given: Any
) -> Table:
    """Return a table with the words of ``words.toml``.

    Parameters
    ----------
    key : str
        Its place there.
    rows : iterable of sequence of str or Dataset
        Cells of each row, or an entry that holds the variables that the columns name there.
    more : str, optional
        What follows the note.
    **given
        Other parts of a :class:`Table`, such as ``name``, if it is not the key, and what the
        words hold in braces.

    Returns
    -------
    Table
    """
    entry = WORDS["tables"][key]
    # A column is a heading, and where its cells come from entries their variable and form.
    columns = [[each] if isinstance(each, str) else each for each in entry.get("columns", ())]
    made = {
        "name": key,
        "title": entry["title"].format(**given),
        "columns": tuple(head.format(**given) for head, *_ in columns),
        "note": entry.get("note", "").format(**given) + more,
    }
    cells = [
        tuple(cell(each, *how) for _, *how in columns) if isinstance(each, xr.Dataset) else each
        for each in rows
    ]
    return Table(rows=cells, **parts_of(Table, entry | made | given))


def parts_of(kind: type, given: Mapping[str, Any]) -> dict[str, Any]:
    """What of all that is given is a part of a dataclass."""
    return {each.name: given[each.name] for each in fields(kind) if each.name in given}


def by_channel(channels: Iterable[str], columns: Iterable[Iterable[str]]) -> dict[str, Any]:
    """Parts of a table with a row per channel, and one of averages where columns have it.

    Columns start with their headings.

    Examples
    --------
    >>> by_channel(["heave"], [["NRMSE", "0.1", "0.2"]])["rows"]
    [('heave', '0.1'), ('average', '0.2')]
    """
    every, names = [[*column] for column in columns], ["channel", *channels]
    averages = [len(names) - 1] if len(every[0]) > len(names) else []
    heads, *rows = zip([*names, *["average"] * len(averages)], *every, strict=True)
    return {"columns": heads, "rows": rows, "averages": averages}


SHADES = (0.1, 0.2, 0.35, 0.5, 0.75, 1.0)
"""Errors in SD at which the shade of a cell changes."""


def shade(text: str) -> int:
    """Shade of a cell: how many of the steps an error is beyond; 0 for NaN.

    Examples
    --------
    >>> shade("0.05"), shade("0.34"), shade("4.6"), shade("–")
    (0, 2, 6, 0)
    """
    try:
        value = float(text)
    except ValueError:
        return 0
    return sum(value >= step for step in SHADES)


def number(value: SupportsFloat, form: Form = 3) -> Number:
    """Text of a number of so many decimals, or in another form; a dash for NaN.

    Examples
    --------
    >>> number(0.12345), number(-0.0001), number(2255.3387, ".4g"), number(float("nan"))
    ('0.123', '0.000', '2255', '–')
    """
    if callable(form):
        return form(value)
    value = float(value)
    spec = f"z.{form}f" if isinstance(form, int) else form
    return MISSING if np.isnan(value) else Number(format(value, spec))


def numbers(values: npt.ArrayLike, form: Form = 3) -> list[Number]:
    """Texts of numbers, one after the other."""
    return [number(each, form) for each in np.ravel(values)]


def reach(values: npt.ArrayLike, digits: int = 0) -> str:
    """Text of the smallest and the largest of some numbers, of both alike once.

    Examples
    --------
    >>> reach([13, 12.7, 278.4]), reach([1.2, 1.2], 1)
    ('13 to 278', '1.2')
    """
    return " to ".join(dict.fromkeys(numbers([np.min(values), np.max(values)], digits)))


short, shorter = partial(number, form=".4g"), partial(number, form=".3g")
"""Texts of numbers of four and of three significant digits."""


def small_number(value: SupportsFloat) -> Number:
    """Text of a number of four decimals, or as many more as two digits of it need.

    Examples
    --------
    >>> small_number(0.0186), small_number(0.00023), small_number(-1.4e-5), small_number(3e-9)
    ('0.0186', '0.00023', '-0.000014', '3.0e-09')
    >>> small_number(0.0)
    '0'
    """
    value = float(value)
    if not np.isfinite(value) or value == 0:
        return number(value, 0)
    decimals = max(4, 1 - int(np.floor(np.log10(abs(value)))))
    return number(value, decimals) if decimals <= 7 else Number(f"{value:.1e}")


def signed(value: SupportsFloat) -> Number:
    """Text of a number with its sign, where anything of it is left after rounding.

    Examples
    --------
    >>> signed(1.4), signed(-0.4), signed(-0.6)
    ('+1', '0', '-1')
    """
    text = number(value, 0)
    return Number(f"+{text}") if text != MISSING and float(text) > 0 else text


def percent(part: SupportsFloat) -> Number:
    """Text of a part of one, in percent and without the sign."""
    return number(100 * float(part), 0)


def probability(value: SupportsFloat) -> Number:
    """Text of a p-value.

    Examples
    --------
    >>> probability(0.0004), probability(0.0386)
    ('< 0.001', '0.039')
    """
    return Number("< 0.001") if float(value) < 0.001 else number(value)


def to(bounds: Iterable[SupportsFloat], form: Form = 3, unit: str = "") -> Number:
    """Text of an interval, or a dash.

    Examples
    --------
    >>> to([0.421, 0.549]), to([2255.3, 3000.1], 0, " m"), to([0.4, float("nan")])
    ('0.421 to 0.549', '2255 to 3000 m', '–')
    """
    texts = [number(each, form) for each in bounds]
    return MISSING if MISSING in texts else Number(" to ".join(texts) + unit)


def entries(data: xr.Dataset, *dims: str) -> Iterator[xr.Dataset]:
    """Entries of a dataset over some of its dimensions, the last of them first."""
    for place in np.ndindex(*(data.sizes[dim] for dim in dims)):
        yield data.isel(dict(zip(dims, place, strict=True)))


def row(at: xr.Dataset, /, *words: str, **forms: Form) -> tuple[str, ...]:
    """Cells of an entry: its words, then its numbers, each with its decimals or form.

    Examples
    --------
    >>> at = xr.Dataset({"run": "first", "height": 0.0612, "mean": 1234.5})
    >>> row(at, "run", height=2, mean=".4g")
    ('first', '0.06', '1234')
    """
    texts: dict[str, Form] = dict.fromkeys(words, "words")
    return tuple(cell(at, key, form) for key, form in (texts | forms).items())


def cell(at: xr.Dataset, key: str, form: Form = "words", *more: Form) -> str:
    """Cell of an entry, in one of the forms of :data:`CELLS`, which `more` go to, or as a number.

    Examples
    --------
    >>> at = xr.Dataset({"run": "first", "share": 0.123})
    >>> cell(at, "run"), cell(at, "share", 2), cell(at, "share", "percent")
    ('first', '0.12', '12 %')
    """
    return CELLS[form](at, key, *more) if form in CELLS else number(at[key], form)


def interval(at: xr.Dataset, key: str, form: Form = 3) -> Number:
    """Text of the bounds ``KEY_lower`` and ``KEY_upper``."""
    return to([at[f"{key}_{bound}"] for bound in ("lower", "upper")], form)


CELLS: dict[Form, Callable[..., str]] = {
    "words": lambda at, key: str(at[key].values),
    "if there": lambda at, key, *how: cell(at, key, *how) if key in at else MISSING,
    "model": lambda at, key: model_words(at[key].item()),
    "percent": lambda at, key: to([100 * at[key]], 0, " %"),
    "probability": lambda at, key: probability(at[key]),
    "interval": interval,
    "uncertain": lambda at, key: uncertain(at[key], at[f"{key}_uncertainty"]),
    "growth": lambda at, _: ratio_of(at).growth(),
}
"""Forms of cells that are no format of a number, as ``words.toml`` names them."""


def beside(*values: SupportsFloat, form: Form = 3) -> Number:
    """Text of a number, and of others that belong to it, such as bounds, in brackets.

    Examples
    --------
    >>> beside(0.481, 0.421, 0.549), beside(-20.4, -35.0, 5.0, form=signed)
    ('0.481 [0.421, 0.549]', '-20 [-35, +5]')
    """
    first, *rest = (number(each, form) for each in values)
    return Number(f"{first} [{', '.join(rest)}]")


class Interval(NamedTuple):
    """A number with its 95 % interval; NaN where there is none."""

    value: float
    lower: float
    upper: float

    def below(self, other: Interval | float) -> bool | None:
        """Whether it lies below a bound, or another number; None where the intervals meet."""
        _, lower, upper = other if isinstance(other, Interval) else (other,) * 3
        if self.upper < lower:
            return True
        return False if self.lower > upper else None

    def above(self, bound: float) -> bool | None:
        """Whether it lies above a bound; None where the interval holds the bound."""
        below = self.below(bound)
        return None if below is None else not below

    def text(self, form: Form = 2, unit: str = "", factor: float = 1.0) -> Number:
        """Text of the number times a factor, with its interval in brackets.

        Examples
        --------
        >>> Interval(0.4, 0.2, 0.6).text(), Interval(0.4, np.nan, np.nan).text(0, " %", 100)
        ('0.40 [0.20, 0.60]', '40 %')
        """
        value, low, high = numbers([factor * x for x in self], form)
        return Number(f"{value}{unit}" + f" [{low}, {high}]" * bool(np.isfinite(self.lower)))

    @property
    def is_multiple(self) -> bool:
        """Whether a ratio is stated as how many times, and not in percent: from 2 on."""
        return round(self.value, 2) >= 2

    def cells(self) -> tuple[Number, Number, str]:
        """Cells of an error over another: its change, the bounds, and what they say.

        Examples
        --------
        >>> Interval(0.8, 0.7, 0.9).cells(), Interval(1.9, 0.9, 2.3).cells()
        (('−20 %', '−30 to −10 %', 'better'), ('+90 %', '−10 to +130 %', 'cannot tell'))
        >>> Interval(2.57, 1.6, 14.57).cells()
        ('2.57 times', '1.6 to 14.6 times', 'worse')
        """
        words = {True: "better", False: "worse", None: "cannot tell"}[self.below(1.0)]
        if max(abs(self.lower - 1.0), abs(self.upper - 1.0)) < 0.005:
            words = "as good"
        how = (shorter, " times") if self.is_multiple else (_relative, " %")
        return to(self[:1], *how), to(self[1:], *how), words

    def change(self) -> Number:
        """Text of a ratio as a change.

        Examples
        --------
        >>> Interval(0.8, 0.7, 1.2).change(), Interval(4.4, 1.9, 9.0).change()
        ('-20 % [-30, +20]', '4.4 times [1.9, 9]')
        """
        return self.text(shorter, " times") if self.is_multiple else self.growth()

    def growth(self) -> Number:
        """Text of a ratio as a relative change, in percent."""
        return Interval(*(x - 1 for x in self)).text(signed, " %", 100.0)

    def part(self) -> Number:
        """Text of a share."""
        return self.text(0, " %", 100.0)


def ratio_of(at: xr.Dataset, prefix: str = "") -> Interval:
    """An error over another one, of an entry that holds its ``change`` with bounds."""
    return Interval(*(1.0 + float(at[f"{prefix}{key}"]) for key in ("change", "lower", "upper")))


def uncertain(value: SupportsFloat, uncertainty: SupportsFloat) -> Number:
    """Text of a value ± its uncertainty, which has two digits, and the value as many decimals.

    Examples
    --------
    >>> uncertain(2255.3387, 1159.329), uncertain(0.01234, 0.00056)
    ('2300 ± 1200', '0.01234 ± 0.00056')
    """
    both = [float(value), float(uncertainty)]
    if not np.isfinite(both).all():
        return MISSING
    places = 1 - int(np.floor(np.log10(both[1]))) if both[1] > 0 else 6
    return Number(" ± ".join(numbers([round(each, places) for each in both], max(places, 0))))


def _relative(ratio: SupportsFloat) -> Number:
    """Change of a ratio from one, without the sign of percent."""
    return Number(signed(100 * (float(ratio) - 1)).replace("-", "−"))


def band_words(level: float, kind: str | None) -> str:
    """Level of a band, and its kind where it is not that of the members.

    Examples
    --------
    >>> band_words(0.95, "members"), band_words(0.9, "calibrated")
    ('95 % band', '90 % calibrated band')
    """
    return f"{100 * level:g} % {'calibrated ' * (kind == 'calibrated')}band"


def band_verdict(inside: float, level: float) -> str:
    """Whether a band holds the part of the instants that it claims, in words.

    Examples
    --------
    >>> band_verdict(1.0, 0.95), band_verdict(0.8, 0.95), band_verdict(0.6, 0.95)
    ('which is what it claims', 'not what it claims', 'far too little')
    """
    if round(abs(inside - level), 9) <= 0.05:
        return "which is what it claims"
    return "far too little" if inside < level - 0.2 else "not what it claims"


def with_minus(text: str) -> str:
    """Text whose negative numbers have the sign of minus."""
    return re.sub(r"(?<![\w)])-(?=\d)", "−", text)


def plain_cell(text: str) -> str:
    """Text that no spreadsheet takes for a formula: an apostrophe stands before it.

    Examples
    --------
    >>> plain_cell("=1+1"), plain_cell("-0.5"), plain_cell("heave")
    ("'=1+1", '-0.5', 'heave')
    """
    is_number = re.match(r"-\Z|[+-]?(\d|\.\d|inf|nan)", text) and not re.search(r"[=(!|]", text)
    begins = text.startswith(("=", "+", "-", "@", "\t", "\r"))
    return f"'{text}" if begins and not is_number else text


def write_csv(table: Table, path: Path) -> Path:
    """Write a table as :func:`write_frame` does."""
    return write_frame(pd.DataFrame([*table.rows], columns=[*table.columns]), path)


def write_frame(frame: pd.DataFrame, path: Path) -> Path:
    """Write a table as CSV (UTF-8), in which no cell is a formula."""
    plain = frame.map(lambda cell: plain_cell(cell) if isinstance(cell, str) else cell)
    with replacing(path) as temporary:
        plain.rename(columns=plain_cell).to_csv(temporary, index=False, lineterminator="\n")
    return path


def rich_tables(table: Table, width: int) -> Iterator[RichTable]:
    """Body of a table for a terminal of `width` characters.

    Text wraps between words, numbers are never cut: columns that do not fit stand in further
    blocks, with the columns before the first number again.
    """
    from rich import box
    from rich.table import Table as RichTable

    columns = list(zip(table.columns, *table.rows, strict=True))
    least = [_least_width(column, k in table.numbers) for k, column in enumerate(columns)]
    first = min(table.numbers, default=len(columns))

    def room(block: Iterable[int]) -> int:
        return width - 1 - sum(least[k] + 2 for k in block)  # two spaces behind each column

    blocks = [[*range(first)]]
    for k in range(first, len(columns)):
        if len(blocks[-1]) > first and room([*blocks[-1], k]) < 0:
            blocks.append([*range(first)])
        blocks[-1].append(k)
    for block in blocks:
        left, each = max(room(block), 0), RichTable(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
        for k in block:
            more = min(left, max(map(len, columns[k])) - least[k])
            left -= more
            each.add_column(
                columns[k][0],
                justify="right" if k in table.numbers else "left",
                width=least[k] + more,
                overflow="fold",
            )
        for number, row in enumerate(table.rows):
            bold = "bold" if number in table.averages else None
            each.add_row(*(row[k] for k in block), style=bold)
        yield each


def _least_width(column: Sequence[str], whole: bool) -> int:
    """Characters that a column needs: of its longest number, or of its longest word."""
    head, *cells = column
    words = cells if whole else " ".join(cells).split()
    longest = max(map(len, [*words, *head.split()]), default=0)
    return longest if whole else min(longest, NAME)


NAME = 20
"""Characters of a word, such as the name of a channel, that a terminal does not break."""
LINE = 75
"""Characters, about, that fit beside each other on a page of an article in small type."""
PAGE = 35
"""Rows from which on a LaTeX table breaks pages."""


def latex_text(text: str) -> str:
    r"""Text that LaTeX prints as it stands.

    Examples
    --------
    >>> latex_text("50 % of λ_max")
    '50 \\% of $\\lambda$\\_max'
    >>> latex_text("τ̂ of τ")
    '$\\hat\\tau$ of $\\tau$'
    >>> latex_text("-0.12 [-0.3, 0.1] a-1")
    '$-$0.12 [$-$0.3, 0.1] a-1'
    """
    known = WORDS["latex"]
    signs = "|".join(map(re.escape, sorted(known, key=len, reverse=True)))
    return re.sub(signs, lambda match: known[match[0]], with_minus(text))


def write_latex(table: Table, path: Path) -> Path:
    r"""Write a table as LaTeX with booktabs rules; longer than a page it is a longtable."""
    columns = list(zip(table.columns, *table.rows, strict=True))
    whole = [max(map(len, column)) for column in columns]
    words = [max(map(len, " ".join(column).split()), default=0) for column in columns]

    def widths(level: int) -> list[int]:
        """Each column as wide as its longest word, and as a level that it may need less than."""
        return [min(a, max(b, level)) for a, b in zip(whole, words, strict=True)]

    fitting = (k for k in range(LINE, 8, -1) if sum(widths(k)) + 2 * len(columns) <= LINE)
    # Numbers to the right, text to the left, what does not fit in lines that break.
    form = "".join(
        rf"p{{{width / LINE:.2f}\linewidth}}" if width < whole[k] else "lr"[k in table.numbers]
        for k, width in enumerate(widths(next(fitting, 8)))
    )
    environment = templates("report")
    environment.filters["latex"] = latex_text
    template = environment.get_template("table.tex")
    write_text(path, template.render(table=table, form=form, long=len(table.rows) > PAGE))
    return path
