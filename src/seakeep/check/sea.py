"""Validity: where the waves of each test lie against those that trained the model."""

from __future__ import annotations

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets
from seakeep.check.parts import is_regular, no_energy, reference_probe, used_parts
from seakeep.core.harmonics import dominant_frequency
from seakeep.errors import DataError
from seakeep.models import Model, outside_training
from seakeep.signals import encounter_period
from seakeep.waves import wavenumber


def validity(model: Model, runs: Datasets) -> xr.Dataset:
    """Height, period, steepness and drift of each run, and what lies outside the training.

    Parameters
    ----------
    model : Model
        The model; it keeps which spans trained it, and the periods of its waves.
    runs : mapping of str to Dataset
        Prepared runs, those that trained the model among them.

    Returns
    -------
    Dataset
        Over (run, part), part "train" or "test": ``height`` (m; four SDs, of regular waves twice
        the root of two), ``period`` (s; mean zero-up-crossing), ``steepness`` (height over wave
        length, NaN where the water depth is not known) and ``drift`` (mean surge, m, NaN without
        surge), NaN of a part that a run does not have; over run: ``waves`` and ``outside``, in
        words what of its test lies outside the training, or an empty text.

    Raises
    ------
    DataError
        If no run can be read, or the probe is constant.
    RequestError
        If no input is a wave elevation.
    """
    reference = reference_probe(model, runs)
    surge = model.states.index("surge") if "surge" in model.states else None
    parts, facts, outside = used_parts(model, runs), [], []
    for name, part in parts.items():
        trained = model.training_spans.get(name)
        tested = part.run.attrs.get("test_span")
        if tested is None and trained is None:
            tested = (part.time[0], part.time[-1])
        of_parts = np.full((2, 4), np.nan)
        for row, span in zip(of_parts, (trained, tested), strict=True):
            begin, end = (np.inf, -np.inf) if span is None else span
            inside = (part.time >= begin - 1e-6) & (part.time <= end + 1e-6)
            if inside.sum() >= 16:
                row[:3] = _sea(part.inputs[inside, reference], model.dt, part.run)
                row[3] = np.nan if surge is None else part.states[inside, surge].mean()
        facts.append(of_parts)
        outside.append(_outside(model, part.run, np.isfinite(of_parts[1, 1])))
    if not parts:
        raise DataError("no run has all channels of the model: there are no waves to compare.")
    columns = np.moveaxis(np.array(facts), -1, 0)
    if np.isnan(columns[0]).all():
        raise no_energy(model.inputs[reference])
    keys = ("height", "period", "steepness", "drift")
    waves = [str(part.run.attrs.get("waves") or "") for part in parts.values()]
    return xr.Dataset(
        {key: (("run", "part"), column) for key, column in zip(keys, columns, strict=True)}
        | {"waves": ("run", waves), "outside": ("run", outside)},
        coords={"run": list(parts), "part": ["train", "test"]},
        attrs={"reference": model.inputs[reference]},
    )


def _sea(wave: np.ndarray, dt: float, run: xr.Dataset) -> tuple[float, float, float]:
    """Height, period and steepness of a wave record; NaN where it is constant."""
    if not np.ptp(wave) > 0:
        return np.nan, np.nan, np.nan
    regular = is_regular(run)
    height = (2 * np.sqrt(2) if regular else 4.0) * float(wave.std())
    period = 1 / dominant_frequency(wave, dt) if regular else encounter_period(wave, dt)
    depth = run.attrs.get("water_depth")
    steepness = np.nan
    if depth is not None:
        k = float(wavenumber(2 * np.pi / period, float(depth)))
        steepness = height * k / (2 * np.pi)
    return height, period, steepness


def _outside(model: Model, run: xr.Dataset, is_test: bool) -> str:
    if not is_test:
        return ""
    time = run["time"].values
    begin, end = run.attrs.get("test_span", (time[0], time[-1]))
    steps = round((float(end) - float(begin)) / model.dt)
    return "; ".join(outside_training(model, run, float(begin), steps))
