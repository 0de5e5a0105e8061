"""Free motion: the modes of a model, and its decay from an offset beside that of the vessel."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import scipy
import xarray as xr

from seakeep.check.parts import single_model, units_of
from seakeep.conventions import MOTIONS, canonical_channel
from seakeep.core.extremes import free_decay
from seakeep.errors import DataError, RequestError
from seakeep.models import Model
from seakeep.models.labelled import channel_matrix
from seakeep.models.linear import modes as modes_of

LONGEST, SHORTEST = 20000, 200
"""Samples of a decay."""


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
        fewer than three extremes.

    Raises
    ------
    RequestError
        If no state is a rigid motion, or the model is none of delayed states.
    """
    single = single_model(model)
    motions = _motions(single)
    table = single.modes()
    waves = table["period"].values[table["damping_ratio"].values < 0.7]
    longest = float(waves[np.isfinite(waves)].max(initial=0.0))
    steps = int(np.clip(8 * longest / single.dt, SHORTEST, LONGEST))
    before = single.history_samples
    history = np.tile(single.state_mean, (before, 1))
    still = np.zeros((before, len(single.inputs)))
    ahead = np.zeros((steps - 1 + single.lead_samples, len(single.inputs)))
    rest = single.forecast_arrays(history, still, ahead, steps)
    rows = []
    for motion in motions:
        column = single.states.index(motion)
        offset = float(single.state_scale.spread[column])
        moved = history.copy()
        moved[:, column] += offset
        run = single.forecast_arrays(moved, still, ahead, steps)
        left = np.concatenate([[1.0], (run - rest)[:, column] / offset])
        released = free_decay(left[np.isfinite(left)], single.dt)
        linear = released.decrements.mean() if released.cycles else np.nan
        damping = linear / np.hypot(2 * np.pi, linear)
        rows.append((left, offset, released.period, damping, linear))
    left, *facts = map(np.array, zip(*rows, strict=True))
    keys = ("offset", "period", "damping_ratio", "p")
    return xr.Dataset(
        {"displacement": (("motion", "time"), left)}
        | {key: ("motion", fact) for key, fact in zip(keys, facts, strict=True)},
        coords={
            "motion": motions,
            "units": ("motion", units_of(single, motions)),
            "time": ("time", single.dt * np.arange(steps + 1), {"units": "s"}),
        },
    )


def measured_decay(model: Model, runs: Mapping[str, xr.Dataset]) -> xr.Dataset:
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
            "no run is a free decay in still water. State waves = 'still' of such runs, and the "
            "model's decay stands beside theirs."
        )
    parts = []
    for name, run in still.items():
        values = channel_matrix(run, motions, name)
        values = values[np.isfinite(values).all(axis=1)]
        spread = dict(zip(model.states, model.signature.state_scale.spread, strict=True))
        moved = (values - values[-1]) / [spread[each] for each in motions]
        column = int(np.argmax(np.abs(moved).max(axis=0)))
        first = int(np.argmax(np.abs(moved[:, column])))
        released = free_decay(values[first:, column], model.dt)
        numbers = {key: getattr(released, key) for key in ("period", "damping_ratio", "p", "q")}
        cycles = {
            "amplitude": ("cycle", released.amplitudes),
            "decrement": ("cycle", released.decrements),
        }
        each = {"motion": motions[column], **numbers, "cycles": released.cycles, **cycles}
        parts.append(xr.Dataset(each, {"cycle": range(len(released.decrements))}))
    names = xr.Variable("run", list(still))
    return xr.concat(parts, names, join="outer").drop_vars("cycle")
