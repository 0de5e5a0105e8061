"""Run a study: every (training set x test window x model) cell, resumed where it was stopped."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import fields
from multiprocessing.connection import wait as wait_for
from pathlib import Path

import xarray as xr

from seakeep.campaign.prepare import Progress
from seakeep.errors import RequestError, SeakeepError
from seakeep.study.cells import Unit, cells_of, compute, units_of
from seakeep.study.description import describe_study
from seakeep.study.merge import merge_cells
from seakeep.study.plan import Plan, make_plan
from seakeep.study.settings import Study
from seakeep.study.specs import Spec
from seakeep.study.statistics import judge
from seakeep.study.store import RESULT, CellFolder, StudyResult, read_result, versions, write_result

__all__ = ["run_study"]


def run_study(
    study: Study,
    out: Path | str,
    *,
    workers: int = 1,
    progress: Progress | None = None,
    extra: Mapping[str, xr.Dataset] | None = None,
    notes: Mapping[str, str] | None = None,
) -> StudyResult:
    """Run a study, or go on with one that was stopped.

    Parameters
    ----------
    study : Study
        From :func:`seakeep.study.read_study`.
    out : Path or str
        Folder of the results. Finished cells are kept there, one file each, and taken over when
        the study is run again; at the end all is in ``study.nc``.
    workers : int, optional
        Processes side by side, each on one BLAS thread. The arrays do not depend on it.
    progress : callable, optional
        Called as ``progress(done, total, what)``.
    extra : mapping of str to Dataset, optional
        Groups to be kept beside the results.
    notes : mapping of str to str, optional
        Attributes to be kept beside them, such as ``preparation_note`` for the report.

    Returns
    -------
    StudyResult
        All that was found.

    Raises
    ------
    RequestError
        If settings leave no feasible window, a channel is missing, or the folder holds another
        study.
    DataError
        If a run cannot be read or used.
    StorageError
        If the disk is full; finished cells are kept.
    """
    if workers < 1:
        raise RequestError(f"workers must be 1 or more; received {workers}.")
    out = Path(out)
    tell = progress or (lambda done, total, what: None)
    cells = CellFolder(out, study.digest)
    cells.open(study.name)
    if (out / RESULT).exists():
        found = read_result(out)
        if found.attrs.get("digest") == study.digest:
            tell(1, 1, "finished before")
            return found
    plan, runs = make_plan(study, lambda done, total, name: tell(0, 1, f"preparing {name}"))
    units = units_of(plan, study.settings.output.eigenvalues)
    left = [unit for unit in units if not all(cells.has(name) for name in cells_of(plan, unit))]
    _compute_all(plan, runs, cells, units, left, workers, tell)
    tell(len(units), len(units), "statistics and densities")
    groups = {**describe_study(study, plan, runs), **merge_cells(study, plan, runs, cells)}
    groups.update(judge(groups, study.settings, list(plan.states)))
    groups.update(extra or {})
    result = write_result(out, {**_attributes(study, plan, groups), **(notes or {})}, groups)
    cells.clear()
    return result


def _attributes(
    study: Study, plan: Plan, groups: Mapping[str, xr.Dataset]
) -> dict[str, str | float | int]:
    general = study.settings.study
    return {
        "study": study.name,
        "description": general.description or study.campaign.settings.campaign.description,
        "campaign": study.campaign.name,
        "preset": general.preset,
        "seed": general.seed,
        "digest": study.digest,
        "campaign_digest": study.campaign.digest,
        "encounter_period": plan.encounter_period,
        "dt": plan.dt,
        "longest_training": plan.needs.training * plan.dt,
        "preparation": study.campaign.settings.preparation.model_dump_json(),
        "settings": study.settings.model_dump_json(),
        "specs": json.dumps({name: _fields(spec) for name, spec in plan.specs.items()}),
        "conditional_on": _conditional(plan),
        "versions": json.dumps(versions()),
        "groups": json.dumps(list(groups)),
    }


def _fields(spec: Spec) -> dict[str, str]:
    """Settings of a model as words."""
    kept = [each for each in fields(spec) if each.repr and each.name != "dt"]
    return {each.name: str(getattr(spec, each.name)) for each in kept}


def _conditional(plan: Plan) -> str:
    """Measured output that a forecast reads after its start, through the alignment."""
    alignments = [getattr(spec, "alignment", None) for spec in plan.specs.values()]
    return "surge" if any(getattr(a, "surge", "") == "measured" for a in alignments) else ""


def _compute_all(
    plan: Plan,
    runs: Mapping[str, xr.Dataset],
    cells: CellFolder,
    units: list[Unit],
    left: list[Unit],
    workers: int,
    tell: Progress,
) -> None:
    done, total = len(units) - len(left), len(units)
    tell(done, total, "fitting and forecasting")
    if not left:
        return
    with _pool(min(workers, len(left)), plan, runs, cells) as pool:
        pending: dict[Future[None], Unit] = {}
        waiting = iter(left)
        try:
            for unit in _first(waiting, 2 * workers):
                pending[pool.submit(_work, unit)] = unit
            while pending:
                finished, _ = wait(pending, return_when=FIRST_COMPLETED)
                for future in finished:
                    unit = pending.pop(future)
                    future.result()
                    done += 1
                    tell(done, total, _words(plan, unit))
                    for following in _first(waiting, 1):
                        pending[pool.submit(_work, following)] = following
        except BrokenProcessPool:
            raise SeakeepError(
                "a worker process was stopped from outside (was there not enough memory?). All "
                "cells that were finished are kept: run the same command again, with fewer "
                "--workers if memory is short."
            ) from None


def _first(units: Iterator[Unit], count: int) -> list[Unit]:
    return [unit for _, unit in zip(range(count), units, strict=False)]


def _words(plan: Plan, unit: Unit) -> str:
    if unit.kind == "eigenvalues":
        return f"{unit.model}, eigenvalues"
    return f"{unit.model}, training set {plan.training[unit.training].name}"


@contextmanager
def _pool(
    workers: int, plan: Plan, runs: Mapping[str, xr.Dataset], cells: CellFolder
) -> Iterator[ProcessPoolExecutor]:
    """Processes that hold the runs; on any error none is left behind."""
    names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))  # read by the children when they start
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(
        workers, context, initializer=_receive, initargs=(plan, dict(runs), cells)
    )
    try:
        yield pool
    except BaseException:
        children = list((pool._processes or {}).values())
        pool.shutdown(wait=False, cancel_futures=True)
        for child in children:
            child.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


class _Received:
    """What a worker process was sent when it started."""

    data: tuple[Plan, Mapping[str, xr.Dataset], CellFolder] | None = None


def _receive(plan: Plan, runs: dict[str, xr.Dataset], cells: CellFolder) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to answer
    parent = multiprocessing.parent_process()
    if parent is not None:  # a parent that was killed leaves no worker behind
        sentinel = parent.sentinel
        threading.Thread(target=lambda: (wait_for([sentinel]), os._exit(1)), daemon=True).start()
    _Received.data = (plan, runs, cells)


def _work(unit: Unit) -> None:
    assert _Received.data is not None
    plan, runs, cells = _Received.data
    compute(plan, runs, unit, cells.write)
