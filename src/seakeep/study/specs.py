"""From the settings of a model, in a campaign file or a study file, to its spec."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from seakeep.campaign import ModelSettings, PriorSettings
from seakeep.errors import RequestError
from seakeep.models import HankelDMDc
from seakeep.models.ensemble import BayesianHankelDMDc
from seakeep.models.priors import Fixed, LogUniform, Prior, Uniform
from seakeep.models.settings import periods_to_samples
from seakeep.study.settings import Study, StudyModelSettings
from seakeep.toml import Length, lengths

__all__ = ["Spec", "build_spec", "counts_in_periods", "model_settings"]

Spec = HankelDMDc | BayesianHankelDMDc

ENSEMBLE = "bayesian_hankel_dmdc"
PRIORS = ("train_length", "state_delay", "input_delay", "ridge")


def model_settings(study: Study, name: str) -> ModelSettings:
    """Settings of a model of a study, with the study's channels, preset and seed filled in.

    Parameters
    ----------
    study : Study
        The study.
    name : str
        Key in ``[models.NAME]``.

    Returns
    -------
    ModelSettings
        As a campaign would state them.
    """
    stated = study.settings.models[name]
    general = study.settings.study
    content: dict[str, Any] = {key: getattr(stated, key) for key in stated.model_fields_set}
    content |= {"states": study.states, "inputs": study.inputs}
    if stated.preset is None and _missing(stated):
        content["preset"] = general.preset
    if stated.kind == ENSEMBLE and stated.seed is None:
        content["seed"] = general.seed
    return ModelSettings.model_validate(content)


def _missing(stated: ModelSettings | StudyModelSettings) -> list[str]:
    """Keys that only a preset could fill in."""
    ensemble = stated.kind == ENSEMBLE
    delays = ("state_delay", "input_delay") if ensemble else ("state_delays", "input_delays")
    return [key for key in (*delays, "ridge") if getattr(stated, key) is None]


def counts_in_periods(settings: ModelSettings) -> bool:
    """Whether a model is stated in encounter periods: by a preset, a key, or as an ensemble."""
    return settings.preset is not None or settings.kind == ENSEMBLE or any(lengths(settings))


def build_spec(settings: ModelSettings, encounter_period: float | None, dt: float) -> Spec:
    """Turn the table of a model into the settings of a model, or of an ensemble of them.

    Parameters
    ----------
    settings : ModelSettings
        The table: a preset, keys of the constructor, or a preset with keys that override it.
    encounter_period : float or None
        Mean encounter period, s; a preset and an ensemble need it.
    dt : float
        Time step of the prepared runs, s.

    Returns
    -------
    HankelDMDc or BayesianHankelDMDc
        The settings.

    Raises
    ------
    RequestError
        If there is no encounter period to count in, or a key that has no default is missing or
        out of range.
    """
    ensemble = settings.kind == ENSEMBLE
    stated = settings.arguments()
    stated.pop("stop", None)
    if ensemble:
        stated |= {key: _prior(stated[key]) for key in PRIORS if key in stated}
    if encounter_period is None:
        if counts_in_periods(settings):
            what = "an ensemble" if ensemble else "the model"
            what = what if settings.preset is None else f"preset = '{settings.preset}'"
            raise RequestError(
                f"{what} counts in encounter periods, and the campaign has none. State "
                "encounter_period (s) in [campaign]."
            )
    else:
        for key, value in stated.items():
            if isinstance(value, Length):
                stated[key] = periods_to_samples(value.value, encounter_period, dt)
    if settings.preset is not None and encounter_period is not None:
        kind: type[Spec] = BayesianHankelDMDc if ensemble else HankelDMDc
        preset = kind.paper if settings.preset == "paper" else kind.recommended
        return replace(preset(encounter_period, dt), **stated)
    if missing := _missing(settings):
        as_priors = " as priors, such as { uniform = [0.5, 1.5] }" if ensemble else ""
        raise RequestError(
            f"the [model] table states no {missing[0]}. Add {', '.join(missing)}{as_priors}, or a "
            "preset: preset = 'recommended' or 'paper'."
        )
    if not ensemble:
        return HankelDMDc(**stated)
    period = {"encounter_period": encounter_period, "dt": dt}
    return BayesianHankelDMDc(**{"train_length": None, **period, **stated})


def _prior(stated: PriorSettings | float) -> Prior:
    if not isinstance(stated, PriorSettings):
        return Fixed(float(stated))
    if stated.uniform is not None:
        return Uniform(*stated.uniform)
    if stated.log_uniform is not None:
        return LogUniform(*stated.log_uniform)
    if stated.distribution is not None:
        from scipy import stats

        frozen: Prior = getattr(stats, stated.distribution)(**stated.parameters)
        return frozen
    assert stated.fixed is not None
    return Fixed(stated.fixed)
