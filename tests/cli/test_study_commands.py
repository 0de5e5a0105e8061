"""``seakeep study``, ``report`` and ``reproduce`` as a user runs them."""

import signal
import subprocess
import sys
import time
from contextlib import nullcontext

import pytest
from started import started
from tutorial_study import edit

from seakeep import executor
from seakeep.cli.judging import _write_reproduction
from seakeep.study import StudyResult

pytest.importorskip("matplotlib")


def test_each_page_of_a_reproduction_is_named_while_its_figures_are_drawn(monkeypatch, tmp_path):
    told = []

    def bar(what):
        return nullcontext(lambda done, total, name: told.append(f"{what} {done}/{total}: {name}"))

    monkeypatch.setattr("seakeep.cli.judging.progress_bar", bar)
    monkeypatch.setattr(
        "seakeep.report.sections.write_report", lambda result, tell, near: tell(0, 9, near)
    )
    monkeypatch.setattr("seakeep.report.acts.write_reproduction", lambda *each: each[0])
    acts = {name: StudyResult(tmp_path, {"study": f"act {name}"}, {}) for name in ("a", "b")}
    _write_reproduction(tmp_path, acts, "pool")
    assert told == ["Report of act a 0/9: pool", "Report of act b 0/9: pool"]


@pytest.mark.parametrize("verb", ["study", "reproduce"])
def test_a_scheduler_that_does_not_answer_is_told_before_any_work(
    verb, study_folder, monkeypatch, command
):
    pytest.importorskip("distributed")
    monkeypatch.setattr(executor, "PATIENCE", 0.3)
    out = study_folder / "out"
    words = [study_folder / "study.toml"] if verb == "study" else []
    _, told = command(verb, *words, "-o", out, "--scheduler", "tcp://127.0.0.1:9", status=2)
    assert "no Dask scheduler answers at 'tcp://127.0.0.1:9'" in told
    assert "preparing" not in told
    assert "playing" not in told


@pytest.mark.skipif(sys.platform == "win32", reason="Windows sends Ctrl-C to a console alone")
def test_ctrl_c_keeps_what_is_finished_and_ends_with_130(study_folder, ctrl_c):
    # Minutes of work after its first unit: it is never over before the signal reaches it.
    edit(study_folder / "study.toml", ("n_members = 4", "n_members = 20_000"))
    out = study_folder / "out"
    command = [sys.executable, "-m", "seakeep", "study", "study.toml", "-o", str(out)]
    with started([*command, "--workers", "1"], study_folder, stderr=subprocess.PIPE) as process:
        while not list((out / "units").glob("*.nc")):
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.002)
        process.send_signal(signal.SIGINT)
        told = process.communicate()[1]
    assert process.returncode == 130, told
    assert told.count("kept") == 1
    assert "Interrupted. Finished files are kept" in told
    assert "Traceback" not in told
    assert list((out / "units").glob("*.nc"))


@pytest.mark.parametrize(
    ("name", "words"),
    {
        "raw/study.toml": "exists and is not a reproduction's study file",
        "report.html": "exists and is not a report that seakeep wrote",
        "tables/mine.csv": "tables holds files that no report of seakeep wrote",
        "campaign/played.txt": "exists and is not a note of a campaign played",
    }.items(),
)
def test_reproduce_replaces_no_file_of_the_user(name, words, tmp_path, command):
    pytest.importorskip("seakeep.tank.play")
    own = tmp_path / name
    own.parent.mkdir(exist_ok=True)
    own.write_text("mine")
    assert words in command("reproduce", "--quick", "-o", tmp_path, status=2)[1]
    assert own.read_text() == "mine"
    assert not (tmp_path / "campaign" / "raw").exists()
