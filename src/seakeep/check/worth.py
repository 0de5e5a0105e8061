"""What a model is worth: its error over the tests beside baselines, and where it may be used."""

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, FloatArray
from seakeep.check.parts import (
    Known,
    beside,
    free_runs,
    is_regular,
    judged,
    no_energy,
    reference_probe,
    used_parts,
    whole_span,
)
from seakeep.core.spectra import dominant_frequency
from seakeep.errors import DataError
from seakeep.metrics import anrmse_differences
from seakeep.models import Model, outside_training
from seakeep.signals import encounter_period
from seakeep.signals.time_axis import inside
from seakeep.waves import wavenumber

LIMITS = (0.1, 0.3, 0.7)
"""NRMSE at which the use of a forecast changes: 99, 91 and 51 % of the variance are explained."""


def worth(
    model: Model,
    runs: Datasets,
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
    own = free_runs(model, runs, free, others=(baselines or {}).values())
    every = {"model": own, **beside(baselines, runs, own, free)}
    spread = model.signature.state_scale.spread

    def labelled(values: FloatArray, run: xr.Dataset, states: list[str]) -> xr.Dataset:
        return xr.Dataset({
            s: ("time", values[:, k], {**run[s].attrs, "training_std": spread[k]})
            for k, s in enumerate(model.states)
        })[states]  # fmt: skip

    def differences(names: list[str], states: list[str]) -> xr.Dataset:
        return anrmse_differences(
            [[labelled(of[r].forecast, runs[r], states) for r in names] for of in every.values()],
            [labelled(own[r].measured, runs[r], states) for r in names],
        )

    waves = {r: "regular" if is_regular(runs[r]) else "irregular" for r in own}
    of_kind = {kind: [r for r in own if waves[r] == kind] for kind in sorted({*waves.values()})}
    groups = {"all": list(model.states), **{state: [state] for state in model.states}}
    tables = [
        xr.concat([differences(names, states) for states in groups.values()], "state")
        for names in of_kind.values()
    ]
    both = xr.concat([table.drop_dims("run") for table in tables], "waves")
    ends = ("", "_lower", "_upper")
    out = xr.Dataset({f"nrmse{end}": both[f"all_anrmse{end}"] for end in ends}, attrs=both.attrs)
    # Of the model from a baseline: the other way round, so that the bounds change places.
    for key, other in {"": "change", "_lower": "upper", "_upper": "lower"}.items():
        out[f"change{key}"] = 1 / (1 + both[f"all_{other}"]) - 1
    out = out.assign_coords(model=list(every), state=list(groups), waves=list(of_kind))
    upper = out["nrmse_upper"]
    most = upper.where(np.isfinite(upper), out["nrmse"]).sel(model="model", drop=True)
    limits = [most < each for each in LIMITS]
    out["limit"] = most.dims, np.select([~np.isfinite(most), *limits], [np.nan, *LIMITS], np.inf)
    whole = [
        [True, *np.all([np.isfinite(own[r].forecast).all(axis=0) for r in of], axis=0)]
        for of in of_kind.values()
    ]
    out["still"] = np.isnan(out["limit"]) & whole
    # A baseline that is lost does not count; the model stands for none.
    known = out["nrmse"].notnull() & (out["model"] != "model")
    names = xr.DataArray(["", *list(every)[1:]], dims="model")
    ranks = {"best": -out["nrmse"], "rival": out["change_upper"].fillna(np.inf)}
    for key, rank in ranks.items():
        out[key] = names[rank.where(known, -np.inf).argmax("model")]
    out["better"] = known.any("model") & ((out["change_upper"] < 0) | ~known).all("model")
    of_runs = xr.concat([table.drop_vars(both) for table in tables], "run")
    for end in ends:
        out[f"anrmse{end}"] = of_runs[f"anrmse{end}"].isel(state=0)
    errors = of_runs["anrmse"].isel(model=0, state=slice(1, None))
    out["run_nrmse"] = errors.rename(state="channel")
    order = [r for names in of_kind.values() for r in names]
    reasons = [
        f"{label}: not all runs can be forecast" for label in baselines or () if label not in every
    ]
    for label, free_of in [*every.items()][1:]:
        if bad := [r for r, each in free_of.items() if not np.isfinite(each.forecast).all()]:
            reasons.append(f"{label}: its forecast of {', '.join(bad)} diverges")
    input_map = model.signature.input_map
    ahead = [input_map.look_ahead(runs[r], model.dt) - model.dt for r in order]
    aligned = input_map.alignment
    reads = aligned.settings.surge_channel if aligned and input_map.reads_surge else ""
    return out.assign_coords(
        run=order,
        channel=list(model.states),
        kind=("run", [waves[r] for r in order]),
        sea_state=("run", [str(runs[r].attrs.get("sea_state", "")) for r in order]),
        look_ahead=("run", np.maximum(ahead, 0.0), {"units": "s"}),
    ).assign_attrs(
        of=of,
        conditional_on=reads,
        lost="; ".join(reasons),
    )


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
            used = inside(part.time, (np.inf, -np.inf) if span is None else span, model.dt)
            if used.sum() >= 16:
                row[:3] = _sea(part.inputs[used, reference], model.dt, part.run)
                row[3] = np.nan if surge is None else part.states[used, surge].mean()
        facts.append(of_parts)
        why = []
        if np.isfinite(of_parts[1, 1]):
            begin, end = whole_span(part.run, "test")
            why = outside_training(model, part.run, begin, round((end - begin) / model.dt))
        outside.append("; ".join(why))
    if not parts:
        raise DataError("no run in waves has all channels of the model: none can be compared.")
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


def _sea(wave: FloatArray, dt: float, run: xr.Dataset) -> tuple[float, float, float]:
    """Height, period and steepness of a wave record; NaN where it is constant."""
    if not np.ptp(wave) > 0:
        return np.nan, np.nan, np.nan
    regular = is_regular(run)
    height = (2 * np.sqrt(2) if regular else 4.0) * wave.std()
    period = 1 / dominant_frequency(wave, dt) if regular else encounter_period(wave, dt)
    depth = run.attrs.get("water_depth")
    steepness = np.nan
    if depth:
        steepness = height * wavenumber(2 * np.pi / period, depth) / (2 * np.pi)
    return height, period, steepness
