"""From finished cells to labelled arrays."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core import metrics
from seakeep.core.bands import band_error_over_time
from seakeep.errors import DataError, SeakeepError
from seakeep.models.fitted_ensemble import HankelEnsemble
from seakeep.study.calibration import calibration_name
from seakeep.study.cells import (
    Unit,
    cell_name,
    eigenvalue_name,
    fit_training,
    members_of,
    training_moments,
    units_of,
    window_arrays,
)
from seakeep.study.plan import Plan
from seakeep.study.settings import Study
from seakeep.study.store import CellFolder

__all__ = ["BAND_ERRORS", "merge_cells"]

Runs = Mapping[str, xr.Dataset]
FloatArray = npt.NDArray[np.float64]

BAND_ERRORS = {"all": "error_over_time", "low": "error_low", "wave": "error_wave"}
"""Names of ε(t), as a whole and in its two bands."""

CELL_DIMS = {
    "mean": ("time", "channel"),
    "std": ("time", "channel"),
    "lower": ("time", "channel"),
    "upper": ("time", "channel"),
    "lost": ("member",),
    "member_nrmse": ("member", "channel"),
    "member_nammae": ("member", "channel"),
}


def merge_cells(study: Study, plan: Plan, runs: Runs, cells: CellFolder) -> dict[str, xr.Dataset]:
    """Put all cells together.

    Parameters
    ----------
    study : Study
        The study.
    plan : Plan
        What was to be done.
    runs : mapping of str to Dataset
        Prepared runs.
    cells : CellFolder
        Finished cells.

    Returns
    -------
    dict of str to Dataset
        ``tests/NAME`` with the arrays of every model over (training, window, …), and
        ``draws/MODEL``, ``calibration/MODEL`` and ``eigenvalues/MODEL`` of ensembles.

    Raises
    ------
    SeakeepError
        If a cell is missing.
    """
    groups = {f"tests/{test}": _merge_test(study, plan, runs, cells, test) for test in plan.tests}
    for model in plan.specs:
        if plan.is_ensemble(model):
            groups[f"draws/{model}"] = draws_of(plan, runs, model)
            if plan.calibrated_on:
                groups[f"calibration/{model}"] = _merge_calibration(plan, cells, model)
        if study.settings.output.eigenvalues:
            groups[f"eigenvalues/{model}"] = _merge_eigenvalues(plan, cells, model)
    return groups


def draws_of(plan: Plan, runs: Runs, model: str) -> xr.Dataset:
    """Draws of an ensemble: the same for every training set, all of which hold the largest."""
    ensemble = fit_training(plan, runs, model, plan.training[0])
    assert isinstance(ensemble, HankelEnsemble)
    return ensemble.draws


def _cell(cells: CellFolder, name: str) -> dict[str, Any]:
    found = cells.read(name)
    if found is None:
        raise SeakeepError(
            f"the cell {name} in {cells.folder} is missing or damaged. Run the study again."
        )
    return found


def _merge_test(study: Study, plan: Plan, runs: Runs, cells: CellFolder, test: str) -> xr.Dataset:
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
        variables.update(_merge_model(plan, cells, test, model, judged))
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


def _merge_model(
    plan: Plan, cells: CellFolder, test: str, model: str, judged: npt.NDArray[np.bool_]
) -> dict[str, Any]:
    arrays: dict[str, FloatArray] = {}
    members: dict[int, FloatArray] = {}
    for training, number in zip(*np.nonzero(judged), strict=True):
        cell = _cell(cells, cell_name(model, int(training), test, int(number)))
        if "members" in cell:
            members[int(number)] = cell.pop("members")
        for key, values in cell.items():
            if key not in arrays:
                # Pairs that are not judged: NaN, or −2 among the instants of loss.
                empty = np.nan if values.dtype.kind == "f" else -2
                arrays[key] = np.full((*judged.shape, *values.shape), empty, dtype=values.dtype)
            arrays[key][training, number] = values
    out: dict[str, Any] = {
        f"{model}_{key}": (("training", "window", *CELL_DIMS[key]), values)
        for key, values in arrays.items()
    }
    if members:
        shown = sorted(members)
        out[f"{model}_members"] = (
            ("shown", "member", "time", "channel"),
            np.stack([members[number] for number in shown]),
        )
        out["shown"] = ("shown", np.array(shown))
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


def _merge_calibration(plan: Plan, cells: CellFolder, model: str) -> xr.Dataset:
    found = [_cell(cells, calibration_name(model, k)) for k in range(len(plan.training))]
    stacked = {key: np.stack([each[key] for each in found]) for key in found[0]}
    return xr.Dataset(
        {key: (("training", "channel")[: values.ndim], values) for key, values in stacked.items()},
        coords={"training": [each.name for each in plan.training], "channel": list(plan.states)},
        attrs={"level": plan.level},
    )


def _merge_eigenvalues(plan: Plan, cells: CellFolder, model: str) -> xr.Dataset:
    units: list[Unit] = [
        unit
        for unit in units_of(plan, eigenvalues=True)
        if unit.kind == "eigenvalues" and unit.model == model
    ]
    found = [_cell(cells, eigenvalue_name(unit)) for unit in units]
    size = max(each["real"].shape[1] for each in found)
    parts = {
        key: np.concatenate(
            [
                np.pad(each[key], ((0, 0), (0, size - each[key].shape[1])), constant_values=np.nan)
                for each in found
            ]
        )
        for key in ("real", "imag")
    }
    assert len(parts["real"]) == members_of(plan, model)
    return xr.Dataset(
        {key: (("member", "mode"), values) for key, values in parts.items()},
        attrs={"training": plan.training[0].name, "dt": plan.dt},
    )
