"""A band calibrated on windows that the members never saw."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal, NamedTuple, Protocol, get_args

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, Progress, check_choice, fraction, whole_number
from seakeep.conventions import is_elevation
from seakeep.core.bands import (
    ConformalMargin,
    band_scale,
    band_scores,
    calibrated_bounds,
    conformal_margin,
    learn_scale,
    scaled_scores,
    spread_floor,
    wave_envelope,
)
from seakeep.errors import RequestError, warn
from seakeep.models import labelled
from seakeep.models.engine import Runs as FreeRuns
from seakeep.models.engine import Windows, member_series, read_groups
from seakeep.models.forecasts import reduce_members
from seakeep.models.inputs import Signature
from seakeep.models.training import RunArrays
from seakeep.signals import repeated_waves

Band = Literal["members", "calibrated"]
BandScale = Literal["spread", "constant", "learnt"]

PARTS = 3
"""Parts of a run that trains alone, each of which is forecast by what the others teach."""


class Judged(NamedTuple):
    """Forecasts of windows that no member has read.

    Attributes
    ----------
    values : ndarray, shape (window, 4, steps, N)
        Statistics of the members.
    measured : ndarray, shape (window, steps, N)
        The measurement.
    envelope : ndarray, shape (window, steps)
        Waves that drive each step; see :func:`envelope_of`.
    starts : tuple of float
        Starts of the windows, s.
    """

    values: FloatArray
    measured: FloatArray
    envelope: FloatArray
    starts: tuple[float, ...] = ()


class Ensemble(FreeRuns, Protocol):
    """Members of an ensemble that a calibration uses."""

    @property
    def arrays(self) -> tuple[RunArrays, ...]:
        """What the members were trained on."""

    @property
    def read_spans(self) -> dict[str, tuple[float, float]]:
        """First and last instant that members have read, of each run, s."""

    def without(self, run: str) -> Ensemble:
        """Members as they learn from the other runs."""

    def without_part(self, begin: int, end: int) -> Ensemble:
        """Members as they learn from the rest of the one run that trains."""


Case = tuple[Ensemble, xr.Dataset]
"""What forecasts a run, and the run."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Numbers that make the calibrated band, and the windows they come from.

    Parameters
    ----------
    conformal : ConformalMargin
        Margins of the states, or factors of their scale.
    floor : ndarray of shape (N,), or None
        Least scale of each state, a quarter of its root mean square error; None where the margin
        is constant.
    law : ndarray of shape (4, N), or None
        Coefficients of a learnt scale (:func:`seakeep.core.bands.learn_scale`).
    windows : dict of str to int
        Number of windows in each run.
    steps : int
        Instants of a window.
    spans : dict of str to (float, float)
        First start and last instant of the windows in each run, s.
    folds : {"run"} or None
        Whether members forecast the runs that trained them as they learn from the others.
    """

    conformal: ConformalMargin
    floor: FloatArray | None
    law: FloatArray | None
    windows: dict[str, int]
    steps: int
    spans: dict[str, tuple[float, float]]
    folds: str | None = None

    @property
    def scale(self) -> BandScale:
        """What the half-width follows."""
        if self.law is not None:
            return "learnt"
        return "constant" if self.floor is None else "spread"

    @property
    def bounds(self) -> str:
        """What the bounds of the band are, in words."""
        level = self.conformal.level
        if self.law is not None:
            return (
                "the mean minus and plus a calibrated factor times a scale learnt from the "
                "members' spread, the horizon and the waves, not below a floor"
            )
        if self.floor is not None:
            return (
                "the mean minus and plus a calibrated factor times the root of the members' "
                "variance and a squared floor"
            )
        quantiles = f"the quantiles {0.5 - level / 2:g} and {0.5 + level / 2:g} of the members"
        return f"{quantiles}, moved outwards by the margin of a calibration"


def calibrate(
    ensemble: Ensemble,
    runs: labelled.Runs,
    steps: int,
    level: float,
    scale: BandScale,
    folds: Literal["run"] | None,
    executor: Executor | None,
    progress: Progress | None,
) -> Calibration:
    """Find the band of an ensemble; see :meth:`HankelEnsemble.calibrate`."""
    level = fraction(level, "level")
    check_choice("scale", scale, get_args(BandScale))
    if folds not in (None, "run"):
        raise RequestError(f"folds must be 'run', or None for unread windows; received {folds!r}.")
    cases: dict[str, Case] = {}
    for name, run in labelled.as_runs(runs).items():
        known = _read_run(ensemble, name, run) if folds else None
        if known is None:
            cases[name] = ensemble, run
        elif len(ensemble.arrays) > 1:
            cases[name] = _without_waves_of(ensemble, known), run
        else:
            cases |= _parts(ensemble, name, run)
    judged = held_out(cases, steps, level, executor, progress)
    history = ensemble.signature.history_samples
    if not judged:
        longest = max(run.sizes["time"] for _, run in cases.values())
        longest -= history + ensemble.signature.input_after
        reason = "members have read what is left of them"
        if longest < steps:
            reason = f"at most {max(longest, 0)} steps fit into the longest of them"
        raise RequestError(
            f"no window of {steps} steps with {history} samples of history is "
            f"free in {', '.join(cases)}, as given here: {reason}. Give fewer steps, longer parts, "
            "or runs that do not train; or let each run that trains be forecast by what the "
            "others teach (folds='run', --folds run of seakeep calibrate)."
        )
    margin, floor, law = learn_margin(judged.values(), level, scale)
    windows = {name: len(each.starts) for name, each in judged.items()}
    length = steps * ensemble.signature.dt
    spans = {name: (each.starts[0], each.starts[-1] + length) for name, each in judged.items()}
    return Calibration(margin, floor, law, windows, steps, spans, folds)


def learn_margin(
    judged: Iterable[Judged], level: float, scale: BandScale
) -> tuple[ConformalMargin, FloatArray | None, FloatArray | None]:
    """Margins of bands in windows that no member has read, the floor of their scale, and its law.

    A learnt scale judges the windows of each run by what the other runs teach, and those of a
    single run by halves; the law that is kept is that of all windows.
    """
    parts = list(judged)
    values, measured, envelope = (
        np.concatenate(each) for each in list(zip(*parts, strict=True))[:3]
    )
    mean, std, lower, upper = np.moveaxis(values, 1, 0)
    if scale == "constant":
        return conformal_margin(band_scores(lower, upper, measured), level), None, None
    floor = spread_floor(mean, measured)
    if scale == "spread":
        errors = scaled_scores(mean, band_scale(std, floor), measured)
        return conformal_margin(errors, level), floor, None
    groups = np.repeat(np.arange(len(parts)), [len(each.measured) for each in parts])
    if len(parts) == 1:
        groups = np.arange(len(measured)) % 2
    if len(measured) < 2:
        raise RequestError(
            "scale = 'learnt' learns from some windows and judges others, and there is 1. Give "
            "more or longer runs, fewer steps, or take scale = 'spread'."
        )
    scores = np.empty(mean.shape)
    for group in np.unique(groups):
        rest, here = groups != group, groups == group
        law = learn_scale(mean[rest], std[rest], measured[rest], envelope[rest], floor)
        scales = band_scale(std[here], floor, law, envelope[here])
        scores[here] = scaled_scores(mean[here], scales, measured[here])
    law = learn_scale(mean, std, measured, envelope, floor)
    return conformal_margin(scores, level), floor, law


def held_out(
    cases: Mapping[str, Case],
    steps: int,
    level: float,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> dict[str, Judged]:
    """Forecasts of windows end to end, none of which a member has read, and the measurement.

    Parameters
    ----------
    cases : mapping of str to (HankelEnsemble, Dataset)
        What forecasts each run, or part of one, under the names by which they trained.
    steps : int
        Instants of a window.
    level : float
        Probability between the bounds.
    executor, progress : optional
        As in :meth:`HankelEnsemble.forecast`; a step of progress is a member in one run.

    Returns
    -------
    dict of str to Judged
        Runs in which there is such a window.
    """
    free = {
        name: places
        for name, (ensemble, run) in cases.items()
        if (places := _free_samples(ensemble, name, run, steps))
    }
    judged: dict[str, Judged] = {}
    done, total = 0, sum(cases[name][0].n_members for name in free)
    for name, places in free.items():
        ensemble, run = cases[name]
        signature = ensemble.signature
        tell = None if progress is None else _counted(progress, done, total, name)
        done += ensemble.n_members
        starts = tuple(run["time"].values[places].astype(float).tolist())
        instants = [(name, start) for start in starts]
        (windows,) = read_groups(signature, {name: run}, [(instants, steps)])
        ((series, lost),) = member_series(ensemble, [windows], executor, tell)
        values = reduce_members(series, lost, level)
        states = labelled.channel_matrix(run, signature.states, name)
        measured = np.stack([states[at + 1 : at + 1 + steps] for at in places])
        judged[name] = Judged(values, measured, envelope_of(signature, windows), starts)
    return judged


def _without_waves_of(ensemble: Ensemble, run: str) -> Ensemble:
    """Members as they learn from runs of other waves; from all other runs where none has others."""
    signature, alike = ensemble.signature, [run]
    if waves := [*filter(is_elevation, signature.inputs)]:
        at = signature.inputs.index(waves[0])
        records = {each.name: each.delayed[:, at] for each in ensemble.arrays}
        groups = repeated_waves(records, signature.dt)
        alike = [name for name in records if groups[name] == groups[run]]
    with suppress(RequestError):  # no member has others
        others = ensemble
        for name in alike:
            others = others.without(name)
        return others
    return ensemble.without(run)


def _parts(ensemble: Ensemble, name: str, run: xr.Dataset) -> Iterator[tuple[str, Case]]:
    """Thirds of the run that trains alone, and the ensemble as it learns from the rest of it."""
    (whole,), half = ensemble.arrays, 0.5 * ensemble.signature.dt
    edges = np.linspace(0, len(whole.states), PARTS + 1).round().astype(int)
    times = whole.begin + edges * ensemble.signature.dt - half
    times[[0, -1]] = -np.inf, np.inf  # what no member reads goes with its neighbour
    for number in range(PARTS):
        part = run.sel(time=slice(times[number], times[number + 1]))
        source = ensemble.without_part(int(edges[number]), int(edges[number + 1]))
        yield f"{name}, part {number + 1}", (source, part)


def envelope_of(signature: Signature, windows: Windows) -> FloatArray:
    """Root mean square of the waves that drive each step, (window, steps), in training SD.

    Over the input delays, and over the inputs as the map carries them; with a predicted surge
    those at the place of the start.
    """
    count = len(signature.inputs)
    scale = signature.input_scale.part(slice(count))
    spread = np.where(scale.spread > 0, scale.spread, 1.0)
    deviations = (windows.delayed[..., :count] - scale.centre) / spread
    return wave_envelope(deviations, windows.steps)


def _counted(progress: Progress, before: int, total: int, name: str) -> Progress:
    """Progress over the members of one run, as part of several."""
    return lambda done, _, what: progress(before + done, total, f"{name}, {what}")


def _free_samples(ensemble: Ensemble, name: str, run: xr.Dataset, steps: int) -> list[int]:
    """Starts of windows end to end in a run, clear of what members have read of it."""
    whole_number(steps, "steps")
    time, signature = run["time"].values.astype(float), ensemble.signature
    slack = 1e-6 * signature.dt
    known = _read_run(ensemble, name, run)
    begin, end = (np.inf, -np.inf) if known is None else ensemble.read_spans[known]
    places, at = [], signature.history_samples - 1
    # The last step reads the input beyond its own end where the model looks further ahead.
    while at + steps + signature.input_after < time.size:
        # The instants at + 1 … at + steps are forecast.
        if time[at + 1] <= end + slack and time[at + steps] >= begin - slack:
            at = int(np.searchsorted(time, end - slack))
            continue
        places.append(at)
        at += steps
    return places


def _read_run(ensemble: Ensemble, name: str, run: xr.Dataset) -> str | None:
    """Which run of the training this is: one with the same samples, else that of its name.

    A name that was made up for a run without one says nothing.
    """
    spans, signature = ensemble.read_spans, ensemble.signature
    time = run["time"].values.astype(float)
    values = labelled.channel_matrix(run, signature.states, name)
    for each in ensemble.arrays:
        if each.name in spans and time.size:
            ahead = round((each.begin - time[0]) / signature.dt)  # samples before the states
            here, there = values[max(ahead, 0) :], each.states[max(-ahead, 0) :]
            count = min(len(here), len(there))  # as far as both reach
            if count > 0 and np.array_equal(here[:count], there[:count]):
                return each.name
    return name if name in spans and not labelled.is_made_up(name, run) else None


def calibrated_for(calibration: Calibration | None, level: float) -> Calibration:
    """Calibration of an ensemble, for a band of a level.

    Raises
    ------
    RequestError
        If the ensemble was not calibrated, or for another level.
    """
    if calibration is None:
        raise RequestError(
            "the ensemble is not calibrated. Call ensemble.calibrate(runs, steps), or seakeep "
            "calibrate, with runs that its members did not learn from, and use the result."
        )
    known = calibration.conformal.level
    if abs(known - level) > 1e-12:
        raise RequestError(
            f"the band was calibrated for level = {known:g}, and {level:g} was asked for. "
            "Calibrate for that level."
        )
    return calibration


def widened(
    calibration: Calibration, values: FloatArray, signature: Signature, windows: Windows
) -> FloatArray:
    """Statistics of shape (window, 4, steps, N) with the bounds of a calibrated band.

    Warns where a forecast is longer than those that the band was made from.
    """
    if windows.steps > calibration.steps:
        warn(
            f"the forecast of {windows.places[0][0]} is longer than the {calibration.steps} "
            "instants that the band was calibrated for: its coverage is not guaranteed there. "
            "Calibrate with longer windows."
        )
    mean, std, lower, upper = np.moveaxis(values, 1, 0)
    scale = None
    if calibration.floor is not None:
        envelope = envelope_of(signature, windows)
        scale = band_scale(std, calibration.floor, calibration.law, envelope)
    bounds = calibrated_bounds(mean, lower, upper, calibration.conformal.margin, scale)
    return np.stack([mean, std, *bounds], axis=1)
