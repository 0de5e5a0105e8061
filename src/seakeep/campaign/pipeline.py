"""A run from its raw files to what a model takes: eight steps, each Run to Run.

========== =====================================================================================
step       what it does
========== =====================================================================================
`read`     opens the files of the run's loggers
`sync`     finds each logger's clock against the reference's
`mapped`   turns columns into channels: names, SI units, signs, the reference's time
`cleaned`  treats gaps and jitter as the campaign says, and flags samples
`derived`  makes channels from others of one logger
`resampled` puts all loggers on one axis, and makes the channels that need several of them
`cropped`  cuts the run to its span
`checked`  looks for faults in what is left
========== =====================================================================================
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr

from seakeep.arrays import BoolArray, Datasets, FloatArray
from seakeep.campaign.derivation import derive
from seakeep.campaign.readers import (
    counts_samples,
    find_column,
    from_midnight,
    is_wave,
    time_column,
    time_step_of,
    times_of,
)
from seakeep.campaign.settings import (
    CampaignSettings,
    ChannelSettings,
    FileSettings,
    PreparationSettings,
    RunSettings,
    long_name_of,
    needed_channels,
    sources_of,
    units_of,
)
from seakeep.conventions import MOTIONS, conversion, same_unit
from seakeep.errors import DataError, RequestError, SeakeepError, did_you_mean, naming
from seakeep.formats import Columns, read_columns
from seakeep.formats.columns import DAY_0, is_unit, meant_column
from seakeep.quality import Finding, Rate, Record, Redundant, check
from seakeep.quality.faults import (
    BRIDGED,
    MISSING,
    OUTLIER,
    REPLACED,
    SATURATED,
    STUCK,
    find_held,
    find_outliers,
    flag_attributes,
    reading_step,
    saturated,
)
from seakeep.quality.sensors import SensorsKind
from seakeep.signals import (
    Clock,
    bridge,
    clock_from_correlation,
    clock_from_pulses,
    clock_from_shared,
    effective_celerity,
    inspect_times,
    low_pass,
    onto_uniform,
    resample,
    uniform_step,
)
from seakeep.signals.time_axis import (
    ASSUMED,
    inside,
    instant_text,
    span_text,
    stretches,
    usual_step,
)
from seakeep.toml import in_seconds

ChannelMap = dict[str, ChannelSettings]
COMMON = "the common step"
"""Place of derived channels whose sources come from several loggers."""
JUMP = 0.1
"""Part of a turn within which a step is a whole turn: an angle was read on either side of zero."""
CORRELATED = "celerity_correlation"
"""Attribute of a run."""
ALIKE = 0.5
"""Correlation of the waves at two probes below which the celerity found from them is in doubt: in
made-up seas, long- and short-crested, the highest peak stood a period away, and the celerity was a
third too low, only at 0.44 or less. Between the probes of the virtual tank it is 0.55."""
MOST_FINER = 8.0
"""Times finer than the fastest logger of a run that its step may be: waves of four samples get the
32 of the paper's; with times in another unit it is 1000."""


@dataclass(frozen=True, eq=False)
class Logger:
    """One logger's file of one run; its name is empty where the run is one file."""

    name: str
    path: Path
    columns: Columns
    options: FileSettings

    @cached_property
    def time(self) -> FloatArray:
        """Readings of its clock, s, checked for their order."""
        return times_of(self.path, self.columns, self.options)[1]

    @property
    def dates(self) -> str:
        """Unit of its times if they were dates, which says whether they state a zone, else ""."""
        unit = self.columns.units.get(time_column(self.columns, self.options.time) or "", "")
        return unit if unit.removesuffix(" in UTC") == f"days since {DAY_0}" else ""

    def column(self, wanted: str) -> FloatArray:
        """Values of a column, by name or full header, in the file's unit."""
        return self.columns.values[find_column(self.path, self.columns, wanted)]

    def uniform(self, wanted: str) -> tuple[FloatArray, FloatArray]:
        """Times and values of a column on a uniform axis, gaps bridged: for clocks only."""
        time, values = onto_uniform(self.time, self.column(wanted), str(self.path))
        return time, bridge(values, usual_step(time), np.inf).values


@dataclass(frozen=True, eq=False)
class Run:
    """A run on its way through the pipeline.

    Parameters
    ----------
    name : str
        Its name.
    settings : CampaignSettings
        The campaign.
    loggers : mapping of str to Logger
        Its files, the reference first.
    period : float
        Encounter period, s; NaN where it is not known.
    clocks : mapping of str to Clock
        Clock of each logger.
    groups : mapping of str to Dataset
        Channels by logger, each at its own rate.
    ahead : sequence of str
        Derived channels that are still to be made, each behind those that it needs.
    data : Dataset or None
        All channels on one axis.
    findings : sequence of Finding
        Results of the checks; before them, what speaks against its counted period.
    """

    name: str
    settings: CampaignSettings
    loggers: Mapping[str, Logger]
    period: float = np.nan
    clocks: Mapping[str, Clock] = field(default_factory=dict)
    groups: Datasets = field(default_factory=dict)
    ahead: Sequence[str] = ()
    data: xr.Dataset = field(default_factory=xr.Dataset)
    findings: Sequence[Finding] = ()

    @property
    def own(self) -> RunSettings:
        """Table of the run in the campaign file."""
        return self.settings.runs[self.name]

    @property
    def channels(self) -> ChannelMap:
        """Channel map: the campaign's, with the keys that the run replaces."""
        chosen = dict(self.settings.channels)
        for name, own in self.own.channels.items():
            chosen[name] = chosen[name].model_copy(update=own.model_dump(exclude_unset=True))
        return chosen

    @property
    def size(self) -> int:
        """Bytes of its columns."""
        return sum(x.nbytes for each in self.loggers.values() for x in each.columns.values.values())

    def span(self, key: str) -> tuple[float, float] | None:
        """Start and end (s) that a key of the run's table states."""
        stated = getattr(self.own, key)
        if not stated:
            return None
        return in_seconds(stated[0], self.period), in_seconds(stated[1], self.period)

    @property
    def used_span(self) -> tuple[float, float]:
        """First and last instant that is used at all, s."""
        keys = ("span",) if self.own.span else ("train", "test")
        edges = [edge for key in keys for edge in self.span(key) or ()]
        return min(edges, default=-np.inf), max(edges, default=np.inf)

    @property
    def reference_time(self) -> FloatArray:
        """Instants of the reference logger, s."""
        return next(iter(self.groups.values()))["time"].values


def read(name: str, settings: CampaignSettings, paths: Mapping[str, Path]) -> Run:
    """Step 1: open the files of a run.

    Parameters
    ----------
    name : str
        The run.
    settings : CampaignSettings
        The campaign.
    paths : mapping of str to Path
        File by logger; one file alone has the name "".
    """
    loggers = {}
    for key, path in paths.items():
        options = settings.files
        if unit := settings.runs[name].time_unit:
            options = options.model_copy(update={"time_unit": unit})
        if key:
            own, keys = settings.instruments[key], {"time", "time_unit", "sampling_rate", "group"}
            options = options.model_copy(update=own.model_dump(include=keys, exclude_none=True))
        columns = read_columns(path, options)
        # Times go before a rate, unless they cannot be read and it is this logger's own.
        time = time_column(columns, options.time)
        if key and time and not (own.sampling_rate and time in columns.faults):
            options = options.model_copy(update={"sampling_rate": None})
        loggers[key] = Logger(key, path, columns, options)
    order = [settings.instruments.reference, *settings.instruments.loggers, *loggers]
    reference = min(loggers, key=order.index)
    loggers = {reference: loggers.pop(reference), **loggers}
    day = 0.0  # from whose midnight all dates of the run count; times since 1970 once it is known
    for each in 2 * [*loggers.values()]:
        day = from_midnight(each.columns, each.options, day)
    return Run(name, settings, loggers, settings.campaign.encounter_period or np.nan)


def sync(run: Run) -> Run:
    """Step 2: find each logger's clock against the reference's."""
    reference, *others = run.loggers.values()
    by_reference = {reference.name: Clock()}
    for each in others:
        with naming(f"run '{run.name}', clock of '{each.name}' ({each.path})"):
            by_reference[each.name] = _clock(run, each, reference)
    return replace(run, clocks=by_reference)


def _clock(run: Run, logger: Logger, reference: Logger) -> Clock:
    own, period = run.settings.instruments[logger.name], run.period
    near = own.offset or 0.0
    if own.trigger is not None:
        theirs = run.settings.instruments[reference.name].trigger
        if theirs is None:
            raise RequestError(
                f"'{logger.name}' states a trigger and the reference '{reference.name}' none. Add "
                f"trigger = 'COLUMN' to [instruments.{reference.name}]."
            )
        return clock_from_pulses(
            logger.column(own.trigger), logger.time, reference.column(theirs), reference.time, near
        )  # fmt: skip
    pair = own.shared or own.correlated
    if not pair:
        stated = own.offset is not None or own.drift is not None
        first = next((each for each in run.loggers.values() if each.dates), logger)
        if not stated and logger.dates not in ("", first.dates):
            raise RequestError(
                f"its dates or those of {first.path} state a zone, and the others none, which "
                "would be taken for UTC. Write the zone in both files or in none; or state by how "
                f"many seconds this clock is ahead, offset = 0.0 in [instruments.{logger.name}]."
            )
        return Clock(near, 1e-6 * (own.drift or 0.0), method="as stated" if stated else ASSUMED)
    time, series = logger.uniform(pair[0])
    instants, other = reference.uniform(pair[1])
    if not np.ptp(series) or not np.ptp(other):
        raise DataError(f"'{pair[0]}' or '{pair[1]}' is constant. Choose signals that move.")
    find = clock_from_shared if own.shared else clock_from_correlation
    window, largest_lag = in_seconds(own.window, period), in_seconds(own.largest_lag, period)
    clock = find(series, time - near, other, instants, window, largest_lag)
    return replace(clock, offset=near + clock.offset)


def mapped(run: Run, wanted: Collection[str] | None = None) -> Run:
    """Step 3: columns become channels with names, SI units and signs, on the reference's time.

    Parameters
    ----------
    run : Run
        The run, its clocks known.
    wanted : collection of str, optional
        The channels wanted, with what they need; the default is all.
    """
    needed = needed_channels(run.settings, wanted)
    held: dict[str, ChannelMap] = {key: {} for key in run.loggers}
    for name, each in run.channels.items():
        if name in needed:
            held[_holder(run, name, each)][name] = each
    return replace(
        run,
        groups={key: _channels(run, run.loggers[key], own) for key, own in held.items() if own},
        ahead=[name for name in needed if name in run.settings.derived],
    )


def _holder(run: Run, name: str, own: ChannelSettings) -> str:
    """Logger in whose file a channel stands."""
    stated, column = own.instrument, own.column or name
    tables = {key: each.columns for key, each in run.loggers.items()}
    having = [key for key, table in tables.items() if table.find(column) is not None]
    if len(tables) == 1:
        having = list(tables)
    elif stated is not None:
        if stated not in tables:
            raise RequestError(
                f"channels.{name}.instrument: run '{run.name}' has no file of "
                f"'{stated}'.{did_you_mean(stated, tables)} Its files: {', '.join(tables)}."
            )
        having = [stated]
    if not having:
        listed = ", ".join(dict.fromkeys(c for table in tables.values() for c in table.names))
        raise RequestError(
            f"run '{run.name}': none of its {len(tables)} files has a column '{column}' for "
            f"channel '{name}'.{meant_column(column, tables.values())} Correct [channels.{name}]. "
            f"Their columns: {listed}."
        )
    if len(having) > 1:
        raise RequestError(
            f"run '{run.name}': the column '{column}' of channel '{name}' stands in the files "
            f"of {' and '.join(having)}. State instrument = '{having[0]}' in [channels.{name}]."
        )
    return having[0]


def _channels(run: Run, logger: Logger, channels: ChannelMap) -> xr.Dataset:
    """Channels of one logger, gaps and jitter as they are."""
    time = run.clocks[logger.name].reference(logger.time)
    # The reference's record is the run's own.
    slack = usual_step(time) * (1 + 1e-6) if logger.name == next(iter(run.loggers)) else np.inf
    span, whole = run.span("record") or (-np.inf, np.inf), (time[0], time[-1])
    records = _part(f"runs.{run.name}.record", span, time, whole, slack)
    variables = {}
    for name, each in channels.items():
        wanted, path = each.column or name, logger.path
        column = find_column(path, logger.columns, wanted)
        said, unit = logger.columns.units.get(column), each.unit
        changed = run.own.channels.get(name)
        if (
            unit is not None
            and not (changed and "unit" in changed.model_fields_set)
            and said not in (None, "", "-", "1")
            and is_unit(said)
            and not same_unit(said, unit)
        ):
            raise RequestError(
                f"channels.{name}: the unit '{unit}' is stated, and run '{run.name}' ({path}) says "
                f"'{said}' for the column '{wanted}'. Leave unit out if all files say one; if "
                f"some say none, state '{said}', and in [runs.RUN.channels.{name}] the unit of "
                "each that has another; or, if this file is wrong, state its unit in "
                f"[runs.{run.name}.channels.{name}]."
            )
        unit = said if unit is None else unit
        if unit is None:
            raise RequestError(
                f"channels.{name}: the column '{wanted}' of {path} states no unit. Add unit = '…' "
                f"to [channels.{name}] ('-' for none), or to [runs.{run.name}.channels.{name}] if "
                "other files say another."
            )
        target = units_of(name, unit)
        factor = conversion(unit, target, f"channel '{name}' (column '{wanted}' of {path})")
        readings, missing = logger.columns.values[column], logger.options.missing
        if missing is not None:  # of float32 as well
            readings = np.where(np.isclose(readings, missing, rtol=1e-6, atol=0), np.nan, readings)
        values = each.sign * factor * (readings + each.offset)
        long_name = long_name_of(name, each.long_name)
        attributes: dict[str, object] = {"units": target, "long_name": long_name}
        if target == "rad":
            values, jumps = _without_jumps(values)
            attributes |= {"jumps": jumps} if jumps else {}
        if each.accuracy is not None:
            attributes["accuracy"] = factor * each.accuracy
        variables[name] = ("time", values[records], attributes)
    return xr.Dataset(
        variables, {"time": ("time", time[records], {"units": "s", "long_name": "time"})}
    )


def _without_jumps(angles: FloatArray) -> tuple[FloatArray, int]:
    """Angles without jumps of a whole turn, and how many there were.

    The median lies within half a turn of zero, so that runs that jump agree with those that do not.
    """
    known, turn = np.isfinite(angles), 2 * np.pi
    if not known.any():
        return angles, 0
    steps = np.diff(angles[known]) / turn
    jumps = np.where(np.abs(np.abs(steps) - 1) < JUMP, np.sign(steps), 0)
    turns = np.append(0, np.cumsum(jumps))
    turns += np.round(np.median(angles[known] / turn - turns))
    if turns.any():
        angles = angles.copy()
        angles[known] -= turn * turns
    return angles, int(np.count_nonzero(jumps))


def cleaned(run: Run) -> Run:
    """Step 4: gaps and jitter treated as the campaign says; samples that look wrong are flagged."""
    preparation = run.settings.preparation
    groups = {}
    for key, data in run.groups.items():
        logger = run.loggers[key]
        if preparation.gaps == "refuse":
            _refuse_gaps(data, run.name, logger.path)
        data, read = _regular(data, preparation, f"run '{run.name}' ({logger.path})")
        groups[key] = data = flag_samples(data, preparation, read)
        if logger.options.sampling_rate and logger.options.time is None:
            step = time_step_of(logger.columns, time_column(logger.columns))
            if step:  # the step of the file's times, where a stated rate is used
                data.attrs["time_column_step"] = step
        elif counts_samples(logger.columns, logger.options):
            data.attrs["time_counts"] = 1
    return replace(run, groups=groups)


def _refuse_gaps(data: xr.Dataset, run: str, path: Path) -> None:
    missing = {str(n): ~np.isfinite(each.values) for n, each in data.items()}
    gapped = [name for name, each in missing.items() if each.any()]
    if not gapped:
        return
    time, first = data["time"].values, missing[gapped[0]]
    step = usual_step(time)

    def said(gap: tuple[int, int]) -> str:
        count, begin = gap[1] - gap[0], instant_text(time[gap[0]], step)
        return f"t = {begin} s ({count} samples, {count * step:.4g} s)"

    gaps = stretches(first)
    longest = max(gaps, key=lambda gap: gap[1] - gap[0])
    others = f" (also in {', '.join(gapped[1:])})" if gapped[1:] else ""
    raise DataError(
        f"run '{run}' ({path}): channel '{gapped[0]}' has {first.sum()} missing values of "
        f"{first.size} in {len(gaps)} gap(s), the first at {said(gaps[0])}, the longest at "
        f"{said(longest)}{others}. Repair the file, leave the "
        f"channel out, or cut the gap off with record = [start, end] in [runs.{run}]; or state "
        "gaps = 'mask' or 'bridge' in [preparation]."
    )


def _regular(
    data: xr.Dataset, preparation: PreparationSettings, name: str
) -> tuple[xr.Dataset, dict[str, FloatArray]]:
    """Put channels on a uniform axis, where that is allowed; and what was read, if it differs."""
    time = data["time"].values
    try:
        uniform_step(time, name)
        return data, {}
    except DataError as error:
        report, mend = inspect_times(time, name), ""
        if report.gaps and preparation.gaps == "refuse":
            mend = "gaps = 'mask' or 'bridge'"
        elif report.jittered and preparation.jitter == "refuse":
            mend = "jitter = 'interpolate'"
        if mend:
            raise DataError(f"{error} Or state {mend} in [preparation].") from None
    new, values = onto_uniform(time, np.column_stack([x.values for x in data.values()]), name)
    read = data.assign_coords(time=data["time"].copy(data=new[report.place])).reindex(time=new)
    done = {
        "time_gaps": len(report.gaps),
        "time_missing": report.missing,
        "time_jitter_rms": report.jitter_rms if report.jittered else 0.0,
    }
    uniform = read.copy(data=dict(zip(data, values.T, strict=True))).assign_attrs(done)
    return uniform, {str(n): each.values for n, each in read.items()}


def flag_samples(
    data: xr.Dataset, preparation: PreparationSettings, read: Mapping[str, FloatArray]
) -> xr.Dataset:
    """Fill gaps, so that filters can run, and flag what was filled and what looks wrong.

    Interpolation makes equal readings differ: whether a sensor is stuck is judged by what was read.
    """
    step = usual_step(data["time"].values)
    longest = preparation.longest_gap if preparation.gaps == "bridge" else 0.0
    for name in list(data.data_vars):
        x, repaired = data[name].values, list[str]()
        with naming(f"channel '{name}'"):
            filled = bridge(x, step, longest)
        x, known = filled.values, data[name].attrs
        flags = (MISSING * filled.long + BRIDGED * filled.short).astype(np.int16)
        if count := filled.short.sum():
            repaired.append(
                f"{count} samples ({count * step:.3g} s of {x.size * step:.4g} s) bridged by "
                "monotone cubics"
            )
        if x.size >= 16 and np.ptp(x):
            own = read.get(str(name), x)
            own = np.where(np.isfinite(own), own, x)
            if np.isfinite(reading := reading_step(own)):
                known["reading_step"] = reading
            there = flags == 0
            stuck = find_held(own, step) & there
            for start, end in stretches(stuck):  # what stands before a gap that was filled
                stuck[start:end] = end - start > 2
            outlier, edge = find_outliers(x) & there & ~stuck, saturated(own, stuck)
            flags[outlier] |= OUTLIER
            flags[edge] |= SATURATED
            flags[stuck & ~edge] |= STUCK
            if preparation.outliers == "replace" and outlier.any():
                x = bridge(np.where(outlier, np.nan, x), step, np.inf).values
                flags[outlier] |= REPLACED
                repaired.append(f"{outlier.sum()} outliers replaced by monotone cubics")
        if repaired:
            known["repaired"] = "; ".join(repaired)
        data[name] = data[name].copy(data=x)
        if flags.any():
            data.coords[f"{name}_flags"] = ("time", flags, flag_attributes(str(name)))
    return data


def derived(run: Run) -> Run:
    """Step 5: channels made from others of one logger, at its own rate."""
    settings, groups, ahead = run.settings, dict(run.groups), []
    home = {str(name): key for key, data in groups.items() for name in data.data_vars}
    for name in run.ahead:
        own = settings.derived[name]
        places = {home[each] for each in sources_of(name, own, settings.channel_names)}
        home[name] = places.pop() if len(places) == 1 else COMMON
        if home[name] == COMMON:
            ahead.append(name)
            continue
        data = groups[home[name]]
        step = uniform_step(data["time"].values, f"run '{run.name}'")
        variable = derive(data.variables, name, settings, step, run.name)
        groups[home[name]] = data.assign({name: variable.pop(name)}).assign_coords(variable)
    return replace(run, groups=groups, ahead=ahead)


def resampled(run: Run, dt: float, time: FloatArray | None = None) -> Run:
    """Step 6: all channels on one axis of step `dt` (s), and those that need several loggers.

    The axis, unless `time` is given, holds multiples of the step from the reference's first
    instant, where every logger recorded; samples that are missing become NaN.
    """
    if time is None:
        times = {name: each["time"].values for name, each in run.groups.items()}
        begin, end = max(t[0] for t in times.values()), min(t[-1] for t in times.values())
        if end <= begin:
            spans = ", ".join(
                f"{name} {span_text(t[0], t[-1], usual_step(t))}" for name, t in times.items()
            )
            raise DataError(
                f"run '{run.name}': its instruments never recorded together ({spans}, on the "
                "reference's clock). Check the files of the run and the clocks."
            )
        own = min(map(usual_step, times.values()))
        if own > MOST_FINER * dt:
            raise DataError(
                f"run '{run.name}' has {1 / own:.4g} samples per second by its times, and "
                f"[preparation] asks for {1 / dt:.4g}. If its times are in ms, state time_unit = "
                f"'ms' in [files], or in [runs.{run.name}] if other runs are in s; where its "
                "header says s, correct that; else correct sampling_rate, dt or steps_per_period."
            )
        origin = run.reference_time[0]
        first = np.ceil((begin - origin) / dt - 1e-6)
        last = np.floor((end - origin) / dt * (1 + 1e-9) + 1e-6)
        if last <= first:
            raise RequestError(
                f"run '{run.name}' of {end - begin:g} s is shorter than two steps of {dt:g} s. "
                "Correct sampling_rate, dt or steps_per_period in [preparation]."
            )
        time = origin + dt * np.arange(first, last + 1)
    channels: dict[str, xr.Variable] = {}
    for group in run.groups.values():
        channels |= _on_axis(run, group, time, dt)
    for name in run.ahead:
        channels |= derive(channels, name, run.settings, dt, run.name)
    of_time = next(iter(run.groups.values()))["time"].attrs
    data, coordinates = {}, {"time": xr.Variable("time", time, of_time)}
    for name in [each for each in run.settings.channel_names if each in channels]:
        data[name] = channels[name]
        if (flags := channels.get(f"{name}_flags")) is not None:
            lost = flags.values & MISSING
            data[name] = data[name].copy(data=np.where(lost, np.nan, data[name].values))
            coordinates[f"{name}_flags"] = flags
        if name in run.settings.rig.positions:
            data[name].attrs["x_position"] = run.settings.rig.positions[name]
    return replace(run, data=xr.Dataset(data, coordinates))


def _on_axis(run: Run, group: xr.Dataset, wanted: FloatArray, dt: float) -> dict[str, xr.Variable]:
    """Channels of a logger and their flags at other instants."""
    time, settings = group["time"].values, run.settings.preparation
    own = uniform_step(time, f"run '{run.name}'")
    series = np.column_stack([channel.values for channel in group.data_vars.values()])
    low, filtered = settings.low_pass, {}
    if low and low[1] < 0.5 / own:
        length = 60 / (14.36 * (low[1] - low[0]))  # of 60 dB, by Kaiser's formula
        if (lasts := time.size * own) < 0.5 * length:
            raise DataError(
                f"low_pass = {list(low)} in [preparation] averages over {length:.3g} s, and the "
                f"record lasts {lasts:.3g} s. Move its second edge away from the first."
            )
        series = low_pass(series, own, *low)
        filtered = {"low_pass": low}
    if strays(own, time.size, dt) or abs(wanted[0] - time[0]) > 0.05 * own:
        # The last instant may lie a rounding beyond the record.
        clipped = np.clip(wanted, time[0], time[-1])
        series = resample(series, time, clipped, settings.attenuation, settings.anti_alias)
    else:
        series = series[: wanted.size]
    out = {
        str(name): xr.Variable("time", series[:, i].copy(), channel.attrs | filtered)
        for i, (name, channel) in enumerate(group.data_vars.items())
    }
    # Flags at new instants: what any sample within half a new step of them carries.
    half = 0.5 * max(dt, time[1] - time[0]) * (1 + 1e-9)
    begin = np.searchsorted(time, wanted - half)
    end = np.searchsorted(time, wanted + half, side="right")
    edges = np.column_stack([begin, end]).ravel()
    for name, flags in group.variables.items():
        if str(name).endswith("_flags"):
            seen = np.bitwise_or.reduceat(np.append(flags.values, 0), edges)[::2]
            new = np.where(begin < end, seen, 0).astype(np.int16)
            out[str(name)] = xr.Variable("time", new, flags.attrs)
    return out


def strays(own: float, samples: int, dt: float) -> bool:
    """Whether a record's own step leads it away from a grid of `dt` by more than rounding.

    Times written with few decimals give a step that is off by a part of a sample over the record.
    """
    return abs(own - dt) * samples > 0.05 * dt


def redundant_pairs(settings: CampaignSettings, period: float) -> Redundant:
    """Groups of ``[redundant]`` with their windows in seconds, for an encounter period (s)."""
    return {
        each.channels: None if each.window is None else in_seconds(each.window, period)
        for each in settings.redundant.values()
    }


def cropped(run: Run) -> Run:
    """Step 7: cut the run to its span; spans that lie outside the record are refused."""
    data, groups, reference = run.data, dict(run.groups), run.reference_time
    place, time, record = f"runs.{run.name}.", data["time"].values, (reference[0], reference[-1])
    # The last sample of a record stands for its own step, too: 60 s at 50 Hz end at 59.98 s.
    slack = max(usual_step(time), np.ptp(record) / (reference.size - 1)) * (1 + 1e-6)
    spans = {key: span for key in ("span", "train", "test") if (span := run.span(key))}
    parts = {key: _part(place + key, span, time, record, slack) for key, span in spans.items()}
    if "span" in parts:
        data = data.isel(time=parts.pop("span"))
        time = data["time"].values
        for name, group in run.groups.items():  # a slow logger may have no sample within
            own = usual_step(group["time"].values)
            groups[name] = group.sel(time=slice(time[0] - own, time[-1] + own))
        for key in parts:
            _part(place + key, spans[key], time, (time[0], time[-1]), np.inf)
    return replace(run, data=data, groups=groups)


def checked(run: Run, left_out: Mapping[str, str]) -> Run:
    """Step 8: look for faults.

    Parameters
    ----------
    run : Run
        The run, on one axis, cut to its span.
    left_out : mapping of str to str
        Runs left out of what is pooled, and why.
    """
    settings, preparation = run.settings, run.settings.preparation
    times = {name: settings.instruments[name] if name else settings.files for name in run.groups}
    channels = run.channels
    record = Record(
        run=run.name,
        whole=run.data,
        groups=run.groups,
        clocks=run.clocks,
        span=run.used_span,
        waves=run.own.waves,
        water_depth=settings.rig.water_depth,
        stated_period=settings.campaign.encounter_period,
        redundant=redundant_pairs(settings, run.period),
        rates={
            name: Rate(own.sampling_rate, own.time is None and own.sampling_rate_assumed)
            for name, own in times.items()
            if own.sampling_rate
        },
        assumed_units={
            name: each.unit or "-" for name, each in channels.items() if each.unit_assumed
        },
        wave_columns={
            name: each.column
            for name, each in channels.items()
            if each.column and name.partition("_")[0] in MOTIONS and is_wave(each.column)
        },
        bridged=preparation.longest_gap if preparation.gaps == "bridge" else None,
        anti_alias=preparation.anti_alias,
        left_out=left_out,
    )
    findings, probes = check(record), settings.celerity_channels
    alike = run.data.attrs.get(CORRELATED)
    if probes and alike and alike < ALIKE and record.waves != "still":
        details = {"other": probes[0], "celerity": run.data.attrs["celerity"]}
        findings.append(record.finding(SensorsKind.CELERITY, probes[1], alike, ALIKE, **details))
    return replace(run, findings=[*findings, *run.findings])


def _part(
    key: str,
    span: tuple[float, float],
    time: FloatArray,
    record: tuple[float, float],
    slack: float,
) -> BoolArray:
    """Instants of a run in a span, which must hold two or more of them.

    Refused is also a span that reaches beyond the reference's record by more than a slack.
    """
    dt = usual_step(time)
    outside = any(
        np.isfinite(edge) and not record[0] - slack <= edge <= record[1] + slack for edge in span
    )
    used = inside(time, span, dt)
    if (count := used.sum()) > 1 and not outside:
        return used
    shown = f"[{instant_text(span[0], dt)}, {instant_text(span[1], dt)}] s"
    if outside:
        raise RequestError(
            f"{key}: received {shown}, and the record runs from "
            f"{span_text(*record, dt)}. Correct the span; 'inf' stands for the end."
        )
    lacks = f"{key}: {shown} holds {count} sample(s) at a step of {dt:.4g} s"
    common = span_text(time[0], time[-1], dt)
    if time[0] > record[0] + 2 * dt or time[-1] < record[1] - 2 * dt:
        raise DataError(
            f"{lacks}, since all loggers recorded together only from {common}; the reference runs "
            f"from {span_text(*record, dt)}. Check whether the files of the other loggers are "
            "whole, or correct the span."
        )
    raise RequestError(f"{lacks}. Lengthen the span, or move it into the run's {common}.")


def celerity_of(run: Run, dt: float) -> dict[str, float]:
    """Effective celerity of the waves in the part of a run that is used, m/s; and correlation."""
    channels, rig = run.settings.celerity_channels, run.settings.rig
    if channels is None or rig.water_depth is None:
        return {}
    apart = rig.positions[channels[1]] - rig.positions[channels[0]]
    try:
        used = inside(run.data["time"].values, run.used_span, dt)
        first, last = (run.data[name].values[used] for name in channels)
        found = effective_celerity(first, last, dt, apart, rig.water_depth)
    except SeakeepError:  # gaps, still water, or waves that do not run from one to the other
        return {}
    return {"celerity": found.celerity, CORRELATED: found.correlation}
