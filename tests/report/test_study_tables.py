"""Tables as files: what LaTeX gets, and settings in words."""

import re
from types import SimpleNamespace

import pytest
import xarray as xr

from seakeep.report.latex import PAGE, write_latex_table
from seakeep.report.study_tables import ReportTable
from seakeep.report.study_words import _setting_words, clock_table


def latex(tmp_path, rows, **options):
    table = ReportTable("t", "Title", ("name", "unit", "number"), tuple(rows), **options)
    return write_latex_table(table, tmp_path / "t.tex").read_text("utf-8")


def test_columns_of_long_text_break_lines_and_those_of_numbers_stand_to_the_right(tmp_path):
    text = latex(tmp_path, [("a", "m/s²", "1.5"), ("b", "x" * 91, "-2")], numeric=(2,))
    # 90 characters are a line: 6 go to "name" and 8 to "number", with the space beside them.
    assert r"\begin{tabular}{lp{0.84\linewidth}r}" in text
    assert r"a & m/s$^2$ & 1.5 \\" in text
    assert r"& $-$2 \\" in text
    assert r"\caption{Title.}" in text
    two = latex(tmp_path, [("y" * 60, "x" * 40, "1")])
    assert r"{p{0.55\linewidth}p{0.36\linewidth}l}" in two
    assert r"{lll}" in latex(tmp_path, [("y" * 30, "x" * 40, "1")])


@pytest.mark.parametrize("rows", [PAGE, PAGE + 1])
def test_a_table_longer_than_a_page_breaks_and_repeats_its_head(tmp_path, rows):
    text = latex(tmp_path, [(str(n), "", "") for n in range(rows)], averages=(3,))
    kind = "longtable" if rows > PAGE else "tabular"
    assert text.count(rf"\begin{{{kind}}}") == text.count(rf"\end{{{kind}}}") == 1
    assert text.count(r"name & unit & number \\") == (2 if kind == "longtable" else 1)
    assert ("endhead" in text) == (kind == "longtable")
    # One rule below each head, and one above the average.
    assert text.count(r"\midrule") == (3 if kind == "longtable" else 2)
    assert re.search(r"2 &  &  \\\\\n\\midrule\n3 & ", text)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("models.m.window", "None", "all samples"),
        ("alignment", "None", "none"),
        ("standardize", "True", "yes"),
        ("tests.unseen.startup", "2.50", "2.5 s"),
        ("state_delays", "32", "32 samples"),
        ("encounter_period", "1.6456710747033423", "1.64567 s"),
        ("ridge", "Uniform(low=50, high=150)", "uniform, 50 to 150"),
        ("train_length", "Fixed(value=20)", "20 T̂"),
        ("train_length", "scipy.stats.norm(loc=15.0, scale=1.0)", None),
        ("name", "Virtual CK-14e", None),
        (
            "alignment",
            "ProbeAlignment(mode='effective', surge='measured', celerity=None, offset=0.0)",
            "elevation carried to the vessel, celerity estimated; surge measured",
        ),
        (
            "alignment",
            "ProbeAlignment(mode='dispersion', surge='none', celerity=None, offset=0.0)",
            "elevation carried to the vessel, by linear dispersion; surge none",
        ),
    ],
)
def test_settings_are_words_and_not_code(key, value, words):
    assert _setting_words(key, value) == (words or value)


def test_each_clock_has_a_row():
    told = "+370.00 ± 0.10 ms, +25.0 ppm (trigger pulses, drift of 2 runs, n = 13)"
    run = xr.Dataset(attrs={"clock_mru": told, "clock_mru_offset": 0.37})
    table = clock_table(SimpleNamespace(prepared={"first": run, "second": run}))
    assert table.rows[1] == (
        "second", "mru", "+370.00 ± 0.10 ms", "+25.0 ppm", "trigger pulses, drift of 2 runs, n = 13"
    )  # fmt: skip
    assert clock_table(SimpleNamespace(prepared={"alone": xr.Dataset()})) is None
