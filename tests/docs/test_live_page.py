"""The page on a model in service prints what it shows, and its example plays a run."""

import runpy
import shutil
from pathlib import Path

import pytest
from pages import play

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/howto/live.md").read_text(encoding="utf-8")


def test_the_page_runs_and_its_example_plays_a_run(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    shutil.copytree(ROOT / "docs/tutorial", tmp_path / "tutorial")
    monkeypatch.chdir(tmp_path / "tutorial")
    play(PAGE, "live.md")
    example = runpy.run_path(str(ROOT / "examples/in_service/play.py"))
    example["main"]("model.nc", "campaign.toml", "unseen", "heave", "played.png")
    assert Path("played.png").stat().st_size > 1e4
    assert (
        "heave while its sensor is dead: error 0.04 SD, 93% in the band" in capsys.readouterr().out
    )
