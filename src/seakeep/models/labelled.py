"""The thin layer between labelled runs and arrays: Datasets in, arrays out, and back."""

import math
import re
import reprlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self, cast

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, FloatArray, Groups
from seakeep.conventions import canonical_channel, is_elevation, same_unit
from seakeep.errors import DataError, RequestError, did_you_mean, warn
from seakeep.signals import uniform_step
from seakeep.signals.time_axis import instant_text, span_text
from seakeep.signals.waves import encounter_period

Runs = xr.Dataset | Sequence[xr.Dataset] | Mapping[str, xr.Dataset]
Stop = float | Sequence[float] | Mapping[str, float] | Mapping[str, float | None] | None
"""Last instant of the training window, s: one for all runs, or one per run."""


@dataclass(frozen=True)
class ChannelLabel:
    """Name, unit and long name of a channel of a model.

    Parameters
    ----------
    name, units, long_name : str
        As in the variable and its attributes; empty where the run did not say.
    """

    name: str
    units: str
    long_name: str


class Span(NamedTuple):
    """Samples of a run that are wanted: from `first` to before `stop`; `known` is the start."""

    first: int
    known: int
    stop: int


def as_runs(runs: Runs) -> Groups:
    """Name the runs.

    Parameters
    ----------
    runs : Dataset, sequence of Dataset, or mapping of names to Datasets
        What the user passed. A run without a name takes its ``attrs["run"]``, else a number.

    Returns
    -------
    dict of str to Dataset
        At least one run.

    Raises
    ------
    RequestError
        If there is no run, or something is not a Dataset.
    """
    named: Groups = {}
    if isinstance(runs, xr.Dataset):
        named[run_name(runs, "run")] = runs
    elif isinstance(runs, Mapping):
        named.update(cast("Mapping[str, xr.Dataset]", runs))
    elif not isinstance(cast("object", runs), Iterable):
        check_run(runs, "runs")
    else:
        for number, run in enumerate(runs, start=1):
            given = name = run_name(run, f"run {number}")
            while name in named:
                name = f"{given} ({number})"
                number += 1
            named[name] = run
    if not named:
        raise RequestError("no run was given. Pass one Dataset, a sequence or a mapping of them.")
    for name, run in named.items():
        check_run(run, name)
    return named


class TrainingRuns(NamedTuple):
    """Training runs, which end where training ends, and the channels of a model."""

    runs: Datasets
    states: Sequence[str]
    inputs: Sequence[str]

    @classmethod
    def of(cls, runs: Runs, states: Sequence[str], inputs: Sequence[str], stop: Stop) -> Self:
        """What a user gives to train with; arguments and errors as :meth:`HankelDMDc.fit`.

        Lists of channels that are strings, empty, repeated or overlapping are refused.
        """
        channels = list[list[str]]()
        for what, names in (("states", states), ("inputs", inputs)):
            if isinstance(names, str):
                raise RequestError(
                    f"{what} must be a list of channel names; received the string '{names}'. "
                    f"Write {what}=['{names}']."
                )
            given: Any = names
            listed = [*given] if isinstance(given, Iterable) else [given]
            if not all(isinstance(name, str) for name in listed):
                raise RequestError(
                    f"{what} must be a list of channel names; received {reprlib.repr(names)}. A "
                    "model without input takes inputs=[]."
                )
            if double := {name for name in listed if listed.count(name) > 1}:
                raise RequestError(
                    f"{what} names {', '.join(sorted(double))} more than once. Name each channel "
                    "once."
                )
            channels.append(listed)
        states, inputs = channels
        if not states:
            raise RequestError("states is empty: name at least one channel to forecast.")
        if both := set(states) & set(inputs):
            raise RequestError(
                f"{', '.join(sorted(both))} is both a state and an input. A state is forecast and "
                "an input is given: choose one."
            )
        return cls(until(as_runs(runs), stop), states, inputs)


def until(runs: Datasets, stop: Stop) -> Groups:
    """Cut runs at the last instants of their training windows.

    Parameters
    ----------
    runs : mapping of str to Dataset
        Runs.
    stop : float, sequence or mapping of float, optional
        Last instants, s.

    Returns
    -------
    dict of str to Dataset
        The runs up to and including these instants.

    Raises
    ------
    RequestError
        If a stop lies outside its run.
    DataError
        If the times of a run are not uniform.
    """
    asked: Any = stop
    names, out = list(runs), {}
    if isinstance(asked, Mapping):
        if unknown := [name for name in asked if name not in names]:
            raise RequestError(
                f"stop names the run '{unknown[0]}', which is not among the runs "
                f"({', '.join(names)}).{did_you_mean(unknown[0], names)}"
            )
        stops = [asked.get(name) for name in names]
    elif np.ndim(asked) > 0:  # a scalar array, such as an instant of a run, is one for all
        stops = list(asked)
        if len(stops) != len(names):
            raise RequestError(
                f"stop has {len(stops)} instants for {len(names)} runs; give one for all, or "
                "one per run."
            )
    else:
        stops = [asked] * len(names)
    for (name, run), at in zip(runs.items(), stops, strict=True):
        step = run_step(run, name)
        out[name] = run
        if at is not None:
            time = run["time"].values.astype(float)
            last = nearest_sample(time, at, name, "stop")
            # "up to and including": a sample later than the stop by more than rounding is not.
            last -= last > 0 and time[last] > float(at) + 1e-3 * step
            out[name] = run.isel(time=slice(0, last + 1))
    return out


def is_made_up(name: str, run: xr.Dataset) -> bool:
    """Whether a name was given by :func:`as_runs` to a run that has none."""
    return "run" not in run.attrs and re.fullmatch(r"run( \d+)?( \(\d+\))*", name) is not None


def run_name(run: object, fallback: str) -> str:
    """Name that a run carries in its attributes, or `fallback`."""
    return str(run.attrs.get("run", fallback)) if isinstance(run, xr.Dataset) else fallback


def check_run(run: object, name: str) -> None:
    """Refuse what is not a Dataset with a ``time`` coordinate."""
    if not isinstance(run, xr.Dataset):
        raise RequestError(
            f"{name} is a {type(run).__name__}; a run is an xarray.Dataset with the dimension "
            "'time' and one variable per channel. Build one, such as of a DataFrame over an index "
            "'time' by to_xarray(), or read it with seakeep.read_campaign."
        )
    if "time" not in run.dims or "time" not in run.coords:
        raise RequestError(
            f"{name} has no coordinate 'time' (dimensions: {', '.join(map(str, run.dims))}). "
            "Give every channel the dimension 'time' and the instants in seconds."
        )


def run_step(run: xr.Dataset, name: str, expected: float | None = None) -> float:
    """Time step of a run, s; its times must be uniform, and the step that which is `expected`.

    A step read from rounded times is known to about the rounding divided by the number of
    samples; one part in ten thousand is beyond that and far below a wrong sampling rate.

    Raises
    ------
    DataError
        If the times are not numbers or not in seconds, unsorted, repeated or not uniform, or the
        step is another.
    """
    check_units(run, "time", "s", name)
    step = uniform_step(run.variables["time"].values, name)
    if expected is not None and abs(step - expected) > 1e-4 * expected:
        words = (
            f"{name} has a time step of {step:.6g} s and the model one of {expected:.6g} s. "
            "Resample the run (seakeep.signals.resample, or the campaign's [preparation])."
        )
        if period := run.attrs.get("encounter_period"):
            words += (
                f" Where steps count in encounter periods, encounter_period = "
                f"{period * expected / step:.7g} in [campaign] gives that of the model; left out, "
                "it is measured, and changes with the runs and their spans."
            )
        raise DataError(words)
    return step


def check_units(run: xr.Dataset, channel: str, expected: str, name: str) -> None:
    """Refuse a channel that states another unit than a model expects, however it is spelt."""
    units = str(run.variables[channel].attrs.get("units", "")).partition(" since ")[0]
    if units and not same_unit(units, expected):
        raise DataError(
            f"channel '{channel}' of {name} is in '{units}' and the model expects '{expected}'. "
            "Convert the channel and its units attribute."
        )


def opened(
    run: xr.Dataset, fallback: str, dt: float, labels: Sequence[ChannelLabel]
) -> tuple[str, FloatArray]:
    """Name and instants of a run that a model reads: one of its time step and its units.

    Warns of channels that state no unit; `fallback` is the name of a run without one.
    """
    name = run_name(run, fallback)
    check_run(run, name)
    run_step(run, name, dt)
    silent, variables = [], run.variables
    for label in labels:
        if label.name not in variables or not label.units:
            continue
        if not variables[label.name].attrs.get("units"):
            silent.append(label)
        check_units(run, label.name, label.units, name)
    if silent:
        listed = ", ".join(f"'{label.name}'" for label in silent)
        units = ", ".join(dict.fromkeys(f"'{label.units}'" for label in silent))
        warn(
            f"channel {listed} of {name} states no unit; it is taken to be in the model's {units}. "
            "Set its units attribute."
        )
    return name, variables["time"].values.astype(float)


def channel_matrix(
    run: xr.Dataset, names: Sequence[str], name: str, samples: slice = slice(None)
) -> FloatArray:
    """Channels of a run side by side.

    Parameters
    ----------
    run : Dataset
        The run.
    names : sequence of str
        Channels, in the order wanted.
    name : str
        What messages call the run.
    samples : slice, optional
        Samples to take.

    Returns
    -------
    ndarray, shape (samples, channels)
        Double precision, for any type in the run.

    Raises
    ------
    RequestError
        If a channel is missing.
    DataError
        If a channel has another dimension than ``time``, or is not numeric.
    """
    size = len(range(*samples.indices(run.sizes["time"])))
    out = np.empty((size, len(names)))
    for column, variable in enumerate(check_channels(run, names, name)):
        out[:, column] = variable.values[samples]
    return out


def check_channels(run: xr.Dataset, names: Sequence[str], name: str) -> list[xr.Variable]:
    """Variables of channels; one that is missing, not numeric or not over time raises an error."""
    variables, channels = run.variables, run.data_vars
    out = []
    for channel in names:
        if channel not in channels:
            known = [str(variable) for variable in channels]
            raise RequestError(
                f"{name} has no channel '{channel}'.{did_you_mean(channel, known)} "
                f"It has: {', '.join(known)}."
            )
        variable = variables[channel]
        if variable.dims != ("time",):
            is_flat = run[channel].squeeze().dims == ("time",)
            remedy = "Take run.squeeze()" if is_flat else "Give each channel its own variable"
            raise DataError(
                f"channel '{channel}' of {name} has the dimensions {variable.dims} and shape "
                f"{variable.shape}; ('time',) is expected. {remedy}."
            )
        if variable.dtype.kind not in "iufb":
            raise DataError(
                f"channel '{channel}' of {name} is of type {variable.dtype}, not a real number. "
                "Convert the column, or leave it out of the run."
            )
        out.append(variable)
    return out


def sound_matrix(
    run: xr.Dataset, names: Sequence[str], name: str, samples: slice = slice(None)
) -> FloatArray:
    """Channels of a run side by side; gaps raise a DataError."""
    values = channel_matrix(run, names, name, samples)
    check_finite(values, names, run, name, samples.start or 0)
    return values


def check_finite(
    values: FloatArray, names: Sequence[str], run: xr.Dataset, name: str, first: int = 0
) -> None:
    """Refuse gaps in channels of a run; `first` is the sample of the first row."""
    bad = ~np.isfinite(values)
    if not bad.any():
        return
    row, column = (int(index) for index in np.argwhere(bad)[0])
    time = run["time"].values.astype(float)
    instant = instant_text(time[first + row], float(time[-1] - time[0]) / (time.size - 1))
    raise DataError(
        f"channel '{names[column]}' of {name} has {int(bad[:, column].sum())} missing or infinite "
        f"value(s) in the samples needed, the first at t = {instant} s. "
        "Nothing is filled in silence: gaps up to longest_gap are bridged where [preparation] says "
        "gaps = 'bridge' (of arrays by seakeep.signals.bridge); cut the run so that a longer one "
        "lies outside (record, span, train or test in [runs.NAME])."
    )


def channel_labels(run: xr.Dataset, names: Sequence[str]) -> tuple[ChannelLabel, ...]:
    """Labels of channels as the run states them."""
    labels = []
    for channel in names:
        attrs = run.variables[channel].attrs
        long_name = attrs.get("long_name", channel.replace("_", " "))
        labels.append(ChannelLabel(channel, str(attrs.get("units", "")), str(long_name)))
    return tuple(labels)


def common_step(runs: Datasets) -> float:
    """Time step that all runs have, s."""
    first_name, first_run = next(iter(runs.items()))
    dt = run_step(first_run, first_name)
    for name, run in runs.items():
        run_step(run, name, dt)
    return dt


def common_labels(runs: Datasets, names: Sequence[str]) -> tuple[ChannelLabel, ...]:
    """Labels of channels, with the unit that all runs which state one agree on.

    Warns
    -----
    SeakeepWarning
        If some of the runs state the unit of a channel and others do not.
    """
    for name, run in runs.items():
        check_channels(run, names, name)
    out = []
    for label in channel_labels(next(iter(runs.values())), names):
        stated = {
            name: str(units)
            for name, run in runs.items()
            if (units := run.variables[label.name].attrs.get("units"))
        }
        if len(set(stated.values())) > 1:
            (one, unit), *others = stated.items()
            other = next(each for each in others if each[1] != unit)
            raise DataError(
                f"channel '{label.name}' is in '{unit}' in {one} and in '{other[1]}' in "
                f"{other[0]}. Convert one of them, and its units attribute."
            )
        if stated and len(stated) < len(runs):
            silent = next(name for name in runs if name not in stated)
            warn(
                f"channel '{label.name}' of {silent} states no unit; it is taken to be in "
                f"'{next(iter(stated.values()))}', as in {next(iter(stated))}. Set its units "
                "attribute."
            )
        out.append(replace(label, units=next(iter(stated.values()), label.units)))
    return tuple(out)


def nearest_sample(time: FloatArray, value: object, name: str, what: str = "start") -> int:
    """Sample nearest to an instant.

    Parameters
    ----------
    time : ndarray, shape (time,)
        Uniform instants, s.
    value : object
        Instant wanted, s: a number, or an array that holds one number.
    name, what : str
        What the message calls the run and the instant.

    Returns
    -------
    int
        Index of the nearest sample.

    Raises
    ------
    RequestError
        If the instant is outside the run by more than rounding, or not a number.
    """
    array = np.asarray(value)
    if array.ndim or array.dtype.kind not in "iuf":
        raise RequestError(f"{what} must be an instant in seconds; received {value!r} for {name}.")
    instant, step = float(array), float(time[-1] - time[0]) / (time.size - 1)
    rounding = 1e-3 * step
    if not time[0] - rounding <= instant <= time[-1] + rounding:
        raise RequestError(
            f"{what} = {instant_text(instant, step)} s is outside {name}, which runs from "
            f"{span_text(time[0], time[-1], step)}. Choose an instant inside it."
        )
    return round((instant - float(time[0])) / step)


def wave_channel(run: xr.Dataset, inputs: Sequence[str], name: str) -> str | None:
    """The input that tells of the waves of a run, which messages call `name`.

    Of the elevations, or else of the inputs that have no unit or metres, that farthest up-wave; the
    first where no position is stated; None where there is none.
    """

    def place(channel: str) -> float:
        return math.inf if (at := position(run, channel)) is None else at

    waves = elevations(run, inputs, name)
    lengths = [each for each in inputs if _is_length(run, each)]
    return min(waves or lengths, key=place, default=None)


def elevations(run: xr.Dataset, inputs: Sequence[str], name: str) -> tuple[str, ...]:
    """Inputs that are wave elevations: by their names, free names by their positions and unit."""
    check_channels(run, inputs, name)

    def is_probe(channel: str) -> bool:
        placed = position(run, channel) is not None and _is_length(run, channel)
        return placed and canonical_channel(channel) is None

    return tuple(each for each in inputs if is_elevation(each) or is_probe(each))


def position(run: xr.Dataset, channel: str) -> float | None:
    """Position of a probe, m, as its channel states it."""
    value = run.variables[channel].attrs.get("x_position")
    return None if value is None else float(value)


def _is_length(run: xr.Dataset, channel: str) -> bool:
    return run.variables[channel].attrs.get("units", "") in ("", "m")


def last_samples(runs: Datasets, window: int | None) -> Groups:
    """The last samples of each run, `window` of them; None keeps all."""
    last = slice(None if window is None else -window, None)
    return {name: run.isel(time=last) for name, run in runs.items()}


def first_halves(runs: Datasets) -> Groups:
    """The first half of each run."""
    return {name: run.isel(time=slice(run.sizes["time"] // 2)) for name, run in runs.items()}


def mean_period(runs: Datasets, inputs: Sequence[str]) -> float:
    """Mean encounter period of some runs, samples: as they state it, or counted.

    It is counted in the :func:`wave_channel` of each run; runs without waves do not count.

    Raises
    ------
    DataError
        If no run states a period and none can be counted.
    """
    steps = {name: run_step(run, name) for name, run in runs.items()}
    key = "encounter_period"
    periods = [
        float(run.attrs[key]) / steps[name] for name, run in runs.items() if key in run.attrs
    ]
    if periods:
        return float(np.mean(periods))
    reason = f"no input ({', '.join(inputs) or 'none'}) is a wave elevation, eta_…."
    for name, run in runs.items():
        if (wave := wave_channel(run, inputs, name)) is None:
            continue
        series = channel_matrix(run, [wave], name)[:, 0]
        try:
            periods.append(encounter_period(series[np.isfinite(series)], steps[name]) / steps[name])
        except (DataError, RequestError) as error:
            reason = f"{name}, channel '{wave}': {error}"
    if not periods:
        raise DataError(
            f"the encounter period is not known: no run states it, and {reason} Set "
            "run.attrs['encounter_period'] (s)."
        )
    return float(np.mean(periods))
