"""Run a study, unit by unit, resumed where it was stopped.

A unit is one model of one training set on all windows that it may be tested on. It is computed as a
whole and kept in one file, so that its arrays are the same to the last bit whether or not a study
was interrupted, and for any number of workers. A unit is a few Datasets by name; :func:`collect`
puts those of all units side by side, along models and training sets.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from itertools import islice, zip_longest
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import xarray as xr

from seakeep import metrics
from seakeep.arrays import Datasets, FloatArray, Groups, IntArray, Progress
from seakeep.core.bands import ConformalMargin
from seakeep.errors import DataError, SeakeepError, warn
from seakeep.executor import WorkerLostError, as_finished, versions
from seakeep.formats.columns import decoding
from seakeep.models.calibration import envelope_of, held_out, learn_margin
from seakeep.models.engine import Windows, member_series, read_groups
from seakeep.models.forecasts import STATISTICS, reduce_members
from seakeep.models.labelled import TrainingRuns, channel_matrix, nearest_sample
from seakeep.models.linear import HankelDMDcModel, spectral_radius
from seakeep.models.selection import Selected
from seakeep.models.specs import HankelDMDc, left_open
from seakeep.models.training import gather, system_of
from seakeep.signals import envelope_squared
from seakeep.study.describe import describe_study, words_of_repeats
from seakeep.study.judge import (
    BANDS,
    MEASURES,
    judge,
    judge_windows,
    numbered,
    side_by_side,
    words_of_lost,
)
from seakeep.study.plan import (
    Plan,
    make_plan,
    named,
    parts_of,
    training_samples,
    warn_of_slow_study,
)
from seakeep.study.settings import Study
from seakeep.study.store import StudyResult, UnitFolder, write_result

EIGENVALUES_OF = 5
"""Members whose eigenvalues are computed: as many show where those of an ensemble lie."""


def run_study(
    study: Study,
    out: Path | str,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
    extra: Datasets | None = None,
    notes: Mapping[str, str] | None = None,
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
        Does units side by side: :func:`seakeep.executor.processes`, or ``get_executor()``
        of a Dask client. Its workers need no disk in common. The arrays do not depend on it.
    progress : callable, optional
        Called as ``progress(done, total, what)``.
    extra : mapping of str to Dataset, optional
        Groups to be kept beside the results.
    notes : mapping of str to str, optional
        Attributes to be kept beside them, such as ``preparation_note`` for the report.

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
    folder = UnitFolder(out, study.digest)
    before = folder.check()
    with folder.alone():
        before = before or folder.check()
        labels = _labels(study)
        if before is not None:
            report(1, 1, "finished before")
            result = replace(before, attrs={**before.attrs, **labels})
        else:
            plan = make_plan(study, named(report, "preparing "))
            warn_of_slow_study(plan)
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
            attributes = {**labels, **_attributes(study, plan), **(notes or {})}
            result = StudyResult(out, attributes, {**groups, **(extra or {})})
        if before is None or before.attrs != result.attrs:
            write_result(result)
        folder.clear()
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
    return {
        "created": datetime.now(UTC).isoformat(timespec="seconds"),
        "campaign": study.campaign.name,
        "preset": general.preset,
        "seed": general.seed,
        "digest": study.digest,
        "campaign_digest": study.campaign.digest,
        "encounter_period": plan.encounter_period,
        "dt": plan.dt,
        "longest_training": training_samples(plan.needs) * plan.dt,
        "preparation": study.campaign.settings.preparation.model_dump_json(),
        "models": json.dumps({name: each.description for name, each in plan.models.items()}),
        "versions": json.dumps(versions()),
    }


def _computed(
    plan: Plan, facts: Groups, folder: UnitFolder, executor: Executor | None, report: Progress
) -> dict[Unit, Groups]:
    """Groups of all units: those that the folder holds, and others once they are written there."""
    units = units_of(plan)
    known = {unit: folder.read(unit.name) for unit in units}
    done = {unit: groups for unit, groups in known.items() if groups is not None}
    tasks = tasks_of(plan, [unit for unit in units if unit not in done])
    report(len(done), len(units), "fitting and forecasting")
    try:
        for task, computed in as_finished(compute_task, (plan, facts), tasks, executor):
            for unit, groups in zip(task, computed, strict=True):
                folder.write(unit.name, groups)
                done[unit] = groups
                name = plan.training[unit.training].name
                report(len(done), len(units), f"{unit.model}, training set {name}")
    except (DataError, WorkerLostError) as error:
        raise type(error)(
            f"{error} What was finished is kept ({len(done)} of {len(units)} units): the same "
            "command continues where it stopped. Other settings are another study, for another "
            "folder."
        ) from error
    return {unit: done[unit] for unit in units}


FILL = {"lost": -2, "windows": 0}
"""What stands for a training set that tests no window, where it is not NaN."""


@dataclass(frozen=True)
class Unit:
    """A model and the number of a training set: what is computed and kept as a whole."""

    model: str
    training: int

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"{self.model}.t{self.training:02d}"


def units_of(plan: Plan) -> list[Unit]:
    """All units, in an order that shows results early."""
    return [
        Unit(model, training)
        for training in range(len(plan.training))
        for model in plan.models
        if tested_windows(plan, training)
    ]


def tasks_of(plan: Plan, units: Iterable[Unit]) -> list[tuple[Unit, ...]]:
    """Units that one worker does in turn: what their settings leave open is chosen once."""
    out: dict[object, tuple[Unit, ...]] = {}
    for unit in units:
        spec = left_open(plan.specs[unit.model])
        key = unit.training, unit.model if spec is None else spec.central(plan.dt)
        out[key] = (*out.get(key, ()), unit)
    return list(out.values())


def tested_windows(plan: Plan, training: int) -> dict[str, list[int]]:
    """Windows that a training set may be tested on, by test set; those without any are left out."""
    where = plan.training[training]
    every = {
        test: [k for k, window in enumerate(windows) if where.may_test(window.run)]
        for test, windows in plan.tests.items()
    }
    return {test: numbers for test, numbers in every.items() if numbers}


def compute_task(data: tuple[Plan, Groups], units: Sequence[Unit]) -> list[Groups]:
    """Compute units of :func:`tasks_of`, in their order; errors name training set and model.

    The groups come back to be written: a worker may have another disk.
    """
    (plan, facts), selected, out = data, None, []
    for unit in units:
        training, spec = plan.training[unit.training], left_open(plan.specs[unit.model])
        place = f"training set '{training.name}', model '{unit.model}'"
        try:
            if selected is None and spec is not None:
                selected = spec.central(plan.dt).settled(*plan.taught(training.spans))
            out.append(compute(plan, facts, unit, selected))
        except SeakeepError as error:
            raise DataError(f"{place}: {error}") from error
        except Exception as error:
            error.add_note(place)  # a model of somebody's own
            raise
    return out


def compute(
    plan: Plan, facts: Groups, unit: Unit, selected: Selected[HankelDMDc] | None = None
) -> Groups:
    """Fit a model, with the settings that were chosen, and forecast all windows.

    Returns
    -------
    dict of str to Dataset
        ``tests/NAME``: ``mean``, and its ``error`` and ``error_over_time``; of an ensemble
        ``bands/NAME``, the other statistics of its members and what became of each; ``chosen``;
        ``calibration``; ``regularisation``. Of the first training set ``eigenvalues`` and
        ``draws``.
    """
    training, settings = plan.training[unit.training], plan.settings
    spec: Any = plan.specs[unit.model]
    how = {} if selected is None else {"selected": selected}
    fitted = spec.fit(*plan.taught(training.spans), **how)
    if spec.is_ensemble and fitted.settings.delay_rows == "exact":  # members take little room
        fitted = fitted.hold()
    ahead = fitted.signature.input_after * plan.dt
    words = {"units": "s", "long_name": "waves read after the instant that is forecast"}
    chosen = {"words": getattr(fitted, "selection", ""), "look_ahead": ((), ahead, words)}
    out = {"chosen": xr.Dataset(chosen)}
    frequency = 1.0 / (settings.statistics.split_period * plan.encounter_period)
    tested = tested_windows(plan, unit.training)
    for test, series, lost, windows in _free_runs(plan, fitted, tested):
        at = {"window": tested[test]}
        mean = np.array(series[0])
        if spec.is_ensemble:
            reduced = reduce_members(series, lost, settings.statistics.level)
            bands = numbered(reduced, ("window", "number", "time", "channel"), STATISTICS, at)
            mean = bands["mean"].values
            bands = bands.drop_vars("mean").assign(lost=(("window", "member"), lost.T))
            if settings.statistics.scale == "learnt":
                envelope = envelope_of(fitted.signature, windows)
                bands["envelope"] = (("window", "time"), envelope)
            out[f"bands/{test}"] = bands.assign_coords(member=np.arange(len(series)))
        known = _known(facts[test], unit, tested[test])
        judged = judge_windows(predicted=mean, **known, dt=plan.dt, frequency=frequency)
        out[f"tests/{test}"] = judged.assign_coords(at)
    if spec.is_ensemble and plan.calibrated_on:
        out["calibration"] = band_margins(plan, unit, fitted)
    ridged = getattr(spec, "delay_rows", "") == "ridge" and not spec.is_ensemble
    if settings.output.regularisation and ridged:
        out["regularisation"] = regularisation(plan, facts, unit, fitted)
    if unit.training == units_of(plan)[0].training:
        if spec.is_ensemble:
            out["draws"] = fitted.draws
        if settings.output.eigenvalues:
            out["eigenvalues"] = _eigenvalues(fitted).assign_attrs(
                training=training.name, dt=plan.dt
            )
    return out


def _known(facts: xr.Dataset, unit: Unit, windows: Sequence[int]) -> dict[str, FloatArray]:
    """What windows are judged by."""
    known = facts.isel(window=windows, training=unit.training)
    return {key: known[key].values for key in ("measured", "training_std", "noise_std")}


def _eigenvalues(fitted: Any) -> xr.Dataset:
    """Eigenvalues of the first members, in descending order of modulus."""
    values = [np.linalg.eigvals(each) for each in islice(fitted.system_matrices(), EIGENVALUES_OF)]
    ordered = (each[np.argsort(-np.abs(each), kind="stable")] for each in values)
    padded = np.array([*zip_longest(*ordered, fillvalue=complex(np.nan, np.nan))]).T
    parts = {key: (("member", "mode"), getattr(padded, key)) for key in ("real", "imag")}
    return xr.Dataset(parts)


def regularisation(plan: Plan, facts: Groups, unit: Unit, fitted: HankelDMDcModel) -> xr.Dataset:
    r"""Identify a model of the paper's form with λ, without it, and by truncated singular values.

    As many singular values are kept as the regression with λ has degrees of freedom,
    :math:`\sum \sigma^2 / (\sigma^2 + \lambda)`.

    Returns
    -------
    Dataset
        Over ``variant``: ``radius``, the spectral radius, and ``seconds`` of processor time for
        the matrices; ``truncated_nrmse`` over (window, channel) of the first test set; ``rank``.
    """
    spec = fitted.settings
    given = TrainingRuns(*plan.taught(plan.training[unit.training].spans))
    data = gather(given, spec)
    system = system_of((data.states, data.delayed, data.direct), data.windows, spec)
    squares = np.linalg.eigvalsh(system.gram, UPLO="U")
    rank = round(float(np.sum(squares / (squares + fitted.training.ridge))))
    truncated = replace(spec, ridge=0.0, rank=rank)
    variants = {"none": replace(spec, ridge=0.0), "truncated": truncated, "ridge": spec}
    radius, seconds, models = [], [], {}
    for name, each in variants.items():
        begin = process_time()
        solution = data.regress(each)
        seconds.append(process_time() - begin)
        models[name] = HankelDMDcModel.fitted(each, data, solution, given.runs)
        radius.append(spectral_radius(models[name].dynamics))
    test, numbers = next(iter(tested_windows(plan, unit.training).items()))
    ((_, series, *_),) = _free_runs(plan, models["truncated"], {test: numbers})
    error = metrics.nrmse(predicted=np.array(series[0]), **_known(facts[test], unit, numbers))
    return xr.Dataset(
        {
            "radius": ("variant", radius),
            "seconds": ("variant", seconds, {"units": "s"}),
            "truncated_nrmse": (("window", "channel"), error),
            "rank": rank,
        },
        {"variant": list(variants), "window": numbers},
    )


def _free_runs(
    plan: Plan, fitted: Any, tested: Mapping[str, Sequence[int]]
) -> Iterator[tuple[str, FloatArray, IntArray, Windows]]:
    """Free runs of all members over each test set, (member, window, steps, N), and where lost."""
    chosen = {test: [plan.tests[test][k] for k in numbers] for test, numbers in tested.items()}
    places = [
        ([(each.run, each.start) for each in windows], windows[0].steps)
        for windows in chosen.values()
    ]
    groups = read_groups(fitted.signature, plan.runs, places)
    every = member_series(fitted, groups)
    for test, (series, lost), windows in zip(tested, every, groups, strict=True):
        yield test, series, lost, windows


def band_margins(plan: Plan, unit: Unit, fitted: Any) -> xr.Dataset:
    """Find the band of an ensemble on windows as long as those of the first test set.

    The windows lie in the training spans, clear of what the members have read. Where these read
    all of it (runs left out, or pooled), each run is forecast by an ensemble that learnt from the
    others, with the settings that were chosen from all of them. No test window is looked at.
    """
    training, statistics = plan.training[unit.training], plan.settings.statistics
    steps = next(iter(plan.tests.values()))[0].steps
    if training.left_out or len(training.spans) > 1:
        spec: Any = plan.specs[unit.model].from_json(fitted.origin)
        groups = [each.left_out for each in plan.training if each is not training and each.left_out]
        cases: dict[str, Any] = {}
        for group in groups or [(run,) for run, *_ in training.spans]:
            rest = [span for span in training.spans if span[0] not in group]
            tests = parts_of(plan.runs, [span for span in training.spans if span[0] in group])
            if rest and tests:
                ensemble = spec.fit(*plan.taught(rest))
                cases |= {name: (ensemble, run) for name, run in tests.items()}
    else:
        spans = [(name, *plan.runs[name].attrs["train_span"]) for name in plan.calibrated_on]
        cases = {name: (fitted, run) for name, run in parts_of(plan.runs, spans).items()}
    judged = list(held_out(cases, steps, statistics.level).values())
    nothing = np.full(len(plan.states), np.nan)
    unknown = ConformalMargin(nothing, nothing, nothing, nothing, statistics.level)
    learnt: Any = unknown, nothing, [nothing] * 4
    if judged:
        learnt = learn_margin(judged, statistics.level, statistics.scale)
    margin, floor, law = learnt
    out: dict[str, Any] = {
        key: ("channel", getattr(margin, key)) for key in ("margin", "blocks", "warranted")
    }
    out["windows"] = sum(len(each.measured) for each in judged)
    if statistics.scale != "constant":
        out["floor"] = ("channel", floor)
    if statistics.scale == "learnt":
        out["law"] = (("term", "channel"), law)
    return xr.Dataset(out, attrs={"level": statistics.level})


def collect(plan: Plan, facts: Groups, computed: Mapping[Unit, Groups]) -> Groups:
    """Put all units together, with the facts of their windows."""
    sets = [each.name for each in plan.training]
    numbers = list(dict.fromkeys(unit.training for unit in computed))

    def stacked(group: str, models: Iterable[str], dim: str) -> xr.Dataset:
        """A group of several models, over (`dim`, training)."""
        names = {dim: list(models), "training": [sets[k] for k in numbers]}
        grid = [[computed[Unit(m, k)].get(group, xr.Dataset()) for k in numbers] for m in models]
        return side_by_side(grid, names, FILL)

    out = {}
    for test in plan.tests:
        means = stacked(f"tests/{test}", plan.models, "model")
        parts = [means.transpose("model", "measure", "band", "training", ...)]
        if plan.ensembles:
            parts.append(stacked(f"bands/{test}", plan.ensembles, "ensemble"))
        data = xr.merge([*parts, facts[test]], join="right", fill_value=FILL)
        out[f"tests/{test}"] = data.drop_vars("member", errors="ignore")
    out["chosen"] = stacked("chosen", plan.models, "model")
    if plan.calibrated_on and plan.ensembles:
        margins = stacked("calibration", plan.ensembles, "ensemble")
        margins = margins.reindex(training=sets, fill_value=FILL)
        out["calibration"] = margins.assign_coords(channel=list(plan.states))
    for model in plan.models:
        first = next(groups for unit, groups in computed.items() if unit.model == model)
        # There is one of the first training set alone, but for what regularisation changes.
        out |= {f"{key}/{model}": first[key] for key in ("eigenvalues", "draws") if key in first}
        if (key := "regularisation") in first:
            out[f"{key}/{model}"] = stacked(key, [model], "model").squeeze("model", drop=True)
    return out


def facts_of(study: Study, plan: Plan) -> Groups:
    """What is known of the windows of each test set without any model.

    Returns
    -------
    dict of str to Dataset
        ``measured`` and, where a study names a folder of them, ``truth`` over (window, time,
        channel), ``judged``, ``start``, ``run``, moments of the training, ``noise_std`` and, with
        an elevation among the inputs, ``wave_height``.
    """
    known = {each.run: _known_of(study, plan, each.run) for each in plan.windows}
    pooled = []
    for training in plan.training:
        parts = parts_of(plan.runs, training.spans).items()
        columns = [channel_matrix(part, plan.states, name) for name, part in parts]
        pooled.append(np.concatenate(columns).T.copy())
    out = {}
    for test, windows in plan.tests.items():
        cut = []
        for each in windows:
            at = nearest_sample(plan.runs[each.run]["time"].values, each.start, each.run) + 1
            cut.append(known[each.run].isel(time=slice(at, at + each.steps)))
        judged = [[each.may_test(w.run) for w in windows] for each in plan.training]
        out[test] = (
            xr.concat(cut, "window", data_vars="all")
            .assign(
                judged=(("training", "window"), judged),
                start=("window", [each.start for each in windows]),
                training_mean=(("training", "channel"), [x.mean(axis=1) for x in pooled]),
                training_std=(("training", "channel"), [x.std(axis=1, ddof=1) for x in pooled]),
            )
            .assign_coords(
                model=list(plan.models),
                ensemble=plan.ensembles,
                measure=list(MEASURES),
                band=list(BANDS),
                training=[each.name for each in plan.training],
                window=range(len(windows)),
                time=("time", plan.dt * np.arange(1, windows[0].steps + 1), {"units": "s"}),
                channel=list(plan.states),
            )
        )
    return out


def _known_of(study: Study, plan: Plan, name: str) -> xr.Dataset:
    """What a run says without any model, at its instants."""
    run = plan.runs[name]
    noise = [run[each].attrs.get("noise_std", 0.0) for each in plan.states]
    known: dict[str, Any] = {
        "measured": (("time", "channel"), channel_matrix(run, plan.states, name)),
        "noise_std": ("channel", noise),
        "run": name,
    }
    if plan.waves is not None:
        squares = envelope_squared(run[plan.waves].values.astype(float), plan.dt)
        known["wave_height"] = "time", 2.0 * np.sqrt(squares)
    if (folder := study.truth_folder) is not None:
        known["truth"] = ("time", "channel"), _truth(folder, plan, name)
    return xr.Dataset(known)


def _truth(folder: Path, plan: Plan, run: str) -> FloatArray:
    """True states at the instants of a run; NaN of a channel that has no truth."""
    import h5py

    path = folder / f"{run}.nc"
    if not path.exists():
        raise DataError(
            f"the study names the folder {folder} of true channels, and {path.name} is not in "
            "it. Play the tank again, or leave study.truth out."
        )
    # These alone: a labelled reading of all channels takes ten times as long.
    with decoding(path, "true channels", "Play the tank again."), h5py.File(path) as file:
        true = {name: file[name][:] for name in ("time", *plan.states) if name in file}
    time = plan.runs[run]["time"].values
    nothing = np.full(time.size, np.nan)
    columns = [
        np.interp(time, true["time"], true[name]) if name in true else nothing
        for name in plan.states
    ]
    return np.stack(columns, axis=-1)
