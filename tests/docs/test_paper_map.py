"""The paper map names only what exists."""

import re
from pkgutil import resolve_name

import pytest
from pages import page
from places import ROOT

PAGE = page("paper_map.md")
ROWS = [
    [each.strip() for each in line.strip("|").split("|")]
    for line in PAGE.split("## Where the paper")[0].splitlines()
    if line.startswith("|") and not line.startswith(("|--", "| in the"))
]
DEVIATIONS = [line for line in PAGE.splitlines() if re.match(r"\| \d+ \|", line)]


def quoted(text):
    return re.findall(r"`([^`]+)`", text)


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row[0])
def test_functions_and_tests_exist(row):
    _, functions, tests = row
    assert quoted(functions), "the row names no function"
    for name in quoted(functions):
        resolve_name(name)
    assert quoted(tests), "the row names no test"
    for name in quoted(tests):
        file, test = name.split("::")
        assert f"def {test}(" in (ROOT / file).read_text("utf-8"), f"{file} has no {test}"


def test_every_deviation_is_there_once():
    assert [int(line.split("|")[1]) for line in DEVIATIONS] == list(range(1, 32))


@pytest.mark.parametrize("line", DEVIATIONS, ids=lambda line: line.split("|")[1].strip())
def test_every_deviation_is_implemented_by_what_exists(line):
    state = line.strip("|").split("|")[-1].strip()
    assert re.match(r"implemented\b", state), state
    for name in quoted(line):
        if name.startswith("seakeep."):
            resolve_name(name)
