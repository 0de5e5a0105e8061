"""One member of an ensemble: identified from the training arrays, run freely, and forgotten."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.core.embedding import TrainingWindow, training_window
from seakeep.core.solve import Solution, identify
from seakeep.models.draws import Draw
from seakeep.models.engine import Dynamics
from seakeep.models.inputs import InputMap
from seakeep.models.settings import HankelSettings
from seakeep.models.training import lengthened, scales_of

__all__ = ["Member", "TrainingArrays", "identify_member", "reach", "window_ends"]


@dataclass(frozen=True, eq=False)
class TrainingArrays:
    """What every member is identified from, in physical units.

    Parameters
    ----------
    names : tuple of str
        Runs.
    states, delayed, direct : tuple of ndarray, each (time, channel)
        States and both kinds of regressors, from the earliest sample that a member reaches on.
        Regressors end before the run's stop by what the model looks ahead.
    offsets : tuple of int
        Sample of the run at which its arrays start.
    begins : tuple of float
        Instant of the first sample of the arrays, s.
    channels : tuple of tuple of str
        Names of the states, the delayed and the direct regressors, for messages.
    """

    names: tuple[str, ...]
    states: tuple[FloatArray, ...]
    delayed: tuple[FloatArray, ...]
    direct: tuple[FloatArray, ...]
    offsets: tuple[int, ...]
    begins: tuple[float, ...]
    channels: tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]

    def only(self, runs: Sequence[int]) -> TrainingArrays:
        """Those of some of the runs."""
        parts = ("names", "states", "delayed", "direct", "offsets", "begins")
        return replace(
            self, **{part: tuple(getattr(self, part)[run] for run in runs) for part in parts}
        )


@dataclass(frozen=True, eq=False)
class Member:
    """A member identified.

    Parameters
    ----------
    dynamics : Dynamics
        What its free runs need.
    solution : Solution
        Coefficients and the form of the regression.
    runs : tuple of int
        Runs that trained it.
    windows : tuple of TrainingWindow
        Their windows, in samples of the training arrays.
    """

    dynamics: Dynamics
    solution: Solution
    runs: tuple[int, ...]
    windows: tuple[TrainingWindow, ...]


def identify_member(
    arrays: TrainingArrays, settings: HankelSettings, input_map: InputMap, draw: Draw
) -> Member:
    """Identify one member, as :meth:`HankelDMDc.fit` does with its settings.

    Means and standard deviations are those of its own windows (paper, section System
    identification setup: the z-score is taken on the training signal).
    """
    chosen = range(len(arrays.states)) if draw.run is None else (draw.run,)
    back = max(draw.state_delays, input_map.history(draw.input_delays))
    windows, parts = [], []
    for run in chosen:
        end = _last_of(arrays, draw, run)
        place = training_window(end, draw.window, draw.state_delays, back, settings.history)
        begin = max(min(place.first, place.first_column - back), 0)
        final = end - max(input_map.lead_samples - 1, 0)
        windows.append(
            TrainingWindow(place.first - begin, final - begin, place.first_column - begin)
        )
        parts.append(
            [
                lengthened(series[run][begin : final + 1], final + 1 - begin)
                for series in (arrays.states, arrays.delayed, arrays.direct)
            ]
        )
    groups = list(zip(*parts, strict=True))
    scales = scales_of(groups, windows, arrays.channels, settings.standardize, input_map.stretch)
    states, delayed, direct = (
        [scale.deviations(values) for values in series]
        for scale, series in zip(scales, groups, strict=True)
    )
    solution = identify(
        states,
        delayed,
        windows,
        state_delays=draw.state_delays,
        input_delays=draw.input_delays,
        direct=direct if direct[0].shape[1] else None,
        ridge=draw.ridge,
        per_snapshot=settings.ridge_scale == "per_snapshot",
        rank=settings.rank,
        all_rows=settings.delay_rows == "ridge",
        radius=settings.radius,
    )
    x, u, w = scales
    delays, follows = (draw.state_delays, draw.input_delays), input_map.follows
    dynamics = Dynamics(solution.coefficients, *delays, x, u, w, follows)
    return Member(dynamics, solution, tuple(chosen), tuple(windows))


def _last_of(arrays: TrainingArrays, draw: Draw, run: int) -> int:
    """Last sample of a member's window in the arrays of a run."""
    return len(arrays.states[run]) - 1 if draw.last is None else draw.last - arrays.offsets[run]


def spectral_radius(dynamics: Dynamics) -> float:
    """Largest modulus of an eigenvalue of Â."""
    top, _ = dynamics.matrices
    size, states = top.shape[1], len(dynamics.state_scale.mean)
    square = top if len(top) == size else np.concatenate([top, np.eye(size - states, size)])
    return float(np.abs(np.linalg.eigvals(square)).max())


def window_ends(arrays: TrainingArrays, draw: Draw, run: int, dt: float) -> tuple[float, float]:
    """First and last instant of a member's training window in a run, s."""
    last = _last_of(arrays, draw, run)
    stop = arrays.begins[run] + last * dt
    samples = last + 1 if draw.window is None else draw.window
    return stop - (samples - 1) * dt, stop


def reach(
    draws: Sequence[Draw], samples: Sequence[int], inside: bool, input_map: InputMap
) -> list[int]:
    """Earliest sample of each run that a member reads; the run's end where none reads it."""
    earliest = list(samples)
    lead = input_map.lead_samples
    for draw in draws:
        for run in range(len(samples)) if draw.run is None else (draw.run,):
            last = samples[run] - 1 if draw.last is None else draw.last
            first = (
                0
                if draw.window is None
                else last + 1 - draw.needed(inside, input_map.history(draw.input_delays), lead)
            )
            earliest[run] = min(earliest[run], first)
    return earliest
