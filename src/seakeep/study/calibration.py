"""Margins that calibrate the band of a study's ensembles, from training data alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.core.calibration import conformal_margin
from seakeep.models.calibration import held_out_scores
from seakeep.models.fitted_ensemble import HankelEnsemble
from seakeep.study.plan import Plan
from seakeep.study.windows import TrainingSet
from seakeep.study.workflow import between

__all__ = ["calibration_arrays", "calibration_name"]

Runs = Mapping[str, xr.Dataset]
Fit = Callable[[TrainingSet], HankelEnsemble]


def calibration_name(model: str, training: int) -> str:
    """Name of the file with the margins of an ensemble of one training set."""
    return f"{model}.t{training:02d}.calibration"


def calibration_arrays(
    plan: Plan, runs: Runs, training: TrainingSet, fitted: HankelEnsemble, fit: Fit
) -> dict[str, Any]:
    """Find the margins of an ensemble on windows as long as those of the first test set.

    The windows lie in the training spans, clear of what the members have read. Where these read
    all of it (runs left out, or pooled), each run is forecast by an ensemble that learnt from the
    others. No test window is looked at.

    Parameters
    ----------
    plan : Plan
        The study.
    runs : mapping of str to Dataset
        Prepared runs.
    training : TrainingSet
        What the ensemble learnt from.
    fitted : HankelEnsemble
        The ensemble.
    fit : callable
        Fits the same ensemble to another training set.

    Returns
    -------
    dict of str to array
        ``margin``, ``blocks`` and ``warranted`` over channels, and the number of ``windows``;
        NaN without any.
    """
    steps = next(iter(plan.tests.values()))[0].steps
    if training.left_out or len(training.runs) > 1:
        scores = _of_others(plan, runs, training, steps, fit)
    else:
        names = plan.calibrated_on
        parts = {name: between(runs[name], runs[name].attrs["train_span"]) for name in names}
        scores = list(held_out_scores(fitted, parts, steps, plan.level).values())
    if not scores:
        nothing = np.full(len(plan.states), np.nan)
        return {"margin": nothing, "blocks": nothing, "warranted": nothing, "windows": 0}
    every = np.concatenate(scores)
    found = conformal_margin(every, plan.level)
    return {
        "margin": found.margin,
        "blocks": found.blocks,
        "warranted": found.warranted,
        "windows": len(every),
    }


def _of_others(
    plan: Plan, runs: Runs, training: TrainingSet, steps: int, fit: Fit
) -> list[npt.NDArray[np.float64]]:
    """Scores in the runs of a training set, each by what the other ones teach."""
    groups = [each.left_out for each in plan.training if each is not training and each.left_out]
    scores: list[npt.NDArray[np.float64]] = []
    for group in groups or [(run,) for run in training.runs]:
        rest = tuple(span for span in training.spans if span[0] not in group)
        held = {n: between(runs[n], (b, e)) for n, b, e in training.spans if n in group}
        if rest and held:
            ensemble = fit(TrainingSet(f"{training.name}, calibration", rest))
            scores += held_out_scores(ensemble, held, steps, plan.level).values()
    return scores
