"""The loggers of a run: their files, their clocks, and which of them holds which channel."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from seakeep.arrays import FloatArray
from seakeep.campaign.readers import find_column, time_column, times_of
from seakeep.campaign.settings import (
    CampaignSettings,
    ChannelSettings,
    FileSettings,
    InstrumentSettings,
    InstrumentsSettings,
    RunSettings,
)
from seakeep.errors import DataError, RequestError, SeakeepError, did_you_mean
from seakeep.formats import Columns, read_columns
from seakeep.formats.columns import meant_column
from seakeep.signals import (
    Clock,
    bridge,
    clock_from_correlation,
    clock_from_pulses,
    clock_from_shared,
    onto_uniform,
)
from seakeep.signals.synchronisation import ASSUMED
from seakeep.toml import number

__all__ = ["Logger", "channels_of", "clocks_of", "homes", "open_loggers", "reference_of"]


@dataclass(frozen=True, eq=False)
class Logger:
    """One logger's file of one run.

    Parameters
    ----------
    name : str
        Name in ``[instruments]``; empty where the run is one file.
    path : Path
        The file.
    columns : Columns
        What it holds.
    options : FileSettings
        How it is read.
    """

    name: str
    path: Path
    columns: Columns
    options: FileSettings

    @cached_property
    def time(self) -> FloatArray:
        """Readings of its clock, s, checked for their order."""
        return times_of(self.path, self.columns, self.options)[1]

    def column(self, wanted: str) -> FloatArray:
        """Values of a column, by name or full header, in the file's unit."""
        return self.columns.values[find_column(self.path, self.columns, wanted)]

    def uniform(self, wanted: str) -> tuple[FloatArray, FloatArray]:
        """Times and values of a column on a uniform axis, gaps bridged: for clocks only."""
        time, values = onto_uniform(self.time, self.column(wanted), str(self.path))
        return time, bridge(values, float(np.median(np.diff(time))), np.inf).values


def open_loggers(paths: Mapping[str, Path], settings: CampaignSettings) -> dict[str, Logger]:
    """Read the files of a run.

    Parameters
    ----------
    paths : mapping of str to Path
        File by logger; one file alone has the name "".
    settings : CampaignSettings
        The campaign.

    Returns
    -------
    dict of str to Logger
        The reference first.

    Raises
    ------
    RequestError, DataError
        As :func:`seakeep.campaign.read_table`.
    """
    loggers = {}
    for name, path in paths.items():
        options = _options(settings.files, settings.instruments[name]) if name else settings.files
        columns = read_columns(path, options.known())
        if name and time_column(columns, options.time) is not None:
            options = options.model_copy(update={"sampling_rate": None})
        loggers[name] = Logger(name, path, columns, options)
    reference = reference_of(settings.instruments, list(paths))
    return {reference: loggers.pop(reference), **loggers}


def _options(files: FileSettings, own: InstrumentSettings) -> FileSettings:
    stated = {
        key: getattr(own, key)
        for key in ("time", "time_unit", "sampling_rate")
        if getattr(own, key) is not None
    }
    return files.model_copy(update=stated)


def reference_of(instruments: InstrumentsSettings, names: list[str]) -> str:
    """Name of the logger whose clock is the time of a run."""
    wanted = instruments.reference
    if wanted in names and wanted is not None:
        return wanted
    return next((name for name in instruments.loggers if name in names), names[0])


def channels_of(settings: CampaignSettings, run: RunSettings) -> dict[str, ChannelSettings]:
    """Channel map of a run: the campaign's, with the keys that the run states in their place."""
    chosen = dict(settings.channels)
    for name, own in run.channels.items():
        stated = {key: getattr(own, key) for key in own.model_fields_set}
        chosen[name] = chosen[name].model_copy(update=stated)
    return chosen


def homes(
    loggers: Mapping[str, Logger], channels: Mapping[str, ChannelSettings], run: str
) -> dict[str, str]:
    """Find the logger that holds each channel.

    Parameters
    ----------
    loggers : mapping of str to Logger
        The loggers of the run.
    channels : mapping of str to ChannelSettings
        The channels wanted.
    run : str
        Name of the run, for messages.

    Returns
    -------
    dict of str to str
        Logger by channel.

    Raises
    ------
    RequestError
        If no file holds a channel's column, or several do and the channel does not say which.
    """
    if len(loggers) == 1:
        return dict.fromkeys(channels, next(iter(loggers)))
    found = {}
    for name, each in channels.items():
        column = each.column or name
        if each.instrument is not None:
            if each.instrument not in loggers:
                near = did_you_mean(each.instrument, loggers)
                raise RequestError(
                    f"channels.{name}.instrument: run '{run}' has no file of "
                    f"'{each.instrument}'.{near} Its files: {', '.join(loggers)}."
                )
            found[name] = each.instrument
            continue
        having = [key for key, logger in loggers.items() if logger.columns.find(column) is not None]
        if not having:
            every = [c for logger in loggers.values() for c in logger.columns.names]
            meant = meant_column(column, [logger.columns for logger in loggers.values()])
            raise RequestError(
                f"run '{run}': none of its {len(loggers)} files has a column '{column}' for "
                f"channel '{name}'.{meant} Correct [channels.{name}]. "
                f"Their columns: {', '.join(dict.fromkeys(every))}."
            )
        if len(having) > 1:
            raise RequestError(
                f"run '{run}': the column '{column}' of channel '{name}' stands in the files of "
                f"{' and '.join(having)}. State instrument = '{having[0]}' in [channels.{name}]."
            )
        found[name] = having[0]
    return found


def clocks_of(
    loggers: Mapping[str, Logger], instruments: InstrumentsSettings, run: str
) -> dict[str, Clock]:
    """Clock of each logger against the reference, which comes first.

    Parameters
    ----------
    loggers : mapping of str to Logger
        The loggers of the run, the reference first.
    instruments : InstrumentsSettings
        How their clocks are found.
    run : str
        Name of the run, for messages.

    Returns
    -------
    dict of str to Clock
        The reference has the default clock.

    Raises
    ------
    RequestError
        If a column does not exist.
    DataError
        If a clock cannot be found; the message says why and proposes another way.
    """
    reference = next(iter(loggers))
    clocks = {reference: Clock()}
    for name, logger in loggers.items():
        if name == reference:
            continue
        try:
            clocks[name] = _clock(logger, loggers[reference], instruments[name], instruments)
        except SeakeepError as error:
            raise type(error)(f"run '{run}', clock of '{name}' ({logger.path}): {error}") from None
    return clocks


def _clock(
    logger: Logger, reference: Logger, own: InstrumentSettings, every: InstrumentsSettings
) -> Clock:
    if own.trigger is not None:
        theirs = every[reference.name].trigger
        if theirs is None:
            raise RequestError(
                f"'{logger.name}' states a trigger and the reference '{reference.name}' none. Add "
                f"trigger = 'COLUMN' to [instruments.{reference.name}]."
            )
        return clock_from_pulses(
            logger.column(own.trigger), logger.time, reference.column(theirs), reference.time,
            own.offset or 0.0,
        )  # fmt: skip
    pair = own.shared or own.correlated
    if pair is None:
        stated = own.offset is not None or own.drift is not None
        clock = Clock(own.offset or 0.0, 1e-6 * (own.drift or 0.0))
        return replace(clock, method="as stated" if stated else ASSUMED)
    time, series = logger.uniform(pair[0])
    instants, other = reference.uniform(pair[1])
    if not np.ptp(series) or not np.ptp(other):
        raise DataError(f"'{pair[0]}' or '{pair[1]}' is constant. Choose signals that move.")
    find = clock_from_shared if own.shared else clock_from_correlation
    return find(series, time, other, instants, number(own.window), number(own.largest_lag))
