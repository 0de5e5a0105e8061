r"""Settings chosen by free runs on training runs that are held out.

Each candidate is fitted to all training runs but one and judged by its free runs on that one, in
windows of one or two lengths; the mean over folds, windows and channels of the NRMSE decides. The
columns of all candidates are built once: a fold, a choice of delays and of observables is a part of
one Gram matrix, and one eigendecomposition gives every λ (:mod:`seakeep.core.path`).
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator, Mapping, MutableMapping, Sequence
from concurrent.futures import Executor
from dataclasses import astuple, dataclass, field, replace
from typing import Any, Generic, TypeVar

import numpy as np
import xarray as xr

from seakeep.arrays import BoolArray, FloatArray, IntArray
from seakeep.conventions import is_elevation
from seakeep.core import metrics
from seakeep.core.path import Moments, lagged, ridge_path, truncated_path
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.models import labelled
from seakeep.models.alignment import Mode, ProbeAlignment, Surge
from seakeep.models.engine import Dynamics, Windows, model_runs
from seakeep.models.executor import Progress, in_order
from seakeep.models.following import LEAD
from seakeep.models.inputs import Drive
from seakeep.models.interface import Scale
from seakeep.models.labelled import mean_period
from seakeep.models.observables import Observable, Powers, SlowSquares, named
from seakeep.models.readouts import FittedReadOut, ReadOut, readouts_asked
from seakeep.models.settings import Folds, HankelSettings, Select
from seakeep.models.stacking import PERIODS, Held, fit_readouts
from seakeep.models.training import TrainingData, gather
from seakeep.signals import repeated_waves

__all__ = [
    "RIDGES",
    "VARIED",
    "Candidate",
    "Choice",
    "Problem",
    "Selected",
    "Trial",
    "default_observables",
    "readouts_for",
    "search",
    "select",
    "settle",
    "split",
]

RIDGES = tuple(float(f"{10 ** (exponent / 2):.3g}") for exponent in range(-10, -1))
"""λ per snapshot pair that are tried, half a decade apart.

On the virtual tank and on both measured sets the best lies between 3e-5 and 3e-2; the error is flat
within half a decade of it."""
Scales = tuple[
    tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]
]
"""Mean and standard deviation of the states, of the delayed and of the direct regressors."""
Variant = tuple[ProbeAlignment | None, int | None]
"""An alignment, and the look-ahead in samples where it is part of it: columns of their own."""
Settings = TypeVar("Settings", bound=HankelSettings)
Chosen = TypeVar("Chosen")
ALIKE = 0.03
"""Part of the lowest error by which the chosen λ may be worse.

On the virtual tank the error falls by that much over the last decade of λ: less than from one
seed to the next. Free runs of a larger λ decay sooner. Where sea states are held out the lowest
error decides: slow loads of other seas suffer most from a large λ."""
FALLBACK = 1e-3
"""λ per snapshot pair where nothing can be held out."""
RANKS = tuple(round(2 ** (exponent / 2)) for exponent in range(18, 7, -1))
"""Numbers of singular values that are tried, half an octave apart: 512 to 16."""
LEADS = (0.0, 0.5, 0.75, 1.0)
"""Look-aheads that are tried, encounter periods."""
VARIED = (
    *("ridge", "rank", "observables", "lead", "input_delays", "state_delays", "alignment"),
    "readouts",
)
"""Settings that can be chosen."""
WORST = 1.0
"""NRMSE at which a channel counts no worse: a forecast that is no better than the mean is none.

Runs that no setting can forecast, or windows of calm water, must not decide for all others."""


@dataclass(frozen=True)
class Candidate:
    """A choice of columns.

    Parameters
    ----------
    state_delays, input_delays : int
        s and z.
    lead : int
        Look-ahead of the delayed regressors, samples.
    observables : tuple of int
        Those that are taken, by their place among all.
    alignment : int
        That which is taken, by its place among all.
    truncated : bool
        Whether singular values are cut off instead of λ.
    """

    state_delays: int
    input_delays: int
    lead: int
    observables: tuple[int, ...]
    alignment: int = 0
    truncated: bool = False


@dataclass(frozen=True, eq=False)
class Trial:
    """Scores of a candidate.

    Parameters
    ----------
    levels : tuple of float
        λ, or numbers of singular values.
    scores : ndarray, shape (level, window)
        NRMSE averaged over the channels, by window of all folds and horizons.
    weights : ndarray, shape (window,)
        They sum to one; folds count alike, and the horizons of a fold.
    """

    levels: tuple[float, ...]
    scores: FloatArray
    weights: FloatArray

    @property
    def means(self) -> FloatArray:
        """Score at each level."""
        result: FloatArray = self.scores @ self.weights
        return result


@dataclass(frozen=True, eq=False)
class _Regression:
    """Models that have not seen one run: its number, their scales, and coefficients by level."""

    fold: int
    scales: Scales
    weights: FloatArray


@dataclass(frozen=True, eq=False)
class Problem:
    """Training runs with the columns of all candidates.

    Parameters
    ----------
    data : TrainingData
        Gathered with the longest delays, the longest lead and all observables.
    drives : tuple of Drive
        One per run, where the model follows its own surge.
    offsets : tuple of int
        Sample of each run at which its arrays in `data` start.
    widest : Candidate
        What `data` was gathered with.
    owners : tuple of int
        For each delayed column the observable that made it, −1 for an input itself.
    direct_owners : tuple of int
        For each direct column the observable that made it, −1 for the slow surge squared.
    horizons : tuple of int
        Lengths of the windows, samples.
    is_per_snapshot : bool
        Whether λ counts per snapshot pair.
    groups : tuple of str
        One per run: runs of one group do not teach what is judged on another of it.
    """

    data: TrainingData
    drives: tuple[Drive, ...]
    offsets: tuple[int, ...]
    widest: Candidate
    owners: tuple[int, ...]
    direct_owners: tuple[int, ...]
    horizons: tuple[int, ...]
    is_per_snapshot: bool
    groups: tuple[str, ...]
    moments: tuple[Moments, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        made = tuple(self._moments(run) for run in range(len(self.data.names)))
        object.__setattr__(self, "moments", made)

    def _moments(self, run: int) -> Moments:
        data, window, widest = self.data, self.data.windows[run], self.widest
        first, count = window.first_column, window.columns
        parts = [
            lagged(data.states[run], first, count, widest.state_delays),
            lagged(data.delayed[run], first, count, widest.input_delays),
            data.direct[run][first : first + count],
        ]
        targets = data.states[run][first + 1 : first + 1 + count]
        return Moments.of(np.concatenate(parts, axis=1), targets)

    def columns(self, candidate: Candidate) -> IntArray:
        """Columns of a candidate among those of the widest."""
        N, Q = self.data.states[0].shape[1], self.data.delayed[0].shape[1]
        states = np.arange(N * (candidate.state_delays + 1))
        kept = np.flatnonzero(self._delayed(candidate))
        ahead = self._ahead(candidate)
        lags = np.arange(ahead, ahead + candidate.input_delays + 1)
        first = N * (self.widest.state_delays + 1)
        delayed = (first + Q * lags[:, None] + kept).ravel()
        first += Q * (self.widest.input_delays + 1)
        direct = first + np.flatnonzero(self._direct(candidate))
        return np.concatenate([states, delayed, direct])

    def _ahead(self, candidate: Candidate) -> int:
        """Samples that delayed columns look ahead too far; none where the model follows."""
        return 0 if self.data.input_map.follows else self.widest.lead - candidate.lead

    def _delayed(self, candidate: Candidate) -> BoolArray:
        return np.isin(self.owners, (-1, *candidate.observables))

    def _direct(self, candidate: Candidate) -> BoolArray:
        return np.isin(self.direct_owners, (-1, *candidate.observables))

    def levels(self, candidate: Candidate, ridges: Sequence[float]) -> tuple[float, ...]:
        """What is tried of a candidate: these λ, or ranks below its number of columns."""
        if not candidate.truncated:
            return tuple(ridges)
        return tuple(rank for rank in RANKS if rank < len(self.columns(candidate)))

    def _path(
        self,
        candidate: Candidate,
        levels: Sequence[float],
        gram: FloatArray,
        right: FloatArray,
        count: int,
    ) -> FloatArray:
        """Coefficients at each level, shape (level, N, p)."""
        if candidate.truncated:
            return truncated_path(gram, right, [int(level) for level in levels])
        factor = count if self.is_per_snapshot else 1
        return ridge_path(gram, right, [factor * level for level in levels])

    def radius(self, candidate: Candidate, level: float) -> float:
        """Spectral radius of the model that a candidate gives of all runs."""
        scales, gram, right, count = self._system(candidate, range(len(self.data.names)))
        size = len(scales[0][0]) * (candidate.state_delays + 1)
        top = self._path(candidate, [level], gram, right, count)[0, :, :size]
        square = np.concatenate([top, np.eye(size - len(top), size)])
        return float(np.abs(np.linalg.eigvals(square)).max())

    def others(self, run: int) -> list[int]:
        """Runs that teach what is judged on a run: those of other groups, if there are any."""
        rest = [other for other in range(len(self.groups)) if other != run]
        return [other for other in rest if self.groups[other] != self.groups[run]] or rest

    def folds(self) -> list[int]:
        """Runs in which a window of some horizon fits: each is held out once."""
        return [
            run
            for run in range(len(self.data.names))
            if any(self._starts(run, steps).size for steps in self.horizons)
        ]

    def held(self, candidate: Candidate, level: float, steps: int) -> Iterator[Held]:
        """Free runs, end to end, on each run by the model of the others."""
        for run in range(len(self.data.names)):
            if len(self.data.names) > 1 and (starts := self._starts(run, steps)).size:
                predicted = self._forecast(candidate, self._without(candidate, [level], run), steps)
                yield Held(run, predicted[0], self._measured(run, starts, steps))

    def _starts(self, run: int, steps: int) -> IntArray:
        """Samples from which windows end to end are forecast in a run that is held out."""
        window = self.data.windows[run]
        return np.arange(window.first_column, window.last - steps + 1, steps)

    def judge(
        self, candidate: Candidate, levels: Sequence[float], fold: int
    ) -> Iterator[FloatArray]:
        """Scores, shape (level, window), for each horizon that fits into the held-out run."""
        held = self._without(candidate, levels, fold)
        spread = held.scales[0][1]
        for steps in self.horizons:
            starts = self._starts(fold, steps)
            if starts.size:
                predicted = self._forecast(candidate, held, steps)
                measured = self._measured(fold, starts, steps)
                with np.errstate(over="ignore", invalid="ignore"):
                    errors = metrics.nrmse(
                        predicted=predicted, measured=measured, training_std=spread
                    )
                judged = ~metrics.is_slack(
                    predicted=measured, measured=measured, training_std=spread
                )
                errors = np.where(np.isfinite(errors), np.minimum(errors, WORST), WORST)
                moved = judged.any(axis=-1)
                yield np.mean(errors[:, moved], axis=-1, where=judged[moved])

    def _measured(self, run: int, starts: IntArray, steps: int) -> FloatArray:
        states = self.data.states[run]
        return np.stack([states[at + 1 : at + 1 + steps] for at in starts])

    def _without(self, candidate: Candidate, levels: Sequence[float], fold: int) -> _Regression:
        """Models of the other runs, at each level."""
        others = self.others(fold)
        scales, gram, right, count = self._system(candidate, others)
        return _Regression(fold, scales, self._path(candidate, levels, gram, right, count))

    def _forecast(self, candidate: Candidate, held: _Regression, steps: int) -> FloatArray:
        """Free runs on the run that is held out, shape (level, window, steps, N).

        They are in the standardised deviations of `data`.
        """
        data, fold, follows = self.data, held.fold, self.data.input_map.follows
        s, z, ahead = candidate.state_delays, candidate.input_delays, self._ahead(candidate)
        kept, direct = self._delayed(candidate), self._direct(candidate)
        own = (data.state_scale, data.input_scale, data.direct_scale)
        parts = (slice(None), kept, direct)
        x, u, w = (_scale(*each) for each in zip(own, held.scales, parts, strict=True))
        starts, rows = self._starts(fold, steps), s + 1
        if follows is not None:
            rows = max(rows, follows.place.taps.size)
        states = data.state_scale.physical(data.states[fold])
        delayed = data.input_scale.physical(data.delayed[fold])[:, kept]
        straight = data.direct_scale.physical(data.direct[fold])[:, direct]
        windows = Windows(
            places=(("a run held out", 0.0),) * len(starts),
            steps=steps,
            time=(),
            histories=np.stack([states[at + 1 - rows : at + 1] for at in starts]),
            delayed=np.stack([delayed[at - ahead - z : at - ahead + steps] for at in starts]),
            direct=np.stack([straight[at : at + steps] for at in starts]),
        )
        if follows is not None:
            first, last = starts[[0, -1]] + self.offsets[fold]
            table = self.drives[fold].table(int(first), int(last) + steps)[:, :, kept]
            squares = windows.direct[..., :-1]
            windows = replace(windows, direct=squares, table=table, starts=starts - starts[0])
        scales = Dynamics(held.weights[0], s, z, x, u, w, follows)
        found = model_runs(scales, held.weights, windows)
        return data.state_scale.deviations(np.nan_to_num(found, nan=np.inf))

    def _system(
        self, candidate: Candidate, runs: Sequence[int]
    ) -> tuple[Scales, FloatArray, FloatArray, int]:
        """Moments of states and both kinds of regressors, Gram matrix, right-hand side, pairs."""
        data, s, z = self.data, candidate.state_delays, candidate.input_delays
        x, u = (_pooled(series, data, runs, False) for series in (data.states, data.delayed))
        w = _pooled(data.direct, data, runs, True)
        if (stretch := data.input_map.stretch) is not None:
            u, w = ((each[0], each[1] * by) for each, by in zip((u, w), stretch, strict=True))
        kept, direct = self._delayed(candidate), self._direct(candidate)
        mean, scale = (
            np.concatenate(
                [np.tile(x[part], s + 1), np.tile(u[part][kept], z + 1), w[part][direct]]
            )
            for part in (0, 1)
        )
        total = sum((self.moments[run] for run in runs[1:]), self.moments[runs[0]])
        system = total.chosen(self.columns(candidate)).standardised(mean, scale, *x)
        return (x, u, w), *system, total.count


def _scale(own: Scale, moments: tuple[FloatArray, FloatArray], part: Any) -> Scale:
    """Moments of some columns in physical units, of moments of standardised deviations."""
    mean, std = own.mean + own.std * moments[0], own.std * moments[1]
    return Scale(*(each[part] for each in (mean, std, own.spread, own.centre, own.reach)))


def _pooled(
    series: Sequence[FloatArray], data: TrainingData, runs: Sequence[int], is_direct: bool
) -> tuple[FloatArray, FloatArray]:
    """Mean and standard deviation (ddof = 1) over the windows of some runs, as a fit takes them."""
    parts = []
    for run in runs:
        window = data.windows[run]
        first = max(window.first, window.first_column) if is_direct else window.first
        parts.append(series[run][first : window.last + 1])
    values = np.concatenate(parts)
    return values.mean(axis=0), values.std(axis=0, ddof=1)


def split(
    runs: Mapping[str, xr.Dataset], parts: int, before: int = 0, after: int = 0
) -> dict[str, xr.Dataset]:
    """Parts of runs, end to end: what is held out in turn where there is one run alone.

    Each part comes with as many samples `before` and `after` it as a snapshot pair reads, so that
    every pair of the run is in one of the parts.
    """
    out = {}
    for name, run in runs.items():
        edges = np.linspace(before, run.sizes["time"] - after, parts + 1).astype(int)
        for number, (first, stop) in enumerate(itertools.pairwise(edges), start=1):
            samples = slice(max(first - before, 0), stop + after)
            out[f"{name}, part {number}"] = run.isel(time=samples)
    return out


@dataclass(frozen=True, eq=False)
class Choice:
    """Result of a search.

    Parameters
    ----------
    candidate : Candidate
        Columns.
    level : float
        λ, or the number of singular values of a truncated candidate.
    trials : tuple of (Candidate, Trial)
        All that was tried, in order.
    """

    candidate: Candidate
    level: float
    trials: tuple[tuple[Candidate, Trial], ...]


def search(
    problems: Sequence[Problem],
    base: Candidate,
    options: Mapping[str, Sequence[Any]],
    ridges: Sequence[float],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
    known: MutableMapping[str, list[list[list[float]]]] | None = None,
    alike: float = ALIKE,
) -> Choice:
    """Choose columns and λ: one setting after the other, each with the whole path of λ.

    Parameters
    ----------
    problems : sequence of Problem
        Training runs, one per alignment.
    base : Candidate
        Where the search starts.
    options : mapping of str to sequence
        Values to try of fields of :class:`Candidate`.
    ridges : sequence of float
        λ to try, in ascending order.
    executor : Executor, optional
        Judges candidates and folds side by side; the result is the same.
    progress : callable, optional
        Called with what is done.
    known : mapping, optional
        Scores by candidate and fold that need not be found again; new ones are added.
    alike : float
        Part of the lowest error by which the chosen λ may be worse.

    Returns
    -------
    Choice
        The best columns, and the largest λ (or the smallest rank) that is as good as the best.
        Where that model grows, the best of all that were tried and do not.
    """
    known = {} if known is None else known
    trials: dict[Candidate, Trial] = {}
    best, folds = base, len(problems[0].folds())
    later = folds * sum(len(values) - 1 for values in options.values())  # the best is tried again
    for key, values in (("", [None]), *options.items()):
        tried = [replace(best, **{key: value}) if key else best for value in values]
        later -= folds * (len(values) - 1)
        tell = _counted(progress, folds * len(trials), later)
        for candidate, trial in _judged(problems, tried, ridges, executor, tell, known):
            trials.setdefault(candidate, trial)
        best = min(trials, key=lambda each: float(trials[each].means.min()))
    means = trials[best].means
    largest = int(np.flatnonzero(means <= (1.0 + alike) * means.min())[-1])
    every = [
        (float(score), candidate, level)
        for candidate, trial in trials.items()
        for score, level in zip(trial.means, trial.levels, strict=True)
    ]
    wanted = [(best, trials[best].levels[largest])]
    wanted += [each[1:] for each in sorted(every, key=lambda each: each[0])]
    still = (each for each in wanted if problems[each[0].alignment].radius(*each) < 1.0)
    return Choice(*next(still, wanted[0]), tuple(trials.items()))


def _counted(progress: Progress | None, before: int, after: int) -> Progress | None:
    """Progress of a part, counted among what was done before it and what comes after."""
    if progress is None:
        return None
    return lambda done, total, what: progress(before + done, before + total + after, what)


def _judged(
    problems: Sequence[Problem],
    candidates: Sequence[Candidate],
    ridges: Sequence[float],
    executor: Executor | None,
    progress: Progress | None,
    known: MutableMapping[str, list[list[list[float]]]],
) -> Iterator[tuple[Candidate, Trial]]:
    folds = problems[0].folds()

    def levels(candidate: Candidate) -> tuple[float, ...]:
        return problems[candidate.alignment].levels(candidate, ridges)

    todo = [
        (candidate, levels(candidate), fold)
        for candidate in dict.fromkeys(candidates)
        for fold in folds
        if _key(candidate, fold) not in known
    ]
    made = in_order(_unit, tuple(problems), todo, executor, progress, "candidate and fold")
    for (candidate, _, fold), scores in zip(todo, made, strict=True):
        known[_key(candidate, fold)] = [each.tolist() for each in scores]
    for candidate in dict.fromkeys(candidates):
        scores, weights = [], []
        for fold in folds:
            found = [np.array(each) for each in known[_key(candidate, fold)]]
            horizons = [each for each in found if each.shape[1]]  # in others nothing moves
            scores += horizons
            weights += [
                np.full(each.shape[1], 1.0 / (len(horizons) * each.shape[1])) for each in horizons
            ]
        joined = np.concatenate(weights)  # a fold sums to one, unless nothing moves in it
        kept = np.concatenate(scores, axis=1), joined / joined.sum()
        yield candidate, Trial(levels(candidate), *kept)


def _key(candidate: Candidate, fold: int) -> str:
    return json.dumps([*astuple(candidate), fold])


def _unit(
    problems: Sequence[Problem], item: tuple[Candidate, Sequence[float], int]
) -> list[FloatArray]:
    return list(problems[item[0].alignment].judge(*item))


@dataclass(frozen=True, eq=False)
class Selected(Generic[Chosen]):
    """Settings that free runs chose, and the evidence.

    Parameters
    ----------
    settings : HankelDMDc or BayesianHankelDMDc
        Complete: nothing is left to be chosen.
    rows : tuple of dict
        One per candidate and λ: settings, mean score, bounds of its 95 % interval, and whether it
        was chosen.
    note : str
        How it was chosen, in words.
    readouts : tuple of FittedReadOut
        Read-outs of these settings, fitted.
    """

    settings: Chosen
    rows: tuple[dict[str, Any], ...]
    note: str
    readouts: tuple[FittedReadOut, ...] = ()

    def describe(self) -> str:
        """Text: how the choice was made, and the best λ of each candidate."""
        keys = ["observables", "lead", "state_delays", "input_delays"]
        if len({row["alignment"] for row in self.rows}) > 1:
            keys.append("alignment")
        groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
        for row in self.rows:
            candidate = (*(row[key] for key in keys), row["rank"] > 0)
            groups.setdefault(candidate, []).append(row)
        lines = [self.note]
        for values, part in groups.items():
            best = min(part, key=lambda row: (not row["chosen"], row["score"]))
            what = ", ".join(f"{key} {value}" for key, value in zip(keys, values, strict=False))
            level = f"rank {best['rank']}" if best["rank"] else f"ridge {best['ridge']:g}"
            lines.append(
                f"  {best['score']:.3f} [{best['lower']:.3f}, {best['upper']:.3f}]  {level}, "
                f"{what}{'  (chosen)' if best['chosen'] else ''}"
            )
        return "\n".join(lines)


def settle(
    settings: Settings,
    chosen: Select | None,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Selected[Settings]:
    """Choose all that settings leave open.

    Parameters
    ----------
    settings : HankelSettings
        What was asked for.
    chosen : Select, optional
        What is chosen beside λ, and how.
    runs, states, inputs
        As in :func:`select`.
    executor, progress
        As in :func:`search`.

    Returns
    -------
    Selected
        With λ as a number.

    Raises
    ------
    RequestError
        As :func:`select`; if λ is stated as zero and something is to be chosen.
    """
    alignment = settings.alignment
    lacking = alignment.missing(runs, states, inputs) if alignment and alignment.optional else ""
    without = f"not aligned to the surge: {lacking}" if lacking else ""
    stated = not isinstance(settings.ridge, str)
    if stated and chosen is None:
        return Selected(settings, (), without)
    if settings.ridge == 0:
        raise RequestError(
            "free runs choose at λ above zero, and ridge = 0 is stated. Set ridge = 'rollout', or "
            "remove select."
        )
    asked = chosen or Select()
    vary = ["ridge"] + ["observables"] * asked.observables
    vary += ["readouts"] * (settings.readouts == "auto")
    found = select(
        settings,
        runs,
        states,
        inputs,
        vary=vary,
        ridges=(float(settings.ridge),) if stated else None,
        horizon=asked.horizon,
        folds=asked.folds,
        period=asked.period,
        executor=executor,
        progress=progress,
    )
    return replace(found, note="; ".join(filter(None, (found.note, without))))


def select(
    settings: Settings,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    *,
    vary: Sequence[str] = ("ridge",),
    ridges: Sequence[float] | None = None,
    horizon: Sequence[float] = (15.0, 45.0),
    folds: Folds | int = "auto",
    period: float | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    known: MutableMapping[str, Any] | None = None,
    seed: int = 0,
) -> Selected[Settings]:
    """Choose settings by free runs on training runs that are held out in turn.

    Parameters
    ----------
    settings : HankelSettings
        Where the search starts; what `vary` does not name stays.
    runs : mapping of str to Dataset
        Training runs, cut at the end of their training windows.
    states, inputs : sequence of str
        Channels.
    vary : sequence of str
        Names out of ``VARIED``; λ is always chosen.
    ridges : sequence of float, optional
        λ to try, as the settings count it; by default ``RIDGES`` per snapshot pair.
    horizon : sequence of float
        Lengths of the windows that are judged, encounter periods.
    folds : {"auto", "run", "sea_state"} or int, optional
        What is held out in turn: a run, with others as :func:`groups_of` says, or a part of a run:
        their number. A single run is held out in three parts.
    period : float, optional
        Encounter period, s; by default that of the runs.
    executor, progress, known
        As in :func:`search`.
    seed : int
        Of the bootstrap of the intervals.

    Returns
    -------
    Selected
        Where no window fits into what could be held out, λ is ``FALLBACK`` per snapshot pair.

    Raises
    ------
    RequestError
        If `vary` names something else, or the delay rows are not exact.
    """
    labels = labelled.common_labels(runs, states)
    readouts = readouts_asked(settings.readouts, labels)
    _check_asked(settings, vary, readouts)
    if isinstance(folds, str) and len(runs) == 1:
        folds = 3
    apart = folds if isinstance(folds, int) else groups_of(runs, folds, inputs)
    step = labelled.common_step(runs)
    samples = mean_period(runs, list(inputs)) if period is None else period / step
    if "readouts" in vary:
        asked = readouts or readouts_asked("auto", labels)
        readouts = tuple(replace(each, kind="auto") for each in asked)
    variants = list(_variants(settings, runs, states, inputs, vary, samples))
    wanted = [settings.observables]
    if "observables" in vary and not settings.observables:
        wanted = _defaults(settings, runs, states, inputs, samples * step, folds == "sea_state")
    base = Candidate(
        settings.state_delays,
        settings.input_delays,
        int(settings.lead),
        tuple(range(len(settings.observables))),
    )
    if ridges is None:
        settings = replace(settings, ridge=FALLBACK, ridge_scale="per_snapshot")
        ridges = RIDGES
    for chosen in wanted:  # runs may be too short for the longest
        options = _options(vary, samples, len(chosen), variants)
        made = [
            _problem(
                replace(
                    settings,
                    observables=chosen,
                    alignment=alignment,
                    lead=base.lead if lead is None else lead,
                ),
                runs,
                states,
                inputs,
                base if lead is None else replace(base, lead=lead),
                options if lead is None else {**options, "lead": []},
                tuple(max(round(each * samples), 1) for each in horizon),
                apart,
            )
            for alignment, lead in variants
        ]
        problems = [problem for problem in made if problem is not None and problem.folds()]
        if len(problems) == len(variants):
            break
    else:
        longest = max(run.sizes["time"] for run in runs.values())
        return _with_readouts(
            settings,
            (),
            f"ridge {settings.ridge:g} per snapshot pair: no window of "
            f"{round(min(horizon) * samples)} samples can be held out of runs of at most {longest}",
            fit_readouts(readouts, _measured(settings, runs, states, inputs), ())
            if readouts
            else (),
            "readouts" in vary,
        )
    known = {} if known is None else known
    found = search(
        problems,
        base,
        options,
        ridges,
        executor=executor,
        progress=progress,
        known=known,
        alike=0.0 if folds == "sea_state" else ALIKE,
    )
    taken = found.candidate
    without = [
        replace(taken, observables=tuple(each for each in taken.observables if each != number))
        for number in taken.observables
    ]
    trials = dict(found.trials)
    untried = [each for each in without if each not in trials]
    tell = _counted(progress, len(trials) * len(problems[0].folds()), 0)
    trials |= dict(_judged(problems, untried, ridges, executor, tell, known))
    found = replace(found, trials=tuple(trials.items()))
    best = trials[taken]
    score = float(best.means[best.levels.index(found.level)])
    alignment, lead = variants[taken.alignment]
    complete = replace(
        settings,
        state_delays=found.candidate.state_delays,
        input_delays=found.candidate.input_delays,
        lead=found.candidate.lead if lead is None else lead,
        observables=tuple(chosen[number] for number in found.candidate.observables),
        alignment=alignment,
        rank=int(found.level) if taken.truncated else None,
        ridge=0.0 if taken.truncated else found.level,
    )
    level = (
        f"rank {found.level:g}" if taken.truncated else f"ridge {found.level:g} per snapshot pair"
    )
    count = sum(len(trial.means) for _, trial in found.trials)
    note = (
        f"{level}: out of {count} settings (below, the best λ of each kind) in free runs on "
        f"{len(problems[0].folds())} parts held out in turn, mean NRMSE {score:.3f}"
    )
    note += "".join(
        f"; without {named(chosen[number])} {trials[less].means.min():.3f}"
        for number, less in zip(taken.observables, without, strict=True)
    )
    lengths = {"lead", "input_delays", "state_delays", "alignment"} & {*vary}
    note += "; over instants that all of these can forecast" * bool(lengths)
    groups = problems[0].groups
    if folds == "sea_state" or len(set(groups)) < len(groups):
        note += f"; {_words_of_groups(groups, folds == 'sea_state')}"
    rows = tuple(_rows_of(found, chosen, variants, seed))
    fitted: tuple[FittedReadOut, ...] = ()
    if readouts:
        problem = problems[taken.alignment]
        held = list(problem.held(taken, found.level, round(PERIODS * samples)))
        fitted = fit_readouts(readouts, problem.data, held)
    return _with_readouts(complete, rows, note, fitted, "readouts" in vary)


def _check_asked(
    settings: HankelSettings, vary: Sequence[str], readouts: Sequence[ReadOut]
) -> None:
    """Refuse what cannot be chosen."""
    for name in vary:
        if name not in VARIED:
            raise RequestError(
                f"vary names '{name}'.{did_you_mean(name, VARIED)} Choose among "
                f"{', '.join(VARIED)}."
            )
    if settings.delay_rows != "exact" or settings.rank is not None:
        raise RequestError(
            "choosing by free runs takes delay_rows = 'exact' and no rank; received delay_rows = "
            f"'{settings.delay_rows}', rank = {settings.rank}. Change them, or fit without a "
            "choice: state ridge, and no select."
        )
    if "rank" in vary and (readouts or "readouts" in vary):
        raise RequestError(
            "vary names 'rank', and read-outs learn from free runs of ridge regressions. Leave out "
            "'rank', or the read-outs: readouts = {} in a campaign file."
        )


def _with_readouts(
    settings: Settings,
    rows: tuple[dict[str, Any], ...],
    note: str,
    readouts: tuple[FittedReadOut, ...],
    chosen: bool,
) -> Selected[Settings]:
    """What was selected, with the kinds of read-outs in the settings where they were chosen."""
    if chosen:
        kinds = tuple(
            ReadOut(each.channel, each.of, each.kind) for each in readouts if each.kind != "none"
        )
        settings = replace(settings, readouts=kinds)
    return Selected(settings, rows, note, readouts)


def readouts_for(
    settings: HankelSettings,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
) -> tuple[FittedReadOut, ...]:
    """Fit the read-outs of settings that leave nothing else to be chosen.

    Parameters
    ----------
    settings : HankelSettings
        Delays, λ and input maps as stated.
    runs : mapping of str to Dataset
        Training runs, cut at the end of their training windows.
    states, inputs : sequence of str
        Channels.

    Returns
    -------
    tuple of FittedReadOut

    Raises
    ------
    RequestError
        If a read-out names what is no state, or λ is zero where forecasts are cross-fitted.
    DataError
        If a stacked read-out has no forecast to learn from.
    """
    readouts = readouts_asked(settings.readouts, labelled.common_labels(runs, states))
    if not readouts:
        return ()
    stacked = [each for each in readouts if each.kind != "hinge"]
    if not stacked:
        return fit_readouts(readouts, _measured(settings, runs, states, inputs), ())
    ridge = float(settings.ridge)
    if ridge == 0.0:
        raise RequestError(
            f"readouts: {stacked[0].channel}: kind = '{stacked[0].kind}' learns from free runs of "
            "ridge regressions, which take ridge above zero. Raise ridge, or take kind = 'hinge'."
        )
    steps = round(PERIODS * mean_period(runs, list(inputs)))
    base = Candidate(settings.state_delays, settings.input_delays, int(settings.lead), ())
    base = replace(base, observables=tuple(range(len(settings.observables))))
    if len(runs) == 1 and settings.window is not None:  # whose parts are shorter
        runs = {name: run.isel(time=slice(-settings.window, None)) for name, run in runs.items()}
        settings = replace(settings, window=None)
    apart = 3 if len(runs) == 1 else groups_of(runs, "auto", inputs)
    problem = _problem(settings, runs, states, inputs, base, {}, (steps,), apart)
    if problem is None:
        return fit_readouts(readouts, _measured(settings, runs, states, inputs), ())
    return fit_readouts(readouts, problem.data, list(problem.held(base, ridge, steps)))


def _measured(
    settings: HankelSettings,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
) -> TrainingData:
    """States of the training windows, standardised."""
    return gather(runs, states, inputs, None, replace(settings, ridge=1.0, standardize=True))


def default_observables(
    inputs: Sequence[str],
    period: float | None = None,
    unseen: bool = False,
    follows: int | None = None,
) -> tuple[Observable, ...]:
    """Slow squares of the elevation at the vessel, or of all, and powers of all elevations.

    `period` is the encounter period, s; by default that of the training runs. Where what is chosen
    must hold in sea states that are `unseen`, several elevations give their envelopes alone,
    without a look-ahead: few training seas do not tell how a force is weighed by frequency, and
    probes away from the vessel see the waves before it. A model that `follows` its own surge and
    looks so many samples ahead takes a filter of one period that reads no further than its waves;
    without a look-ahead the squares of all elevations, of which those up-wave tell what comes.
    """
    elevations = tuple(name for name in inputs if is_elevation(name))
    if not elevations:
        return ()
    at_vessel = tuple(name for name in elevations if name == "eta_cog") or elevations
    slow = SlowSquares(at_vessel, period=period)
    if follows is not None:
        lead, of = (0.75, at_vessel) if follows else (0.0, elevations)
        slow = replace(slow, of=of, cutoff=1.0, lead=lead)
    elif unseen and len(at_vessel) > 1:
        slow = replace(slow, orders=(0,), lead=0.0)
    return slow, Powers(elevations)


def _options(
    vary: Sequence[str], period: float, observables: int, variants: Sequence[Variant]
) -> dict[str, list[Any]]:
    """Values to try of the fields of a candidate."""
    found: dict[str, list[Any]] = {}
    if "observables" in vary:
        every = tuple(range(observables))
        found["observables"] = list(dict.fromkeys([(), *((number,) for number in every), every]))
    for name, periods in (
        ("lead", LEADS),
        ("input_delays", (2.0, 3.0, 5.0)),
        ("state_delays", (0.5, 1.0, 1.5)),
    ):
        if name in vary:
            found[name] = [round(each * period) for each in periods]
    if "rank" in vary:
        found["truncated"] = [False, True]
    if all(lead is not None for _, lead in variants):
        found.pop("lead", None)
    found["alignment"] = list(range(len(variants)))
    return found


def _alignments(
    stated: ProbeAlignment | None,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
) -> list[ProbeAlignment | None]:
    """Alignments that these runs allow and that differ, the stated one first, and none.

    None reads the measured surge: what is read after a start is no choice of a setting.
    """
    base = replace(stated or ProbeAlignment(), optional=False)
    found: list[ProbeAlignment | None] = []
    modes: tuple[Mode, ...] = ("dispersion", "effective")
    surges: tuple[Surge, ...] = ("predicted", "none")
    for mode, surge in itertools.product(modes, surges):
        if surge == "predicted" and mode == "effective":
            continue
        made = replace(
            base,
            mode=mode,
            surge=surge,
            celerity=base.celerity if mode == "effective" else None,
            highest_frequency=base.highest_frequency if mode == "dispersion" else None,
        )
        try:
            fitted = made.fit(runs, states, inputs, None)
        except (RequestError, DataError):
            continue  # no depth, no positions, or no surge among the states
        assert fitted is not None
        if surge == "predicted" or any(np.any(fitted.offsets(run)) for run in runs.values()):
            found.append(made)
    found.append(None)
    first = None if stated is None else replace(stated, optional=False)
    return sorted(found, key=lambda each: each != first)


def _defaults(
    settings: HankelSettings,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    period: float,
    unseen: bool,
) -> list[tuple[Observable, ...]]:
    """Observables to choose among, and fewer of them for runs that are too short."""
    elevations = [
        label.name for label in labelled.common_labels(runs, inputs) if is_elevation(label.name)
    ]
    aligned, lead = settings.alignment, None
    if aligned is not None and aligned.surge == "predicted":
        is_left_out = aligned.optional and aligned.missing(runs, states, inputs)
        lead = None if is_left_out else int(settings.lead)
    defaults = default_observables(elevations, period, unseen, lead)
    return list(dict.fromkeys([defaults, defaults[1:], ()]))


def _variants(
    settings: HankelSettings,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    vary: Sequence[str],
    period: float,
) -> Iterator[Variant]:
    """Alignments, with each look-ahead that is tried where the model follows its own surge."""
    stated = int(settings.lead)
    tried = [round(part * period) for part in LEADS if part > LEAD and "lead" in vary]
    alignments = [settings.alignment]
    if "alignment" in vary:
        alignments = _alignments(settings.alignment, runs, states, inputs)
    for each in alignments:
        if each is None or each.surge != "predicted":
            yield each, None
        else:
            yield from ((each, ahead) for ahead in dict.fromkeys([stated, *tried]))


def _problem(
    settings: HankelSettings,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    base: Candidate,
    options: Mapping[str, Sequence[Any]],
    horizons: tuple[int, ...],
    folds: Mapping[str, str] | int,
) -> Problem | None:
    """The columns of all candidates; None where the runs are too short for them."""
    leads = [base.lead, *options.get("lead", ())]
    lead = max(leads)
    delays = max([base.input_delays, *options.get("input_delays", ())]) + lead - min(leads)
    widest = Candidate(
        max([base.state_delays, *options.get("state_delays", ())]),
        delays,
        lead,
        tuple(range(len(settings.observables))),
    )
    wide = replace(
        settings,
        state_delays=widest.state_delays,
        input_delays=widest.input_delays,
        lead=lead,
        ridge=1.0,
        standardize=True,
    )
    chain = wide.input_map(dict(runs), states, inputs, settings.window)
    before = max(widest.state_delays, chain.history(delays))
    after = max(chain.lead_samples - 1, 0)
    pieces = split(runs, folds, before, after) if isinstance(folds, int) else dict(runs)
    if any(run.sizes["time"] < before + 2 + after for run in pieces.values()):
        return None
    data = gather(pieces, states, inputs, None, wide)
    chain, drives, offsets = data.input_map, [], []
    for (name, run), x in zip(pieces.items(), data.states, strict=True):
        size = run.sizes["time"]
        offsets.append(size - max(chain.lead_samples - 1, 0) - len(x))
        if chain.follows is not None:
            values = labelled.channel_matrix(run, list(inputs), name)
            drives.append(chain.drive(values, [], run=run))
    owners: list[int] = [-1] * len(inputs)
    direct: list[int] = []
    for number, bound in enumerate(() if chain.observed is None else chain.observed.bound):
        (owners if bound.delayed else direct).extend([number] * len(bound.labels))
    direct += [-1] * (chain.follows is not None)  # the slow surge squared
    return Problem(
        data=data,
        drives=tuple(drives),
        offsets=tuple(offsets),
        widest=widest,
        owners=tuple(owners),
        direct_owners=tuple(direct),
        horizons=horizons,
        is_per_snapshot=settings.ridge_scale == "per_snapshot",
        groups=tuple(pieces if isinstance(folds, int) else folds.values()),
    )


def groups_of(
    runs: Mapping[str, xr.Dataset], folds: Folds, inputs: Sequence[str]
) -> dict[str, str]:
    """Name, by run, of the group of runs that are held out together.

    With "sea_state", runs that state the same; with "auto", runs whose waves are the same, as the
    first of `inputs` that is a length recorded them; with "run", each is alone.
    """
    if folds == "sea_state":
        return {name: str(run.attrs.get("sea_state") or name) for name, run in runs.items()}
    if folds == "run" or not inputs or len(runs) < 2:
        return {name: name for name in runs}
    lengths = (label.name for label in labelled.common_labels(runs, inputs) if label.units == "m")
    wave = next(lengths, inputs[0])
    records = {name: run[wave].to_numpy() for name, run in runs.items()}
    return repeated_waves(records, labelled.common_step(runs))


def _words_of_groups(groups: Sequence[str], by_sea: bool) -> str:
    """What was held out beside each run."""
    seas = len(set(groups))
    if 1 < seas < len(groups):
        if by_sea:
            return f"held out with each: the runs of its sea state, of which there are {seas}"
        return f"held out with each: the runs that repeat its waves; {seas} waves differ"
    shared = "no two runs share a sea state" if seas > 1 else "all runs have the same sea state"
    return f"{shared}, so each was held out alone"


def _rows_of(
    found: Choice,
    observables: Sequence[Observable],
    variants: Sequence[Variant],
    seed: int,
) -> Iterator[dict[str, Any]]:
    """Rows of the table: windows are drawn again 400 times for the interval of each score."""
    rng = np.random.default_rng(seed)
    for candidate, trial in found.trials:
        count = len(trial.weights)
        drawn = rng.integers(count, size=(400, count))
        weights = trial.weights[drawn]
        totals = (trial.scores[:, drawn] * weights).sum(axis=2) / weights.sum(axis=1)
        lower, upper = np.quantile(totals, [0.025, 0.975], axis=1)
        aligned, lead = variants[candidate.alignment]
        for number, (level, score) in enumerate(zip(trial.levels, trial.means, strict=True)):
            yield {
                "state_delays": candidate.state_delays,
                "input_delays": candidate.input_delays,
                "lead": candidate.lead if lead is None else lead,
                "observables": ", ".join(observables[k].kind for k in candidate.observables)
                or "none",
                "alignment": "none" if aligned is None else f"{aligned.mode}, {aligned.surge}",
                "ridge": 0.0 if candidate.truncated else level,
                "rank": int(level) if candidate.truncated else 0,
                "score": float(score),
                "lower": float(lower[number]),
                "upper": float(upper[number]),
                "chosen": candidate == found.candidate and level == found.level,
            }
