r"""Motion by a model's matrices: its modes, its decay beside the vessel's, and its second order.

A free decay shows period and damping in its successive extremes, and how damping grows with
amplitude. With :math:`a_k` half the distance between successive extremes, the decrement of a cycle
is :math:`\delta_k = 2 \ln(a_k / a_{k+1}) = p + q\,\bar a_k`: p is linear damping,
:math:`\zeta = p / \sqrt{4\pi^2 + p^2}`, and q quadratic (Himeno, 1981; ITTC 7.5-02-07-04.5).
"""

from typing import Any

import numpy as np
import scipy
import xarray as xr

from seakeep.arrays import Datasets, FloatArray
from seakeep.check.parts import (
    HERTZ,
    driven,
    elevations,
    gathered,
    is_regular,
    read_off,
    reference_probe,
    single_model,
    units_of,
    used_parts,
    wave_turns,
)
from seakeep.check.response import points_of, transfer
from seakeep.conventions import MOTIONS, canonical_channel
from seakeep.errors import DataError, RequestError
from seakeep.models import HankelDMDcModel, Model
from seakeep.models.labelled import Span, channel_matrix, mean_period
from seakeep.models.linear import modes as modes_of

LONGEST, SHORTEST = 20000, 200
"""Samples of a decay."""
OWN = 0.25
"""Part of what a cycle would leave of the offset, above which swings are the motion's own."""


def _motions(model: Model) -> list[str]:
    """States that are rigid motions."""
    motions = [name for name in model.states if name in MOTIONS]
    if not motions:
        free = [name for name in model.states if canonical_channel(name) is None]
        meant = [(name, motion) for name in free for motion in MOTIONS if motion in name]
        state, motion = meant[0] if meant else (model.states[0], MOTIONS[2])
        raise RequestError(
            f"no state of the model is a rigid motion ({', '.join(MOTIONS)}): states "
            f"{', '.join(model.states)}. If {state} is the vessel's {motion}, call it {motion} in "
            f"the campaign file ([channels.{motion}], with column = …, and in states), and fit "
            "again."
        )
    return motions


def modes(model: Model) -> xr.Dataset:
    r"""Modes of a model, slowest decay first, and which states take part in each.

    Parameters
    ----------
    model : HankelDMDcModel
        The model.

    Returns
    -------
    Dataset
        As :meth:`seakeep.HankelDMDcModel.modes`, and ``participation`` over (mode, state):
        :math:`|w_i v_i|` of left and right eigenvectors, summed over the delays of a state, as
        parts of one.

    Raises
    ------
    RequestError
        If it is an ensemble, or no model of delayed states.
    """
    single = single_model(model)
    values, left, right = scipy.linalg.eig(single.A, left=True)
    order = np.argsort(-np.abs(values), kind="stable")
    order = order[values[order].imag >= 0]
    parts = np.abs(left[:, order] * right[:, order])
    shares = parts.reshape(-1, len(single.states), order.size).sum(axis=0)
    out = modes_of(values[order], single.dt)
    label = {"units": "1", "long_name": "participation"}
    out["participation"] = (("mode", "state"), (shares / shares.sum(axis=0)).T, label)
    return out.assign_coords(state=single.states)


def decay(model: Model) -> xr.Dataset:
    """Release a model from an offset of each rigid motion, in still water.

    The offset, one training SD, is held for the length of the history; what is left of it after
    the release is the difference of two free runs, with the offset and without. A linear model's
    damping does not depend on the offset.

    Parameters
    ----------
    model : HankelDMDcModel
        The model.

    Returns
    -------
    Dataset
        Over (motion, time): ``displacement``, in parts of the offset; over motion: ``offset``,
        ``period`` (s), ``damping_ratio``, and ``p`` (decrement of a cycle); NaN of a motion with
        fewer than three extremes, or with swings a quarter as large as that damping leaves of the
        offset, which are those of other modes.

    Raises
    ------
    RequestError
        If no state is a rigid motion, or the model is none of delayed states.
    """
    single = single_model(model)
    motions = _motions(single)
    table = single.modes()
    waves = table["period"].values[table["damping_ratio"].values < 0.7]
    longest = waves[np.isfinite(waves)].max(initial=0.0)
    steps = int(np.clip(8 * longest / single.dt, SHORTEST, LONGEST))
    before = single.history_samples
    history = np.tile(single.state_mean, (before, 1))
    still = np.zeros((before, len(single.inputs)))
    ahead = np.zeros((steps - 1 + single.lead_samples, len(single.inputs)))
    rest = single.forecast_arrays(history, still, ahead, steps)
    rows = []
    for motion in motions:
        column = single.states.index(motion)
        offset = single.state_scale.spread[column]
        moved = history.copy()
        moved[:, column] += offset
        run = single.forecast_arrays(moved, still, ahead, steps)
        left = np.concatenate([[1.0], (run - rest)[:, column] / offset])
        released = free_decay(left[np.isfinite(left)], single.dt)
        period = linear = np.nan
        if released:
            decrement = released["decrement"].values.mean()
            if released["amplitude"].values[0] > OWN * np.exp(-decrement):
                period, linear = released["period"].item(), decrement
        damping = linear / np.hypot(2 * np.pi, linear)
        facts = {"offset": offset, "period": period, "damping_ratio": damping, "p": linear}
        rows.append(xr.Dataset({"displacement": ("time", left), **facts}))
    return xr.concat(rows, xr.Variable("motion", motions)).assign_coords(
        units=("motion", units_of(single, motions)),
        time=("time", single.dt * np.arange(steps + 1), {"units": "s"}),
    )


def measured_decay(model: Model, runs: Datasets) -> xr.Dataset:
    r"""Period and damping of measured decay runs, :math:`\delta = p + q a`.

    Parameters
    ----------
    model : Model
        Names the states.
    runs : mapping of str to Dataset
        Prepared runs; those with ``attrs["waves"]`` "still" are decays. The motion that moves
        most, in training SDs, is taken, from its largest excursion on.

    Returns
    -------
    Dataset
        Over ``run``: ``motion``, ``period`` (s), ``damping_ratio``, ``p``, ``q`` (per unit of the
        motion), ``cycles``; over (run, cycle): ``amplitude`` and ``decrement``.

    Raises
    ------
    DataError
        If no run is a decay in still water.
    RequestError
        If no state is a rigid motion.
    """
    still = {name: run for name, run in runs.items() if run.attrs.get("waves") == "still"}
    motions = _motions(model)
    if not still:
        raise DataError(
            "no run in use is a free decay in still water. State waves = 'still' and role = 'test' "
            "of such runs (unused ones are not read), and the model's decay stands beside theirs."
        )
    spread = model.signature.state_scale.spread[[*map(model.states.index, motions)]]

    def released(name: str) -> xr.Dataset:
        run = still[name]
        values = channel_matrix(run, motions, name)
        values = values[np.isfinite(values).all(axis=1)]
        moved = (values - values[-1]) / spread
        column = np.argmax(np.abs(moved).max(axis=0))
        first = np.argmax(np.abs(moved[:, column]))
        noise = run[motions[column]].attrs.get("noise_std", 0.0)
        found = free_decay(values[first:, column], model.dt, noise)
        if found is None:
            raise DataError("no motion swings above its noise. Was anything released?")
        return found.assign(motion=motions[column])

    parts = gathered(still, released, "no run in still water is a free decay.", "no decay from")
    names = xr.Variable("run", list(parts))
    return xr.concat([*parts.values()], names, join="outer").drop_vars("cycle")


SMALLEST = 0.02
"""Part of the whole range below which a swing counts as noise."""
NOISE = 4.0
"""SDs of noise on either side that thousands of its samples hardly leave."""
APART = 2.0
"""Half periods of the largest swing after which the next extreme is another motion's."""


def free_decay(series: FloatArray, dt: float, noise: float = 0.0) -> xr.Dataset | None:
    """Period, p and q of a series that was released; a constant in it does not matter.

    Swings count from the largest on, until one is lost in noise. Extremes are those of parabolas
    through a third of a half period on either side, which shrink all of them alike; one that lies
    nearer to the release is a jerk. What follows is weighted by amplitude, as noise matters by its
    inverse.

    Parameters
    ----------
    series : ndarray, shape (time,)
        From the release on.
    dt : float
        Time step.
    noise : float, optional
        Standard deviation of the noise of its sensor.

    Returns
    -------
    Dataset or None
        The damped ``period``; ``damping_ratio``, of small amplitudes, from p; ``p`` and ``q``, the
        decrement of a cycle at zero amplitude and its growth per unit of amplitude; ``cycles``, the
        number of decrements; over cycle ``amplitude``, the geometric mean, and ``decrement``. None
        where there are too few extremes.

    Examples
    --------
    >>> t = np.arange(0, 60, 0.05)
    >>> found = free_decay(np.exp(-0.05 * t) * np.cos(t), 0.05)
    >>> round(float(found.period) / (2 * np.pi), 3), round(float(found.damping_ratio), 3)
    (1.0, 0.05)
    """
    least = max(SMALLEST * np.ptp(series), 2 * NOISE * noise)
    places = np.sort(
        np.concatenate(
            [scipy.signal.find_peaks(sign * series, prominence=least)[0] for sign in (1, -1)]
        )
    )
    if places.size < 3:
        return None
    places = places[np.argmax(np.abs(np.diff(series[places]))) :]  # other modes die out before
    reach = max((places[1] - places[0]) // 3, 1)
    if places[0] < reach:  # a jerk, and no extreme of the swing
        return free_decay(series[places[0] + 1 :], dt, noise)
    window = 2 * reach + 1
    value, slope, bend = (
        scipy.signal.savgol_filter(series, window, 2, deriv=order)[places] for order in range(3)
    )
    shift = -np.divide(slope, bend, out=np.zeros_like(bend), where=bend != 0)
    gaps = np.diff(places + shift)
    length = int(np.argmin(np.append(gaps < APART * gaps[0], False)))
    if length < 2:
        return None
    gaps, ranges = gaps[:length], 0.5 * np.abs(np.diff(value + 0.5 * slope * shift))[:length]
    decrements = 2 * np.log(ranges[:-1] / ranges[1:])
    amplitudes = np.sqrt(ranges[:-1] * ranges[1:])
    p, q = float(decrements.mean()), np.nan
    if decrements.size >= 3:
        q, p = map(float, np.polyfit(amplitudes, decrements, 1, w=amplitudes))
    period = 2 * dt * float(np.average(gaps, weights=ranges))
    return xr.Dataset(
        {
            "period": period,
            "damping_ratio": p / np.hypot(2 * np.pi, p),
            "p": p,
            "q": q,
            "cycles": decrements.size,
            "amplitude": ("cycle", amplitudes),
            "decrement": ("cycle", decrements),
        },
        {"cycle": range(decrements.size)},
    )


PERIODS = 32
"""Encounter periods in which all probing waves repeat: differences are multiples of its inverse."""
DIFFERENCES = 4
"""Difference frequencies, besides zero."""
PROBED = 12
"""Frequencies, of those that were trained, at which waves probe."""


def drift(model: Model, runs: Datasets) -> xr.Dataset:
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
        per amplitude squared, counted from the rest in still water where all but the waves is as in
        the run, with ``run`` and ``point_frequency``. The rest is the mean over the last quarter of
        runs in still water, decays among them, each weighted by the inverse of its variance there;
        without such runs it is the model's. ``attrs``:
        ``amplitude`` (m), ``reference``, and ``rest``, where that is from.

    Raises
    ------
    RequestError
        If the model has no observables, or is none of delayed states.
    DataError
        If the runs do not state positions and water depth, where there are several probes.
    """
    model.signature.check_fixed()
    single = single_model(model)
    if len(single.regressors) == len(single.inputs):
        raise RequestError(
            "the model has no observables, so that its mean and slow response do not depend on the "
            "waves. Fit one with observables = [seakeep.SlowSquares(…)] for drift."
        )
    reference, waves = reference_probe(model, runs), elevations(model)
    samples = round(PERIODS * mean_period(runs, model.inputs))
    step = 1.0 / (samples * model.dt)
    every = np.arange(1, int(0.4 / model.dt / step))
    trained = single.coverage.is_trained(step * every.astype(float))
    known = every[trained[single.coverage.channels.index(model.inputs[reference])]]
    if not known.size:
        raise DataError("training holds no waves by which the model could be probed.")
    bins = known[np.linspace(0, known.size - 1, min(PROBED, known.size)).round().astype(int)]
    turns = wave_turns(model, runs, step * np.arange(bins[-1] + DIFFERENCES + 1), reference)
    if turns is None:
        if waves.sum() > 1:
            raise DataError(
                "the runs do not state the positions of the probes and the water depth, by which "
                "waves pass several probes. State them in [rig]."
            )
        turns = np.tile(np.where(waves, 0.0, np.nan), (bins[-1] + DIFFERENCES + 1, 1))
    amplitude = float(np.sqrt(2) * single.input_scale.spread[reference])
    differences = step * np.arange(DIFFERENCES + 1, dtype=float)
    slow = transfer(model, single.dynamics, differences)
    still = _columns(single, np.zeros((samples, len(single.inputs))))
    forces = np.empty((len(single.states), DIFFERENCES + 1, bins.size), dtype=complex)
    for number, first in enumerate(bins):
        for apart in range(DIFFERENCES + 1):
            pair = np.unique([first, first + apart])[:, None, None]
            turn = 2 * np.pi * pair * np.arange(samples)[:, None] / samples
            # Inputs that are not elevations are zero.
            elevation = amplitude * np.nan_to_num(np.cos(turn - turns[pair[:, 0]]))
            rows = _columns(single, elevation.sum(axis=0)) - still
            parts = np.fft.fft(rows, axis=0)[apart] / samples * (1 if apart == 0 else 2)
            forces[:, apart, number] = slow[apart] @ parts / (amplitude**2 * (2 if apart else 1))
    forces[read_off(model)] = np.nan
    # Offsets of regular runs from the rest, per amplitude squared.
    offsets: dict[str, Any] = {}
    ends = _ends(single, runs)
    if regular := {name: run for name, run in runs.items() if is_regular(run)}:
        parts = used_parts(model, regular)
        at = points_of(model, regular, parts)
        used = [parts[str(run)].inputs for run in at["run"].values]
        used += [inputs for _, inputs in ends.values()]
        calm = [np.where(waves, 0.0, each.mean(axis=0)) for each in used]
        columns = np.stack([_columns(single, each[None])[0] for each in calm])
        means = np.concatenate([single.input_scale.mean, single.signature.direct_scale.mean])
        rests = single.state_mean + (columns - means) @ slow[0].real.T
        rests, still = np.split(rests, [at.sizes["point"]])
        if ends:  # what the model errs in still water; what still swings says little of it
            errors = np.stack([x.mean(axis=0) for x, _ in ends.values()]) - still
            moved = np.stack([x.var(axis=0) for x, _ in ends.values()])
            moved += 1e-9 * single.state_scale.spread**2
            rests += np.average(errors, axis=0, weights=1.0 / moved)
        square = at["wave_amplitude"].values[:, None] ** 2
        offset = at["offset"].values + single.state_scale.centre - rests
        offsets = {
            "offset": (("point", "state"), offset / square),
            "offset_uncertainty": (("point", "state"), at["offset_uncertainty"].values / square),
            "run": ("point", at["run"].values),
            "point_frequency": ("point", at["frequency"].values, {"units": "Hz"}),
        }
    slow_response = np.abs(forces)
    slow_response[:, 0] = forces[:, 0].real  # the mean has a sign
    dims = ("state", "difference", "frequency")
    return xr.Dataset(
        {
            "slow_response": (dims, slow_response),
            "phase": (dims, np.degrees(np.angle(forces)), {"units": "deg"}),
            **offsets,
        },
        coords={
            "state": single.states,
            "difference": ("difference", differences, {"units": "Hz"}),
            "frequency": ("frequency", step * bins, HERTZ),
            "units": ("state", [f"{unit}/m²" for unit in units_of(model, single.states)]),
        },
        attrs={
            "amplitude": amplitude,
            "reference": model.inputs[reference],
            "rest": f"measured in {', '.join(ends)}" if ends else "as the model has it",
        },
    )


def _ends(model: HankelDMDcModel, runs: Datasets) -> dict[str, list[FloatArray]]:
    """States and inputs over the last quarter of runs in still water, where all are known."""
    ends = {}
    for name, run in runs.items():
        last = slice(-(run.sizes["time"] // 4), None)
        both = [channel_matrix(run, each, name, last) for each in (model.states, model.inputs)]
        if run.attrs.get("waves") == "still" and all(np.isfinite(each).all() for each in both):
            ends[name] = both
    return ends


def _columns(model: HankelDMDcModel, inputs: FloatArray) -> FloatArray:
    """Regressors over one repetition of inputs that repeat, (samples, n + m)."""
    input_map = model.signature.input_map
    size, reach = len(inputs), input_map.reads(Span(0, 0, 1))
    before, after = -(-max(-reach.first, 0) // size), -(-max(reach.stop, 1) // size)
    first = before * size
    tiled = np.tile(inputs, (before + 1 + after, 1))
    return driven(input_map, tiled, None, first, first + size)
