"""What only all runs together tell: the clocks of the loggers and the encounter period."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.campaign.channels import read_groups
from seakeep.campaign.instruments import clocks_of, open_loggers
from seakeep.campaign.resampling import inside, on_one_axis
from seakeep.campaign.settings import CampaignSettings, RunSettings
from seakeep.errors import DataError
from seakeep.signals import Clock, encounter_period, pool_drift, uniform_step

__all__ = ["Survey", "survey"]


@dataclass(frozen=True)
class Survey:
    """Clocks and encounter periods of runs.

    Parameters
    ----------
    clocks : dict of str to dict of str to Clock
        By run and logger.
    periods : dict of str to float
        Zero-up-crossing period of the wave channel by run, s.
    """

    clocks: Mapping[str, Mapping[str, Clock]]
    periods: Mapping[str, float]


def survey(
    settings: CampaignSettings,
    files_of: Callable[[str], Mapping[str, Path]],
    clock_runs: Sequence[str],
    period_runs: Sequence[str],
    channel: str,
    progress: Callable[[int, int, str], None] | None = None,
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

    Returns
    -------
    Survey
        Drifts are pooled over the runs, where the campaign does not say otherwise.

    Raises
    ------
    RequestError, DataError
        If a file cannot be read, a clock not found, or a record holds fewer than two waves.
    """
    runs = list(dict.fromkeys([*clock_runs, *period_runs]))
    clocks: dict[str, dict[str, Clock]] = {}
    periods: dict[str, float] = {}
    for number, run in enumerate(runs, 1):
        if progress is not None:
            progress(0, len(runs), f"clocks and waves of {run} ({number} of {len(runs)})")
        loggers = open_loggers(files_of(run), settings)
        clocks[run] = clocks_of(loggers, settings.instruments, run)
        if run in period_runs:
            groups = read_groups(loggers, clocks[run], settings, run, [channel])
            holder = [each for each in groups.values() if channel in each]
            if holder:
                waves = holder[0]
            else:
                dt = uniform_step(next(iter(groups.values()))["time"].to_numpy())
                waves = on_one_axis(groups, dt, settings, run)
            least = settings.campaign.period_hysteresis
            periods[run] = _period(waves, channel, settings.runs[run], run, least)
    if settings.instruments.pool_drift:
        for logger in {name for each in clocks.values() for name in each}:
            having = [run for run in clocks if logger in clocks[run]]
            pooled = pool_drift([clocks[run][logger] for run in having])
            for run, clock in zip(having, pooled, strict=True):
                clocks[run][logger] = clock
    return Survey(clocks, periods)


def _period(
    waves: xr.Dataset, channel: str, settings: RunSettings, run: str, hysteresis: float
) -> float:
    time, series = waves["time"].to_numpy(), waves[channel].to_numpy()
    step = uniform_step(time, f"run '{run}'")
    kept = inside(time, used_span(settings), step)
    try:
        return encounter_period(series[kept] if kept.sum() > 2 else series, step, hysteresis)
    except DataError as error:
        raise DataError(f"run '{run}', channel '{channel}': {error}") from None


def used_span(settings: RunSettings) -> tuple[float, float]:
    """First and last instant of a run that is used at all, s."""
    spans = [each for each in (settings.span, settings.train, settings.test) if each is not None]
    if settings.span is not None:
        return settings.span
    if not spans:
        return (-np.inf, np.inf)
    return min(each[0] for each in spans), max(each[1] for each in spans)
