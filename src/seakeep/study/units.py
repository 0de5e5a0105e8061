"""The work of a study: one model of one training set on all windows that it may be tested on.

Such a unit is computed as a whole and kept in one file, so that its arrays are the same to the last
bit whether or not a study was interrupted, and whatever the number of workers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.core import metrics
from seakeep.core.bands import band_error_over_time
from seakeep.core.calibration import conformal_margin
from seakeep.errors import DataError, SeakeepError
from seakeep.models import HankelDMDcModel
from seakeep.models.alignment import FittedAlignment
from seakeep.models.calibration import held_out_scores
from seakeep.models.fitted_ensemble import HankelEnsemble
from seakeep.models.shelf import Layout, Shelf, open_shelf
from seakeep.models.summaries import STATISTICS, first_lost, reduce_members
from seakeep.models.windows import free_runs
from seakeep.study.judge import BAND_ERRORS
from seakeep.study.plan import Plan, TestWindow, TrainingSet, between
from seakeep.study.settings import Study

__all__ = ["Unit", "collect", "compute", "fit_training", "units_of"]

Runs = Mapping[str, xr.Dataset]
Arrays = dict[str, npt.NDArray[Any]]
Read = Callable[["Unit"], Arrays]

DIMS = {
    "mean": ("time", "channel"),
    "std": ("time", "channel"),
    "lower": ("time", "channel"),
    "upper": ("time", "channel"),
    "lost": ("member",),
    "member_nrmse": ("member", "channel"),
    "member_nammae": ("member", "channel"),
}
"""Dimensions of the arrays of a window, after (training, window)."""


@dataclass(frozen=True)
class Unit:
    """A model and the number of a training set: what one worker does at a time."""

    model: str
    training: int

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"{self.model}.t{self.training:02d}"


def units_of(plan: Plan) -> list[Unit]:
    """All that there is to do, in an order that shows something early."""
    return [
        Unit(model, training)
        for training in range(len(plan.training))
        for model in plan.models
        if any(tested_windows(plan, training, test) for test in plan.tests)
    ]


def tested_windows(plan: Plan, training: int, test: str) -> tuple[int, ...]:
    """Windows of a test set that a training set may be tested on."""
    where = plan.training[training]
    return tuple(k for k, w in enumerate(plan.tests[test]) if where.may_test(w.run))


def compute(plan: Plan, runs: Runs, unit: Unit) -> Arrays:
    """Fit a model and forecast all windows."""
    training = plan.training[unit.training]
    try:
        fitted = fit_training(plan, runs, unit.model, training)
    except SeakeepError as error:
        raise DataError(f"training set '{training.name}', model '{unit.model}': {error}") from error
    groups = {
        test: window_arrays(plan, runs, plan.tests[test], numbers, fitted.alignment)
        for test in plan.tests
        if (numbers := tested_windows(plan, unit.training, test))
    }
    out: Arrays = {}
    if isinstance(fitted, HankelDMDcModel):
        for test, windows in groups.items():
            out[f"tests/{test}/mean"] = _forecast(fitted, runs, windows)
    else:
        spread = training_moments(plan, runs, training)[1]
        out |= _ensemble_arrays(plan, runs, fitted, unit, groups, spread)
        if plan.calibrated_on:
            found = calibration_arrays(plan, runs, unit, fitted)
            out |= {f"calibration/{key}": np.asarray(value) for key, value in found.items()}
    if plan.eigenvalues and unit.training == units_of(plan)[0].training:
        values = _eigenvalues(fitted)
        out |= {"eigenvalues/real": values.real, "eigenvalues/imag": values.imag}
    return out


@dataclass(frozen=True, eq=False)
class Windows:
    """Measured samples of the windows of a test set, side by side.

    Parameters
    ----------
    numbers : tuple of int
        Windows of the set.
    places : tuple of (str, float)
        Run and start of each, s.
    histories : ndarray, shape (window, history, N)
        States up to each start.
    inputs : ndarray, shape (window, history + steps − 1, Q)
        Inputs from the first of these on.
    measured : ndarray, shape (window, steps, N)
        States to be forecast.
    """

    numbers: tuple[int, ...]
    places: tuple[tuple[str, float], ...]
    histories: FloatArray
    inputs: FloatArray
    measured: FloatArray


def window_arrays(
    plan: Plan,
    runs: Runs,
    windows: tuple[TestWindow, ...],
    numbers: tuple[int, ...],
    alignment: FittedAlignment | None = None,
) -> Windows:
    """Cut the windows of a test set out of the runs."""
    histories, inputs, measured, places = [], [], [], []
    reach = plan.needs.history
    for number in numbers:
        window = windows[number]
        run = runs[window.run]
        at = int(np.argmin(np.abs(run["time"].values - window.start)))
        x, u = (
            np.stack([run[n].values for n in names], axis=-1).astype(float)
            if names
            else np.zeros((run.sizes["time"], 0))
            for names in (plan.states, plan.inputs)
        )
        histories.append(x[at - reach : at + 1])
        needed = slice(at - reach, at + window.steps)
        if alignment is None or alignment.settings.surge == "predicted":
            inputs.append(u[needed])
        else:
            inputs.append(alignment.aligned(run, list(plan.inputs), window.run, needed))
        places.append((window.run, window.start))
        measured.append(x[at + 1 : at + 1 + window.steps])
    return Windows(
        numbers, tuple(places), np.stack(histories), np.stack(inputs), np.stack(measured)
    )


def fit_training(
    plan: Plan, runs: Runs, model: str, training: TrainingSet
) -> HankelDMDcModel | HankelEnsemble:
    """Fit a model of the study to a training set."""
    parts = {name: between(runs[name], (begin, stop)) for name, begin, stop in training.spans}
    return plan.specs[model].fit(parts, list(plan.states), list(plan.inputs))


def _forecast(model: HankelDMDcModel, runs: Runs, windows: Windows) -> FloatArray:
    """Free runs over all windows, shape (window, steps, N), physical units."""
    if model.alignment is not None and model.alignment.settings.surge == "predicted":
        steps = windows.measured.shape[1]
        forecasts = [model.forecast(runs[run], start, steps) for run, start in windows.places]
        return np.stack(
            [np.stack([each[n].values for n in model.states], axis=-1) for each in forecasts]
        )
    steps = windows.measured.shape[1]
    return free_runs(model, windows.histories, windows.inputs, steps)


def training_moments(plan: Plan, runs: Runs, training: TrainingSet) -> FloatArray:
    """Mean and standard deviation of the states over what a training set may read, shape (2, N).

    The same for all models, so that all are judged on the same channels.
    """
    parts = [between(runs[name], (begin, stop)) for name, begin, stop in training.spans]
    pooled = np.concatenate([[part[n].values for n in plan.states] for part in parts], axis=1)
    return np.stack([pooled.mean(axis=1), pooled.std(axis=1, ddof=1)])


def _batches(groups: Mapping[str, Windows]) -> list[tuple[list[str], Windows]]:
    """Test sets of the same length side by side: what a free run prepares serves all of them."""
    lengths: dict[int, list[str]] = {}
    for test, windows in groups.items():
        lengths.setdefault(windows.measured.shape[1], []).append(test)
    return [
        (
            tests,
            Windows(
                tuple(n for test in tests for n in groups[test].numbers),
                tuple(place for test in tests for place in groups[test].places),
                np.concatenate([groups[test].histories for test in tests]),
                np.concatenate([groups[test].inputs for test in tests]),
                np.concatenate([groups[test].measured for test in tests]),
            ),
        )
        for tests in lengths.values()
    ]


def _ensemble_arrays(
    plan: Plan,
    runs: Runs,
    ensemble: HankelEnsemble,
    unit: Unit,
    groups: Mapping[str, Windows],
    spread: FloatArray,
) -> Arrays:
    """Each member is identified once and forecasts all windows; then each window is reduced."""
    count, batches = ensemble.n_members, _batches(groups)
    out: Arrays = {}
    with ExitStack() as stack:
        tables = {
            test: stack.enter_context(_table(plan, unit, test, windows, spread, count))
            for test, windows in groups.items()
        }
        for number in range(count):
            member = ensemble.member(number)
            for tests, windows in batches:
                values = _forecast(member, runs, windows)
                edges = np.cumsum([len(groups[test].numbers) for test in tests])[:-1]
                for test, part in zip(tests, np.split(values, edges), strict=True):
                    tables[test].put(number, part)
        for test, table in tables.items():
            out |= {f"tests/{test}/{key}": each for key, each in table.arrays(plan.level).items()}
    return out


@dataclass(frozen=True)
class _Table:
    """What becomes of the members of a test set, one after the other; their series on a shelf."""

    windows: Windows
    spread: FloatArray
    shown: Mapping[int, int]
    shelf: Shelf
    lost: npt.NDArray[np.int64]
    judged: Mapping[str, npt.NDArray[np.float32]]
    members: npt.NDArray[np.float32]

    def put(self, number: int, values: FloatArray) -> None:
        """Judge a member's free runs, shape (window, steps, N), and put them away."""
        pair = {"measured": self.windows.measured, "training_std": self.spread}
        self.lost[number] = first_lost(values)
        self.judged["member_nrmse"][number] = metrics.nrmse(predicted=values, **pair)
        self.judged["member_nammae"][number] = metrics.normalised_extremes_error(
            predicted=values, **pair
        )
        for place, row in enumerate(self.shown):
            self.members[place, number] = values[row]
        self.shelf.put(number, values)

    def arrays(self, level: float) -> Arrays:
        """All of the windows, by what they are."""
        reduced = reduce_members(self.shelf, self.lost, level)
        out: Arrays = {key: reduced[:, row] for row, key in enumerate(STATISTICS)}
        out["lost"] = self.lost.T
        out |= {key: np.swapaxes(each, 0, 1) for key, each in self.judged.items()}
        if self.shown:
            out["members"] = self.members
            out["shown"] = np.array([self.windows.numbers[row] for row in self.shown])
        return out


@contextmanager
def _table(
    plan: Plan, unit: Unit, test: str, windows: Windows, spread: FloatArray, members: int
) -> Iterator[_Table]:
    count, *size = windows.measured.shape
    rows = [k for k, n in enumerate(windows.numbers) if plan.is_shown(unit.training, test, n)]
    with open_shelf(Layout.in_pieces(count, members, *size)) as shelf:
        yield _Table(
            windows=windows,
            spread=spread,
            shown={row: place for place, row in enumerate(rows)},
            shelf=shelf,
            lost=np.empty((members, count), dtype=np.int64),
            judged={
                key: np.empty((members, count, size[1]), dtype=np.float32)
                for key in ("member_nrmse", "member_nammae")
            },
            members=np.empty((len(rows), members, *size), dtype=np.float32),
        )


def _eigenvalues(fitted: HankelDMDcModel | HankelEnsemble) -> npt.NDArray[np.complex128]:
    """Eigenvalues of a model, or of each member, in descending order of modulus."""
    if isinstance(fitted, HankelDMDcModel):
        matrices: Iterator[FloatArray] = iter([fitted.A])
    else:
        matrices = (fitted.member(k).A for k in range(fitted.n_members))
    values = [np.linalg.eigvals(matrix) for matrix in matrices]
    padded = np.full((len(values), max(each.size for each in values)), complex(np.nan, np.nan))
    for row, each in enumerate(values):
        padded[row, : each.size] = each[np.argsort(-np.abs(each), kind="stable")]
    return padded


def calibration_arrays(
    plan: Plan, runs: Runs, unit: Unit, fitted: HankelEnsemble
) -> dict[str, Any]:
    """Find the margins of an ensemble on windows as long as those of the first test set.

    The windows lie in the training spans, clear of what the members have read. Where these read
    all of it (runs left out, or pooled), each run is forecast by an ensemble that learnt from the
    others. No test window is looked at.
    """
    training = plan.training[unit.training]
    steps = next(iter(plan.tests.values()))[0].steps
    if training.left_out or len(training.runs) > 1:
        scores = _scores_of_others(plan, runs, unit, steps)
    else:
        names = plan.calibrated_on
        parts = {name: between(runs[name], runs[name].attrs["train_span"]) for name in names}
        scores = list(held_out_scores(fitted, parts, steps, plan.level).values())
    if not scores:
        nothing = np.full(len(plan.states), np.nan)
        return {"margin": nothing, "blocks": nothing, "warranted": nothing, "windows": 0}
    every = np.concatenate(scores)
    found = conformal_margin(every, plan.level)
    return {
        "margin": found.margin,
        "blocks": found.blocks,
        "warranted": found.warranted,
        "windows": len(every),
    }


def _scores_of_others(plan: Plan, runs: Runs, unit: Unit, steps: int) -> list[FloatArray]:
    """Scores in the runs of a training set, each by what the other ones teach."""
    training = plan.training[unit.training]
    groups = [each.left_out for each in plan.training if each is not training and each.left_out]
    scores: list[FloatArray] = []
    for group in groups or [(run,) for run in training.runs]:
        rest = tuple(span for span in training.spans if span[0] not in group)
        held = {n: between(runs[n], (b, e)) for n, b, e in training.spans if n in group}
        if rest and held:
            others = TrainingSet(f"{training.name}, calibration", rest)
            ensemble = cast("HankelEnsemble", fit_training(plan, runs, unit.model, others))
            scores += held_out_scores(ensemble, held, steps, plan.level).values()
    return scores


def collect(study: Study, plan: Plan, runs: Runs, read: Read) -> dict[str, xr.Dataset]:
    """Put all units together."""
    units = units_of(plan)
    found = {unit: read(unit) for unit in units}
    groups = {f"tests/{test}": _collect_test(study, plan, runs, found, test) for test in plan.tests}
    for model, each in plan.models.items():
        mine = {unit.training: arrays for unit, arrays in found.items() if unit.model == model}
        if each.is_ensemble:
            groups[f"draws/{model}"] = draws_of(plan, runs, model)
            if plan.calibrated_on:
                groups[f"calibration/{model}"] = _collect_calibration(plan, mine)
        if plan.eigenvalues:
            first = units[0].training
            groups[f"eigenvalues/{model}"] = xr.Dataset(
                {
                    part: (("member", "mode"), mine[first][f"eigenvalues/{part}"])
                    for part in ("real", "imag")
                },
                attrs={"training": plan.training[first].name, "dt": plan.dt},
            )
    return groups


def draws_of(plan: Plan, runs: Runs, model: str) -> xr.Dataset:
    """Draws of an ensemble: the same for every training set, all of which hold the largest."""
    ensemble = fit_training(plan, runs, model, plan.training[0])
    assert isinstance(ensemble, HankelEnsemble)
    return ensemble.draws


def _collect_test(
    study: Study, plan: Plan, runs: Runs, found: Mapping[Unit, Arrays], test: str
) -> xr.Dataset:
    windows, training = plan.tests[test], plan.training
    everything = tuple(range(len(windows)))
    measured = window_arrays(plan, runs, windows, everything).measured
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
    }
    truth = true_channels(study, plan, runs, test)
    if truth is not None:
        variables["truth"] = (dims, truth)
    for model in plan.specs:
        variables.update(_collect_model(plan, found, test, model))
    steps = windows[0].steps
    out = xr.Dataset(
        variables,
        coords={
            "training": [each.name for each in training],
            "window": list(everything),
            "time": ("time", plan.dt * np.arange(1, steps + 1), {"units": "s"}),
            "channel": list(plan.states),
        },
    )
    frequency = 1.0 / (study.settings.statistics.split_period * plan.encounter_period)
    for model in plan.specs:
        _add_errors(out, model, plan.dt, frequency)
    return out


def _collect_model(
    plan: Plan, found: Mapping[Unit, Arrays], test: str, model: str
) -> dict[str, Any]:
    """Arrays of a model over (training, window, …); NaN, or −2 of losses, where none is tested."""
    size = (len(plan.training), len(plan.tests[test]))
    arrays: Arrays = {}
    members: dict[int, FloatArray] = {}
    for unit, cells in found.items():
        numbers = list(tested_windows(plan, unit.training, test))
        if unit.model != model or not numbers:
            continue
        part = {k.rpartition("/")[2]: v for k, v in cells.items() if k.startswith(f"tests/{test}/")}
        shown = part.pop("shown", np.array([], dtype=int))
        members |= dict(zip(shown.tolist(), part.pop("members", []), strict=True))
        for key, values in part.items():
            if key not in arrays:
                empty = np.nan if values.dtype.kind == "f" else -2
                arrays[key] = np.full((*size, *values.shape[1:]), empty, dtype=values.dtype)
            arrays[key][unit.training, numbers] = values
    out: dict[str, Any] = {
        f"{model}_{key}": (("training", "window", *DIMS[key]), values)
        for key, values in arrays.items()
    }
    if members:
        in_order = sorted(members)
        out[f"{model}_members"] = (
            ("shown", "member", "time", "channel"),
            np.stack([members[number] for number in in_order]),
        )
        out["shown"] = ("shown", np.array(in_order))
    return out


def _add_errors(out: xr.Dataset, model: str, dt: float, frequency: float) -> None:
    """Error measures of a model's (mean) forecast in every cell; bands meet at `frequency`, Hz."""
    predicted = out[f"{model}_mean"].values
    measured = np.broadcast_to(out["measured"].values, predicted.shape)
    shape = predicted.shape
    results = {
        "nrmse": np.full((*shape[:2], shape[3]), np.nan),
        "nammae": np.full((*shape[:2], shape[3]), np.nan),
        **{BAND_ERRORS[band]: np.full(shape[:3], np.nan) for band in BAND_ERRORS},
    }
    for training in range(shape[0]):
        pair = {
            "predicted": predicted[training],
            "measured": measured[training],
            "training_std": out["training_std"].values[training],
        }
        results["nrmse"][training] = metrics.nrmse(**pair)
        results["nammae"][training] = metrics.normalised_extremes_error(**pair)
        results["error_over_time"][training] = metrics.error_over_time(**pair)
        bands = band_error_over_time(**pair, dt=dt, frequency=frequency)
        results["error_low"][training], results["error_wave"][training] = bands
    dims = ("training", "window")
    out[f"{model}_nrmse"] = ((*dims, "channel"), results["nrmse"])
    out[f"{model}_nammae"] = ((*dims, "channel"), results["nammae"])
    for key in BAND_ERRORS.values():
        out[f"{model}_{key}"] = ((*dims, "time"), results[key])


def true_channels(study: Study, plan: Plan, runs: Runs, test: str) -> FloatArray | None:
    """Return true states at the instants of the windows, where the study names a folder of them."""
    folder = study.truth_folder
    if folder is None:
        return None
    out = []
    for window in plan.tests[test]:
        path = folder / f"{window.run}.nc"
        if not path.exists():
            raise DataError(
                f"the study names the folder {folder} of true channels, and {path.name} is not in "
                "it. Play the tank again, or leave study.truth out."
            )
        with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as opened:
            known = [name for name in plan.states if name in opened]
            true = opened[known].load()
        time = window.start + plan.dt * np.arange(1, window.steps + 1)
        out.append(
            np.stack(
                [
                    np.interp(time, true["time"].values, true[name].values)
                    if name in known
                    else np.full(time.size, np.nan)
                    for name in plan.states
                ],
                axis=-1,
            )
        )
    return np.stack(out)


def _collect_calibration(plan: Plan, found: Mapping[int, Arrays]) -> xr.Dataset:
    """Margins over the training sets; NaN of those that no window tests."""
    names = [key for key in next(iter(found.values())) if key.startswith("calibration/")]
    variables = {}
    for name in names:
        first = next(iter(found.values()))[name]
        nothing = np.full_like(first, np.nan if first.dtype.kind == "f" else 0)
        rows = [found[k][name] if k in found else nothing for k in range(len(plan.training))]
        dims = ("training", "channel")[: first.ndim + 1]
        variables[name.removeprefix("calibration/")] = (dims, np.stack(rows))
    return xr.Dataset(
        variables,
        coords={"training": [each.name for each in plan.training], "channel": list(plan.states)},
        attrs={"level": plan.level},
    )
