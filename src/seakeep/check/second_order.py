"""Second order: mean drift and slow response of a model with observables, per amplitude squared."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.arrays import ComplexArray, FloatArray, IntArray
from seakeep.check.parts import (
    driven,
    is_regular,
    read_off,
    reference_probe,
    single_model,
    units_of,
    wave_turns,
)
from seakeep.check.response import measured_response, transfer
from seakeep.errors import DataError, RequestError
from seakeep.models import HankelDMDcModel, Model
from seakeep.models.labelled import Span, mean_period

PERIODS = 32
"""Encounter periods in which all probing waves repeat: differences are multiples of its inverse."""
DIFFERENCES = 4
"""Difference frequencies, besides zero."""


def drift(model: Model, runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
    r"""Probe the observables of a model by one and by two waves: mean drift and slow response.

    Two waves of frequencies :math:`f` and :math:`f + \Delta` and of the amplitude a pass the
    probes. Half of what the model answers at :math:`\Delta`, divided by :math:`a^2`, is a
    difference-frequency transfer function; its limit at zero, by one wave, is the mean drift.
    Both are exact: the regressors of waves that repeat, and the transfer functions of the model's
    matrices. With powers above two they hold for the amplitude of the probe.

    Parameters
    ----------
    model : HankelDMDcModel
        A model with observables.
    runs : mapping of str to Dataset
        Runs that state the positions of the probes and the water depth; regular ones are measured
        points.

    Returns
    -------
    Dataset
        Over (state, difference, frequency): ``slow_response`` (in ``units`` over state, per m²),
        at difference 0 the mean; ``phase`` (degrees, against the wave group at the reference
        probe); over (point, state): ``offset`` and ``offset_uncertainty`` of regular runs,
        per amplitude squared, counted from the model's rest in still water, with ``run`` and
        ``point_frequency``. ``attrs``: ``amplitude`` (m) and ``reference``.

    Raises
    ------
    RequestError
        If the model has no observables, or is none of delayed states.
    DataError
        If the runs do not state positions and water depth, where there are several probes.
    """
    single = single_model(model)
    if len(single.regressors) == len(single.inputs):
        raise RequestError(
            "the model has no observables, so that its mean and slow response do not depend on the "
            "waves. Fit one with observables = [seakeep.SlowSquares(…)] for drift."
        )
    reference = reference_probe(model, runs)
    period = mean_period(runs, model.inputs) * model.dt
    samples = round(PERIODS * period / model.dt)
    step = 1.0 / (samples * model.dt)
    bins = _probed(single, step)
    turns = wave_turns(model, runs, step * np.arange(bins[-1] + DIFFERENCES + 1), reference)
    if turns is None:
        if len(model.inputs) > 1:
            raise DataError(
                "the runs do not state the positions of the probes and the water depth, by which "
                "waves pass several probes. State them in [rig]."
            )
        turns = np.zeros((bins[-1] + DIFFERENCES + 1, 1))
    amplitude = float(np.sqrt(2) * single.input_scale.spread[reference])
    differences: FloatArray = step * np.arange(DIFFERENCES + 1, dtype=float)
    slow = transfer(model, single.dynamics, differences)
    still = _columns(single, np.zeros((samples, len(single.inputs))))
    forces = np.empty((len(single.states), DIFFERENCES + 1, bins.size), dtype=complex)
    for number, first in enumerate(bins):
        for apart in range(DIFFERENCES + 1):
            waves = [first] if apart == 0 else [first, first + apart]
            elevation = sum(_wave(samples, each, turns[each], amplitude) for each in waves)
            rows = _columns(single, np.asarray(elevation)) - still
            parts = np.fft.fft(rows, axis=0)[apart] / samples * (1 if apart == 0 else 2)
            forces[:, apart, number] = slow[apart] @ parts / (amplitude**2 * (2 if apart else 1))
    forces[read_off(model)] = np.nan
    slow_response = np.abs(forces)
    slow_response[:, 0] = forces[:, 0].real  # the mean has a sign
    dims = ("state", "difference", "frequency")
    return xr.Dataset(
        {
            "slow_response": (dims, slow_response),
            "phase": (dims, np.degrees(np.angle(forces)), {"units": "deg"}),
            **_offsets(single, runs, slow[0], still),
        },
        coords={
            "state": single.states,
            "difference": ("difference", differences, {"units": "Hz"}),
            "frequency": ("frequency", step * bins, {"units": "Hz", "long_name": "frequency"}),
            "units": ("state", [f"{unit}/m²" for unit in units_of(model, single.states)]),
        },
        attrs={"amplitude": amplitude, "reference": model.inputs[reference]},
    )


def _probed(model: HankelDMDcModel, step: float) -> IntArray:
    """Multiples of the step at which waves probe: up to twelve that were trained."""
    every = np.arange(1, int(0.4 / model.dt / step))
    frequency: FloatArray = step * every.astype(float)
    known = every[model.coverage.is_trained(frequency).any(axis=0)]
    if not known.size:
        raise DataError("training holds no waves by which the model could be probed.")
    chosen = np.linspace(0, known.size - 1, min(12, known.size)).round().astype(int)
    result: IntArray = known[chosen]
    return result


def _wave(samples: int, cycles: int, turns: FloatArray, amplitude: float) -> FloatArray:
    """A wave at each input, (samples, input); inputs that are not elevations are zero."""
    turn = 2 * np.pi * cycles * np.arange(samples) / samples
    result: FloatArray = amplitude * np.nan_to_num(np.cos(turn[:, None] - turns))
    return result


def _columns(model: HankelDMDcModel, inputs: FloatArray) -> FloatArray:
    """Regressors over one repetition of inputs that repeat, (samples, n + m)."""
    input_map = model.signature.input_map
    size, reach = len(inputs), input_map.reads(Span(0, 0, 1))
    before, after = -(-max(-reach.first, 0) // size), -(-max(reach.stop, 1) // size)
    first = before * size
    tiled = np.tile(inputs, (before + 1 + after, 1))
    return driven(input_map, tiled, None, first, first + size)


def _offsets(
    model: HankelDMDcModel,
    runs: Mapping[str, xr.Dataset],
    static: ComplexArray,
    still: FloatArray,
) -> dict[str, object]:
    """Offsets of regular runs from the model's rest, per amplitude squared."""
    regular = {name: run for name, run in runs.items() if is_regular(run)}
    if not regular:
        return {}
    at = measured_response(model, regular)
    means = np.concatenate([model.input_scale.mean, model.signature.direct_scale.mean])
    rest = model.state_mean + static.real @ (still[0] - means)
    square = at["wave_amplitude"].values[:, None] ** 2
    offset = at["offset"].values + model.state_scale.centre - rest
    over = ("point", "state")
    return {
        "offset": (over, offset / square),
        "offset_uncertainty": (over, at["offset_uncertainty"].values / square),
        "run": ("point", at["run"].values),
        "point_frequency": ("point", at["frequency"].values, {"units": "Hz"}),
    }
