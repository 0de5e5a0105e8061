"""From a campaign's settings to a model, with warnings about its training data."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import fields, replace
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import Datasets, Groups, Progress
from seakeep.campaign import Campaign, load_prepared
from seakeep.campaign.prepare import prepared_folder
from seakeep.check.parts import uses_of, whole_span
from seakeep.conventions import in_waves
from seakeep.errors import RequestError, SeakeepError, warn
from seakeep.models import KINDS, Model, Spec, is_ensemble, outside_training
from seakeep.models.conditions import disagreements
from seakeep.models.labelled import elevations, mean_period, until
from seakeep.models.settings import Select
from seakeep.models.specs import left_open
from seakeep.models.validity import warn_of_slow_motions
from seakeep.signals import find_leakage
from seakeep.study.plan import between, step_of
from seakeep.study.resolve import can_align, counts_in_periods, mistakes_of, resolve_model
from seakeep.toml import Length, refusal

MAPS = {"alignment", "lead", "observables"}
"""Settings that say how measured inputs drive a model."""


def training_runs(prepared: Datasets, window: int | None = None) -> Groups:
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
        Each cut at the end of its ``train_span``; a run with the ``role`` "train" and without
        spans is taken as a whole.

    Raises
    ------
    RequestError
        If no run trains.
    """
    runs = {}
    for name, run in prepared.items():
        if "train" not in uses_of(run):
            continue
        span = whole_span(run, "train")
        runs[name] = between(run, span)
        if window is not None and runs[name].sizes["time"] >= window:
            runs[name] = between(run, (float(run["time"][0]), span[1]))
    if not runs:
        raise RequestError(
            "no run of the campaign trains a model. Give one role = 'train', or a span "
            "train = [start, end]."
        )
    return runs


def fit_campaign(
    campaign: Campaign,
    model: str | None = None,
    progress: Progress | None = None,
    *,
    executor: Executor | None = None,
) -> Model:
    """Identify the model, or the ensemble, that a campaign describes from its training runs.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    model : str, optional
        Key in ``[models.NAME]``; by default the table ``[model]``.
    progress : callable, optional
        Called as ``progress(done, total, what)`` while runs are prepared, and while settings are
        chosen.
    executor : concurrent.futures.Executor, optional
        Tries settings side by side; the result does not depend on it.

    Returns
    -------
    Model
        As the table's ``kind`` says; where it states none and settings are chosen, a filter of the
        waves (``"fir"``) if that errs less by more than the noise.

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
        windows (for an ensemble the longest) hold fewer than five periods of a slow motion; of what
        the quality checks found in the model's channels; of tests outside the training (periods,
        heights and steepness of the waves, means of inputs, mean surge); and where the model reads
        inputs after the instant that it forecasts; and of runs that disagree with the others.
    """
    settings = campaign.model(model)
    spec, prepared, runs, stop = read_training(campaign, model, progress)
    dt = step_of(prepared)
    channels = list(settings.states), list(settings.inputs)
    open_spec, choice = left_open(spec), None
    how: dict[str, Any] = {"executor": executor, "progress": progress} if open_spec else {}
    if open_spec and "kind" not in settings.model_fields_set:
        choice = open_spec.settled(runs, *channels, stop, **how)
        how = {"selected": choice}
    identified: Any
    if choice and choice.rival:
        identified = replace(choice.rival.fit(runs, *channels, stop), selection=choice.note)
    else:
        identified = spec.fit(runs, *channels, stop, **how)
    both = {name: run for name, run in prepared.items() if "test_span" in run.attrs}
    warn_of_repeats(identified, campaign, both)
    # Other tests are not prepared for a warning.
    folder = prepared_folder(campaign)
    others = [n for n in campaign.test_runs if n not in both and (folder / f"{n}.nc").exists()]
    for name, run in in_waves(both | load_prepared(campaign, names=others)).items():
        begin, end = whole_span(run, "test")
        warn_of_waves(identified, run, name, begin, round((end - begin) / dt))
    latest = max(identified.signature.input_map.look_ahead(run, dt) for run in runs.values()) - dt
    if latest > 0.5 * dt:
        warn(
            f"forecasts of this model read the inputs up to {latest:.3g} s after the instant that "
            "they forecast: it needs them ahead of time."
        )
    if not settings.inputs and identified.settings.role == "model":
        warn(
            "the model has no inputs: it continues the states from themselves, and no waves drive "
            "it. Name the channels of the waves in inputs of [model]."
        )
    if spec.standardize:
        _warn_of_slow_model(identified, runs)
    single: Any = identified.centre if is_ensemble(identified) else identified
    varies = identified.signature.parameter  # then runs differ on purpose
    if single is not None and single.settings.role == "model" and not varies:
        for each in disagreements(single.settings, until(runs, stop), *channels):
            warn(each.describe())
    return identified


def read_training(
    campaign: Campaign, model: str | None, progress: Progress | None
) -> tuple[Spec, Groups, Groups, float | None]:
    """Read what a model of a campaign trains on; arguments and errors as :func:`fit_campaign`.

    Returns
    -------
    spec : Spec
        Settings of the model.
    prepared : dict of str to Dataset
        Runs that train, whole.
    runs : dict of str to Dataset
        Their training parts.
    stop : float or None
        Last instant of the training windows, s.
    """
    settings = campaign.model(model)
    place = ("model",) if model is None else ("models", model)
    if mistakes := mistakes_of(settings, place):
        raise refusal(campaign.path, "campaign", mistakes)
    prepared = load_prepared(
        campaign,
        names=campaign.training_runs,
        progress=progress,
        channels=[*settings.states, *settings.inputs],
    )
    runs = training_runs(prepared)
    dt = step_of(prepared)
    period = campaign.encounter_period() if counts_in_periods(settings) else None
    aligned = can_align(campaign.settings, settings.inputs)
    spec = resolve_model(settings, period, dt, aligned=aligned).spec
    if period is not None and (open_spec := left_open(spec)):
        chosen = open_spec.select or Select()
        spec = replace(open_spec, select=replace(chosen, period=chosen.period or period))
    stop = settings.stop
    if isinstance(stop, Length):
        stop = None if period is None else stop.at(period)
    needs = spec.needs(dt, period)
    if not needs.inside and needs.snapshots > 1 and getattr(spec, "train_on", "") != "windows":
        runs = training_runs(prepared, needs.snapshots)
    return spec, prepared, runs, stop


def fit_baselines(
    campaign: Campaign,
    states: Sequence[str],
    inputs: Sequence[str],
    progress: Progress | None = None,
    prepared: Datasets | None = None,
    *,
    beside: Model | None = None,
) -> dict[str, Model]:
    """Fit every baseline, with its recommended settings, to the training runs of a campaign.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    states, inputs : sequence of str
        Channels, those of the model that is compared.
    progress : callable, optional
        Called as ``progress(done, total, run)`` while runs are prepared.
    prepared : mapping of str to Dataset, optional
        Prepared runs, the training runs among them; by default these are prepared here.
    beside : Model, optional
        Model whose look-ahead, alignment and observables the baselines take, so that what differs
        is the method.

    Returns
    -------
    dict of str to Model
        By kind. A baseline that these runs cannot identify is left out.

    Raises
    ------
    RequestError
        If no run trains, or the campaign has no encounter period.
    DataError
        If a run cannot be read or used.

    Warns
    -----
    SeakeepWarning
        Of each baseline that is left out, with the reason.
    """
    if prepared is None:
        prepared = load_prepared(campaign, names=campaign.training_runs, progress=progress)
    runs = training_runs(prepared)
    period, dt = campaign.encounter_period(), step_of(runs)
    models: dict[str, Model] = {}
    for kind, each in KINDS.items():
        if each.role != "reference":
            continue
        recommended = getattr(each, "recommended", None)
        spec: Any = each() if recommended is None else recommended(period, dt)
        try:
            if beside is not None:
                spec = replace(spec, **_input_map(spec, beside.settings))
            models[kind] = spec.fit(runs, states, inputs)
        except SeakeepError as error:
            warn(
                f"baseline '{kind}' is left out: with its recommended settings, {error} To compare "
                f"with one of other settings, state them in [models.{kind}], fit it with --model "
                f"{kind}, and name its file beside the model's."
            )
    return models


def _input_map(spec: Any, settings: Any) -> dict[str, Any]:
    """Settings of an input map that a spec has in common with those of a model."""
    own, others = ({each.name for each in fields(part) if each.init} for part in (spec, settings))
    return {name: getattr(settings, name) for name in MAPS & own & others}


def warn_of_waves(model: Model, run: xr.Dataset, name: str, start: float, steps: int) -> None:
    """Warn of each respect in which a test lies outside what trained the model."""
    for text in outside_training(model, run, start, steps):
        warn(f"{name}: {text}. Train in such conditions too: errors may be large.")


def _warn_of_slow_model(model: Model, runs: Datasets) -> None:
    """Warn of slow motions that the training windows of a model hold fewer than five periods of."""
    spans = model.training_spans
    first = runs[next(iter(spans))]
    if "encounter_period" not in first.attrs and not model.inputs:
        return
    period = mean_period({str(first.attrs.get("run", "the run")): first}, model.inputs) * model.dt
    parts = {name: runs[name].sel(time=slice(None, end + 1e-6)) for name, (_, end) in spans.items()}
    trained = sum(last - first for first, last in spans.values())
    warn_of_slow_motions(parts, model.states, trained, period)


def repeats_of(model: Model, campaign: Campaign, tested: Groups) -> dict[str, str]:
    """Words for tests whose input repeats the model's training input, up to a constant phase.

    Training runs that the campaign marks as regular waves are left out: regular waves repeat by
    their nature. So are runs that the campaign does not have.
    """
    known = campaign.settings.runs
    spans = {
        name: span
        for name, span in model.training_spans.items()
        if name in known and known[name].waves != "regular" and model.inputs
    }
    prepared = load_prepared(campaign, names=[name for name in spans if name not in tested])
    pieces = {name: between((tested | prepared)[name], span) for name, span in spans.items()}
    repeats = {}
    for name, run in tested.items():
        part = run
        if "test_span" in run.attrs:
            part = between(run, run.attrs["test_span"])
        elif name in pieces:  # a test on the training part repeats by definition
            part = run.sel(time=slice(float(pieces[name]["time"][-1]) + 1e-6, None))
        # What a member leaves of a training run is too short to be judged.
        enough = name not in spans or part.sizes["time"] >= model.history_samples
        if not enough or known[name].waves == "regular":
            continue
        if repeat := find_repeat(model.inputs, pieces, name, part, model.dt):
            repeats[name] = repeat["words"]
    return repeats


def warn_of_repeats(model: Model, campaign: Campaign, tested: Groups) -> None:
    """Warn where a test run's input repeats the model's training input."""
    for words in repeats_of(model, campaign, tested).values():
        warn(f"{words} This test shows memory, not skill: test on another run.")


def find_repeat(
    inputs: Sequence[str], pieces: Datasets, name: str, test: xr.Dataset, dt: float
) -> dict[str, Any] | None:
    """Look for the waves of a test part among those that the training pieces hold.

    Other inputs, such as wind, lack the narrow band by which waves that repeat are told.

    Returns
    -------
    dict or None
        ``run`` and ``input``, the channel; ``share``, the fraction of the test record that
        repeats; ``start``, where the best matching stretch starts, s; ``source``, the training run
        that holds it, from ``source_start`` on, s; ``phase`` by which it is turned, rad;
        ``correlation`` of the analytic signals; and all of this in ``words``.
    """
    for channel in elevations(test, inputs, name) or inputs:
        records = {key: piece[channel].values for key, piece in pieces.items() if channel in piece}
        whole = all(np.all(np.isfinite(each)) for each in (*records.values(), test[channel].values))
        if not (records and whole) or min(test.sizes["time"], *map(len, records.values())) < 8:
            continue
        if (leakage := find_leakage(list(records.values()), test[channel].values, dt)) is not None:
            source = list(records)[leakage.training]
            start = float(test["time"][0]) + leakage.test_start
            source_start = float(pieces[source]["time"][0]) + leakage.training_start
            return {
                "run": name,
                "input": channel,
                "share": leakage.share,
                "start": start,
                "source": source,
                "source_start": source_start,
                "phase": leakage.phase,
                "correlation": leakage.correlation,
                "words": f"the input '{channel}' of {name} repeats training input: "
                f"{100 * leakage.share:.0f} % of it, such as from t = {start:.4g} s on, is what "
                f"{source} holds from t = {source_start:.4g} s on, turned by "
                f"{np.degrees(leakage.phase):z.0f} degrees "
                f"(correlation {leakage.correlation:.3f}).",
            }
    return None
