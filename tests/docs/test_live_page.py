"""The page on a model in service prints what it shows, and its example plays a run."""

import pytest
from loaded import loaded
from pages import page, play
from places import ROOT


def test_the_page_runs_and_its_example_plays_a_run(tutorial, capsys):
    pytest.importorskip("matplotlib")
    play(page("howto/live.md"))
    example = loaded(ROOT / "examples/in_service/play.py")
    example.main("model.nc", "campaign.toml", "unseen", "heave", "played.png")
    assert (tutorial / "played.png").stat().st_size > 1e4
    assert (
        "heave while its sensor is dead: error 0.04 SD, 93% in the band" in capsys.readouterr().out
    )
