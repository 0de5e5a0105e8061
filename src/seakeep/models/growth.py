"""Growth of errors in training with the time after a start, and forecasts that it weighs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.optimize import isotonic_regression

from seakeep.arrays import TINY, BoolArray, Datasets, FloatArray, ratio
from seakeep.models.engine import Dynamics, Windows, linear_runs, read_groups
from seakeep.models.inputs import Scale, Signature
from seakeep.models.readouts import FittedReadOut
from seakeep.models.training import TrainingData

WINDOWS = 48
"""Free runs that the errors are averaged over; a root mean square is known to a tenth then."""
STEPS = 1024
"""Single steps that the covariance of the residuals is taken from, at most."""
REACH = 3
"""Longest delays of the model that the free runs last."""
LEAST = 64
"""Steps that they last at least: errors of a lightly damped vessel outgrow short delays."""
DOUBTED = 0.5, 0.9
"""Squares of errors, claimed, over the variance of training between which a forecast from waves
that are predicted passes over to the mean: on the virtual tank its best weight is 0.7 to 0.9 at
0.55, 0.2 to 0.5 at 0.75 and 0 to 0.1 at 0.95, by one probe and by two."""


@dataclass(frozen=True, eq=False)
class LeadErrors:
    """Errors of a model in its training runs, physical units.

    Parameters
    ----------
    residual : ndarray, shape (N, N)
        Covariance of the one-step residuals.
    rms : ndarray, shape (steps, N)
        Root mean square error of free runs, 1 … steps samples after their starts; it never falls.

    Notes
    -----
    All are raised to what is expected in data that did not train (:func:`lead_errors`).
    """

    residual: FloatArray
    rms: FloatArray

    @classmethod
    def together(cls, parts: Sequence[LeadErrors]) -> LeadErrors:
        """Errors of several models, which count alike at each lead that they are known at."""
        residual = np.mean([each.residual for each in parts], axis=0)
        reached = [
            np.mean([each.rms[at] ** 2 for each in parts if at < each.longest], axis=0)
            for at in range(max(each.longest for each in parts))
        ]
        return cls(residual, np.sqrt(np.maximum.accumulate(reached)))

    @property
    def longest(self) -> int:
        """Longest lead that they are known at, samples."""
        return len(self.rms)

    def of_forecast(self, steps: int, since: int = 0) -> FloatArray:
        """Mean squares over a forecast, shape (steps, N), `since` samples after measured states."""
        return self.at(np.arange(1, steps + 1) + since) ** 2

    def at(self, leads: npt.ArrayLike) -> FloatArray:
        """RMS errors at leads (samples from 1 on), shape (…, N); held after the last."""
        places = np.minimum(np.asarray(leads, dtype=int), self.longest) - 1
        return self.rms[places]


class Source(NamedTuple):
    """Where a stretch comes from, for free runs that read more of a run than the stretch holds."""

    signature: Signature
    name: str
    run: xr.Dataset
    begin: float


@dataclass(frozen=True, eq=False)
class Stretch:
    """Training samples in physical units.

    Parameters
    ----------
    states, delayed, direct : ndarray, each (time, channel)
        States and both kinds of regressors.
    first, last : int
        Samples between which forecasts may start and end.
    source : Source, optional
        Run, and the instant of the first sample in s, where predicted states drive the input or
        states depart from means before a start.
    zero : ndarray, shape (N,), optional
        What the states depart from.
    """

    states: FloatArray
    delayed: FloatArray
    direct: FloatArray
    first: int
    last: int
    source: Source | None = None
    zero: FloatArray | float = 0.0

    def windows(self, starts: Sequence[int], s: int, z: int, steps: int) -> Windows:
        """What free runs from these samples read."""
        if self.source is not None and steps > 1:
            signature, name, run, begin = self.source
            places = [(name, begin + at * signature.dt) for at in starts]
            return read_groups(signature, {name: run}, [(places, steps)])[0]
        return Windows(
            steps=steps,
            histories=np.stack([self.states[at - s : at + 1] for at in starts]),
            delayed=np.stack([self.delayed[at - z : at + steps] for at in starts]),
            direct=np.stack([self.direct[at : at + steps] for at in starts]),
        )


Forecast = Callable[[Windows, Sequence[FittedReadOut]], FloatArray]
"""States after windows, (window, steps, N), with what is read off them."""


def linear_errors(
    members: Sequence[Dynamics],
    stretches: Sequence[Stretch],
    readouts: Sequence[FittedReadOut],
) -> LeadErrors | None:
    """Errors of the mean of linear members in their training runs."""
    own = [each.signature for each in members]
    return lead_errors(
        lambda windows, read_off: linear_runs(members, [windows], read_off)[0].mean(axis=0),
        (max(each.state_delays for each in own), max(each.input_delays for each in own)),
        float(np.mean([each.coefficients.shape[1] for each in members])),
        stretches,
        readouts,
    )


def lead_errors(
    forecast: Forecast,
    delays: tuple[int, int],
    unknowns: float,
    stretches: Sequence[Stretch],
    readouts: Sequence[FittedReadOut] = (),
) -> LeadErrors | None:
    """Errors of forecasts in training runs; None where no stretch has room for one.

    Residuals are those of the states as they are regressed; free runs are read off as forecasts
    are.

    Parameters
    ----------
    forecast : callable
        The model.
    delays : tuple of int
        s and z.
    unknowns : float
        Coefficients of an equation.
    stretches : sequence of Stretch
        What it learnt from.
    readouts : sequence of FittedReadOut
        Its read-outs.
    """
    stretches = [each for each in stretches if each.last > each.first]
    if not stretches:
        return None
    longest = max(each.last - each.first for each in stretches)
    steps = max(1, min(max(REACH * (max(delays) + 1), LEAST), longest // 2))
    residuals = _errors(forecast, delays, stretches, 1, STEPS)[:, 0]
    longest_first = sorted(stretches, key=lambda each: each.first - each.last)
    errors = _errors(forecast, delays, longest_first, steps, WINDOWS, readouts)
    known = np.isfinite(errors)
    # NaN where all have diverged.
    square = ratio(np.where(known, errors**2, 0.0).sum(axis=0), known.sum(axis=0))
    square = square[np.isfinite(square).all(axis=1)]
    # One step is what the residuals are, of which there are more.
    read_off = [each.column for each in readouts if each.acts]
    regressed = np.setdiff1d(np.arange(square.shape[1]), read_off)
    square[:1, regressed] = np.mean(residuals[:, regressed] ** 2, axis=0)
    grown = np.stack([isotonic_regression(each).x for each in square.T], axis=1)
    factor = _unseen(unknowns, stretches)
    residual = factor * residuals.T @ residuals / len(residuals)
    return LeadErrors(residual, np.sqrt(factor * grown))


def _unseen(unknowns: float, stretches: Sequence[Stretch]) -> float:
    """How much larger squared errors are in data that did not train (Akaike, 1970).

    The final prediction error of p coefficients found from n samples, (n + p)/(n − p) times the
    mean square of the residuals; at most three times, where a ridge makes up for what is missing.
    """
    n = sum(each.last - each.first for each in stretches)
    p = min(unknowns, 0.5 * n)
    return (n + p) / (n - p)


def _errors(
    forecast: Forecast,
    delays: tuple[int, int],
    stretches: Sequence[Stretch],
    steps: int,
    most: int,
    readouts: Sequence[FittedReadOut] = (),
) -> FloatArray:
    """Forecast minus measurement in windows, shape (window, steps, N).

    Their starts are spread evenly over the stretches in which one fits.
    """
    room = [max(each.last - steps - each.first + 1, 0) for each in stretches]
    errors = []
    for each, count in zip(stretches, room, strict=True):
        if number := min(count, -(-most * count // max(sum(room), 1))):
            starts = np.linspace(each.first, each.last - steps, number).astype(int).tolist()
            measured = np.stack([each.states[at + 1 : at + steps + 1] for at in starts])
            windows, measured = each.windows(starts, *delays, steps).departing(measured, each.zero)
            errors.append(forecast(windows, readouts) - measured)
    return np.concatenate(errors)


def stretches_of(data: TrainingData, signature: Signature, runs: Datasets) -> list[Stretch]:
    """What a single model learnt from in the runs that it was fitted to."""
    stretches, source, input_map = [], None, signature.input_map
    for number, (name, window) in enumerate(zip(data.names, data.windows, strict=True)):
        if input_map.follows is not None or input_map.reference:
            source = Source(signature, name, runs[name], data.begin(number))
        first, own = window.first_column, data.physical(number)
        if input_map.reference:  # which the run holds before a start, not the window
            skipped = round((data.begin(number) - float(runs[name]["time"][0])) / signature.dt)
            first = max(first, signature.history_samples - 1 - skipped)
        stretches.append(Stretch(*own, first, window.last, source, data.zero(number)))
    return stretches


def weighed_runs(
    model: Any, run: Callable[[Sequence[Windows]], list[FloatArray]], groups: Sequence[Windows]
) -> list[FloatArray]:
    """Free runs of a single model over groups of windows, weighed where waves are predicted."""
    runs = run(groups)
    for values, windows in zip(runs, groups, strict=True):
        if windows.departures and model.errors is not None:
            parts = [values, *run(windows.departures)]
            weigh_members(windows, parts, model.errors, model.signature.state_scale)
    return runs


def weighed(
    runs: FloatArray,
    errors: FloatArray | float,
    scale: Scale,
    given: BoolArray,
    before: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean of runs that passes over to that of training as the claimed error nears the SD there.

    Where a state lies farther than the SD to one side of that mean all through the history, as the
    mean surge of another sea does, the mean errs by more: by what the forecast departs, too.

    Parameters
    ----------
    runs : ndarray, shape (member, 1 + 2 departures, …, steps, N)
        Runs from the inputs that are expected, then from departures from them and from their
        opposites. Innovations of later samples do the same later, so that effects add up over the
        leads: what squares of waves move the mean by, and the variance. Inputs may depart by the
        same waves, so that effects of one innovation of each count with one sign. Steps before
        those of `given` only add up.
    errors : ndarray, shape (steps, N)
        Mean squares of the model's errors.
    scale : Scale
        Moments of training.
    given : ndarray of bool, shape (…, steps)
        Whether the waves that a step reads are known: nothing changes there.
    before : ndarray, shape (N,)
        The :func:`departure` of the history.

    Returns
    -------
    mean, spread, weight : ndarray, shape (…, steps, N)
        The mean; the variance over members and waves, before it is weighed; and the weight of the
        forecast against the mean of training.
    """
    late = runs.shape[-2] - given.shape[-1]
    middle, (plus, minus) = runs[:, 0], np.split(runs[:, 1:], 2, axis=1)
    apart = 0.5 * np.abs(plus - minus).sum(axis=1)
    moved = (0.5 * (plus + minus) - middle[:, None]).sum(axis=1)
    spread: FloatArray = np.cumsum(np.mean(apart**2, axis=0), axis=-2)[..., late:, :]
    away = np.nan_to_num(np.cumsum(moved.mean(axis=0), axis=-2))[..., late:, :]
    middle = middle[..., late:, :]
    if len(middle) > 1:
        spread += middle.var(axis=0, ddof=1)
    low, high = DOUBTED
    known, mean, centre = given[..., None], middle.mean(axis=0), scale.centre
    # A state that never moved is as it is.
    usual = np.fmax(np.fmin(np.abs(mean - centre), before), scale.spread)
    claimed = (spread + errors) / np.maximum(usual**2, TINY)
    # Where a departure is lost, nothing of the forecast is trusted.
    trust = np.nan_to_num((high - claimed) / (high - low), nan=0.0)
    lasting = np.minimum.accumulate(np.clip(trust, 0.0, 1.0), axis=-2)
    shrunk = centre + lasting * (mean + away - centre)
    return np.where(known, mean, shrunk), spread, np.where(known, 1.0, lasting)


def departure(history: FloatArray, scale: Scale) -> FloatArray:
    """How far all of a history lies to one side of the mean of training, shape (N,)."""
    away = history - scale.centre
    return np.maximum(away.min(axis=0), -away.max(axis=0))


def weigh_members(
    windows: Windows, parts: Sequence[FloatArray], errors: LeadErrors, scale: Scale
) -> None:
    """Weigh members in place where windows read predicted inputs, and keep their spread.

    Parameters
    ----------
    windows : Windows
        With their departures.
    parts : sequence of ndarray, each of shape (member, window, steps, N)
        Runs over the windows, which are changed, and over the departures. A member that is lost in
        a window does not count there, unless all are.
    errors : LeadErrors
        Errors of the members' mean.
    scale : Scale
        Moments of training.
    """
    steps, squares = np.arange(windows.steps), errors.of_forecast(windows.steps)
    for number, first in enumerate(windows.predicted):
        whole = np.isfinite(parts[0][:, number]).all(axis=(1, 2))
        whole |= not whole.any()
        own, before = scale, departure(windows.histories[number], scale)
        if windows.zero is not None:
            own = replace(scale, centre=scale.centre + windows.zero[number])
        for column in range(squares.shape[1] if first >= 0 else 0):  # one by one, for memory
            at = slice(column, column + 1)
            runs = np.stack([each[whole, number, :, at] for each in parts], axis=1)
            mean, *_ = weighed(runs, squares[:, at], own.part(at), steps < first, before[at])
            parts[0][:, number, :, at] += mean - runs[:, 0].mean(axis=0)
