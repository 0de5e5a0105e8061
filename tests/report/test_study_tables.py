"""Tables as files: what LaTeX gets, and settings in words."""

import csv
import io
import re

import numpy as np
import pytest
import xarray as xr
from rich.console import Console

from seakeep.report.quality_sheet import clock_rows
from seakeep.report.sections.data import setting_text
from seakeep.report.tables import Number, Table, number, rich_tables, write_csv, write_latex
from seakeep.signals import Clock


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("window", None, "all samples"),
        ("alignment", None, "none"),
        ("standardize", True, "yes"),
        ("tests.unseen.startup", 2.5, "2.5 s"),
        ("state_delays", 32, "32 samples"),
        ("encounter_period", 1.6456710747033423, "1.64567 s"),
        ("seed", 2**63, "9223372036854775808"),
        ("ridge", {"uniform": [50.0, 150.0]}, "uniform, 50 to 150"),
        ("window", {"log_uniform": [320, 640]}, "log-uniform, 320 to 640 samples"),
        (
            "window",
            {"distribution": "norm", "parameters": {"loc": 15.0, "scale": 1.0}, "unit": "T"},
            "scipy.stats.norm(loc=15, scale=1) T̂",
        ),
        ("runs", ["first", "second"], "first, second"),
        ("lead", 24, "24 samples"),
    ],
)
def test_settings_are_words_and_not_code(key, value, words):
    assert setting_text(key, value) == words


def test_no_cell_of_a_csv_file_is_a_formula(tmp_path):
    names = ("=1+1", "@SUM(A1)", "+cmd|' /C calc'!A0", "-2+HYPERLINK(A1)", "\tx")
    numbers = ("-0.4", "+370.00 ± 0.10 ms", "–", "-", "heave")
    table = Table("t", "T", ("=head",), tuple((each,) for each in names + numbers))
    with write_csv(table, tmp_path / "t.csv").open(encoding="utf-8", newline="") as file:
        rows = [row[0] for row in csv.reader(file)]
    assert rows == ["'=head", *(f"'{name}" for name in names), *numbers]


def test_a_latex_table_breaks_short_headings_where_it_is_too_wide(tmp_path):
    def widths(models):
        heads = ("channel", *(f"NRMSE {name}: median [IQR]" for name in models))
        row = ("a bow load", *(Number("1.005 [1.122]") for _ in models))
        path = write_latex(Table("t", "T", heads, [row]), tmp_path / "t.tex")
        form = re.search(r"begin\{tabular\}\{(.*)\}", path.read_text("utf-8"))[1]
        return [form, *(float(each) for each in re.findall(r"p\{([\d.]+)\\linewidth\}", form))]

    assert widths(["own"]) == ["lr"]  # it fits as it is
    _, *parts = widths(["own", "ens", "fir", "arx", "old", "new"])
    assert len(parts) == 7  # of at most 23 letters each
    assert 0.6 < sum(parts) <= 1.0


@pytest.mark.parametrize("width", [140, 60])
def test_a_table_for_the_terminal_keeps_its_numbers_in_further_blocks(width):
    """As of the acts of `seakeep reproduce`: ten columns."""
    seas = ("irregular", "λ/L 1.5", "λ/L 2", "λ/L 3")
    heads = ("act", "model", *(f"{sea}: {part}" for sea in seas for part in ("waves", "slow")))
    row = ("a long title of it", "deterministic", *(number(10.25 + k, 2) for k in range(8)))
    console = Console(file=io.StringIO(), width=width)
    console.print(*rich_tables(Table("t", "T", heads, [row]), console.width))
    lines = console.file.getvalue().splitlines()
    assert re.findall(r"1\d\.25", console.file.getvalue()) == list(row[2:])
    blocks = sum("deterministic" in line for line in lines)
    assert blocks == 1 if width == 140 else blocks > 1
    assert "…" not in console.file.getvalue()
    assert max(map(len, lines)) <= width


def test_each_clock_has_a_row_and_none_is_parsed_from_a_sentence():
    told = {"offset": 0.37, "offset_error": 1e-4, "drift_ppm": 25.0, "drift_error_ppm": np.nan,
            "method": "trigger pulses, drift of 2 runs", "count": 13}  # fmt: skip
    run = xr.Dataset(attrs={f"clock_mru_{key}": value for key, value in told.items()})
    row = ("mru", "+370.00 ± 0.10 ms", "+25.0 ppm", "trigger pulses, drift of 2 runs, n = 13")
    assert list(clock_rows(run)) == [row]
    same = run.assign_attrs(clock_mru_method=Clock.method, clock_mru_count=0)
    assert list(clock_rows(same)) == [("mru", "", "", "the same clock")]
    assert list(clock_rows(xr.Dataset())) == []
