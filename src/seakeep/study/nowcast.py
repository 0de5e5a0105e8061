"""Skill against lead time: a model in service, to which waves to come are not known."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
import xarray as xr

from seakeep.arrays import Groups, Progress, whole_number
from seakeep.campaign import Campaign, load_prepared
from seakeep.check.parts import whole_span
from seakeep.errors import RequestError
from seakeep.models import Model, is_ensemble
from seakeep.models.labelled import channel_matrix
from seakeep.models.live import Servable, held_samples
from seakeep.models.registry import is_linear
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
    level: float = 0.95,
    progress: Progress | None = None,
) -> Groups:
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
    every = {}
    for name, model in models.items():
        if (follows := served(model)) is None:
            raise RequestError(
                f"{name} is a {model.kind} model, which cannot be put into service: it has no "
                "delayed states to estimate. Name a Hankel or ARX model."
            )
        every[name] = follows
    channels = {c for m in models.values() for c in (*m.states, *m.inputs)}
    prepared = load_prepared(campaign, names=list(runs) or campaign.test_runs, channels=channels)
    longest = steps or f"{PERIODS} T"
    out: dict[str, list[xr.Dataset]] = {name: [] for name in models}
    for done, (name, key) in enumerate(product(every, prepared), 1):
        dt = every[name].signature.dt
        count = samples_of(longest, campaign, prepared.values(), dt, "steps")
        out[name].append(nowcast(every[name], prepared[key], count, level=level))
        if progress is not None:
            progress(done, len(every) * len(prepared), f"{name}, {key}")
    return {name: xr.concat(each, xr.Variable("run", list(prepared))) for name, each in out.items()}


def nowcast(model: Servable, run: xr.Dataset, steps: int, *, level: float = 0.95) -> xr.Dataset:
    """Play a run to a model in service, sample by sample, and judge its forecasts.

    Parameters
    ----------
    model : HankelDMDcModel or HankelEnsemble
        What has ``live``.
    run : Dataset
        A prepared run; in its test span, if it states one, forecasts start at even distances.
    steps : int
        Longest lead, samples.
    level : float
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
    begin, end = whole_span(run, "test")
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
            forecast = live.forecast(steps, level=level)
            statistics = np.stack([forecast[each].values for each in signature.states], axis=-1)
            mean, std, lower, upper = statistics
            truth = y[at + 1 : at + steps + 1]
            squares += ((mean - truth) / spread) ** 2
            claimed += (std / spread) ** 2
            inside += (lower <= truth) & (truth <= upper)
    error = np.sqrt(squares / len(starts))
    over, sd = ("lead", "channel"), {"units": "training SD"}
    leads = signature.dt * np.arange(1, steps + 1)
    return xr.Dataset(
        {
            "error": (over, error, sd),
            "claimed": (over, np.sqrt(claimed / len(starts)), sd),
            "coverage": (over, 100.0 * inside / len(starts), {"units": "%"}),
            "lead_time": ("channel", signature.dt * held_samples(error <= SHARE), {"units": "s"}),
        },
        coords={
            "lead": ("lead", leads, {"units": "s", "long_name": "lead time"}),
            "channel": list(signature.states),
        },
        attrs={"share": SHARE, "level": level, "starts": len(starts)},
    )


def served(model: Model) -> Servable | None:
    """What follows a run sample by sample: the model, or its members held; None without states."""
    if is_ensemble(model):
        return model.hold()
    return model if is_linear(model) else None
