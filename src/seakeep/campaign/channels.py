"""From the columns of a run's files to channels: names, SI units, signs, and what is derived."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.campaign.checks import check_samples
from seakeep.campaign.derivation import derive
from seakeep.campaign.instruments import Logger, channels_of, homes
from seakeep.campaign.readers import labelled_table, time_column, time_step_of
from seakeep.campaign.settings import (
    CampaignSettings,
    ChannelSettings,
    PreparationSettings,
    RunSettings,
    long_name_of,
)
from seakeep.campaign.validation import derivation_order, needed_channels, sources_of
from seakeep.conventions import canonical_channel, conversion, si_unit
from seakeep.errors import DataError, RequestError
from seakeep.formats.columns import is_unit
from seakeep.signals import Clock, bridge, inspect_times, onto_uniform, uniform_step
from seakeep.signals.quality import BRIDGED, MISSING, flag_attributes
from seakeep.signals.time_axis import instant_text, span_text

__all__ = ["Group", "read_groups"]

FloatArray = npt.NDArray[np.float64]

COMMON = "the common step"
"""Group of derived channels whose sources come from several loggers."""


class Group(dict[str, xr.Dataset]):
    """Channels of a run by logger, each at its own rate and on the reference's time.

    `late` names the derived channels that need several loggers, in the order in which they are
    to be made once all stand on one axis.
    """

    late: tuple[str, ...] = ()


def read_groups(
    loggers: Mapping[str, Logger],
    clocks: Mapping[str, Clock],
    settings: CampaignSettings,
    run: str,
    wanted: Collection[str] | None = None,
) -> Group:
    """Read the mapped channels of a run and derive the others, each at its logger's rate.

    Parameters
    ----------
    loggers : mapping of str to Logger
        The run's files, the reference first.
    clocks : mapping of str to Clock
        Their clocks.
    settings : CampaignSettings
        The campaign.
    run : str
        Name of the run.
    wanted : collection of str, optional
        The channels wanted, with what they need; the default is all.

    Returns
    -------
    Group
        Dataset by logger: dimension ``time`` (s, of the reference), channels in SI units and
        radians without gaps; where samples are missing or bridged, a coordinate ``NAME_flags``
        says so.

    Raises
    ------
    RequestError
        If a file or a column does not exist, or a unit is missing or does not fit.
    DataError
        If a file is damaged, its times are not uniform, or a channel has gaps, and
        ``[preparation]`` does not say what to do about it.
    """
    needed = needed_channels(settings, settings.channel_names if wanted is None else wanted)
    chosen = {
        n: each for n, each in channels_of(settings, settings.runs[run]).items() if n in needed
    }
    home = homes(loggers, chosen, run)
    groups = Group()
    for key, logger in loggers.items():
        own = {name: each for name, each in chosen.items() if home[name] == key}
        if own:
            groups[key] = _channels(logger, clocks[key], settings, run, own)
    late = []
    for name in derivation_order(settings.derived, settings.channel_names):
        if name not in needed:
            continue
        sources = sources_of(name, settings.derived[name], settings.channel_names)
        places = {home[source] for source in sources}
        home[name] = places.pop() if len(places) == 1 else COMMON
        if home[name] == COMMON:
            late.append(name)
        else:
            dataset = groups[home[name]]
            step = uniform_step(dataset["time"].to_numpy(), f"run '{run}'")
            groups[home[name]] = derive(dataset, name, settings, step, run)
    groups.late = tuple(late)
    return groups


def _channels(
    logger: Logger,
    clock: Clock,
    settings: CampaignSettings,
    run: str,
    channels: Mapping[str, ChannelSettings],
) -> xr.Dataset:
    """Mapped channels of one logger, gaps and jitter treated as the campaign says."""
    path, preparation = logger.path, settings.preparation
    columns = [each.column or name for name, each in channels.items()]
    table = labelled_table(path, logger.columns, logger.options, columns)
    time = table["time"].copy(data=clock.reference(table["time"].to_numpy()))
    table = _cut(table.assign_coords(time=time), settings.runs[run], run)
    own = settings.runs[run].channels
    variables = {}
    for name, each in channels.items():
        if not (name in own and "unit" in own[name].model_fields_set):
            _refuse_other_unit(table, name, each, run, path)
        variables[name] = ("time", *_mapped(table, name, each, path))
    dataset = xr.Dataset(variables, {"time": table["time"]})
    if preparation.gaps == "refuse":
        _refuse_gaps(dataset, run, path)
    dataset = _bridged(_regular(dataset, preparation, f"run '{run}' ({path})"), preparation)
    dataset = check_samples(dataset, preparation.outliers == "replace")
    if (aside := _time_aside(logger)) is not None:
        dataset.attrs["time_column_step"] = aside
    for name, position in settings.rig.positions.items():
        if name in dataset:
            dataset[name].attrs["x_position"] = float(position)
    return dataset


def _time_aside(logger: Logger) -> float | None:
    """Step that the file's times tell, s, where a stated rate counts in their place."""
    if logger.options.sampling_rate is None or logger.options.time is not None:
        return None
    name = time_column(logger.columns)
    return None if name is None else time_step_of(logger.columns, name)


def _regular(dataset: xr.Dataset, preparation: PreparationSettings, name: str) -> xr.Dataset:
    """Put the channels on a uniform axis, where that is allowed."""
    time = dataset["time"].to_numpy()
    try:
        uniform_step(time, name)
    except DataError as error:
        report = inspect_times(time, name)
        if report.gaps and preparation.gaps == "refuse":
            raise DataError(
                f"{error} Or state gaps = 'mask' or 'bridge' in [preparation]."
            ) from None
        if report.jittered and preparation.jitter == "refuse":
            raise DataError(f"{error} Or state jitter = 'interpolate' in [preparation].") from None
        series = np.column_stack([each.to_numpy() for each in dataset.values()])
        new, values = onto_uniform(time, series, name)
        told = {
            "time_gaps": len(report.gaps),
            "time_missing": report.missing,
            "time_jitter_rms": report.jitter_rms if report.jittered else 0.0,
        }
        return xr.Dataset(
            {
                str(n): ("time", values[:, i], each.attrs)
                for i, (n, each) in enumerate(dataset.items())
            },
            {"time": ("time", new, dataset["time"].attrs)},
            told,
        )
    return dataset


def _bridged(dataset: xr.Dataset, preparation: PreparationSettings) -> xr.Dataset:
    """Fill gaps so that filters can run, and flag each sample that was filled."""
    step = float(np.median(np.diff(dataset["time"].to_numpy())))
    longest = preparation.longest_gap if preparation.gaps == "bridge" else 0.0
    for name in list(dataset.data_vars):
        values = dataset[name].to_numpy()
        if np.isfinite(values).all():
            continue
        filled = bridge(values, step, longest)
        flags = (MISSING * filled.long + BRIDGED * filled.short).astype(np.int16)
        dataset[name] = dataset[name].copy(data=filled.values)
        dataset.coords[f"{name}_flags"] = ("time", flags, flag_attributes(str(name)))
        if filled.short.any():
            dataset[name].attrs["repaired"] = (
                f"{int(filled.short.sum())} samples "
                f"({filled.short.sum() * step:.3g} s of {filled.short.size * step:.4g} s) "
                "bridged by monotone cubics"
            )
    return dataset


def _cut(table: xr.Dataset, settings: RunSettings, run: str) -> xr.Dataset:
    if settings.record is None:
        return table
    begin, end = settings.record
    time = table["time"].to_numpy()
    kept = (time >= begin) & (time <= end)
    if kept.sum() < 2:
        step = float(np.median(np.diff(time)))
        raise RequestError(
            f"runs.{run}.record: received [{begin:g}, {end:g}] s, and the file runs from "
            f"{span_text(time[0], time[-1], step)}: nothing is left. Correct the two times."
        )
    return table.isel(time=kept)


def _column(table: xr.Dataset, name: str, settings: ChannelSettings) -> xr.DataArray:
    """Column of a channel, by name or full header."""
    wanted = settings.column or name
    found = table.get(wanted)
    if found is None:
        found = next(c for c in table.data_vars.values() if c.attrs["long_name"] == wanted)
    return found


def _refuse_other_unit(
    table: xr.Dataset, name: str, settings: ChannelSettings, run: str, path: Path
) -> None:
    """Refuse a unit that is stated for all runs where this run's file says another one."""
    stated = settings.unit
    said = str(_column(table, name, settings).attrs.get("units", "")).strip()
    if stated is None or said in ("", "-", "1") or not is_unit(said):
        return
    same = si_unit(said) == si_unit(stated)
    if same and conversion(said, si_unit(said)) == conversion(stated, si_unit(stated)):
        return
    raise RequestError(
        f"channels.{name}: the unit '{stated}' is stated, and run '{run}' ({path}) says "
        f"'{said}' of the column '{settings.column or name}'. Leave unit out where the files say "
        f"it; or, if this file is wrong, state the unit in [runs.{run}.channels.{name}]."
    )


def _mapped(
    table: xr.Dataset, name: str, settings: ChannelSettings, path: Path
) -> tuple[FloatArray, dict[str, str]]:
    wanted = settings.column or name
    column = _column(table, name, settings)
    unit = settings.unit if settings.unit is not None else column.attrs.get("units")
    if unit is None:
        raise RequestError(
            f"channels.{name}: the column '{wanted}' of {path} states no unit. Add unit = '…' to "
            f"[channels.{name}] ('-' for none)."
        )
    canonical = canonical_channel(name)
    target = canonical.units if canonical else si_unit(unit)
    factor = conversion(unit, target, f"channel '{name}' (column '{wanted}' of {path})")
    values = settings.sign * factor * (column.to_numpy().astype(float) + settings.offset)
    return values, {"units": target, "long_name": long_name_of(name, settings.long_name)}


def _refuse_gaps(dataset: xr.Dataset, run: str, path: Path) -> None:
    time = dataset["time"].to_numpy()
    gapped = [str(n) for n, each in dataset.items() if not np.isfinite(each.to_numpy()).all()]
    if not gapped:
        return
    missing = ~np.isfinite(dataset[gapped[0]].to_numpy())
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(int)))
    begins, ends = edges[::2], edges[1::2]
    step = float(np.median(np.diff(time)))
    lengths = ends - begins
    longest = int(np.argmax(lengths))
    first, worst = (instant_text(time[begins[at]], step) for at in (0, longest))
    others = f" (also in {', '.join(gapped[1:])})" if gapped[1:] else ""
    raise DataError(
        f"run '{run}' ({path}): channel '{gapped[0]}' has {int(missing.sum())} missing values of "
        f"{missing.size} in {begins.size} gap(s), the first at t = {first} s ({lengths[0]} "
        f"samples, {lengths[0] * step:.4g} s), the longest at t = {worst} s "
        f"({lengths[longest]} samples, {lengths[longest] * step:.4g} s)"
        f"{others}. Repair the file, leave the channel out, or cut the gap off with record = "
        f"[begin, end] in [runs.{run}]; or state gaps = 'mask' or 'bridge' in [preparation]."
    )
