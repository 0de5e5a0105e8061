"""Free runs of the members of an ensemble: whoever makes one puts it into its place."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.models import aligned
from seakeep.models.executor import Progress, in_order
from seakeep.models.forecasting import ForecastWindow
from seakeep.models.members import Task, forecast_member
from seakeep.models.shelf import Layout, Shelf, open_shelf
from seakeep.models.summaries import first_lost
from seakeep.models.windows import stacked

if TYPE_CHECKING:
    from seakeep.models.fitted_ensemble import HankelEnsemble

__all__ = ["shelved"]

FloatArray = npt.NDArray[np.float64]


@contextmanager
def shelved(
    ensemble: HankelEnsemble,
    run: xr.Dataset,
    windows: Sequence[ForecastWindow],
    executor: Executor | None,
    progress: Progress | None = None,
    *,
    whole: bool = False,
) -> Iterator[tuple[Shelf, npt.NDArray[np.int64]]]:
    """Free runs of all members, in pieces of time.

    Parameters
    ----------
    ensemble : HankelEnsemble
        The ensemble.
    run : Dataset
        The run.
    windows : sequence of ForecastWindow
        From :func:`read_windows`, of one length.
    executor, progress
        As in :meth:`HankelEnsemble.forecast`.
    whole : bool, optional
        Whether the series are wanted in one piece.

    Yields
    ------
    shelf : Shelf
        States in physical units; NaN from where a window diverges on.
    lost : ndarray of int, shape (member, window)
        First instant lost, or −1.

    Raises
    ------
    RequestError
        If the temporary folder has no room.
    """
    function: Any
    data: Any
    items: Sequence[Any]
    if ensemble.alignment is not None and ensemble.alignment.settings.surge == "predicted":
        loops = [aligned.prepare_loop(ensemble, run, window) for window in windows]
        function, data, items = _closed_loops, (ensemble, loops), range(ensemble.n_members)
    else:
        data = Task(ensemble.arrays, ensemble.settings, *stacked(windows), windows[0].steps)
        function, items = forecast_member, ensemble.members
    size = len(windows), ensemble.n_members, windows[0].steps, len(ensemble.states)
    layout = Layout(*size, size[2]) if whole else Layout.in_pieces(*size)
    lost = np.empty((ensemble.n_members, len(windows)), dtype=np.int64)
    with open_shelf(layout, whole=whole) as shelf:
        for number, values in enumerate(in_order(function, data, items, executor, progress)):
            shelf.put(number, values)
            lost[number] = first_lost(values)
        yield shelf, lost


def _closed_loops(data: tuple[HankelEnsemble, Sequence[aligned.Loop]], number: int) -> FloatArray:
    ensemble, loops = data
    member = ensemble.member(number)
    return np.stack([aligned.closed_loop(member, loop) for loop in loops])
