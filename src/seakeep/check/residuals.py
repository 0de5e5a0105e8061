"""What is left unexplained: by any linear model of the inputs, and by the model itself.

Coherence of inputs and states gives the error that no linear model of the inputs goes below.
Residuals are judged by whiteness, past inputs, spectrum, bands, and age of the forecast.
"""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, FloatArray, ratio, undefined
from seakeep.check.parts import (
    HERTZ,
    FreeRun,
    Known,
    beside,
    deviations,
    free_runs,
    gathered,
    irregular,
    judged,
    linear_part,
    read_off,
    regressors,
    used_parts,
    window_of,
)
from seakeep.core.spectra import (
    Spectra,
    autocorrelation,
    cross_spectra,
    dominant_frequency,
    input_correlation,
    ljung_box,
    segment_length,
)
from seakeep.errors import DataError, RequestError
from seakeep.models import Model
from seakeep.models.labelled import channel_matrix, mean_period

LONGEST = 64
"""Most encounter periods of a segment of Welch's method: long ones resolve a lightly damped
response."""
AVERAGES = 10
"""Independent segments per input, and one more, that are kept where the records are long enough."""


def coherence(
    model: Model,
    runs: Datasets,
    free: Known | None = None,
    baselines: Mapping[str, Model] | None = None,
) -> xr.Dataset:
    r"""Coherence of inputs and states, and the NRMSE that no linear map of the inputs goes below.

    Parameters
    ----------
    model : Model
        Names the channels, aligns the waves, and is judged beside the bound.
    runs : mapping of str to Dataset
        Prepared runs; tests in irregular waves are taken, or what trains where no run tests.
    free : dict, optional
        Free runs that other checks of the same model and runs made; this one adds its own.
    baselines : mapping of str to Model, optional
        Linear models of the same states, which sharpen the bound (see the notes).

    Returns
    -------
    Dataset
        Over (state, input, frequency): ``ordinary`` coherence; over (state, frequency):
        ``multiple`` coherence with all inputs, corrected for what q inputs explain by chance (not
        below that with one input), and
        ``spectrum`` of the state; over state: ``linear_bound`` with ``linear_bound_lower`` and
        ``linear_bound_upper`` (95 %), and ``nrmse`` and ``correlation`` of the model's free runs,
        pooled, all NaN where the state stands ``still`` (below 1 % of its SD in training); bounds
        are NaN where its dominant ``period`` (s) exceeds a third of a segment. With
        observables also ``multiple_observables`` and ``observables_bound`` with its interval, of
        inputs and observables together. ``attrs``: ``averages`` (independent segments),
        ``segment`` (s), ``observables`` (their names) and ``of`` ("tests" or "training").

    Raises
    ------
    DataError
        If no run is in irregular waves, or the records are too short.
    RequestError
        If the model has no input.

    Notes
    -----
    Segments have 16 to 64 encounter periods, as long as there are ten of them per input and one
    more. A segment resolves a lightly damped response, or a long delay between probe and vessel,
    incompletely, so that coherence is lost to leakage. What no linear map of the inputs explains
    of a state x, none explains of :math:`e = x - Lu` either, whatever the linear map L; and little
    is left in e that could leak. The bound is therefore

    .. math:: \min_L \sqrt{\frac{\operatorname{var} e}{\operatorname{var} x}
              \frac{\int (1 - \gamma_{ue}^2) S_{ee}}{\int S_{ee}}}

    over L = 0, the baselines, and what the model makes of the inputs without observables and
    read-outs: it lies above the error of none of them that is linear. The interval is that of the
    part that is left. Slow motions count with all their power.
    """
    if not model.inputs:
        raise RequestError("the model has no input, with which a state could be coherent.")
    runs, of = judged(runs)
    waves = irregular(runs, "coherence")
    own = free_runs(model, waves, free, others=(baselines or {}).values())
    parts = {name: part for name, part in used_parts(model, waves).items() if name in own}
    names = [name for name in model.signature.regressors if name not in model.inputs]
    linear = not names and not read_off(model)
    others = [*beside(baselines, waves, own, free).values()]
    bounding: list[dict[str, FreeRun]] = []
    if linear:
        bounding = [own]
    elif plain := linear_part(model):
        bounding = [free_runs(plain, waves, like=own)]
    # Baselines take the observables of the model: then they bound no linear map.
    references = [*bounding, *others, *([] if linear else [own])]
    bounding += [] if names else others
    pieces = []
    for name, part in parts.items():
        columns = regressors(model, part)
        whole = np.isfinite(columns).all(axis=1)
        ours, theirs = (np.round(t / model.dt) for t in (part.time[whole], own[name].time))
        _, at, to = np.intersect1d(ours, theirs, return_indices=True)
        x = part.states[whole][at]
        left = [x, *(x - each[name].forecast[to] for each in references)]
        pieces.append((columns[whole][at], np.concatenate(left, axis=1)))
    period = mean_period(waves, model.inputs)
    samples = sum(len(columns) for columns, _ in pieces)
    segment = segment_length(samples, AVERAGES * (len(model.inputs) + 1), period, LONGEST)
    further = cross_spectra(pieces, model.dt, segment)
    spectra = further.of_first(len(model.inputs))
    if not spectra.input_power.max() > 0:
        raise DataError(
            f"the inputs ({', '.join(model.inputs)}) hold no energy: they are constant. Look for a "
            "dead probe."
        )
    over, size = ("state", "frequency"), len(model.states)
    spreads = sum(((x - x.mean(axis=0)) ** 2).sum(axis=0) for _, x in pieces)
    still = np.sqrt(spreads[:size] / samples) < 0.01 * model.signature.state_scale.spread
    wave = max((x[:, :size] for _, x in pieces), key=len)
    slow = np.array([
        np.nan if each else 1 / dominant_frequency(wave[:, k], model.dt)
        for k, each in enumerate(still)
    ])  # fmt: skip
    unjudged = still | (slow > segment * model.dt / 3)
    nrmse, correlation = _skill(own)
    variables = {
        "ordinary": (("state", "input", "frequency"), spectra.ordinary()[..., :size].T),
        "spectrum": (over, spectra.outputs[:, :size].T),
        "nrmse": ("state", np.where(still, np.nan, nrmse)),
        "correlation": ("state", np.where(still, np.nan, correlation)),
        "still": ("state", still),
        "period": ("state", slow, {"units": "s"}),
    }
    bounds = {"linear_bound": ("multiple", spectra, len(bounding) + 1)}
    if names:
        bounds["observables_bound"] = ("multiple_observables", further, len(references) + 1)
    least = spectra.ordinary()[..., :size].max(axis=1).T
    for bound, (multiple, of_all, count) in bounds.items():
        ends, alike = _bound(of_all, spreads, size, count)
        for key, values in zip(("", "_lower", "_upper"), ends, strict=True):
            variables[f"{bound}{key}"] = ("state", np.where(unjudged, np.nan, values))
        least = np.maximum(alike, least)
        variables[multiple] = (over, least)
    return xr.Dataset(
        variables,
        coords={
            "state": model.states,
            "input": model.inputs,
            "frequency": ("frequency", spectra.frequency, HERTZ),
        },
        attrs={
            "averages": spectra.averages,
            "segment": segment * model.dt,
            "observables": ", ".join(names),
            "of": of,
        },
    )


def _bound(
    spectra: Spectra, spreads: FloatArray, size: int, count: int
) -> tuple[FloatArray, FloatArray]:
    """Bound with its interval, (3, state), and multiple coherence, (state, frequency).

    Outputs are the states and what `count` - 1 references leave of them, one after the other;
    `spreads` are their squares.
    """
    share = spectra.share().reshape(3, -1, size)[:, :count]
    with undefined():
        error = np.sqrt(share * spreads.reshape(-1, size)[:count] / spreads[:size])
    best = np.argmin(np.where(np.isfinite(error[0]), error[0], np.inf), axis=0), np.arange(size)
    rest = spectra.unexplained().reshape(len(spectra.frequency), -1, size)[:, *best]
    power = spectra.outputs[:, :size]
    alike = 1 - ratio(rest, power, 1.0)
    return np.minimum(error[:, *best], 1.0), np.clip(alike, 0, 1).T


def _skill(runs: Mapping[str, FreeRun]) -> tuple[FloatArray, FloatArray]:
    """NRMSE of each state over all free runs, and correlation of forecast and measurement."""
    errors = np.concatenate([run.forecast - run.measured for run in runs.values()])
    forecast, moved = (np.concatenate(deviations(runs, k)) for k in ("forecast", "measured"))
    power = (moved**2).sum(axis=0)
    norms = np.sqrt((forecast**2).sum(axis=0) * power)
    nrmse = np.sqrt(ratio((errors**2).sum(axis=0), power))
    return nrmse, ratio((forecast * moved).sum(axis=0), norms)


BANDS = {"slow": (0.0, 0.5), "wave": (0.5, 2.0), "above": (2.0, np.inf)}
"""Bands, in cycles per encounter period."""
SEGMENT = 8
"""Encounter periods of a segment of the spectra, at most."""
AGES = 15
"""Encounter periods over which a forecast grows old."""
AT_ONCE = 1024
"""Forecasts of one step that are made at once: each reads a history of its own."""


def residuals(model: Model, runs: Datasets, free: Known | None = None) -> xr.Dataset:
    r"""Test the errors of one step, and say where and when those of free runs arise.

    Parameters
    ----------
    model : Model
        The model.
    runs : mapping of str to Dataset
        Prepared runs; tests are taken, or what trains where no run tests.
    free : dict, optional
        Free runs that other checks of the same model and runs made; this one adds its own.

    Returns
    -------
    Dataset
        Of errors of one step: ``autocorrelation`` over (state, lag), ``limit`` (95 % of white
        noise), ``ljung_box`` and its ``probability`` over state, up to one encounter period;
        ``input_correlation`` over (state, input, lag) with past inputs and ``input_limit`` over
        (state, input); ``one_step`` over state, their NRMSE. Of free runs over the test parts:
        ``error_spectrum`` and ``measured_spectrum`` over (state, frequency); ``band_nrmse`` over
        (state, band), in SDs of the whole state, bands below 0.5, to 2 and above 2 cycles per
        encounter period; ``age_nrmse`` over (state, age): the error against the time since the
        start, from starts an encounter period apart.

    Raises
    ------
    DataError
        If no run can be judged, with the reason of each.

    Warns
    -----
    SeakeepWarning
        Of each run that is left out, with the reason.
    """
    runs, of = judged(runs)
    known = free_runs(model, runs, free)
    period = mean_period(runs, model.inputs) * model.dt
    lags = round(period / model.dt)

    def one_step(name: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Errors of one step over the test part, inputs and measured states at its instants."""
        run = runs[name]
        first, last = window_of(model, run)
        both = [
            model.judged_runs(run, name, range(at, min(at + AT_ONCE, last)), 1)
            for at in range(first, last, AT_ONCE)
        ]
        forecasts, measured = (np.concatenate(each)[:, 0] for each in zip(*both, strict=True))
        inputs = channel_matrix(run, model.inputs, name, slice(first + 1, last + 1))
        sound = np.isfinite(forecasts).all(axis=1) & np.isfinite(measured).all(axis=1)
        if sound.sum() < 2:
            raise DataError("the model diverges, or nothing is measured.")
        return (forecasts - measured)[sound], inputs[sound], measured[sound]

    stepped = gathered(
        known,
        one_step,
        "no run can be judged. One-step errors of",
        "left out: one-step errors of",
    )

    # Squared errors over the time since each of several starts, (steps, N), and how many.
    squares, counted = np.zeros((2, AGES * lags, len(model.states)))
    for name in stepped:
        run = runs[name]
        first, last = window_of(model, run)
        count = min(AGES * lags, last - first)
        starts = range(first, last - count + 1, lags)
        forecasts, then = model.judged_runs(run, name, starts, count)
        errors = (forecasts - then) ** 2
        counted[:count] += np.isfinite(errors).sum(axis=0)
        squares[:count] += np.nan_to_num(errors, nan=0.0, posinf=0.0).sum(axis=0)
    every, inputs, measured = zip(*stepped.values(), strict=True)
    count = sum(map(len, every))
    if count <= 2 * lags:
        raise DataError(
            f"the test parts hold {count} instants, and whiteness over an encounter period takes "
            f"more than {2 * lags}. Test on longer runs."
        )
    correlation = autocorrelation(every, lags)
    by_age = ratio(squares, counted)
    statistic, probability = ljung_box(correlation, count)
    spread = np.sqrt(np.mean(np.concatenate([m - m.mean(axis=0) for m in measured]) ** 2, axis=0))
    whole = np.concatenate(every)
    variables = {
        "autocorrelation": (("state", "lag"), correlation.T),
        "limit": ((), 1.96 / np.sqrt(count)),
        "ljung_box": ("state", statistic),
        "probability": ("state", probability),
        "one_step": ("state", ratio(np.sqrt(np.mean(whole**2, axis=0)), spread)),
        **_of_free_runs(model, known, period),
        "age_nrmse": (("state", "age"), ratio(np.sqrt(by_age), spread).T),
    }
    if model.inputs:
        past, limit = input_correlation([*zip(every, inputs, strict=True)], lags)
        variables["input_correlation"] = (("state", "input", "lag"), past.transpose(1, 2, 0))
        variables["input_limit"] = (("state", "input"), limit)
    return xr.Dataset(
        variables,
        coords={
            "state": model.states,
            "input": model.inputs,
            "lag": ("lag", model.dt * np.arange(lags + 1), {"units": "s", "long_name": "lag"}),
            "age": ("age", model.dt * np.arange(1, AGES * lags + 1), {"units": "s"}),
            "band": list(BANDS),
        },
        attrs={"instants": count, "encounter_period": period, "of": of},
    )


def _of_free_runs(model: Model, free: Mapping[str, FreeRun], period: float) -> dict[str, object]:
    """Spectra of error and measurement, and the errors of the bands."""
    pieces = []
    for each in free.values():
        error = each.forecast - each.measured
        sound = np.isfinite(error).all(axis=1)
        pieces.append((error[sound], each.measured[sound]))
    segment = min(round(SEGMENT * period / model.dt), max(len(e) for e, _ in pieces))
    if segment < 16:
        raise DataError(
            f"free runs hold for {segment} instants at most: there is no spectrum of their error."
        )
    spectra = cross_spectra(pieces, model.dt, segment)
    error, power = spectra.input_power, spectra.outputs
    cycles = spectra.frequency * period
    total = power.sum(axis=0)
    bands = [
        np.sqrt(ratio(error[(cycles >= low) & (cycles < high)].sum(axis=0), total))
        for low, high in BANDS.values()
    ]
    return {
        "error_spectrum": (("state", "frequency"), error.T),
        "measured_spectrum": (("state", "frequency"), power.T),
        "frequency": ("frequency", spectra.frequency, HERTZ),
        "band_nrmse": (("state", "band"), np.stack(bands, axis=1)),
    }
