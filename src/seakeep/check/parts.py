"""Data of the checks: test parts of runs without gaps, and free runs over them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple, TypeVar

import numpy as np
import xarray as xr

from seakeep.arrays import BoolArray, Datasets, FloatArray, Groups
from seakeep.conventions import MOTIONS, in_waves, is_elevation
from seakeep.errors import DataError, RequestError, SeakeepError, quiet, warn
from seakeep.models import HankelDMDcModel, InputMap, Model, is_ensemble
from seakeep.models.labelled import Span, channel_matrix, nearest_sample, run_step
from seakeep.models.observables import at_once
from seakeep.models.registry import is_linear
from seakeep.signals.time_axis import inside, stretches
from seakeep.signals.waves import first_wave
from seakeep.waves import wavenumber

T = TypeVar("T")


class Part(NamedTuple):
    """The longest stretch without gaps of what a campaign uses of a run, in physical units.

    Attributes
    ----------
    run : Dataset
        The whole run.
    time : ndarray, shape (time,)
        Instants, s.
    states, inputs : ndarray, shape (time, channel)
        Inputs are aligned as the model aligns them.
    """

    run: xr.Dataset
    time: FloatArray
    states: FloatArray
    inputs: FloatArray


class FreeRun(NamedTuple):
    """A free run over a test part, and the measurement at its instants.

    Attributes
    ----------
    time : ndarray, shape (time,)
    forecast, measured : ndarray, shape (time, N)
        For an ensemble the mean of its members.
    """

    time: FloatArray
    forecast: FloatArray
    measured: FloatArray


HERTZ = {"units": "Hz", "long_name": "frequency"}
Known = dict[str, dict[str, FreeRun]]
"""Free runs that several checks share, by label of a baseline ("" is the model) and run."""


def is_regular(run: xr.Dataset) -> bool:
    """Whether a run states that its waves are regular."""
    return bool(run.attrs.get("waves") == "regular")


def irregular(runs: Datasets, what: str) -> Groups:
    """Runs that are not regular; an error says what cannot be had without them."""
    skipped = {name: run for name, run in runs.items() if not is_regular(run)}
    if not skipped:
        why = f"all runs ({', '.join(runs)}) are in regular waves, which hold one frequency each"
        raise DataError(
            f"{why if runs else 'no run is in waves'}: {what} takes a run in irregular waves."
        )
    return skipped


def uses_of(run: xr.Dataset) -> list[str]:
    """What a run serves, "train" or "test": as its spans say, else its role, else a test."""
    spans = [use for use in ("train", "test") if f"{use}_span" in run.attrs]
    return spans or ["train" if run.attrs.get("role") == "train" else "test"]


def of_part(runs: Datasets, part: str) -> Groups:
    """Runs in waves that train ("train") or test ("test"), with the span of this use alone."""
    other, parts = {"train": "test_span", "test": "train_span"}[part], {}
    for name, run in in_waves(runs).items():
        if part in uses_of(run):
            parts[name] = run.copy(deep=False)
            parts[name].attrs.pop(other, None)
    return parts


def judged(runs: Datasets) -> tuple[Groups, str]:
    """Tests, or what trains where there is none, and the word for it."""
    tests = of_part(runs, "test")
    return (tests, "tests") if tests else (of_part(runs, "train"), "training")


def used_parts(model: Model, runs: Datasets) -> dict[str, Part]:
    """Parts of runs in waves that train or test; a run that cannot be used warns."""
    parts = {}
    for name, run in in_waves(runs).items():
        run_step(run, name, model.dt)
        time = run["time"].values
        states = channel_matrix(run, model.states, name)
        try:
            aligned = model.aligned_inputs(run) if is_linear(model) else run
            inputs = channel_matrix(aligned, model.inputs, name)
        except DataError as error:
            warn(f"{name} is left out: {error}")
            continue
        whole = np.isfinite(states).all(axis=1) & np.isfinite(inputs).all(axis=1)
        pieces = stretches(whole & inside(time, whole_span(run), model.dt))
        if not pieces:
            warn(f"{name} is left out: no sample of it has all channels of the model.")
            continue
        first, stop = max(pieces, key=lambda piece: piece[1] - piece[0])
        parts[name] = Part(run, time[first:stop], states[first:stop], inputs[first:stop])
    return parts


def free_runs(
    model: Model,
    runs: Datasets,
    free: Known | None = None,
    label: str = "",
    like: Mapping[str, FreeRun] | None = None,
    others: Iterable[Model] = (),
) -> dict[str, FreeRun]:
    """Free runs from the first possible instant of each test part to its end, or as others go.

    Those in `free`, by label of the model and name of the run, are taken from there; the others
    are put there. They start where `others` can be forecast too, if the run is long enough.

    Raises
    ------
    DataError
        If no run can be forecast, with the reason of each.
    """
    known = ({} if free is None else free).setdefault(label, {})

    def played(name: str) -> FreeRun:
        if name in known:
            return known[name]
        run = runs[name]
        if like:
            time, _, measured = like[name]
        else:
            at, last = window_of(model, run, [each.history_samples for each in others])
            time = run["time"].values[at + 1 : last + 1]
            measured = channel_matrix(run, model.states, name, slice(at + 1, last + 1))
        start = float(time[0]) - model.dt
        if is_ensemble(model):
            forecast = model.forecast_summary(run, start, len(time)).sel(statistic="mean")
        else:
            forecast = model.forecast(run, start, len(time))
        known[name] = FreeRun(time, channel_matrix(forecast, model.states, name), measured)
        return known[name]

    names = runs if like is None else like
    return gathered(names, played, "no run can be forecast.", "left out:")


def gathered(
    names: Iterable[str], make: Callable[[str], T], none: str, left_out: str
) -> dict[str, T]:
    """What is made of each name; one that fails warns.

    Raises
    ------
    DataError
        If all fail, with the reason of each.
    """
    results, reasons = {}, []
    for name in names:
        try:
            results[name] = make(name)
        except SeakeepError as error:
            reasons.append(f"{name}: {error}")
    if not results:
        raise DataError(" ".join([none, *reasons]))
    for reason in reasons:
        warn(f"{left_out} {reason}")
    return results


def deviations(runs: Mapping[str, FreeRun], kind: str) -> list[FloatArray]:
    """Forecast or measurement ("forecast", "measured") of each free run, less its mean."""
    return [x - x.mean(axis=0) for x in (getattr(run, kind) for run in runs.values())]


def no_energy(names: str) -> DataError:
    """Error of inputs that are constant."""
    return DataError(f"{names} holds no energy: it is constant. Look for a dead probe.")


def read_off(model: Model) -> list[int]:
    """Columns of states that read-outs make of other states."""
    return [each.column for each in model.signature.readouts if each.acts]


def driven(
    input_map: InputMap,
    inputs: FloatArray,
    run: xr.Dataset | None,
    first: int,
    stop: int,
    surge: FloatArray | None = None,
) -> FloatArray:
    """What an input map makes of inputs from `first` to before `stop`, side by side."""
    drive = input_map.drive(inputs, [Span(first, first, stop)], run=run, surge=surge)
    return np.concatenate(drive.rows(first, stop), axis=1)


def beside(
    baselines: Mapping[str, Model] | None,
    runs: Datasets,
    own: Mapping[str, FreeRun],
    free: Known | None,
) -> dict[str, dict[str, FreeRun]]:
    """Free runs of baselines over those of a model; one that lacks a run is left out."""
    others = {}
    for label, each in (baselines or {}).items():
        with quiet(), suppress(DataError):
            others[label] = free_runs(each, runs, free, label, own)
    return {label: of for label, of in others.items() if of.keys() == own.keys()}


def linear_part(model: Model) -> HankelDMDcModel | None:
    """A model without its observables and read-outs, of an ensemble a member.

    None where the rest is no linear map of the inputs, as where it follows its own surge.
    """
    member = model.member(0) if is_ensemble(model) else model
    if not is_linear(member) or member.variation or member.signature.input_map.follows:
        return None
    signature = member.signature
    delayed, direct = signature.input_map.regressors(signature.input_labels)
    waves = np.tile(np.arange(len(delayed)) < len(member.inputs), signature.input_delays + 1)
    states = member.coefficients.shape[1] - waves.size - len(direct)
    stays = np.concatenate([np.ones(states), waves, np.zeros(len(direct))])
    return replace(
        member, coefficients=member.coefficients * stays, signature=replace(signature, readouts=())
    )


def window_of(model: Model, run: xr.Dataset, further: Iterable[int] = ()) -> tuple[int, int]:
    """First sample of a run that a forecast of its test part may start from, and the last sample.

    It leaves room for `further` histories that are at most half as long as the run.

    Raises
    ------
    DataError
        If the test part ends before.
    """
    history, lead = model.history_samples, model.signature.lead_samples
    history = max(history, *(each for each in further if 2 * each <= run.sizes["time"]), 0)
    if run.sizes["time"] <= history:
        raise DataError(
            f"the run has {run.sizes['time']} samples and a forecast reads {history} before "
            "its first. Give a longer run."
        )
    names = [*model.states, *model.inputs]
    at, last = samples_in(run, names, whole_span(run), model.dt, history, lead)
    if last - at < 8:  # as errors with intervals take
        raise DataError("its test part ends before the first forecast. Give a longer run.")
    return at, last


def samples_in(
    run: xr.Dataset,
    names: Iterable[str],
    span: tuple[float, float],
    dt: float,
    history: int,
    lead: int,
    start: float | None = None,
) -> tuple[int, int]:
    """First sample that a forecast of a span may start from, or that of `start`, and the last.

    Before the waves have come to the probes and the vessel among the channels `names`, a constant
    is as good a forecast as any.
    """
    time = run["time"].values
    last = int(np.searchsorted(time, span[1] + 0.5 * dt)) - 1
    # The last step reads the input `lead` samples after the instant that it starts from.
    last = min(last, time.size - max(lead, 1))
    if start is None:
        first = time[min(max(history - 1, _waves_come(run, names)), time.size - 1)]
        start = max(span[0], first)
    return nearest_sample(time, start, str(run.attrs.get("run", "the run"))), last


def _waves_come(run: xr.Dataset, names: Iterable[str]) -> int:
    """Sample at which waves have come to each probe, and each motion has begun."""
    begins = [0]
    for name in names:
        if is_elevation(name) or name in MOTIONS:
            series = run[name].values
            if np.isfinite(series).all() and np.ptp(series):
                begins.append(first_wave(series, name in MOTIONS))
    return max(begins)


def whole_span(run: xr.Dataset, *uses: str) -> tuple[float, float]:
    """Span of a run that has one of the uses, by default training or testing; or all of it."""
    time = run["time"].values
    keys = [f"{use}_span" for use in uses or ("train", "test")]
    known = [run.attrs[key] for key in keys if key in run.attrs]
    begins, ends = zip(*(known or [(time[0], time[-1])]), strict=True)
    return float(min(begins)), float(max(ends))


def regressors(model: Model, part: Part) -> FloatArray:
    """Columns that drive a model over a part: inputs, then observables, each at the instant itself.

    Leads and lags add nothing to a coherence, and cost some of it in segments of finite length.

    Returns
    -------
    ndarray, shape (time, column)
        NaN where a row reads what is not there.
    """
    # Without look-ahead and lags, and without limits of what is above training.
    input_map = model.signature.input_map
    follows, observed = input_map.follows, input_map.observed
    observed = replace(observed, observables=tuple(map(at_once, observed.observables)), tops=())
    still = replace(follows, lead=0) if follows else None
    input_map = replace(input_map, lead=0, observed=observed, follows=still, reference=0)
    run = part.run.sel(time=part.time)
    size, reach = run.sizes["time"], input_map.reads(Span(0, 0, 1))
    first, stop = -reach.first, size - (reach.stop - 1)
    width = sum(map(len, input_map.regressors(model.signature.input_labels)))
    out = np.full((size, width), np.nan)
    if stop > first:
        values, surge = channel_matrix(run, model.inputs, "the run"), None
        if follows:
            surge = channel_matrix(run, [model.states[follows.column]], "the run")[:, 0]
        out[first:stop] = driven(input_map, values, run, first, stop, surge)
    return out


def single_model(model: Model) -> HankelDMDcModel:
    """The model itself, where it is one of delayed states and inputs.

    One that varies with a parameter is taken in the middle of its training, and a warning says so;
    one of departures from the means before each start as these departures.
    """
    if not is_linear(model):
        raise RequestError(
            "response, free motion and second order are read off the matrices of one Hankel, ARX "
            f"or FIR model; received one of kind '{model.kind}'. For free motion of an ensemble, "
            "check a member: seakeep.check.modes(ensemble.member(0))."
        )
    if varies := model.variation:
        warn(
            f"the model varies with {model.signature.parameter}: what is shown is the one in the "
            f"middle of the training, {varies.centre:g}."
        )
        model = model.at(parameter=varies.centre)
    if not (input_map := model.signature.input_map).reference:
        return model
    signature = replace(model.signature, input_map=replace(input_map, reference=0))
    return replace(model, signature=signature)


def reference_probe(model: Model, runs: Datasets) -> int:
    """Input that waves are counted from: the elevation that stands farthest downstream.

    Raises
    ------
    RequestError
        If no input is a wave elevation.
    """
    waves = elevations(model)
    if not waves.any():
        raise RequestError(
            "no input of the model is a wave elevation (inputs: "
            f"{', '.join(model.inputs) or 'none'}): there is no wave to count a response from. "
            "Name elevations eta_…, in metres."
        )
    places = positions(model, runs)
    if places is None:
        return int(np.flatnonzero(waves)[-1])
    return int(np.argmax(np.where(waves, places, -np.inf)))


def elevations(model: Model) -> BoolArray:
    """Which inputs are wave elevations."""
    return np.array([is_elevation(name) for name in model.inputs], dtype=bool)


def positions(model: Model, runs: Datasets) -> FloatArray | None:
    """Position of each elevation, m (NaN of another input); None where one is not stated."""
    waves = elevations(model)
    for run in runs.values():
        places = np.array([run[name].attrs.get("x_position", np.nan) for name in model.inputs])
        if np.isfinite(places[waves]).all():
            return places
    return None


def wave_turns(
    model: Model, runs: Datasets, frequency: FloatArray, reference: int
) -> FloatArray | None:
    """Phase of the wave at each input behind that at the reference, rad, by linear dispersion.

    Returns
    -------
    ndarray, shape (frequency, input), or None
        NaN for an input that is no elevation; None where the positions or the water depth are
        not stated.
    """
    places = positions(model, runs)
    depths = [run.attrs["water_depth"] for run in runs.values() if "water_depth" in run.attrs]
    if places is None or not depths:
        return None
    k = wavenumber(2 * np.pi * frequency, depths[0])
    return k[:, None] * (places - places[reference])


def units_of(model: Model, names: Sequence[str]) -> list[str]:
    """SI units of states or inputs of a model."""
    signature = model.signature
    labels = {each.name: each.units for each in signature.state_labels + signature.input_labels}
    return [labels[name] for name in names]
