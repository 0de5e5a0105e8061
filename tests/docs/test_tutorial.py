"""Every command and every Python block of the tutorial runs and prints what the page shows."""

import shutil
from pathlib import Path

import pytest
from pages import play

from seakeep.cli import main

FOLDER = Path(__file__).parents[2] / "docs/tutorial"
PAGE = (FOLDER / "tutorial.md").read_text(encoding="utf-8")


def test_the_tutorial_runs_and_prints_what_it_shows(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib", reason="seakeep compare draws a figure")
    pytest.importorskip("control", reason="the page exports to python-control")
    folder = tmp_path / "tutorial"
    shutil.copytree(FOLDER, folder)
    monkeypatch.chdir(folder)
    play(PAGE, "tutorial.md")
    assert (folder / "comparison/unseen.png").stat().st_size > 10_000
    assert (folder / "rom.mat").exists()


def test_the_page_shows_the_header_of_the_files_and_lines_of_the_draft(tmp_path, monkeypatch):
    shutil.copytree(FOLDER, tmp_path / "tutorial")
    monkeypatch.chdir(tmp_path / "tutorial")
    assert Path("run1.csv").read_text(encoding="utf-8").splitlines()[0] in PAGE
    assert main(["init", "run1.csv", "run2.csv", "run3.csv", "-o", "draft.toml"]) == 0
    draft = Path("draft.toml").read_text(encoding="utf-8").splitlines()
    first = PAGE.index("```toml\n") + len("```toml\n")
    for line in PAGE[first : PAGE.index("```", first)].splitlines():
        assert line in draft


def test_the_draft_can_be_fitted_and_judged_as_it_stands(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="seakeep compare draws a figure")
    shutil.copytree(FOLDER, tmp_path / "tutorial")
    monkeypatch.chdir(tmp_path / "tutorial")
    assert main(["init", "run1.csv", "run2.csv", "run3.csv", "-o", "draft.toml"]) == 0
    assert main(["fit", "draft.toml", "-o", "draft.nc"]) == 0
    assert main(["compare", "draft.nc", "draft.toml"]) == 0
    printed = capsys.readouterr().out
    for kinds in ("none", "slow_squares", "powers", "slow_squares, powers"):
        assert f"observables {kinds}, lead" in printed
    assert printed.count("(chosen)") == 1
    assert "pitch" in printed
    assert "mooring_bow" not in printed  # loads are left to the user
