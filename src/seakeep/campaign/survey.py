"""Computed from all runs together: the clocks of the loggers and the encounter period."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path

import numpy as np

from seakeep.arrays import Progress
from seakeep.campaign.pipeline import (
    Run,
    cleaned,
    derived,
    mapped,
    read,
    resampled,
    sync,
)
from seakeep.campaign.settings import CampaignSettings
from seakeep.errors import DataError, SeakeepError, naming, warn
from seakeep.quality import Finding, warn_of
from seakeep.quality.clocks import ClocksKind
from seakeep.signals import Clock, encounter_period, pool_drift, uniform_step, waves_part
from seakeep.signals.synchronisation import without_doubtful_drift
from seakeep.signals.time_axis import inside
from seakeep.signals.waves import energy_period

NOISY = 1.2
"""Part by which the count may grow once crossings lower than a tenth of the SD are left out.

It grows by 5 to 10 % in Pierson-Moskowitz and JONSWAP seas, and by 24 to 37 % with white noise of
a twentieth of their SD, which takes 17 to 23 % off the count."""
FEW = 40
"""Waves of which a few that are low may be a fifth."""
FEWEST = 10.0
"""Waves in a run that others, if they hold more, leave out of the encounter period: the mean of ten
is certain to a tenth."""
Failures = dict[str, SeakeepError]
"""Errors by run: a run that cannot be read must not stop the others."""

LED = 2.0
"""Factor between counted and energy period beyond which one of them is not a period of the waves.

The energy period is 1.20 times the crossing period in a Pierson-Moskowitz spectrum, and less in
narrower ones; two seas of one height that are two octaves apart make 1.82. White noise of a third
of the waves' height takes a tenth off the energy period, and makes the count a fraction."""

KEPT = 2**30
"""Bytes of columns that are kept from the survey of all runs until each is prepared: campaigns of
model tests fit; what is beyond is read again."""

LISTED = 6
"""Errors of runs that one message holds at most."""


def as_one(errors: Mapping[str, SeakeepError]) -> SeakeepError:
    """One error for those of several runs; that of a single run as it is."""
    if len(errors) == 1:
        return next(iter(errors.values()))
    lines = [f"'{run}': {error}" for run, error in list(errors.items())[:LISTED]]
    if len(errors) > LISTED:
        lines.append(f"and {len(errors) - LISTED} more")
    return DataError(f"{len(errors)} runs cannot be read:\n" + "\n".join(lines))


@dataclass(frozen=True)
class Survey:
    """What is computed from all runs together, and how each of them is read with it.

    Parameters
    ----------
    settings : CampaignSettings
        The campaign.
    files_of : callable
        Gives the paths of a run's files by logger.
    kept : dict of str to Run
        Runs that were read for the survey, each until it is wanted.
    clocks : dict of str to dict of str to Clock
        By run and logger, of those that were read.
    period : float
        Encounter period, s: the stated one, or the mean zero-up-crossing period of the wave
        channel; 0 where it was not asked for.
    failures : dict of str to SeakeepError
        Errors of runs that could not be read.
    left_out : dict of str to str
        By run, what it is left out of because it cannot be read, and why.
    doubts : dict of str to list of Finding
        By run, what speaks against its counted period.
    """

    settings: CampaignSettings
    files_of: Callable[[str], Mapping[str, Path]]
    kept: dict[str, Run]
    clocks: Mapping[str, Mapping[str, Clock]]
    period: float
    failures: Failures
    left_out: Mapping[str, str]
    doubts: Mapping[str, Sequence[Finding]]

    @property
    def dt(self) -> float | None:
        """Common time step, s, if one is stated."""
        stated = self.settings.preparation
        if stated.steps_per_period and self.period:
            return self.period / stated.steps_per_period
        return 1.0 / stated.sampling_rate if stated.sampling_rate else stated.dt

    def clocks_of(self, name: str) -> Mapping[str, Clock]:
        """Clocks of a run by logger; the error with which it could not be read, if there is one."""
        if name in self.failures:
            raise self.failures[name]
        return self.clocks.get(name, {"": Clock()})

    def read(self, name: str) -> Run:
        """Steps 1 and 2: a run's files, their clocks known."""
        clocks, findings = self.clocks_of(name), self.doubts.get(name, ())
        run = self.kept.pop(name, None) or read(name, self.settings, self.files_of(name))
        return replace(run, period=self.period, clocks=clocks, findings=findings)

    def channels(self, name: str) -> Run:
        """Steps 1 to 5: the channels of a run by logger, at their own rates."""
        return derived(cleaned(mapped(self.read(name))))


def survey(
    settings: CampaignSettings,
    files_of: Callable[[str], Mapping[str, Path]],
    asked: Sequence[str],
    channel: str | None,
    progress: Progress | None,
) -> Survey:
    """Read each run once for its clocks and, where a `channel` of waves is given, its period.

    Runs that cannot be read are left out of what is pooled, with a warning unless they are `asked`
    for, since their errors are raised then. Drifts are pooled where the campaign does not say
    otherwise, and one that is not certain is left out.
    """
    pools = settings.instruments.pool_drift
    # Those whose drifts are pooled with theirs, too.
    pooled = settings.used_runs if pools and any(settings.runs[n].files for n in asked) else ()
    clock_runs = [n for n in (*asked, *pooled) if settings.runs[n].files]
    period_runs = () if channel is None else settings.period_runs
    runs = list(dict.fromkeys([*clock_runs, *period_runs]))
    kept: dict[str, Run] = {}
    free = KEPT
    clocks = {}
    counted = {}
    failures: Failures = {}
    left_out = {}
    for count, name in enumerate(runs, 1):
        if progress:
            progress(0, len(runs), f"clocks and waves of {name} ({count} of {len(runs)})")
        try:
            run = sync(read(name, settings, files_of(name)))
            if name in asked and free > 0:
                kept[name] = run
                free -= run.size
            clocks[name] = dict(run.clocks)
            if name in period_runs:
                counted[name] = _counted(run, str(channel))
        except SeakeepError as error:
            failures[name] = error
            lacks = ["the encounter period"] * (name in period_runs)
            lacks += ["the pooled clock drifts"] * (name in clock_runs and name not in clocks)
            left_out[name] = (
                f"is left out of {' and of '.join(lacks) or 'the clocks'}: {error} "
                f"Once it is repaired, prepare again; or state role = 'unused' in [runs.{name}]."
            )
    long = [each for each in counted.values() if each[1] >= FEWEST] or counted.values()
    measured = float(np.mean([each[0] for each in long])) if long else 0.0
    period = settings.campaign.encounter_period or measured
    doubts = {name: each[2] for name, each in counted.items()}
    if failures and (not clocks or (period_runs and not counted)):
        raise as_one(failures)
    for name, words in left_out.items():
        if name not in asked:
            warn(f"run '{name}' {words}")
    warn_of(chain.from_iterable(doubts.values()), set())
    _settle_drifts(clocks, pools)
    return Survey(settings, files_of, kept, clocks, period, failures, left_out, doubts)


def _settle_drifts(clocks: Mapping[str, dict[str, Clock]], pools: bool) -> None:
    """Pool the drifts of each logger, if that is wanted, and leave out those in doubt."""
    for logger in {name for each in clocks.values() for name in each}:
        having = [each for each in clocks.values() if logger in each]
        known = [each[logger] for each in having]
        for each, clock in zip(having, pool_drift(known) if pools else known, strict=True):
            each[logger] = without_doubtful_drift(clock)


def _counted(run: Run, channel: str) -> tuple[float, float, list[Finding]]:
    """Counted period of the waves of a run (s), their number, and what speaks against it."""
    run = derived(cleaned(mapped(run, [channel])))
    group = next((each for each in run.groups.values() if channel in each), None)
    if group is None:  # it needs several loggers
        group = resampled(run, uniform_step(run.reference_time)).data
    time, series = group["time"].values, group[channel].values
    step = uniform_step(time, f"run '{run.name}'")
    used = inside(time, run.used_span, step)
    series = series[used] if used.sum() > 2 else series
    with naming(f"run '{run.name}', channel '{channel}'"):
        stated = run.settings.campaign.period_hysteresis
        period = encounter_period(series, step, stated)
        waves = series.size * step / period
        steady = period
        if waves > FEW:
            # A spike would make the SD so large that no wave is left.
            clipped = np.clip(series, *np.quantile(series, [0.001, 0.999]))
            steady = encounter_period(clipped, step, max(stated, 0.1))
    energy = energy_period(series[waves_part(series, step)], step)
    doubts = []
    if not 1 / LED <= energy / period <= LED or steady > NOISY * period:
        doubts.append(Finding(ClocksKind.PERIOD, run.name, channel, period, energy, "s"))
    return period, waves, doubts
