"""Every command and every Python block of the tutorial runs and prints what the page shows."""

import contextlib
import io
import re
import shlex
import shutil
import warnings
from pathlib import Path

import pytest

from seakeep.cli import main
from seakeep.errors import SeakeepWarning

FOLDER = Path(__file__).parents[2] / "docs/tutorial"
PAGE = (FOLDER / "tutorial.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(console|python|text)\n(.*?)^```$", PAGE, flags=re.M | re.S)
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def shown(text):
    """Lines with single blanks, without rules and empty lines."""
    lines = (" ".join(re.sub("[─━]", "", line).split()) for line in text.splitlines())
    return [line for line in lines if line]


def alike(expected, found):
    """The same words, and numbers equal to one unit of the last printed place.

    The unit covers other linear algebra libraries: it moves the third decimal of an NRMSE only
    where that was about to round the other way.
    """
    if NUMBER.sub("#", expected) != NUMBER.sub("#", found):
        return False
    for one, other in zip(NUMBER.findall(expected), NUMBER.findall(found), strict=True):
        decimals = len(one.partition(".")[2])
        if abs(float(one) - float(other)) > 1.01 * 10.0**-decimals * (decimals > 0):
            return False
    return True


def check(expected, printed):
    found = shown(printed)
    for line in shown(expected):
        if line != "…":
            assert any(alike(line, each) for each in found), f"{line!r} is not in {found}"


def run_console(block):
    out = io.StringIO()
    for line in block.splitlines():
        words = shlex.split(line.removeprefix("$ "))
        assert words[0] == "seakeep"
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            status = main(words[1:])
        assert (status != 0) == ("Error:" in out.getvalue()), out.getvalue()
    return out.getvalue()


def test_the_tutorial_runs_and_prints_what_it_shows(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib", reason="seakeep compare draws a figure")
    pytest.importorskip("control", reason="the page exports to python-control")
    folder = tmp_path / "tutorial"
    shutil.copytree(FOLDER, folder)
    monkeypatch.chdir(folder)
    printed, names = "", {}
    for kind, content in BLOCKS:
        if kind == "console":
            printed = run_console(content)
        elif kind == "python":
            out = io.StringIO()
            with contextlib.redirect_stdout(out), warnings.catch_warnings():
                warnings.simplefilter("ignore", SeakeepWarning)  # of the unstable model
                exec(compile(content, "tutorial.md", "exec"), names)  # the page is ours
            printed = out.getvalue()
        elif printed:
            check(content, printed)
            printed = ""
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
    assert "pitch" in printed
    assert "mooring_bow" not in printed  # loads are left to the user
