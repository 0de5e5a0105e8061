"""What a model is worth: its error over the tests beside baselines, and what it can be used for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.check.parts import FreeRun, Known, beside, free_runs, is_regular, judged
from seakeep.metrics import anrmse_differences
from seakeep.models import Model

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
    of_kind: dict[str, list[str]] = {}
    for r in sorted(own, key=lambda r: waves[r] == "regular"):
        of_kind.setdefault(waves[r], []).append(r)
    names = [r for of in of_kind.values() for r in of]
    groups = {"all": list(model.states), **{state: [state] for state in model.states}}
    tables = [
        [differences(of_waves, states) for states in groups.values()]
        for of_waves in of_kind.values()
    ]
    both = xr.concat(
        [xr.concat([each.drop_dims("run") for each in row], "state") for row in tables], "waves"
    )
    ends = ("", "_lower", "_upper")
    out = xr.Dataset({f"nrmse{end}": both[f"all_anrmse{end}"] for end in ends})
    # Of the model from a baseline: the other way round, so that the bounds change places.
    for key, other in {"": "change", "_lower": "upper", "_upper": "lower"}.items():
        out[f"change{key}"] = 1 / (1 + both[f"all_{other}"]) - 1
    out = out.assign_coords(model=list(every), state=list(groups), waves=list(of_kind))
    upper, baseline = out["nrmse_upper"], out.isel(model=slice(1, None))
    most = upper.where(np.isfinite(upper), out["nrmse"]).sel(model="model", drop=True)
    limits = [most < each for each in LIMITS]
    known = baseline["nrmse"].notnull()  # a baseline that is lost does not count
    whole = [
        [True, *np.all([np.isfinite(own[r].forecast).all(axis=0) for r in of], axis=0)]
        for of in of_kind.values()
    ]
    out["limit"] = most.dims, np.select([~np.isfinite(most), *limits], [np.nan, *LIMITS], np.inf)
    out["still"] = np.isnan(out["limit"]) & whole
    ranks = {"best": -baseline["nrmse"], "rival": baseline["change_upper"].fillna(np.inf)}
    for key, rank in ranks.items():
        none = xr.full_like(most, "", dtype=object)
        label = rank.where(known, -np.inf).idxmax("model") if known.size else none
        out[key] = label.where(known.any("model"), "")
    is_better = (baseline["change_upper"] < 0) | ~known
    out["better"] = known.any("model") & is_better.all("model")
    of_runs = xr.concat([row[0][[f"anrmse{end}" for end in ends]] for row in tables], "run")
    out = out.assign({key: (each.dims, each.values) for key, each in of_runs.items()})
    out["run_nrmse"] = (
        ("channel", "run"),
        np.hstack([[table["anrmse"].values[0] for table in row[1:]] for row in tables]),
    )
    signature = model.signature
    ahead = [signature.input_map.look_ahead(runs[r], model.dt) - model.dt for r in names]
    reads = [signature.input_map.notes(runs[r]).get("conditional_on", "") for r in names]
    return out.assign_coords(
        run=names,
        channel=list(model.states),
        kind=("run", [waves[r] for r in names]),
        sea_state=("run", [str(runs[r].attrs.get("sea_state", "")) for r in names]),
        look_ahead=("run", np.maximum(ahead, 0.0), {"units": "s"}),
    ).assign_attrs(
        of=of,
        conditional_on=str(next(filter(None, reads), "")),
        lost="; ".join(_lost(every, baselines or {})),
    )


def _lost(every: Mapping[str, Mapping[str, FreeRun]], baselines: Mapping[str, Model]) -> list[str]:
    """Baselines that do not count in all runs, each with the reason."""
    reasons = [
        f"{label}: not all runs can be forecast" for label in baselines if label not in every
    ]
    for label, free in list(every.items())[1:]:
        if bad := [r for r, each in free.items() if not np.isfinite(each.forecast).all()]:
            reasons.append(f"{label}: its forecast of {', '.join(bad)} diverges")
    return reasons
