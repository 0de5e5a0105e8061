"""Skill against lead time: a model in service, to which waves to come are not known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import cast

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, whole_number
from seakeep.campaign import Campaign, load_prepared
from seakeep.campaign.prepare import Progress
from seakeep.errors import RequestError
from seakeep.models import Model, is_ensemble
from seakeep.models.labelled import channel_matrix
from seakeep.models.live import Servable, held_samples
from seakeep.quality import warn_of_runs
from seakeep.study.comparison import samples_of

STARTS = 24
"""Forecasts of a run: enough for a root mean square known to a seventh."""
PERIODS = 5
"""Longest lead where none is stated, in encounter periods."""
SHARE = 0.5
"""Part of the training SD below which the error is to stay, where none is stated."""


def nowcasts(
    models: Mapping[str, Model],
    campaign: Campaign,
    runs: Sequence[str] = (),
    steps: int | str | None = None,
    *,
    share: float = SHARE,
    level: float = 0.95,
    progress: Progress | None = None,
) -> dict[str, xr.Dataset]:
    """Play runs of a campaign to models in service, and judge what they forecast.

    Parameters
    ----------
    models : mapping of str to Model
        Models by name; an ensemble is held.
    campaign : Campaign
        The campaign.
    runs : sequence of str, optional
        Runs; by default those that test.
    steps : int or str, optional
        Longest lead, samples or a length; by default five encounter periods.
    share : float, optional
        Part of the training SD below which the error is to stay over the lead time.
    level : float, optional
        Probability of the band.
    progress : callable, optional
        Called as ``progress(done, total, what)`` after each run and model.

    Returns
    -------
    dict of str to Dataset
        :func:`nowcast` of each model, over ``run``.

    Raises
    ------
    RequestError
        If a model cannot serve, or a run is too short.
    """
    served = {name: _servable(name, model) for name, model in models.items()}
    prepared = load_prepared(campaign, names=list(runs) or campaign.test_runs)
    warn_of_runs(prepared.values(), {c for m in models.values() for c in (*m.states, *m.inputs)})
    out: dict[str, list[xr.Dataset]] = {name: [] for name in models}
    every, longest = list(product(served, prepared)), steps or f"{PERIODS} T"
    for done, (name, key) in enumerate(every, 1):
        model = served[name]
        count = samples_of(longest, campaign, prepared.values(), model.signature.dt, "steps")
        found = nowcast(model, prepared[key], count, share=share, level=level)
        out[name].append(found.assign_coords(run=key))
        if progress is not None:
            progress(done, len(every), f"{name}, {key}")
    return {name: xr.concat(each, "run") for name, each in out.items()}


def nowcast(
    model: Servable, run: xr.Dataset, steps: int, *, share: float = SHARE, level: float = 0.95
) -> xr.Dataset:
    """Play a run to a model in service, sample by sample, and judge its forecasts.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        What has ``live``.
    run : Dataset
        A prepared run; in its test span, if it states one, forecasts start at even distances.
    steps : int
        Longest lead, samples.
    share, level : float
        As in :func:`nowcasts`.

    Returns
    -------
    Dataset
        Over (channel, lead): ``error`` and ``claimed``, root mean square error and what the model
        says of it, in training SDs, and ``coverage`` of the band, %; over channel ``lead_time``,
        s, up to which ``error`` stays below ``attrs["share"]``: the longest lead where it never
        rises above. No wave after a start is read.

    Raises
    ------
    RequestError
        If no forecast of so many steps fits into the run.
    """
    whole_number(steps, "steps")
    signature = model.signature
    time, name = run["time"].values, str(run.attrs.get("run", "the run"))
    begin, end = run.attrs.get("test_span", (time[0], time[-1]))
    first = max(int(np.searchsorted(time, begin)), signature.history_samples - 1)
    last = int(np.searchsorted(time, end + 0.5 * signature.dt)) - 1 - steps
    if last < first:
        raise RequestError(
            f"{name} has {time.size} samples, and a forecast of {steps} steps takes "
            f"{signature.history_samples} of history before. Give fewer steps, or another run."
        )
    starts = set(np.linspace(first, last, min(STARTS, last - first + 1)).astype(int).tolist())
    u = channel_matrix(run, signature.inputs, name)
    y = channel_matrix(run, signature.states, name)
    spread = signature.state_scale.spread
    live = model.live(like=run)
    squares, claimed, inside = np.zeros((3, steps, len(spread)))
    for at in range(last + 1):
        live.step(u[at], y[at])
        if at in starts:
            found = live.forecast(steps, level=level)
            statistics = np.stack([found[each].values for each in signature.states], axis=-1)
            mean, std, lower, upper = statistics
            truth = y[at + 1 : at + steps + 1]
            squares += ((mean - truth) / spread) ** 2
            claimed += (std / spread) ** 2
            inside += (lower <= truth) & (truth <= upper)
    error = np.sqrt(squares / len(starts))
    skill = {
        "error": error,
        "claimed": np.sqrt(claimed / len(starts)),
        "coverage": 100.0 * inside / len(starts),
        "lead_time": signature.dt * held_samples(error <= share),
    }
    attrs = {"share": share, "level": level, "starts": len(starts)}
    return labelled_skill(skill, signature.dt, signature.states).assign_attrs(attrs)


def labelled_skill(
    values: Mapping[str, FloatArray],
    dt: float,
    states: Sequence[str],
    before: tuple[str, ...] = (),
) -> xr.Dataset:
    """Skill against lead time as a Dataset; `before` are dimensions before lead and channel."""
    units = {"error": "training SD", "claimed": "training SD", "coverage": "%", "lead_time": "s"}
    dims = dict.fromkeys(units, (*before, "lead", "channel"))
    dims["lead_time"] = (*before, "channel")
    leads = dt * np.arange(1, values["error"].shape[-2] + 1)
    return xr.Dataset(
        {key: (dims[key], values[key], {"units": unit}) for key, unit in units.items()},
        coords={
            "lead": ("lead", leads, {"units": "s", "long_name": "lead time"}),
            "channel": list(states),
        },
    )


def _servable(name: str, model: Model) -> Servable:
    if is_ensemble(model):
        return model.hold()
    if not hasattr(model, "live"):
        raise RequestError(
            f"{name} is a {model.kind} model, which cannot be put into service: it has no delayed "
            "states to estimate. Name a Hankel or ARX model."
        )
    return cast("Servable", model)
