"""Decisions made before the first model is fitted: models, training sets, test windows.

Windows are drawn once and are the same for all models.
"""

import zlib
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, Groups, Progress
from seakeep.campaign import load_prepared
from seakeep.check.parts import whole_span
from seakeep.conventions import is_elevation
from seakeep.errors import RequestError, warn
from seakeep.models import Needs, Spec
from seakeep.models.labelled import sound_matrix
from seakeep.models.selection import groups_of
from seakeep.models.settings import Folds, periods_to_samples
from seakeep.models.validity import warn_of_slow_motions
from seakeep.study.resolve import ResolvedModel, can_align, resolve_model
from seakeep.study.settings import Study, StudySettings, TestSetSettings, TrainingSettings

Span = tuple[str, float, float]
"""Run, first and last instant, s."""


@dataclass(frozen=True)
class TrainingSet:
    """Training data of one model: spans of one or several runs, each up to its stop.

    Parameters
    ----------
    name : str
        Such as ``t03``, or the run that is left out.
    spans : tuple of (str, float, float)
        Run, first instant that may be read, and stop, s.
    left_out : tuple of str
        Runs that only test; empty where training and test lie in different spans.
    like : tuple of str
        Runs that may not test: those that train, and those of their groups; empty where training
        and test lie in different spans.
    """

    name: str
    spans: tuple[Span, ...]
    left_out: tuple[str, ...] = ()
    like: tuple[str, ...] = ()

    def may_test(self, run: str) -> bool:
        """Whether a run may test what was learnt here."""
        return run not in self.like


@dataclass(frozen=True)
class TestWindow:
    """A window that is forecast: a run, its start and its number of instants.

    Parameters
    ----------
    run : str
        The run.
    start : float
        Instant of the last measured state, s; a sample of the run.
    steps : int
        Instants forecast.
    """

    __test__ = False  # not a test class, although pytest would collect it by its name

    run: str
    start: float
    steps: int


def random_stream(seed: int, purpose: str) -> np.random.Generator:
    """Generator of one purpose, so that a further test set changes no other draw."""
    return np.random.default_rng([seed, zlib.crc32(purpose.encode())])


def named(progress: Progress | None, words: str) -> Progress | None:
    """Put words before what a progress names."""
    if progress is None:
        return None
    return lambda done, total, name: progress(done, total, f"{words}{name}")


def between(run: xr.Dataset, span: tuple[float, float]) -> xr.Dataset:
    """Part of a run between two of its own instants, both included."""
    first, last = _samples(run, span)
    return run.isel(time=slice(first, last + 1))


def step_of(runs: Datasets) -> float:
    """Time step that prepared runs share, s."""
    return float(next(iter(runs.values())).attrs["dt"])


def _samples(run: xr.Dataset, span: tuple[float, float]) -> tuple[int, int]:
    """First and last sample of a run inside a span."""
    slack = 1e-6 * float(run.attrs.get("dt", 1.0))
    begin, end = np.searchsorted(run["time"].values, [span[0] - slack, span[1] + slack])
    return int(begin), int(end) - 1


def parts_of(runs: Datasets, spans: Iterable[Span]) -> Groups:
    """Part of each run from the start of its first to the end of its last span."""
    edges = defaultdict[str, list[float]](list)
    for name, *ends in spans:
        edges[name] += ends
    return {name: between(runs[name], (min(ends), max(ends))) for name, ends in edges.items()}


def left_out_together(
    runs: Datasets, names: Sequence[str], folds: Folds, inputs: Sequence[str]
) -> list[list[str]]:
    """Groups of training runs that are left out together, each with the other runs like them.

    Other runs are compared one by one: an irregular run does not decide how regular ones that
    train are grouped.
    """
    known = {name: runs[name] for name in names}
    of_run = groups_of(known, folds, inputs)
    for name in runs.keys() - known.keys():
        each = groups_of({**known, name: runs[name]}, folds, inputs)
        of_run.update((name, of_run[n]) for n in names if each[n] == each[name])
    groups = dict.fromkeys(of_run.values())
    return [[name for name in runs if of_run.get(name) == group] for group in groups]


def choose_training(
    settings: StudySettings,
    runs: Datasets,
    names: Sequence[str],
    needs: Needs,
    inputs: Sequence[str],
) -> tuple[TrainingSet, ...]:
    """Choose what the models learn from."""
    training = settings.training
    groups: list[list[str]] = []
    if training.scheme == "leave_out":
        groups = left_out_together(runs, names, training.leave_out, inputs)
        if len(groups) < 2:
            what = training.leave_out.replace("_", " ")
            what = "run with its repetitions" if what == "auto" else what
            raise RequestError(
                f"training: leaving out a {what} of {', '.join(names)} leaves no run to learn "
                "from. Give more runs, or use scheme = 'halves'."
            )
    elif missing := [name for name in names if "train_span" not in runs[name].attrs]:
        raise RequestError(
            f"training: the run '{missing[0]}' has no training span in the campaign. Give it "
            "role = 'train' or a span train = [start, end], or use scheme = 'leave_out'."
        )
    uses = () if groups else ("train",)
    spans = {name: _samples(runs[name], whole_span(runs[name], *uses)) for name in names}
    longest = max(spans, key=lambda name: spans[name][1] - spans[name][0])
    needed = training_samples(needs)
    for name in [longest] if training.scheme == "halves" else names:
        samples, dt = spans[name][1] - spans[name][0] + 1, float(runs[name].attrs["dt"])
        if samples < needed:
            raise RequestError(
                f"training: no window is feasible in '{name}'. Its span holds {samples} samples "
                f"({samples * dt:g} s), and the largest draw of all models needs {needed} "
                f"({needs.snapshots} snapshots and {needs.history} of delay history, "
                f"{needed * dt:g} s). Shorten window or the delays, or give longer runs."
            )

    def part(name: str, last: int) -> Span:
        time = runs[name]["time"].values
        return name, float(time[spans[name][0]]), float(time[last])

    whole = {name: part(name, last) for name, (_, last) in spans.items()}
    if groups:
        return tuple(
            TrainingSet(
                f"without {group[0]}" + (f" (+{len(group) - 1})" if len(group) > 1 else ""),
                tuple(whole[name] for name in names if name not in group),
                tuple(group),
                tuple(name for other in groups if other is not group for name in other),
            )
            for group in groups
        )
    if training.scheme == "pooled":
        return (TrainingSet("pooled", tuple(whole.values())),)
    seed, remedy = settings.study.seed, "shorten the training length"
    places = _places("training", training, spans, needed, needs.snapshots, seed, remedy, {})
    return tuple(
        TrainingSet(f"t{number:02d}", (part(*place),)) for number, place in enumerate(places)
    )


def _places(
    table: str,
    asked: TrainingSettings | TestSetSettings,
    spans: Mapping[str, tuple[int, int]],
    needed: int,
    width: int,
    seed: int,
    remedy: str,
    shares: Mapping[str, str],
) -> list[tuple[str, int]]:
    """Feasible last samples in random order; with 'apart' no two within `width` samples.

    `shares` names the share of each run: the first place of each share goes before all others.
    """
    drawn = asked.placement == "random"
    step = 1 if drawn else max(width, 1)
    every = []
    for name, (first, last) in spans.items():
        stops = range(last, first + needed - 2, -step)
        every += [(name, stop) for stop in (reversed(stops) if drawn else stops)]
    count = len(every) if asked.windows is None else asked.windows
    if drawn and count > len(every):
        raise RequestError(
            f"{table}.windows: {count} windows were asked for and {len(every)} are feasible. Ask "
            f"for fewer, or {remedy}."
        )
    places = [every[i] for i in random_stream(seed, table).permutation(len(every))]
    firsts = dict[str, tuple[str, int]]()
    for place in places if shares else ():
        firsts.setdefault(shares[place[0]], place)
    return list(dict.fromkeys([*firsts.values(), *places]))[:count]


def choose_tests(
    name: str,
    test: TestSetSettings,
    runs: Datasets,
    names: Sequence[str],
    *,
    steps: int,
    needs: Needs,
    whole: bool,
    seed: int,
    training: Sequence[TrainingSet],
) -> tuple[TestWindow, ...]:
    """Choose the windows of a test set.

    Each group of runs that is left out together has one, and each other run, where there are as
    many windows.
    """
    spans = {}
    for each in names:
        run = runs[each]
        span = whole_span(run) if whole or "test_span" not in run.attrs else run.attrs["test_span"]
        first, last = _samples(run, (span[0] + test.startup, span[1]))
        # The last step reads the input `lead` samples after the instant that it starts from.
        spans[each] = (max(first, needs.history), min(last, run.sizes["time"] - max(needs.lead, 1)))
    longest = max(last - first + 1 for first, last in spans.values())
    if longest <= steps:  # a window of `steps` instants after its start: steps + 1 samples
        dt = float(runs[names[0]].attrs["dt"])
        periods = np.floor(10 * (longest - 1) * test.length / steps) / 10
        at_most = f" (length at most {periods:g} periods)" if periods > 0 else ""
        raise RequestError(
            f"tests.{name}: no window is feasible. A window has {steps} instants "
            f"({steps * dt:g} s), and the longest test span ({', '.join(names)}) holds "
            f"{max(longest, 0)} samples after {needs.history} of delay history and the start-up. "
            f"Reduce length or startup{at_most}, or give longer runs."
        )
    shares = {run: run for run in names}
    shares |= {run: each.name for each in training for run in each.left_out}
    places = _places(f"tests.{name}", test, spans, steps + 1, steps, seed, "reduce length", shares)
    return tuple(
        TestWindow(each, float(runs[each]["time"].values[last - steps]), steps)
        for each, last in sorted(places, key=lambda place: (names.index(place[0]), place[1]))
    )


def windows_overlap(spans: Sequence[tuple[str, float, float]]) -> float:
    """Mean fraction of a window that other windows of the same run cover too, 0 to 1.

    Parameters
    ----------
    spans : sequence of (str, float, float)
        Run, start and end of each window.

    Returns
    -------
    float
        0 for windows apart, 1 for windows that all lie in one another.

    Examples
    --------
    >>> windows_overlap([("a", 0.0, 10.0), ("a", 5.0, 15.0)])
    0.5
    """
    shares = []
    for run, begin, end in spans:
        middle = begin + (end - begin) * (np.arange(200) + 0.5) / 200
        covers = [
            (first <= middle) & (middle <= last) for other, first, last in spans if other == run
        ]
        shares.append(np.mean(np.sum(covers, axis=0) > 1))  # its own is one of them
    return float(np.mean(shares)) if shares else 0.0


def training_samples(needs: Needs) -> int:
    """Samples up to and including the stop of a training window."""
    return max(needs.snapshots, needs.history + 2) + (0 if needs.inside else needs.history)


@dataclass(frozen=True, eq=False)
class Plan:
    """Plan of a study.

    Parameters
    ----------
    settings : StudySettings
        What was asked for.
    states, inputs : tuple of str
        Channels.
    dt, encounter_period : float
        s.
    models : dict of str to ResolvedModel
        Specs, and where their settings come from.
    needs : Needs
        Samples of the largest draw of all models.
    training : tuple of TrainingSet
        Training data of the members.
    tests : dict of str to tuple of TestWindow
        What they are judged on.
    runs : dict of str to Dataset
        Prepared runs.
    calibrated_on : tuple of str
        Runs that train, if bands are to be calibrated on them.
    """

    settings: StudySettings
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    dt: float
    encounter_period: float
    models: dict[str, ResolvedModel]
    needs: Needs
    training: tuple[TrainingSet, ...]
    tests: dict[str, tuple[TestWindow, ...]]
    runs: Groups
    calibrated_on: tuple[str, ...] = ()

    @property
    def specs(self) -> dict[str, Spec]:
        """Specs of the models."""
        return {name: each.spec for name, each in self.models.items()}

    @property
    def ensembles(self) -> list[str]:
        """Names of the models that have members."""
        return [name for name, each in self.models.items() if each.spec.is_ensemble]

    @property
    def waves(self) -> str | None:
        """First wave elevation among the inputs."""
        return next(filter(is_elevation, self.inputs), None)

    @property
    def windows(self) -> list[TestWindow]:
        """Windows of all test sets."""
        return [each for windows in self.tests.values() for each in windows]

    def taught(self, spans: Iterable[Span]) -> tuple[Groups, list[str], list[str]]:
        """What a spec is fitted to: parts of runs, states, inputs."""
        return parts_of(self.runs, spans), list(self.states), list(self.inputs)


def make_plan(study: Study, progress: Progress | None = None) -> Plan:
    """Prepare the runs of a study and choose its windows."""
    settings, campaign = study.settings, study.campaign
    general = settings.study
    training_names = list(settings.training.runs) or campaign.training_runs
    testing = {name: _test_runs(study, name) for name in settings.tests}
    asked = dict.fromkeys(run for names in testing.values() for run in names)
    wanted = list(dict.fromkeys(training_names) | asked)
    runs = load_prepared(campaign, names=wanted, progress=progress)
    for name, run in runs.items():
        sound_matrix(run, [*study.states, *study.inputs], f"run '{name}'")
    shared, dt = next(iter(runs.values())).attrs, step_of(runs)
    # Prepared runs hold the period where their preparation counts in it.
    period = (
        general.encounter_period or shared.get("encounter_period") or campaign.encounter_period()
    )
    left_out = settings.training.scheme == "leave_out"
    models = {
        name: resolve_model(
            each,
            period,
            dt,
            preset=general.preset,
            seed=general.seed,
            aligned=can_align(campaign.settings, study.inputs),
            folds=settings.training.leave_out if left_out else "auto",
        )
        for name, each in settings.models.items()
    }
    # The same windows serve all models.
    each_needs = [each.spec.needs(dt, period) for each in models.values()]
    needs = Needs(
        max(each.snapshots for each in each_needs),
        max(each.history for each in each_needs),
        all(each.inside for each in each_needs),
        max(each.lead for each in each_needs),
    )
    training = choose_training(settings, runs, training_names, needs, study.inputs)
    tests = {
        name: choose_tests(
            name,
            test,
            runs,
            testing[name],
            steps=periods_to_samples(test.length, period, dt),
            needs=needs,
            whole=(test.part or ("whole" if left_out else "test")) == "whole",
            seed=general.seed,
            training=training,
        )
        for name, test in settings.tests.items()
    }
    tested = {window.run for windows in tests.values() for window in windows}
    untested = [
        each.name
        for each in training
        if asked.keys() & each.left_out and not any(map(each.may_test, tested))
    ]
    if untested:
        warn(
            f"tests: no window is left for the training sets {', '.join(untested)}, whose models "
            f"are fitted and not judged. Ask for more windows, at least {len(training)} to test "
            "all, or reduce length."
        )
    return Plan(
        settings,
        study.states,
        study.inputs,
        dt,
        period,
        models,
        needs,
        training,
        tests,
        runs,
        tuple(training_names) if settings.calibrates else (),
    )


def _test_runs(study: Study, name: str) -> list[str]:
    test, campaign = study.settings.tests[name], study.campaign
    folds = study.settings.training.scheme == "leave_out"
    trained = study.settings.training.runs
    names = test.runs or (trained if folds else ()) or campaign.test_runs
    kinds = {n: campaign.settings.runs[n].waves for n in names}
    chosen = [n for n in names if test.waves in (None, kinds[n] or "irregular")]
    if not chosen:
        listed = (
            ", ".join(f"{n} ({kind or 'not stated: irregular'})" for n, kind in kinds.items())
            or "none"
        )
        raise RequestError(
            f"tests.{name}: no run to test. The runs that test are: {listed}; waves = "
            f"{test.waves!r}. State the waves of a run in the campaign, such as waves = "
            "'irregular' under [runs.NAME]; or name runs = [...] here, without waves; or give runs "
            "of the campaign a test span."
        )
    trains = trained or campaign.training_runs
    if learnt := [n for n in chosen if n in trains and n not in campaign.test_runs and not folds]:
        raise RequestError(
            f"tests.{name}: the run '{learnt[0]}' trains, and the campaign gives it no test span: "
            "models would forecast what they learnt from. Give it the spans train = [start, end] "
            "and test = [start, end], or name other runs."
        )
    return chosen


def warn_of_slow_study(plan: Plan) -> None:
    """Warn once for a study, of the model and training set that hold the fewest slow periods."""
    trained = {}
    for model, spec in plan.specs.items():
        snapshots = spec.needs(plan.dt, plan.encounter_period).snapshots
        longest = (snapshots - 1) * plan.dt if snapshots > 1 else np.inf
        for each in plan.training if spec.standardize else ():
            seconds = sum(min(stop - begin, longest) for _, begin, stop in each.spans)
            trained[f"the training windows of '{model}' in '{each.name}'"] = seconds
    if trained:
        where = min(trained, key=trained.__getitem__)
        parts, states, _ = plan.taught(span for each in plan.training for span in each.spans)
        warn_of_slow_motions(parts, states, trained[where], plan.encounter_period, where)
