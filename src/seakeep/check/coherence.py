"""Coherence of inputs and states, and the error that no linear model of the inputs goes below."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.check.parts import (
    FreeRun,
    encounter_period_of,
    free_runs,
    irregular,
    regressors,
    used_parts,
)
from seakeep.core.spectra import cross_spectra
from seakeep.errors import DataError, RequestError
from seakeep.models import Model

__all__ = ["coherence"]

SHORTEST, LONGEST = 16, 64
"""Encounter periods of a segment of Welch's method: long ones resolve a lightly damped response."""
AVERAGES = 10
"""Independent segments per input, and one more, that are kept where the records are long enough."""


def coherence(
    model: Model, runs: Mapping[str, xr.Dataset], free: dict[str, FreeRun] | None = None
) -> xr.Dataset:
    r"""Coherence of inputs and states, and the NRMSE that no linear map of the inputs goes below.

    Parameters
    ----------
    model : Model
        Names the channels, aligns the waves, and is judged beside the bound.
    runs : mapping of str to Dataset
        Prepared runs; those in irregular waves are taken, what trains or tests of them.
    free : dict of str to FreeRun, optional
        Free runs that other checks of the same model and runs made; this one adds its own.

    Returns
    -------
    Dataset
        Over (state, input, frequency): ``ordinary`` coherence; over (state, frequency):
        ``multiple`` coherence with all inputs, corrected for what q inputs explain by chance, and
        ``spectrum`` of the state; over state: ``linear_bound``, :math:`\sqrt{\int (1 - \gamma^2)
        S_{xx} / \int S_{xx}}`, and ``nrmse`` of the model's free runs over the test parts, pooled.
        With observables also ``multiple_observables`` and ``observables_bound``, of inputs and
        observables together. ``attrs``: ``averages`` (independent segments), ``segment`` (s) and
        ``observables`` (their names).

    Raises
    ------
    DataError
        If no run is in irregular waves, or the records are too short.
    RequestError
        If the model has no input.

    Notes
    -----
    Segments have 16 to 64 encounter periods, as long as there are ten of them per input and one
    more. They resolve a lightly damped response, or a long delay between probe and vessel,
    incompletely: the bound is then an upper one, and a model may lie below it.
    Slow motions count with all their power.
    """
    if not model.inputs:
        raise RequestError("the model has no input, with which a state could be coherent.")
    waves = irregular(runs, "coherence")
    parts = used_parts(model, waves)
    period = encounter_period_of(model, waves) / model.dt
    samples = sum(len(part.time) for part in parts.values())
    wanted = 2 * samples / (AVERAGES * (len(model.inputs) + 1))
    segment = round(np.clip(wanted, SHORTEST * period, LONGEST * period))
    pieces = []
    for part in parts.values():
        columns = regressors(model, part)
        whole = np.isfinite(columns).all(axis=1)
        pieces.append((columns[whole], part.states[whole]))
    further = cross_spectra(pieces, model.dt, segment)
    spectra = further.only(range(len(model.inputs)))
    if not spectra.input_power.max() > 0:
        raise DataError(
            f"the inputs ({', '.join(model.inputs)}) hold no energy: they are constant. Look for a "
            "dead probe."
        )
    over = ("state", "frequency")
    found = {
        "ordinary": (("state", "input", "frequency"), spectra.ordinary().transpose(2, 1, 0)),
        "multiple": (over, spectra.multiple().T),
        "spectrum": (over, spectra.outputs.T),
        "linear_bound": ("state", spectra.bound()),
        "nrmse": ("state", pooled_nrmse(free_runs(model, waves, free))),
    }
    names = [name for name in model.signature.regressors if name not in model.inputs]
    if names:
        found["multiple_observables"] = (over, further.multiple().T)
        found["observables_bound"] = ("state", further.bound())
    return xr.Dataset(
        found,
        coords={
            "state": model.states,
            "input": model.inputs,
            "frequency": (
                "frequency",
                spectra.frequency,
                {"units": "Hz", "long_name": "frequency"},
            ),
        },
        attrs={
            "averages": spectra.averages,
            "segment": segment * model.dt,
            "observables": ", ".join(names),
        },
    )


def pooled_nrmse(runs: Mapping[str, FreeRun]) -> FloatArray:
    """NRMSE of each state over all free runs, deviations from the mean of each run."""
    squares = sum(((r.forecast - r.measured) ** 2).sum(axis=0) for r in runs.values())
    spread = sum(((r.measured - r.measured.mean(axis=0)) ** 2).sum(axis=0) for r in runs.values())
    out = np.full(np.shape(spread), np.nan)
    ratio = np.divide(squares, spread, out=out, where=np.asarray(spread) > 0)
    result: FloatArray = np.sqrt(ratio)
    return result
