"""Runs that one model of all of them does not serve: which, and what sets each apart."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, FloatArray
from seakeep.errors import DataError, RequestError, SeakeepWarning
from seakeep.models import labelled
from seakeep.models.alignment import ProbeAlignment
from seakeep.models.interface import Scale
from seakeep.models.linear import HankelDMDcModel
from seakeep.models.offsets import estimate_probe_offset
from seakeep.models.selection import regular_periods
from seakeep.models.specs import HankelDMDc

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
LOST = 10.0
"""Error, SD, beyond which it counts no worse."""

Reason = Literal["offset", "probe position", "scale", "dynamics"]


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
    reason : {"offset", "probe position", "scale", "dynamics"}
        What makes up most of the difference; the last where nothing else does.
    channel : str
        State with the offset or the scale; empty for the others.
    value : float
        Offset in units of the channel, distance in m, or factor; NaN for dynamics.
    spread : float
        Standard deviation of a distance, m.
    rival : str
        The other run, where only one is left: either may be wrong.
    placed : bool
        Whether the probe was tried at other places.
    """

    run: str
    pooled: float
    own: float
    reason: Reason
    channel: str = ""
    value: float = np.nan
    spread: float = np.nan
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
        what = {
            "offset": f"{self.channel} lies {self.value:+.3g} off where a model of {rest} has it. "
            "Correct its zero, or set centre = 'run' in [model]: departures from each run's means",
            "probe position": "its waves fit where they are carried by "
            f"{self.value:.3g} ± {self.spread:.1g} m, as if the probe stood elsewhere. Set "
            f"probe_offset = {self.value:.3g} in [runs.{self.run}], with alignment = "
            '{ mode = "dispersion", surge = "none" } in [model] if it has none, or correct the '
            "position",
            "scale": f"{self.channel} moves {self.value:.3g} times as much as in a model of "
            f"{rest}. Check its calibration",
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
    spec: HankelDMDc, runs: Datasets, states: Sequence[str], inputs: Sequence[str]
) -> list[Disagreement]:
    """Compare a model of all runs with one per run, on data that neither learnt from.

    Parameters
    ----------
    spec : HankelDMDc
        Settings that leave nothing to be chosen.
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
    if len(runs) < 2 or not inputs or spec.parameter:  # then they differ on purpose
        return []
    spec = replace(spec, readouts=(), window=None, memory=0)  # a memory learns offsets of runs
    at_rest = replace(spec, alignment=ProbeAlignment(mode="dispersion", surge="none"))
    halves = {n: run.isel(time=slice(run.sizes["time"] // 2)) for n, run in runs.items()}

    def fitted(names: Iterable[str], settings: HankelDMDc = spec) -> HankelDMDcModel:
        return settings.fit({name: halves[name] for name in names}, states, inputs)

    disagreeing: list[Disagreement] = []
    # Halves may be too short, and runs without waves.
    with warnings.catch_warnings(), contextlib.suppress(DataError, RequestError):
        warnings.simplefilter("ignore", SeakeepWarning)  # given when all of the runs were fitted
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
            reason: tuple[Any, ...] | None
            reason = _reason(fitted(left), runs[odd], steps, scales[odd], own[odd])
            placed = False
            if reason is None or reason[0] != "offset":
                with contextlib.suppress(DataError, RequestError):  # no depth, or no positions
                    reason = _place(fitted(left, at_rest), runs[odd]) or reason
                    placed = True
            pair = [float(_scores(each[odd]).mean()) for each in (errors, own)]
            said = Disagreement(odd, pair[0], pair[1], *(reason or ("dynamics",)))
            rival = next(iter(left)) if len(left) == 1 else ""
            disagreeing.append(replace(said, rival=rival, placed=placed))
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


def _reason(
    model: HankelDMDcModel, run: xr.Dataset, steps: int, scale: Scale, own: FloatArray
) -> tuple[Reason, str, float] | None:
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
        return "offset", model.states[at], float(offsets[at] * scale.spread[at])
    p, m = ((each - each.mean(axis=(0, 1))).reshape(errors.shape) for each in (predicted, measured))
    factors = np.sum(p * m, axis=0) / np.sum(p * p, axis=0)
    gains = np.mean((m - p) ** 2, axis=0) - np.mean((m - factors * p) ** 2, axis=0)
    at = int(np.argmax(gains))
    return ("scale", model.states[at], float(factors[at])) if gains.sum() >= least else None


def _place(model: HankelDMDcModel, run: xr.Dataset) -> tuple[Reason, str, float, float] | None:
    """A distance of the probe that explains the error of a model of other runs."""
    time = run["time"].values
    best = estimate_probe_offset(model, run, (float(time[len(time) // 2]), float(time[-1])))
    is_certain = best.interval[0] * best.interval[1] > 0
    if not is_certain or best.nrmse**2 > (1.0 - EXPLAINS) * best.nrmse_uncorrected**2:
        return None
    return "probe position", "", best.offset, best.spread
