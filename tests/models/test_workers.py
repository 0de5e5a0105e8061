"""Who does the work changes no array, and no process, thread of BLAS or file is left over."""

import gc
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import side_work
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import seakeep
from seakeep.errors import RequestError
from seakeep.models import processes, workers
from seakeep.models.members import TrainingArrays, forecast_member, member_radius
from seakeep.models.windows import read_windows, stacked
from seakeep.models.workers import Crew, WorkerLostError, as_finished, side_by_side

CREWS = [Crew(1), Crew(2, "threads"), Crew(3, "threads"), Crew(2, "processes"), Crew(2, "auto")]
posix = pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system knows no SIGKILL")


@pytest.fixture(scope="module")
def ensemble_of():
    rng = np.random.default_rng(0)
    time = 0.1 * np.arange(500)
    eta = np.cos(np.outer(time, rng.uniform(2, 6, 20)) + rng.uniform(0, 6, 20)).sum(axis=1)
    run = xr.Dataset(
        {
            "heave": ("time", np.convolve(eta, [0.1, 0.3, 0.2], "same")),
            "pitch": ("time", np.convolve(eta, [0.3, -0.1, -0.2], "same")),
            "eta": ("time", eta),
        },
        coords={"time": time},
    )

    def fit(members, seed, delay_rows):
        spec = seakeep.BayesianHankelDMDc(
            encounter_period=1.6,
            train_length=seakeep.Uniform(6, 12),
            state_delay=seakeep.Uniform(0.2, 0.8),
            input_delay=seakeep.Uniform(0.3, 1.2),
            ridge=seakeep.LogUniform(0.1, 10),
            n_members=members,
            seed=seed,
            delay_rows=delay_rows,
        )
        return spec.fit(run, ["heave", "pitch"], ["eta"], stop=30.0), run

    return fit


@settings(max_examples=12)
@given(
    members=st.integers(1, 9),
    seed=st.integers(0, 2**31),
    delay_rows=st.sampled_from(["exact", "ridge"]),
    windows=st.integers(1, 3),
    order=st.randoms(use_true_random=False),
)
def test_arrays_depend_neither_on_the_crew_nor_on_the_order(
    ensemble_of, members, seed, delay_rows, windows, order
):
    ensemble, run = ensemble_of(members, seed, delay_rows)
    starts = [31.0 + 2 * k for k in range(windows)]
    task = _task(ensemble, run, starts)
    alone = [forecast_member(task, draw) for draw in ensemble.members]
    shuffled = list(range(members))
    order.shuffle(shuffled)
    draws = [ensemble.members[k] for k in shuffled]
    for crew in CREWS:
        ordered = list(side_by_side(forecast_member, task, draws, crew))
        finished = dict(as_finished(forecast_member, task, draws, crew))
        assert len(ordered) == len(finished) == members
        for place, number in enumerate(shuffled):
            np.testing.assert_array_equal(ordered[place], alone[number])
            np.testing.assert_array_equal(finished[place], alone[number])


def _task(ensemble, run, starts):
    windows = read_windows(ensemble, run, starts, 40)
    return seakeep.models.members.Task(
        ensemble.arrays,
        ensemble.settings,
        *stacked(windows),
        40,
    )


@pytest.mark.parametrize("crew", CREWS, ids=str)
def test_blas_has_one_thread_wherever_members_work(crew):
    for process, found in side_by_side(side_work.blas_threads, None, range(4), crew):
        assert (process == os.getpid()) == (crew.workers == 1 or crew.backend != "processes")
        assert set(found) == {1}


def test_the_limit_of_blas_is_lifted_when_the_last_one_leaves():
    from threadpoolctl import threadpool_info, threadpool_limits

    def threads():
        return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}

    with threadpool_limits(2, user_api="blas"):
        before = threads()
        first = side_by_side(side_work.blas_threads, None, range(2), Crew())
        second = side_by_side(side_work.blas_threads, None, range(2), Crew())
        next(first)
        next(second)
        first.close()
        assert threads() == {1}
        second.close()
        assert threads() == before


def test_the_limit_of_blas_holds_in_any_thread_and_any_thread_may_lift_it():
    from threadpoolctl import threadpool_info, threadpool_limits

    def threads():
        return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}

    def work():
        found.extend(side_by_side(side_work.blas_threads, None, range(2), Crew()))
        next(held)
        seen.append(threads())

    with threadpool_limits(2, user_api="blas"):  # the limit is this thread's now
        before = threads()
        found, seen = [], []
        held = side_by_side(side_work.blas_threads, None, range(2), Crew())
        other = threading.Thread(target=work)
        other.start()
        other.join()
        assert [set(each) for _, each in found] == [{1}, {1}]
        assert seen == [{1}]
        held.close()  # begun there, left here
        assert threads() == before


def test_little_work_stays_in_this_process_and_much_goes_to_others(monkeypatch):
    def where():
        return [process for process, _ in side_by_side(side_work.square, 1, range(6), crew)]

    crew = Crew(2, "auto")
    assert set(where()) == {os.getpid()}  # 6 x 20 ms, and processes must save 6 s
    # Of 6 x 20 ms half of the last three are saved: 30 ms.
    monkeypatch.setattr(workers, "WORTH", 0.01)
    found = where()
    assert found[:3] == [os.getpid()] * 3
    assert os.getpid() not in found[3:]


def test_work_that_is_handed_over_gives_the_same_arrays(ensemble_of, monkeypatch):
    ensemble, run = ensemble_of(7, 2, "ridge")
    alone = ensemble.forecast_summary(run, 31.0, 40)
    monkeypatch.setattr(workers, "WORTH", 0.0)
    handed = ensemble.forecast_summary(run, 31.0, 40, workers=2, backend="auto")
    xr.testing.assert_identical(alone, handed)


def test_data_are_pickled_once_and_read_once_by_each_process(ensemble_of, monkeypatch):
    ensemble, run = ensemble_of(9, 0, "exact")
    pickled = []

    def counting(self, protocol):
        pickled.append(protocol)
        return object.__reduce_ex__(self, protocol)

    monkeypatch.setattr(TrainingArrays, "__reduce_ex__", counting)
    pickle.dumps(ensemble.arrays)
    assert len(pickled) == 1, "the count does not count"
    ensemble.forecast(run, start=31.0, steps=20, workers=2)
    assert len(pickled) == 2


def test_processes_stay_ready_for_the_next_call():
    def pids():
        return {pid for pid, _ in side_by_side(side_work.square, 1, range(8), Crew(2))}

    # Either process may have slept through a call; new ones for each call would be three or more.
    found = pids() | pids() | pids()
    assert os.getpid() not in found
    assert len(found) <= 2


def test_processes_end_when_nobody_wants_them_any_more(monkeypatch):
    monkeypatch.setattr(processes, "IDLE", 0.05)
    (pid, _), *_ = side_by_side(side_work.square, 1, range(4), Crew(2))
    assert _ends(pid)


@posix
def test_a_process_that_was_killed_while_it_waited_is_replaced():
    (pid, _), *_ = side_by_side(side_work.square, 3, range(4), Crew(2))
    os.kill(pid, signal.SIGKILL)
    assert _ends(pid)
    again = [value for _, value in side_by_side(side_work.square, 3, range(4), Crew(2))]
    assert again == [0, 3, 12, 27]


@posix
def test_a_process_that_is_killed_at_work_is_told_and_leaves_nothing_behind():
    (pid, _), *_ = side_by_side(side_work.square, 3, range(4), Crew(2))
    with pytest.raises(WorkerLostError, match=r"stopped from outside.*take fewer workers"):
        list(side_by_side(side_work.fall, 5, range(20), Crew(2)))
    assert _ends(pid)
    again = [value for _, value in side_by_side(side_work.square, 3, range(4), Crew(2))]
    assert again == [0, 3, 12, 27]


def test_an_error_of_an_item_ends_the_work():
    for crew in CREWS:
        with pytest.raises(ValueError, match="item 0"):
            list(side_by_side(side_work.refuse, None, range(6), crew))


def test_results_that_nobody_reads_end_the_work_and_its_files(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    begun = side_by_side(side_work.square, 1, range(1000), Crew(2))
    pid, _ = next(begun)
    assert len(list(tmp_path.iterdir())) == 1
    begun.close()
    gc.collect()
    assert _ends(pid)
    assert list(tmp_path.iterdir()) == []


@posix
def test_a_parent_that_is_killed_leaves_no_process_behind(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(
        "import side_work\n"
        "from seakeep.models.workers import Crew, side_by_side\n"
        "if __name__ == '__main__':\n"
        "    for pid in side_by_side(side_work.sleep, 0.2, range(10**6), Crew(2)):\n"
        "        print(pid, flush=True)\n"
    )
    places = [*sys.path, str(Path(side_work.__file__).parent)]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(places)}
    with subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, text=True, env=environment
    ) as parent:
        pids = {int(parent.stdout.readline()) for _ in range(4)}
        parent.kill()
    for pid in pids:
        assert _ends(pid)


def _ends(pid):
    """Whether a process is gone within minutes; a zombie without other threads is gone too.

    While one of its threads still ends, its parent is told that it lives.
    """
    deadline = time.monotonic() + 120
    while time.monotonic() < deadline:
        try:
            state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
            threads = len(list(Path(f"/proc/{pid}/task").iterdir()))
        except FileNotFoundError:
            if not Path("/proc").exists():
                pytest.skip("the system shows no processes")
            return True
        except ProcessLookupError:
            return True
        if state == "Z" and threads == 1:
            return True
        time.sleep(0.02)
    return False


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"workers": 0}, "workers must be a positive integer; received 0"),
        ({"workers": True}, "workers must be a positive integer; received True"),
        ({"backend": "gpu"}, "backend must be 'processes', 'threads' or 'auto'; received 'gpu'"),
        ({"workers": 2, "scheduler": "tcp://a:1"}, "hands all work to a cluster. Give one"),
    ],
)
def test_a_crew_that_does_not_exist(arguments, words):
    with pytest.raises(RequestError, match=words):
        Crew(**arguments)


def test_radii_do_not_depend_on_the_crew(ensemble_of):
    ensemble, _ = ensemble_of(5, 1, "ridge")
    data = (ensemble.arrays, ensemble.settings)
    found = [list(side_by_side(member_radius, data, ensemble.members, crew)) for crew in CREWS]
    assert all(each == found[0] for each in found)
