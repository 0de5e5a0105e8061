"""One member of an ensemble: identified from the training arrays, run freely, and forgotten."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from seakeep.core.embedding import TrainingWindow, training_window
from seakeep.core.solve import Solution, identify
from seakeep.errors import RequestError
from seakeep.models.draws import Draw
from seakeep.models.identification import Scale, moments
from seakeep.models.model import HankelDMDcModel
from seakeep.models.settings import HankelSettings
from seakeep.models.training import Training
from seakeep.models.windows import free_runs

if TYPE_CHECKING:
    from seakeep.models.fitted_ensemble import HankelEnsemble

__all__ = [
    "Member",
    "Task",
    "TrainingArrays",
    "forecast_member",
    "identify_member",
    "member_model",
    "member_radius",
    "window_ends",
]

FloatArray = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TrainingArrays:
    """What every member is identified from, in physical units.

    Parameters
    ----------
    names : tuple of str
        Runs.
    states, inputs : tuple of ndarray, each (time, channel)
        Samples from the earliest that a member reaches to the run's stop.
    offsets : tuple of int
        Sample of the run at which its arrays begin.
    begins : tuple of float
        Instant of the first sample of the arrays, s.
    state_names, input_names : tuple of str
        Channels, for messages.
    """

    names: tuple[str, ...]
    states: tuple[FloatArray, ...]
    inputs: tuple[FloatArray, ...]
    offsets: tuple[int, ...]
    begins: tuple[float, ...]
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Member:
    """A member identified.

    Parameters
    ----------
    draw : Draw
        What is its own.
    solution : Solution
        Coefficients and the form of the regression.
    runs : tuple of int
        Runs that trained it.
    windows : tuple of TrainingWindow
        Their windows, in samples of the training arrays.
    state_scale, input_scale : Scale
        Moments over these windows.
    """

    draw: Draw
    solution: Solution
    runs: tuple[int, ...]
    windows: tuple[TrainingWindow, ...]
    state_scale: Scale
    input_scale: Scale

    @property
    def coefficients(self) -> FloatArray:
        """Regressed rows of [Â B̂]."""
        return self.solution.coefficients

    @property
    def state_delays(self) -> int:
        """Delayed copies of the states, s."""
        return self.draw.state_delays

    @property
    def input_delays(self) -> int:
        """Delayed copies of the inputs, z."""
        return self.draw.input_delays


@dataclass(frozen=True, eq=False)
class Task:
    """What a worker needs to forecast members: sent once, whatever their number.

    Parameters
    ----------
    arrays : TrainingArrays
        Training data.
    settings : HankelSettings
        What all members share; delays, window and λ are the draw's.
    histories, inputs : ndarray, shapes (window, time, N) and (window, time + steps − 1, Q)
        Measured samples up to each start, and the inputs from the same sample on.
    steps : int
        Instants forecast.
    """

    arrays: TrainingArrays
    settings: HankelSettings
    histories: FloatArray
    inputs: FloatArray
    steps: int


def identify_member(
    arrays: TrainingArrays,
    settings: HankelSettings,
    draw: Draw,
) -> Member:
    """Identify one member, as :meth:`HankelDMDc.fit` does with its settings.

    Parameters
    ----------
    arrays : TrainingArrays
        Training data.
    settings : HankelSettings
        What all members share.
    draw : Draw
        What is the member's own.

    Returns
    -------
    Member
        With means and standard deviations of its own windows (paper, section System
        identification setup: the z-score is taken on the training signal).
    """
    chosen = range(len(arrays.states)) if draw.run is None else (draw.run,)
    windows, states, inputs = [], [], []
    for run in chosen:
        end = len(arrays.states[run]) - 1 if draw.last is None else draw.last - arrays.offsets[run]
        place = training_window(
            end, draw.window, draw.state_delays, draw.input_delays, settings.history
        )
        begin = min(place.first, place.first_column - max(draw.state_delays, draw.input_delays))
        begin = max(begin, 0)
        windows.append(
            TrainingWindow(place.first - begin, place.last - begin, place.first_column - begin)
        )
        states.append(arrays.states[run][begin : end + 1])
        inputs.append(arrays.inputs[run][begin : end + 1])
    state_scale = moments(states, windows, arrays.state_names, settings.standardize)
    input_scale = moments(inputs, windows, arrays.input_names, settings.standardize)
    solution = identify(
        [state_scale.deviations(values) for values in states],
        [input_scale.deviations(values) for values in inputs],
        windows,
        state_delays=draw.state_delays,
        input_delays=draw.input_delays,
        ridge=draw.ridge,
        per_snapshot=settings.ridge_scale == "per_snapshot",
        rank=settings.rank,
        all_rows=settings.delay_rows == "ridge",
    )
    return Member(draw, solution, tuple(chosen), tuple(windows), state_scale, input_scale)


def forecast_member(task: Task, draw: Draw) -> FloatArray:
    """Identify one member and run it freely over all windows side by side.

    Parameters
    ----------
    task : Task
        Training data and what a forecast reads.
    draw : Draw
        The member.

    Returns
    -------
    ndarray, shape (window, steps, N)
        States in physical units; NaN from where a window diverges on.
    """
    member = identify_member(task.arrays, task.settings, draw)
    return free_runs(member, task.histories, task.inputs, task.steps)


def window_ends(arrays: TrainingArrays, draw: Draw, run: int, dt: float) -> tuple[float, float]:
    """First and last instant of a member's training window in a run, s."""
    last = len(arrays.states[run]) - 1 if draw.last is None else draw.last - arrays.offsets[run]
    stop = arrays.begins[run] + last * dt
    samples = last + 1 if draw.window is None else draw.window
    return stop - (samples - 1) * dt, stop


def member_model(ensemble: HankelEnsemble, number: int) -> HankelDMDcModel:
    """One member as a model of its own; see :meth:`HankelEnsemble.member`."""
    arrays = ensemble.arrays
    if not 0 <= number < ensemble.n_members:
        raise RequestError(
            f"there is no member {number!r}: the ensemble has {ensemble.n_members}, counted from "
            f"0 to {ensemble.n_members - 1}."
        )
    draw = ensemble.members[number]
    found = identify_member(arrays, ensemble.settings, draw)
    settings = replace(
        ensemble.settings,
        state_delays=draw.state_delays,
        input_delays=draw.input_delays,
        ridge=draw.ridge,
        window=draw.window,
    )
    ends = [window_ends(arrays, draw, run, ensemble.dt) for run in found.runs]
    return HankelDMDcModel(
        settings=settings,
        coefficients=found.solution.coefficients,
        dt=ensemble.dt,
        state_labels=ensemble.state_labels,
        input_labels=ensemble.input_labels,
        state_scale=found.state_scale,
        input_scale=found.input_scale,
        training=Training(
            runs=tuple(arrays.names[run] for run in found.runs),
            first=tuple(first for first, _ in ends),
            stop=tuple(stop for _, stop in ends),
            columns=tuple(window.columns for window in found.windows),
            method=found.solution.method,
            ridge=found.solution.ridge,
            rank=found.solution.rank,
        ),
        alignment=ensemble.alignment,
    )


def member_radius(data: tuple[TrainingArrays, HankelSettings], draw: Draw) -> float:
    """Identify one member and find the largest modulus of an eigenvalue of its Â.

    Parameters
    ----------
    data : (TrainingArrays, HankelSettings)
        Training data, and what all members share.
    draw : Draw
        The member.

    Returns
    -------
    float
        The spectral radius.
    """
    arrays, settings = data
    N = len(arrays.state_names)
    size = N * (draw.state_delays + 1)
    top = identify_member(arrays, settings, draw).solution.coefficients[:, :size]
    square = top if len(top) == size else np.concatenate([top, np.eye(size - N, size)])
    return float(np.abs(np.linalg.eigvals(square)).max())


def reach(draws: Sequence[Draw], samples: Sequence[int], inside: bool) -> list[int]:
    """Earliest sample of each run that a member reads.

    Parameters
    ----------
    draws : sequence of Draw
        Members.
    samples : sequence of int
        Samples of each run up to its stop.
    inside : bool
        Whether the delay history lies inside the window.

    Returns
    -------
    list of int
        One a run; the run's end where no member reads it.
    """
    earliest = list(samples)
    for draw in draws:
        for run in range(len(samples)) if draw.run is None else (draw.run,):
            last = samples[run] - 1 if draw.last is None else draw.last
            first = 0 if draw.window is None else last + 1 - draw.needed(inside)
            earliest[run] = min(earliest[run], first)
    return earliest
