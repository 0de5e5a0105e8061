"""The command `seakeep tank`."""

import pytest

pytest.importorskip("numba")


def test_one_logger_and_the_truth(tmp_path, command):
    short, out = tmp_path / "short.toml", tmp_path / "out"
    short.write_text(
        "[runs.sea]\nstartup = 5.0\nduration = 30.0\n"
        "spectrum = { height = 0.15, peak_period = 2.0 }\n"
        "[runs.regular]\nstartup = 5.0\nduration = 20.0\nwavelength = 2.8\nheight = 0.1\n",
        "utf-8",
    )
    command("tank", "--settings", short, "--out", out, "--seed", 3, "--one-logger", "--run", "sea")
    assert (out / "raw" / "sea" / "all.csv").is_file()
    assert (out / "truth" / "sea.nc").is_file()
