"""From the table of a model, in a campaign file or a study file, to its spec.

One rule, key by key, for campaigns and studies: what the table states, else what the preset says,
else the default of the kind.
"""

from collections.abc import Mapping, Sequence
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any, Literal

from seakeep.arrays import check_keys
from seakeep.campaign import ModelSettings
from seakeep.campaign.settings import CampaignSettings
from seakeep.errors import RequestError, did_you_mean, quiet
from seakeep.models import KINDS, ProbeAlignment, Select, Spec
from seakeep.models.observables import SlowSquares, counted_in, observables_of
from seakeep.models.settings import Folds
from seakeep.models.specs import left_open
from seakeep.toml import Length, Mistake, lengths

Source = Literal["stated", "preset", "study", "default"]

TABLES = {"alignment": ProbeAlignment, "select": Select}
"""Arguments of a spec that are tables of their own."""
IN_PERIODS = ("horizon", "cutoff", "lead", "lags")
"""Settings of choices and observables that count in encounter periods."""
OF_THE_DATA = ("dt", "encounter_period")
"""Arguments of a spec that are measured, not set."""
ALIGNMENTS = {"paper": ProbeAlignment(mode="effective", surge="measured")}
"""Alignment of a preset, where a campaign has the channels for it."""


@dataclass(frozen=True)
class ResolvedModel:
    """A spec, and where each of its settings comes from.

    Parameters
    ----------
    spec : Spec
        The settings.
    description : dict
        JSON values: ``kind``, ``preset`` (what filled in the keys that were not stated), ``role``,
        ``ensemble`` and ``n_members``; and ``settings``, for each key its ``value`` and its
        ``source``, "stated", "preset", "study" (its seed) or "default". Keys of tables are named
        ``alignment.KEY`` and ``select.KEY``.
    """

    spec: Spec
    description: dict[str, Any]


def _defaults(kind: Any) -> dict[str, Any]:
    """Keys that a kind of model has, and their defaults."""
    return {
        each.name: each.default
        for each in fields(kind)
        if each.init and each.name not in OF_THE_DATA
    }


def _values(spec: Spec) -> dict[str, Any]:
    """Settings of a spec as JSON values; those of its tables one by one."""
    known = _defaults(type(spec))
    out = {key: value for key, value in spec.to_json().items() if key in known}
    for name in TABLES:
        if (table := out.get(name)) is not None:
            del out[name]
            out |= {f"{name}.{k}": v for k, v in table.items() if k != "period"}
    return out


def counts_in_periods(settings: ModelSettings) -> bool:
    """Whether a model is stated in encounter periods: by a preset, a key, or as an ensemble."""
    by_kind = _kind_of(settings).is_ensemble
    stated = settings.arguments()
    squares = any(each.get("kind") == SlowSquares.kind for each in stated.get("observables", ()))
    named = preset_of(settings) is not None or "select" in stated
    return named or by_kind or squares or any(lengths(settings)) or stated.get("centre") == "run"


def can_align(campaign: CampaignSettings, inputs: Sequence[str]) -> bool:
    """Whether a campaign has surge, water depth, and two places at which inputs are measured."""
    places = {campaign.rig.positions[name] for name in inputs if name in campaign.rig.positions}
    surge = ProbeAlignment().surge_channel in campaign.channel_names
    return surge and campaign.rig.water_depth is not None and len(places) > 1


def resolve_model(
    settings: ModelSettings,
    encounter_period: float | None,
    dt: float,
    *,
    preset: str | None = None,
    seed: int | None = None,
    aligned: bool = False,
    folds: Folds = "auto",
) -> ResolvedModel:
    """Turn the table of a model into its settings: fill in, key by key, what it does not state.

    Parameters
    ----------
    settings : ModelSettings
        The table: a preset, keys of the constructor, or a preset with keys that override it.
    encounter_period : float or None
        Mean encounter period, s; a preset and an ensemble need it.
    dt : float
        Time step of the prepared runs, s.
    preset, seed, folds : optional
        Those of a study, for what the table does not state.
    aligned : bool, optional
        Whether the alignment of the preset is taken, :func:`can_align`.

    Raises
    ------
    RequestError
        If there is no encounter period to count in, or a key is unknown, missing or out of range.
    """
    kind: Any = _kind_of(settings)
    stated, named = settings.arguments(), settings.preset or preset
    if settings.preset is None and preset is not None:  # a baseline may lack the paper's
        preset = next((p for p in (preset, "recommended") if p in presets_of(kind)), None)
    else:
        preset = preset_of(settings)
    _check(settings, preset, encounter_period)
    if "select" in stated:
        stated["select"] = {"period": encounter_period, **_counted(stated["select"])}
    if "observables" in stated:
        observables = observables_of(map(_counted, stated["observables"]))
        stated["observables"] = tuple(counted_in(each, encounter_period) for each in observables)
    data = {"encounter_period": encounter_period, "dt": dt}
    from_study: dict[str, Any] = {"seed": seed} if kind.is_ensemble and seed is not None else {}
    start, by_preset = {**_defaults(kind), **data}, dict[str, Any]()
    if preset is not None:
        filled = getattr(kind, preset)(encounter_period, dt)
        # That of the preset is optional: windows of runs that allow none have no room for it.
        alignment = ALIGNMENTS.get(named or "") if aligned else None
        if "alignment" in start and (alignment or (not aligned and "alignment" not in stated)):
            filled = replace(filled, alignment=alignment)
        start, by_preset = vars(filled), _values(filled)
    spec = _spec_of(kind, start, {**from_study, **stated}).resolved(dt, encounter_period)
    own = stated.get("select") or {}
    if (open_spec := left_open(spec)) and folds != "auto" and "folds" not in own:
        spec = replace(open_spec, select=replace(open_spec.select or Select(), folds=folds))
        from_study["select.folds"] = folds
    known = {*stated, *(f"{name}.{key}" for name in TABLES for key in stated.get(name) or {})}

    def source(key: str) -> Source:
        if key in known:
            return "stated"
        if key in from_study:
            return "study"
        default = _defaults(kind).get(key)
        default = list(default) if isinstance(default, tuple) else default
        return "preset" if key in by_preset and by_preset[key] != default else "default"

    values = _values(spec)
    description = {
        "kind": settings.kind,
        "preset": preset,
        "role": spec.role,
        "ensemble": spec.is_ensemble,
        "n_members": spec.n_members,
        "settings": {key: {"value": values[key], "source": source(key)} for key in values},
    }
    return ResolvedModel(spec, description)


def _check(settings: ModelSettings, preset: str | None, encounter_period: float | None) -> None:
    """Refuse a preset or a key that a kind has not, and lengths without a period."""
    kind, stated = _kind_of(settings), settings.arguments()
    known = list(_defaults(kind))
    if settings.preset not in (None, *presets_of(kind)):
        raise RequestError(
            f"kind = '{settings.kind}' has no preset. Remove preset = '{settings.preset}', and "
            f"state its keys: {', '.join(known)}."
        )
    if unknown := [key for key in stated if key not in known]:
        raise RequestError(
            f"kind = '{settings.kind}' has no key '{unknown[0]}'."
            f"{did_you_mean(unknown[0], known)} Keys: {', '.join(known)}."
        )
    if encounter_period is None and (preset is not None or counts_in_periods(settings)):
        what = "an ensemble" if kind.is_ensemble else "the model"
        what = what if preset is None else f"preset = '{preset}'"
        raise RequestError(
            f"{what} counts in encounter periods, and the campaign has none. State "
            "encounter_period (s) in [campaign]."
        )


def _spec_of(kind: Any, start: Mapping[str, Any], given: dict[str, Any]) -> Spec:
    """The spec of what is given, and of what its preset or its kind starts from."""
    start = {each.name: start[each.name] for each in fields(kind) if each.init}
    for name, table in TABLES.items():
        if isinstance(given.get(name), dict):
            check_keys(table, given[name], f"{name}: ")
            given[name] = replace(start.get(name) or table(), **given[name])
    if given.get("delay_rows") == "ridge" or given.get("rank") is not None:
        # Free runs are tried with exact rows alone: what a preset would choose by them is left out.
        start |= {key: each for key, each in (("select", None), ("readouts", ())) if key in start}
    if select := start.get("select"):
        closed = {name: False for name in select.opened if name in given}
        start["select"] = replace(select, **closed)
        if given.get("observables") is not None:  # those that are stated are not chosen
            start["select"] = None
    values = {**start, **given}
    if missing := [key for key, value in values.items() if value is MISSING]:
        as_priors = (
            " as priors, such as { uniform = ['0.5 T', '1.5 T'] }" if kind.is_ensemble else ""
        )
        presets = [f"'{name}'" for name in presets_of(kind)]
        raise RequestError(
            f"the [model] table states no {missing[0]}. Add {', '.join(missing)}{as_priors}"
            + (f", or a preset: preset = {' or '.join(presets)}." if presets else ".")
        )
    return kind(**values)


def mistakes_of(
    settings: ModelSettings, place: tuple[str, ...], preset: str | None = None
) -> list[Mistake]:
    """What is wrong with the table of a model, before its runs are prepared.

    Parameters
    ----------
    settings : ModelSettings
        The table.
    place : tuple of str
        Keys that lead to it in its file.
    preset : str, optional
        Preset of the study.
    """
    with quiet():  # given when the model is fitted
        try:
            resolve_model(settings, 1.0, 1.0 / 32, preset=preset)  # any period and step
        except RequestError as error:
            return [(place, str(error))]
    return []


def presets_of(kind: type[Spec]) -> list[str]:
    """Presets that a kind of model has, each a constructor of its spec."""
    return [name for name in ("recommended", "paper") if hasattr(kind, name)]


def preset_of(settings: ModelSettings) -> str | None:
    """What a table names, or takes where it states none of the keys that have no default."""
    kind = _kind_of(settings)
    needed = {key for key, default in _defaults(kind).items() if default is MISSING}
    none = not needed & set(settings.arguments()) and "recommended" in presets_of(kind)
    return settings.preset or ("recommended" if none else None)


def _kind_of(settings: ModelSettings) -> type[Spec]:
    if settings.kind not in KINDS:
        raise RequestError(
            f"there is no kind of model '{settings.kind}'.{did_you_mean(settings.kind, KINDS)} "
            f"Kinds: {', '.join(KINDS)}."
        )
    return KINDS[settings.kind]


def _counted(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table whose lengths are numbers of encounter periods: 2 or '2 T', 0.33 or '0.33 /T'."""

    def bare(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return [bare(each) for each in value]
        return value.value if isinstance(value, Length) else value

    return {key: bare(value) if key in IN_PERIODS else value for key, value in table.items()}
