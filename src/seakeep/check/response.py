r"""Response to waves of one frequency: the model's own, the measured one, and whether they agree.

A model of delayed states and inputs is :math:`\hat x_{j+1} = \hat A \hat x_j + \hat B \hat u_j`;
with :math:`u_j = e^{i\omega j}` its steady answer is :math:`H(\omega)\,e^{i\omega j}`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import xarray as xr
from scipy.interpolate import interp1d

from seakeep.arrays import ComplexArray, Datasets, FloatArray, as_real
from seakeep.check.parts import (
    HERTZ,
    Part,
    elevations,
    gathered,
    is_regular,
    no_energy,
    read_off,
    reference_probe,
    single_model,
    units_of,
    used_parts,
    wave_turns,
)
from seakeep.conventions import is_elevation
from seakeep.core.spectra import (
    cross_spectra,
    dominant_frequency,
    estimate,
    half_angle,
    harmonic_fits,
    segment_length,
)
from seakeep.errors import DataError, RequestError
from seakeep.models import Model, is_ensemble
from seakeep.models.engine import Dynamics
from seakeep.models.labelled import Span, mean_period
from seakeep.models.validity import Coverage

WAVE = "wave"
"""Name of the input that is a wave which passes all probes."""
LONGEST = 32
"""Most encounter periods of a segment of Welch's method."""
AVERAGES = 20
"""Independent segments that are kept, where the records are long enough."""
POWER = 0.02
"""Part of the highest power of the wave from which on a frequency is a point."""
FREQUENCIES = 120
LEVEL = 0.95


def response(
    model: Model, frequencies: npt.ArrayLike | None = None, runs: Datasets | None = None
) -> xr.Dataset:
    r"""Transfer functions of a model from its matrices, per input and for a passing wave.

    The answer to small waves: observables that are squares or cubes vanish there. Inputs are those
    that the model is driven by: with an alignment, waves where the vessel is, and of a model that
    follows its own surge what its carriers read of them at the mean surge of training.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        The model.
    frequencies : array_like, shape (frequency,), optional
        Hz; by default 120 around those that were trained.
    runs : mapping of str to Dataset, optional
        Runs that state the positions of the probes and the water depth. With them a further input
        "wave" is a wave that passes all probes by linear dispersion, counted from the probe
        farthest downstream: with several probes, this is the RAO.

    Returns
    -------
    Dataset
        Over (state, input, frequency): ``amplitude`` (in ``units`` over (state, input)) and
        ``phase`` (degrees, positive where the response is early); ``trained`` over (input,
        frequency), whether training holds energy there; of an ensemble the mean of the members'
        complex responses, and ``amplitude_lower``, ``amplitude_upper`` and ``phase_spread`` (half
        the width of the band) at 95 %. NaN for a state that a read-out makes. ``attrs``
        ``reference`` names the probe.

    Raises
    ------
    RequestError
        If the model has no input, or is not a model of delayed states and inputs.

    Examples
    --------
    >>> import seakeep
    >>> run = xr.Dataset({"eta": ("time", np.sin(np.arange(900.0) ** 1.2), {"units": "m"})},
    ...                  coords={"time": 0.1 * np.arange(900)})
    >>> run["heave"] = 0.5 * run.eta.shift(time=1, fill_value=0.0).assign_attrs(units="m")
    >>> run.heave.attrs["units"] = "m"
    >>> spec = seakeep.HankelDMDc(state_delays=0, input_delays=2, ridge=1e-9, delay_rows="exact")
    >>> found = response(spec.fit(run, ["heave"], ["eta"]), [0.5])
    >>> round(float(found.amplitude[0, 0, 0]), 3), str(found.units[0, 0].values)
    (0.5, 'm/m')
    """
    if not model.inputs:
        raise RequestError("the model has no input: it answers no wave. Check its modes instead.")
    if is_ensemble(model):
        coverage, members = model.coverage, range(model.n_members)
        dynamics = [model.dynamics(member) for member in members]
    else:
        single = single_model(model)
        coverage, dynamics = single.coverage, [single.dynamics]
    wanted = _default_frequencies(coverage, model.dt) if frequencies is None else frequencies
    frequency = np.atleast_1d(as_real(wanted, "frequencies"))
    if frequency.size == 0:
        raise RequestError("frequencies is empty. Give at least one, in Hz, or leave it out.")
    if frequency.min() <= 0 or frequency.max() > 0.5 / model.dt:
        raise RequestError(
            f"frequencies must lie above 0 and up to half the sampling rate ({0.5 / model.dt:.4g} "
            f"Hz); received {frequency.min():.4g} to {frequency.max():.4g} Hz."
        )
    names = list(model.inputs)
    waves, size, turns = names, len(names), None
    input_map = model.signature.input_map
    read = np.exp(2j * np.pi * frequency * model.dt * input_map.lead)[:, None]
    if input_map.follows:
        read = input_map.follows.gain(frequency)
    each = np.stack([transfer(model, one, frequency)[:, :, :size] for one in dynamics])
    each *= read[:, None]
    if runs and size > 1:
        probe = reference_probe(model, runs)
        turns = wave_turns(model, runs, frequency, probe)
    if turns is not None:
        phasors = np.nan_to_num(np.exp(-1j * turns))  # other inputs are still
        passing = np.einsum("mfnq,fq->mfn", each, phasors)[..., None]
        each = np.concatenate([each, passing], axis=-1)
        waves, names = [*names, names[probe]], [*names, WAVE]
    each[:, :, read_off(model)] = np.nan
    each, dims = np.moveaxis(each, 1, -1), ("state", "input", "frequency")
    mean = each.mean(axis=0)
    values = {"amplitude": np.abs(mean), "phase": np.degrees(np.angle(mean))}
    if len(each) > 1:
        ends = np.quantile(np.abs(each), [0.5 - LEVEL / 2, 0.5 + LEVEL / 2], axis=0)
        turned = np.abs(np.angle(each * np.conj(mean)))
        values |= dict(zip(("amplitude_lower", "amplitude_upper"), ends, strict=True))
        values["phase_spread"] = np.degrees(np.quantile(turned, LEVEL, axis=0))
    known = coverage.is_trained(frequency)[[coverage.channels.index(name) for name in waves]]
    of = units_of(model, waves)
    units = [
        [x if u in ("", "1") else f"{x or '1'}/{u}" for u in of]
        for x in units_of(model, model.states)
    ]
    out = xr.Dataset(
        {key: (dims, value) for key, value in values.items()}
        | {"trained": (("input", "frequency"), known)},
        coords={
            "state": model.states,
            "input": names,
            "frequency": ("frequency", frequency, HERTZ),
            "units": (("state", "input"), units),
        },
        attrs={"reference": (list(filter(is_elevation, waves)) or waves)[-1]},
    )
    out["phase"].attrs = {"units": "deg", "long_name": "phase before the wave"}
    return out


def transfer(model: Model, dynamics: Dynamics, frequency: FloatArray) -> ComplexArray:
    r"""Transfer functions of a member, :math:`(e^{i\omega} I - \hat A)^{-1} \hat B(\omega)`.

    Returns
    -------
    ndarray of complex, shape (frequency, N, n + m)
        From the n regressors with delays, then the m without, in physical units.
    """
    own = dynamics.signature
    state_rows, input_rows = dynamics.matrices  # newest block first
    turn = np.exp(2j * np.pi * frequency * model.dt)
    scale = np.concatenate([own.input_scale.std, own.direct_scale.std])
    n_states, lags = len(own.state_labels), own.input_delays + 1
    delayed, direct = np.split(input_rows, [own.input_scale.std.size * lags], axis=1)
    back = turn[:, None] ** -np.arange(lags)
    driven = np.concatenate(
        [
            np.einsum("fl,rlq->frq", back, delayed.reshape(len(delayed), lags, -1)),
            np.broadcast_to(direct, (turn.size, *direct.shape)),
        ],
        axis=2,
    )
    size = state_rows.shape[1]
    if len(state_rows) == n_states:  # the others shift the delays
        rows = state_rows.reshape(n_states, -1, n_states)
        back = turn[:, None] ** -np.arange(rows.shape[1])
        system = turn[:, None, None] * np.eye(n_states) - np.einsum("fl,rlj->frj", back, rows)
        gain = np.linalg.solve(system, driven)
    else:  # one frequency at a time: the whole of Â is large
        gain = np.array([
            np.linalg.solve(z * np.eye(size) - state_rows, b)[:n_states]
            for z, b in zip(turn, driven, strict=True)
        ])  # fmt: skip
    return gain * own.state_scale.std[:, None] / scale


def _default_frequencies(coverage: Coverage, dt: float) -> FloatArray:
    highest = 0.5 / dt
    low = highest / 200
    grid = np.geomspace(low, highest, 400)
    known = grid[coverage.is_trained(grid).any(axis=0)]
    if known.size:
        low, highest = 0.5 * known[0], min(highest, 1.3 * known[-1])
    return np.geomspace(low, highest, FREQUENCIES)


def measured_response(model: Model, runs: Datasets) -> xr.Dataset:
    """Measured response per wave amplitude: points with expanded uncertainty.

    Each run in regular waves is one point, by a harmonic fit in windows of whole periods (ITTC
    7.5-02-07-02.1: type A over the windows, type B from ``attrs["accuracy"]`` of the channels,
    their standard uncertainty). Runs in irregular waves together give a point per frequency, by
    cross-spectra with the reference probe in segments of 16 to 32 encounter periods; what leakage
    does is judged from segments half as long. With an alignment of the model to the surge, waves
    are those where the vessel was by its measured surge, else those at the probe.

    Parameters
    ----------
    model : Model
        Names the channels, and aligns the waves.
    runs : mapping of str to Dataset
        Prepared runs; what trains or tests of them is taken.

    Returns
    -------
    Dataset
        Over ``point``: ``run``, ``kind`` ("regular" or "irregular"), ``frequency`` (Hz) and
        ``wave_amplitude`` (m, of regular waves); over (point, state): ``amplitude``, ``phase``
        (degrees), ``amplitude_uncertainty`` and ``phase_uncertainty`` (expanded, 95 %),
        ``coherence`` (irregular waves), and ``offset`` with ``offset_uncertainty``: the mean of a
        regular run less the model's mean state. ``attrs["reference"]`` names the probe.

    Raises
    ------
    DataError
        If no run gives a point, with the reason of each.

    Warns
    -----
    SeakeepWarning
        Of each run that gives none, with the reason.
    """
    return points_of(model, runs, used_parts(model, runs))


def points_of(model: Model, runs: Datasets, parts: dict[str, Part]) -> xr.Dataset:
    """Measured response in the used parts of runs."""
    reference = reference_probe(model, runs)
    pieces = [part for part in parts.values() if not is_regular(part.run)]
    names = [name for name, part in parts.items() if is_regular(part.run)]

    def points(name: str) -> xr.Dataset:
        if name in names:
            return _regular_point(model, name, parts[name], reference)
        return _irregular_points(model, pieces, reference, mean_period(runs, model.inputs))

    estimates = gathered(
        [*names, *["irregular waves"] * bool(pieces)],
        points,
        "no run gives a measured response.",
        "no measured response from",
    )
    out = xr.concat([*estimates.values()], dim="point", coords="minimal", join="outer")
    out["phase"].attrs = {"units": "deg", "long_name": "phase before the wave"}
    return out.assign_attrs(reference=model.inputs[reference])


def _answered(model: Model, part: Part, reference: int) -> tuple[FloatArray, FloatArray]:
    """Wave of a part, where the model has it by the measured surge, and its states."""
    alignment, size = model.signature.input_map.alignment, len(part.time)
    if alignment is None:
        return part.inputs[:, [reference]], part.states
    if alignment.settings.surge == "predicted":
        measured = replace(alignment.settings, surge="measured")
        alignment = replace(alignment, settings=measured)
    carried = alignment.carry(part.run.sel(time=part.time), [Span(0, size - 1, size)])
    return carried[:, [reference]], part.states


def _regular_point(model: Model, name: str, part: Part, reference: int) -> xr.Dataset:
    names = [model.inputs[reference], *model.states]
    both = np.concatenate(_answered(model, part, reference), axis=1)
    frequency = dominant_frequency(both[:, 0], model.dt)
    harmonics, means = harmonic_fits(both, model.dt, frequency)
    amplitude, *answer = np.abs(harmonics).mean(axis=0)
    accuracy = np.array([part.run[each].attrs.get("accuracy", 0.0) for each in names])
    ratio = np.array(answer) / amplitude
    type_b = np.hypot(accuracy[1:], ratio * accuracy[0]) / amplitude
    estimated = estimate(harmonics[:, 1:] / harmonics[:, :1], type_b)
    offset = means[:, 1:] - model.signature.state_scale.centre
    mean = estimate(offset.astype(complex), accuracy[1:])
    return _points(
        model,
        {"run": name, "kind": "regular", "frequency": frequency, "wave_amplitude": amplitude},
        estimated.ratio,
        estimated.amplitude,
        estimated.phase,
        # Where a model departs from the means of each run, its mean state is that of the run.
        offset=np.where(model.signature.input_map.reference > 0, np.nan, mean.ratio.real),
        offset_uncertainty=mean.amplitude,
    )


def _irregular_points(model: Model, parts: list[Part], reference: int, period: float) -> xr.Dataset:
    pieces = [_answered(model, part, reference) for part in parts]
    segment = segment_length(sum(len(wave) for wave, _ in pieces), AVERAGES, period, LONGEST)
    spectra, halves = (cross_spectra(pieces, model.dt, each) for each in (segment, segment // 2))
    gain, radius = spectra.gain()
    # Leakage shrinks with longer segments: the change from segments half as long, which is what it
    # moves a point at most, is added to the radius by chance, as a root of squares.
    other = interp1d(halves.frequency, halves.gain()[0], axis=0, fill_value="extrapolate")
    radius = np.hypot(radius, np.abs(gain - other(spectra.frequency)))
    power = spectra.input_power[:, 0]
    if not power.max() > 0:
        raise no_energy(model.inputs[reference])
    at = np.flatnonzero((power >= POWER * power.max()) & (spectra.frequency > 0))
    gain, half = gain[at, 0], radius[at, 0]
    name = ", ".join(str(part.run.attrs.get("run", "run")) for part in parts)
    frequency = spectra.frequency[at]
    return _points(
        model,
        {"run": name, "kind": "irregular", "frequency": frequency, "wave_amplitude": np.nan},
        gain,
        half,
        half_angle(half, np.abs(gain)),
        coherence=spectra.ordinary()[at, 0],
    )


def _points(
    model: Model,
    of_points: Mapping[str, npt.ArrayLike],
    ratio: ComplexArray,
    radius: FloatArray,
    turn: FloatArray,
    **others: FloatArray,
) -> xr.Dataset:
    """Points from ratios with their uncertainty and that of the phase (rad); others are NaN."""
    values = {
        "amplitude": np.abs(ratio),
        "phase": np.degrees(np.angle(ratio)),
        "amplitude_uncertainty": radius,
        "phase_uncertainty": np.degrees(turn),
        **dict.fromkeys(("coherence", "offset", "offset_uncertainty"), np.nan + radius),
        **others,
    }
    count = np.size(of_points["frequency"])
    return xr.Dataset(
        {key: (("point", "state"), np.atleast_2d(value)) for key, value in values.items()},
        coords={"state": model.states}
        | {key: ("point", np.resize(value, count)) for key, value in of_points.items()},
    )


def validation(model: Model, runs: Datasets, measured: xr.Dataset | None = None) -> xr.Dataset:
    r"""Judge the response by ASME V&V 20: comparison error against validation uncertainty.

    :math:`E = S - D` with S the model's and D the measured amplitude;
    :math:`U_{val} = \sqrt{U_D^2 + U_S^2}` with :math:`U_D` of the measurement and :math:`U_S` half
    the width of an ensemble's band (0 of a single model, whose own uncertainty is not known).

    Parameters
    ----------
    model : Model
        As for :func:`response`.
    runs : mapping of str to Dataset
        As for :func:`measured_response`.
    measured : Dataset, optional
        What :func:`measured_response` found of them.

    Returns
    -------
    Dataset
        Over (point, state): ``model``, ``measured``, ``error``, ``uncertainty`` (95 %), in the
        units of the amplitude, and ``within``: whether \|E\| < U_val, so that the error cannot be
        told from the uncertainty.

    Raises
    ------
    DataError
        If the model reads several probes and no run states where they stand.
    """
    measured = measured_response(model, runs) if measured is None else measured
    result = response(model, np.unique(measured["frequency"]), runs)
    entry = WAVE if WAVE in result["input"] else result.attrs["reference"]
    if entry != WAVE and elevations(model).sum() > 1:
        raise DataError(
            "the model answers several probes, of which no run states the positions and the water "
            "depth: its answer to one of them is not its answer to a wave that passes all. State "
            "both in [rig] of the campaign file."
        )
    own = result.sel(input=entry, frequency=measured["frequency"]).transpose("point", "state")
    error = own["amplitude"] - measured["amplitude"]
    spread = 0 * error
    if "amplitude_lower" in own:
        spread = 0.5 * (own["amplitude_upper"] - own["amplitude_lower"])
    uncertainty = np.hypot(spread, measured["amplitude_uncertainty"])
    out = xr.Dataset({"model": own["amplitude"], "measured": measured["amplitude"]})
    out = out.assign(error=error, uncertainty=uncertainty, within=abs(error) < uncertainty)
    return out.drop_vars(["input", "wave_amplitude"])
