"""The work of a study: one model of one training set on all windows that it may be tested on.

Such a unit is computed as a whole and kept in one file, so that its arrays are the same to the last
bit whether or not a study was interrupted, and for any number of workers. A unit is a few Datasets
by name; :func:`collect` puts those of all units side by side, along models and training sets.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.conventions import is_elevation
from seakeep.core import embed, metrics
from seakeep.errors import DataError, SeakeepError
from seakeep.formats.netcdf import opened_netcdf
from seakeep.models import Spec
from seakeep.models.calibration import Judged, envelope_of, held_out, learn_margin
from seakeep.models.engine import member_series, read_groups
from seakeep.models.ensemble import spectral_radius
from seakeep.models.linear import HankelDMDcModel
from seakeep.models.selection import Selected
from seakeep.models.specs import HankelDMDc, left_open
from seakeep.models.summaries import STATISTICS, reduce_members
from seakeep.models.training import gather
from seakeep.signals import envelope_squared
from seakeep.study.judge import BANDS, MEASURES, judge_windows
from seakeep.study.plan import Plan, TestWindow, TrainingSet, between
from seakeep.study.settings import Study
from seakeep.study.store import Groups

Runs = Mapping[str, xr.Dataset]

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


@contextmanager
def _named_after(plan: Plan, unit: Unit) -> Iterator[None]:
    """Name training set and model in errors."""
    try:
        yield
    except SeakeepError as error:
        name = plan.training[unit.training].name
        raise DataError(f"training set '{name}', model '{unit.model}': {error}") from error


def compute_task(plan: Plan, runs: Runs, facts: Groups, units: Sequence[Unit]) -> list[Groups]:
    """Compute units of :func:`tasks_of`, in their order."""
    selected, out = None, []
    for unit in units:
        spec = left_open(plan.specs[unit.model])
        if selected is None and spec is not None:
            parts = training_parts(runs, plan.training[unit.training])
            with _named_after(plan, unit):
                selected = spec.central(plan.dt).settled(
                    parts, list(plan.states), list(plan.inputs)
                )
        out.append(compute(plan, runs, facts, unit, selected))
    return out


def compute(
    plan: Plan,
    runs: Runs,
    facts: Groups,
    unit: Unit,
    selected: Selected[HankelDMDc] | None = None,
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
    with _named_after(plan, unit):
        fitted = fit_training(plan, runs, unit.model, training, selected=selected)
    ahead = (max(fitted.signature.lead_samples, 1) - 1) * plan.dt
    words = {"units": "s", "long_name": "waves read after the instant that is forecast"}
    chosen = {"words": getattr(fitted, "selection", ""), "look_ahead": ((), ahead, words)}
    out = {"chosen": xr.Dataset(chosen)}
    is_ensemble = plan.specs[unit.model].is_ensemble
    frequency = 1.0 / (settings.statistics.split_period * plan.encounter_period)
    tested = tested_windows(plan, unit.training)
    for test, series, lost, envelope in _series(plan, runs, fitted, tested):
        at = {"window": tested[test]}
        known = facts[test].isel(at | {"training": unit.training})
        pair = {key: known[key].values for key in ("measured", "training_std", "noise_std")}
        mean = np.array(series[0])
        if is_ensemble:
            reduced = reduce_members(series, lost, settings.statistics.level)
            mean = reduced[:, 0]
            bands: dict[str, Any] = {
                key: (("window", "time", "channel"), reduced[:, row])
                for row, key in enumerate(STATISTICS)
                if key != "mean"
            }
            bands["lost"] = (("window", "member"), lost.T)
            if settings.statistics.scale == "learnt":
                bands["envelope"] = (("window", "time"), envelope)
            out[f"bands/{test}"] = xr.Dataset(bands, {**at, "member": np.arange(len(series))})
        judged = judge_windows(predicted=mean, **pair, dt=plan.dt, frequency=frequency)
        out[f"tests/{test}"] = judged.assign_coords(at)
    if is_ensemble and plan.calibrated_on:
        out["calibration"] = band_margins(plan, runs, unit, fitted)
    form = getattr(plan.specs[unit.model], "delay_rows", "")
    if settings.output.regularisation and form == "ridge" and not is_ensemble:
        out["regularisation"] = regularisation(plan, runs, fitted, training, facts, tested)
    if unit.training == units_of(plan)[0].training:
        out |= _of_first(plan, unit, fitted)
    return out


def regularisation(
    plan: Plan,
    runs: Runs,
    fitted: HankelDMDcModel,
    training: TrainingSet,
    facts: Groups,
    tested: Mapping[str, Sequence[int]],
) -> xr.Dataset:
    r"""Identify a model of the paper's form with λ, without it, and by truncated singular values.

    As many singular values are kept as the regression with λ has degrees of freedom,
    :math:`\sum \sigma^2 / (\sigma^2 + \lambda)`.

    Returns
    -------
    Dataset
        Over ``variant``: ``radius``, the spectral radius, and ``seconds`` of processor time for
        the matrices; ``truncated_nrmse`` over (window, channel) of the first test set; ``rank``.
    """
    spec: Any = fitted.settings
    parts = training_parts(runs, training)
    data = gather(parts, plan.states, plan.inputs, None, spec)
    groups = (data.states, spec.state_delays), (data.delayed, spec.input_delays)
    regressors = [
        np.concatenate([embed(x[k], lags, at.first_column, at.columns) for x, lags in groups])
        for k, at in enumerate(data.windows)
    ]
    squares = np.linalg.svd(np.concatenate(regressors, axis=1), compute_uv=False) ** 2
    rank = round(float(np.sum(squares / (squares + fitted.training.ridge))))
    variants = {
        "none": replace(spec, ridge=0.0),
        "truncated": replace(spec, ridge=0.0, rank=rank),
        "ridge": spec,
    }
    radius, seconds, models = [], [], {}
    for name, each in variants.items():
        begin = process_time()
        solution = data.regress(each, each.state_delays, all_rows=True)
        seconds.append(process_time() - begin)
        models[name] = HankelDMDcModel.fitted(each, data, solution, parts)
        radius.append(spectral_radius(models[name].dynamics))
    test, numbers = next(iter(tested.items()))
    known = facts[test].isel(window=numbers, training=list(plan.training).index(training))
    pair = {key: known[key].values for key in ("measured", "training_std", "noise_std")}
    ((_, series, *_),) = _series(plan, runs, models["truncated"], {test: numbers})
    return xr.Dataset(
        {
            "radius": ("variant", radius),
            "seconds": ("variant", seconds, {"units": "s"}),
            "truncated_nrmse": (
                ("window", "channel"),
                metrics.nrmse(predicted=np.array(series[0]), **pair),
            ),
            "rank": rank,
        },
        {"variant": list(variants), "window": numbers},
    )


def _of_first(plan: Plan, unit: Unit, fitted: Any) -> Groups:
    """What is kept of a model of the first training set alone."""
    out = {}
    if plan.specs[unit.model].is_ensemble:
        out["draws"] = fitted.draws
    if plan.settings.output.eigenvalues:
        values = [np.linalg.eigvals(matrix) for matrix in fitted.system_matrices()]
        padded = np.full((len(values), max(each.size for each in values)), complex(np.nan, np.nan))
        for row, each in enumerate(values):  # in descending order of modulus
            padded[row, : each.size] = each[np.argsort(-np.abs(each), kind="stable")]
        out["eigenvalues"] = xr.Dataset(
            {key: (("member", "mode"), getattr(padded, key)) for key in ("real", "imag")},
            attrs={"training": plan.training[unit.training].name, "dt": plan.dt},
        )
    return out


def _series(
    plan: Plan, runs: Runs, fitted: Any, tested: Mapping[str, Sequence[int]]
) -> Iterator[tuple[str, FloatArray, npt.NDArray[np.int64], FloatArray]]:
    """Free runs of all members over each test set, (member, window, steps, N), where lost, waves.

    Test sets of one length run side by side: what a free run prepares serves all of them.
    """
    batches: dict[int, list[str]] = {}
    for test in tested:
        batches.setdefault(plan.tests[test][0].steps, []).append(test)
    chosen = {test: [plan.tests[test][k] for k in numbers] for test, numbers in tested.items()}
    groups = [
        ([(window.run, window.start) for test in tests for window in chosen[test]], steps)
        for steps, tests in batches.items()
    ]
    windows = read_groups(fitted.signature, runs, groups)
    with member_series(fitted, windows) as series_of:
        for (series, lost), tests, each in zip(series_of, batches.values(), windows, strict=True):
            envelope = envelope_of(fitted.signature, each)
            first = 0
            for test in tests:
                mine = slice(first, first + len(tested[test]))
                yield test, series[:, mine], lost[:, mine], envelope[mine]
                first = mine.stop


def training_parts(runs: Runs, training: TrainingSet) -> dict[str, xr.Dataset]:
    """The runs of a training set, cut to what may be read."""
    return {name: between(runs[name], (begin, stop)) for name, begin, stop in training.spans}


def fit_training(
    plan: Plan,
    runs: Runs,
    model: str,
    training: TrainingSet,
    spec: Spec | None = None,
    selected: Selected[HankelDMDc] | None = None,
) -> Any:
    """Fit a model of the study to a training set.

    Its settings may be others, `spec`, and what they leave open may be chosen already, `selected`.
    """
    spec = spec or plan.specs[model]
    parts, states, inputs = training_parts(runs, training), list(plan.states), list(plan.inputs)
    if selected is not None and (open_spec := left_open(spec)) is not None:
        return open_spec.fit(parts, states, inputs, selected=selected)
    return spec.fit(parts, states, inputs)


def band_margins(plan: Plan, runs: Runs, unit: Unit, fitted: Any) -> xr.Dataset:
    """Find the band of an ensemble on windows as long as those of the first test set.

    The windows lie in the training spans, clear of what the members have read. Where these read
    all of it (runs left out, or pooled), each run is forecast by an ensemble that learnt from the
    others, with the settings that were chosen from all of them. No test window is looked at.
    """
    training, statistics = plan.training[unit.training], plan.settings.statistics
    steps = next(iter(plan.tests.values()))[0].steps
    judged: list[Judged] = []
    if training.left_out or len(training.runs) > 1:
        groups = [each.left_out for each in plan.training if each is not training and each.left_out]
        spec = plan.specs[unit.model].from_json(fitted.origin)
        for group in groups or [(run,) for run in training.runs]:
            rest = tuple(span for span in training.spans if span[0] not in group)
            tests = {n: between(runs[n], (b, e)) for n, b, e in training.spans if n in group}
            if rest and tests:
                others = TrainingSet(f"{training.name}, calibration", rest)
                ensemble = fit_training(plan, runs, unit.model, others, spec)
                judged += held_out(
                    dict.fromkeys(tests, ensemble), tests, steps, statistics.level
                ).values()
    else:
        parts = {n: between(runs[n], runs[n].attrs["train_span"]) for n in plan.calibrated_on}
        judged += held_out(dict.fromkeys(parts, fitted), parts, steps, statistics.level).values()
    keys = ("margin", "blocks", "warranted")
    nothing = np.full(len(plan.states), np.nan)
    out: dict[str, Any] = dict.fromkeys(keys, ("channel", nothing))
    floor: FloatArray | None = nothing
    law: FloatArray | None = np.tile(nothing, (4, 1))
    if judged:
        margin, floor, law = learn_margin(judged, statistics.level, statistics.scale)
        out = {key: ("channel", getattr(margin, key)) for key in keys}
    out["windows"] = sum(len(each.measured) for each in judged)
    if statistics.scale != "constant":
        out["floor"] = ("channel", floor)
    if statistics.scale == "learnt":
        out["law"] = (("term", "channel"), law)
    return xr.Dataset(out, attrs={"level": statistics.level})


def collect(plan: Plan, facts: Groups, read: Callable[[Unit], Groups]) -> Groups:
    """Put all units together, with the facts of their windows."""
    units = units_of(plan)
    computed = {unit: read(unit) for unit in units}
    sets = [each.name for each in plan.training]

    def of(model: str, group: str) -> dict[str, xr.Dataset]:
        """A group of a model, by training set."""
        mine = {sets[u.training]: computed[u] for u in units if u.model == model}
        return {name: each[group] for name, each in mine.items() if group in each}

    def stacked(models: Sequence[str], group: str, dim: str) -> xr.Dataset:
        """A group of several models, over (`dim`, training)."""
        each = [_along("training", of(model, group)) for model in models]
        return _along(dim, dict(zip(models, each, strict=True)))

    out: Groups = {}
    for test, windows in plan.tests.items():
        every = {"training": sets, "window": range(len(windows))}
        means = stacked(list(plan.models), f"tests/{test}", "model").reindex(every)
        parts = [means.transpose("model", "measure", "band", "training", ...)]
        if plan.ensembles:
            bands = stacked(plan.ensembles, f"bands/{test}", "ensemble")
            parts.append(bands.reindex(every, fill_value=FILL))
        data = xr.merge([*parts, facts[test]], join="outer")
        out[f"tests/{test}"] = data.drop_vars("member", errors="ignore")
    out["chosen"] = stacked(list(plan.models), "chosen", "model")
    if plan.calibrated_on and plan.ensembles:
        margins = stacked(plan.ensembles, "calibration", "ensemble")
        margins = margins.reindex(training=sets, fill_value=FILL)
        out["calibration"] = margins.assign_coords(channel=list(plan.states))
    for model, key in product(plan.models, ("eigenvalues", "draws", "regularisation")):
        if each := of(model, key):
            several = key == "regularisation"  # of the others there is the first alone
            group = _along("training", each) if several else next(iter(each.values()))
            out[f"{key}/{model}"] = group
    return out


def _along(dim: str, parts: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Datasets one after the other along a new dimension, by name."""
    names = xr.Variable(dim, list(parts))
    return xr.concat(list(parts.values()), names, join="outer", fill_value=FILL)


def facts_of(study: Study, plan: Plan, runs: Runs) -> dict[str, xr.Dataset]:
    """What is known of the windows of each test set without any model.

    Returns
    -------
    dict of str to Dataset
        ``measured`` and, where a study names a folder of them, ``truth`` over (window, time,
        channel), ``judged``, ``start``, ``run``, moments of the training, ``noise_std`` and, with
        an elevation among the inputs, ``wave_height``.
    """
    measured = {name: _columns(plan, run) for name, run in runs.items()}
    waves = next(filter(is_elevation, plan.inputs), None)
    heights = {} if waves is None else {n: _heights(r[waves], plan.dt) for n, r in runs.items()}
    means, spreads = [], []
    for training in plan.training:
        parts = training_parts(runs, training).values()
        pooled = np.concatenate([_columns(plan, part) for part in parts]).T.copy()
        means.append(pooled.mean(axis=1))
        spreads.append(pooled.std(axis=1, ddof=1))
    out, dims = {}, ("window", "time", "channel")
    for test, windows in plan.tests.items():
        noise = [
            [runs[each.run][name].attrs.get("noise_std", 0.0) for name in plan.states]
            for each in windows
        ]
        variables: dict[str, Any] = {
            "measured": (dims, _cut(runs, measured, windows)),
            "judged": (
                ("training", "window"),
                [[each.may_test(w.run) for w in windows] for each in plan.training],
            ),
            "start": ("window", [each.start for each in windows]),
            "run": ("window", [each.run for each in windows]),
            "training_mean": (("training", "channel"), means),
            "training_std": (("training", "channel"), spreads),
            "noise_std": (("window", "channel"), noise),
        }
        if heights:
            variables["wave_height"] = (dims[:2], _cut(runs, heights, windows))
        if (folder := study.truth_folder) is not None:
            variables["truth"] = (dims, _true_windows(folder, plan, windows))
        time = plan.dt * np.arange(1, windows[0].steps + 1)
        out[test] = xr.Dataset(
            variables,
            coords={
                "model": list(plan.models),
                "ensemble": plan.ensembles,
                "measure": list(MEASURES),
                "band": list(BANDS),
                "training": [each.name for each in plan.training],
                "window": range(len(windows)),
                "time": ("time", time, {"units": "s"}),
                "channel": list(plan.states),
            },
        )
    return out


def _cut(runs: Runs, whole: Mapping[str, FloatArray], windows: Sequence[TestWindow]) -> FloatArray:
    """Samples of arrays over the time of runs that windows forecast."""
    parts = []
    for each in windows:
        at = int(np.argmin(np.abs(runs[each.run]["time"].values - each.start))) + 1
        parts.append(whole[each.run][at : at + each.steps])
    return np.stack(parts)


def _columns(plan: Plan, run: xr.Dataset) -> FloatArray:
    """States of a run, (time, channel)."""
    return np.stack([run[name].values for name in plan.states], axis=-1).astype(float)


def _heights(elevation: xr.DataArray, dt: float) -> FloatArray:
    """Twice the envelope of an elevation; NaN in gaps at the ends of the record."""
    known = np.flatnonzero(np.isfinite(elevation.values))
    part = slice(known[0], known[-1] + 1)
    heights = np.full(elevation.size, np.nan)
    heights[part] = 2.0 * np.sqrt(envelope_squared(elevation.values[part].astype(float), dt))
    return heights


def _true_windows(folder: Path, plan: Plan, windows: Sequence[TestWindow]) -> FloatArray:
    """True states at the instants of windows; NaN of a channel that has no truth."""
    truth = {}
    for name in dict.fromkeys(window.run for window in windows):
        path = folder / f"{name}.nc"
        if not path.exists():
            raise DataError(
                f"the study names the folder {folder} of true channels, and {path.name} is not in "
                "it. Play the tank again, or leave study.truth out."
            )
        truth[name] = opened_netcdf(path)
    values = np.full((len(windows), windows[0].steps, len(plan.states)), np.nan)
    for row, window in zip(values, windows, strict=True):
        time = window.start + plan.dt * np.arange(1, window.steps + 1)
        true = truth[window.run]
        for k, name in enumerate(plan.states):
            if name in true:
                row[:, k] = np.interp(time, true["time"].values, true[name].values)
    return values
