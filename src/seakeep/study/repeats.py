"""Warnings about test inputs that were in the training data."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from seakeep.campaign import Campaign, load_prepared
from seakeep.errors import SeakeepWarning
from seakeep.models import HankelDMDcModel, HankelEnsemble
from seakeep.signals import find_leakage

__all__ = ["warn_of_repeats"]


def warn_of_repeats(
    model: HankelDMDcModel | HankelEnsemble, campaign: Campaign, tested: Mapping[str, xr.Dataset]
) -> None:
    """Warn where a test run's input repeats the model's training input, up to a constant phase.

    Training runs that the campaign marks as regular waves are left out: regular waves repeat by
    their nature. So are runs that the campaign does not have.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        The model, which knows the runs and spans it was trained on.
    campaign : Campaign
        The campaign.
    tested : mapping of str to Dataset
        Prepared test runs.

    Warns
    -----
    SeakeepWarning
        One for each test run that repeats.
    """
    training = {
        name: span
        for name, span in model.training_spans.items()
        if name in campaign.settings.runs and campaign.settings.runs[name].waves != "regular"
    }
    if not (model.inputs and training):
        return
    missing = [name for name in training if name not in tested]
    prepared = dict(tested) | (load_prepared(campaign, names=missing) if missing else {})
    pieces = {
        name: prepared[name].sel(time=slice(first - 1e-6, stop + 1e-6))
        for name, (first, stop) in training.items()
    }
    for name, run in tested.items():
        part = _test_part(run, pieces.get(name))
        # What a member leaves of a training run is too short to be judged.
        enough = name not in training or part.sizes["time"] >= model.history_samples
        if enough and campaign.settings.runs[name].waves != "regular":
            _warn(model.inputs, pieces, name, part, model.dt)


def _test_part(run: xr.Dataset, trained: xr.Dataset | None) -> xr.Dataset:
    span = run.attrs.get("test_span")
    if span is not None:
        return run.sel(time=slice(span[0] - 1e-6, span[1] + 1e-6))
    if trained is not None:  # whoever tests on the training part knows that it repeats
        return run.sel(time=slice(float(trained["time"][-1]) + 1e-6, None))
    return run


def _warn(
    inputs: Sequence[str], pieces: Mapping[str, xr.Dataset], name: str, test: xr.Dataset, dt: float
) -> None:
    for channel in inputs:
        records = {key: piece[channel].values for key, piece in pieces.items() if channel in piece}
        whole = all(np.all(np.isfinite(each)) for each in (*records.values(), test[channel].values))
        if not (records and whole) or min(test.sizes["time"], *map(len, records.values())) < 8:
            continue
        found = find_leakage(list(records.values()), test[channel].values, dt)
        if found is None:
            continue
        source = list(records)[found.training]
        begin = float(test["time"][0]) + found.test_start
        origin = float(pieces[source]["time"][0]) + found.training_start
        warnings.warn(
            f"the input '{channel}' of {name} repeats training input: {100 * found.share:.0f} % of "
            f"it, such as from t = {begin:.4g} s on, is what {source} holds from t = {origin:.4g} "
            f"s on, turned by {np.degrees(found.phase):.0f} degrees (correlation "
            f"{found.correlation:.3f}). This test shows memory, not skill: test on another run.",
            SeakeepWarning,
            stacklevel=4,
        )
        return
