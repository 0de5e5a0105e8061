"""Tables of a report as LaTeX."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from seakeep.files import replacing
from seakeep.report.study_tables import ReportTable

__all__ = ["latex_text", "write_latex_table"]

_LATEX = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_",
    "{": r"\{", "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "–": "--", "×": r"$\times$", "λ": r"$\lambda$", "ε": r"$\varepsilon$", "τ": r"$\tau$",
    "−": r"$-$", "η": r"$\eta$", "≥": r"$\ge$", "²": r"$^2$", "±": r"$\pm$", "°": r"$^\circ$",
    "→": r"$\to$", "σ": r"$\sigma$", "Δ": r"$\Delta$", "√": r"$\surd$", "π": r"$\pi$",
    "·": r"$\cdot$", "³": r"$^3$", "φ": r"$\varphi$", "θ": r"$\theta$", "ω": r"$\omega$",
    "<": r"$<$", ">": r"$>$", "T̂": r"$\hat T$", "τ̂": r"$\hat\tau$",
}  # fmt: skip


def latex_text(text: str) -> str:
    r"""Text that LaTeX prints as it stands.

    Examples
    --------
    >>> latex_text("50 % of λ_max")
    '50 \\% of $\\lambda$\\_max'
    """
    text = re.sub(r"(?<![\w)])-(?=\d)", "−", text.replace("T̂", "\0"))
    return "".join(_LATEX.get(each, each) for each in text).replace("\0", r"$\hat T$")


WIDE = 24
"""Characters of a cell from which on its column may break lines in LaTeX."""
LINE = 90
"""Characters, about, that fit beside each other on a page of an article in small type."""
PAGE = 35
"""Rows from which on a LaTeX table breaks pages."""


def write_latex_table(table: ReportTable, path: Path) -> Path:
    r"""Write a table as LaTeX with booktabs rules.

    Parameters
    ----------
    table : ReportTable
        The table.
    path : Path
        The file; ``\input`` it where ``booktabs`` is loaded, and ``longtable`` for tables that are
        longer than a page.

    Returns
    -------
    Path
        The file.
    """

    def line(cells: Sequence[str]) -> str:
        return " & ".join(map(latex_text, cells)) + r" \\"

    body = []
    for number, row in enumerate(table.rows):
        if number in table.averages:
            body.append(r"\midrule")
        body.append(line(row))
    words = latex_text(f"{table.title}. {table.note}".strip())
    caption = rf"\caption{{{words}}}"
    label, head = rf"\label{{tab:{table.name}}}", [r"\toprule", line(table.columns), r"\midrule"]
    form = _latex_columns(table)
    if len(table.rows) > PAGE:
        lines = [
            r"\begingroup\small",
            rf"\begin{{longtable}}{{{form}}}",
            rf"{caption}{label}\\",
            *head,
            r"\endfirsthead",
        ]
        lines += [*head, r"\endhead", *body, r"\bottomrule", r"\end{longtable}", r"\endgroup", ""]
    else:
        lines = [
            r"\begin{table}",
            r"\centering\small",
            caption,
            label,
            rf"\begin{{tabular}}{{{form}}}",
        ]
        lines += [*head, *body, r"\bottomrule", r"\end{tabular}", r"\end{table}", ""]
    with replacing(path) as temporary:
        temporary.write_text("\n".join(lines), encoding="utf-8")
    return path


def _latex_columns(table: ReportTable) -> str:
    """Columns of numbers to the right, of text to the left, of long text in lines that break."""
    longest = [
        max(len(cell) for cell in column) for column in zip(table.columns, *table.rows, strict=True)
    ]
    wide = [length for length in longest if length > WIDE]
    room = 1.0 - sum(length + 2 for length in longest if length <= WIDE) / LINE
    part = max(room, 0.12 * len(wide)) / max(sum(wide), 1)
    breaks = sum(longest) > LINE
    return "".join(
        rf"p{{{part * length:.2f}\linewidth}}"
        if breaks and length > WIDE
        else "r"
        if k in table.numeric
        else "l"
        for k, length in enumerate(longest)
    )
