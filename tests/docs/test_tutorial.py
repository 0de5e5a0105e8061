"""Every command and every Python block of the tutorial runs and prints what the page shows."""

import pytest
from pages import page, play

PAGE = page("tutorial/tutorial.md")


def test_the_tutorial_runs_and_prints_what_it_shows(tutorial):
    pytest.importorskip("matplotlib")
    pytest.importorskip("control")
    play(PAGE)
    assert (tutorial / "comparison/unseen.png").stat().st_size > 10_000
    assert (tutorial / "rom.mat").exists()


def test_the_page_shows_the_files_and_their_draft_can_be_fitted_and_judged(tutorial, command):
    pytest.importorskip("matplotlib")
    assert (tutorial / "run1.csv").read_text("utf-8").splitlines()[0] in PAGE
    command("init", "run1.csv", "run2.csv", "run3.csv", "-o", "draft.toml")
    draft = (tutorial / "draft.toml").read_text("utf-8").splitlines()
    for line in PAGE.partition("```toml\n")[2].partition("```")[0].splitlines():
        assert line in draft
    fitted, _ = command("fit", "draft.toml", "-o", "draft.nc")
    printed = fitted + command("compare", "draft.nc", "draft.toml")[0]
    for kinds in ("none", "slow_squares", "powers", "slow_squares, powers"):
        assert f"observables {kinds}, lead" in printed
    assert printed.count("(chosen)") == 1
    assert "pitch" in printed
    assert "mooring_bow" not in printed  # loads are left to the user
