r"""Settings chosen by free runs on training runs that are held out.

A candidate is a complete set of settings but for λ. It is fitted to all training runs but one and
judged by its free runs on that one, in windows of one or two lengths; the mean over folds, windows
and channels of the NRMSE decides. The regressors of all candidates are made once; one Gram matrix
of a candidate and a fold gives the whole path of λ (:mod:`seakeep.core.gram`).
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterable, Iterator, Mapping, MutableMapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, fields, replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
import xarray as xr

from seakeep.arrays import BoolArray, FloatArray, IntArray, Progress
from seakeep.conventions import is_elevation
from seakeep.core import metrics
from seakeep.core.gram import Piece, primal_system, ridge_path, truncated_path
from seakeep.errors import DataError, RequestError, did_you_mean
from seakeep.models import labelled
from seakeep.models.alignment import FittedAlignment, ProbeAlignment
from seakeep.models.engine import Dynamics, model_runs, read_windows
from seakeep.models.ensemble import spectral_radius
from seakeep.models.executor import in_order
from seakeep.models.following import LEAD
from seakeep.models.interface import Scale, Signature
from seakeep.models.loads import PERIODS, Held, fit_readouts
from seakeep.models.observables import Observable, Powers, SlowSquares, named
from seakeep.models.readouts import FittedReadOut, ReadOut, ReadOuts, readouts_asked
from seakeep.models.settings import Folds, HankelSettings, Select
from seakeep.models.training import TrainingData, gather, scales_of
from seakeep.signals import repeated_waves

RIDGES = tuple(float(f"{10 ** (exponent / 2):.3g}") for exponent in range(-10, -1))
"""λ per snapshot pair that are tried, half a decade apart.

On the virtual tank and on both measured sets the best lies between 3e-5 and 3e-2; the error is flat
within half a decade of it."""
Settings = TypeVar("Settings", bound=HankelSettings)
Chosen = TypeVar("Chosen")
Given = tuple[Mapping[str, xr.Dataset], Sequence[str], Sequence[str]]
"""Training runs, states and inputs."""
Changes = dict[str, Any]
"""Settings of a candidate that differ from those of the best so far."""
Columns = tuple[ProbeAlignment | None, int | None]
"""An alignment, and the look-ahead in samples where it is part of it: columns of their own."""
Scores = tuple[FloatArray, FloatArray]
"""Scores, shape (level, window), and weights of the windows, which sum to one in a fold."""
Known = MutableMapping[str, list[list[Any]]]
"""Scores and weights by candidate and fold, as JSON values."""
ALIKE = 0.03
"""Part of the lowest error by which the chosen λ may be worse.

On the virtual tank the error falls by that much over the last decade of λ: less than from one
seed to the next. Free runs of a larger λ decay sooner. Where sea states are held out the lowest
error decides: slow loads of other seas suffer most from a large λ."""
FALLBACK = 1e-3
"""λ per snapshot pair where nothing can be held out."""
RANKS = tuple(round(2 ** (exponent / 2)) for exponent in range(18, 7, -1))
"""Numbers of singular values that are tried, half an octave apart: 512 to 16."""
DELAYS = {"input_delays": (2.0, 3.0, 5.0), "state_delays": (0.5, 1.0, 1.5)}
"""Delays that are tried, encounter periods."""
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
DRAWS = 400
"""Times that windows are drawn again for the interval of a score."""


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


class FreeRuns(NamedTuple):
    """Free runs, shape (level, window, steps, N), what was measured, and the training SD."""

    predicted: FloatArray
    measured: FloatArray
    spread: FloatArray


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
    ridges : tuple of float
        λ that are tried, in ascending order.
    horizons : tuple of int
        Lengths of the windows that are judged, samples.
    """

    runs: Mapping[str, xr.Dataset]
    groups: tuple[str, ...]
    data: TrainingData
    widest: HankelSettings
    ridges: tuple[float, ...]
    horizons: tuple[int, ...]

    def ahead(self, candidate: HankelSettings) -> int:
        """Samples that delayed regressors look ahead too far."""
        return self.widest.lead - candidate.lead

    @property
    def reader(self) -> Signature:
        """What windows are read for; units were compared when the runs were gathered."""
        signature = self.data.signature(self.widest)
        states, inputs = (
            tuple(replace(label, units="") for label in labels)
            for labels in (signature.state_labels, signature.input_labels)
        )
        return replace(signature, state_labels=states, input_labels=inputs)

    def parts(self, candidate: HankelSettings) -> tuple[BoolArray, BoolArray, BoolArray]:
        """Which states (all), delayed and direct regressors a candidate has."""
        chain, direct = self.data.input_map, list[bool]()
        delayed = [True] * len(self.data.input_labels)
        bound = () if chain.observed is None else chain.observed.bound
        for observable, each in zip(self.widest.observables, bound, strict=True):
            columns = [observable in candidate.observables] * len(each.labels)
            (delayed if each.delayed else direct).extend(columns)
        direct += [True] * (chain.follows is not None)  # the slow surge squared
        states = np.ones(len(self.data.state_labels), dtype=bool)
        return states, np.array(delayed, dtype=bool), np.array(direct, dtype=bool)

    def levels(self, candidate: HankelSettings) -> tuple[float, ...]:
        """What is tried of a candidate: the λ, or ranks below its number of columns."""
        if candidate.rank is None:
            return self.ridges
        states, delayed, direct = (np.count_nonzero(part) for part in self.parts(candidate))
        size = states * (candidate.state_delays + 1) + delayed * (candidate.input_delays + 1)
        return tuple(rank for rank in RANKS if rank < size + direct)

    def models(
        self, candidate: HankelSettings, levels: Sequence[float], runs: Sequence[int]
    ) -> tuple[Dynamics, FloatArray]:
        """Models of some runs: the first of them, and coefficients, shape (level, N, p)."""
        data, parts = self.data, self.parts(candidate)
        delays = candidate.state_delays, candidate.input_delays, 0
        windows = [data.windows[run] for run in runs]
        labels = data.state_labels, *data.input_map.regressors(data.input_labels)
        names = [[label.name for label in group] for group in labels]
        series = [
            [scale.physical(values[run]) for run in runs]
            for scale, values in (
                (data.state_scale, data.states),
                (data.input_scale, data.delayed),
                (data.direct_scale, data.direct),
            )
        ]
        scales = [
            Scale(*(getattr(scale, each.name)[part] for each in fields(scale)))
            for scale, part in zip(
                scales_of(series, windows, names, True, data.input_map.stretch), parts, strict=True
            )
        ]
        # Later by the samples that a row looks ahead too far.
        series[1] = [np.roll(each, self.ahead(candidate), axis=0) for each in series[1]]
        groups = [
            [scale.deviations(each[:, part]) for each in group]
            for group, scale, part in zip(series, scales, parts, strict=True)
        ]
        there = [number for number, part in enumerate(parts) if part.any()]
        system = primal_system(
            [
                Piece(
                    groups[0][run],
                    tuple(groups[number][run] for number in there),
                    window.first_column,
                    window.columns,
                )
                for run, window in enumerate(windows)
            ],
            [delays[number] for number in there],
        )
        if candidate.rank is not None:
            ranks = [int(level) for level in levels]
            path = truncated_path(system.gram, system.right, ranks)
        else:
            pairs = sum(window.columns for window in windows)
            factor = pairs if candidate.ridge_scale == "per_snapshot" else 1
            path = ridge_path(system.gram, system.right, [factor * level for level in levels])
        x, u, w = scales
        return Dynamics(path[0], *delays[:2], x, u, w, data.input_map.follows), path

    def grows(self, candidate: HankelSettings, level: float) -> bool:
        """Whether the model that a candidate gives of all runs grows."""
        return spectral_radius(self.models(candidate, [level], range(len(self.groups)))[0]) >= 1.0

    def starts(self, run: int, steps: int) -> IntArray:
        """Samples from which windows end to end are forecast in a run that is held out."""
        window = self.data.windows[run]
        return np.arange(window.first_column, window.last - steps + 1, steps)

    def folds(self) -> list[int]:
        """Runs in which a window of some length fits: each is held out once."""
        runs = range(len(self.groups))
        return [run for run in runs if any(self.starts(run, k).size for k in self.horizons)]

    def free_runs(
        self, candidate: HankelSettings, levels: Sequence[float], run: int, horizons: Sequence[int]
    ) -> Iterator[FreeRuns]:
        """Free runs on a run by models of others, for each horizon that fits.

        Runs of other groups teach, if there are any.
        """
        data, (_, delayed, direct) = self.data, self.parts(candidate)
        rest = [other for other in range(len(self.groups)) if other != run]
        others = [other for other in rest if self.groups[other] != self.groups[run]]
        dynamics, coefficients = self.models(candidate, levels, others or rest)
        name = data.names[run]
        begin = data.first_instants[run] - data.windows[run].first * data.dt
        states = data.state_scale.physical(data.states[run])
        for steps in horizons:
            if not (starts := self.starts(run, steps)).size:
                continue
            places = [(name, begin + at * data.dt) for at in starts]
            windows = read_windows(self.reader, self.runs, places, steps)
            last = windows.delayed.shape[1] - self.ahead(candidate)
            windows = replace(
                windows,
                delayed=windows.delayed[:, :last, delayed],
                direct=windows.direct[..., direct[: windows.direct.shape[2]]],
                table=None if windows.table is None else windows.table[..., delayed],
            )
            (predicted,) = model_runs(dynamics, coefficients, [windows])
            measured = np.stack([states[at + 1 : at + 1 + steps] for at in starts])
            yield FreeRuns(predicted, measured, dynamics.state_scale.std)

    def judge(self, candidate: HankelSettings, fold: int) -> Scores:
        """Judge free runs on a run that is held out, over all horizons that fit."""
        levels = self.levels(candidate)
        scores = [np.empty((len(levels), 0))]
        for predicted, measured, spread in self.free_runs(candidate, levels, fold, self.horizons):
            with np.errstate(over="ignore", invalid="ignore"):
                errors = metrics.nrmse(predicted=predicted, measured=measured, training_std=spread)
            judged = ~metrics.is_slack(predicted=measured, measured=measured, training_std=spread)
            errors = np.where(np.isfinite(errors), np.minimum(errors, WORST), WORST)
            if (moved := judged.any(axis=-1)).any():
                scores.append(np.mean(errors[:, moved], axis=-1, where=judged[moved]))
        counts = [each.shape[1] for each in scores]
        weights = np.repeat(1.0 / np.maximum(counts, 1) / max(len(scores) - 1, 1), counts)
        return np.concatenate(scores, axis=1), weights

    def held_out(self, candidate: HankelSettings, level: float, steps: int) -> Iterator[Held]:
        """Free runs, end to end, on each run by the model of the others."""
        for run in range(len(self.groups)) if len(self.groups) > 1 else ():
            for predicted, measured, _ in self.free_runs(candidate, [level], run, [steps]):
                yield Held(run, self.starts(run, steps), predicted[0], measured)


def _problem(
    settings: HankelSettings,
    given: Given,
    folds: Mapping[str, str] | int,
    ridges: Iterable[float],
    horizons: tuple[int, ...],
    tried: Mapping[str, Sequence[int]],
) -> Problem | None:
    """The columns of settings with all that is tried; None where the runs are too short for them.

    `folds` holds the group of each run, or the number of parts that runs are split into, and
    `tried` delays and look-aheads.
    """
    state_delays, input_delays, leads = (
        [getattr(settings, name), *tried.get(name, ())]
        for name in ("state_delays", "input_delays", "lead")
    )
    widest = replace(
        settings,
        state_delays=max(state_delays),
        input_delays=max(input_delays) + max(leads) - min(leads),
        lead=max(leads),
        ridge=1.0,
        standardize=True,
    )
    runs, states, inputs = given
    chain = widest.input_map(dict(runs), states, inputs, settings.window)
    before = max(widest.state_delays, chain.history(widest.input_delays))
    after = max(chain.lead_samples - 1, 0)
    pieces = dict(runs)
    if isinstance(folds, int):  # with what their pairs read, so that each pair is in one part
        pieces = {}
        for name, run in runs.items():
            edges = np.linspace(before, run.sizes["time"] - after, folds + 1).astype(int)
            for number, (first, stop) in enumerate(itertools.pairwise(edges), start=1):
                samples = slice(max(first - before, 0), stop + after)
                pieces[f"{name}, part {number}"] = run.isel(time=samples)
    if any(run.sizes["time"] < before + 2 + after for run in pieces.values()):
        return None
    data = gather(pieces, states, inputs, None, widest)
    groups = tuple(pieces if isinstance(folds, int) else folds.values())
    return Problem(pieces, groups, data, widest, tuple(ridges), horizons)


def _columns_of(candidate: HankelSettings) -> Columns:
    """What makes columns of their own: the alignment, and the look-ahead if it is part of that."""
    aligned = candidate.alignment
    follows = aligned is not None and aligned.surge == "predicted"
    return aligned, candidate.lead if follows else None


def _judge(
    problems: Mapping[Columns, Problem],
    trials: dict[Settings, Trial],
    candidates: Iterable[Settings],
    known: Known,
    executor: Executor | None,
    progress: Progress | None,
    later: int = 0,
) -> None:
    """Add trials of candidates that are not among them; `later` more are to come at most."""
    folds = next(iter(problems.values())).folds()
    new = [each for each in dict.fromkeys(candidates) if each not in trials]
    before, after = len(trials) * len(folds), later * len(folds)

    def tell(done: int, total: int, what: str) -> None:
        if progress is not None:
            progress(before + done, before + total + after, what)

    keys = {unit: _key(*unit) for unit in itertools.product(new, folds)}
    units = [unit for unit, key in keys.items() if key not in known]
    outcomes = in_order(_unit, problems, units, executor, tell, "candidate and fold")
    for unit, outcome in zip(units, outcomes, strict=True):
        known[keys[unit]] = [part.tolist() for part in outcome]
    for candidate in new:
        parts = [map(np.array, known[keys[candidate, fold]]) for fold in folds]
        scores, weights = zip(*parts, strict=True)
        joined = np.concatenate(weights)  # a fold sums to one, unless nothing moves in it
        levels = problems[_columns_of(candidate)].levels(candidate)
        every = np.concatenate(scores, axis=1)
        trials[candidate] = Trial(levels, every, joined / joined.sum())


def _key(candidate: HankelSettings, fold: int) -> str:
    return json.dumps([candidate.to_json(), fold], sort_keys=True)


def _unit(problems: Mapping[Columns, Problem], item: tuple[HankelSettings, int]) -> Scores:
    return problems[_columns_of(item[0])].judge(*item)


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

        def candidate(row: dict[str, Any]) -> tuple[Any, ...]:
            return (*(row[key] for key in keys), row["rank"] > 0)

        lines = [self.note]
        for values, part in itertools.groupby(self.rows, candidate):
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
    runs, states, inputs, executor, progress
        As in :func:`select`.

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
    vary = ["observables"] * asked.observables + ["readouts"] * (settings.readouts == "auto")
    selected = select(
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
    return replace(selected, note="; ".join(filter(None, (selected.note, without))))


def select(
    settings: Settings,
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    *,
    vary: Sequence[str] = (),
    ridges: Sequence[float] | None = None,
    horizon: Sequence[float] = (15.0, 45.0),
    folds: Folds | int = "auto",
    period: float | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    seed: int = 0,
    known: Known | None = None,
) -> Selected[Settings]:
    """Choose settings by free runs on training runs that are held out in turn.

    One setting after the other is chosen, each candidate with the whole path of λ. Of the best
    columns the largest λ (or the smallest rank) is taken that is as good as the best. Where that
    model grows, it is the best of all that were tried and do not.

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
        λ to try in ascending order, as the settings count it; by default ``RIDGES`` per snapshot
        pair.
    horizon : sequence of float
        Lengths of the windows that are judged, encounter periods.
    folds : {"auto", "run", "sea_state"} or int, optional
        What is held out in turn: a run, with others as :func:`groups_of` says, or a part of a run:
        their number. A single run is held out in three parts.
    period : float, optional
        Encounter period, s; by default that of the runs.
    executor : Executor, optional
        Judges candidates and folds side by side; the result is the same.
    progress : callable, optional
        Called with what is done.
    seed : int
        Of the bootstrap of the intervals.
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
    given = runs, states, inputs
    labels = labelled.common_labels(runs, states)
    readouts = readouts_asked(settings.readouts, labels)
    _check_asked(settings, vary, readouts)
    if "readouts" in vary:
        asked = readouts or readouts_asked("auto", labels)
        readouts = tuple(replace(each, kind="auto") for each in asked)
    if isinstance(folds, str):
        folds = 3 if len(runs) == 1 else folds
    step = labelled.common_step(runs)
    samples = labelled.mean_period(runs, inputs) if period is None else period / step
    if ridges is None:
        settings = replace(settings, ridge=FALLBACK, ridge_scale="per_snapshot")
    offered = [settings.observables]
    if "observables" in vary and not settings.observables:
        offered = _defaults(settings, given, samples * step, folds == "sea_state")
    variants = list(_variants(settings, given, vary, samples))
    apart = folds if isinstance(folds, int) else groups_of(runs, folds, inputs)
    horizons = tuple(max(round(each * samples), 1) for each in horizon)
    base = replace(settings, readouts=(), **variants[0])
    for observables in offered:  # runs may be too short for the longest
        steps = [*_steps(observables, vary, samples, variants)]
        every = replace(base, observables=observables)
        problems = _problems(every, steps, given, apart, ridges or RIDGES, horizons)
        if len(problems) == len(variants):
            break
    else:
        longest = max(run.sizes["time"] for run in runs.values())
        note = (
            f"{settings.ridge_text(float(settings.ridge))}: no window of "
            f"{round(min(horizon) * samples)} samples can be held out of runs of at most {longest}"
        )
        fitted = _learnt(readouts, None, settings, 0.0, 0, given)
        complete = replace(settings, readouts=_asked(settings, fitted, vary))
        return Selected(complete, (), note, fitted)
    trials: dict[Settings, Trial] = {}
    work = ({} if known is None else known), executor, progress
    best, later = base, sum(len(changes) - 1 for changes in steps)  # the best is among them
    for changes in ([{}], *steps):
        later -= len(changes) - 1
        tried = [replace(best, **change) for change in changes]
        _judge(problems, trials, tried, *work, later)
        best = min(trials, key=lambda each: float(trials[each].means.min()))
    taken, level = _best(problems, trials, best, 0.0 if folds == "sea_state" else ALIKE)
    without = {
        left: replace(taken, observables=tuple(o for o in taken.observables if o != left))
        for left in taken.observables
    }
    _judge(problems, trials, without.values(), *work)
    worth = "".join(
        f"; without {named(left)} {trials[less].means.min():.3f}" for left, less in without.items()
    )
    problem = problems[_columns_of(taken)]
    fitted = _learnt(readouts, problem, taken, level, round(PERIODS * samples), given)
    if taken.rank is None:
        complete = replace(taken, ridge=level, readouts=_asked(settings, fitted, vary))
    else:
        complete = replace(taken, rank=int(level))
    return Selected(
        complete,
        tuple(_rows_of(trials, taken, level, seed)),
        _note(problem, trials, taken, level, worth, vary, folds == "sea_state"),
        fitted,
    )


def _problems(
    base: HankelSettings,
    steps: Sequence[Sequence[Changes]],
    given: Given,
    folds: Mapping[str, str] | int,
    ridges: Sequence[float],
    horizons: tuple[int, ...],
) -> dict[Columns, Problem]:
    """A problem per variant, of which the last step is made, if something can be held out."""
    tried = {
        name: [change[name] for changes in steps[:-1] for change in changes if name in change]
        for name in ("state_delays", "input_delays", "lead")
    }
    problems = {}
    for variant in steps[-1]:
        start = replace(base, **variant)
        lengths = tried | ({"lead": []} if "lead" in variant else {})
        problem = _problem(start, given, folds, ridges, horizons, lengths)
        if problem is not None and problem.folds():
            problems[_columns_of(start)] = problem
    return problems


def _best(
    problems: Mapping[Columns, Problem],
    trials: Mapping[Settings, Trial],
    best: Settings,
    alike: float,
) -> tuple[Settings, float]:
    """The best columns and the largest λ that is as good; if that grows, the best that does not."""
    means = trials[best].means
    largest = int(np.flatnonzero(means <= (1.0 + alike) * means.min())[-1])
    every = [
        (float(score), candidate, level)
        for candidate, trial in trials.items()
        for score, level in zip(trial.means, trial.levels, strict=True)
    ]
    wanted = [(best, trials[best].levels[largest])]
    wanted += [each[1:] for each in sorted(every, key=lambda each: each[0])]
    sound = (each for each in wanted if not problems[_columns_of(each[0])].grows(*each))
    return next(sound, wanted[0])


def _note(
    problem: Problem,
    trials: Mapping[Settings, Trial],
    taken: Settings,
    level: float,
    worth: str,
    vary: Sequence[str],
    by_sea: bool,
) -> str:
    """How the choice was made, in words."""
    count = sum(len(trial.levels) for trial in trials.values())
    score = trials[taken].means[trials[taken].levels.index(level)]
    chosen = taken.ridge_text(level) if taken.rank is None else f"rank {level:g}"
    note = (
        f"{chosen}: out of {count} settings (below, the best λ of each kind) in free runs on "
        f"{len(problem.folds())} parts held out in turn, mean NRMSE {score:.3f}{worth}"
    )
    if {"lead", "input_delays", "state_delays", "alignment"} & {*vary}:
        note += "; over instants that all of these can forecast"
    seas = len(set(problem.groups))
    if 1 < seas < len(problem.groups):
        if by_sea:
            alike = f"the runs of its sea state, of which there are {seas}"
        else:
            alike = f"the runs that repeat its waves; {seas} waves differ"
        note += f"; held out with each: {alike}"
    elif by_sea or seas == 1:
        shared = "no two runs share a sea state" if seas > 1 else "all runs have the same sea state"
        note += f"; {shared}, so each was held out alone"
    return note


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
            "vary names 'rank', and read-outs are chosen by free runs of ridge regressions. Leave "
            "out 'rank', or the read-outs: readouts = {} in a campaign file."
        )


def _asked(
    settings: HankelSettings, fitted: Sequence[FittedReadOut], vary: Sequence[str]
) -> ReadOuts:
    """Read-outs of complete settings: as stated, or of the kinds that were chosen."""
    if "readouts" not in vary:
        return settings.readouts
    return tuple(ReadOut(o.channel, o.of, o.kind) for o in fitted if o.kind != "none")


def _learnt(
    readouts: Sequence[ReadOut],
    problem: Problem | None,
    candidate: HankelSettings,
    level: float,
    steps: int,
    given: Given,
) -> tuple[FittedReadOut, ...]:
    """Fit read-outs to runs, and to forecasts of what is held out, if anything can be."""
    if not readouts:
        return ()
    if problem is not None:
        judged = list(problem.held_out(candidate, level, steps))
        return fit_readouts(readouts, problem.data, problem.runs, judged)
    settings = replace(candidate, ridge=1.0, standardize=True)
    return fit_readouts(readouts, gather(*given, None, settings), given[0], ())


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
        If a read-out names what is no state, λ is zero where forecasts are cross-fitted, or kind
        "wave" meets no waves that are carried to the predicted surge.
    """
    readouts = readouts_asked(settings.readouts, labelled.common_labels(runs, states))
    judged = [each for each in readouts if each.kind == "auto"]
    if not judged:
        return _learnt(readouts, None, settings, 0.0, 0, (runs, states, inputs))
    ridge = float(settings.ridge)
    if ridge == 0.0:
        raise RequestError(
            f"readouts: {judged[0].channel}: kind = 'auto' is chosen by free runs of ridge "
            "regressions, which take ridge above zero. Raise ridge, or take kind = 'wave'."
        )
    steps = round(PERIODS * labelled.mean_period(runs, inputs))
    if len(runs) == 1 and settings.window is not None:  # whose parts are shorter
        runs = {name: run.isel(time=slice(-settings.window, None)) for name, run in runs.items()}
        settings = replace(settings, window=None)
    apart = 3 if len(runs) == 1 else groups_of(runs, "auto", inputs)
    given = runs, states, inputs
    problem = _problem(settings, given, apart, (ridge,), (steps,), {})
    return _learnt(readouts, problem, settings, ridge, steps, given)


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


def _defaults(
    settings: HankelSettings,
    given: Given,
    period: float,
    unseen: bool,
) -> list[tuple[Observable, ...]]:
    """Observables to choose among, and fewer of them for runs that are too short."""
    aligned, lead = settings.alignment, None
    if aligned is not None and aligned.surge == "predicted":
        is_left_out = aligned.optional and aligned.missing(*given)
        lead = None if is_left_out else int(settings.lead)
    defaults = default_observables(given[2], period, unseen, lead)
    return list(dict.fromkeys([defaults, defaults[1:], ()]))


def _steps(
    every: tuple[Observable, ...],
    vary: Sequence[str],
    period: float,
    variants: Sequence[Changes],
) -> Iterator[Sequence[Changes]]:
    """Changes to try of one setting after the other."""
    if "observables" in vary:
        subsets = dict.fromkeys([(), *((each,) for each in every), every])
        yield [{"observables": each} for each in subsets]
    if "lead" in vary and "lead" not in variants[0]:
        yield [{"lead": round(each * period)} for each in LEADS]
    for name, periods in DELAYS.items():
        if name in vary:
            yield [{name: round(each * period)} for each in periods]
    if "rank" in vary:
        yield [{}, {"rank": RANKS[0], "ridge": 0.0}]
    yield variants


def _variants(
    settings: HankelSettings,
    given: Given,
    vary: Sequence[str],
    period: float,
) -> Iterator[Changes]:
    """Alignments, with each look-ahead that is tried where the model follows its own surge."""
    leads = [settings.lead]
    leads += [round(part * period) for part in LEADS if part > LEAD and "lead" in vary]
    alignments = [settings.alignment]
    if "alignment" in vary:
        alignments = _alignments(settings.alignment, given)
    for each in alignments:
        if each is None or each.surge != "predicted":
            yield {"alignment": each}
        else:
            yield from ({"alignment": each, "lead": lead} for lead in dict.fromkeys(leads))


def _alignments(
    stated: ProbeAlignment | None,
    given: Given,
) -> list[ProbeAlignment | None]:
    """Alignments that these runs allow and that differ, the stated one first, and none.

    None reads the measured surge: what is read after a start is no choice of a setting.
    """
    base = replace(stated or ProbeAlignment(), optional=False)
    carried = replace(base, mode="dispersion", celerity=None)
    alignments: list[ProbeAlignment | None] = []
    for alignment in (
        replace(carried, surge="predicted"),
        replace(carried, surge="none"),
        replace(base, mode="effective", surge="none"),
    ):
        try:
            fitted = alignment.fit(*given, None)
        except (RequestError, DataError):
            continue  # no depth, no positions, or no surge among the states
        assert isinstance(fitted, FittedAlignment)
        if alignment.surge == "predicted" or any(
            np.any(fitted.offsets(run)) for run in given[0].values()
        ):
            alignments.append(alignment)
    alignments.append(None)
    first = None if stated is None else base
    return sorted(alignments, key=lambda each: each != first)


def groups_of(
    runs: Mapping[str, xr.Dataset], folds: Folds, inputs: Sequence[str]
) -> dict[str, str]:
    """Name, by run, of the group of runs that are held out together.

    With "sea_state", runs that state the same; with "auto", runs whose waves are the same, as the
    channel that periods are counted in recorded them; with "run", each is alone.
    """
    if folds == "sea_state":
        return {name: str(run.attrs.get("sea_state") or name) for name, run in runs.items()}
    waves = {name: labelled.wave_channel(run, inputs, name) for name, run in runs.items()}
    if folds == "run" or None in waves.values():
        return {name: name for name in runs}
    records = {name: runs[name][wave].to_numpy() for name, wave in waves.items()}
    return repeated_waves(records, labelled.common_step(runs))


def _rows_of(
    trials: Mapping[Settings, Trial], taken: Settings, level: float, seed: int
) -> Iterator[dict[str, Any]]:
    """Rows of the table: windows are drawn again for the interval of each score."""
    rng = np.random.default_rng(seed)
    for candidate, trial in trials.items():
        count = len(trial.weights)
        drawn = rng.integers(count, size=(DRAWS, count))
        weights = trial.weights[drawn]
        totals = (trial.scores[:, drawn] * weights).sum(axis=2) / weights.sum(axis=1)
        aligned, is_rank = candidate.alignment, candidate.rank is not None
        bounds = np.quantile(totals, [0.025, 0.975], axis=1)
        for own, score, low, high in zip(trial.levels, trial.means, *bounds, strict=True):
            yield {
                "state_delays": candidate.state_delays,
                "input_delays": candidate.input_delays,
                "lead": candidate.lead,
                "observables": ", ".join(each.kind for each in candidate.observables) or "none",
                "alignment": "none" if aligned is None else f"{aligned.mode}, {aligned.surge}",
                "ridge": 0.0 if is_rank else own,
                "rank": int(own) if is_rank else 0,
                "score": float(score),
                "lower": float(low),
                "upper": float(high),
                "chosen": candidate == taken and own == level,
            }
