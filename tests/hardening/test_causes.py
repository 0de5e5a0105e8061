"""What the attack found, cause by cause, where no case of it shows the cause."""

import hashlib
import os
import subprocess
import sys

import ground
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


@pytest.mark.hardening
def test_the_same_seed_gives_the_same_bytes_everywhere(tmp_path):
    first = {"LC_ALL": "C.UTF-8", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "1", "TZ": "UTC"}
    other = {"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "TZ": "Asia/Tokyo",
             "OMP_NUM_THREADS": "2", "PYTHONHASHSEED": "2",
             "PYTHONIOENCODING": "utf-16"}  # fmt: skip
    found = []
    # Twice with the same empty caches: the first run after an installation, and the second.
    for name, place in (("cold", first), ("warm", first), ("other", other)):
        folder = tmp_path / name
        folder.mkdir()
        made = ground.write(folder)
        caches = {"NUMBA_CACHE_DIR": str(tmp_path / "numba"),
                  "PYTHONPYCACHEPREFIX": str(tmp_path / "bytecode")}  # fmt: skip
        for arguments in (
            ("tank", "--settings", "tank.toml", "--out", "o"),
            ("prepare", "campaign.toml"),
            ("fit", "campaign.toml", "--model", "ensemble", "-o", "model.nc"),
            ("compare", "model.nc", "campaign.toml", "-o", "compared"),
        ):
            done = subprocess.run(
                [sys.executable, "-m", "seakeep", *arguments], cwd=made, check=False,
                env={**os.environ, **caches, **place}, capture_output=True,
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
            assert b"Traceback" not in done.stderr
        files = (each for each in made.rglob("*") if each.is_file())
        found.append({
            str(each.relative_to(made)): hashlib.sha256(each.read_bytes()).hexdigest()
            for each in files
        })  # fmt: skip
    cold, warm, elsewhere = found
    assert len(cold) > 12
    assert {name for name in cold if warm[name] != cold[name]} == set()
    assert {name for name in cold if elsewhere[name] != cold[name]} == set()
