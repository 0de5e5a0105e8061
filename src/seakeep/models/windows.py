"""Forecasts from several starts side by side: many windows are one product of matrices."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core.rollout import rollout
from seakeep.errors import RequestError
from seakeep.models import aligned
from seakeep.models.ensemble_labels import label_channels, window_coords
from seakeep.models.forecasting import ForecastWindow, cut_divergence, read_window, status_text
from seakeep.models.identification import Scale
from seakeep.models.summaries import first_lost

if TYPE_CHECKING:
    from seakeep.models.fitted_ensemble import HankelEnsemble
    from seakeep.models.model import HankelDMDcModel

__all__ = ["Linear", "forecast_windows", "free_runs", "read_windows", "stacked"]

FloatArray = npt.NDArray[np.float64]


class Linear(Protocol):
    """What a free run needs of a model, or of a member."""

    @property
    def coefficients(self) -> FloatArray:
        """Regressed rows of [Â B̂], shape (N(s+1) or N, N(s+1) + Q(z+1))."""

    @property
    def state_delays(self) -> int:
        """Delayed copies of the states, s."""

    @property
    def input_delays(self) -> int:
        """Delayed copies of the inputs, z."""

    @property
    def state_scale(self) -> Scale:
        """Means and standard deviations of the states."""

    @property
    def input_scale(self) -> Scale:
        """The same of the inputs."""


def free_runs(
    model: Linear,
    histories: FloatArray,
    inputs: FloatArray,
    steps: int,
) -> FloatArray:
    """Free runs over several windows, in physical units.

    Parameters
    ----------
    model : Linear
        Coefficients, delays and scales.
    histories : ndarray, shape (window, s + 1 or more, N)
        Measured samples up to each start.
    inputs : ndarray, shape (window, z + steps or more, Q)
        Inputs up to the instant before the last one forecast.
    steps : int
        Instants forecast.

    Returns
    -------
    ndarray, shape (window, steps, N)
        NaN from where a window diverges on.
    """
    count = histories.shape[2]
    size = count * (model.state_delays + 1)
    driving = inputs[:, inputs.shape[1] - model.input_delays - steps :]
    if not driving.shape[2]:
        driving = np.zeros((len(driving), steps, 0))
    deviations = rollout(
        model.coefficients[:, :size],
        model.coefficients[:, size:],
        model.state_scale.deviations(histories[:, -1 - model.state_delays :]),
        model.input_scale.deviations(driving),
        n_states=count,
    )
    with np.errstate(over="ignore"):  # a run that is lost is cut just below
        values = model.state_scale.physical(deviations, out=deviations)
    return cut_divergence(values, model.state_scale, histories[:, -1:])


def read_windows(
    model: HankelDMDcModel | HankelEnsemble,
    run: xr.Dataset,
    starts: Sequence[float],
    steps: int | None,
) -> list[ForecastWindow]:
    """Cut what forecasts from several starts need out of a run, the input aligned.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        What forecasts.
    run, steps
        As in :meth:`HankelDMDcModel.forecast`.
    starts : sequence of float
        Instants of the last measured state, s.

    Returns
    -------
    list of ForecastWindow
        One a start; of an ensemble with the history of the member that reaches back farthest.

    Raises
    ------
    RequestError, DataError
        As :meth:`HankelDMDcModel.forecast`, or if there is no start.
    """
    if np.ndim(starts) == 0:
        raise RequestError(
            f"starts must be a list of instants; received {starts!r}. Write [{starts}]."
        )
    if len(starts) == 0:
        raise RequestError("starts is empty: name at least one instant to forecast from.")
    if steps is None and len(starts) > 1:
        raise RequestError(
            f"steps is None, which is the end of the run, at another distance from each of the "
            f"{len(starts)} starts. Give the number of instants to forecast from all of them."
        )
    windows = [read_window(model, run, start, steps) for start in starts]
    if model.alignment is None:
        return windows
    if model.alignment.settings.surge == "predicted":
        return windows
    return [aligned.align_window(model, run, window) for window in windows]


def stacked(windows: Sequence[ForecastWindow]) -> tuple[FloatArray, FloatArray]:
    """Histories and inputs of windows side by side, as :func:`free_runs` takes them."""
    histories = np.stack([window.state_history for window in windows])
    inputs = np.stack([np.concatenate([w.input_history, w.input_future]) for w in windows])
    return histories, inputs


def forecast_windows(
    model: HankelDMDcModel, run: xr.Dataset, starts: Sequence[float], steps: int
) -> xr.Dataset:
    """Free runs from several starts; see :meth:`HankelDMDcModel.forecast_windows`."""
    windows = read_windows(model, run, starts, steps)
    notes = {}
    if model.alignment is not None:
        notes = aligned.notes(model.alignment, run)
    if model.alignment is not None and model.alignment.settings.surge == "predicted":
        loops = [aligned.prepare_loop(model, run, window) for window in windows]
        values = np.stack([aligned.closed_loop(model, loop) for loop in loops])
    else:
        values = free_runs(model, *stacked(windows), windows[0].steps)
    labels, spread = model.state_labels, model.state_scale.spread
    variables = label_channels(labels, spread, values, ("window", "lead"))
    lost = first_lost(values).tolist()
    status = [status_text(at, w.time.values, model.dt) for at, w in zip(lost, windows, strict=True)]
    variables["status"] = xr.Variable(("window",), status)
    attrs = {"run": windows[0].name, **notes}
    return xr.Dataset(variables, coords=window_coords(windows, model.dt), attrs=attrs)
