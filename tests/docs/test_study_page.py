"""The study page: its command, its Python and its study file give what it shows."""

import pytest
from pages import page, play

PAGE = page("study.md")


def test_the_page_runs_and_prints_what_it_shows(tutorial, monkeypatch):
    pytest.importorskip("matplotlib")
    # Figures of reports are looked at in tests/report/test_page.py, of such a study.
    monkeypatch.setattr("seakeep.report.page._drawn", lambda drawing, folder: None)
    # One process: the small study is done before another has started.
    play(PAGE.replace("study.toml -o study", "study.toml -o study --workers 1", 1))
    assert (tutorial / "study/report.html").stat().st_size > 10_000


def test_the_page_shows_the_study_file():
    shown = PAGE.partition("```toml\n")[2].partition("```")[0]
    assert page("tutorial/study.toml").partition("\n\n")[2] == shown
