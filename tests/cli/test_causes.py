"""What the system refuses, what a killed run left, threads and encodings of a command."""

import os
import subprocess
import sys

import pytest

from seakeep.cli import main
from seakeep.errors import SeakeepWarning
from seakeep.study.store import UnitFolder


def test_what_the_system_refuses_is_no_fault_of_seakeep(monkeypatch, capsys):
    def fail(*_, **__):
        raise OSError(5, "Input/output error", "run.nc")

    monkeypatch.setattr("seakeep.campaign.read_campaign", fail)
    assert main(["prepare", "campaign.toml"]) == 1
    assert "Error: run.nc: Input/output error. Correct the path" in capsys.readouterr().err


def test_a_study_clears_what_a_killed_run_left_and_says_so(tmp_path):
    (tmp_path / "units").mkdir()
    (tmp_path / "units" / ".cell.nc.12.ab.tmp").touch()
    (tmp_path / "notes.tmp").touch()
    with (
        pytest.warns(SeakeepWarning, match=r"removed 1 unfinished file\(s\) of a killed run"),
        UnitFolder(tmp_path, "digest").alone(),
    ):
        assert not list(tmp_path.glob("units/*"))
    assert (tmp_path / "notes.tmp").exists()


def test_a_command_keeps_blas_to_one_thread_and_prints_in_any_encoding(tmp_path):
    code = (
        "import seakeep.cli, sys, os\n"
        "assert 'numpy' not in sys.modules\n"
        "assert seakeep.cli.main(['info']) == 0\n"
        "import threadpoolctl, scipy.linalg\n"
        "assert {each['num_threads'] for each in threadpoolctl.threadpool_info()} == {1}\n"
        "sys.exit(seakeep.cli.main(['compare', 'm.nc', 'c.toml', '--format', '\\u03c0']))\n"
    )
    posix = {"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    environment = {**os.environ, **posix, "OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, env=environment, check=False,
        cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 2
    assert b"is not one of" in done.stderr
    assert b"Traceback" not in done.stderr
