"""All that is decided before the first model is fitted: models, windows, what the windows hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from seakeep.campaign import load_prepared
from seakeep.campaign.prepare import Progress
from seakeep.errors import DataError, RequestError
from seakeep.models import HankelDMDc
from seakeep.models.settings import periods_to_samples
from seakeep.study.needs import needs_of
from seakeep.study.settings import Study
from seakeep.study.specs import Spec, build_spec, model_settings
from seakeep.study.windows import (
    Needs,
    TestWindow,
    TrainingSet,
    choose_tests,
    choose_training,
)

__all__ = ["Plan", "make_plan"]


@dataclass(frozen=True, eq=False)
class Plan:
    """What a study does.

    Parameters
    ----------
    digest : str
        Of the study.
    states, inputs : tuple of str
        Channels.
    dt, encounter_period : float
        s.
    level : float
        Probability of the bands.
    specs : dict of str to HankelDMDc or BayesianHankelDMDc
        Models.
    training : tuple of TrainingSet
        What they learn from.
    tests : dict of str to tuple of TestWindow
        What they are judged on.
    shown : int
        Windows of the first test set whose members are kept; one of each further set.
    needs : Needs
        Samples of the greediest draw.
    calibrated_on : tuple of str
        Runs that train, if bands are to be calibrated on them.
    """

    digest: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    dt: float
    encounter_period: float
    level: float
    specs: dict[str, Spec]
    training: tuple[TrainingSet, ...]
    tests: dict[str, tuple[TestWindow, ...]]
    shown: int
    needs: Needs
    calibrated_on: tuple[str, ...] = ()

    def is_ensemble(self, model: str) -> bool:
        """Whether a model is an ensemble."""
        return not isinstance(self.specs[model], HankelDMDc)

    def is_shown(self, training: int, test: str, window: int) -> bool:
        """Whether the members of a cell are kept for figures."""
        first = next(iter(self.tests)) == test
        valid = [
            k for k, each in enumerate(self.training) if each.may_test(self.tests[test][window].run)
        ]
        wanted = self.shown if first else min(self.shown, 1)
        return window in self.shown_windows(test, wanted) and valid[:1] == [training]

    def shown_windows(self, test: str, count: int | None = None) -> list[int]:
        """Windows of a test set that figures show, spread over its runs."""
        first = next(iter(self.tests)) == test
        wanted = (self.shown if first else min(self.shown, 1)) if count is None else count
        total = len(self.tests[test])
        return [int(place) for place in np.linspace(0, total - 1, min(wanted, total)).round()]


def make_plan(study: Study, progress: Progress | None = None) -> tuple[Plan, dict[str, xr.Dataset]]:
    """Prepare the runs of a study and choose its windows.

    Parameters
    ----------
    study : Study
        The study.
    progress : callable, optional
        Called as ``progress(done, total, run)`` while runs are prepared.

    Returns
    -------
    plan : Plan
        What there is to do.
    runs : dict of str to Dataset
        Prepared runs with all of their channels.

    Raises
    ------
    RequestError
        If a channel is missing, or settings leave no feasible window.
    DataError
        If a run cannot be read or used.
    """
    settings, campaign = study.settings, study.campaign
    training_names = list(settings.training.runs) or campaign.training_runs
    testing = {name: _test_runs(study, name) for name in settings.tests}
    wanted = dict.fromkeys([*training_names, *(n for names in testing.values() for n in names)])
    runs = load_prepared(campaign, names=list(wanted), progress=progress)
    for name, run in runs.items():
        _check_channels(name, run, [*study.states, *study.inputs])
    dt = float(next(iter(runs.values())).attrs["dt"])
    period = settings.study.encounter_period or campaign.encounter_period()
    specs = {n: build_spec(model_settings(study, n), period, dt) for n in settings.models}
    needs = needs_of(list(specs.values()), dt)
    training = choose_training(settings, runs, training_names, needs)
    tests = {
        name: choose_tests(
            name,
            test,
            runs,
            testing[name],
            steps=periods_to_samples(test.length, period, dt),
            needs=needs,
            whole=settings.training.scheme == "leave_out",
            seed=settings.study.seed,
        )
        for name, test in settings.tests.items()
    }
    plan = Plan(
        digest=study.digest,
        states=study.states,
        inputs=study.inputs,
        dt=dt,
        encounter_period=period,
        level=settings.statistics.level,
        specs=specs,
        training=training,
        tests=tests,
        shown=settings.output.shown_windows,
        needs=needs,
        calibrated_on=tuple(training_names) if settings.calibrates else (),
    )
    _check_pairs(plan)
    return plan, runs


def _test_runs(study: Study, name: str) -> list[str]:
    test, campaign = study.settings.tests[name], study.campaign
    folds = study.settings.training.scheme == "leave_out"
    default = list(study.settings.training.runs) if folds else campaign.test_runs
    names = list(test.runs) or default or campaign.test_runs
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
    trains = list(study.settings.training.runs) or campaign.training_runs
    if learnt := [n for n in chosen if n in trains and n not in campaign.test_runs and not folds]:
        raise RequestError(
            f"tests.{name}: the run '{learnt[0]}' trains, and the campaign gives it no test span: "
            "models would forecast what they learnt from. Give it the spans train = [begin, end] "
            "and test = [begin, end], or name other runs."
        )
    return chosen


def _check_channels(name: str, run: xr.Dataset, channels: list[str]) -> None:
    for channel in channels:
        if channel not in run.data_vars:
            known = ", ".join(map(str, run.data_vars))
            raise RequestError(
                f"the run '{name}' has no channel '{channel}', which the study needs. It has: "
                f"{known}. Add the channel to the campaign, or leave the run out."
            )
        if not np.all(np.isfinite(run[channel].values)):
            raise DataError(
                f"channel '{channel}' of the run '{name}' has missing values. Fill or cut the gap "
                "in the campaign, or leave the run out."
            )


def _check_pairs(plan: Plan) -> None:
    for name, windows in plan.tests.items():
        for window in windows:
            if not any(each.may_test(window.run) for each in plan.training):
                raise RequestError(
                    f"tests.{name}: no model may be tested on the run '{window.run}', because all "
                    "learn from it. Leave it out of training.runs, or name other runs."
                )
