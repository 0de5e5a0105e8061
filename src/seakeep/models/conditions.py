"""Runs that one model of all does not serve: what sets each apart, and where its probe stood."""

import contextlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import compress
from typing import Any, Literal

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, FloatArray
from seakeep.conventions import displayed, is_load
from seakeep.errors import DataError, RequestError, quiet, warn
from seakeep.models import labelled
from seakeep.models.alignment import ProbeAlignment
from seakeep.models.inputs import Scale
from seakeep.models.linear import HankelDMDcModel
from seakeep.models.selection import regular_periods
from seakeep.signals import encounter_period
from seakeep.signals.lags import parabola_peak
from seakeep.waves import phase_speed

PERIODS = 5.0
"""Length of the free runs that are judged, encounter periods."""
BETTER = 0.8
"""Part of the pooled model's error below which a model of the run alone says that it differs.

Half of one run is little to learn from: within one condition the pooled model is better."""
LEAST = 0.02
"""Gain, SD, below which nothing is said."""
STANDARD_ERRORS = 2.0
"""Standard errors over the windows by which it must be better."""
EXPLAINS = 0.7
"""Part of what the run's own model gains, in squared errors, that a reason must explain."""
DRIFTING = ("surge", "sway", "yaw")
"""Motions that nothing but a mooring brings back."""
LOST = 10.0
"""Error, SD, beyond which it counts no worse."""

Reason = Literal["input", "offset", "probe position", "scale", "dynamics"]


@dataclass(frozen=True)
class Disagreement:
    """A run that a model of all runs serves worse than one of half of it.

    Parameters
    ----------
    run : str
        The run.
    pooled, own : float
        Mean NRMSE of free runs on its second half, in SD of its first: of the model of the first
        halves of all runs, and of that of its own.
    reason : {"input", "offset", "probe position", "scale", "dynamics"}
        The mean of an input that lies outside what trained the others; or what makes up most of the
        difference, the last where nothing else does.
    channel : str
        Input, or state with the offset or the scale; empty for the others.
    value : float
        Mean or offset in units of the channel, distance in m, or factor; NaN for dynamics.
    spread : float
        Standard deviation of a distance, m.
    units : str
        SI unit of the channel.
    rival : str
        The other run, where only one is left: either may be wrong.
    placed : bool
        Whether the probe was tried at other places.
    """

    run: str
    pooled: float
    own: float
    reason: Reason = "dynamics"
    channel: str = ""
    value: float = np.nan
    spread: float = np.nan
    units: str = ""
    rival: str = ""
    placed: bool = True

    def describe(self) -> str:
        """A sentence, and what to do."""
        rest = self.rival or "the other runs"
        place = "no offset, scale or place of a probe explains it"
        if not self.placed:
            place = (
                "no offset or scale explains it, and the place of a probe was not tried: that "
                "takes water_depth in [rig] and the probe's x_position in [rig.positions]"
            )
        factor, units = displayed(self.units)
        units = f" {units}" if units not in ("", "1") else ""
        value, remedy = factor * self.value, "Correct its zero"
        if self.channel in DRIFTING or is_load(self.units):
            remedy = (
                "Of a moored vessel that may be real drift: give the model what drives it, such as "
                "a wind or observables = [{ kind = 'slow_squares', of = … }] in [model]. Else "
                "correct its zero"
            )
        what = {
            "input": f"the mean of {self.channel}, {value:.3g}{units}, is far from that of {rest}. "
            "If another condition, such as a wind, is the cause, fit one model per condition, or "
            "one that varies with it: parameter in [model]. Else correct its zero",
            "offset": f"{self.channel} lies {value:+.3g}{units} off where a model of {rest} has "
            f"it. {remedy}, or set centre = 'run' in [model]: departures from each run's means",
            "probe position": "its waves fit where they are carried by "
            f"{self.value:.3g} ± {self.spread:.1g} m, as if the probe stood elsewhere. Set "
            f"probe_offset = {self.value:.3g} in [runs.{self.run}], with alignment = "
            '{ mode = "dispersion", surge = "none" } in [model] if it has none, or correct the '
            "position",
            "scale": f"{self.channel} moves {self.value:.3g} times as much as in a model of "
            f"{rest}. If another heading or speed is the cause, fit one model per condition. Else "
            "check its calibration, or its sign where it is negative",
            "dynamics": f"{place}. Fit one model per condition, and forecast each with its own",
        }[self.reason]
        pair = f"{self.run} disagrees with {rest}"
        if self.rival:
            pair = f"{self.run} and {rest} disagree; which one is wrong, these data do not say"
        return (
            f"{pair}: free runs on the second half of {self.run} err {self.pooled:.2f} SD by a "
            f"model of all runs and {self.own:.2f} by one of its first half alone; {what}. One "
            "model of unlike conditions forecasts none of them well."
        )


def disagreements(
    spec: Any, runs: Datasets, states: Sequence[str], inputs: Sequence[str]
) -> list[Disagreement]:
    """Compare a model of all runs with one per run, on data that neither learnt from.

    Parameters
    ----------
    spec : HankelSettings
        Settings of a linear kind, which leave nothing to be chosen.
    runs : mapping of str to Dataset
        Training runs, cut at the end of their training windows.
    states, inputs : sequence of str
        Channels.

    Returns
    -------
    list of Disagreement
        Runs in irregular waves that need a model of their own, the one that differs most first,
        each from those after it; empty for a single run, and where halves are too short.
    """
    if len(runs) < 2 or not inputs:
        return []
    spec = spec.having(readouts=(), window=None, memory=0)  # a memory learns offsets of runs
    at_rest = replace(spec, alignment=ProbeAlignment(mode="dispersion", surge="none"))
    halves = labelled.first_halves(runs)

    def fitted(names: Iterable[str], settings: Any = spec) -> HankelDMDcModel:
        return settings.fit({name: halves[name] for name in names}, states, inputs)

    disagreeing: list[Disagreement] = []
    # Halves may be too short, and runs without waves; warnings were given of the fit of all.
    with quiet(), contextlib.suppress(DataError, RequestError):
        steps = round(PERIODS * labelled.mean_period(runs, inputs))
        judged = [name for name in runs if not regular_periods({name: runs[name]}, inputs)]
        alone = {name: fitted([name]) for name in judged}
        scales = {name: model.signature.state_scale for name, model in alone.items()}
        own = {name: _errors(alone[name], runs[name], steps, scales[name]) for name in judged}
        left = dict.fromkeys(runs)
        while len(left) > 1 and judged:  # the odd one out, then the next among the rest
            pooled = fitted(left)
            errors = {name: _errors(pooled, runs[name], steps, scales[name]) for name in judged}
            gains = {name: _gain(errors[name], own[name]) for name in judged}
            odd = max(judged, key=lambda name: gains[name])
            if not gains[odd]:
                break
            judged.remove(odd)
            del left[odd]
            others, placed = fitted(left), False
            reason = _input(others, runs[odd])
            reason = reason or _reason(others, runs[odd], steps, scales[odd], own[odd])
            if reason.get("reason") not in ("input", "offset"):
                with contextlib.suppress(DataError, RequestError):  # no depth, or no positions
                    reason = _place(fitted(left, at_rest), runs[odd]) or reason
                    placed = True
            whole, alike = (float(_scores(each[odd]).mean()) for each in (errors, own))
            rival = next(iter(left)) if len(left) == 1 else ""
            labels = others.state_labels + others.input_labels
            units = {each.name: each.units for each in labels}.get(reason.get("channel", ""), "")
            disagreeing.append(
                Disagreement(odd, whole, alike, units=units, rival=rival, placed=placed, **reason)
            )
    return disagreeing


def _scores(errors: FloatArray) -> FloatArray:
    """NRMSE of each window."""
    return np.sqrt((errors**2).mean(axis=1)).mean(axis=1)


def _gain(pooled: FloatArray, own: FloatArray) -> float:
    """By how much a model of all runs errs more than one of the run, if that is sure; else zero."""
    pooled, own = _scores(pooled), _scores(own)
    gain, doubt = pooled - own, STANDARD_ERRORS * (pooled - own).std(ddof=1) / len(own) ** 0.5
    is_certain = gain.mean() > max(doubt, LEAST) and own.mean() < BETTER * pooled.mean()
    return float(gain.mean()) if is_certain else 0.0


def _series(
    model: HankelDMDcModel, run: xr.Dataset, steps: int, scale: Scale
) -> tuple[FloatArray, FloatArray]:
    """Free runs end to end in the second half, and the measurement, (window, steps, N), in SD."""
    starts = model.judged_starts(run, steps, run.sizes["time"] // 2)
    if len(starts) < 2:
        raise DataError("no two windows fit into half of the run.")
    predicted, measured = (
        (each - scale.centre) / scale.spread
        for each in model.judged_runs(run, "the run", starts, steps)
    )
    return np.where(np.isfinite(predicted), predicted, measured + LOST), measured


def _errors(model: HankelDMDcModel, run: xr.Dataset, steps: int, scale: Scale) -> FloatArray:
    """Errors of these, at most LOST."""
    predicted, measured = _series(model, run, steps, scale)
    return np.clip(measured - predicted, -LOST, LOST)


def _input(model: HankelDMDcModel, run: xr.Dataset) -> dict[str, Any]:
    """The input whose mean lies outside what trained a model of other runs, if one does."""
    values = labelled.channel_matrix(run, model.inputs, "the run")
    found = model.coverage.conditions(values, model.signature)
    if not found.reasons[3].any():
        return {}
    at = int(np.argmax(found.reasons[3]))
    return {"reason": "input", "channel": model.inputs[at], "value": float(found.means[at])}


def _reason(
    model: HankelDMDcModel, run: xr.Dataset, steps: int, scale: Scale, own: FloatArray
) -> dict[str, Any]:
    """The offset or the scale of a state that explains what a model of other runs errs more."""
    # What a run starts with has an offset and a scale of its own; later the waves decide.
    predicted, measured, own = (
        each[:, steps // 2 :] for each in (*_series(model, run, steps, scale), own)
    )
    errors = (measured - predicted).reshape(-1, measured.shape[2])
    least = EXPLAINS * (np.mean(errors**2) - np.mean(own**2)) * errors.shape[1]
    offsets = errors.mean(axis=0)
    at = int(np.argmax(np.abs(offsets)))
    if np.sum(offsets**2) >= least:
        value = float(offsets[at] * scale.spread[at])
        return {"reason": "offset", "channel": model.states[at], "value": value}
    p, m = ((each - each.mean(axis=(0, 1))).reshape(errors.shape) for each in (predicted, measured))
    factors = np.sum(p * m, axis=0) / np.sum(p * p, axis=0)
    gains = np.mean((m - p) ** 2, axis=0) - np.mean((m - factors * p) ** 2, axis=0)
    at = int(np.argmax(gains))
    mean = float(offsets[at] ** 2)  # another unit moves the mean of a load too
    is_scale = gains.sum() + mean >= least and gains[at] >= (1 - EXPLAINS) * (gains[at] + mean)
    scaled = {"reason": "scale", "channel": model.states[at], "value": float(factors[at])}
    return scaled if is_scale else {}


def _place(model: HankelDMDcModel, run: xr.Dataset) -> dict[str, Any]:
    """A distance of the probe that explains the error of a model of other runs."""
    time = run["time"].values
    best = estimate_probe_offset(model, run, (float(time[len(time) // 2]), float(time[-1])))
    is_certain = best.interval[0] * best.interval[1] > 0
    if not is_certain or best.nrmse**2 > (1.0 - EXPLAINS) * best.nrmse_uncorrected**2:
        return {}
    return {"reason": "probe position", "value": best.offset, "spread": best.spread}


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
    errors = np.array([_offset_errors(model, part, distance) for distance in coarse])
    best = int(errors.mean(axis=1).argmin())
    step = (coarse[1] - coarse[0]) / 6.0
    fine = coarse[best] + step * np.arange(-FINE, FINE + 1)
    errors = np.array([_offset_errors(model, part, distance) for distance in fine])

    def least(mean: FloatArray) -> float:
        return float(fine[0] + step * parabola_peak(-mean)[0])

    offset = least(errors.mean(axis=1))
    if best in (0, coarse.size - 1):
        warn(
            f"the offset found, {offset:.3g} m, lies at the end of the distances tried, {low:.3g} "
            f"to {high:.3g} m. Widen bounds, or check the run: another sea or another probe."
        )
    rng = np.random.default_rng(0)
    blocks = np.stack([block.mean(axis=1) for block in np.array_split(errors, BLOCKS, axis=1)])
    drawn = rng.integers(0, BLOCKS, (RESAMPLES, BLOCKS))
    offsets = np.array([least(blocks[rows].mean(axis=0)) for rows in drawn])
    return ProbeOffset(
        offset=offset,
        spread=float(offsets.std(ddof=1)),
        interval=(float(np.quantile(offsets, 0.025)), float(np.quantile(offsets, 0.975))),
        nrmse=float(np.sqrt(errors.mean(axis=1).min())),
        nrmse_uncorrected=float(np.sqrt(_offset_errors(model, part, 0.0).mean())),
        span=(float(part["time"][0]), float(part["time"][-1])),
    )


def _part(model: HankelDMDcModel, run: xr.Dataset, span: tuple[float, float]) -> xr.Dataset:
    name = labelled.run_name(run, "the run")
    labelled.check_run(run, name)
    slack = 1e-3 * model.dt
    part = run.sel(time=slice(span[0] - slack, span[1] + slack))
    needed = model.history_samples + BLOCKS + model.signature.input_after
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
    channel = next(compress(model.inputs, alignment.carried))
    period = encounter_period(part[channel].values, model.dt)
    depth = part.attrs.get("water_depth", alignment.water_depth)
    speed = alignment.celerity_of(part)
    if speed is None:
        speed = float(phase_speed(2 * np.pi / period, np.inf if depth is None else depth))
    return -0.5 * speed * period, 0.5 * speed * period


def _offset_errors(model: HankelDMDcModel, part: xr.Dataset, distance: float) -> FloatArray:
    """Squared error over variance at each instant, mean over the states."""
    run, name = part.assign_attrs(probe_offset=float(distance)), labelled.run_name(part, "the run")
    at = model.history_samples - 1
    # The last step reads the input `lead_samples` after the instant that it starts from.
    steps = part.sizes["time"] - model.history_samples - model.signature.input_after
    (predicted,), (measured,) = model.judged_runs(run, name, [at], steps)
    out: FloatArray = np.mean((predicted - measured) ** 2 / measured.var(axis=0), axis=1)
    if not np.all(np.isfinite(out)):
        raise DataError(
            f"the forecast of {name} from {float(part['time'][at]):g} s cannot be judged at an "
            f"offset of {distance:.3g} m: it diverges, or a state is constant. Look for a constant "
            "state, or raise ridge."
        )
    return out
