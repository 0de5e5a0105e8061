"""Run a study, unit by unit, resumed where it was stopped."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from pathlib import Path

import xarray as xr

from seakeep.arrays import Progress
from seakeep.errors import warn
from seakeep.models.executor import WorkerLostError, as_finished
from seakeep.study.describe import describe_study, words_of_repeats
from seakeep.study.judge import judge, words_of_lost
from seakeep.study.plan import Plan, make_plan, named, training_samples, warn_of_slow_study
from seakeep.study.settings import Study
from seakeep.study.store import (
    RESULT,
    Groups,
    StudyResult,
    UnitFolder,
    read_result,
    versions,
    write_result,
)
from seakeep.study.units import Unit, collect, compute_task, facts_of, tasks_of, units_of


def run_study(
    study: Study,
    out: Path | str,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
    extra: Mapping[str, xr.Dataset] | None = None,
    notes: Mapping[str, str] | None = None,
    finished: Callable[[StudyResult], None] | None = None,
) -> StudyResult:
    """Run a study, or continue one that was stopped.

    Parameters
    ----------
    study : Study
        From :func:`seakeep.study.read_study`.
    out : Path or str
        Folder of the results. Finished units (a model of a training set) are kept there, one file
        each, and reused when the study is run again; at the end all is in ``study.nc``.
    executor : concurrent.futures.Executor, optional
        Does units side by side: :func:`seakeep.models.executor.processes`, or ``get_executor()``
        of a Dask client. Its workers need no disk in common. The arrays do not depend on it.
    progress : callable, optional
        Called as ``progress(done, total, what)``.
    extra : mapping of str to Dataset, optional
        Groups to be kept beside the results.
    notes : mapping of str to str, optional
        Attributes to be kept beside them, such as ``preparation_note`` for the report.
    finished : callable, optional
        Called with the result once it is known, just before it is written.

    Returns
    -------
    StudyResult
        Results of the study.

    Raises
    ------
    RequestError
        If settings leave no feasible window, a channel is missing, the folder holds another
        study or cannot be written, or another process works there.
    DataError
        If a run cannot be read or used.
    StorageError
        If the disk is full; what was finished is kept.
    WorkerLostError
        If a worker process was stopped from outside; what was finished is kept.

    Warns
    -----
    SeakeepWarning
        If training windows hold fewer than five periods of a slow motion, or forecasts diverged:
        model, training set and window are named, and the result leaves them out.
    """
    out = Path(out)
    report = progress or (lambda done, total, what: None)
    hand_on = finished or (lambda result: None)
    folder = UnitFolder(out, study.digest)
    folder.check()
    if (result := _finished(study, out, report)) is not None:
        labels = _labels(study)
        if any(result.attrs[key] != value for key, value in labels.items()):
            return write_result(out, {**result.attrs, **labels}, result.groups, hand_on)
        hand_on(result)
        return result
    plan = make_plan(study, named(report, "preparing "))
    warn_of_slow_study(plan)
    folder.open(study.name)
    with folder.alone():
        result = _finished(study, out, report)  # by another process, meanwhile
        if result is None:
            facts = facts_of(study, plan)
            computed = _computed(plan, facts, folder, executor, report)
            report(len(computed), len(computed), "statistics and densities")
            groups = describe_study(study, plan)
            if "repeats" in groups:
                warn(words_of_repeats(groups["repeats"]))
            groups |= collect(plan, facts, computed)
            groups |= judge(groups, study.settings, list(plan.states), executor)
            if "statistics/lost" in groups:
                warn(words_of_lost(groups["statistics/lost"]))
            groups |= extra or {}
            attributes = {**_labels(study), **_attributes(study, plan), **(notes or {})}
            result = write_result(out, attributes, groups, hand_on)
        else:
            hand_on(result)
        folder.clear()
    return result


def _finished(study: Study, out: Path, report: Progress) -> StudyResult | None:
    """The result of an earlier run, if there is one of the same study."""
    if not (out / RESULT).exists():
        return None
    result = read_result(out)
    if result.attrs.get("digest") != study.digest:
        return None
    report(1, 1, "finished before")
    return result


def _labels(study: Study) -> dict[str, str]:
    """Attributes in which a study may change without becoming another one: names and labels."""
    general, campaign = study.settings.study, study.campaign.settings.campaign
    return {
        "study": study.name,
        "description": general.description or campaign.description,
        "settings": study.settings.model_dump_json(),
    }


def _attributes(study: Study, plan: Plan) -> dict[str, str | float | int]:
    general = study.settings.study
    alignments = [each.spec.alignment for each in plan.models.values()]
    # Measured output that a forecast reads after its start.
    read = [each.surge_channel for each in alignments if each and each.surge == "measured"]
    return {
        "campaign": study.campaign.name,
        "preset": general.preset,
        "seed": general.seed,
        "digest": study.digest,
        "campaign_digest": study.campaign.digest,
        "encounter_period": plan.encounter_period,
        "dt": plan.dt,
        "longest_training": training_samples(plan.needs) * plan.dt,
        "preparation": study.campaign.settings.preparation.model_dump_json(),
        "models": json.dumps({name: each.to_json() for name, each in plan.models.items()}),
        "conditional_on": ", ".join(dict.fromkeys(read)),
        "versions": json.dumps(versions()),
    }


def _computed(
    plan: Plan, facts: Groups, folder: UnitFolder, executor: Executor | None, report: Progress
) -> dict[Unit, Groups]:
    """Groups of all units: those that the folder holds, and others once they are written there."""
    units = units_of(plan)
    known = {unit: folder.read(unit.name) for unit in units}
    done = {unit: groups for unit, groups in known.items() if groups is not None}
    items = deque(tasks_of(plan, [unit for unit in units if unit not in done]))
    members = sum(each.spec.n_members for each in plan.models.values())
    steps = [w.steps for each in plan.training for w in plan.windows if each.may_test(w.run)]
    mebibytes = 8 * members * sum(steps) * len(plan.states) / 2**20
    taken = f"{members * len(steps)} forecasts of {mebibytes:.3g} MiB"
    report(len(done), len(units), f"fitting and forecasting, {taken}")
    try:
        for task, computed in as_finished(_work, (plan, facts), items, executor):
            for unit, groups in zip(task, computed, strict=True):
                folder.write(unit.name, groups)
                done[unit] = groups
                name = plan.training[unit.training].name
                report(len(done), len(units), f"{unit.model}, training set {name}")
    except WorkerLostError as error:
        raise WorkerLostError(
            f"{error} What was finished is kept: the same command continues where it stopped."
        ) from None
    return {unit: done[unit] for unit in units}


def _work(data: tuple[Plan, Groups], task: tuple[Unit, ...]) -> list[Groups]:
    """Groups of some units, which come back to be written: a worker may have another disk."""
    return compute_task(*data, task)
