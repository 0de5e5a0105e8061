"""Validity: where the waves of each test lie against those that trained the model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.check.parts import is_regular, no_energy, reference_probe, used_parts
from seakeep.core.harmonics import dominant_frequency
from seakeep.errors import DataError
from seakeep.models import Model, outside_training
from seakeep.signals import encounter_period
from seakeep.waves import wavenumber


def validity(model: Model, runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
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
    rows = {}
    for name, part in used_parts(model, runs).items():
        trained = model.training_spans.get(name)
        tested = part.run.attrs.get("test_span")
        if tested is None and trained is None:
            tested = (part.time[0], part.time[-1])
        facts = np.full((2, 4), np.nan)
        for row, span in zip(facts, (trained, tested), strict=True):
            inside = np.zeros(len(part.time), dtype=bool)
            if span is not None:
                inside = (part.time >= span[0] - 1e-6) & (part.time <= span[1] + 1e-6)
            if inside.sum() >= 16:
                row[:3] = _sea(part.inputs[inside, reference], model.dt, part.run)
                row[3] = np.nan if surge is None else part.states[inside, surge].mean()
        keys = ("height", "period", "steepness", "drift")
        rows[name] = xr.Dataset(
            {key: ("part", column) for key, column in zip(keys, facts.T, strict=True)}
            | {
                "waves": str(part.run.attrs.get("waves") or ""),
                "outside": _outside(model, part.run, np.isfinite(facts[1, 1])),
            }
        )
    if not rows:
        raise DataError("no run has all channels of the model: there are no waves to compare.")
    out = xr.concat(list(rows.values()), xr.Variable("run", list(rows)))
    if out["height"].isnull().all():
        raise no_energy(model.inputs[reference])
    out = out.assign_coords(part=["train", "test"])
    return out.assign_attrs(reference=model.inputs[reference])


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
