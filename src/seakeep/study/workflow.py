"""A campaign's settings become a model: the one place where both rooms meet."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from seakeep.campaign import Campaign, load_prepared
from seakeep.campaign.prepare import Progress
from seakeep.errors import RequestError
from seakeep.models import HankelDMDc, HankelDMDcModel, HankelEnsemble
from seakeep.study.needs import needs_of
from seakeep.study.repeats import warn_of_repeats
from seakeep.study.slow import warn_of_slow_model
from seakeep.study.specs import Spec, build_spec, counts_in_periods
from seakeep.toml import Length

__all__ = ["fit_campaign", "training_runs"]

NOTHING_TRAINS = (
    "no run of the campaign trains a model. Give one role = 'train', or a span "
    "train = [begin, end]."
)


def training_runs(
    prepared: Mapping[str, xr.Dataset], window: int | None = None
) -> dict[str, xr.Dataset]:
    """Parts of prepared runs that train.

    Parameters
    ----------
    prepared : mapping of str to Dataset
        Runs of a campaign, as ``campaign.prepare()`` gives them.
    window : int, optional
        Most snapshots that a model takes from the end of the span. Where the span holds them,
        what lies before the span is kept, so that the delay history may come from there. Without
        it the whole span is the window, and the history lies inside it.

    Returns
    -------
    dict of str to Dataset
        Each cut at the end of its ``train_span``.

    Raises
    ------
    RequestError
        If no run trains.
    """
    runs = {}
    for name, run in prepared.items():
        if "train_span" not in run.attrs:
            continue
        runs[name] = between(run, run.attrs["train_span"])
        if window is not None and runs[name].sizes["time"] >= window:
            begin = float(run["time"][0])
            runs[name] = between(run, (begin, run.attrs["train_span"][1]))
    if not runs:
        raise RequestError(NOTHING_TRAINS)
    return runs


def between(run: xr.Dataset, span: tuple[float, float]) -> xr.Dataset:
    """Part of a run between two of its own instants, both included."""
    slack = 1e-6 * float(run.attrs.get("dt", 1.0))
    return run.sel(time=slice(float(span[0]) - slack, float(span[1]) + slack))


def fit_campaign(
    campaign: Campaign, model: str | None = None, progress: Progress | None = None
) -> HankelDMDcModel | HankelEnsemble:
    """Identify the model, or the ensemble, that a campaign describes from its training runs.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    model : str, optional
        Key in ``[models.NAME]``; by default the table ``[model]``.
    progress : callable, optional
        Called as ``progress(done, total, run)`` while runs are prepared.

    Returns
    -------
    HankelDMDcModel or HankelEnsemble
        As the table's ``kind`` says.

    Raises
    ------
    RequestError
        If the campaign describes no such model, or no run trains.
    DataError
        If a run cannot be read or used.

    Warns
    -----
    SeakeepWarning
        If the test part of a training run repeats the model's training input, or the training
        windows (of an ensemble the longest) hold fewer than five periods of a slow motion.
    """
    settings = campaign.model(model)
    prepared = load_prepared(campaign, names=campaign.training_runs, progress=progress)
    if not prepared:
        raise RequestError(NOTHING_TRAINS)
    dt = float(next(iter(prepared.values())).attrs["dt"])
    period = campaign.encounter_period() if counts_in_periods(settings) else None
    spec = build_spec(settings, period, dt)
    runs = training_runs(prepared, _longest_window(spec, dt))
    stop = settings.stop
    if isinstance(stop, Length):
        stop = None if period is None else stop.at(period)
    identified = spec.fit(runs, list(settings.states), list(settings.inputs), stop=stop)
    both = {name: run for name, run in prepared.items() if "test_span" in run.attrs}
    warn_of_repeats(identified, campaign, both)
    if spec.standardize:
        warn_of_slow_model(identified, runs)
    return identified


def _longest_window(spec: Spec, dt: float) -> int | None:
    """Most snapshots before the end of a span, where the history may lie before them."""
    if spec.history == "inside":
        return None
    if isinstance(spec, HankelDMDc):
        return spec.window
    if spec.train_length is None or spec.train_on == "windows":
        return None
    return needs_of([spec], dt).snapshots
