"""Run a study: every (training set x test window x model) cell, resumed where it was stopped."""

from __future__ import annotations

import json
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from seakeep.campaign.prepare import Progress
from seakeep.models.executor import WorkerLostError, as_finished, make_executor
from seakeep.models.priors import Prior, describe
from seakeep.study.cells import Unit, cells_of, compute, units_of
from seakeep.study.description import describe_study
from seakeep.study.lock import alone_in
from seakeep.study.merge import merge_cells
from seakeep.study.plan import Plan, make_plan
from seakeep.study.settings import Study
from seakeep.study.slow import warn_of_slow_study
from seakeep.study.specs import Spec
from seakeep.study.statistics import judge
from seakeep.study.store import (
    RESULT,
    CellFolder,
    StudyResult,
    read_result,
    retell,
    versions,
    write_result,
)

__all__ = ["run_study"]


def run_study(
    study: Study,
    out: Path | str,
    *,
    workers: int = 1,
    scheduler: str | None = None,
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
    scheduler : str, optional
        Address of the scheduler of a running Dask cluster, ``tcp://host:8786``, whose workers
        compute the cells instead (extra ``cluster``). They need no disk in common: cells come back
        and are written here.
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
        If settings leave no feasible window, a channel is missing, the folder holds another
        study or cannot be written, another process works there, or the cluster cannot be used.
    DataError
        If a run cannot be read or used.
    StorageError
        If the disk is full; finished cells are kept.
    WorkerLostError
        If a worker process was stopped from outside; finished cells are kept.

    Warns
    -----
    SeakeepWarning
        If training windows hold fewer than five periods of a slow motion.
    """
    out = Path(out)
    tell = progress or (lambda done, total, what: None)
    cells = CellFolder(out, study.digest)
    cells.check()
    if (found := _finished(study, out, tell)) is not None:
        return retell(found, _words_of_study(study))
    with make_executor(workers, scheduler) as executor:
        return _run(study, out, cells, executor, tell, extra or {}, notes or {})


def _run(
    study: Study,
    out: Path,
    cells: CellFolder,
    executor: Executor | None,
    tell: Progress,
    extra: Mapping[str, xr.Dataset],
    notes: Mapping[str, str],
) -> StudyResult:
    plan, runs = make_plan(study, lambda done, total, name: tell(done, total, f"preparing {name}"))
    warn_of_slow_study(plan, runs)
    cells.open(study.name)
    with alone_in(out):
        if (found := _finished(study, out, tell)) is None:  # by another process, meanwhile
            units = units_of(plan, study.settings.output.eigenvalues)
            left = [u for u in units if not all(cells.has(name) for name in cells_of(plan, u))]
            _compute_all(plan, runs, cells, units, left, executor, tell)
            tell(len(units), len(units), "statistics and densities")
            groups = {**describe_study(study, plan, runs), **merge_cells(study, plan, runs, cells)}
            groups.update(judge(groups, study.settings, list(plan.states)))
            groups.update(extra)
            attributes = {**_attributes(study, plan, groups), **notes}
            found = write_result(out, attributes, groups)
        cells.clear()
    return found


def _finished(study: Study, out: Path, tell: Progress) -> StudyResult | None:
    """The result of an earlier run, if there is one of the same study."""
    if not (out / RESULT).exists():
        return None
    found = read_result(out)
    if found.attrs.get("digest") != study.digest:
        return None
    tell(1, 1, "finished before")
    return found


def _words_of_study(study: Study) -> dict[str, str]:
    """Attributes in which a study may change without becoming another one: names and labels."""
    general, campaign = study.settings.study, study.campaign.settings.campaign
    return {
        "study": study.name,
        "description": general.description or campaign.description,
        "settings": study.settings.model_dump_json(),
    }


def _attributes(
    study: Study, plan: Plan, groups: Mapping[str, xr.Dataset]
) -> dict[str, str | float | int]:
    general = study.settings.study
    return {
        **_words_of_study(study),
        "campaign": study.campaign.name,
        "preset": general.preset,
        "seed": general.seed,
        "digest": study.digest,
        "campaign_digest": study.campaign.digest,
        "encounter_period": plan.encounter_period,
        "dt": plan.dt,
        "longest_training": plan.needs.training * plan.dt,
        "preparation": study.campaign.settings.preparation.model_dump_json(),
        "specs": json.dumps({name: _fields(spec) for name, spec in plan.specs.items()}),
        "conditional_on": _conditional(plan),
        "versions": json.dumps(versions()),
        "groups": json.dumps(list(groups)),
    }


def _fields(spec: Spec) -> dict[str, str]:
    """Settings of a model as words."""
    kept = [each for each in fields(spec) if each.repr and each.name != "dt"]
    return {each.name: _words_of(getattr(spec, each.name)) for each in kept}


def _words_of(value: object) -> str:
    """A setting in words; a distribution of scipy.stats by name, for it prints as an address."""
    if not isinstance(value, Prior) or is_dataclass(value):
        return str(value)
    known = describe(value)
    assert known is not None
    stated = [*map(str, known["args"]), *(f"{key}={v}" for key, v in known["kwds"].items())]
    return f"{known['prior']}({', '.join(stated)})"


def _conditional(plan: Plan) -> str:
    """Measured output that a forecast reads after its start, through the alignment."""
    alignments = [spec.alignment for spec in plan.specs.values() if spec.alignment is not None]
    read = [each.surge_channel for each in alignments if each.surge == "measured"]
    return ", ".join(dict.fromkeys(read))


def _compute_all(
    plan: Plan,
    runs: Mapping[str, xr.Dataset],
    cells: CellFolder,
    units: list[Unit],
    left: list[Unit],
    executor: Executor | None,
    tell: Progress,
) -> None:
    done, total = len(units) - len(left), len(units)
    tell(done, total, "fitting and forecasting")
    if not left:
        return
    try:
        for number, found in as_finished(_work, (plan, dict(runs)), left, executor):
            for name, arrays in found:
                cells.write(name, arrays)
            done += 1
            tell(done, total, _words(plan, left[number]))
    except WorkerLostError as error:
        raise WorkerLostError(
            f"{error} All cells that were finished are kept: the same command goes on where it "
            "stopped."
        ) from None


def _words(plan: Plan, unit: Unit) -> str:
    if unit.kind == "eigenvalues":
        return f"{unit.model}, eigenvalues from member {unit.first + 1} on"
    return f"{unit.model}, training set {plan.training[unit.training].name}"


def _work(data: tuple[Plan, dict[str, xr.Dataset]], unit: Unit) -> list[tuple[str, dict[str, Any]]]:
    """Cells of a unit; whoever asked for them writes them, for a worker may have another disk."""
    plan, runs = data
    found: list[tuple[str, dict[str, Any]]] = []
    compute(plan, runs, unit, lambda name, arrays: found.append((name, arrays)))
    return found
