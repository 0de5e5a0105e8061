"""Checks of the channels of a run, which report findings and change no value."""

from collections.abc import Callable, Collection, Iterable

import xarray as xr

from seakeep.quality import clocks, samples, sensors
from seakeep.quality.findings import (
    Finding,
    Kind,
    Rate,
    Record,
    Redundant,
    as_json,
    findings_of,
    warn_of,
)
from seakeep.quality.runs import judge_runs
from seakeep.quality.sensors import compared

__all__ = [
    "CHECKS",
    "Finding",
    "Kind",
    "Rate",
    "Record",
    "Redundant",
    "as_json",
    "check",
    "compared",
    "findings_of",
    "judge_runs",
    "warn_of",
    "warn_of_runs",
]

CHECKS: list[Callable[[Record], Iterable[Finding]]] = [
    samples.constant,
    samples.noise,
    samples.flagged,
    samples.jumps,
    samples.levels,
    sensors.redundant,
    sensors.derivatives,
    sensors.positions,
    clocks.clocks,
    clocks.others,
    clocks.records,
    samples.impossible,
    samples.waves,
    samples.units,
    clocks.rates,
    clocks.steps,
]
"""All checks, in the order in which findings are listed."""


def check(record: Record) -> list[Finding]:
    """Findings of all checks of a run."""
    return [finding for each in CHECKS for finding in each(record)]


def warn_of_runs(runs: Iterable[xr.Dataset], channels: Collection[str]) -> None:
    """Warn of what was found in the channels of a model, in the prepared runs that it reads.

    Parameters
    ----------
    runs : iterable of Dataset
        Prepared runs.
    channels : collection of str
        States and inputs of the model.

    Warns
    -----
    SeakeepWarning
        One per channel and kind of finding; gaps that were bridged do no harm.
    """
    harmless = samples.SamplesKind.BRIDGED
    found = (each for run in runs for each in findings_of(run) if each.kind is not harmless)
    warn_of(found, set(), channels)
