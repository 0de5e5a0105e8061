"""Residuals: whiteness, past inputs, spectrum, bands, and age of the forecast."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, FloatArray, ratio
from seakeep.check.parts import (
    HERTZ,
    FreeRun,
    Known,
    free_runs,
    gathered,
    judged,
    window_of,
)
from seakeep.core.spectra import autocorrelation, cross_spectra, input_correlation, ljung_box
from seakeep.errors import DataError
from seakeep.models import Model
from seakeep.models.labelled import channel_matrix, mean_period

BANDS = {"slow": (0.0, 0.5), "wave": (0.5, 2.0), "above": (2.0, np.inf)}
"""Bands, in cycles per encounter period."""
SEGMENT = 8
"""Encounter periods of a segment of the spectra, at most."""
AGES = 15
"""Encounter periods over which a forecast grows old."""


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
        both = model.judged_runs(run, name, range(first, last), 1)
        forecasts, measured = (each[:, 0] for each in both)
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

    def aged(name: str) -> FloatArray:
        """Squared errors over the time since each of several starts, (window, steps, N)."""
        run = runs[name]
        first, last = window_of(model, run)
        count = min(AGES * lags, last - first)
        starts = range(first, last - count + 1, lags)
        forecasts, measured = model.judged_runs(run, name, starts, count)
        squares = np.full((len(starts), AGES * lags, len(model.states)), np.nan)
        squares[:, :count] = (forecasts - measured) ** 2
        return squares

    every, inputs, measured = zip(*stepped.values(), strict=True)
    squares = np.concatenate([aged(name) for name in stepped])
    counted = np.isfinite(squares).sum(axis=0)
    by_age = ratio(np.nan_to_num(squares, nan=0.0, posinf=0.0).sum(axis=0), counted)
    count = sum(map(len, every))
    if count <= 2 * lags:
        raise DataError(
            f"the test parts hold {count} instants, and whiteness over an encounter period takes "
            f"more than {2 * lags}. Test on longer runs."
        )
    correlation = autocorrelation(every, lags)
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
