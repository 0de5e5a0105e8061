"""What only all runs together tell: the clocks of the loggers and the encounter period."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.campaign.channels import read_groups
from seakeep.campaign.instruments import Logger, clocks_of, open_loggers
from seakeep.campaign.resampling import inside, on_one_axis
from seakeep.campaign.settings import CampaignSettings, RunSettings
from seakeep.errors import DataError, MissingFileError, SeakeepError, SeakeepWarning
from seakeep.signals import Clock, encounter_period, pool_drift, uniform_step, waves_part
from seakeep.signals.synchronisation import without_doubtful_drift
from seakeep.signals.waves import energy_period
from seakeep.toml import number

__all__ = ["Failures", "Survey", "as_one", "spare", "survey"]

Failures = dict[str, SeakeepError]
"""Errors by run, where runs that cannot be read shall not stop the others."""

LED = 2.0
"""Factor between counted and energy period beyond which one of them is no period of the waves.

The energy period is 1.20 times the crossing period in a Pierson-Moskowitz spectrum, and less in
narrower ones; two seas of one height that are two octaves apart make 1.82. White noise of a third
of the waves' height takes a tenth off the energy period, and makes the count a fraction."""

LISTED = 6
"""Errors of runs that one message holds at most."""


@dataclass(frozen=True)
class Survey:
    """Clocks and encounter periods of runs.

    Parameters
    ----------
    clocks : dict of str to dict of str to Clock
        By run and logger.
    periods : dict of str to float
        Zero-up-crossing period of the wave channel by run, s.
    left_out : dict of str to str
        By run, of what it is no part because it cannot be read, and why.
    doubts : dict of str to str
        By run, what speaks against its period.
    """

    clocks: Mapping[str, Mapping[str, Clock]]
    periods: Mapping[str, float]
    left_out: Mapping[str, str] = field(default_factory=dict)
    doubts: Mapping[str, str] = field(default_factory=dict)


def spare(failures: Failures | None, run: str, error: SeakeepError) -> None:
    """Note the error of a run whose files cannot be read, or raise it.

    Parameters
    ----------
    failures : dict of str to SeakeepError, or None
        Takes the error; None raises it.
    run : str
        Name of the run.
    error : SeakeepError
        What was wrong. A request that is wrong is so for all runs, and raised anyway.

    Raises
    ------
    SeakeepError
        The error, if it is not to be noted.
    """
    if failures is None or not isinstance(error, DataError | MissingFileError):
        raise error
    failures[run] = error


def as_one(errors: Mapping[str, SeakeepError]) -> SeakeepError:
    """One error for those of several runs; that of a single run as it is."""
    if len(errors) == 1:
        return next(iter(errors.values()))
    lines = [f"'{run}': {error}" for run, error in list(errors.items())[:LISTED]]
    if len(errors) > LISTED:
        lines.append(f"and {len(errors) - LISTED} more")
    return DataError(f"{len(errors)} runs cannot be read:\n" + "\n".join(lines))


def survey(
    settings: CampaignSettings,
    files_of: Callable[[str], Mapping[str, Path]],
    clock_runs: Sequence[str],
    period_runs: Sequence[str],
    channel: str,
    progress: Callable[[int, int, str], None] | None = None,
    asked: Collection[str] = (),
    failures: Failures | None = None,
) -> Survey:
    """Read each run once for its clocks and its period; only one is held at a time.

    Parameters
    ----------
    settings : CampaignSettings
        The campaign.
    files_of : callable
        Gives the files of a run by logger.
    clock_runs, period_runs : sequence of str
        Runs whose clocks, and whose periods, are wanted.
    channel : str
        The wave channel.
    progress : callable, optional
        Called as ``progress(0, total, words)`` before each run.
    asked : collection of str, optional
        Runs that are wanted for themselves. Of the others, those that cannot be read are left out
        of what is pooled, with a warning.
    failures : dict of str to SeakeepError, optional
        Takes the errors of runs in `asked` that cannot be read, in place of raising them.

    Returns
    -------
    Survey
        Drifts are pooled over the runs that can be read, where the campaign does not say
        otherwise, and one that is not certain is left out.

    Raises
    ------
    RequestError, DataError
        If a file of a run in `asked` cannot be read, a clock not found, or its record holds fewer
        than two waves; or if that is so of every run.
    """
    runs = list(dict.fromkeys([*clock_runs, *period_runs]))
    clocks: dict[str, dict[str, Clock]] = {}
    periods: dict[str, float] = {}
    doubts: dict[str, str] = {}
    bad: Failures = {}
    for count, run in enumerate(runs, 1):
        if progress is not None:
            progress(0, len(runs), f"clocks and waves of {run} ({count} of {len(runs)})")
        try:
            loggers = open_loggers(files_of(run), settings)
            clocks[run] = clocks_of(loggers, settings.instruments, run)
            if run in period_runs:
                waves = _waves_of(run, loggers, clocks[run], settings, channel)
                periods[run], doubts[run] = _period(waves, channel, settings, run)
        except SeakeepError as error:
            if run in asked:
                spare(failures, run, error)
            bad[run] = error
    if bad and (not clocks or (period_runs and not periods)):
        raise as_one(bad)
    left_out = {
        run: _left_out(run, error, run in period_runs, run in clock_runs and run not in clocks)
        for run, error in bad.items()
    }
    doubts = {run: doubt for run, doubt in doubts.items() if doubt}
    _warn({run: words for run, words in left_out.items() if run not in asked}, doubts, channel)
    if settings.instruments.pool_drift:
        _pool(clocks)
    for each in clocks.values():
        each.update({logger: without_doubtful_drift(clock) for logger, clock in each.items()})
    return Survey(clocks, periods, left_out, doubts)


def _warn(left_out: Mapping[str, str], doubts: Mapping[str, str], channel: str) -> None:
    for words in left_out.values():
        warnings.warn(words, SeakeepWarning, stacklevel=4)
    for run, doubt in list(doubts.items())[:1]:
        others = f" (and {len(doubts) - 1} more runs alike)" if len(doubts) > 1 else ""
        warnings.warn(f"{run}: {channel} {doubt}{others}. {_PERIOD_MEND}", SeakeepWarning, 4)


def _pool(clocks: Mapping[str, dict[str, Clock]]) -> None:
    """Give each logger one drift in all runs whose clocks agree."""
    for logger in {name for each in clocks.values() for name in each}:
        having = [run for run in clocks if logger in clocks[run]]
        pooled = pool_drift([clocks[run][logger] for run in having])
        for run, clock in zip(having, pooled, strict=True):
            clocks[run][logger] = clock


def _left_out(run: str, error: SeakeepError, period: bool, drift: bool) -> str:
    pooled = ["the encounter period"] * period + ["the pooled clock drifts"] * drift
    return (
        f"run '{run}' is left out of {' and of '.join(pooled) or 'the clocks'}: {error} "
        f"Once it is mended, prepare again; or state role = 'unused' in [runs.{run}]."
    )


def _waves_of(
    run: str,
    loggers: Mapping[str, Logger],
    clocks: Mapping[str, Clock],
    settings: CampaignSettings,
    channel: str,
) -> xr.Dataset:
    groups = read_groups(loggers, clocks, settings, run, [channel])
    holder = [each for each in groups.values() if channel in each]
    if holder:
        return holder[0]
    dt = uniform_step(next(iter(groups.values()))["time"].to_numpy())
    return on_one_axis(groups, dt, settings, run)


_PERIOD_MEND = (
    "Noise or a slow drift of the probe leads the count, or waves too low for period_hysteresis "
    "are left out, and all that is stated in encounter periods is wrong with it. In [campaign], "
    "state period_hysteresis (0.2 passes noise of a twentieth of the waves), another "
    "period_channel, or encounter_period in seconds."
)


def _period(
    waves: xr.Dataset, channel: str, settings: CampaignSettings, run: str
) -> tuple[float, str]:
    """Counted period of a run, s, and what speaks against it."""
    time, series = waves["time"].to_numpy(), waves[channel].to_numpy()
    step = uniform_step(time, f"run '{run}'")
    kept = inside(time, used_span(settings.runs[run]), step)
    series = series[kept] if kept.sum() > 2 else series
    try:
        counted = encounter_period(series, step, settings.campaign.period_hysteresis)
    except DataError as error:
        raise DataError(f"run '{run}', channel '{channel}': {error}") from None
    energy = energy_period(series[waves_part(series, step)], step)
    if energy / LED <= counted <= energy * LED:
        return counted, ""
    return counted, (
        f"counts waves of {counted:.3g} s, and the energy period of its spectrum is {energy:.3g} s"
    )


def used_span(settings: RunSettings) -> tuple[float, float]:
    """First and last instant of a run that is used at all, s."""
    stated = (settings.span,) if settings.span else (settings.train, settings.test)
    spans = [(number(each[0]), number(each[1])) for each in stated if each is not None]
    starts, ends = zip(*spans, strict=True) if spans else ((-np.inf,), (np.inf,))
    return min(starts), max(ends)
