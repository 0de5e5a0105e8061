"""The page of the measurement chain runs and prints what it shows; what it names exists."""

import re

import pytest
from pages import page, play


@pytest.mark.usefixtures("empty_sheet")
def test_the_page_runs_and_prints_what_it_shows(tmp_path, monkeypatch):
    pytest.importorskip("numba")
    monkeypatch.chdir(tmp_path)
    play(page("measurement_chain.md"))
    sheet = (tmp_path / "virtual/prepared/quality.html").read_text("utf-8")
    assert re.search(r"<td>regular_<wbr>2</td><td[^>]*>not prepared</td>", sheet)
