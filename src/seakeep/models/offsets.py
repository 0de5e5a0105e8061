"""Offset of a run's wave probe, estimated with a model from a stated part of the run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray
from seakeep.errors import DataError, RequestError, warn
from seakeep.models import labelled
from seakeep.models.linear import HankelDMDcModel
from seakeep.signals import encounter_period
from seakeep.waves import phase_speed

COARSE = 20  # distances on either side of zero
FINE = 24  # distances on either side of the best, a sixth as far apart
BLOCKS = 10
RESAMPLES = 500


@dataclass(frozen=True)
class ProbeOffset:
    """Distance by which a run's elevation is to be carried, and how well it is known.

    Parameters
    ----------
    offset : float
        m, positive downstream.
    spread : float
        Standard deviation over resampled blocks of the stated part, m.
    interval : (float, float)
        95 % interval of these, m.
    nrmse, nrmse_uncorrected : float
        Error of the forecast of the stated part with the offset and without, root mean square
        over the states of their NRMSE.
    span : (float, float)
        Instants between which states and inputs were read, s.
    """

    offset: float
    spread: float
    interval: tuple[float, float]
    nrmse: float
    nrmse_uncorrected: float
    span: tuple[float, float]


def estimate_probe_offset(
    model: HankelDMDcModel,
    run: xr.Dataset,
    span: tuple[float, float],
    bounds: tuple[float, float] | None = None,
) -> ProbeOffset:
    """Find the distance at which the model forecasts a part of a run best.

    The part is forecast freely from its first possible instant at distances over the bounds; the
    least mean squared error decides. Its spread comes from resampling ten blocks of the part.

    Parameters
    ----------
    model : HankelDMDcModel
        A model with an alignment; its mode carries the elevation.
    run : Dataset
        The run; nothing outside the span is read.
    span : (float, float)
        First and last instant, s.
    bounds : (float, float), optional
        Least and greatest distance, m; by default half a wavelength of the mean period either
        way, since waves of one frequency fix the offset only up to whole wavelengths.

    Returns
    -------
    ProbeOffset
        To be set as ``run.attrs["probe_offset"]``.

    Raises
    ------
    RequestError
        If the model has no alignment, or the span does not fit the run or the model.
    DataError
        If the run has gaps there, or no forecast of it holds.

    Warns
    -----
    SeakeepWarning
        If the best distance lies at a bound.
    """
    if model.alignment is None:
        raise RequestError(
            "an offset is estimated with a model that aligns its input, and this one has no "
            "alignment. Fit it with alignment=seakeep.ProbeAlignment(mode='dispersion', "
            "surge='none')."
        )
    part = _part(model, run, span)
    low, high = _half_wavelengths(model, part) if bounds is None else bounds
    if not low < high:
        raise RequestError(f"bounds must rise; received {bounds!r} (m).")
    coarse = np.linspace(low, high, 2 * COARSE + 1)
    errors = np.array([_errors(model, part, distance) for distance in coarse])
    best = int(_least(coarse, errors.mean(axis=1))[1])
    step = coarse[1] - coarse[0]
    fine = coarse[best] + step / 6.0 * np.arange(-FINE, FINE + 1)
    errors = np.array([_errors(model, part, distance) for distance in fine])
    offset, at = _least(fine, errors.mean(axis=1))
    if best in (0, coarse.size - 1):
        warn(
            f"the offset found, {offset:.3g} m, lies at the end of the distances tried, {low:.3g} "
            f"to {high:.3g} m. Widen bounds, or check the run: another sea or another probe."
        )
    rng = np.random.default_rng(0)
    blocks = np.stack([block.mean(axis=1) for block in np.array_split(errors, BLOCKS, axis=1)])
    drawn = rng.integers(0, BLOCKS, (RESAMPLES, BLOCKS))
    offsets = np.array([_least(fine, blocks[rows].mean(axis=0))[0] for rows in drawn])
    interval = (float(np.quantile(offsets, 0.025)), float(np.quantile(offsets, 0.975)))
    return ProbeOffset(
        offset=offset,
        spread=float(offsets.std(ddof=1)),
        interval=interval,
        nrmse=float(np.sqrt(errors[at].mean())),
        nrmse_uncorrected=float(np.sqrt(_errors(model, part, 0.0).mean())),
        span=(float(part["time"][0]), float(part["time"][-1])),
    )


def _part(model: HankelDMDcModel, run: xr.Dataset, span: tuple[float, float]) -> xr.Dataset:
    name = labelled.run_name(run, "the run")
    labelled.check_run(run, name)
    slack = 1e-3 * model.dt
    part = run.sel(time=slice(span[0] - slack, span[1] + slack))
    needed = model.history_samples + BLOCKS + max(model.lead_samples - 1, 0)
    if part.sizes["time"] < needed:
        raise RequestError(
            f"the span [{span[0]:g}, {span[1]:g}] s holds {part.sizes['time']} samples of {name}; "
            f"an offset takes at least {needed} (the model's history, its look-ahead and {BLOCKS} "
            "more). Lengthen the span."
        )
    return part


def _half_wavelengths(model: HankelDMDcModel, part: xr.Dataset) -> tuple[float, float]:
    alignment = model.alignment
    assert alignment is not None
    channel = next(c for c, yes in zip(model.inputs, alignment.carried, strict=True) if yes)
    period = encounter_period(part[channel].values, model.dt)
    depth = part.attrs.get("water_depth", alignment.water_depth)
    speed = alignment.celerity_of(part)
    if speed is None:
        speed = float(phase_speed(2 * np.pi / period, np.inf if depth is None else depth))
    return -0.5 * speed * period, 0.5 * speed * period


def _errors(model: HankelDMDcModel, part: xr.Dataset, distance: float) -> FloatArray:
    """Squared error over variance at each instant, mean over the states."""
    run, name = part.assign_attrs(probe_offset=float(distance)), labelled.run_name(part, "the run")
    at = model.history_samples - 1
    # The last step reads the input `lead_samples` after the instant that it starts from.
    steps = part.sizes["time"] - model.history_samples - max(model.lead_samples - 1, 0)
    (predicted,), (measured,) = model.judged_runs(run, name, [at], steps)
    out: FloatArray = np.mean((predicted - measured) ** 2 / measured.var(axis=0), axis=1)
    if not np.all(np.isfinite(out)):
        raise DataError(
            f"the forecast of {name} from {float(part['time'][at]):g} s cannot be judged at an "
            f"offset of {distance:.3g} m: it diverges, or a state is constant. Look for a constant "
            "state, or raise ridge."
        )
    return out


def _least(places: FloatArray, values: FloatArray) -> tuple[float, int]:
    """Place of the least value, by a parabola through three, and its index."""
    at = int(np.argmin(values))
    if at in (0, values.size - 1):
        return float(places[at]), at
    before, here, after = values[at - 1 : at + 2]
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend > 0 else 0.0
    return float(places[at] + shift * (places[1] - places[0])), at
