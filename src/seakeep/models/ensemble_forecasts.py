"""What all members of an ensemble forecast, as Datasets: each of them, or statistics of them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.models import aligned
from seakeep.models.calibration import Band, check_band, warn_of_horizon, widened
from seakeep.models.ensemble_labels import label_channels, statuses, verdict, window_coords
from seakeep.models.ensemble_series import shelved
from seakeep.models.executor import Progress
from seakeep.models.forecasting import ForecastWindow
from seakeep.models.summaries import check_level, reduce_members, statistic_coordinate
from seakeep.models.windows import read_windows

if TYPE_CHECKING:
    from seakeep.models.fitted_ensemble import HankelEnsemble

__all__ = ["all_members", "all_members_of_windows", "summary", "summary_of_windows"]

FloatArray = npt.NDArray[np.float64]


def all_members(
    ensemble: HankelEnsemble,
    run: xr.Dataset,
    start: float,
    steps: int | None,
    executor: Executor | None,
    progress: Progress | None,
) -> xr.Dataset:
    """Free runs; see :meth:`HankelEnsemble.forecast`."""
    windows = read_windows(ensemble, run, [start], steps)
    with shelved(ensemble, run, windows, executor, progress, whole=True) as (shelf, lost):
        (values,) = shelf.all()
    variables = _labelled(ensemble, values, ("member", "time"))
    status = statuses(lost[:, 0], windows[0].time.values, ensemble.dt)
    variables["status"] = xr.Variable(("member",), status)
    return xr.Dataset(
        variables,
        coords={"member": np.arange(ensemble.n_members), "time": windows[0].time},
        attrs=_attributes(ensemble, run, windows[0]) | verdict(lost) | {"start": windows[0].start},
    )


def summary(
    ensemble: HankelEnsemble,
    run: xr.Dataset,
    start: float,
    steps: int | None,
    level: float,
    band: Band,
    executor: Executor | None,
    progress: Progress | None,
) -> xr.Dataset:
    """Statistics; see :meth:`HankelEnsemble.forecast_summary`."""
    windows, values, lost = _reduced(ensemble, run, [start], steps, level, band, executor, progress)
    window = windows[0]
    variables = _labelled(ensemble, values[0], ("statistic", "time"))
    status = statuses(lost[:, 0], window.time.values, ensemble.dt)
    variables["status"] = xr.Variable(("member",), status)
    counts = {"start": window.start} | _counted(ensemble, level, band) | verdict(lost)
    return xr.Dataset(
        variables,
        coords={
            "statistic": statistic_coordinate(level, band == "calibrated"),
            "member": np.arange(ensemble.n_members),
            "time": window.time,
        },
        attrs=_attributes(ensemble, run, window) | counts,
    )


def all_members_of_windows(
    ensemble: HankelEnsemble,
    run: xr.Dataset,
    starts: Sequence[float],
    steps: int,
    executor: Executor | None,
    progress: Progress | None,
) -> xr.Dataset:
    """Free runs; see :meth:`HankelEnsemble.forecast_windows`."""
    windows = read_windows(ensemble, run, starts, steps)
    with shelved(ensemble, run, windows, executor, progress, whole=True) as (shelf, lost):
        values = shelf.all()
    variables = _labelled(ensemble, values, ("window", "member", "lead"))
    status = [
        statuses(row, window.time.values, ensemble.dt)
        for row, window in zip(lost.T, windows, strict=True)
    ]
    variables["status"] = xr.Variable(("window", "member"), np.stack(status))
    coords = window_coords(windows, ensemble.dt) | {"member": np.arange(ensemble.n_members)}
    return xr.Dataset(variables, coords=coords, attrs=_attributes(ensemble, run, windows[0]))


def summary_of_windows(
    ensemble: HankelEnsemble,
    run: xr.Dataset,
    starts: Sequence[float],
    steps: int,
    level: float,
    band: Band,
    executor: Executor | None,
    progress: Progress | None,
) -> xr.Dataset:
    """Statistics; see :meth:`HankelEnsemble.summarize_windows`."""
    windows, values, lost = _reduced(ensemble, run, starts, steps, level, band, executor, progress)
    variables = _labelled(ensemble, values, ("window", "statistic", "lead"))
    variables["diverged"] = xr.Variable(("window",), (lost >= 0).sum(axis=0))
    coords = window_coords(windows, ensemble.dt)
    coords["statistic"] = statistic_coordinate(level, band == "calibrated")
    attrs = _attributes(ensemble, run, windows[0]) | _counted(ensemble, level, band)
    return xr.Dataset(variables, coords=coords, attrs=attrs)


def _reduced(
    ensemble: HankelEnsemble,
    run: xr.Dataset,
    starts: Sequence[float],
    steps: int | None,
    level: float,
    band: Band,
    executor: Executor | None,
    progress: Progress | None,
) -> tuple[list[ForecastWindow], FloatArray, npt.NDArray[np.int64]]:
    """Windows, statistics (window, 4, steps, N), and where members were lost (member, window)."""
    level = check_level(level)
    check_band(ensemble, level, band)
    windows = read_windows(ensemble, run, starts, steps)
    if band == "calibrated":
        warn_of_horizon(ensemble, windows[0].name, windows[0].steps)
    with shelved(ensemble, run, windows, executor, progress) as (shelf, lost):
        values = widened(ensemble, reduce_members(shelf, lost, level), band)
    return windows, values, lost


def _labelled(
    ensemble: HankelEnsemble, values: FloatArray, dims: tuple[str, ...]
) -> dict[str, xr.Variable]:
    return label_channels(ensemble.state_labels, ensemble.state_spread, values, dims)


def _counted(ensemble: HankelEnsemble, level: float, band: Band) -> dict[str, Any]:
    kind = {"band": band} if band == "calibrated" else {}
    return {"level": level, "members": ensemble.n_members, **kind}


def _attributes(
    ensemble: HankelEnsemble, run: xr.Dataset, window: ForecastWindow
) -> dict[str, Any]:
    notes = {} if ensemble.alignment is None else aligned.notes(ensemble.alignment, run)
    return {"run": window.name, "ensemble": json.dumps(ensemble.origin), **notes}
