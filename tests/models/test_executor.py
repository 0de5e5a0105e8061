"""Who does the work changes no array, and no process or file is left over."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import side_work
import xarray as xr
from ensembles import INPUTS, STATES, few, wave_run
from started import started

import seakeep
from seakeep import executor as executors
from seakeep.executor import WorkerLostError, as_finished, in_order
from seakeep.models import processes

PLACES = [*sys.path, str(Path(side_work.__file__).parent)]
ENVIRONMENT = os.environ | {"PYTHONPATH": os.pathsep.join(PLACES)}
posix = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system knows no SIGKILL")


@pytest.fixture(scope="module")
def pool():
    with processes(2) as executor:
        yield executor


def test_results_come_in_order_and_progress_is_reported(pool):
    seen = []
    for executor in (None, pool, ThreadPoolExecutor(3)):
        found = in_order(side_work.square, 3, range(40), executor, lambda *each: seen.append(each))
        assert [value for _, value in found] == [3 * k**2 for k in range(40)]
        assert seen[-1] == (40, 40, "member 40")
        assert list(in_order(side_work.square, 3, [], executor)) == []


def test_large_pieces_come_as_they_are_finished(pool):
    found = dict(as_finished(side_work.square, 3, range(20), pool))
    assert {number: value for number, (_, value) in found.items()} == {
        number: 3 * number**2 for number in range(20)
    }
    assert len({pid for pid, _ in found.values()}) == 2


def test_nothing_is_begun_after_an_error():
    begun = []

    def piece(_, number):
        begun.append(number)
        if number == 5:
            raise ValueError("piece 5")

    def taken(threads):
        for _ in as_finished(piece, None, range(200), threads):
            time.sleep(0.001)  # whoever takes the results is slower than the work

    with ThreadPoolExecutor(4) as threads, pytest.raises(ValueError, match="piece 5"):
        taken(threads)
    assert len(begun) <= 5 + 2 * executors.AHEAD  # those that were handed out before it was seen


def test_blas_has_one_thread_wherever_work_is_done(pool):
    for executor in (None, pool):
        for process, found in in_order(side_work.blas_threads, None, range(4), executor):
            assert (process == os.getpid()) == (executor is None)
            assert set(found) == {1}


@posix
def test_a_process_that_is_killed_at_work_is_reported():
    with (
        pytest.raises(WorkerLostError, match=r"stopped from outside.*take fewer workers"),
        processes(1) as executor,
    ):
        list(in_order(side_work.fall, 5, range(20), executor))


def alone(script, *lines):
    """Start a script of its own, which imports what a caller of the executors imports."""
    header = "import side_work\nfrom seakeep.executor import as_finished, processes\n"
    script.write_text(header + "if __name__ == '__main__':\n    " + "\n    ".join(lines))
    streams = dict.fromkeys(("stdout", "stderr"), subprocess.PIPE)
    return subprocess.Popen([sys.executable, str(script)], **streams, text=True, env=ENVIRONMENT)


@posix
def test_an_interrupt_ends_its_processes_and_waits_for_no_result_on_its_way(tmp_path):
    lines = (  # its worker is nearly always in the middle of a result of 64 MB
        "try:",
        "    with processes(1) as pool:",
        "        pids = [pool.submit(side_work.sleep, 0.0, None).result()]",
        "        work = as_finished(side_work.zeros, 8_000_000, range(99), pool)",
        "        next(work)",
        "        raise KeyboardInterrupt",
        "except KeyboardInterrupt:",
        "    print(*pids)",
    )
    with alone(tmp_path / "interrupted.py", *lines) as child:
        printed, said = child.communicate(timeout=300)
    assert (said, child.returncode) == ("", 0)
    assert _ends(int(printed))


@posix
def test_a_parent_that_is_killed_leaves_no_process_behind(tmp_path):
    lines = (
        "with processes(1) as pool:",
        "    for _ in range(9):",
        "        print(pool.submit(side_work.sleep, 0.2, None).result(), flush=True)",
        "    side_work.sleep(600, None)",
    )
    with alone(tmp_path / "parent.py", *lines) as parent:
        pid = int(parent.stdout.readline())
        parent.kill()
    assert _ends(pid)


def _ends(pid):
    """Whether a process is gone within minutes; a zombie without other threads is gone too."""
    psutil = pytest.importorskip("psutil")
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        try:
            process = psutil.Process(pid)
            if process.status() == psutil.STATUS_ZOMBIE and process.num_threads() == 1:
                return True
        except psutil.NoSuchProcess:
            return True
        time.sleep(0.02)
    return False


def lose(processes, executor):
    """Kill processes at work, which is neither waited for then nor begun again."""
    work = in_order(side_work.square, 1, range(4000), executor)
    next(work)
    for process in processes:
        process.kill()
        process.wait()
    begin = time.monotonic()
    for left in (work, in_order(side_work.square, 1, range(4), executor)):
        with pytest.raises(WorkerLostError, match=r"no workers that answer|was lost"):
            list(left)
    assert time.monotonic() - begin < 240


@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning")
def test_a_dask_cluster_gives_the_same_members_and_is_not_waited_for_once_lost(
    tmp_path, monkeypatch
):
    distributed, run = pytest.importorskip("distributed"), wave_run(samples=500)
    spec = few(window=seakeep.Uniform("6 T", "12 T"), n_members=9, delay_rows="ridge")
    ensemble = spec.fit(run, STATES, INPUTS, stop=30.0)
    monkeypatch.setattr(executors, "PATIENCE", 300.0)  # a busy machine answers in minutes
    options = ["--scheduler-file", "here.json", "--host", "127.0.0.1", "--no-dashboard"]
    with contextlib.ExitStack() as stack:

        def start(*words):
            """Start a process as a user does, on loopback."""
            command = [sys.executable, "-m", "dask", *words, *options]
            return stack.enter_context(started(command, tmp_path, env=ENVIRONMENT))

        def client(workers, timeout=15):
            here = {"scheduler_file": str(tmp_path / "here.json"), "set_as_default": False}
            found = distributed.Client(**here, timeout=timeout)
            found.wait_for_workers(workers, timeout=300)
            return found

        scheduler, worker = start("scheduler", "--port", "0"), ["worker", "--no-nanny"]
        workers = [start(*worker, "--nthreads", "1") for _ in range(2)]
        with client(2) as ready:
            address = ready.scheduler_info()["address"]
        with executors.cluster(address) as executor:
            found = ensemble.forecast_summary(run, start=31.0, steps=30, executor=executor)
            for _, threads in in_order(side_work.blas_threads, None, range(8), executor):
                assert set(threads) == {1}
            with pytest.raises(ValueError, match="item 0"):
                list(in_order(side_work.refuse, None, range(3), executor))
        xr.testing.assert_identical(found, ensemble.forecast_summary(run, start=31.0, steps=30))
        monkeypatch.setattr(executors, "PATIENCE", 1.0)
        with client(2) as left:
            lose(workers, left.get_executor(pure=False))
        start(*worker)
        with client(1, timeout=5) as left:  # as long as it looks for a scheduler that is gone
            lose([scheduler], left.get_executor(pure=False))
