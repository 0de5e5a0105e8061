"""Warnings about slow motions of which a training window holds too few periods."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.models import HankelDMDcModel, HankelEnsemble
from seakeep.models.slow import warn_of_slow_motions
from seakeep.signals import encounter_period
from seakeep.study.needs import needs_of
from seakeep.study.plan import Plan

__all__ = ["warn_of_slow_model", "warn_of_slow_study"]


def warn_of_slow_model(
    model: HankelDMDcModel | HankelEnsemble, runs: Mapping[str, xr.Dataset]
) -> None:
    """Warn of slow motions that the training windows of a model hold fewer than five periods of.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        The model; of an ensemble the longest windows count.
    runs : mapping of str to Dataset
        Its training runs; the encounter period is taken from their attributes, or where they have
        none from the first input. Nothing is said of a model that has neither.

    Warns
    -----
    SeakeepWarning
        As :func:`seakeep.models.slow.warn_of_slow_motions`.
    """
    spans = model.training_spans
    first = runs[next(iter(spans))]
    period = first.attrs.get("encounter_period")
    if period is None and not model.inputs:
        return
    if period is None:
        wave = first[model.inputs[0]].values
        period = encounter_period(wave[np.isfinite(wave)], model.dt)
    parts = {name: runs[name].sel(time=slice(None, end + 1e-6)) for name, (_, end) in spans.items()}
    trained = sum(last - first for first, last in spans.values())
    warn_of_slow_motions(parts, model.states, trained, float(period))


def warn_of_slow_study(plan: Plan, runs: Mapping[str, xr.Dataset]) -> None:
    """Warn once for a study, of the model and training set that hold the fewest slow periods.

    Parameters
    ----------
    plan : Plan
        The study.
    runs : mapping of str to Dataset
        Prepared runs.

    Warns
    -----
    SeakeepWarning
        As :func:`seakeep.models.slow.warn_of_slow_motions`.
    """
    least = None
    for model, spec in plan.specs.items():
        snapshots = needs_of([spec], plan.dt).snapshots
        longest = (snapshots - 1) * plan.dt if snapshots > 1 else float("inf")
        for training in plan.training if spec.standardize else ():
            trained = sum(min(stop - begin, longest) for _, begin, stop in training.spans)
            if least is None or trained < least[0]:
                least = trained, f"the training windows of '{model}' in '{training.name}'"
    if least is None:
        return
    begins: dict[str, list[float]] = {}
    for training in plan.training:
        for name, begin, stop in training.spans:
            begins.setdefault(name, []).extend((begin, stop))
    parts = {
        name: runs[name].sel(time=slice(min(ends) - 1e-6, max(ends) + 1e-6))
        for name, ends in begins.items()
    }
    warn_of_slow_motions(parts, list(plan.states), least[0], plan.encounter_period, least[1])
