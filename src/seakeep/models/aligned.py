"""Forecasts of models whose wave input is aligned to the vessel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core.rollout import feedback_rollout
from seakeep.models import forecasting, labelled
from seakeep.models.alignment import FittedAlignment, ProbeAlignment, fit_alignment
from seakeep.models.forecasting import ForecastWindow
from seakeep.signals.propagation import CarriedElevation

if TYPE_CHECKING:
    from collections.abc import Sequence

    from seakeep.models.model import HankelDMDcModel

__all__ = [
    "align_history",
    "align_training",
    "align_window",
    "aligned_inputs",
    "closed_loop",
    "notes",
    "prepare_loop",
]

FloatArray = npt.NDArray[np.float64]


class Aligning(Protocol):
    """What a model or an ensemble tells of its inputs."""

    @property
    def alignment(self) -> FittedAlignment | None:
        """The alignment."""

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""

    @property
    def history_samples(self) -> int:
        """Samples up to the start, that one included."""


def align_training(
    settings: ProbeAlignment,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    window: int | None,
    reach: int,
) -> tuple[FittedAlignment, dict[str, xr.Dataset]]:
    """Fit the alignment and replace the inputs of the training runs by aligned ones.

    Parameters
    ----------
    settings : ProbeAlignment
        What was asked for.
    runs : mapping of str to Dataset
        Training runs, cut at the end of their training windows.
    states, inputs : sequence of str
        Channels of the model.
    window : int or None
        Samples of the training windows; None for all of the runs.
    reach : int
        Samples before the windows that serve as delay history.

    Returns
    -------
    FittedAlignment
        What the model keeps.
    dict of str to Dataset
        The runs; inputs are NaN where window and history do not reach.

    Raises
    ------
    RequestError, DataError
        As :func:`seakeep.models.alignment.fit_alignment`.
    """
    fitted = fit_alignment(settings, runs, states, inputs, window)
    out = {}
    for name, run in runs.items():
        time = np.asarray(run["time"].values, dtype=float)
        first = 0 if window is None else max(time.size - window - reach, 0)
        samples = slice(first, time.size)
        _check_needed(fitted, run, inputs, name, samples)
        values = fitted.aligned(run, inputs, name, samples)
        whole = np.full((time.size, len(inputs)), np.nan)
        whole[samples] = values
        variables = {
            channel: ("time", whole[:, column], run[channel].attrs)
            for column, channel in enumerate(inputs)
        }
        out[name] = run.assign(variables)
    return fitted, out


def _check_needed(
    fitted: FittedAlignment, run: xr.Dataset, inputs: Sequence[str], name: str, samples: slice
) -> None:
    """Refuse gaps in the inputs, and in the surge if it is read."""
    time = np.asarray(run["time"].values, dtype=float)
    names = list(inputs)
    if fitted.settings.surge != "none":
        names.append(fitted.settings.surge_channel)
    values = labelled.channel_matrix(run, names, name, samples)
    labelled.check_finite(values, names, name, samples.start, time)


def _place(model: Aligning, run: xr.Dataset, window: ForecastWindow) -> tuple[int, int]:
    """Sample of the start, and the first sample of the history."""
    time = np.asarray(run["time"].values, dtype=float)
    at = labelled.nearest_sample(time, window.start, window.name)
    return at, at + 1 - model.history_samples


def align_history(model: HankelDMDcModel, run: xr.Dataset, window: ForecastWindow) -> FloatArray:
    """Inputs up to the start of a forecast, carried to the measured position.

    Parameters
    ----------
    model : HankelDMDcModel
        A model with an alignment.
    run : Dataset
        The run.
    window : ForecastWindow
        What :func:`seakeep.models.forecasting.read_window` cut out of it.

    Returns
    -------
    ndarray, shape (history_samples, Q)
        Aligned inputs; no surge after the start is read.
    """
    assert model.alignment is not None
    at, first = _place(model, run, window)
    samples = slice(first, at + 1)
    _check_needed(model.alignment, run, model.inputs, window.name, samples)
    return model.alignment.aligned(run, model.inputs, window.name, samples)


def align_window(model: Aligning, run: xr.Dataset, window: ForecastWindow) -> ForecastWindow:
    """Replace the inputs of a window by inputs carried to the measured position.

    Parameters
    ----------
    model : HankelDMDcModel
        A model with an alignment by measured surge or none.
    run : Dataset
        The run.
    window : ForecastWindow
        What :func:`seakeep.models.forecasting.read_window` cut out of it.

    Returns
    -------
    ForecastWindow
        With aligned history and future.
    """
    assert model.alignment is not None
    at, first = _place(model, run, window)
    samples = slice(first, at + window.steps)
    _check_needed(model.alignment, run, model.inputs, window.name, samples)
    values = model.alignment.aligned(run, model.inputs, window.name, samples)
    history = model.history_samples
    return replace(window, input_history=values[:history], input_future=values[history:])


@dataclass(frozen=True, eq=False)
class Loop:
    """What a closed loop reads of a run after the start: the same for all members of an ensemble.

    Parameters
    ----------
    run : Dataset
        The run; its surge is read up to the start and not after.
    window : ForecastWindow
        What :func:`seakeep.models.forecasting.read_window` cut out of it.
    raw : ndarray, shape (steps, Q)
        Inputs from the start on, as measured.
    carriers : list of CarriedElevation or None
        Elevations to be read where the surge is predicted.
    places : ndarray, shape (Q,)
        Constant distances, m.
    first : int
        Sample of the carriers at the start.
    """

    run: xr.Dataset
    window: ForecastWindow
    raw: FloatArray
    carriers: list[CarriedElevation | None]
    places: FloatArray
    first: int


def prepare_loop(model: Aligning, run: xr.Dataset, window: ForecastWindow) -> Loop:
    """Prepare the elevations of a window to be carried to a surge that is predicted.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        With an alignment by predicted surge.
    run : Dataset
        The run; its surge is read up to the start and not after.
    window : ForecastWindow
        What :func:`seakeep.models.forecasting.read_window` cut out of the run.

    Returns
    -------
    Loop
        For :func:`closed_loop`.
    """
    alignment = model.alignment
    assert alignment is not None
    at, _ = _place(model, run, window)
    needed = slice(at, at + window.steps)
    stretch = alignment.stretch(run, model.inputs, window.name, needed)
    return Loop(
        run=run,
        window=window,
        raw=labelled.channel_matrix(run, model.inputs, window.name, needed),
        carriers=alignment.carry(
            run,
            model.inputs,
            window.name,
            labelled.channel_matrix(run, model.inputs, window.name, stretch),
            alignment.surge_range,
        ),
        places=alignment.offsets(run, model.inputs),
        first=at - stretch.start,
    )


def closed_loop(model: HankelDMDcModel, loop: Loop) -> FloatArray:
    """Free run that carries the elevation to the surge that it predicts.

    Parameters
    ----------
    model : HankelDMDcModel
        A model with an alignment by predicted surge.
    loop : Loop
        From :func:`prepare_loop`, of the model or of an ensemble that it is a member of.

    Returns
    -------
    ndarray, shape (steps, N)
        States after the start, physical units; NaN from where the run diverged on.
    """
    alignment, window = model.alignment, loop.window
    assert alignment is not None
    history = align_history(model, loop.run, window)
    column = model.states.index(alignment.settings.surge_channel)
    low, high = alignment.surge_range

    def next_input(step: int, deviations: FloatArray) -> FloatArray:
        surge = np.clip(model.state_scale.physical(deviations)[column], low, high)
        values = loop.raw[step].copy()
        for index, carrier in enumerate(loop.carriers):
            if carrier is not None:
                values[index] = carrier.at(surge + loop.places[index], loop.first + step)[0]
        return model.input_scale.deviations(values)

    a, b = model.top
    deviations = feedback_rollout(
        a,
        b,
        model.state_scale.deviations(window.state_history[-model.state_delays - 1 :]),
        model.input_scale.deviations(history[-model.input_delays - 1 :]),
        window.steps,
        next_input,
    )
    with np.errstate(over="ignore", invalid="ignore"):
        values = model.state_scale.physical(deviations, out=deviations)
    return forecasting.cut_divergence(values, model.state_scale, window.state_history[-1])


def aligned_inputs(model: HankelDMDcModel, run: xr.Dataset) -> xr.Dataset:
    """Inputs of a whole run; see :meth:`seakeep.HankelDMDcModel.aligned_inputs`."""
    name = labelled.run_name(run, "the run")
    labelled.check_run(run, name)
    values = labelled.channel_matrix(run, model.inputs, name)
    if model.alignment is not None:
        samples = slice(0, run.sizes["time"])
        _check_needed(model.alignment, run, model.inputs, name, samples)
        values = model.alignment.aligned(run, model.inputs, name, samples)
    variables = {
        channel: ("time", values[:, column], run[channel].attrs)
        for column, channel in enumerate(model.inputs)
    }
    return xr.Dataset(variables, coords={"time": run["time"]}, attrs=run.attrs)


def notes(alignment: FittedAlignment, run: xr.Dataset) -> dict[str, str | float]:
    """What a forecast's attributes say of its alignment.

    Parameters
    ----------
    alignment : FittedAlignment
        The model's.
    run : Dataset
        The run that was forecast.

    Returns
    -------
    dict
        Mode, surge, the run's probe offset, and with measured surge ``conditional_on``.
    """
    settings = alignment.settings
    out: dict[str, str | float] = {
        "alignment_mode": settings.mode,
        "alignment_surge": settings.surge,
    }
    if settings.surge == "measured":
        out["conditional_on"] = settings.surge_channel
    for key in ("probe_offset", "probe_offset_spread"):
        if key in run.attrs:
            out[key] = float(run.attrs[key])
    return out
