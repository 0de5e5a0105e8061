"""Write the numbers of `seakeep reproduce` into README.md and docs/study.md, and its figure.

    python benchmarks/acts_in_docs.py FOLDER

What it writes stands between comments in the pages that name this file.
"""

import argparse
import re
import shutil
import textwrap
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

from seakeep.cli.console import print_table
from seakeep.report.acts import (
    ENSEMBLE,
    acts_table,
    against_filter,
    claims_table,
    finding,
    short_table,
    still_water,
)
from seakeep.report.tables import percent, short
from seakeep.study.reproduce import read_reproduction

ROOT = Path(__file__).resolve().parents[1]
WIDTH = 120


def main():
    """Read a folder, and write."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of a full `seakeep reproduce`")
    folder = parser.parse_args().folder
    write(read_reproduction(folder), ROOT)
    shutil.copy(folder / "figures" / "acts.png", ROOT / "docs" / "figures")


def band_sentence(results):
    """How much the calibrated band of the recommended ensemble holds; empty without one."""
    if (result := results.get("recommended")) is None:
        return ""
    table = result.groups["statistics/coverage"]["inside"]
    at = table.sel(model=ENSEMBLE, band="calibrated", against="measured", channel="average")
    seas = (f"{percent(at.sel(test=test))} % ({result.label_of(test)})" for test in result.tests)
    level = short(100 * float(result.settings["statistics"]["level"]))
    return f"Of the instants, the calibrated {level} % band of (c) holds {', '.join(seas)}."


def write(results, root):
    """Put tables and sentences into the pages of a folder."""
    shown = StringIO()
    with redirect_stdout(shown):
        print_table(short_table(results), note=False)
    table = "\n".join(line.rstrip() for line in shown.getvalue().strip().splitlines())
    said = finding(results)
    ending = f"{_wrapped(said)}\n\nReport: reproduction/report.html"
    said_of_all = (finding, against_filter, still_water, band_sentence)
    every = " ".join(each(results) for each in said_of_all)
    blocks = {
        "README.md": {"finding": _wrapped(said), "short": f"```text\n{table}\n\n{ending}\n```"},
        "docs/study.md": {
            "acts": _markdown(acts_table(results)),
            "findings": _wrapped(every.strip()),
            "claims": _markdown(claims_table(results)),
        },
    }
    for page, texts in blocks.items():
        path = root / page
        text = path.read_text(encoding="utf-8")
        for name, block in texts.items():
            mark = f"<!-- {name}: written by benchmarks/acts_in_docs.py -->"
            between = re.compile(rf"({re.escape(mark)}\n\n).*?(\n\n<!-- end of {name} -->)", re.S)
            text, count = between.subn(lambda at, block=block: at[1] + block + at[2], text)
            if count != 1:
                raise SystemExit(f"{page} has {count} places for '{name}'; it needs one.")
        path.write_text(text, encoding="utf-8")


def _wrapped(text):
    return textwrap.fill(text, WIDTH, break_on_hyphens=False)


def _markdown(table):
    head = [table.columns, ["---"] * len(table.columns)]
    rows = ([cell.replace("|", r"\|") for cell in row] for row in (*head, *table.rows))
    return "\n".join(f"| {' | '.join(row)} |".replace("| --- ", "|---").replace("|--- |", "|---|")
                     for row in rows)  # fmt: skip


if __name__ == "__main__":
    main()
