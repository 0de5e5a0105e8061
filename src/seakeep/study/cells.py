"""The work of a study: models of one training set, forecasts of all windows they may be tested on.

Windows of a test set are forecast side by side. A unit is always computed as a whole, so that its
arrays are the same to the last bit whether or not a study was interrupted, and whatever the number
of workers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core import metrics
from seakeep.errors import DataError, SeakeepError
from seakeep.models import HankelDMDc, HankelDMDcModel
from seakeep.models.alignment import FittedAlignment
from seakeep.models.fitted_ensemble import HankelEnsemble
from seakeep.models.shelf import Layout, Shelf, open_shelf
from seakeep.models.summaries import STATISTICS, first_lost, reduce_members
from seakeep.models.windows import free_runs
from seakeep.study.calibration import calibration_arrays, calibration_name
from seakeep.study.plan import Plan
from seakeep.study.windows import TestWindow, TrainingSet
from seakeep.study.workflow import between

__all__ = ["Unit", "Windows", "cell_name", "cells_of", "compute", "units_of", "window_arrays"]

FloatArray = npt.NDArray[np.float64]
Runs = Mapping[str, xr.Dataset]
Write = Callable[[str, dict[str, Any]], None]

EIGENVALUES_AT_ONCE = 10
"""Members whose eigenvalues make one unit; a dense matrix of 363 rows takes about 0.2 s."""


@dataclass(frozen=True)
class Unit:
    """A piece of work that one worker does at a time.

    Parameters
    ----------
    kind : {"cells", "eigenvalues"}
        Forecasts, or eigenvalues of members.
    model : str
        The model.
    training : int
        Number of the training set.
    first : int
        First member, for eigenvalues.
    """

    kind: str
    model: str
    training: int
    first: int = 0


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
    """Cut the windows of a test set out of the runs.

    Parameters
    ----------
    plan : Plan
        The study.
    runs : mapping of str to Dataset
        Prepared runs.
    windows : tuple of TestWindow
        The set.
    numbers : tuple of int
        Those of its windows that are wanted.
    alignment : FittedAlignment, optional
        Replaces the inputs by aligned ones; not one by predicted surge, which the forecast makes.

    Returns
    -------
    Windows
        In that order.
    """
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


def cell_name(model: str, training: int, test: str, window: int) -> str:
    """Name of a cell's file."""
    return f"{model}.t{training:02d}.{test}.w{window:03d}"


def eigenvalue_name(unit: Unit) -> str:
    """Name of the file with the eigenvalues of some members."""
    return f"{unit.model}.eigenvalues.m{unit.first:04d}"


def _numbers(plan: Plan, training: int, test: str) -> tuple[int, ...]:
    """Windows of a test set that a training set may be tested on."""
    where = plan.training[training]
    return tuple(k for k, w in enumerate(plan.tests[test]) if where.may_test(w.run))


def units_of(plan: Plan, eigenvalues: bool) -> list[Unit]:
    """All that there is to do, in an order that shows something early.

    Parameters
    ----------
    plan : Plan
        The study.
    eigenvalues : bool
        Whether those of the members of each ensemble's first training set are wanted.

    Returns
    -------
    list of Unit
    """
    units = [
        Unit("cells", model, training)
        for training in range(len(plan.training))
        for model in plan.specs
        if any(_numbers(plan, training, test) for test in plan.tests)
    ]
    if eigenvalues:
        units += [
            Unit("eigenvalues", model, 0, first)
            for model in plan.specs
            for first in range(0, members_of(plan, model), EIGENVALUES_AT_ONCE)
        ]
    return units


def members_of(plan: Plan, model: str) -> int:
    """Number of members, 1 of a single model."""
    spec = plan.specs[model]
    return 1 if isinstance(spec, HankelDMDc) else int(spec.n_members)


def cells_of(plan: Plan, unit: Unit) -> list[str]:
    """Names of the files that a unit leaves behind."""
    if unit.kind == "eigenvalues":
        return [eigenvalue_name(unit)]
    names = [
        cell_name(unit.model, unit.training, test, number)
        for test in plan.tests
        for number in _numbers(plan, unit.training, test)
    ]
    if plan.calibrated_on and plan.is_ensemble(unit.model):
        names.append(calibration_name(unit.model, unit.training))
    return names


def compute(plan: Plan, runs: Runs, unit: Unit, write: Write) -> None:
    """Do a unit and write its cells.

    Parameters
    ----------
    plan : Plan
        The study.
    runs : mapping of str to Dataset
        Prepared runs.
    unit : Unit
        What to do.
    write : callable
        Called as ``write(name, arrays)`` for each cell.

    Raises
    ------
    DataError
        If the training set cannot be used; the message names it.
    """
    training = plan.training[unit.training]
    try:
        fitted = fit_training(plan, runs, unit.model, training)
    except SeakeepError as error:
        raise DataError(f"training set '{training.name}', model '{unit.model}': {error}") from error
    if unit.kind == "eigenvalues":
        _eigenvalues(plan, fitted, unit, write)
        return
    groups = {
        test: window_arrays(plan, runs, plan.tests[test], numbers, fitted.alignment)
        for test in plan.tests
        if (numbers := _numbers(plan, unit.training, test))
    }
    if isinstance(fitted, HankelDMDcModel):
        _single_cells(runs, fitted, unit, groups, write)
    else:
        spread = training_moments(plan, runs, training)[1]
        _ensemble_cells(plan, runs, fitted, unit, groups, spread, write)
        if plan.calibrated_on:

            def fit(part: TrainingSet) -> HankelEnsemble:
                return cast("HankelEnsemble", fit_training(plan, runs, unit.model, part))

            found = calibration_arrays(plan, runs, training, fitted, fit)
            write(calibration_name(unit.model, unit.training), found)


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


def _single_cells(
    runs: Runs, model: HankelDMDcModel, unit: Unit, groups: Mapping[str, Windows], write: Write
) -> None:
    for test, windows in groups.items():
        values = _forecast(model, runs, windows)
        for row, number in enumerate(windows.numbers):
            name = cell_name(unit.model, unit.training, test, number)
            write(name, {"mean": values[row]})


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


def _ensemble_cells(
    plan: Plan,
    runs: Runs,
    ensemble: HankelEnsemble,
    unit: Unit,
    groups: Mapping[str, Windows],
    spread: FloatArray,
    write: Write,
) -> None:
    """Each member is identified once and forecasts all windows; then each cell is reduced."""
    count, batches = ensemble.n_members, _batches(groups)
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
            for window, arrays in table.cells(plan.level):
                write(cell_name(unit.model, unit.training, test, window), arrays)


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

    def cells(self, level: float) -> Iterator[tuple[int, dict[str, Any]]]:
        """Number and arrays of each window."""
        reduced = reduce_members(self.shelf, self.lost, level)
        for row, window in enumerate(self.windows.numbers):
            arrays: dict[str, Any] = dict(zip(STATISTICS, reduced[row], strict=True))
            arrays["lost"] = self.lost[:, row]
            arrays |= {key: each[:, row] for key, each in self.judged.items()}
            if row in self.shown:
                arrays["members"] = self.members[self.shown[row]]
            yield window, arrays


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


def _eigenvalues(
    plan: Plan, fitted: HankelDMDcModel | HankelEnsemble, unit: Unit, write: Write
) -> None:
    if isinstance(fitted, HankelDMDcModel):
        matrices = [fitted.A]
    else:
        last = min(unit.first + EIGENVALUES_AT_ONCE, members_of(plan, unit.model))
        matrices = [fitted.member(k).A for k in range(unit.first, last)]
    values = [np.linalg.eigvals(matrix) for matrix in matrices]
    size = max(each.size for each in values)
    padded = np.full((len(values), size), np.nan + 0j)
    for row, each in enumerate(values):
        padded[row, : each.size] = each[np.argsort(-np.abs(each), kind="stable")]
    write(eigenvalue_name(unit), {"real": padded.real, "imag": padded.imag})
