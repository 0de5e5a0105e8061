"""Growth of errors in training with the time after a start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.optimize import isotonic_regression

from seakeep.arrays import Datasets, FloatArray, ratio
from seakeep.models.engine import Dynamics, Windows, linear_runs, read_groups
from seakeep.models.inputs import Signature
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
    # Squared errors are larger in data that did not train: by the final prediction error of p
    # coefficients found from n samples (Akaike, 1970), at most three times, where a ridge makes up
    # for what is missing.
    n = sum(each.last - each.first for each in stretches)
    p = min(unknowns, 0.5 * n)
    factor = (n + p) / (n - p)
    residual = factor * residuals.T @ residuals / len(residuals)
    return LeadErrors(residual, np.sqrt(factor * grown))


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
        stretches.append(Stretch(*own, first, window.last, source, data.zeros[number]))
    return stretches
