"""From the settings of a study's models to their specs."""

from __future__ import annotations

from typing import Any

from seakeep.campaign import ModelSettings, PriorSettings
from seakeep.errors import RequestError
from seakeep.models import HankelDMDc
from seakeep.models.ensemble import BayesianHankelDMDc
from seakeep.models.priors import Fixed, LogUniform, Prior, Uniform
from seakeep.study.settings import Study, StudyModelSettings
from seakeep.study.workflow import build_spec

__all__ = ["Spec", "build_model", "model_settings"]

Spec = HankelDMDc | BayesianHankelDMDc


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
    if stated.preset is None and _incomplete(stated):
        content["preset"] = general.preset
    if stated.kind == "bayesian_hankel_dmdc" and stated.seed is None:
        content["seed"] = general.seed
    return ModelSettings.model_validate(content)


def _incomplete(stated: StudyModelSettings) -> bool:
    ensemble = stated.kind == "bayesian_hankel_dmdc"
    delays = ("state_delay", "input_delay") if ensemble else ("state_delays", "input_delays")
    return any(getattr(stated, key) is None for key in (*delays, "ridge"))


def build_model(settings: ModelSettings, encounter_period: float, dt: float) -> Spec:
    """Settings of a model, or of an ensemble of them.

    Parameters
    ----------
    settings : ModelSettings
        A preset, keys of the constructor, or a preset with keys that override it.
    encounter_period : float
        Mean encounter period, s.
    dt : float
        Time step of the prepared runs, s.

    Returns
    -------
    HankelDMDc or BayesianHankelDMDc

    Raises
    ------
    RequestError
        If a key that has no default is missing, or out of range.
    """
    if settings.kind == "hankel_dmdc":
        return build_spec(settings, encounter_period, dt)
    stated = settings.arguments()
    stated.pop("stop", None)
    for key in ("train_length", "state_delay", "input_delay", "ridge"):
        if key in stated:
            stated[key] = _prior(stated[key])
    if settings.preset is not None:
        recommended = settings.preset == "recommended"
        preset = BayesianHankelDMDc.recommended if recommended else BayesianHankelDMDc.paper
        base = preset(encounter_period, dt)
        names = [name for name, each in base.__dataclass_fields__.items() if each.init]
        return BayesianHankelDMDc(**{**{name: getattr(base, name) for name in names}, **stated})
    missing = [key for key in ("state_delay", "input_delay", "ridge") if key not in stated]
    if missing:
        raise RequestError(
            f"the ensemble states no {missing[0]}. Add {', '.join(missing)} as priors, such as "
            "{ uniform = [0.5, 1.5] }, or a preset: preset = 'recommended' or 'paper'."
        )
    stated.setdefault("train_length", None)
    return BayesianHankelDMDc(encounter_period=encounter_period, dt=dt, **stated)


def _prior(stated: PriorSettings | float) -> Prior:
    if isinstance(stated, PriorSettings):
        if stated.uniform is not None:
            return Uniform(*stated.uniform)
        if stated.log_uniform is not None:
            return LogUniform(*stated.log_uniform)
        return Fixed(float(stated.fixed or 0.0))
    return Fixed(float(stated))
