"""From runs to what the regression needs: windows, moments, standardised arrays."""

from __future__ import annotations

import reprlib
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core.embedding import History, TrainingWindow, training_window
from seakeep.errors import DataError, RequestError, SeakeepWarning, did_you_mean
from seakeep.models import labelled
from seakeep.models.labelled import ChannelLabel

__all__ = [
    "Scale",
    "TrainingData",
    "gather",
    "is_constant",
    "last_sample",
    "moments",
    "stop_instants",
]

FloatArray = npt.NDArray[np.float64]
Stop = float | Sequence[float] | Mapping[str, float] | None


@dataclass(frozen=True, eq=False)
class Scale:
    """Mean and standard deviation that turn physical values into standardised deviations.

    Parameters
    ----------
    mean, std : ndarray, shape (channel,)
        What is subtracted, and what is divided by (0 and 1 without standardisation).
    spread : ndarray, shape (channel,)
        Standard deviation over the training windows, with standardisation or without.
    """

    mean: FloatArray
    std: FloatArray
    spread: FloatArray

    def deviations(self, values: FloatArray) -> FloatArray:
        """Standardised deviations of physical values, shape (…, channel)."""
        return (values - self.mean) / self.std

    def physical(self, deviations: FloatArray, out: FloatArray | None = None) -> FloatArray:
        """Physical values of standardised deviations, shape (…, channel); `out` may be these."""
        values = np.multiply(deviations, self.std, out=out)
        values += self.mean
        return values


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Standardised arrays of the training runs, cut to what the windows reach.

    Parameters
    ----------
    names : tuple of str
        Runs.
    states, inputs : tuple of ndarray, each (time, channel)
        Standardised deviations.
    windows : tuple of TrainingWindow
        In samples of these arrays.
    first_instants, last_instants : tuple of float
        First and last instant of each window, s.
    dt : float
        Time step, s.
    state_labels, input_labels : tuple of ChannelLabel
        Names and units.
    state_scale, input_scale : Scale
        Moments over the windows.
    """

    names: tuple[str, ...]
    states: tuple[FloatArray, ...]
    inputs: tuple[FloatArray, ...]
    windows: tuple[TrainingWindow, ...]
    first_instants: tuple[float, ...]
    last_instants: tuple[float, ...]
    dt: float
    state_labels: tuple[ChannelLabel, ...]
    input_labels: tuple[ChannelLabel, ...]
    state_scale: Scale
    input_scale: Scale


def gather(
    runs: Mapping[str, xr.Dataset],
    states: Sequence[str],
    inputs: Sequence[str],
    stop: Stop,
    *,
    state_delays: int,
    input_delays: int,
    window: int | None,
    history: History,
    standardize: bool,
) -> TrainingData:
    """Collect the training windows of the runs.

    Parameters
    ----------
    runs : mapping of str to Dataset
        Runs, at least one.
    states, inputs : sequence of str
        Channels.
    stop : float, sequence or mapping of float, optional
        Last instants, s.
    state_delays, input_delays, window, history, standardize
        As in :class:`seakeep.HankelDMDc`.

    Returns
    -------
    TrainingData
        What the regression needs.

    Raises
    ------
    RequestError
        If names are unknown, repeated or missing, or a stop lies outside its run.
    DataError
        If a run is too short, has gaps, another time step, other units, or a constant channel.
    """
    check_names(states, inputs)
    states, inputs = list(states), list(inputs)  # arrays of names are welcome too
    stops = stop_instants(stop, list(runs))
    first_name, first_run = next(iter(runs.items()))
    dt = labelled.run_step(first_run, first_name)
    labels: tuple[tuple[ChannelLabel, ...], ...] = ()
    pieces = []
    for name, run in runs.items():
        if run is not first_run:
            labelled.check_step(run, name, dt)
        time = np.asarray(run.variables["time"].values, dtype=float)
        last = last_sample(time, stops[name], name)
        place = training_window(last, window, state_delays, input_delays, history)
        _check_length(place, name, window, max(state_delays, input_delays), history)
        reach = place.first_column - max(state_delays, input_delays)
        samples = slice(min(place.first, reach), last + 1)
        arrays = []
        for channels, delays in ((states, state_delays), (inputs, input_delays)):
            values = labelled.channel_matrix(run, channels, name, samples)
            # Each group reaches back by its own delays, and the moments over the window.
            needed = min(place.first, place.first_column - delays)
            unread = needed - samples.start
            labelled.check_finite(values[unread:], channels, name, needed, time)
            arrays.append(values)
        labels = labels or tuple(labelled.channel_labels(run, names) for names in (states, inputs))
        for group in labels:
            labelled.check_units(run, group, name)
        shifted = TrainingWindow(
            place.first - samples.start,
            place.last - samples.start,
            place.first_column - samples.start,
        )
        pieces.append((name, arrays[0], arrays[1], shifted, time[place.first], time[last]))

    names, x, u, windows, first, final = zip(*pieces, strict=True)
    state_scale = moments(x, windows, states, standardize)
    input_scale = moments(u, windows, inputs, standardize)
    if len(names) > 1:
        _warn_of_dead(names, x, windows, state_scale, states)
        _warn_of_dead(names, u, windows, input_scale, inputs)
    return TrainingData(
        names=names,
        states=tuple(state_scale.deviations(values) for values in x),
        inputs=tuple(input_scale.deviations(values) for values in u),
        windows=windows,
        first_instants=first,
        last_instants=final,
        dt=dt,
        state_labels=labels[0],
        input_labels=labels[1],
        state_scale=state_scale,
        input_scale=input_scale,
    )


def until(runs: Mapping[str, xr.Dataset], stop: Stop) -> dict[str, xr.Dataset]:
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
    stops = stop_instants(stop, list(runs))
    out = {}
    for name, run in runs.items():
        labelled.run_step(run, name)
        last = last_sample(np.asarray(run["time"].values, dtype=float), stops[name], name)
        out[name] = run.isel(time=slice(0, last + 1))
    return out


def check_names(states: Sequence[str], inputs: Sequence[str]) -> None:
    """Refuse lists of channels that are strings, empty, repeated or overlapping."""
    for what, names in (("states", states), ("inputs", inputs)):
        if isinstance(names, str):
            raise RequestError(
                f"{what} must be a list of channel names; received the string '{names}'. "
                f"Write {what}=['{names}']."
            )
        listed = isinstance(cast("object", names), Iterable)
        if not listed or not all(isinstance(cast("object", name), str) for name in names):
            raise RequestError(
                f"{what} must be a list of channel names; received {reprlib.repr(names)}. A "
                "model without input takes inputs=[]."
            )
        double = {name for name in names if list(names).count(name) > 1}
        if double:
            raise RequestError(
                f"{what} names {', '.join(sorted(double))} more than once. Name each channel once."
            )
    if len(states) == 0:
        raise RequestError("states is empty: name at least one channel to forecast.")
    both = set(states) & set(inputs)
    if both:
        raise RequestError(
            f"{', '.join(sorted(both))} is both a state and an input. A state is forecast and an "
            "input is given: choose one."
        )


def stop_instants(stop: Stop, names: list[str]) -> dict[str, float | None]:
    """Last instant of each run's window as the user gave it; None for the run's end."""
    if stop is None:
        return dict.fromkeys(names)
    if isinstance(stop, Mapping):
        unknown = [name for name in stop if name not in names]
        if unknown:
            raise RequestError(
                f"stop names the run '{unknown[0]}', which is not among the runs "
                f"({', '.join(names)}).{did_you_mean(unknown[0], names)}"
            )
        return {name: _one_stop(stop.get(name), f"stop of '{name}'") for name in names}
    if np.ndim(stop) > 0:  # a scalar array, such as an instant of a run, is one for all
        values = [_one_stop(value, "each stop") for value in cast("list[Any]", stop)]
        if len(values) != len(names):
            raise RequestError(
                f"stop has {len(values)} instants for {len(names)} runs; give one for all, or "
                "one a run."
            )
        return dict(zip(names, values, strict=True))
    return dict.fromkeys(names, labelled.as_instant(stop, "stop"))


def _one_stop(value: object, what: str) -> float | None:
    return None if value is None else labelled.as_instant(value, what)


def last_sample(time: FloatArray, stop: float | None, name: str) -> int:
    """Last sample up to and including `stop`."""
    if stop is None:
        return time.size - 1
    nearest = labelled.nearest_sample(time, stop, name, "stop")
    step = (time[-1] - time[0]) / (time.size - 1)
    # "up to and including": a sample later than the stop by more than rounding is not included.
    return nearest if time[nearest] <= stop + 1e-3 * step else max(nearest - 1, 0)


def _warn_of_dead(
    runs: Sequence[str],
    series: Sequence[FloatArray],
    windows: Sequence[TrainingWindow],
    scale: Scale,
    names: Sequence[str],
) -> None:
    """Warn of channels that move in some runs and stand still in others."""
    for run, values, window in zip(runs, series, windows, strict=True):
        seen = values[window.samples]
        for column in np.flatnonzero(is_constant(seen) & (scale.spread > 0)).tolist():
            warnings.warn(
                f"channel '{names[column]}' of {run} is constant ({seen[0, column]:.6g}) over its "
                "training window, and moves in other runs. If its sensor was dead, leave this run "
                "out: the model would learn that nothing moves.",
                SeakeepWarning,
                stacklevel=4,
            )


def is_constant(values: FloatArray) -> npt.NDArray[np.bool_]:
    """Channels, shape (channel,), that do not move; values are (time, channel)."""
    # A constant that is not a binary fraction has a spread of rounding, not of zero.
    largest = np.abs(values).max(axis=0, initial=0.0)
    still: npt.NDArray[np.bool_] = np.ptp(values, axis=0) <= 1e-12 * largest
    return still


def _check_length(
    place: TrainingWindow, name: str, window: int | None, reach: int, history: History
) -> None:
    if window is not None and place.first < 0:
        raise DataError(
            f"{name} has {place.last + 1} samples up to the end of the training window, which asks "
            f"for {window}: {-place.first} are missing. Shorten the window (window, or "
            "train_length of an ensemble), or give a longer run (span or train in [runs.NAME])."
        )
    if place.columns < 1:
        needed = reach + 2
        received = (place.last + 1) if window is None or history == "before" else window
        raise DataError(
            f"{name} is too short for its delays: {needed} samples are needed (delay history of "
            f"{reach}, one snapshot and its successor), {received} were received, "
            f"{needed - received} are missing. Reduce the delays, or give a longer "
            f"{'window' if history == 'inside' and window is not None else 'run'}."
        )


def moments(
    series: Sequence[FloatArray],
    windows: Sequence[TrainingWindow],
    names: Sequence[str],
    standardize: bool,
) -> Scale:
    """Means and standard deviations (ddof = 1) over the windows of all runs.

    Raises
    ------
    DataError
        If a channel is constant there and `standardize` is set.
    """
    pooled = np.concatenate(
        [values[window.samples] for values, window in zip(series, windows, strict=True)]
    )
    mean = pooled.sum(axis=0) / len(pooled)
    centred = pooled - mean
    spread = np.sqrt(np.einsum("tc,tc->c", centred, centred) / (len(pooled) - 1))
    # A constant that is not a binary fraction has a spread of rounding, not of zero.
    constant = spread <= 1e-12 * np.abs(mean)
    spread = np.where(constant, 0.0, spread)
    if not standardize:
        return Scale(np.zeros(mean.size), np.ones(mean.size), spread)
    if np.any(constant):
        column = int(np.flatnonzero(constant)[0])
        raise DataError(
            f"channel '{names[column]}' is constant ({pooled[0, column]:g}) over the training "
            "window, so it cannot be standardised. Look for a dead sensor, choose another window, "
            "leave the channel out, or set standardize=False."
        )
    return Scale(mean, spread, spread)
