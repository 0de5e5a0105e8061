"""Every command, Python block and program of the pages runs and prints what the page shows."""

import re
import shutil
import subprocess

import pytest
from compiled import need_compiler
from loaded import loaded
from pages import page, play
from places import ROOT

pytest.importorskip("matplotlib")

HOSTS, STUDY, TUTORIAL = map(page, ("howto/hosts.md", "study.md", "tutorial/tutorial.md"))


@pytest.fixture
def tutorial(tmp_path, monkeypatch):
    """A copy of the tutorial's folder, where the commands of a page run."""
    folder = tmp_path / "tutorial"
    shutil.copytree(ROOT / "docs/tutorial", folder)
    monkeypatch.chdir(folder)
    return folder


def test_the_tutorial(tutorial):
    pytest.importorskip("control")
    play(TUTORIAL)
    assert (tutorial / "comparison/unseen.png").stat().st_size > 10_000
    assert (tutorial / "rom.mat").exists()


def test_files_of_the_tutorial_are_shown_and_their_draft_can_be_fitted_and_judged(
    tutorial, command
):
    assert (tutorial / "run1.csv").read_text("utf-8").splitlines()[0] in TUTORIAL
    command("init", "run1.csv", "run2.csv", "run3.csv", "-o", "draft.toml")
    draft = (tutorial / "draft.toml").read_text("utf-8").splitlines()
    for line in TUTORIAL.partition("```toml\n")[2].partition("```")[0].splitlines():
        assert line in draft
    fitted, _ = command("fit", "draft.toml", "-o", "draft.nc")
    printed = fitted + command("compare", "draft.nc", "draft.toml")[0]
    for kinds in ("none", "slow_squares", "powers", "slow_squares, powers"):
        assert f"observables {kinds}, lead" in printed
    assert printed.count("(chosen)") == 1
    assert "pitch" in printed
    assert "mooring_bow" not in printed  # loads are left to the user


def test_a_study_ends_with_its_table_and_the_way_to_its_report(tutorial, monkeypatch, command):
    # Figures of reports are looked at in tests/report/test_page.py, of such a study.
    monkeypatch.setattr("seakeep.report.page._drawn", lambda page, number: None)
    # One process: the small study is done before another has started.
    play(STUDY.replace("study.toml -o study", "study.toml -o study --workers 1", 1))
    report = tutorial / "study/report.html"
    assert report.stat().st_size > 10_000
    told, beside = command("study", "study.toml", "-o", "study", "--workers", 1)
    assert "ANRMSE median" in told
    assert told.rstrip().endswith("Report: study/report.html")
    assert "Study 1/1: finished before" in beside
    report.unlink()
    assert command("report", "study")[0].strip() == "study/report.html"
    assert report.exists()
    shown = STUDY.partition("```toml\n")[2].partition("```")[0]
    assert page("tutorial/study.toml").partition("\n\n")[2] == shown


@pytest.mark.usefixtures("tutorial")
def test_runs_in_memory():
    play(page("howto/data.md").partition("## Runs in memory\n")[2].partition("\n## ")[0])


def test_other_programs_whose_c_prints_what_python_does(tutorial):
    for name in ("fmpy", "onnx", "onnxruntime"):
        pytest.importorskip(name)
    need_compiler()
    play(HOSTS)
    programs, shells = (
        re.findall(rf"^```{kind}\n(.*?)^```$", HOSTS, re.M | re.S) for kind in ("c", "sh")
    )
    for name, program, shell in zip(("main.c", "follow.c"), programs, shells, strict=True):
        (tutorial / name).write_text(program, "utf-8")
        done = subprocess.run(shell, shell=True, check=True, capture_output=True, text=True)
        assert done.stdout in HOSTS


def test_a_model_in_service_and_its_example_that_plays_a_run(tutorial, capsys):
    play(page("howto/live.md"))
    example = loaded(ROOT / "examples/in_service/play.py")
    example.main("model.nc", "campaign.toml", "unseen", "heave", "played.png")
    assert (tutorial / "played.png").stat().st_size > 1e4
    assert (
        "heave while its sensor is dead: error 0.04 SD, 96% in the band" in capsys.readouterr().out
    )


@pytest.mark.usefixtures("empty_figures")
def test_the_measurement_chain(tmp_path, monkeypatch):
    pytest.importorskip("numba")
    monkeypatch.chdir(tmp_path)
    play(page("measurement_chain.md"))
    sheet = (tmp_path / "virtual/prepared/quality.html").read_text("utf-8")
    assert re.search(r"<td>regular_<wbr>2</td><td[^>]*>not prepared</td>", sheet)
