r"""Settings chosen by free runs on training runs that are held out.

A candidate is a complete set of settings but for λ. It is fitted to all training runs but one and
judged by its free runs on that one, in windows of one or two lengths; the mean over folds, windows
and channels of the NRMSE decides. The noise is the standard error, over what is held out, of the
difference between two candidates. Of what settings leave open, the simplest candidate is taken that
errs at most 5 % more than the best, or is as good but for the noise; what a search starts from is
left for nothing less. The regressors of all candidates are made once; one Gram matrix of a
fold, with the longest delays, gives the path of λ of all of them (:mod:`seakeep.core.solve`). Free
runs of candidates with equal columns go side by side: a worker takes all of them on a fold.
"""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import (
    Iterable,
    Iterator,
    Mapping,
    MutableMapping,
    Sequence,
)
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from operator import itemgetter
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from seakeep import metrics
from seakeep.arrays import BoolArray, Datasets, FloatArray, IntArray, Progress
from seakeep.core.embedding import PrimalSystem, spread_means, training_window
from seakeep.core.solve import ridge_path
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.executor import in_order
from seakeep.models import labelled
from seakeep.models.candidates import Candidates, Columns, Step, alignments_of
from seakeep.models.engine import Dynamics, Windows, linear_runs, read_groups
from seakeep.models.inputs import Signature
from seakeep.models.labelled import TrainingRuns
from seakeep.models.linear import spectral_radius
from seakeep.models.loads import PERIODS, Held, fit_readouts
from seakeep.models.observables import named
from seakeep.models.readouts import Asked, FittedReadOut, ReadOuts, readouts_asked
from seakeep.models.settings import Folds, HankelSettings, Select
from seakeep.models.training import TrainingData, gather, system_of
from seakeep.signals import encounter_period, repeated_waves
from seakeep.signals.waves import is_regular

RIDGES = tuple(float(f"{10 ** (exponent / 2):.3g}") for exponent in range(-10, -1))
"""λ per snapshot pair that are tried, half a decade apart.

On the virtual tank and on both measured sets the best lies between 3e-5 and 3e-2; the error is flat
within half a decade of it."""
Settings = TypeVar("Settings", bound=HankelSettings)
Chosen = TypeVar("Chosen")
Tried = Sequence[tuple[HankelSettings, Sequence[float]]]
"""Candidates of equal columns and look-ahead, each with its λ."""
Scores = tuple[FloatArray, FloatArray]
"""Scores, shape (level, window), and weights of the windows, which sum to one in a fold."""
Known = MutableMapping[str, list[list[Any]]]
"""Scores and weights by candidate, fold and λ, as JSON values."""
Read = tuple[list[int], Windows, FloatArray]
"""Starts of windows of one length, what is read from there, and what was measured after them."""
Alike = tuple[int, Columns, Any]
"""What is held out, columns, and look-ahead: free runs of such candidates go side by side."""
COARSE = 4
"""Every so-many-th λ is tried first."""
NEAR = 1.2
"""Error, in parts of the best, above which the other λ of a candidate are left.

On the virtual tank they lower that of a candidate by 7 % at most."""
FEW = 3
"""Runs up to which a problem keeps their windows in memory."""
ALIKE = 0.03
"""Part of the lowest error by which the chosen λ may be worse.

On the virtual tank the error falls by that much over the last decade of λ: less than from one
seed to the next. Free runs of a larger λ decay sooner. Where sea states are held out the lowest
error decides: slow loads of other seas suffer most from a large λ."""
SIMPLER = 0.05
"""Part of the lowest error by which what is simpler may be worse: less is not worth a part."""
SAME = 1.03
"""Ratio of two periods of regular waves up to which they count as the same."""
HYSTERESIS = 0.1
"""Part of the wave amplitude that noise does not pass where the period of a run is counted."""
FALLBACK = 1e-3
"""λ per snapshot pair where nothing can be held out."""
UNHELD = "samples can be held out of runs of at most"
"""What a note says then."""
VARIED = (
    *("ridge", "observables", "lead", "input_delays", "state_delays", "alignment", "memory"),
    *("readouts", "kind"),
)
"""Settings that can be chosen."""
WORST = 1.0
"""NRMSE at which a channel counts no worse: a forecast that is no better than the mean is none.

Runs that no setting can forecast, or windows of calm water, must not decide for all others."""
DRAWS = 400
"""Times that windows are drawn again for the interval of a score."""


@dataclass(frozen=True, eq=False)
class Trial:
    """Scores of a candidate.

    Parameters
    ----------
    levels : tuple of float
        λ.
    scores : ndarray, shape (level, window)
        NRMSE averaged over the channels, by window of all folds and horizons; NaN where a λ was
        not tried.
    weights : ndarray, shape (window,)
        They sum to one; folds count alike, and the horizons of a fold.
    groups : ndarray of int, shape (window,)
        What is held out with each window: folds that repeat each other are one group.
    """

    levels: tuple[float, ...]
    scores: FloatArray
    weights: FloatArray
    groups: IntArray

    @property
    def means(self) -> FloatArray:
        """Score at each level, NaN where that was not tried."""
        return self.scores @ self.weights

    @property
    def best(self) -> float:
        """Score at the best level."""
        return float(np.nanmin(self.means))

    def between(self) -> list[float]:
        """λ that were not tried, up to the next that is worse on either side of the best."""
        tried = np.flatnonzero(np.isfinite(self.means))
        near = np.flatnonzero(self.means <= (1.0 + ALIKE) * self.best)
        low = tried[tried < near[0]].max(initial=-1)
        high = tried[tried > near[-1]].min(initial=len(self.levels))
        return [self.levels[at] for at in range(low + 1, high) if at not in tried]

    def level(self, alike: float, stated: float | None = None) -> float:
        """The largest λ that is as good as the best, or the stated one if that is."""
        near = self.means <= (1.0 + alike) * self.best
        levels: list[float] = np.array(self.levels)[near].tolist()
        return stated if stated in levels else levels[-1]

    def at(self, level: float) -> float:
        """Score at a level."""
        return float(self.means[self.levels.index(level)])

    def is_as_good_as(self, other: Trial) -> bool:
        """Whether it errs no more than another, but for a standard error over the groups."""
        worse = self.by_group() - other.by_group()
        worse = worse[np.isfinite(worse)]
        doubt = worse.std(ddof=1) / len(worse) ** 0.5 if len(worse) > 1 else 0.0
        return bool(worse.mean() <= doubt)

    def by_group(self) -> FloatArray:
        """Scores at the best level in each group, NaN where nothing moves."""
        best = self.scores[np.nanargmin(self.means)]
        total = np.bincount(self.groups, self.weights)
        total[total == 0.0] = np.nan
        return np.bincount(self.groups, self.weights * best) / total


class FreeRuns(NamedTuple):
    """Free runs, shape (level, window, steps, N), what was measured, and the training SD."""

    predicted: FloatArray
    measured: FloatArray
    spread: FloatArray


def scores_of(runs: FreeRuns) -> FloatArray:
    """NRMSE averaged over the channels that move, shape (level, window), windows in which any does.

    None counts worse than ``WORST``.
    """
    predicted, measured, spread = runs
    with np.errstate(over="ignore", invalid="ignore"):
        errors = metrics.nrmse(predicted=predicted, measured=measured, training_std=spread)
    judged = ~metrics.is_slack(predicted=measured, measured=measured, training_std=spread)
    errors = np.fmin(errors, WORST)
    moved = judged.any(axis=-1)
    return np.mean(errors[:, moved], axis=-1, where=judged[moved])


@dataclass(frozen=True, eq=False)
class Problem:
    """Training runs with the regressors of all candidates of one alignment.

    Parameters
    ----------
    runs : dict of Dataset
        Training runs, or parts of them.
    groups : tuple of str
        One per run: runs of one group do not teach what is judged on another of it.
    data : TrainingData
        Gathered with the longest delays, the longest lead and all observables.
    widest : HankelSettings
        What `data` was gathered with.
    horizons : tuple of int
        Lengths of the windows that are judged, samples.
    read : dict
        What :meth:`windows` gave, by run and horizons, where there are but a ``FEW`` runs.
    taught : dict
        By the runs that teach, the normal equations of all columns that were made last, which
        candidates share.
    """

    runs: Datasets
    groups: tuple[str, ...]
    data: TrainingData
    widest: HankelSettings
    horizons: tuple[int, ...]
    read: dict[tuple[int, tuple[int, ...]], list[Read]] = field(default_factory=dict)
    taught: dict[tuple[int, ...], tuple[Any, Signature, PrimalSystem]] = field(default_factory=dict)

    def ahead(self, candidate: HankelSettings) -> int:
        """Samples that delayed regressors look ahead too far."""
        return self.widest.lead - candidate.lead

    @property
    def reader(self) -> Signature:
        """What windows are read for; units were compared when the runs were gathered."""
        signature = self.data.signature
        states, inputs = (
            tuple(replace(label, units="") for label in labels)
            for labels in (signature.state_labels, signature.input_labels)
        )
        return replace(signature, state_labels=states, input_labels=inputs)

    def parts(self, candidate: HankelSettings) -> tuple[BoolArray, BoolArray]:
        """Which delayed and direct regressors a candidate has."""
        chain = self.data.signature.input_map
        delayed, direct = [True] * len(self.data.signature.inputs), list[bool]()
        for observable, each in zip(self.widest.observables, chain.observed.bound, strict=True):
            columns = [observable in candidate.observables] * len(each.labels)
            (delayed if observable.delayed else direct).extend(columns)
        direct += [True] * (chain.follows is not None)  # the slow surge squared
        return np.array(delayed, dtype=bool), np.array(direct, dtype=bool)

    def models(
        self, candidate: HankelSettings, levels: Sequence[float], runs: Sequence[int]
    ) -> list[Dynamics]:
        """Models of some runs, one per level; coefficients of what a candidate lacks are zero."""
        data, (delayed, direct) = self.data, self.parts(candidate)
        count, s, z = len(data.signature.states), candidate.state_delays, candidate.input_delays
        # The longest delays, as far as the candidate's own columns are among those.
        longest = {"input_delays": self.widest.input_delays - self.ahead(candidate)}
        if not candidate.memory:  # whose blocks begin after the delays of the states
            longest["state_delays"] = self.widest.state_delays
        wide = candidate.having(**longest)
        signature, system = self._system(candidate, wide, runs)
        own, every = (0 if candidate.is_filter else count * (d + 1) for d in (s, wide.state_delays))
        lags = np.tile(delayed, z + 1)
        later = np.pad(lags, (0, delayed.size * (wide.input_delays - z)))
        means = np.ones(count * len(candidate.blocks), bool)
        kept = np.concatenate([np.arange(every) < own, later, direct, means])
        pairs = sum(data.windows[run].columns for run in runs)
        factor = pairs if candidate.ridge_scale == "per_snapshot" else 1
        gram, right = system.gram, system.right
        if not kept.all():
            gram, right = gram.compress(kept, 0).compress(kept, 1), right[:, kept]
        path = ridge_path(gram, right, [factor * level for level in levels])
        path = spread_means(path, count, s, candidate.blocks)
        states = np.full(count * (candidate.state_reach + 1), not candidate.is_filter)
        there = np.concatenate([states, lags, direct])
        coefficients = np.zeros((*path.shape[:2], there.size))
        coefficients[..., there] = path
        signature = replace(signature, state_delays=candidate.state_reach, input_delays=z)
        return [Dynamics(each, signature) for each in coefficients]

    def _system(
        self, candidate: HankelSettings, wide: HankelSettings, runs: Sequence[int]
    ) -> tuple[Signature, PrimalSystem]:
        """Signature of some runs, and normal equations of all columns with the longest delays."""
        ahead, of = self.ahead(candidate), tuple(runs)
        key = ahead, wide.state_delays, wide.memory, wide.is_filter
        made = self.taught.get(of)
        if made is None or made[0] != key:
            data = self.data.of(runs, self.widest)
            # Later by the samples that a row looks ahead too far.
            delayed = [np.roll(each, ahead, axis=0) for each in data.delayed]
            system = system_of((data.states, delayed, data.direct), data.windows, wide)
            made = self.taught[of] = key, data.signature, system
        return made[1:]

    def grows(self, candidate: HankelSettings, level: float) -> bool:
        """Whether the model of all runs grows; neither a filter nor a subspace model does."""
        if candidate.is_filter or not candidate.has_path:
            return False
        return spectral_radius(self.models(candidate, [level], range(len(self.groups)))[0]) >= 1.0

    def starts(self, run: int, steps: int) -> IntArray:
        """Samples from which windows end to end are forecast in a run that is held out."""
        window = self.data.windows[run]
        first = window.first_column + self.widest.centre
        return np.arange(first, window.last - steps + 1, steps)

    def windows(self, run: int) -> list[Read]:
        """Windows by which a run is forecast over all horizons, the longest first.

        A longer free run begins with the shorter one from the same sample.
        """
        key = run, self.horizons
        if (found := self.read.get(key)) is None:
            data, dt, name = self.data, self.data.signature.dt, self.data.names[run]
            new, known = dict[int, list[int]](), set[int]()
            for steps in sorted(self.horizons, reverse=True):
                new[steps] = [at for at in self.starts(run, steps).tolist() if at not in known]
                known.update(new[steps])
            places = [
                ([(name, data.begin(run) + at * dt) for at in starts], steps)
                for steps, starts in new.items()
                if starts
            ]
            states, found = data.signature.state_scale.physical(data.states[run]), []
            for windows in read_groups(self.reader, self.runs, places):
                starts = new[windows.steps]
                measured = np.stack([states[at + 1 : at + 1 + windows.steps] for at in starts])
                # Read-outs are learnt from departures.
                found.append((starts, *windows.departing(measured, data.zeros[run])))
            if len(self.groups) <= FEW:
                self.read[key] = found
        return found

    def folds(self) -> list[int]:
        """Runs in which a window of some length fits: each is held out once."""
        runs = range(len(self.groups))
        return [run for run in runs if any(self.starts(run, k).size for k in self.horizons)]

    def free_runs(self, tried: Tried, run: int) -> Iterator[FreeRuns]:
        """Free runs on a run by models of others, side by side, for each horizon that fits.

        Runs of other groups teach, if there are any.
        """
        candidate = tried[0][0]
        rest = [other for other in range(len(self.groups)) if other != run]
        others = [other for other in rest if self.groups[other] != self.groups[run]] or rest
        if not candidate.has_path:
            yield from self._fitted_runs(candidate, others, run)
            return
        models = [each for one in tried for each in self.models(*one, others)]
        read, ahead = self.windows(run), self.ahead(candidate)
        groups = [
            replace(each, delayed=each.delayed[:, : each.delayed.shape[1] - ahead])
            for _, each, _ in read
        ]
        runs = linear_runs(models, groups) if groups else []
        ours: dict[int, FloatArray] = {}  # by start: a longer run begins with the shorter one
        truth: dict[int, FloatArray] = {}
        for (starts, _, measured), computed in zip(read, runs, strict=True):
            ours |= zip(starts, computed.swapaxes(0, 1), strict=True)
            truth |= zip(starts, measured, strict=True)
        for steps in self.horizons:
            if at := self.starts(run, steps).tolist():
                predicted = np.stack([ours[start][:, :steps] for start in at], axis=1)
                measured = np.stack([truth[start][:steps] for start in at])
                yield FreeRuns(predicted, measured, models[0].signature.state_scale.std)

    def _fitted_runs(self, candidate: Any, others: Sequence[int], run: int) -> Iterator[FreeRuns]:
        """The same of a candidate that is fitted for itself."""
        own, names = self.data.signature, self.data.names
        given = {names[other]: self.runs[names[other]] for other in others}
        candidate = replace(candidate, window=self.widest.window)
        model, judged = candidate.fit(given, own.states, own.inputs), self.runs[names[run]]
        begin = round((self.data.begin(run) - float(judged["time"][0])) / own.dt)
        for steps in self.horizons:
            if (starts := begin + self.starts(run, steps)).size:
                predicted, measured = model.judged_runs(judged, names[run], starts, steps)
                yield FreeRuns(predicted[None], measured, model.signature.state_scale.std)

    def judge(self, tried: Tried, fold: int) -> list[Scores]:
        """Judge free runs on a run that is held out, over all horizons that fit."""
        scores = list(map(scores_of, self.free_runs(tried, fold)))
        counts = [each.shape[1] for each in scores if each.size]
        weights = np.repeat(np.divide(1.0, counts) / len(counts), counts)
        ends = np.cumsum([len(levels) for _, levels in tried])
        nothing = np.empty((ends[-1], 0))
        parts = np.split(np.concatenate([nothing, *scores], axis=1), ends[:-1])
        return [(part, weights) for part in parts]

    def held_out(self, candidate: HankelSettings, level: float, steps: int) -> Iterator[Held]:
        """Free runs, end to end, on each run by the model of the others."""
        own = replace(self, horizons=(steps,))  # which shares what was read and taught
        for run in range(len(self.groups)):
            for predicted, measured, _ in own.free_runs([(candidate, [level])], run):
                yield Held(run, self.starts(run, steps), predicted[0], measured)


def _problem(
    widest: HankelSettings,
    given: TrainingRuns,
    folds: Mapping[str, str] | int,
    horizons: tuple[int, ...],
) -> Problem | None:
    """The columns of all candidates, which the widest holds; None where the runs are too short.

    `folds` holds the group of each run, or the number of parts that the training window of each is
    split into.
    """
    widest = replace(widest, ridge=1.0, standardize=True)
    chain = widest.input_map(given, widest.window)
    before = widest.reach(chain)
    after = chain.around.after
    pieces = dict(given.runs)
    if isinstance(folds, int):  # with what their pairs read, so that each pair is in one part
        pieces = {}
        for name, run in given.runs.items():
            size = run.sizes["time"]
            place = training_window(size - 1, widest.window, before, 0, widest.history)
            edges = np.linspace(place.first_column, size - after, folds + 1).astype(int)
            for number, (first, stop) in enumerate(itertools.pairwise(edges), start=1):
                samples = slice(first - before, stop + after)
                pieces[f"{name}, part {number}"] = run.isel(time=samples)
        widest = replace(widest, window=None)  # all of the parts, which share it
    if any(run.sizes["time"] < before + 2 + after for run in pieces.values()):
        return None
    known = None if isinstance(folds, int) else chain
    data = gather(given._replace(runs=pieces), widest, known)
    groups = tuple(pieces if isinstance(folds, int) else folds.values())
    return Problem(pieces, groups, data, widest, horizons)


def _problems(
    tried: Candidates,
    folds: Mapping[str, str] | int,
    horizons: tuple[int, ...],
) -> dict[Columns, Problem]:
    """The columns of all that is tried; none where what it starts from is too long."""
    problems: dict[Columns, Problem] = {}
    for key, widest in tried.widest().items():  # that of the base is the first
        try:
            problem = _problem(widest, tried.given, folds, horizons)
        except RequestError:
            if not problems:
                raise
            continue  # a look-ahead of nothing takes a probe up-wave
        if problem is not None and problem.folds():
            problems[key] = problem
        elif not problems:
            break
    return problems


def _lacking(settings: HankelSettings, given: TrainingRuns) -> str:
    """What an optional alignment goes without, in words."""
    aligned = settings.alignment
    return aligned.missing(*given) if aligned is not None and aligned.optional else ""


@dataclass(eq=False)
class _Trials:
    """Trials of candidates, and what more are made with.

    Parameters
    ----------
    search : Candidates
        What is tried.
    problems : mapping
        Columns of the candidates.
    ridges : tuple of float
        λ that are tried, in ascending order.
    known : mapping
        As for :func:`select`.
    executor, progress
        As for :func:`select`.
    later : int
        Candidates that are to come at most.
    made : dict of Trial
        By candidate.
    rival : HankelSettings, optional
        Of another kind that is no choice, and surely better.
    """

    search: Candidates
    problems: Mapping[Columns, Problem]
    ridges: tuple[float, ...]
    known: Known
    executor: Executor | None
    progress: Progress | None
    later: int = 0
    made: dict[Any, Trial] = field(default_factory=dict)
    rival: HankelSettings | None = None

    def problem(self, candidate: HankelSettings) -> Problem:
        """The columns of a candidate."""
        return self.problems[self.search.columns(candidate)]

    def levels(self, candidate: HankelSettings) -> tuple[float, ...]:
        """λ that may be tried of a candidate."""
        return self.ridges if candidate.has_path else (float(candidate.ridge),)

    @property
    def tried(self) -> list[tuple[Any, float]]:
        """Candidates, each with every λ that was tried."""
        return [
            (candidate, level)
            for candidate, trial in self.made.items()
            for level in np.array(trial.levels)[np.isfinite(trial.means)].tolist()
        ]

    def searched(self, best: Any, steps: Iterable[Step]) -> Any:
        """The best candidate, from one on, after each step of a search."""
        for step_of in steps:
            tried = step_of(best)
            self.later -= len(tried) - 1  # the best is among them
            self.judge([best, *tried])
            best = min(self.made, key=lambda each: self.made[each].best)
        return best

    def judge(self, candidates: Iterable[HankelSettings]) -> None:
        """Try candidates that were not and have columns.

        Every ``COARSE``-th λ is tried, and of what errs little more than the best those about its
        own.
        """
        new = [
            each
            for each in dict.fromkeys(candidates)
            if each not in self.made and self.search.columns(each) in self.problems
        ]
        self._try({each: self.levels(each)[::COARSE] for each in new})
        least = NEAR * min((each.best for each in self.made.values()), default=math.inf)
        self.refine([each for each in new if self.made[each].best <= least])

    def refine(self, candidates: Iterable[HankelSettings]) -> None:
        """Try the λ of candidates next to the best of those that were tried."""
        self._try({each: self.made[each].between() for each in candidates})

    def _try(self, levels: Mapping[Any, Sequence[float]]) -> None:
        """Try λ of candidates; each has two parts."""
        problem = next(iter(self.problems.values()))
        folds, levels = problem.folds(), {each: own for each, own in levels.items() if own}
        keys = {
            (fold, each): _key(each, fold, own)
            for fold, (each, own) in itertools.product(folds, levels.items())
        }
        batches: dict[Alike, list[tuple[Any, Sequence[float]]]] = {}
        for (fold, each), key in keys.items():
            if key not in self.known:
                alike = fold, self.search.columns(each), each.lead if each.has_path else each
                batches.setdefault(alike, []).append((each, levels[each]))
        outcomes = in_order(_judged, self.problems, [*batches.items()], self.executor)
        known = len({*self.made, *levels})
        total = 2 * len(folds) * (known + self.later)
        done = len(folds) * (len(self.made) + known) - sum(map(len, batches.values()))
        for ((fold, *_), tried), outcome in zip(batches.items(), outcomes, strict=True):
            for (each, _), judged in zip(tried, outcome, strict=True):
                self.known[keys[fold, each]] = [part.tolist() for part in judged]
            done += len(tried)
            if self.progress is not None:
                self.progress(done, total, f"candidate and fold {done}")
        for each, own in levels.items():
            found = [map(np.array, self.known[keys[fold, each]]) for fold in folds]
            scores, weights = zip(*found, strict=True)
            joined = np.concatenate(weights)  # a fold sums to one, unless nothing moves in it
            firsts = [problem.groups.index(problem.groups[fold]) for fold in folds]
            groups = np.repeat(firsts, [len(part) for part in weights])
            every = self.levels(each)
            rows = np.full((len(every), joined.size), np.nan)
            if each in self.made:
                rows[:] = self.made[each].scores
            rows[[every.index(level) for level in own]] = np.concatenate(scores, axis=1)
            self.made[each] = Trial(every, rows, joined / joined.sum(), groups)

    def stable(self, taken: Any, level: float) -> tuple[Any, float]:
        """A candidate and λ; where that grows, the best of all that do not."""
        ranked = sorted(self.tried, key=lambda pair: self.made[pair[0]].at(pair[1]))
        for candidate, ridge in [(taken, level), *ranked]:
            if not self.problem(candidate).grows(candidate, ridge):
                return candidate, ridge
        return taken, level

    def is_near(self, rival: HankelSettings, taken: HankelSettings) -> bool:
        """Whether a kind that is slow to fit comes near the taken one on the first fold."""
        problem, levels = self.problem(rival), self.levels(rival)
        fold = problem.folds()[0]
        scores, weights = problem.judge([(rival, levels)], fold)[0]
        self.known[_key(rival, fold, levels)] = [scores.tolist(), weights.tolist()]
        others = self.made[taken].by_group()[problem.groups.index(problem.groups[fold])]
        return bool(np.min(scores @ weights) <= NEAR * others)

    def worth(self, taken: HankelSettings) -> str:
        """What a candidate errs without each of its observables, in words."""
        parts = taken.observables
        without = {o: replace(taken, observables=tuple(p for p in parts if p != o)) for o in parts}
        self.judge(without.values())
        return "".join(
            f"; without {named(o)} {self.made[less].best:.3f}" for o, less in without.items()
        )


def _key(candidate: HankelSettings, fold: int, levels: Sequence[float]) -> str:
    """What scores of a candidate are known by."""
    return json.dumps([candidate.to_json(), fold, [*levels]], sort_keys=True)


def _judged(problems: Mapping[Columns, Problem], batch: tuple[Alike, Tried]) -> list[Scores]:
    (fold, columns, _), tried = batch
    return problems[columns].judge(tried, fold)


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
    rival : HankelSettings, optional
        Settings of another kind that runs wherever these do: they err less by more than the noise.
    """

    settings: Chosen
    rows: tuple[dict[str, Any], ...]
    note: str
    readouts: tuple[FittedReadOut, ...] = ()
    rival: Any = None

    def describe(self) -> str:
        """Text: how the choice was made, and the best λ of each candidate."""
        keys = ["observables", "lead", "state_delays", "input_delays"]
        often = ("alignment", "memory", "kind")
        keys += [k for k in often if len({row[k] for row in self.rows}) > 1]
        lines = [self.note]
        for values, part in itertools.groupby(self.rows, itemgetter(*keys)):
            best = min(part, key=lambda row: (not row["chosen"], row["score"]))
            what = ", ".join(f"{key} {value}" for key, value in zip(keys, values, strict=True))
            lines.append(
                f"  {best['score']:.3f} [{best['lower']:.3f}, {best['upper']:.3f}]  "
                f"ridge {best['ridge']:g}, {what}{'  (chosen)' if best['chosen'] else ''}"
            )
        return "\n".join(lines)


def settle(settings: Settings, given: TrainingRuns, **how: Any) -> Selected[Settings]:
    """Choose all that settings leave open.

    Parameters
    ----------
    settings : HankelSettings
        What was asked for; its ``select`` says what is chosen beside λ, and how.
    given : TrainingRuns
        Training runs and channels.
    **how
        Its ``kinds``, ``executor`` and ``progress``.

    Returns
    -------
    Selected
        With λ as a number.

    Raises
    ------
    RequestError
        As :func:`select`; if λ is stated as zero and something is to be chosen.
    """
    lacking = _lacking(settings, given)
    without = f"not aligned to the surge: {lacking}" if lacking else ""
    stated, chosen = not isinstance(settings.ridge, str), getattr(settings, "select", None)
    if stated and chosen is None:
        return Selected(settings, (), without)
    if settings.ridge == 0:
        raise RequestError(
            "free runs choose at λ above zero, and ridge = 0 is stated. Set ridge = 'rollout', or "
            "remove select."
        )
    asked = chosen or Select()
    selected = select(
        settings,
        *given,
        vary=["readouts"] * (settings.readouts == "auto"),
        opened=asked.opened,
        ridges=(float(settings.ridge),) if stated else None,
        horizon=asked.horizon,
        folds=asked.folds,
        period=asked.period,
        **how,
    )
    return replace(selected, note="; ".join(filter(None, (selected.note, without))))


def select(
    settings: Settings,
    runs: Datasets,
    states: Sequence[str],
    inputs: Sequence[str],
    *,
    vary: Sequence[str] = (),
    opened: Sequence[str] = (),
    ridges: Sequence[float] | None = None,
    horizon: Sequence[float] = (15.0, 45.0),
    folds: Folds | int = "auto",
    period: float | None = None,
    kinds: Sequence[HankelSettings] = (),
    executor: Executor | None = None,
    progress: Progress | None = None,
    known: Known | None = None,
) -> Selected[Settings]:
    """Choose settings by free runs on training runs that are held out in turn.

    One setting after the other is chosen, each candidate with every fourth λ, and those about its
    best unless it errs a fifth more than the best of all: first what the settings leave open,
    of which the simplest is taken that is as good as the best but for the noise; then what is
    varied from there, which is left for what is better by more than the noise.
    Of the λ the largest is taken that is as good as the best. Where that model grows, it is the
    best of all that were tried and do not.

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
    opened : sequence of str
        Names that the settings leave open: delays, "observables", "memory", and "alignment" and
        "lead", each with what is stated and without it.
    ridges : sequence of float, optional
        λ to try in ascending order, as the settings count it; by default ``RIDGES`` per snapshot
        pair.
    horizon : sequence of float
        Lengths of the windows that are judged, encounter periods.
    folds : {"auto", "run", "sea_state"} or int, optional
        What is held out in turn: a run, with others as :func:`groups_of` says, or a part of a run:
        their number. A single run is held out in three parts.
    period : float, optional
        Encounter period, s; by default that of the runs.
    kinds : sequence of HankelSettings, optional
        Other kinds of models, which take what they have of the settings that were chosen. One that
        errs less, by more than the noise, is named; it is chosen where `vary` names "kind". Where
        it does not, a kind without a path of λ is left after the first fold if it errs a fifth
        more there.
    executor : Executor, optional
        Judges candidates and folds side by side; the result is the same.
    progress : callable, optional
        Called with what is done.
    known : mapping, optional
        Scores and weights by candidate and fold that need not be computed; new ones are added.

    Returns
    -------
    Selected
        Where no window fits into what could be held out, λ is ``FALLBACK`` per snapshot pair.

    Raises
    ------
    RequestError
        If `vary` names something else, or the delay rows are not exact.
    """
    given = TrainingRuns(runs, states, inputs)
    labels = labelled.common_labels(runs, states)
    readouts = readouts_asked(settings.readouts, labels)
    _check_asked(settings, vary)
    if "readouts" in vary:
        asked = readouts or readouts_asked("auto", labels)
        readouts = dict.fromkeys(asked, "auto")
    if isinstance(folds, str) and len(runs) == 1:
        folds = 3
    step = labelled.common_step(runs)
    samples = labelled.mean_period(runs, inputs) if period is None else period / step
    stated = None
    if ridges is None:
        ridges = RIDGES
        if settings.ridge_scale == "per_snapshot" and not isinstance(settings.ridge, str):
            stated = float(settings.ridge)
            ridges = sorted({*RIDGES, stated} - {0.0})
        settings = replace(settings, ridge=FALLBACK, ridge_scale="per_snapshot")
    apart = folds if isinstance(folds, int) else groups_of(runs, folds, inputs)
    horizons = tuple(max(round(each * samples), 1) for each in horizon)
    aligned = None if _lacking(settings, given) else settings.alignment
    # One that reads the measured surge is no choice.
    first = alignments_of(aligned, given)[0] if "alignment" in vary else aligned
    base = settings.having(readouts=(), alignment=first)
    whole = Candidates(base, given, samples, step, vary, opened, folds == "sea_state", bool(kinds))
    for search in whole.shorter():
        problems = _problems(search, apart, horizons)
        if problems:
            break
    else:  # runs are too short for the shortest
        longest = max(run.sizes["time"] for run in runs.values())
        note = (
            f"{settings.ridge_text(float(settings.ridge))}: no window of "
            f"{round(min(horizon) * samples)} {UNHELD} {longest}"
        )
        fitted = _learnt(readouts, None, settings, 0.0, 0, given)
        complete = settings.having(readouts=_asked(settings, fitted, vary))
        return Selected(complete, (), note, fitted)
    trials = _Trials(
        search, problems, tuple(ridges), {} if known is None else known, executor, progress
    )
    taken, level, words = _chosen(trials, stated, kinds)
    problem = trials.problem(taken)
    readouts = readouts if taken.kind == settings.kind else {}
    fitted = _learnt(readouts, problem, taken, level, round(PERIODS * samples), given)
    return Selected(
        taken.having(ridge=level, readouts=_asked(settings, fitted, vary)),
        tuple(_rows_of(trials.made, taken, level)),
        _note(trials, taken, level, words),
        fitted,
        trials.rival,
    )


def _chosen(
    trials: _Trials, stated: float | None, kinds: Sequence[HankelSettings]
) -> tuple[Any, float, str]:
    """The candidate and λ that a search ends with, and words on what else was tried."""
    search, made = trials.search, trials.made
    base, alike = search.base, 0.0 if search.unseen else ALIKE
    left, varied = search.left_open(), search.varied()
    trials.later = sum(len(step_of(base)) - 1 for step_of in (*left, *varied))
    if left:
        start = simplest(made, trials.searched(base, left), alike)
    else:
        start = base
        trials.judge([base])
    best = trials.searched(start, varied)
    taken = start if made[start].is_as_good_as(made[best]) else best
    trials.refine([taken])
    level = made[taken].level(alike, stated if taken == start else None)
    taken, level = trials.stable(taken, level)
    worth = trials.worth(taken) if base.role == "model" else ""
    if taken != best or (varied and taken == start):
        worth += (
            "; what it starts from: nothing that was tried is better by more than the noise"
            if varied
            else f"; the simplest that is as good as the best ({made[best].best:.3f})"
        )
    taken, level, words = _rivalled(trials, taken, level, kinds, alike)
    return taken, level, worth + words


def simplest(trials: Mapping[Settings, Trial], best: Settings, alike: float) -> Settings:
    """Take the candidate with the fewest parts that errs at most 5 % more than the best.

    It counts with the λ that it would be given, the best one with its best λ.

    Where three groups or more tell the noise, also one that errs more, but for the noise. The
    look-ahead of the first candidate goes before another one of as many parts.
    """
    lead = next(iter(trials)).lead
    least = (1.0 + SIMPLER) * trials[best].best
    is_known = len(set(trials[best].groups)) > 2
    near = {
        key: each.best
        for key, each in trials.items()
        if each.at(each.level(alike)) <= least or (is_known and each.is_as_good_as(trials[best]))
    }
    return min(near, key=lambda key: (_parts_of(key), key.lead != lead, near[key]))


def _parts_of(candidate: HankelSettings) -> int:
    """What a candidate has beside delays: the fewer, the simpler.

    The look-ahead of waves that are carried to the predicted surge is part of their alignment.
    """
    own_lead = 0 if candidate.follows_surge else candidate.lead
    parts = candidate.alignment, own_lead, candidate.memory
    return sum(map(bool, parts)) + len(candidate.observables)


def _rivalled(
    trials: _Trials, taken: Any, level: float, kinds: Sequence[HankelSettings], alike: float
) -> tuple[Any, float, str]:
    """A candidate and λ, of another kind where that is varied and better, and words on the better.

    The better one is the best that errs less by more than the noise and does not grow.
    """
    # Beside a fit only the waves themselves are tried.
    search, words = trials.search, ""
    is_varied = "kind" in search.vary
    both = trials if is_varied else replace(trials, made=dict(trials.made))
    made = both.made
    own = {"ridge"} if is_varied else {"ridge", "observables"}
    plain = {key: v for key, v in vars(search.at_rest(taken)).items() if key not in own}
    before = {*made}
    rivals = [each.having(**plain) for each in kinds if search.given.inputs]
    slow = [each for each in rivals if not (is_varied or each.has_path)]
    both.judge(each for each in rivals if each not in slow)
    for rival in slow:
        with suppress(RequestError, DataError):  # a run is too short for it
            if both.is_near(rival, taken):
                both.judge([rival])
    others = [each for each in made if each not in before]
    for other in sorted(others, key=lambda each: made[each].best):
        if made[taken].is_as_good_as(made[other]):
            continue
        both.refine([other])
        own_level = made[other].level(alike)
        if trials.problem(other).grows(other, own_level):
            continue
        score = made[other].at(own_level)
        words += f"; kind = '{other.kind}' errs {score:.3f}, less by more than the noise"
        if is_varied:
            taken, level = other, own_level
        elif other.has_path:
            trials.rival = other.having(ridge=own_level)
        else:  # named alone: subspace models run on no host
            continue
        break
    return taken, level, words


def _note(trials: _Trials, taken: Settings, level: float, worth: str) -> str:
    """How the choice was made, in words."""
    search, problem = trials.search, trials.problem(taken)
    note = (
        f"{taken.ridge_text(level)}: out of {len(trials.tried)} settings (below, the best λ of "
        f"each kind) in free runs on {len(problem.folds())} parts held out in turn, mean NRMSE "
        f"{trials.made[taken].at(level):.3f}{worth}"
    )
    if {"lead", "input_delays", "state_delays", "alignment", "memory"} & {
        *search.vary,
        *search.opened,
    }:
        note += "; over instants that all of these can forecast"
    runs, _, inputs = search.given
    if periods := regular_periods(runs, inputs):
        low, high = min(periods.values()), max(periods.values())
        note += (
            "; all runs are of regular waves: forecasts at periods other than "
            f"{low:.3g}{f' to {high:.3g}' if high > SAME * low else ''} s extrapolate"
        )
    seas = len(set(problem.groups))
    if 1 < seas < len(problem.groups):
        if search.unseen:
            alike = f"the runs of its sea state, of which there are {seas}"
        else:
            what = "of its period" if periods else "that repeat its waves"
            alike = f"the runs {what}; {seas} waves differ"
        note += f"; held out with each: {alike}"
    elif search.unseen or seas == 1:
        shared = "no two runs share a sea state" if seas > 1 else "all runs have the same sea state"
        note += f"; {shared}, so each was held out alone"
    return note


def _check_asked(settings: HankelSettings, vary: Sequence[str]) -> None:
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


def _asked(
    settings: HankelSettings, fitted: Sequence[FittedReadOut], vary: Sequence[str]
) -> ReadOuts:
    """Read-outs of complete settings: as stated, or of the kinds that were chosen."""
    if "readouts" not in vary:
        return settings.readouts
    return tuple((o.channel, o.kind) for o in fitted if o.kind != "none")


def _learnt(
    readouts: Mapping[str, Asked],
    problem: Problem | None,
    candidate: HankelSettings,
    level: float,
    steps: int,
    given: TrainingRuns,
) -> tuple[FittedReadOut, ...]:
    """Fit read-outs to runs, and to forecasts of what is held out, if anything can be."""
    if not readouts:
        return ()
    if problem is not None:
        held = problem.held_out(candidate, level, steps)
        return fit_readouts(readouts, problem.data, problem.runs, held)
    settings = replace(candidate, ridge=1.0, standardize=True)
    return fit_readouts(readouts, gather(given, settings), given.runs, ())


def readouts_for(settings: HankelSettings, given: TrainingRuns) -> tuple[FittedReadOut, ...]:
    """Fit the read-outs of settings that leave nothing else to be chosen.

    Parameters
    ----------
    settings : HankelSettings
        Delays, λ and input maps as stated.
    given : TrainingRuns
        Training runs and channels.

    Returns
    -------
    tuple of FittedReadOut

    Raises
    ------
    RequestError
        If a read-out names what is no state, λ is zero where forecasts are cross-fitted, or kind
        "wave" meets no waves that are carried to the predicted surge.
    """
    runs, states, inputs = given
    readouts = readouts_asked(settings.readouts, labelled.common_labels(runs, states))
    if "auto" not in readouts.values():
        return _learnt(readouts, None, settings, 0.0, 0, given)
    ridge = float(settings.ridge)
    if ridge == 0.0:
        raise RequestError(
            "readouts = 'auto' is chosen by free runs of ridge regressions, which take ridge above "
            "zero. Raise ridge, or write 'wave'."
        )
    steps = round(PERIODS * labelled.mean_period(runs, inputs))
    apart = 3 if len(runs) == 1 else groups_of(runs, "auto", inputs)
    problem = _problem(settings, given, apart, (steps,))
    return _learnt(readouts, problem, settings, ridge, steps, given)


def groups_of(runs: Datasets, folds: Folds, inputs: Sequence[str]) -> dict[str, str]:
    """Name, by run, of the group of runs that are held out together.

    With "sea_state", runs that state the same; with "auto", runs whose waves are the same, as the
    channel that periods are counted in recorded them, or runs of the same period where all are of
    regular waves; with "run", each is alone.
    """
    if folds == "sea_state":
        return {name: str(run.attrs.get("sea_state") or name) for name, run in runs.items()}
    waves = {name: labelled.wave_channel(run, inputs, name) for name, run in runs.items()}
    if folds == "run" or None in waves.values():
        return {name: name for name in runs}
    periods = regular_periods(runs, inputs)
    groups, first = dict[str, str](), ""
    for name in sorted(periods, key=lambda each: periods[each]):
        if not first or periods[name] > SAME * periods[first]:
            first = name
        groups[name] = first
    if len({*groups.values()}) > 1:
        return {name: groups[name] for name in runs}
    records = {name: runs[name][wave].values for name, wave in waves.items()}
    return repeated_waves(records, labelled.common_step(runs))


def regular_periods(runs: Datasets, inputs: Sequence[str]) -> dict[str, float]:
    """Wave period of each run, s, where all are of regular waves; else empty."""
    periods, step = {}, labelled.common_step(runs)
    for name, run in runs.items():
        wave = labelled.wave_channel(run, inputs, name)
        if wave is None:
            return {}
        series = run[wave].values
        stated = run.attrs.get("waves") == "regular"
        if not np.isfinite(series).all() or not (stated or is_regular(series)):
            return {}
        periods[name] = encounter_period(series, step, HYSTERESIS)
    return periods


def _rows_of(
    trials: Mapping[Settings, Trial], taken: Settings, level: float
) -> Iterator[dict[str, Any]]:
    """Rows of the table: windows are drawn again for the interval of each score."""
    rng = np.random.default_rng(0)
    for candidate, trial in trials.items():
        count = len(trial.weights)
        drawn = rng.integers(count, size=(DRAWS, count))
        weights = trial.weights[drawn]
        totals = (trial.scores[:, drawn] * weights).sum(axis=2) / weights.sum(axis=1)
        aligned = candidate.alignment
        bounds = np.quantile(totals, [0.025, 0.975], axis=1)
        tried = zip(trial.levels, trial.means, *bounds, strict=True)
        for own, score, low, high in (each for each in tried if np.isfinite(each[1])):
            yield {
                "state_delays": candidate.state_delays,
                "input_delays": candidate.input_delays,
                "lead": candidate.lead,
                "observables": ", ".join(each.kind for each in candidate.observables) or "none",
                "alignment": "none" if aligned is None else f"{aligned.mode}, {aligned.surge}",
                "memory": candidate.memory,
                "kind": candidate.kind,
                "ridge": own,
                "score": float(score),
                "lower": float(low),
                "upper": float(high),
                "chosen": candidate == taken and own == level,
            }
