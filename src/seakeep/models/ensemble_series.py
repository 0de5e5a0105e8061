"""Free runs of the members of an ensemble, one after the other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core.scratch import Scratch
from seakeep.errors import RequestError
from seakeep.models import aligned
from seakeep.models.forecasting import ForecastWindow, read_window
from seakeep.models.members import Task, forecast_member
from seakeep.models.offsets import check_offset
from seakeep.models.progress import Progress, told
from seakeep.models.workers import Crew, side_by_side

if TYPE_CHECKING:
    from seakeep.models.fitted_ensemble import HankelEnsemble

__all__ = ["member_series", "read_windows"]

FloatArray = npt.NDArray[np.float64]


def read_windows(
    ensemble: HankelEnsemble, run: xr.Dataset, starts: Sequence[float], steps: int | None
) -> list[ForecastWindow]:
    """Cut what forecasts from several starts need out of a run, the input aligned.

    Parameters
    ----------
    ensemble : HankelEnsemble
        The ensemble.
    run, steps
        As in :meth:`HankelDMDcModel.forecast`.
    starts : sequence of float
        Instants of the last measured state, s.

    Returns
    -------
    list of ForecastWindow
        One a start, with the history of the member that reaches back farthest.

    Raises
    ------
    RequestError, DataError
        As :meth:`HankelDMDcModel.forecast`, or if there is no start.
    """
    windows = [read_window(ensemble, run, float(start), steps) for start in starts]
    if not windows:
        raise RequestError("starts is empty: name at least one instant to forecast from.")
    if ensemble.alignment is None:
        return windows
    check_offset(run)
    if ensemble.alignment.settings.surge == "predicted":
        return windows
    return [aligned.align_window(ensemble, run, window) for window in windows]


def member_series(
    ensemble: HankelEnsemble,
    run: xr.Dataset,
    windows: Sequence[ForecastWindow],
    crew: Crew,
    progress: Progress | None = None,
) -> Iterator[FloatArray]:
    """Free runs of the members, in their order.

    Parameters
    ----------
    ensemble : HankelEnsemble
        The ensemble.
    run : Dataset
        The run.
    windows : sequence of ForecastWindow
        From :func:`read_windows`, of one length.
    crew : Crew
        Who does the work.
    progress
        As in :meth:`HankelEnsemble.forecast`.

    Returns
    -------
    iterator of ndarray, each of shape (window, steps, N)
        States in physical units; NaN from where a window diverges on.
    """
    found: Iterator[FloatArray]
    if ensemble.alignment is not None and ensemble.alignment.settings.surge == "predicted":
        loops = [aligned.prepare_loop(ensemble, run, window) for window in windows]
        found = side_by_side(_closed_loops, (ensemble, loops), range(ensemble.n_members), crew)
    else:
        histories = np.stack([window.state_history for window in windows])
        inputs = np.stack([np.concatenate([w.input_history, w.input_future]) for w in windows])
        task = Task(ensemble.arrays, ensemble.settings, histories, inputs, windows[0].steps)
        found = side_by_side(forecast_member, task, ensemble.members, crew)
    return told(found, ensemble.n_members, progress)


def _closed_loops(
    data: tuple[HankelEnsemble, Sequence[aligned.Loop]], number: int, _: Scratch
) -> FloatArray:
    ensemble, loops = data
    member = ensemble.member(number)
    return np.stack([aligned.closed_loop(member, loop) for loop in loops])
