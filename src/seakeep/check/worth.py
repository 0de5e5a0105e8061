"""What a model is worth: its error over the tests beside baselines, and what it can be used for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.check.parts import FreeRun, Known, beside, free_runs, is_regular, judged
from seakeep.metrics import anrmse_differences
from seakeep.models import Model

__all__ = ["LIMITS", "worth"]

LIMITS = (0.1, 0.3, 0.7)
"""NRMSE at which the use of a forecast changes: 99, 91 and 51 % of the variance are explained."""


def worth(
    model: Model,
    runs: Mapping[str, xr.Dataset],
    baselines: Mapping[str, Model] | None = None,
    free: Known | None = None,
) -> xr.Dataset:
    """Judge the free runs of a model over the tests, beside baselines.

    Parameters
    ----------
    model : Model
        The model.
    runs : mapping of str to Dataset
        Prepared runs; tests are taken, or what trains where no run tests.
    baselines : mapping of str to Model, optional
        Models of the same states to compare with, over the same instants; one that cannot
        forecast all of them is left out.
    free : dict, optional
        Free runs that other checks of the same model and runs made; this one adds its own.

    Returns
    -------
    Dataset
        Over (model, run), with "model" and the names of the baselines: ``anrmse`` with its bounds
        ``anrmse_lower`` and ``anrmse_upper``. Over (waves, state, model), waves "irregular" or
        "regular" and the state "all" for the ANRMSE: ``nrmse``, the mean over the runs, and
        ``change`` of the model from each baseline (−0.2 for 20 % less; paired), with their bounds.
        Bounds are of 95 %, and hold for these runs. Over (waves, state): ``limit``, the least of
        0.1, 0.3 and 0.7 that ``nrmse_upper`` of the model lies below (infinite if none, NaN of a
        state that stands still or is lost), ``still``, whether that is because it stands
        still in one of the runs, ``best``, the baseline of least error, ``better``, whether
        ``change_upper`` from each baseline that is judged lies below zero, and ``rival``, the
        judged baseline with the largest ``change_upper``. Over (channel, run): ``run_nrmse``
        of the model. Over run: ``kind`` of waves,
        ``sea_state``, and ``look_ahead``, how long after an instant the model reads the waves (s).
        ``attrs``: ``of`` ("tests" or "training"), the measured state that the alignment of
        the waves reads after the start (``conditional_on``), and ``lost``, which baselines do not
        count and why, in words.

    Raises
    ------
    DataError
        If no run can be forecast.
    """
    runs, of = judged(runs)
    own = free_runs(model, runs, free)
    every = {"model": own, **beside(baselines, runs, own, free)}
    spread = dict(zip(model.states, model.signature.state_scale.spread, strict=True))

    def labelled(values: FloatArray, run: xr.Dataset) -> xr.Dataset:
        return xr.Dataset({
            s: ("time", values[:, k], {**run[s].attrs, "training_std": spread[s]})
            for k, s in enumerate(model.states)
        })  # fmt: skip

    def differences(names: list[str], states: list[str]) -> xr.Dataset:
        return anrmse_differences(
            [[labelled(of[r].forecast, runs[r])[states] for r in names] for of in every.values()],
            [labelled(own[r].measured, runs[r])[states] for r in names],
        )

    waves = {r: "regular" if is_regular(runs[r]) else "irregular" for r in own}
    kinds = [kind for kind in ("irregular", "regular") if kind in waves.values()]
    groups = [list(model.states), *([s] for s in model.states)]
    tables = [
        [differences([r for r in own if waves[r] == kind], states) for states in groups]
        for kind in kinds
    ]

    def of_all(key: str) -> FloatArray:
        return np.array([[table[f"all_{key}"].values for table in of] for of in tables])

    error, upper = of_all("anrmse"), of_all("anrmse_upper")
    change = [1 / (1 + of_all(key)) - 1 for key in ("change", "upper", "lower")]
    most = np.where(np.isfinite(upper), upper, error)[:, :, 0]
    limit = np.select(
        [~np.isfinite(most), *(most < each for each in LIMITS)], [np.nan, *LIMITS], np.inf
    )
    # A baseline that is lost does not count.
    known = np.isfinite(error[:, :, 1:])
    labels = np.array([*every][1:] or [""])
    none = np.zeros(limit.shape, dtype=int)
    least = np.where(known, error[:, :, 1:], np.inf).argmin(axis=2) if len(every) > 1 else none
    above = np.where(known, change[2][:, :, 1:], -np.inf)
    most_above = np.nan_to_num(above, nan=np.inf).argmax(axis=2) if len(every) > 1 else none
    named = known.any(axis=2)
    ends = np.array([
        [True, *np.all([np.isfinite(own[r].forecast).all(0) for r in own if waves[r] == kind], 0)]
        for kind in kinds
    ])  # fmt: skip
    still = np.isnan(limit) & ends
    of_runs = np.hstack([[table["anrmse"].values[0] for table in of[1:]] for of in tables])
    each = xr.concat([of[0][["anrmse", "anrmse_lower", "anrmse_upper"]] for of in tables], "run")
    dims, signature = ("waves", "state", "model"), model.signature
    names = [r for kind in kinds for r in own if waves[r] == kind]
    ahead = [signature.input_map.look_ahead(runs[r], model.dt) - model.dt for r in names]
    reads = [signature.input_map.notes(runs[r]).get("conditional_on", "") for r in names]
    return xr.Dataset(
        {
            **{key: (("model", "run"), values.values) for key, values in each.data_vars.items()},
            "nrmse": (dims, error),
            "nrmse_lower": (dims, of_all("anrmse_lower")),
            "nrmse_upper": (dims, upper),
            "change": (dims, change[0]),
            "change_lower": (dims, change[1]),
            "change_upper": (dims, change[2]),
            "run_nrmse": (("channel", "run"), of_runs),
            "limit": (dims[:2], limit),
            "still": (dims[:2], still),
            "best": (dims[:2], np.where(named, labels[least], "")),
            "rival": (dims[:2], np.where(named, labels[most_above], "")),
            "better": (dims[:2], named & ((change[2][:, :, 1:] < 0) | ~known).all(axis=2)),
        },
        coords={
            "model": [*every],
            "run": names,
            "state": ["all", *model.states],
            "channel": list(model.states),
            "waves": kinds,
            "kind": ("run", [waves[r] for r in names]),
            "sea_state": ("run", [str(runs[r].attrs.get("sea_state", "")) for r in names]),
            "look_ahead": ("run", np.maximum(ahead, 0.0), {"units": "s"}),
        },
        attrs={
            "of": of,
            "conditional_on": str(next(filter(None, reads), "")),
            "lost": "; ".join(_lost(every, baselines or {})),
        },
    )


def _lost(every: Mapping[str, Mapping[str, FreeRun]], baselines: Mapping[str, Model]) -> list[str]:
    """Baselines that do not count in all runs, each with the reason."""
    told = [f"{label}: not all runs can be forecast" for label in baselines if label not in every]
    for label, free in list(every.items())[1:]:
        if bad := [r for r, each in free.items() if not np.isfinite(each.forecast).all()]:
            told.append(f"{label}: its forecast of {', '.join(bad)} diverges")
    return told
