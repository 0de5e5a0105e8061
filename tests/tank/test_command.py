"""The command, hooked onto an application of its own."""

import pytest
import typer
from typer.testing import CliRunner

from seakeep.cli.campaigns import tank

pytest.importorskip("numba", reason="needs the extra tank")


@pytest.fixture
def run(tmp_path):
    app = typer.Typer()
    app.command()(tank)
    short = tmp_path / "short.toml"
    short.write_text(
        "[runs.sea]\nstartup = 5.0\nduration = 30.0\n"
        "spectrum = { height = 0.15, peak_period = 2.0 }\n"
        "[runs.regular]\nstartup = 5.0\nduration = 20.0\nwavelength = 2.8\nheight = 0.1\n",
        encoding="utf-8",
    )

    def invoke(*arguments):
        return CliRunner().invoke(
            app, ["--settings", str(short), *map(str, arguments)], catch_exceptions=False
        )

    return invoke


def test_one_logger_and_the_truth(run, tmp_path):
    out = tmp_path / "out"
    done = run("--out", out, "--seed", "3", "--one-logger", "--run", "sea")
    assert done.exit_code == 0
    assert (out / "raw" / "sea" / "all.csv").is_file()
    assert (out / "truth" / "sea.nc").is_file()
    assert not (out / "figures").exists()
