"""What the system refuses, threads and encodings of a command."""

import os
import subprocess
import sys


def test_what_the_system_refuses_is_no_fault_of_seakeep(monkeypatch, command):
    def fail(*_, **__):
        raise OSError(5, "Input/output error", "run.nc")

    monkeypatch.setattr("seakeep.campaign.read_campaign", fail)
    _, told = command("prepare", "campaign.toml", status=1)
    assert "Error: run.nc: Input/output error. Correct the path" in told


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
