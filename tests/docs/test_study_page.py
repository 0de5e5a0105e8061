"""The study page: its command, its Python and its study file give what it shows."""

from pathlib import Path

import pytest
from pages import play

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "study.md").read_text("utf-8")


def test_the_page_runs_and_prints_what_it_shows(tutorial, monkeypatch):
    pytest.importorskip("matplotlib", reason="the report draws figures")
    # Figures of reports are looked at in tests/report/test_page.py, of such a study.
    monkeypatch.setattr("seakeep.report.page._drawn", lambda drawing, folder: None)
    # One process: the small study is done before another has started.
    play(PAGE.replace("seakeep study study.toml -o study", "seakeep study study.toml -o study "
                      "--workers 1", 1), "study.md")  # fmt: skip
    assert (tutorial / "study/report.html").stat().st_size > 10_000


def test_the_page_shows_the_study_file():
    begin = PAGE.index("```toml\n") + len("```toml\n")
    shown = PAGE[begin : PAGE.index("```", begin)]
    written = (DOCS / "tutorial" / "study.toml").read_text("utf-8")
    assert written.partition("\n\n")[2] == shown
