"""Free runs of many members over many windows: the one engine of models, ensembles and studies.

:func:`read_groups` reads what forecasts from several starts in several runs need, the inputs of
each run once. A model's ``free_runs(windows, members)`` gives arrays; :func:`member_series` hands
members to an executor and collects them, in a file where they are many.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from operator import call
from typing import Any, Protocol

import numpy as np
import xarray as xr

from seakeep.arrays import (
    BoolArray,
    Datasets,
    FloatArray,
    IntArray,
    Progress,
    check_choice,
    undefined,
    whole_number,
)
from seakeep.core.recursion import Recursion, read_table, recursion
from seakeep.core.rollout import rollouts
from seakeep.errors import RequestError
from seakeep.executor import in_order
from seakeep.models import labelled
from seakeep.models.inputs import Drive, Signature
from seakeep.models.labelled import Span
from seakeep.models.readouts import FittedReadOut, read_out
from seakeep.signals.prediction import Foreseen, fill_future, foresee
from seakeep.signals.time_axis import instant_text

GROWTH = 10.0
"""A free run is lost where a state is this many times as far from the training mean as training,
or the history of the forecast, ever was, in waves as high as those of training.

A linear model answers waves twice as high by twice the motion, so the limit grows with the ratio of
the highest deviation of the input to that in training. What is left for the factor are transients
and resonances that training did not show: a tenfold answer is no longer a forecast of a vessel, and
members that go on from there would make up the mean of an ensemble."""
MEMORY, LEAST = 20, 64
"""Longest delays over which the limit falls back after a high wave, or a spike of a probe, and the
samples that a delay counts at least: slow drift rings for some hundred wave periods."""
TOGETHER = 64
"""Free runs, at most, of members that follow their own surge, which are stepped side by side."""
HELD = 32 * 2**20
"""Bytes of member series that are held in memory; more is put into a temporary file."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Measured samples that forecasts read, and the instants they give, window by window.

    Parameters
    ----------
    steps : int
        Instants forecast from each start.
    histories : ndarray, shape (window, at least s + 1, N)
        Measured states up to each start, physical units.
    delayed : ndarray, shape (window, z + steps, n)
        Delayed regressors that drive these steps; where the model follows its own surge, from the
        start on those at the place of the start.
    direct : ndarray, shape (window, steps, m)
        Direct regressors from the start on; then without the slow surge squared.
    places : tuple of (str, float)
        Run and start of each window, s.
    time : tuple of Variable, each of shape (steps,)
        Instants that are forecast, where they are of a run.
    notes : dict
        What a forecast's attributes report of the first run, of the input map there, and of how
        far ahead it reads.
    table : ndarray, shape (time, place, n), optional
        What would drive a step at each place, where the model follows its own surge.
    starts : ndarray of int, shape (window,), optional
        Samples of the table from which the windows start.
    predicted : tuple of int
        First step of each window that reads predicted input, or −1.
    waves : ndarray, shape (window, steps, line, 2), optional
        Elevation and rate of the wave at the line of each load that reads it.
    parameters : tuple of float
        Parameter of the run of each window, where the model varies with one.
    zero : ndarray, shape (window, N), optional
        What the states of each window depart from: it is to be added to free runs.
    departures : tuple of Windows
        The same with an innovation of one SD where each input is first predicted, and with the
        opposites.
    """

    steps: int
    histories: FloatArray
    delayed: FloatArray
    direct: FloatArray
    places: tuple[tuple[str, float], ...] = ()
    time: tuple[xr.Variable, ...] = ()
    notes: Mapping[str, str | float] = field(default_factory=dict)
    table: FloatArray | None = None
    starts: IntArray | None = None
    predicted: tuple[int, ...] = ()
    waves: FloatArray | None = None
    parameters: tuple[float, ...] = ()
    zero: FloatArray | None = None
    departures: tuple[Windows, ...] = ()

    def departing(
        self, measured: FloatArray, zero: FloatArray | float
    ) -> tuple[Windows, FloatArray]:
        """The windows, and what is measured in them less `zero`, as departures from their means."""
        if self.zero is None:
            return self, measured
        return replace(self, zero=None), measured + (zero - self.zero)[:, None]


@dataclass(frozen=True, eq=False)
class Dynamics:
    """What a free run needs from a linear model or a member.

    Parameters
    ----------
    coefficients : ndarray, shape (N(s+1) or N, N(s+1) + n(z+1) + m)
        Regressed rows of [Â B̂], on standardised deviations.
    signature : Signature
        Its own delays, moments and input map.
    """

    coefficients: FloatArray
    signature: Signature

    @property
    def matrices(self) -> tuple[FloatArray, FloatArray]:
        """Regressed rows of Â and B̂."""
        size = len(self.signature.state_labels) * (self.signature.state_delays + 1)
        return self.coefficients[:, :size], self.coefficients[:, size:]

    @property
    def system(self) -> FloatArray:
        """Â, with the rows that shift the delayed states where these are exact."""
        rows, count = self.matrices[0], len(self.signature.state_labels)
        size = rows.shape[1]
        return rows if len(rows) == size else np.concatenate([rows, np.eye(size - count, size)])


class Runs(Protocol):
    """An object that makes free runs: a model, an ensemble, or members that are held."""

    @property
    def signature(self) -> Signature:
        """Channels, delays, input map and scales."""

    @property
    def n_members(self) -> int:
        """Number of members; one for a single model."""

    @property
    def is_centred(self) -> bool:
        """Whether one more run, numbered `n_members`, is what the members' mean is moved to."""

    def free_runs(self, groups: Sequence[Windows], members: Sequence[int]) -> list[FloatArray]:
        """Free runs of members over groups of windows, each (member, window, steps, N).

        Physical units, NaN from where a run is lost.
        """


Place = tuple[str, float]
"""Name of a run, and the instant of the last measured state, s."""


def read_groups(
    signature: Signature,
    runs: Datasets,
    groups: Sequence[tuple[Sequence[Place], int | None]],
    ahead: str = "refuse",
) -> list[Windows]:
    """Read what forecasts from several starts need, each group of starts with its steps.

    Each probe is carried once per run for all of them; arguments and errors as ``forecast``.
    """
    check_choice("ahead", ahead, ("refuse", "predict"))
    predicts = ahead == "predict" and bool(signature.inputs)
    labels, opened = signature.state_labels + signature.input_labels, dict[str, _Opened]()
    spans: list[list[Span]] = []
    for places, steps in groups:
        if not places:
            raise RequestError("starts is empty: name at least one instant to forecast from.")
        if steps is None and len(places) > 1:
            raise RequestError(
                f"steps is None, which is the end of the run, at another distance from each of the "
                f"{len(places)} starts. Give the number of instants to forecast from all of them."
            )
        spans.append([])
        for name, start in places:
            if name not in opened:
                own = labelled.opened(runs[name], name, signature.dt, labels)
                opened[name] = _Opened(runs[name], *own)
            spans[-1].append(opened[name].span(signature, start, steps, predicts))
            opened[name].spans.append(spans[-1][-1])
    for each in opened.values():
        each.drive(signature, predicts)
    return [
        _windows(signature, [opened[name] for name, _ in places], own)
        for (places, _), own in zip(groups, spans, strict=True)
    ]


def _windows(signature: Signature, runs: Sequence[_Opened], spans: Sequence[Span]) -> Windows:
    """Windows of one length, each with what drives its run."""
    maps, dt, steps = signature.input_map, signature.dt, spans[0].stop - spans[0].known
    places, time, histories, look_ahead, predicted = [], [], [], [], []
    for run, span in zip(runs, spans, strict=True):
        places.append((run.name, float(run.time[span.known])))
        attrs = dict(run.run.variables["time"].attrs) or {"units": "s", "long_name": "time"}
        instants = run.instants(span.known + 1, span.stop + 1, dt)
        time.append(xr.Variable(("time",), instants, attrs))
        rows = slice(span.known + 1 - signature.state_samples, span.known + 1)
        histories.append(labelled.sound_matrix(run.run, signature.states, run.name, rows))
        look_ahead.append(maps.look_ahead(run.run, dt))
        step = steps
        if run.known is not None:
            step = max(run.known - math.ceil(look_ahead[-1] / dt - 1e-6) - span.known + 1, 0)
        predicted.append(step if step < steps else -1)
    notes: dict[str, str | float] = {"run": runs[0].name}
    if maps.alignment is not None:
        notes |= maps.alignment.notes(runs[0].run)
    if signature.inputs:
        notes["reads_input_until"] = max(look_ahead) - dt
    # A run of which nothing is predicted has one future.
    expected, *departures = (
        _series(signature, histories, [run.futures[at % len(run.futures)] for run in runs], spans)
        for at in range(max(len(run.futures) for run in runs))
    )
    parameter = signature.parameter
    windows = Windows(
        places=tuple(places),
        steps=steps,
        time=tuple(time),
        notes=notes,
        predicted=tuple(predicted),
        parameters=tuple(parameter_of(run.run, parameter, run.name) for run in runs if parameter),
        **expected,
    )
    return replace(windows, departures=tuple(replace(windows, **each) for each in departures))


def _series(
    signature: Signature,
    histories: Sequence[FloatArray] | FloatArray,
    drives: Sequence[Drive],
    spans: Sequence[Span],
) -> dict[str, Any]:
    """What windows of one length start from, and what drives each, from its run's drive."""
    reference, follows = signature.input_map.reference, signature.input_map.follows
    z, pairs = signature.input_delays, list(zip(drives, spans, strict=True))
    out: dict[str, Any] = {"histories": np.stack([*histories])}
    if reference:  # all but the place of a vessel that is followed departs from means
        zero = out["histories"][:, -reference:].mean(axis=1)
        if follows is not None:
            zero[:, follows.column] = 0.0
        rows = max(signature.state_delays + 1, signature.history_samples - reference)
        out = {"histories": out["histories"][:, -rows:] - zero[:, None], "zero": zero}
        before = [drive.rows(at.known + 1 - reference, at.known + 1) for drive, at in pairs]
        zeros = [
            np.stack([each.mean(axis=0) for each in group])[:, None]
            for group in zip(*before, strict=True)
        ]
    if follows is None:
        read = [drive.rows(span.first, span.stop) for drive, span in pairs]
        delayed = np.stack([each.delayed for each in read])
        direct = np.stack([each.direct[z:] for each in read])
        if reference:
            delayed, direct = delayed - zeros[0], direct - zeros[1]
        return out | {"delayed": delayed, "direct": direct}
    direct = np.stack([drive.direct(span.known, span.stop) for drive, span in pairs])
    if reference:
        direct -= zeros[1][..., :-1]
    tables, starts, offsets, length = [], [], dict[Drive, int](), 0
    for number, (drive, span) in enumerate(pairs):
        if reference or drive not in offsets:
            first, table = drive.whole
            if reference:
                first, table = span.first, drive.table(span.first, span.stop) - zeros[0][number]
            tables.append(table)
            offsets[drive] = length - first
            length += len(table)
        starts.append(offsets[drive] + span.known)
    table = np.concatenate(tables)
    steps, at = spans[0].stop - spans[0].known, np.array(starts)
    here = np.stack([drive.places(span.first, span.known + 1) for drive, span in pairs])
    here = np.concatenate([here, here[:, -1:].repeat(steps - 1, axis=1)], axis=1)
    delayed = read_table(follows.place, table, at[:, None] + np.arange(-z, steps), here)
    lines = tuple(each.load.place for each in signature.readouts if each.load is not None)
    if lines:
        waves = [drive.waves(lines, span.known, span.stop) for drive, span in pairs]
        out["waves"] = np.stack(waves)
    return out | {"delayed": delayed, "direct": direct, "table": table, "starts": at}


def parameter_of(run: xr.Dataset, parameter: str, name: str) -> float:
    """Value of a parameter in the attributes of a run.

    Parameters
    ----------
    run : Dataset
        The run.
    parameter : str
        Attribute; a dot leads into an attribute that is a mapping.
    name : str
        What messages call the run.

    Raises
    ------
    RequestError
        If the run has no such number.
    """
    value: Any = run.attrs.get(parameter)
    if value is None:
        value = run.attrs
        for key in parameter.split("."):
            value = value.get(key) if isinstance(value, Mapping) else None
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        raise RequestError(
            f"{name} does not state the parameter {parameter} as a number; received {value!r}. "
            f"Set run.attrs['{parameter}'], or take the model at a value: model.at(parameter=…)."
        )
    return float(value)


@dataclass(eq=False)
class _Opened:
    """A run that was checked, and what forecasts read of it.

    Parameters
    ----------
    run, name, time : Dataset, str, ndarray
        The run, its name and its instants, s.
    spans : list of Span
        Samples that forecasts read, before the map.
    futures : list of Drive
        What drives all of them; where inputs are predicted, then departures from these, of each
        input, and their opposites.
    known : int, optional
        Sample after which inputs are predicted.
    """

    run: xr.Dataset
    name: str
    time: FloatArray
    spans: list[Span] = field(default_factory=list)
    futures: list[Drive] = field(default_factory=list)
    known: int | None = None

    def instants(self, first: int, stop: int, dt: float) -> FloatArray:
        """Instants of samples, which may lie beyond the end of the run."""
        inside = self.time[first:stop]
        beyond = np.arange(1, stop - first - inside.size + 1)
        return np.concatenate([inside, self.time[-1] + dt * beyond])

    def span(self, signature: Signature, start: float, steps: int | None, predicts: bool) -> Span:
        """Samples of input that one more forecast reads, before the map."""
        time, dt, name = self.time, signature.dt, self.name
        at = labelled.nearest_sample(time, start, name)
        needed, lead = signature.history_samples, 0 if predicts else signature.lead_samples

        def shown(instant: float) -> str:
            return instant_text(instant, dt)

        if at + 1 < needed:
            near = abs(float(start) - time[at]) <= 1e-6 * dt
            snapped = "" if near else f" (nearest sample {shown(time[at])} s)"
            remedy = f"Start at {shown(time[0] + (needed - 1) * dt)} s or later."
            if time.size < needed:
                end = shown(time[-1])
                remedy = f"The run ends at {end} s: give a longer one, or fit with fewer delays."
            raise RequestError(
                f"start = {shown(float(start))} s{snapped} leaves {at + 1} samples of history in "
                f"{name} and the model needs {needed} (the start included): {needed - at - 1} are "
                f"missing. {remedy}"
            )
        available = time.size - 1 - at
        # The last input needed is the one an instant before the last state, and the lead after it.
        most = available + 1 - lead
        count = whole_number(
            available - max(lead - 1, 0) if steps is None else steps,
            "steps (to the end of the run)" if steps is None else "steps",
        )
        if signature.inputs and not predicts and count > most:
            ahead = f", of which the model's lead takes {lead}" if lead else ""
            raise RequestError(
                f"{count} steps from {shown(time[at])} s need the input up to "
                f"{shown(time[at] + (count - 1 + lead) * dt)} s and {name} ends at "
                f"{shown(time[-1])} s{ahead}. At most {max(most, 0)} steps can be forecast from "
                "there; ahead = 'predict' continues the input by linear prediction."
            )
        return Span(at - signature.input_delays, at, at + count)

    def drive(self, signature: Signature, predicts: bool) -> None:
        """Read what drives all forecasts of the run, once every span is known."""
        maps, names = signature.input_map, signature.inputs
        read = [maps.reads(span) for span in self.spans]
        first = min(each.first for each in read)
        stop = max(each.stop for each in read)
        surge = None
        if (follows := maps.follows) is not None:
            last = max(span.known for span in self.spans) + 1  # no later state is read
            channel, rows = [signature.states[follows.column]], slice(first, last)
            surge = labelled.channel_matrix(self.run, channel, self.name, rows)[:, 0]
        for run in self._continued(signature, first, stop) if predicts else [self.run]:
            values = np.empty((stop - first, 0))  # without inputs it may end after the run
            if names:
                values = labelled.channel_matrix(run, names, self.name, slice(first, stop))
            for each in read:
                wanted = values[each.first - first : each.stop - first]
                labelled.check_finite(wanted, names, run, self.name, each.first)
            self.futures.append(maps.drive(values, self.spans, run=run, first=first, surge=surge))

    def _continued(self, signature: Signature, first: int, stop: int) -> list[xr.Dataset]:
        """The run up to a sample, with what is missing of inputs predicted; then departures.

        The run as it is where nothing is missing, or something before a start: only the future
        is predicted.
        """
        start = max(span.known for span in self.spans)
        values = labelled.channel_matrix(self.run, signature.inputs, self.name, slice(stop))
        values = np.pad(values, ((0, stop - len(values)), (0, 0)), constant_values=np.nan)
        gaps = np.flatnonzero(~np.isfinite(values).all(axis=1))
        if gaps.max(initial=0) <= start or np.any((gaps >= first) & (gaps <= start)):
            return [self.run]
        if signature.input_map.reads_surge:
            raise RequestError(
                f"ahead = 'predict' continues inputs, and those of {self.name} are carried to the "
                "measured surge, which nothing continues. Forecast fewer steps, or fit a model "
                "with surge = 'predicted' or 'none'."
            )
        futures, missing, _ = fill_future(values, start + 1, foresight(signature, self.run))
        self.known = missing - 1
        names = [each for each in (*signature.inputs, *signature.states) if each in self.run]
        run = self.run[names].reindex(time=self.instants(0, stop, signature.dt))
        continued = []
        for future in futures:
            columns = zip(signature.inputs, future.T, strict=True)
            continued.append(run.assign({name: run[name].copy(data=x) for name, x in columns}))
        return continued


def foresight(signature: Signature, run: xr.Dataset | None = None) -> partial[Foreseen]:
    """:func:`seakeep.signals.prediction.foresee` with what is known of the probes in a run.

    Positions are NaN where none is known. Without a run they are those of training, if the model
    takes raw probes.
    """
    places: tuple[float | None, ...] = (None,)
    depth = math.nan
    if (alignment := signature.input_map.alignment) is not None:
        if run is not None or signature.input_map.follows is not None:
            _, places, depth = alignment.rig(run)
    elif run is not None:
        stated = [run.attrs.get("water_depth")]
        stated += [run[name].attrs.get("x_position") for name in signature.inputs]
        numbers = [float(x) if isinstance(x, int | float | np.number) else math.nan for x in stated]
        depth, places = numbers[0], tuple(numbers[1:])
    known = np.array(places, dtype=float)  # None becomes NaN
    positions = np.where(math.isnan(depth), math.nan, known)
    return partial(foresee, dt=signature.dt, positions=positions, depth=depth)


def array_windows(
    signature: Signature,
    histories: FloatArray,
    inputs: FloatArray,
    steps: int,
    rig: xr.Dataset | None = None,
) -> Windows:
    """Windows of plain arrays, inputs aligned already to a measured surge.

    Parameters
    ----------
    signature : Signature
        Of what forecasts.
    histories : ndarray, shape (window, history, N)
        States up to each start.
    inputs : ndarray, shape (window, history + steps − 1 + lead, Q)
        Inputs from the same sample on; the history of at least z + 1 samples.
    steps : int
        Instants forecast.
    rig : Dataset, optional
        Whose attributes state positions and depth for a model that follows its own surge; by
        default those of training.

    Returns
    -------
    Windows
        Without instants.
    """
    history = inputs.shape[1] - (steps - 1) - signature.lead_samples
    span = Span(history - 1 - signature.input_delays, history - 1, history - 1 + steps)
    follows = signature.input_map.follows
    drives = []
    for values, states in zip(inputs, histories, strict=True):
        surge = None
        if follows is not None:
            known = states[-history:, follows.column]
            surge = np.concatenate([np.full(history - len(known), np.nan), known])
        drives.append(signature.input_map.drive(values, [span], run=rig, surge=surge))
    return Windows(
        steps=steps,
        places=(("these arrays", 0.0),) * len(histories),
        **_series(signature, histories, drives, [span] * len(drives)),
    )


def linear_runs(
    members: Sequence[Dynamics],
    groups: Sequence[Windows],
    readouts: Sequence[FittedReadOut] = (),
) -> list[FloatArray]:
    """Free runs of linear members side by side, each (member, window, steps, N), physical units.

    Read-outs see each member's series when its run is done.
    """
    if any(windows.table is not None for windows in groups):
        runs = [_followed_runs(members, windows) for windows in groups]
    else:
        every = (
            open_runs(each.signature, groups, partial(rollouts, *each.matrices)) for each in members
        )
        runs = [np.stack(each) for each in zip(*every, strict=True)]
    for values, windows in zip(runs, groups, strict=True):
        if readouts:
            read_out(readouts, values, windows.waves)
        if windows.zero is not None:
            values += windows.zero[:, None]
    return runs


def _followed_runs(members: Sequence[Dynamics], windows: Windows) -> FloatArray:
    """Free runs step by step, where members follow their own surge; NaN from where one is lost."""
    assert windows.starts is not None
    assert windows.table is not None
    own = [each.signature for each in members]
    follows = own[0].input_map.follows
    assert follows is not None
    # Delays that a member does not have count nothing.
    s, z = max(each.state_delays for each in own), max(each.input_delays for each in own)
    N, n = windows.histories.shape[2], windows.table.shape[2]
    on_states = np.zeros((len(members), N, N * (s + 1)))
    on_inputs = np.zeros((len(members), N, n * (z + 1)))
    on_square = np.empty((len(members), N))
    histories = np.empty((len(members), *windows.histories.shape))
    forcing = np.empty((len(members), len(windows.histories), windows.steps, N))
    for k, each in enumerate(members):
        of, (a, b) = each.signature, each.matrices
        u, w, lags = of.input_scale, of.direct_scale, of.input_delays + 1
        on_states[k, :, : a.shape[1]] = a
        # On regressors in physical units; their means are part of what is constant.
        on_delayed, on_direct = b[:, : n * lags] / np.tile(u.std, lags), b[:, n * lags :] / w.std
        on_inputs[k, :, : n * lags] = on_delayed
        on_square[k] = on_direct[:, -1]
        np.matmul(windows.direct, on_direct[:, :-1].T, out=forcing[k])
        forcing[k] -= on_delayed @ np.tile(u.mean, lags) + on_direct @ w.mean
        histories[k] = of.state_scale.deviations(windows.histories)
    surges = [[of.state_scale.std, of.state_scale.mean] for of in own]
    gain, offset = np.array(surges)[..., follows.column].T
    models = Recursion(on_states, on_inputs, on_square, gain, offset, follows.column)
    known = windows.delayed.shape[1] - windows.steps
    delayed = windows.delayed[:, known - z : known]
    computed, used = recursion(
        models, follows.place, histories, delayed, windows.table, windows.starts, forcing
    )
    with undefined():  # a run that is lost is cut just below
        for values, drove, of in zip(computed, used, own, strict=True):
            driving = np.concatenate([delayed, drove], axis=1)
            of.state_scale.physical(values, out=values)
            cut_lost(values, of, replace(windows, delayed=driving))
    return computed


def open_runs(
    signature: Signature,
    groups: Sequence[Windows],
    run: Callable[[list[tuple[FloatArray, FloatArray, FloatArray]]], list[FloatArray]],
) -> list[FloatArray]:
    """Free runs over all windows as products of matrices, each (window, steps, N).

    Parameters
    ----------
    signature : Signature
        Delays and scales.
    groups : sequence of Windows
        What is read.
    run : callable
        Runs of batches of standardised states, delayed and direct regressors.
    """
    batches = []
    for windows in groups:
        steps = windows.steps
        driving = windows.delayed[:, windows.delayed.shape[1] - signature.input_delays - steps :]
        if not driving.shape[2]:
            driving = driving[:, :steps]
        history = signature.state_scale.deviations(
            windows.histories[:, -1 - signature.state_delays :]
        )
        direct = signature.direct_scale.deviations(windows.direct)
        batches.append((history, signature.input_scale.deviations(driving), direct))
    computed = run(batches)
    with undefined():  # a run that is lost is cut just below
        for windows, values in zip(groups, computed, strict=True):
            cut_lost(signature.state_scale.physical(values, out=values), signature, windows)
    return computed


def _excess(signature: Signature, windows: Windows) -> FloatArray:
    """Largest deviation of the input over that in training, at least one, shape (window, steps).

    What lies before a step counts less, by ``fading`` of each step in between.
    """
    z = signature.input_delays
    first = windows.delayed.shape[1] - z - windows.steps
    delayed, direct = (
        # The slow surge squared is no input.
        (np.abs(x - scale.centre[: x.shape[2]]) / scale.bound[: x.shape[2]]).max(axis=2, initial=1)
        for scale, x in (
            (signature.input_scale, windows.delayed[:, first:]),
            (signature.direct_scale, windows.direct),
        )
    )
    excess: FloatArray = np.maximum(delayed[:, z:], direct)
    last, fade = delayed[:, :z].max(axis=1, initial=1.0), fading(signature)
    for now in excess.T:
        last = now[:] = np.maximum(now, 1.0 + fade * (last - 1.0))
    return excess


def fading(signature: Signature) -> float:
    """Part that is left of an input's excess over the training after one step."""
    longest = max(signature.state_delays, signature.input_delays) + 1
    return 1.0 - 1.0 / (MEMORY * max(longest, LEAST))


def cut_lost(values: FloatArray, signature: Signature, windows: Windows) -> None:
    """NaN from where free runs (window, steps, N) are lost, in physical units; they are changed."""
    scale = signature.state_scale
    start = np.abs(windows.histories - scale.centre).max(axis=1, initial=0.0)
    reach = GROWTH * np.maximum(scale.bound, start)
    with undefined():
        farthest = np.zeros(values.shape[:2])
        for column, centre in enumerate(scale.centre):  # one after the other takes little room
            away = np.abs(values[..., column] - centre)
            np.maximum(farthest, away / reach[:, [column]], out=farthest)
        if not (farthest <= 1.0).all():
            lost = ~(farthest <= _excess(signature, windows))
            values[np.logical_or.accumulate(lost, axis=1)] = np.nan


Series = tuple[FloatArray, IntArray]


def member_series(
    model: Runs,
    groups: Sequence[Windows],
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> list[Series]:
    """Free runs of all members, in a temporary file where they take more than ``HELD`` bytes.

    Each member is identified once.

    Parameters
    ----------
    model : Runs
        A model, an ensemble, or members that are held.
    groups : sequence of Windows
        From :func:`read_groups`.
    executor, progress
        As in :meth:`HankelEnsemble.forecast`.

    Returns
    -------
    list of (series, lost), one of each group
        States in physical units, shape (member, window, steps, N), NaN from where a window is lost
        on; and the first instant lost, or −1, shape (member, window).

    Raises
    ------
    RequestError
        If the temporary folder has no room.
    """
    count = model.n_members
    runs: list[Series] = []
    for each in groups:
        windows, _, N = each.histories.shape
        lost = np.empty((count, windows), dtype=np.int64)
        runs.append((_room((count, windows, each.steps, N)), lost))
    # What members are centred on comes after them.
    total = count + model.is_centred
    together = 1
    if any(each.table is not None for each in groups):
        size = sum(series.nbytes for series, _ in runs) // count
        most = TOGETHER // max(len(each.histories) for each in groups)
        together = max(1, min(most, HELD // size))
    parts = [range(total)[at : at + together] for at in range(0, total, together)]
    computed = in_order(call, partial(model.free_runs, groups), parts, executor)
    for part, every in zip(parts, computed, strict=True):
        number = min(part.stop, count)
        if progress:
            progress(number, count, f"member {number}")
        for (series, lost), values in zip(runs, every, strict=True):
            members = values[: count - part.start]
            series[part.start : number] = members
            lost[part.start : number] = first_lost(members)
            if part.stop > count:
                _centre(series, lost, values[-1])
    return runs


def _centre(series: FloatArray, lost: IntArray, runs: FloatArray) -> None:
    """Move members, shape (member, window, steps, N), so that their mean is a single model's run.

    Members that are lost in a window count in none of it. Where the single model is lost, the
    members stay where they are.
    """
    complete, mean = lost < 0, np.zeros(runs.shape)
    for own, here in zip(series, complete, strict=True):
        mean[here] += own[here]
    shift = runs - mean / np.maximum(np.count_nonzero(complete, axis=0), 1)[:, None, None]
    shift[~np.isfinite(shift).all(axis=(1, 2))] = 0.0
    series += shift


def _room(shape: tuple[int, ...]) -> FloatArray:
    """Array for member series, in a file without a name, which goes with it, where it is large."""
    size = 8 * math.prod(shape)
    if size <= HELD:
        return np.empty(shape)
    try:
        with tempfile.TemporaryFile(prefix="seakeep-") as file:
            if hasattr(os, "posix_fallocate"):  # a full disk is reported now, not by a signal
                os.posix_fallocate(file.fileno(), 0, size)
            return np.memmap(file, dtype=np.float64, mode="w+", shape=shape)
    except OSError as error:
        raise RequestError(
            f"cannot keep {size / 2**20:.0f} MiB of members in the temporary folder "
            f"{tempfile.gettempdir()}: {error.strerror or error}. Free space there, name a "
            "folder on another disk in the environment variable TMPDIR, or ask for fewer "
            "steps, windows or members at a time."
        ) from error


def first_lost(values: FloatArray) -> IntArray:
    """First instant at which a channel is NaN, or −1, of values (…, steps, N)."""
    gone: BoolArray = np.isnan(values.sum(axis=-1))
    return np.where(gone.any(axis=-1), gone.argmax(axis=-1), -1)
