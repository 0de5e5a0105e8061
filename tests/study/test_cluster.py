"""The units of a study on a real Dask cluster, one of whose workers is killed in the middle."""

import os
import signal

import pytest
import xarray as xr

from seakeep.models.executor import make_executor
from seakeep.study import read_study, run_study

distributed = pytest.importorskip(
    "distributed", reason="a Dask cluster needs distributed (extra 'cluster')"
)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system knows no SIGKILL")
@pytest.mark.usefixtures("patient_cluster")
def test_a_worker_that_is_killed_costs_its_units_alone(study_folder, tmp_path_factory):
    from dask_processes import Cluster

    path = study_folder / "study.toml"
    path.write_text(path.read_text("utf-8").replace("windows = 2", "windows = 4", 1), "utf-8")
    study = read_study(path)
    alone = run_study(study, study_folder / "alone")
    cluster = Cluster(tmp_path_factory.mktemp("dask"), workers=2)
    lost: dict[str, int] = {}
    try:
        with distributed.Client(cluster.address, set_as_default=False) as client:

            def executed():
                return client.run(lambda dask_worker: dask_worker.state.executed_count)

            def kill_one(done, total, what):
                if lost and "statistics" in what:
                    (lost["count"],) = executed().values()
                if "training set" not in what or done < 3 or lost:
                    return
                counts = executed()
                victim = max(counts, key=counts.get)
                pid = client.run(os.getpid)[victim]
                (process,) = [each for each in cluster.processes if each.pid == pid]
                process.send_signal(signal.SIGKILL)
                process.wait()
                lost.update(done=done, total=total, other=min(counts.values()))

            with make_executor(1, cluster.address) as executor:
                found = run_study(
                    study, study_folder / "wide", executor=executor, progress=kill_one
                )
    finally:
        cluster.close()
    assert found.groups.keys() == alone.groups.keys()
    for name, group in alone.groups.items():
        xr.testing.assert_identical(group, found.groups[name])
    # The other one did what had not come back by then, and perhaps made the data once more.
    assert 3 <= lost["done"] < lost["total"]
    assert lost["count"] - lost["other"] <= lost["total"] - lost["done"] + 1
