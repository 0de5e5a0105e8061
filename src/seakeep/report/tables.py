"""Tables as data, and their output as CSV, LaTeX and text (pages have a template)."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, SupportsFloat

import numpy as np
import xarray as xr

from seakeep.files import replacing

if TYPE_CHECKING:
    from rich.console import JustifyMethod
    from rich.table import Table as RichTable

__all__ = [
    "MISSING",
    "Table",
    "change",
    "interval",
    "latex_text",
    "number",
    "plain_cell",
    "probability",
    "rich_tables",
    "shade",
    "signed",
    "small_number",
    "text",
    "write_csv",
    "write_latex",
]

MISSING = "–"


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
    numeric : sequence of int
        Columns of numbers.
    elsewhere : sequence of int
        Columns that come from another data set.
    averages : sequence of int
        Rows that are averages of others.
    folded : bool
        Whether a page folds it away until it is wanted.
    heat : sequence of int
        Columns of errors whose size a page shows as a shade; such a table stands before figures.
    """

    name: str
    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    numeric: Sequence[int] = ()
    elsewhere: Sequence[int] = ()
    averages: Sequence[int] = ()
    folded: bool = False
    heat: Sequence[int] = ()


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


def number(value: SupportsFloat, digits: int = 3) -> str:
    """Text of a number; a dash for one that is not finite."""
    value = float(value)
    if not np.isfinite(value):
        return MISSING
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0 else text


def small_number(value: SupportsFloat) -> str:
    """Text of a number of four decimals, or as many more as two digits of it need.

    Examples
    --------
    >>> small_number(0.0186), small_number(0.00023), small_number(-1.4e-5), small_number(3e-9)
    ('0.0186', '0.00023', '-0.000014', '3.0e-09')
    """
    value = float(value)
    if not np.isfinite(value) or value == 0:
        return number(value, 0)
    decimals = max(4, 1 - int(np.floor(np.log10(abs(value)))))
    return f"{value:.{decimals}f}" if decimals <= 7 else f"{value:.1e}"


def signed(value: SupportsFloat, digits: int) -> str:
    """Text of a number with its sign, where anything of it is left after rounding.

    Examples
    --------
    >>> signed(1.4, 0), signed(-0.04, 1), signed(-0.06, 1)
    ('+1', '0.0', '-0.1')
    """
    text = number(value, digits)
    if text == MISSING or float(text) == 0.0:
        return text.removeprefix("-")
    return text if float(value) < 0 else f"+{text}"


def text(
    value: SupportsFloat, bounds: Sequence[float] | None = None, digits: int | None = 3
) -> str:
    """Text of a value with its interval, or with its uncertainty, where that is known.

    An uncertainty is shown with two digits, and the value to the same place.

    Parameters
    ----------
    value : float
        The value; NaN for an interval alone.
    bounds : sequence of float, optional
        Lower and upper bound, or one expanded uncertainty.
    digits : int, optional
        Decimals; None for four significant digits.

    Examples
    --------
    >>> text(0.481, (0.421, 0.549)), text(float("nan"), (0.421, 0.549)), text(0.481)
    ('0.481 (0.421 to 0.549)', '0.421 to 0.549', '0.481')
    >>> text(2255.3387, (1159.329,)), text(0.01234, (0.00056,)), text(2255.3387, digits=None)
    ('2300 ± 1200', '0.01234 ± 0.00056', '2255')
    """
    value = float(value)
    known = bounds is not None and bool(np.isfinite(bounds).all())
    if bounds is not None and len(bounds) == 1:
        if not (known and np.isfinite(value)):
            return MISSING
        places = 1 - int(np.floor(np.log10(bounds[0]))) if bounds[0] > 0 else 6
        both = (round(each, places) for each in (value, bounds[0]))
        return " ± ".join(number(each, max(places, 0)) for each in both)
    shown = [f"{each:.4g}" if digits is None else number(each, digits) for each in bounds or ()]
    whole = f"{value:.4g}" if digits is None and np.isfinite(value) else number(value, digits or 0)
    if not known:
        return whole
    return f"{whole} ({' to '.join(shown)})" if np.isfinite(value) else " to ".join(shown)


def change(*ratios: float) -> str:
    """Text of one error over another, or of an interval: in percent, or how many times from 2 on.

    Examples
    --------
    >>> change(0.4), change(1.1), change(14.57), change(2.1, 3.05), change(float("nan"))
    ('−60 %', '+10 %', '14.6 times', '2.1 to 3.05 times', '–')
    """
    if not np.isfinite(ratios).all():
        return MISSING
    if round(max(ratios), 2) >= 2:
        return " to ".join(f"{each:.3g}" for each in ratios) + " times"
    return " to ".join(signed(100 * (each - 1), 0) for each in ratios).replace("-", "−") + " %"


def interval(at: xr.Dataset, key: str, value: SupportsFloat = np.nan) -> str:
    """Text of the bounds ``KEY_lower`` and ``KEY_upper``, behind a value where one is given."""
    return text(value, [float(at[f"{key}_{bound}"]) for bound in ("lower", "upper")])


def probability(value: SupportsFloat) -> str:
    """Text of a p-value."""
    return "< 0.001" if float(value) < 0.001 else number(value)


def plain_cell(text: str) -> str:
    """Text that no spreadsheet takes for a formula: an apostrophe stands before it.

    Examples
    --------
    >>> plain_cell("=1+1"), plain_cell("-0.5"), plain_cell("heave")
    ("'=1+1", '-0.5', 'heave')
    """
    if not text.startswith(("=", "+", "-", "@", "\t", "\r")):
        return text
    if re.match(r"[+-]?(\d|\.\d|inf|nan)", text) and not re.search(r"[=(!|]", text):
        return text
    return text if text in ("-", MISSING) else f"'{text}"


def write_csv(table: Table, path: Path) -> Path:
    """Write a table as CSV (UTF-8)."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerows([*map(plain_cell, row)] for row in (table.columns, *table.rows))
    with replacing(path) as temporary:
        temporary.write_text(buffer.getvalue(), encoding="utf-8")
    return path


def rich_tables(table: Table, width: int) -> list[RichTable]:
    """Body of a table for a terminal of `width` characters.

    Text wraps between words, numbers are never cut: columns that do not fit stand in further
    blocks, with the columns before the first number again.
    """
    least = [_least_width(table, k) for k in range(len(table.columns))]
    first = min(table.numeric, default=len(least))
    blocks: list[list[int]] = [[*range(first)]]
    for k in range(first, len(least)):
        if len(blocks[-1]) > first and _drawn_width(least, [*blocks[-1], k]) > width:
            blocks.append([*range(first)])
        blocks[-1].append(k)
    return [_rich_table(table, block, least, width) for block in blocks]


def _drawn_width(widths: Sequence[int], columns: Iterable[int]) -> int:
    return 1 + sum(widths[k] + 2 for k in columns)  # a space, and two behind each column


def _least_width(table: Table, k: int) -> int:
    """Characters that a column needs: of its longest number, or of its longest word."""
    whole = k in table.numeric
    words = [word for row in table.rows for word in ([row[k]] if whole else row[k].split())]
    longest = max(map(len, [*words, *table.columns[k].split()]), default=0)
    return longest if whole else min(longest, NAME)


def _rich_table(
    table: Table, columns: Sequence[int], least: Sequence[int], width: int
) -> RichTable:
    from rich import box
    from rich.table import Table as RichTable

    out = RichTable(box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
    room = max(width - _drawn_width(least, columns), 0)
    for k in columns:
        longest = max(map(len, [table.columns[k], *(row[k] for row in table.rows)]))
        more = min(room, max(longest - least[k], 0))
        room -= more
        justify: JustifyMethod = "right" if k in table.numeric else "left"
        out.add_column(table.columns[k], justify=justify, width=least[k] + more, overflow="fold")
    for k, row in enumerate(table.rows):
        out.add_row(*(row[j] for j in columns), style="bold" if k in table.averages else None)
    return out


_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "–": "--", "×": r"$\times$", "λ": r"$\lambda$", "ε": r"$\varepsilon$", "τ": r"$\tau$",
    "−": r"$-$", "η": r"$\eta$", "≥": r"$\ge$", "²": r"$^2$", "±": r"$\pm$", "°": r"$^\circ$",
    "→": r"$\to$", "σ": r"$\sigma$", "Δ": r"$\Delta$", "√": r"$\surd$", "π": r"$\pi$",
    "·": r"$\cdot$", "³": r"$^3$", "φ": r"$\varphi$", "θ": r"$\theta$", "ω": r"$\omega$",
    "<": r"$<$", ">": r"$>$", "T̂": r"$\hat T$", "τ̂": r"$\hat\tau$",
}  # fmt: skip
_KNOWN = re.compile("|".join(re.escape(each) for each in sorted(_LATEX, key=len, reverse=True)))
NAME = 20
"""Characters of a word, such as the name of a channel, that a terminal does not break."""
WIDE = 24
"""Characters of a cell from which on its column may break lines in LaTeX."""
LINE = 90
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
    """
    text = re.sub(r"(?<![\w)])-(?=\d)", "−", text)
    return _KNOWN.sub(lambda found: _LATEX[found[0]], text)


def write_latex(table: Table, path: Path) -> Path:
    r"""Write a table as LaTeX with booktabs rules; longer than a page it is a longtable."""
    caption = rf"\caption{{{latex_text(f'{table.title}. {table.note}'.strip())}}}"
    label = rf"\label{{tab:{table.name}}}"
    head = [r"\toprule", _latex_line(table.columns), r"\midrule"]
    body = []
    for k, row in enumerate(table.rows):
        body += [r"\midrule"] * (k in table.averages) + [_latex_line(row)]
    form = _latex_columns(table)
    if len(table.rows) > PAGE:
        lines = [r"\begingroup\small", rf"\begin{{longtable}}{{{form}}}", rf"{caption}{label}\\"]
        lines += [*head, r"\endfirsthead", *head, r"\endhead", *body, r"\bottomrule"]
        lines += [r"\end{longtable}", r"\endgroup", ""]
    else:
        lines = [r"\begin{table}", r"\centering\small", caption, label]
        lines += [rf"\begin{{tabular}}{{{form}}}", *head, *body, r"\bottomrule"]
        lines += [r"\end{tabular}", r"\end{table}", ""]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines), encoding="utf-8")
    return path


def _latex_line(cells: Iterable[str]) -> str:
    return " & ".join(map(latex_text, cells)) + r" \\"


def _latex_columns(table: Table) -> str:
    """Columns of numbers to the right, of text to the left, of long text in lines that break."""
    columns: Sequence[Sequence[str]] = list(zip(table.columns, *table.rows, strict=True))
    longest = [max(map(len, column)) for column in columns]
    wide = [length for length in longest if length > WIDE]
    room = 1.0 - sum(length + 2 for length in longest if length <= WIDE) / LINE
    part = max(room, 0.12 * len(wide)) / max(sum(wide), 1)
    breaks = sum(longest) > LINE
    return "".join(
        rf"p{{{part * length:.2f}\linewidth}}"
        if breaks and length > WIDE
        else "lr"[k in table.numeric]
        for k, length in enumerate(longest)
    )
