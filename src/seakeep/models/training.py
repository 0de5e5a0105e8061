"""From runs to what the regression needs: windows, regressors, moments, standardised arrays."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from operator import getitem
from typing import NamedTuple, Self

import numpy as np

from seakeep.arrays import FloatArray, undefined
from seakeep.core.embedding import (
    Delayed,
    PrimalSystem,
    TrainingWindow,
    block_means,
    primal_system,
    spread_means,
    training_window,
)
from seakeep.core.solve import Method, Solution, identify
from seakeep.errors import DataError, warn
from seakeep.models import labelled
from seakeep.models.inputs import InputMap, Regressors, Scale, Signature
from seakeep.models.labelled import ChannelLabel, Span, TrainingRuns
from seakeep.models.settings import HankelSettings


@dataclass(frozen=True)
class Training:
    """Training of a model: its data, and the regression.

    Parameters
    ----------
    runs : tuple of str
        Names of the runs.
    first, stop : tuple of float
        First and last instant of the training window of each run, s.
    columns : tuple of int
        Snapshot pairs each run contributed.
    method : {"primal", "dual", "svd"}
        The form of the regression that was solved.
    ridge : float
        Effective λ.
    rank : int
        Singular values used.
    clipped : tuple of float
        Moduli of the eigenvalues that were clipped to ``stable``, largest first.
    """

    runs: tuple[str, ...]
    first: tuple[float, ...]
    stop: tuple[float, ...]
    columns: tuple[int, ...]
    method: Method
    ridge: float
    rank: int
    clipped: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Standardised arrays of the training runs, cut to what the windows reach.

    Parameters
    ----------
    signature : Signature
        What a forecast must know of a model that is fitted to these data, without read-outs.
    names : tuple of str
        Runs.
    states, delayed, direct : tuple of ndarray, each (time, channel)
        Standardised deviations of the states and of both kinds of regressors.
    windows : tuple of TrainingWindow
        In samples of these arrays.
    instants : tuple of (float, float)
        First and last instant of each window, s.
    inputs : tuple of ndarray, each (time, Q)
        Measured inputs of the windows, physical units.
    zeros : tuple of ndarray, each (N,), or zero
        What the states of each run depart from, physical units.
    """

    signature: Signature
    names: tuple[str, ...]
    states: tuple[FloatArray, ...]
    delayed: tuple[FloatArray, ...]
    direct: tuple[FloatArray, ...]
    windows: tuple[TrainingWindow, ...]
    instants: tuple[tuple[float, float], ...]
    inputs: tuple[FloatArray, ...] = ()
    zeros: tuple[FloatArray | float, ...] = ()

    def begin(self, run: int) -> float:
        """Instant of the first sample of a run's arrays, s."""
        return self.instants[run][0] - self.windows[run].first * self.signature.dt

    @property
    def series(self) -> tuple[tuple[FloatArray, ...], ...]:
        """States, delayed and direct regressors, each by run."""
        return self.states, self.delayed, self.direct

    def physical(self, run: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """States and both kinds of regressors of a run, physical units, less its zeros."""
        groups = zip(self.signature.scales, self.series, strict=True)
        x, u, w = (scale.physical(values[run]) for scale, values in groups)
        return x, u, w

    def of(self, runs: Iterable[int], settings: HankelSettings) -> TrainingData:
        """Some of the runs, on deviations from their own moments."""
        own = self.signature
        pieces = [
            Piece(self.names[run], self.physical(run), self.windows[run], self.instants[run])
            for run in runs
        ]
        labels = own.state_labels, own.input_labels
        return _standardised(pieces, own.dt, labels, own.input_map, replace(settings, centre=0))

    def regress(self, settings: HankelSettings) -> Solution:
        """Rows of the next states, or of all delayed ones, from these data.

        Means over blocks of delayed states enter as regressors without delays; the rows that are
        returned spread them over these delays.
        """
        solution = identify(
            self.states,
            self.delayed,
            self.windows,
            state_delays=None if settings.is_filter else settings.state_delays,
            input_delays=settings.input_delays,
            direct=with_means(settings, self.states, self.direct),
            ridge=float(settings.ridge),
            per_snapshot=settings.ridge_scale == "per_snapshot",
            rank=settings.rank,
            all_rows=settings.delay_rows == "ridge",
            radius=settings.radius,
        )
        if not settings.memory:
            return solution
        count, s = len(self.signature.states), settings.state_delays
        spread = spread_means(solution.coefficients, count, s, settings.blocks)
        return replace(solution, coefficients=spread)

    def training(self, solution: Solution) -> Training:
        """What a model that was fitted to these data keeps of them."""
        return Training(
            runs=self.names,
            first=tuple(float(first) for first, _ in self.instants),
            stop=tuple(float(stop) for _, stop in self.instants),
            columns=tuple(window.columns for window in self.windows),
            method=solution.method,
            ridge=solution.ridge,
            rank=solution.rank,
            clipped=solution.clipped,
        )


def with_means(
    settings: HankelSettings, states: Sequence[FloatArray], direct: Sequence[FloatArray]
) -> list[FloatArray]:
    """Direct regressors of each run, and the means over blocks of its delayed states."""
    if not settings.memory:
        return [*direct]
    return [
        np.concatenate([own, block_means(x, settings.blocks)], axis=1)
        for own, x in zip(direct, states, strict=True)
    ]


def system_of(
    groups: Sequence[Sequence[FloatArray]],
    windows: Sequence[TrainingWindow],
    settings: HankelSettings,
) -> PrimalSystem:
    """Gram matrix of runs, given as states, delayed and direct regressors, each by run."""
    states, delayed, direct = groups
    series = [(delayed, settings.input_delays), (with_means(settings, states, direct), 0)]
    if not settings.is_filter:
        series.insert(0, (states, settings.state_delays))
    return primal_system(Delayed(states, series, windows))


def gather(
    given: TrainingRuns, settings: HankelSettings, input_map: InputMap | None = None
) -> TrainingData:
    """Fit the input map, and collect the training windows of the runs.

    Parameters
    ----------
    given : TrainingRuns
        Runs, at least one, and channels.
    settings : HankelSettings
        Input maps, delays, window and scaling.
    input_map : InputMap, optional
        That of these runs, where it is known.

    Returns
    -------
    TrainingData
        What the regression needs.

    Raises
    ------
    RequestError
        If a channel is not known.
    DataError
        If a run is too short, has gaps, another time step, other units, or a constant channel.
    """
    runs, states, inputs = given
    dt = labelled.common_step(runs)
    labels = labelled.common_labels(runs, states), labelled.common_labels(runs, inputs)
    input_map = input_map or settings.input_map(given, settings.window)
    reach = settings.reach(input_map)
    pieces, read = [], []
    for name, run in runs.items():
        time = run["time"].values.astype(float)
        place, shifted, cut = _place(time.size - 1, settings, input_map)
        _check_length(place, cut.stop - 1, name, settings, reach)
        begin, here = cut.start, labelled.channel_matrix(run, states, name, cut)
        needed = min(place.first, place.first_column - settings.state_reach)
        labelled.check_finite(here[needed - begin :], states, run, name, needed)
        needed = min(place.first, place.first_column - settings.input_delays)
        span = Span(begin, place.last, place.last + 1 - input_map.around.ahead)
        regressors = run_regressors(input_map, given, name, span, needed)
        instants = time[place.first], time[place.last]
        pieces.append(Piece(name, (here, *regressors), shifted, instants))
        read.append(labelled.channel_matrix(run, inputs, name, place.samples))
    data = _standardised(pieces, dt, labels, input_map, settings)
    if len(pieces) > 1:
        _warn_of_dead(pieces, 0, data.signature.state_scale, labels[0])
        _warn_of_dead(pieces, 1, data.signature.input_scale, input_map.regressors(labels[1])[0])
    return replace(data, inputs=tuple(read))


class Piece(NamedTuple):
    """What a run gives to train with, physical units, and its window in samples of these arrays."""

    name: str
    series: tuple[FloatArray, FloatArray, FloatArray]
    window: TrainingWindow
    instants: tuple[float, float]


def _place(
    last: int, settings: HankelSettings, input_map: InputMap
) -> tuple[TrainingWindow, TrainingWindow, slice]:
    """Window that ends at a sample, the same in what it reads up to its last successor, and that.

    A step from j reads the input up to j + lead, and none after the window.
    """
    reach = settings.reach(input_map)
    place = training_window(last, settings.window, settings.state_reach, reach, settings.history)
    begin = min(place.first, place.first_column - reach)
    final = last - input_map.around.after
    shifted = TrainingWindow(place.first - begin, final - begin, place.first_column - begin)
    return place, shifted, slice(begin, final + 1)


def _standardised(
    pieces: Sequence[Piece],
    dt: float,
    labels: tuple[tuple[ChannelLabel, ...], tuple[ChannelLabel, ...]],
    input_map: InputMap,
    settings: HankelSettings,
) -> TrainingData:
    """Deviations from the moments of these windows (paper, System identification setup)."""
    names, series, windows, instants = zip(*pieces, strict=True)
    zeros: tuple[FloatArray | float, ...] = (0.0,) * len(names)
    if settings.centre:
        series, zeros = departures(series, windows, input_map)
    # A look-ahead leaves the last row, which is no column, without regressors.
    groups = [
        [
            values if len(values) == len(own[0]) else np.concatenate([values, values[-1:]])
            for values, own in zip(group, series, strict=True)
        ]
        for group in zip(*series, strict=True)
    ]
    channels = labels[0], *input_map.regressors(labels[1])
    counted = zip(*map(_counted, windows), strict=True)
    states, delayed, direct = (
        moments([*map(getitem, every, own)], named, settings.standardize)
        for every, own, named in zip(groups, counted, channels, strict=True)
    )
    if input_map.follows is not None and settings.standardize:
        by = input_map.stretch
        delayed = replace(delayed, std=delayed.std * by[0])
        direct = replace(direct, std=direct.std * by[1])
    scales = states, delayed, direct
    x, u, w = (
        tuple(scale.deviations(values) for values in each)
        for scale, each in zip(scales, groups, strict=True)
    )
    reach = settings.state_reach, settings.input_delays
    input_map = replace(input_map, reference=settings.centre)
    signature = Signature(dt, *labels, *reach, input_map, *scales)
    return TrainingData(signature, names, x, u, w, windows, instants, zeros=zeros)


def departures(
    series: Sequence[Sequence[FloatArray]], windows: Sequence[TrainingWindow], input_map: InputMap
) -> tuple[tuple[Sequence[FloatArray], ...], tuple[FloatArray, ...]]:
    """Series of each run less their means over its window, and those of the states.

    A surge that is followed and its slow square stay, since they say where the vessel is.
    """
    out, zeros = [], []
    for each, window in zip(series, windows, strict=True):
        cuts = zip(each, _counted(window), strict=True)
        means = [values[own].mean(axis=0) for values, own in cuts]
        if input_map.follows is not None:
            means[0][input_map.follows.column] = means[2][-1] = 0.0
        out.append(tuple(values - mean for values, mean in zip(each, means, strict=True)))
        zeros.append(means[0])
    return tuple(out), tuple(zeros)


def departing(
    series: Iterable[Sequence[FloatArray]], input_map: InputMap
) -> tuple[Sequence[FloatArray], ...]:
    """Series of each run less their means; runs without samples are left out."""
    every = [each for each in series if len(each[0])]
    return departures(every, [TrainingWindow(0, len(each[0]), 0) for each in every], input_map)[0]


@dataclass(frozen=True, eq=False)
class RunArrays:
    """What members of an ensemble learn from a run, in physical units.

    Parameters
    ----------
    name : str
        The run.
    states, delayed, direct : ndarray, each (time, channel)
        States and both kinds of regressors, from the earliest sample that a member reads on.
        Regressors end before the run's stop by what the model looks ahead.
    offset : int
        Sample of the run at which these arrays start.
    begin : float
        Instant of their first sample, s.
    """

    name: str
    states: FloatArray
    delayed: FloatArray
    direct: FloatArray
    offset: int
    begin: float

    @classmethod
    def read(cls, given: TrainingRuns, name: str, first: int, input_map: InputMap) -> Self:
        """Samples of a run from the first that a member reads on."""
        run = given.runs[name]
        time = run["time"].values.astype(float)
        end = time.size
        x = labelled.sound_matrix(run, given.states, name, slice(first, None))
        span = Span(first, end - 1, max(end - input_map.around.ahead, first))
        u, v = run_regressors(input_map, given, name, span)
        for values in (x, u, v):
            values.flags.writeable = False
        return cls(name, x, u, v, first, float(time[min(first, end - 1)]))

    def without(self, begin: int, end: int, dt: float) -> list[Self]:
        """What lies before some samples and after them, as two runs where both hold something."""
        parts = (
            replace(
                self,
                states=self.states[cut],
                delayed=self.delayed[cut],
                direct=self.direct[cut],
                offset=self.offset + at,
                begin=self.begin + at * dt,
            )
            for cut, at in ((slice(0, begin), 0), (slice(end, None), end))
        )
        return [each for each in parts if len(each.states)]


def member_data(
    arrays: Sequence[RunArrays], settings: HankelSettings, last: int | None, signature: Signature
) -> TrainingData:
    """What :func:`gather` makes of these runs with the settings of a member.

    The windows end at a sample of the run, None for the end of what is given.
    """
    input_map, pieces = replace(signature.input_map, reference=0), []
    for each in arrays:
        end = len(each.states) - 1 if last is None else last - each.offset
        place, shifted, cut = _place(end, settings, input_map)
        series = each.states[cut], each.delayed[cut], each.direct[cut]
        instants = each.begin + place.first * signature.dt, each.begin + end * signature.dt
        pieces.append(Piece(each.name, series, shifted, instants))
    labels = signature.state_labels, signature.input_labels
    return _standardised(pieces, signature.dt, labels, input_map, settings)


def run_regressors(
    input_map: InputMap, given: TrainingRuns, name: str, span: Span, needed: int | None = None
) -> Regressors:
    """Regressors of a training run; inputs as they are may have gaps before `needed`."""
    run, inputs = given.runs[name], given.inputs
    # A map that reaches back has no rows at the start of a run; no column reads those.
    missing = max(0, -input_map.reads(span).first)
    span = span._replace(first=span.first + missing)
    read = input_map.reads(span)
    values = labelled.channel_matrix(run, inputs, name)
    observed = bool(input_map.observed.observables)
    as_is = input_map.alignment is None and not observed and not input_map.lead
    first = needed if as_is and needed is not None else read.first
    labelled.check_finite(values[first : read.stop], inputs, run, name, first)
    surge = None
    if (follows := input_map.follows) is not None:
        surge = labelled.channel_matrix(run, [given.states[follows.column]], name)[:, 0]
    rows = input_map.drive(values, [span], run=run, surge=surge).rows(span.first, span.stop)
    return Regressors(*(np.concatenate([each[:1].repeat(missing, 0), each]) for each in rows))


def _warn_of_dead(
    pieces: Sequence[Piece], group: int, scale: Scale, labels: Sequence[ChannelLabel]
) -> None:
    """Warn of channels that move in some runs and stand still in others."""
    for piece in pieces:
        seen = piece.series[group][piece.window.samples]
        # A constant that is not a binary fraction has a spread of rounding, not of zero.
        still = np.ptp(seen, axis=0) <= 1e-12 * np.abs(seen).max(axis=0, initial=0.0)
        for column in np.flatnonzero(still & (scale.spread > 0)).tolist():
            warn(
                f"channel '{labels[column].name}' of {piece.name} is constant "
                f"({seen[0, column]:.6g}) over its training window, and moves in other runs. If "
                "its sensor was dead, leave this run out: the model would learn that nothing moves."
            )


def _check_length(
    place: TrainingWindow, final: int, name: str, settings: HankelSettings, reach: int
) -> None:
    window, history = settings.window, settings.history
    if window is not None and place.first < 0:
        raise DataError(
            f"{name} has {place.last + 1} samples up to the end of the training window, which asks "
            f"for {window}: {-place.first} are missing. Shorten window, or give a longer run (span "
            "or train in [runs.NAME])."
        )
    if final - place.first_column < 1:
        needed = reach + 2 + place.last - final
        received = (place.last + 1) if window is None or history == "before" else window
        raise DataError(
            f"{name} is too short for its delays: {needed} samples are needed (delay history of "
            f"{reach}, one snapshot and its successor{', lead' if final < place.last else ''}), "
            f"{received} were received, "
            f"{needed - received} are missing. Reduce the delays, or give a longer "
            f"{'window' if history == 'inside' and window is not None else 'run'}."
        )


def _counted(window: TrainingWindow) -> tuple[slice, slice, slice]:
    """Samples of states, delayed and direct regressors that moments are taken of.

    Direct ones count from the first snapshot pair on: before it they may need inputs that are not
    there.
    """
    first = max(window.first, window.first_column)
    return window.samples, window.samples, slice(first, window.last + 1)


def moments(
    series: Sequence[FloatArray],
    labels: Sequence[ChannelLabel],
    standardize: bool,
) -> Scale:
    """Means and standard deviations (ddof = 1) over all runs.

    Raises
    ------
    DataError
        If a channel is constant there and `standardize` is set.
    """
    if not labels:
        return Scale(*np.zeros((5, 0)))
    # Sums along contiguous memory take half the time.
    pooled = np.ascontiguousarray(np.concatenate(list(series)).T)
    with undefined():
        mean = pooled.sum(axis=1) / pooled.shape[1]
        centred = pooled - mean[:, None]
        spread = np.sqrt(np.einsum("ct,ct->c", centred, centred) / (pooled.shape[1] - 1))
    if not np.isfinite(spread).all():
        column = int(np.flatnonzero(~np.isfinite(spread))[0])
        raise DataError(
            f"channel '{labels[column].name}' has a standard deviation that is not finite over the "
            f"training window: its largest value is {np.abs(pooled[column]).max():.3g}. Look "
            "for a fault of the sensor or of its conversion."
        )
    reach = np.abs(centred, out=centred).max(axis=1)
    # A constant that is not a binary fraction has a spread of rounding, not of zero.
    constant = spread <= 1e-12 * np.abs(mean)
    if constant.any():
        spread[constant] = reach[constant] = 0.0
    if not standardize:
        return Scale(np.zeros(mean.size), np.ones(mean.size), spread, mean, reach)
    if constant.any():
        column = int(np.flatnonzero(constant)[0])
        raise DataError(
            f"channel '{labels[column].name}' is constant ({pooled[column, 0]:g}) over the "
            "training window, so it cannot be standardised. Look for a dead sensor, choose another "
            "window, leave the channel out, or set standardize=False."
        )
    return Scale(mean, spread, spread, mean, reach)
