"""A campaign's settings become a model: the one place where both rooms meet."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from seakeep.campaign import Campaign, ModelSettings, load_prepared
from seakeep.campaign.periods import Periods, counted
from seakeep.campaign.prepare import Progress
from seakeep.errors import RequestError
from seakeep.models import HankelDMDc, HankelDMDcModel
from seakeep.models.settings import periods_to_samples
from seakeep.study.repeats import warn_of_repeats

__all__ = ["build_spec", "fit_campaign", "training_runs"]


NOTHING_TRAINS = (
    "no run of the campaign trains a model. Give one role = 'train', or a span "
    "train = [begin, end]."
)


def build_spec(settings: ModelSettings, encounter_period: float | None, dt: float) -> HankelDMDc:
    """Turn the ``[model]`` table of a campaign into the settings of a model.

    Parameters
    ----------
    settings : ModelSettings
        The table: a preset, keys of the constructor, or a preset with keys that override it.
    encounter_period : float or None
        Mean encounter period, s; a preset needs it.
    dt : float
        Time step of the prepared runs, s.

    Returns
    -------
    HankelDMDc
        The settings.

    Raises
    ------
    RequestError
        If the kind of model is not known, a preset has no encounter period, or a key that has no
        default is missing.
    """
    if settings.kind != "hankel_dmdc":
        raise RequestError(
            f"kind = '{settings.kind}' is not available in this version. Use kind = 'hankel_dmdc'."
        )
    stated = settings.arguments()
    stated.pop("stop", None)
    if encounter_period is None and (settings.preset is not None or any(counted(settings))):
        what = f"preset = '{settings.preset}'" if settings.preset else "the model"
        raise RequestError(
            f"{what} counts in encounter periods, and the campaign has none. State "
            "encounter_period (s) in [campaign]."
        )
    for key, value in stated.items():
        if isinstance(value, Periods) and encounter_period is not None:
            stated[key] = periods_to_samples(value.count, encounter_period, dt)
    if settings.preset is not None and encounter_period is not None:
        preset = HankelDMDc.paper if settings.preset == "paper" else HankelDMDc.recommended
        base = preset(encounter_period, dt)
        names = base.__dataclass_fields__
        return HankelDMDc(**{**{name: getattr(base, name) for name in names}, **stated})
    missing = [key for key in ("state_delays", "input_delays", "ridge") if key not in stated]
    if missing:
        raise RequestError(
            f"the [model] table states no {missing[0]}. Add {', '.join(missing)}, or a preset: "
            "preset = 'recommended' or 'paper'."
        )
    return HankelDMDc(**stated)


def training_runs(
    prepared: Mapping[str, xr.Dataset], window: int | None = None
) -> dict[str, xr.Dataset]:
    """Parts of prepared runs that train.

    Parameters
    ----------
    prepared : mapping of str to Dataset
        Runs of a campaign, as ``campaign.prepare()`` gives them.
    window : int, optional
        Snapshots that a model takes from the end of the span. Where the span holds them, what
        lies before the span is kept, so that the delay history may come from there. Without it
        the whole span is the window, and the history lies inside it.

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
) -> HankelDMDcModel:
    """Identify the model that a campaign describes from its training runs.

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
    HankelDMDcModel
        The model.

    Raises
    ------
    RequestError
        If the campaign describes no such model, or no run trains.
    DataError
        If a run cannot be read or used.

    Warns
    -----
    SeakeepWarning
        If the test part of a training run repeats the model's training input.
    """
    settings = campaign.model(model)
    prepared = load_prepared(campaign, names=campaign.training_runs, progress=progress)
    if not prepared:
        raise RequestError(NOTHING_TRAINS)
    dt = float(next(iter(prepared.values())).attrs["dt"])
    needed = settings.preset is not None or any(counted(settings))
    period = campaign.encounter_period() if needed else None
    spec = build_spec(settings, period, dt)
    runs = training_runs(prepared, spec.window if spec.history == "before" else None)
    stop = settings.stop
    if isinstance(stop, Periods) and period is not None:
        stop = stop.at(period)
    identified = spec.fit(runs, list(settings.states), list(settings.inputs), stop=stop)
    both = {name: run for name, run in prepared.items() if "test_span" in run.attrs}
    warn_of_repeats(identified, campaign, both)
    return identified
