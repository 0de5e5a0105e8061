"""The work of a study: one model of one training set on all windows that it may be tested on.

Such a unit is computed as a whole and kept in one file, so that its arrays are the same to the last
bit whether or not a study was interrupted, and for any number of workers.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.conventions import is_elevation
from seakeep.core import metrics
from seakeep.core.bands import band_error_over_time
from seakeep.errors import DataError, SeakeepError
from seakeep.formats.netcdf import opened_netcdf
from seakeep.models.calibration import Judged, envelope_of, found_margin, held_out
from seakeep.models.checks import Json
from seakeep.models.engine import group_series, read_groups
from seakeep.models.readouts import FittedReadOut
from seakeep.models.registry import is_ensemble
from seakeep.models.selection import Selected
from seakeep.models.specs import HankelDMDc, left_open
from seakeep.models.summaries import STATISTICS, reduce_members
from seakeep.signals import envelope_squared
from seakeep.study.judge import BANDS, MEASURES
from seakeep.study.nowcast import PERIODS, SHARE, labelled_skill, nowcast
from seakeep.study.plan import Plan, TestWindow, TrainingSet, between
from seakeep.study.settings import Study

Runs = Mapping[str, xr.Dataset]
Arrays = dict[str, npt.NDArray[Any]]
Read = Callable[["Unit"], Arrays]


DIMS = {
    "mean": ("model", "training", "window", "time", "channel"),
    **dict.fromkeys(
        ("std", "lower", "upper"), ("ensemble", "training", "window", "time", "channel")
    ),
    "lost": ("ensemble", "training", "window", "member"),
    "member_nrmse": ("ensemble", "training", "window", "member", "channel"),
    "envelope": ("ensemble", "training", "window", "time"),
    "members": ("ensemble", "shown", "member", "time", "channel"),
}
"""Dimensions of what units find in the windows of a test set."""


@dataclass(frozen=True)
class Unit:
    """A model and the number of a training set: what one worker does at a time.

    A unit that chooses finds the settings that the model, and others like it, leave open.
    """

    model: str
    training: int
    chooses: bool = False

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"{self.model}.t{self.training:02d}" + ".choice" * self.chooses


def units_of(plan: Plan) -> list[Unit]:
    """All units, in an order that shows results early."""
    return [
        Unit(model, training)
        for training in range(len(plan.training))
        for model in plan.models
        if any(tested_windows(plan, training, test) for test in plan.tests)
    ]


def choice_of(plan: Plan, unit: Unit) -> Unit | None:
    """The unit that chooses for another one; None where nothing is left open."""

    def central(model: str) -> HankelDMDc | None:
        spec = left_open(plan.specs[model])
        return None if spec is None else spec.central(plan.dt)

    if (wanted := central(unit.model)) is None:
        return None
    first = next(model for model in plan.models if central(model) == wanted)
    return Unit(first, unit.training, chooses=True)


def choose(plan: Plan, runs: Runs, unit: Unit) -> Arrays:
    """Choose what the settings of a model leave open, on a training set."""
    parts = training_parts(runs, plan.training[unit.training])
    spec = left_open(plan.specs[unit.model])
    assert spec is not None
    with _named_after(plan, unit):
        found = spec.central(plan.dt).settled(parts, list(plan.states), list(plan.inputs))
    content = {
        "settings": found.settings.to_json(),
        "rows": found.rows,
        "note": found.note,
        "readouts": [each.to_json() for each in found.readouts],
    }
    return {"choice": np.array(json.dumps(content))}


def _chosen(plan: Plan, choice: Arrays) -> Selected[HankelDMDc]:
    """What :func:`choose` found."""
    content = json.loads(str(choice["choice"]))
    return Selected(
        HankelDMDc.from_json(content["settings"]),
        tuple(content["rows"]),
        content["note"],
        tuple(FittedReadOut.from_json(each) for each in content["readouts"]),
    )


@contextmanager
def _named_after(plan: Plan, unit: Unit) -> Iterator[None]:
    """Name training set and model in errors."""
    try:
        yield
    except SeakeepError as error:
        name = plan.training[unit.training].name
        raise DataError(f"training set '{name}', model '{unit.model}': {error}") from error


def tested_windows(plan: Plan, training: int, test: str) -> tuple[int, ...]:
    """Windows of a test set that a training set may be tested on."""
    where = plan.training[training]
    return tuple(k for k, w in enumerate(plan.tests[test]) if where.may_test(w.run))


def compute(plan: Plan, runs: Runs, unit: Unit, choice: Arrays | None = None) -> Arrays:
    """Fit a model, with the settings that were chosen, and forecast all windows."""
    training = plan.training[unit.training]
    with _named_after(plan, unit):
        fitted = fit_training(plan, runs, unit.model, training, choice=choice)
    ahead = (max(fitted.signature.lead_samples, 1) - 1) * plan.dt
    out: Arrays = {
        "chosen/words": np.array(getattr(fitted, "selection", "")),
        "chosen/look_ahead": np.array(ahead),
    }
    every = {test: tested_windows(plan, unit.training, test) for test in plan.tests}
    tested = {test: numbers for test, numbers in every.items() if numbers}
    spread = training_moments(plan, runs, training)[1]
    for test, numbers, series, lost, envelope in _series(plan, runs, fitted, tested):
        if plan.models[unit.model].is_ensemble:
            windows = [plan.tests[test][n] for n in numbers]
            measured, noise = measured_windows(plan, runs, windows), _noise(plan, runs, windows)
            shown = [k for k, n in enumerate(numbers) if plan.is_shown(unit.training, test, n)]
            pair = {"measured": measured, "training_std": spread, "noise_std": noise}
            found = _judged(series, lost, pair, shown, plan.level)
            found |= {"shown": np.array([numbers[k] for k in shown])} if shown else {}
            found |= {"envelope": envelope} if plan.scale == "learnt" else {}
            out |= {f"tests/{test}/{key}": each for key, each in found.items()}
        else:
            out[f"tests/{test}/mean"] = np.array(series[0])
    if plan.models[unit.model].is_ensemble:
        out["origin"] = np.array(json.dumps(fitted.origin))
    if plan.calibrated_on and plan.models[unit.model].is_ensemble:
        margins = band_margins(plan, runs, unit, fitted)
        out |= {f"calibration/{key}": np.asarray(value) for key, value in margins.items()}
    is_first = unit.training == units_of(plan)[0].training
    if plan.eigenvalues and is_first:
        values = _eigenvalues(fitted)
        out |= {"eigenvalues/real": values.real, "eigenvalues/imag": values.imag}
    if plan.nowcast and is_first and (is_ensemble(fitted) or hasattr(fitted, "live")):
        with _named_after(plan, unit):
            out |= _in_service(plan, runs, fitted, tested)
    return out


def _in_service(
    plan: Plan, runs: Runs, fitted: Any, tested: Mapping[str, tuple[int, ...]]
) -> Arrays:
    """Skill of a model in service against lead time, in the runs of the first test set."""
    test, numbers = next(iter(tested.items()))
    names = list(dict.fromkeys(plan.tests[test][k].run for k in numbers))
    steps = round(PERIODS * plan.encounter_period / plan.dt)
    model = fitted.hold() if is_ensemble(fitted) else fitted
    found = [nowcast(model, runs[name], steps, level=plan.level) for name in names]
    keys = ("error", "claimed", "coverage", "lead_time")
    out = {f"nowcast/{key}": np.stack([each[key].values for each in found]) for key in keys}
    starts = min(each.attrs["starts"] for each in found)
    return out | {"nowcast/run": np.array(names), "nowcast/starts": np.array(starts)}


def _under(arrays: Arrays, place: str) -> Arrays:
    """Arrays whose names start with a place, by the rest of their names."""
    return {k.removeprefix(place): v for k, v in arrays.items() if k.startswith(place)}


def _collect_nowcast(plan: Plan, found: Arrays) -> xr.Dataset:
    attrs = {"share": SHARE, "level": plan.level, "starts": int(found.pop("starts"))}
    names = found.pop("run").astype(object)
    skill = labelled_skill(found, plan.dt, plan.states, ("run",))
    return skill.assign_coords(run=names).assign_attrs(attrs)


def _series(
    plan: Plan, runs: Runs, fitted: Any, tested: Mapping[str, tuple[int, ...]]
) -> Iterator[tuple[str, tuple[int, ...], FloatArray, npt.NDArray[np.int64], FloatArray]]:
    """Free runs of all members over each test set, (member, window, steps, N), where lost, waves.

    Test sets of one length run side by side: what a free run prepares serves all of them.
    """
    batches: dict[int, list[str]] = {}
    for test in tested:
        batches.setdefault(plan.tests[test][0].steps, []).append(test)
    places = {
        test: [(plan.tests[test][k].run, plan.tests[test][k].start) for k in numbers]
        for test, numbers in tested.items()
    }
    groups = [([p for test in tests for p in places[test]], n) for n, tests in batches.items()]
    windows = read_groups(fitted.signature, runs, groups)
    with group_series(fitted, windows) as found:
        for (series, lost), tests, each in zip(found, batches.values(), windows, strict=True):
            envelope = envelope_of(fitted.signature, each)
            first = 0
            for test in tests:
                mine = slice(first, first + len(tested[test]))
                yield test, tested[test], series[:, mine], lost[:, mine], envelope[mine]
                first = mine.stop


def _judged(
    series: FloatArray,
    lost: npt.NDArray[np.int64],
    pair: Mapping[str, FloatArray],
    shown: Sequence[int],
    level: float,
) -> Arrays:
    """Statistics of the members of a test set, their errors, and those that figures show."""
    reduced = reduce_members(series, lost, level)
    out: Arrays = {key: reduced[:, row] for row, key in enumerate(STATISTICS)}
    out["lost"] = lost.T
    each = [metrics.nrmse(predicted=np.array(values), **pair) for values in series]
    out["member_nrmse"] = np.stack(each, axis=1).astype(np.float32)
    if shown:
        out["members"] = np.stack([series[:, row] for row in shown]).astype(np.float32)
    return out


def _after(run: xr.Dataset, window: TestWindow) -> slice:
    """Samples that a window forecasts."""
    at = int(np.argmin(np.abs(run["time"].values - window.start)))
    return slice(at + 1, at + 1 + window.steps)


def measured_windows(plan: Plan, runs: Runs, windows: Sequence[TestWindow]) -> FloatArray:
    """Measured states of windows, shape (window, steps, N)."""
    out = []
    for window in windows:
        run = runs[window.run]
        each = [run[name].values[_after(run, window)] for name in plan.states]
        out.append(np.stack(each, axis=-1).astype(float))
    return np.stack(out)


def training_parts(runs: Runs, training: TrainingSet) -> dict[str, xr.Dataset]:
    """The runs of a training set, cut to what may be read."""
    return {name: between(runs[name], (begin, stop)) for name, begin, stop in training.spans}


def fit_training(
    plan: Plan,
    runs: Runs,
    model: str,
    training: TrainingSet,
    origin: Json | None = None,
    choice: Arrays | None = None,
) -> Any:
    """Fit a model of the study to a training set.

    An ensemble may be chosen already, `origin`, or what its settings leave open, `choice`.
    """
    spec = plan.specs[model] if origin is None else plan.specs[model].from_json(origin)
    parts, states, inputs = training_parts(runs, training), list(plan.states), list(plan.inputs)
    if choice is not None and (open_spec := left_open(spec)) is not None:
        return open_spec.fit(parts, states, inputs, selected=_chosen(plan, choice))
    return spec.fit(parts, states, inputs)


def training_moments(plan: Plan, runs: Runs, training: TrainingSet) -> FloatArray:
    """Mean and standard deviation of the states over what a training set may read, shape (2, N).

    The same for all models, so that all are judged on the same channels.
    """
    parts = training_parts(runs, training).values()
    pooled = np.concatenate([[part[n].values for n in plan.states] for part in parts], axis=1)
    return np.stack([pooled.mean(axis=1), pooled.std(axis=1, ddof=1)])


def _eigenvalues(fitted: Any) -> npt.NDArray[np.complex128]:
    """Eigenvalues of a model, or of each member, in descending order of modulus."""
    values = [np.linalg.eigvals(matrix) for matrix in fitted.system_matrices()]
    padded = np.full((len(values), max(each.size for each in values)), complex(np.nan, np.nan))
    for row, each in enumerate(values):
        padded[row, : each.size] = each[np.argsort(-np.abs(each), kind="stable")]
    return padded


def band_margins(plan: Plan, runs: Runs, unit: Unit, fitted: Any) -> dict[str, Any]:
    """Find the band of an ensemble on windows as long as those of the first test set.

    The windows lie in the training spans, clear of what the members have read. Where these read
    all of it (runs left out, or pooled), each run is forecast by an ensemble that learnt from the
    others, with the settings that were chosen from all of them. No test window is looked at.
    """
    training = plan.training[unit.training]
    steps = next(iter(plan.tests.values()))[0].steps
    if training.left_out or len(training.runs) > 1:
        judged = _judged_by_others(plan, runs, unit, steps, fitted.origin)
    else:
        names = plan.calibrated_on
        parts = {name: between(runs[name], runs[name].attrs["train_span"]) for name in names}
        judged = list(held_out(fitted, parts, steps, plan.level).values())
    keys = ("margin", "blocks", "warranted")
    if judged:
        found, floor, law = found_margin(judged, plan.level, plan.scale)
        out = {key: getattr(found, key) for key in keys}
    else:
        floor = np.full(len(plan.states), np.nan)
        out, law = dict.fromkeys(keys, floor), np.tile(floor, (4, 1))
    out["windows"] = sum(len(each.measured) for each in judged)
    more = {"spread": {"floor": floor}, "learnt": {"floor": floor, "law": law}}
    return out | more.get(plan.scale, {})


def _judged_by_others(plan: Plan, runs: Runs, unit: Unit, steps: int, origin: Json) -> list[Judged]:
    """Forecasts of the runs of a training set, each by what the other ones teach."""
    training = plan.training[unit.training]
    groups = [each.left_out for each in plan.training if each is not training and each.left_out]
    judged: list[Judged] = []
    for group in groups or [(run,) for run in training.runs]:
        rest = tuple(span for span in training.spans if span[0] not in group)
        held = {n: between(runs[n], (b, e)) for n, b, e in training.spans if n in group}
        if rest and held:
            others = TrainingSet(f"{training.name}, calibration", rest)
            ensemble = fit_training(plan, runs, unit.model, others, origin)
            judged += held_out(ensemble, held, steps, plan.level).values()
    return judged


def collect(study: Study, plan: Plan, runs: Runs, read: Read) -> dict[str, xr.Dataset]:
    """Put all units together."""
    units = units_of(plan)
    found = {unit: read(unit) for unit in units}
    groups = {f"tests/{test}": _collect_test(study, plan, runs, found, test) for test in plan.tests}
    groups["chosen"] = _collect_chosen(plan, found)
    calibrations = []
    for model, each in plan.models.items():
        mine = {unit.training: arrays for unit, arrays in found.items() if unit.model == model}
        if each.is_ensemble:
            origin = json.loads(str(mine[min(mine)]["origin"]))
            groups[f"draws/{model}"] = draws_of(plan, runs, model, origin)
            if plan.calibrated_on:
                calibrations.append(_collect_calibration(plan, mine))
        first = units[0].training
        if skill := _under(mine.get(first, {}), "nowcast/"):
            groups[f"nowcast/{model}"] = _collect_nowcast(plan, skill)
        if plan.eigenvalues:
            parts = _under(mine[first], "eigenvalues/")
            groups[f"eigenvalues/{model}"] = xr.Dataset(
                {part: (("member", "mode"), values) for part, values in parts.items()},
                attrs={"training": plan.training[first].name, "dt": plan.dt},
            )
    if calibrations:
        groups["calibration"] = xr.concat(calibrations, xr.Variable("ensemble", plan.ensembles))
    return groups


def draws_of(plan: Plan, runs: Runs, model: str, origin: Json) -> xr.Dataset:
    """Draws of an ensemble: the same for every training set, all of which hold the largest.

    A λ that is drawn around one that was chosen is that of the first training set.
    """
    origin = {**origin, "readouts": []}  # not needed here, and slow to fit
    draws: xr.Dataset = fit_training(plan, runs, model, plan.training[0], origin).draws
    return draws


def _collect_test(
    study: Study, plan: Plan, runs: Runs, found: Mapping[Unit, Arrays], test: str
) -> xr.Dataset:
    windows, training = plan.tests[test], plan.training
    measured = measured_windows(plan, runs, windows)
    judged = np.array([[each.may_test(w.run) for w in windows] for each in training])
    moments = np.stack([training_moments(plan, runs, each) for each in training])
    dims = ("window", "time", "channel")
    variables: dict[str, Any] = {
        "measured": (dims, measured),
        "judged": (("training", "window"), judged),
        "start": ("window", np.array([w.start for w in windows])),
        "run": ("window", np.array([w.run for w in windows], dtype=object)),
        "training_mean": (("training", "channel"), moments[:, 0]),
        "training_std": (("training", "channel"), moments[:, 1]),
        "noise_std": (("window", "channel"), _noise(plan, runs, windows)),
    }
    if (heights := wave_heights(plan, runs, windows)) is not None:
        variables["wave_height"] = (("window", "time"), heights)
    truth = true_channels(study, plan, runs, test)
    if truth is not None:
        variables["truth"] = (dims, truth)
    arrays, shown = _forecasts(plan, found, test)
    frequency = 1.0 / (study.settings.statistics.split_period * plan.encounter_period)
    steps = windows[0].steps
    out = xr.Dataset(
        variables | {key: (DIMS[key], values) for key, values in arrays.items()},
        coords={
            "model": list(plan.models),
            "ensemble": plan.ensembles,
            "measure": list(MEASURES),
            "band": list(BANDS),
            "training": [each.name for each in training],
            "window": list(range(len(windows))),
            "time": ("time", plan.dt * np.arange(1, steps + 1), {"units": "s"}),
            "channel": list(plan.states),
            "shown": shown,
        },
    )
    return out.assign(_errors(out, plan.dt, frequency))


def _noise(plan: Plan, runs: Runs, windows: Sequence[TestWindow]) -> FloatArray:
    """SD of the noise of each channel in the run of each window."""
    return np.array(
        [[runs[w.run][c].attrs.get("noise_std", 0.0) for c in plan.states] for w in windows]
    )


def wave_heights(plan: Plan, runs: Runs, windows: Sequence[TestWindow]) -> FloatArray | None:
    """Twice the envelope of the first elevation in windows, (window, time), or None."""
    name = next((name for name in plan.inputs if is_elevation(name)), None)
    if name is None:
        return None
    out = []
    for window in windows:
        run = runs[window.run]
        elevation = run[name].values.astype(float)
        known = np.flatnonzero(np.isfinite(elevation))  # gaps at the ends of a record
        heights = np.full(elevation.size, np.nan)
        part = slice(known[0], known[-1] + 1)
        heights[part] = 2.0 * np.sqrt(envelope_squared(elevation[part], plan.dt))
        out.append(heights[_after(run, window)])
    return np.stack(out)


def _forecasts(plan: Plan, found: Mapping[Unit, Arrays], test: str) -> tuple[Arrays, list[int]]:
    """Arrays of :data:`DIMS`, and the windows whose members are shown.

    NaN, or −2 of losses, where none is tested and beyond the members of a smaller ensemble.
    """
    windows, sets = range(len(plan.tests[test])), range(len(plan.training))
    owners = {"model": list(plan.models), "ensemble": plan.ensembles}
    shown = [k for k in windows if any(plan.is_shown(t, test, k) for t in sets)]
    sizes = {
        **{dim: len(names) for dim, names in owners.items()},
        "training": len(sets),
        "window": len(windows),
        "shown": len(shown),
        "member": max(each.n_members for each in plan.models.values()),
        "time": plan.tests[test][0].steps,
        "channel": len(plan.states),
    }
    out: Arrays = {}
    for unit, cells in found.items():
        numbers = list(tested_windows(plan, unit.training, test))
        part = _under(cells, f"tests/{test}/")
        drawn = [shown.index(k) for k in part.pop("shown", np.array([])).tolist()]
        for key, values in part.items():
            if key not in out:
                empty = np.nan if values.dtype.kind == "f" else -2
                size = [sizes[dim] for dim in DIMS[key]]
                out[key] = np.full(size, empty, dtype=values.dtype)
            place = out[key][owners[DIMS[key][0]].index(unit.model)]
            rows, place = (drawn, place) if key == "members" else (numbers, place[unit.training])
            place[rows, : values.shape[1]] = values
    return out, shown


def _errors(test: xr.Dataset, dt: float, frequency: float) -> dict[str, Any]:
    """Error measures of each (mean) forecast in every cell; bands meet at `frequency`, Hz."""
    forecasts, measured = test["mean"].values, test["measured"].values
    shape = forecasts.shape
    errors = np.full((shape[0], len(MEASURES), *shape[1:3], shape[4]), np.nan)
    over_time = np.full((shape[0], len(BANDS), *shape[1:4]), np.nan)
    for model, training in np.ndindex(shape[:2]):
        pair = {
            "predicted": forecasts[model, training],
            "measured": measured,
            "training_std": test["training_std"].values[training],
            "noise_std": test["noise_std"].values,
        }
        errors[model, :, training] = (
            metrics.nrmse(**pair),
            metrics.normalised_extremes_error(**pair),
            metrics.root_mean_square(pair["predicted"] - measured) / pair["training_std"],
        )
        bands = band_error_over_time(**pair, dt=dt, frequency=frequency)
        over_time[model, :, training] = metrics.error_over_time(**pair), *bands
    return {
        "error": (("model", "measure", "training", "window", "channel"), errors),
        "error_over_time": (("model", "band", "training", "window", "time"), over_time),
    }


def true_channels(study: Study, plan: Plan, runs: Runs, test: str) -> FloatArray | None:
    """Return true states at the instants of the windows, where the study names a folder of them."""
    folder = study.truth_folder
    if folder is None:
        return None
    truths = {}
    for run in dict.fromkeys(window.run for window in plan.tests[test]):
        path = folder / f"{run}.nc"
        if not path.exists():
            raise DataError(
                f"the study names the folder {folder} of true channels, and {path.name} is not in "
                "it. Play the tank again, or leave study.truth out."
            )
        truths[run] = opened_netcdf(path)
    out = []
    for window in plan.tests[test]:
        true = truths[window.run]
        time = window.start + plan.dt * np.arange(1, window.steps + 1)
        each: FloatArray = np.full((window.steps, len(plan.states)), np.nan)
        for k, name in enumerate(plan.states):
            if name in true:
                each[:, k] = np.interp(time, true["time"].values, true[name].values)
        out.append(each)
    return np.stack(out)


def _collect_chosen(plan: Plan, found: Mapping[Unit, Arrays]) -> xr.Dataset:
    """How settings were chosen on each training set, and how far each model looks ahead."""
    sets = sorted({unit.training for unit in found})
    words, ahead = (
        [[found[Unit(model, k)][f"chosen/{key}"].item() for k in sets] for model in plan.models]
        for key in ("words", "look_ahead")
    )
    long_name = "waves read after the instant that is forecast"
    dims = ("model", "training")
    return xr.Dataset(
        {
            "words": (dims, words),
            "look_ahead": (dims, ahead, {"units": "s", "long_name": long_name}),
        },
        coords={"model": list(plan.models), "training": [plan.training[k].name for k in sets]},
    )


def _collect_calibration(plan: Plan, found: Mapping[int, Arrays]) -> xr.Dataset:
    """Margins over the training sets; NaN of those that no window tests."""
    margins = {k: _under(arrays, "calibration/") for k, arrays in found.items()}
    variables = {}
    for name, first in next(iter(margins.values())).items():
        nothing = np.full_like(first, np.nan if first.dtype.kind == "f" else 0)
        rows = [margins.get(k, {name: nothing})[name] for k in range(len(plan.training))]
        dims = ((), ("channel",), ("term", "channel"))[first.ndim]
        variables[name] = (("training", *dims), np.stack(rows))
    return xr.Dataset(
        variables,
        coords={"training": [each.name for each in plan.training], "channel": list(plan.states)},
        attrs={"level": plan.level},
    )
