"""What goes wrong with a study at the command line: message, exit status, and what is kept."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest
from tutorial_study import edit, studied

from seakeep import RequestError
from seakeep.study.run import compute, units_of
from seakeep.study.store import UnitFolder

pytest.importorskip("matplotlib")


@pytest.fixture
def study(study_folder, command):
    """Run it to a status; what it said."""

    def run(status):
        words = [study_folder / "study.toml", "-o", study_folder / "out", "--workers", 1]
        return " ".join(command("study", *words, status=status)[1].split())

    return run


def units_in(folder):
    """Finished units, and when they were written."""
    return {path.name: path.stat().st_mtime_ns for path in (folder / "out" / "units").iterdir()}


def without_line(folder):
    """The run that tests was recorded without the mooring line."""
    path = folder / "run3.csv"
    rows = [line.rsplit(";", 1)[0] for line in path.read_text("utf-8").splitlines()]
    path.write_text("\n".join(rows) + "\n", "utf-8")


def of_another(folder):
    units = UnitFolder(folder / "out", "0" * 64)
    units.check()
    units.write("unit", {})


def with_damaged_truth(folder):
    edit(folder / "study.toml", ("seed = 3", 'seed = 3\ntruth = "truth"'))
    (folder / "truth").mkdir()
    (folder / "truth" / "unseen.nc").write_bytes(b"\x89HDF\r\n\x1a\n")


def a_file(folder):
    (folder / "out").write_text("a file", "utf-8")


@pytest.mark.parametrize(
    ("spoil", "status", "words"),
    [
        (
            ('["10 T", "20 T"]', '["1000 T", "2000 T"]'),
            2,
            ["training: no window is feasible in", "Shorten window or the delays"],
        ),
        (
            ("length = 6", "length = 6\nstartup = 1e6"),
            2,
            ["tests.unseen: no window is feasible", "holds 0 samples", "Reduce length or startup"],
        ),
        (
            ('["unseen"]', '["first"]'),
            2,
            ["tests.unseen: the run 'first' trains", "no test span", "or name other runs"],
        ),
        (
            without_line,
            2,
            ["run3.csv has no column 'FWD_LINE'", "Its columns: t, WP_01", "Name one of these"],
        ),
        (
            with_damaged_truth,
            1,
            ["unseen.nc cannot be read as true channels (", "Play the tank again."],
        ),
        (of_another, 2, ["holds the results of another study", "000000000000", "-o"]),
        (a_file, 1, ["results could not be written to", "or choose a folder"]),
    ],
)
def test_each_mistake_has_its_message_and_its_exit_status(
    study_folder, spoil, status, words, study
):
    spoil(study_folder) if callable(spoil) else edit(study_folder / "study.toml", spoil)
    told = study(status)
    for each in words:
        assert each in told


def test_a_unit_that_fails_says_what_is_kept_and_how_to_go_on(study_folder, monkeypatch, study):
    def fails(plan, facts, unit, *more, original=compute):
        if unit == units_of(plan)[1]:
            raise RequestError("the second fails.")
        return original(plan, facts, unit, *more)

    with monkeypatch.context() as patch:
        patch.setattr("seakeep.study.run.compute", fails)
        told = study(1)
    assert "training set 't00', model" in told
    assert "the second fails. What was finished is kept (1 of 4 units): the same command" in told
    assert len(units_in(study_folder)) == 1
    assert np.isfinite(studied(study_folder).tests["unseen"]["error"]).any()


def filling(room, opened=Path.open):
    """Opening a file on a disk on which so many binary files still have room."""
    left = iter(range(room))

    def opens(path, mode="r", *arguments, **keywords):
        if mode == "wb" and next(left, None) is None:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return opened(path, mode, *arguments, **keywords)

    return opens


def test_a_disk_that_fills_up_loses_no_finished_unit(study_folder, monkeypatch, study):
    folder = study_folder
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", filling(3))
        told = study(1)
    assert "No space left on device. What was finished is kept." in told
    assert "the same command then continues where it stopped" in told
    before = units_in(folder)
    assert len(before) == 3
    # Then there is room for the units of two training windows and two models, and no result.
    with monkeypatch.context() as patch:
        patch.setattr(Path, "open", filling(1))
        study(1)
    assert not (folder / "out" / "study.nc").exists()
    assert before.items() <= units_in(folder).items()
    studied(folder)
    assert (folder / "out" / "study.nc").exists()
