"""Members on a real Dask cluster: a scheduler and two workers, each a process on loopback."""

import pickle
import re
import sys

import numpy as np
import pytest
import side_work
import xarray as xr

import seakeep
from seakeep.errors import RequestError
from seakeep.models import cluster
from seakeep.models.members import TrainingArrays
from seakeep.models.workers import Crew, WorkerLostError, as_finished, side_by_side

distributed = pytest.importorskip(
    "distributed", reason="a Dask cluster needs distributed (extra 'cluster')"
)
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning"),
    pytest.mark.usefixtures("patient_cluster"),
]


@pytest.fixture(scope="module")
def dask_cluster(tmp_path_factory):
    from dask_processes import Cluster

    started = Cluster(tmp_path_factory.mktemp("dask"), workers=2)
    yield started
    started.close()


@pytest.fixture
def fresh_cluster(tmp_path):
    """One that has done nothing yet: what its workers count is the test's own."""
    from dask_processes import Cluster

    started = Cluster(tmp_path, workers=2)
    yield started
    started.close()


@pytest.fixture(scope="module")
def problem():
    rng = np.random.default_rng(0)
    time = 0.1 * np.arange(2000)
    eta = np.cos(np.outer(time, rng.uniform(2, 6, 20)) + rng.uniform(0, 6, 20)).sum(axis=1)
    run = xr.Dataset(
        {"heave": ("time", np.convolve(eta, [0.1, 0.3, 0.2], "same")), "eta": ("time", eta)},
        coords={"time": time},
    )
    spec = seakeep.BayesianHankelDMDc(
        encounter_period=1.6,
        train_length=seakeep.Uniform(20, 100),
        state_delay=seakeep.Uniform(0.2, 0.8),
        input_delay=seakeep.Uniform(0.3, 1.2),
        ridge=seakeep.LogUniform(0.1, 10),
        n_members=40,
    )
    return spec.fit(run, ["heave"], ["eta"], stop=180.0), run


def test_members_are_those_of_one_worker_and_data_travel_once(fresh_cluster, problem, monkeypatch):
    ensemble, run = problem
    pickled = []

    def counting(self, protocol):
        pickled.append(protocol)
        return object.__reduce_ex__(self, protocol)

    alone = ensemble.forecast(run, start=181.0, steps=30)
    monkeypatch.setattr(TrainingArrays, "__reduce_ex__", counting)
    size = len(pickle.dumps(ensemble.arrays, protocol=5))
    assert len(pickled) == 1, "the count does not count"
    found = ensemble.forecast(run, start=181.0, steps=30, scheduler=fresh_cluster.address)
    xr.testing.assert_identical(alone, found)
    assert len(pickled) == 2
    with distributed.Client(fresh_cluster.address, set_as_default=False) as client:
        sent = client.run(
            lambda dask_worker: [
                (key, nbytes)
                for transfer in dask_worker.transfer_outgoing_log
                for key, nbytes in transfer["keys"].items()
            ]
        )
        states = client.run(lambda dask_worker: dask_worker.state.executed_count)
    # One worker makes the data out of the task that carries them, the other fetches them from it.
    (copied,) = [nbytes for log in sent.values() for key, nbytes in log if key.endswith("-data")]
    assert copied >= size
    # Forty members in seven tasks of five and four of 2, 1, 1 and 1, and the data: both workers
    # worked, and no task came twice.
    assert sum(states.values()) == 7 + 4 + 1
    summary = ensemble.forecast_summary(run, start=181.0, steps=30, scheduler=fresh_cluster.address)
    xr.testing.assert_identical(summary, ensemble.forecast_summary(run, start=181.0, steps=30))


def test_blas_has_one_thread_on_the_workers(dask_cluster):
    crew = Crew(scheduler=dask_cluster.address)
    for _, found in side_by_side(side_work.blas_threads, None, range(8), crew):
        assert set(found) == {1}


def test_large_pieces_come_as_they_are_finished(dask_cluster):
    crew = Crew(scheduler=dask_cluster.address)
    found = dict(as_finished(side_work.square, 3, range(20), crew))
    assert {number: value for number, (_, value) in found.items()} == {
        number: 3 * number**2 for number in range(20)
    }
    assert len({pid for pid, _ in found.values()}) == 2


def test_an_error_of_an_item_comes_back(dask_cluster):
    with pytest.raises(ValueError, match="item 0"):
        list(side_by_side(side_work.refuse, None, range(3), Crew(scheduler=dask_cluster.address)))


def test_other_versions_are_refused(dask_cluster, monkeypatch):
    here = cluster.versions()
    monkeypatch.setattr(cluster, "versions", lambda: here | {"numpy": "1.0"})
    words = (
        r"would not compute the same arrays: the scheduler tcp.* has numpy "
        rf"{re.escape(here['numpy'])} \(here 1.0\); tcp.*Install the same versions everywhere"
    )
    with pytest.raises(RequestError, match=words):
        list(side_by_side(side_work.square, 1, [1], Crew(scheduler=dask_cluster.address)))


def test_a_worker_that_joins_later_with_other_versions_refuses_the_data():
    parcel = cluster.Parcel(pickle.dumps(1), cluster.versions() | {"seakeep": "0.0.1"})
    with pytest.raises(RequestError, match=r"has seakeep .* \(here 0.0.1\)"):
        pickle.loads(pickle.dumps(parcel)).desk()


def test_a_package_that_is_missing_on_the_workers_is_told():
    told = cluster._differences({"tcp://a:1": {"numpy": "2.0"}}, {"seakeep": "1", "numpy": "2.0"})
    assert "tcp://a:1 has seakeep not installed (here 1). Install" in told


def test_an_address_where_nobody_answers(monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 0.5)
    with pytest.raises(RequestError, match=r"no Dask scheduler answers at .*`dask scheduler`"):
        list(side_by_side(side_work.square, 1, [1], Crew(scheduler="tcp://127.0.0.1:9")))


@pytest.mark.parametrize("address", ["nonsense", "http://127.0.0.1:8786", "tcp://host", "tcp://"])
def test_what_is_no_address_is_told_at_once(address):
    with pytest.raises(RequestError, match=rf"'{address}' is no address of a Dask scheduler"):
        list(side_by_side(side_work.square, 1, [1], Crew(scheduler=address)))


def test_a_scheduler_without_workers(monkeypatch, tmp_path):
    from dask_processes import Cluster

    waits = distributed.Client.wait_for_workers

    def briefly(self, count, timeout):  # the time to connect stays long
        waits(self, count, timeout=0.5)

    monkeypatch.setattr(distributed.Client, "wait_for_workers", briefly)
    alone = Cluster(tmp_path, workers=0)
    try:
        with pytest.raises(RequestError, match=r"has no workers. Start some with `dask worker tcp"):
            list(side_by_side(side_work.square, 1, [1], Crew(scheduler=alone.address)))
    finally:
        alone.close()


def test_the_extra_that_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        RequestError, match=r"needs distributed, which is not installed.*\[cluster\]"
    ):
        list(side_by_side(side_work.square, 1, [1], Crew(scheduler="tcp://127.0.0.1:1")))


def test_a_scheduler_that_is_lost_is_told(tmp_path):
    from dask_processes import Cluster

    lost = Cluster(tmp_path, workers=1)
    try:
        work = side_by_side(side_work.square, 1, range(400), Crew(scheduler=lost.address))
        next(work)
        lost.close()
        with pytest.raises(WorkerLostError, match=r"connection to the scheduler tcp.* was lost"):
            list(work)
    finally:
        lost.close()
