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
    kind : str
        As in TOML.
    preset : str or None
        What filled in the keys that were not stated.
    spec : Spec
        The settings.
    sources : mapping of str to str
        Key → "stated", "preset", "study" (its seed) or "default"; keys of tables are named
        ``alignment.KEY`` and ``select.KEY``.
    """

    kind: str
    preset: str | None
    spec: Spec
    sources: Mapping[str, Source]

    def to_json(self) -> dict[str, Any]:
        """Kind, preset, number of members, and value and source of each key, as JSON values."""
        values = _values(self.spec)
        return {
            "kind": self.kind,
            "preset": self.preset,
            "role": self.spec.role,
            "ensemble": self.spec.is_ensemble,
            "n_members": self.spec.n_members,
            "settings": {
                key: {"value": value, "source": self.sources[key]} for key, value in values.items()
            },
        }


def _defaults(kind: Any) -> dict[str, Any]:
    """Keys that a kind of model has, and their defaults."""
    settable = [each for each in fields(kind) if each.init]
    return {each.name: each.default for each in settable if each.name not in OF_THE_DATA}


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
    kind = _kind_of(settings)
    if settings.preset not in (None, *presets_of(kind)):
        raise RequestError(
            f"kind = '{settings.kind}' has no preset. Remove preset = '{settings.preset}', and "
            f"state its keys: {', '.join(_defaults(kind))}."
        )
    alignment = ALIGNMENTS.get(settings.preset or preset or "") if aligned else None
    if settings.preset is None and preset is not None:  # a baseline may lack the paper's
        preset = next((p for p in (preset, "recommended") if p in presets_of(kind)), None)
    else:
        preset = preset_of(settings)
    stated = settings.arguments()
    known = list(_defaults(kind))
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
    if "select" in stated:
        stated["select"] = {"period": encounter_period, **_counted(stated["select"])}
    if "observables" in stated:
        observables = observables_of(map(_counted, stated["observables"]))
        stated["observables"] = tuple(counted_in(each, encounter_period) for each in observables)
    from_study: dict[str, Any] = {"seed": seed} if kind.is_ensemble and seed is not None else {}
    filled: Any = None
    if preset is not None:
        filled = getattr(kind, preset)(encounter_period, dt)
        # That of the preset is optional: windows of runs that allow none have no room for it.
        if "alignment" in known and (alignment or (not aligned and "alignment" not in stated)):
            filled = replace(filled, alignment=alignment)
    data = {"encounter_period": encounter_period, "dt": dt}
    spec = _spec_of(kind, filled, {**from_study, **stated}, data).resolved(dt, encounter_period)
    open_spec = left_open(spec)
    if open_spec and folds != "auto" and "folds" not in (stated.get("select") or {}):
        spec = replace(open_spec, select=replace(open_spec.select or Select(), folds=folds))
        from_study["select.folds"] = folds
    return ResolvedModel(settings.kind, preset, spec, _sources(spec, filled, stated, from_study))


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


def _spec_of(
    kind: Any, filled: Any, given: dict[str, Any], data: Mapping[str, float | None]
) -> Spec:
    for name, table in TABLES.items():
        if isinstance(given.get(name), dict):
            check_keys(table, given[name], f"{name}: ")
            before = getattr(filled, name, None) or table()
            given = {**given, name: replace(before, **given[name])}
    if given.get("observables") is not None and "select" in _defaults(kind):
        given.setdefault("select", None)  # those that are stated are not chosen
    if given.get("delay_rows") == "ridge" or given.get("rank") is not None:
        # Free runs are tried with exact rows alone: what a preset would choose by them is left out.
        yields = {"select": None, "readouts": ()}
        given = {**{key: value for key, value in yields.items() if key in _defaults(kind)}, **given}
    if "select" not in given and (select := getattr(filled, "select", None)) is not None:
        closed = {name: False for name in select.opened if name in given}
        given = {**given, "select": replace(select, **closed)} if closed else given
    if filled is not None:
        return replace(filled, **given)
    needed = [key for key, default in _defaults(kind).items() if default is MISSING]
    if missing := [key for key in needed if key not in given]:
        as_priors = (
            " as priors, such as { uniform = ['0.5 T', '1.5 T'] }" if kind.is_ensemble else ""
        )
        presets = [f"'{name}'" for name in presets_of(kind)]
        raise RequestError(
            f"the [model] table states no {missing[0]}. Add {', '.join(missing)}{as_priors}"
            + (f", or a preset: preset = {' or '.join(presets)}." if presets else ".")
        )
    of_data = {each.name for each in fields(kind)} & set(OF_THE_DATA)
    return kind(**{**{key: data[key] for key in of_data}, **given})


def _sources(
    spec: Spec, filled: Spec | None, stated: Mapping[str, Any], from_study: Mapping[str, Any]
) -> dict[str, Source]:
    """Where each setting comes from; a preset counts where it differs from the default."""
    tables = {f"{name}.{key}" for name in TABLES for key in stated.get(name) or {}}
    known = {*stated, *tables}
    defaults = _defaults(type(spec))
    by_preset = {} if filled is None else _values(filled)

    def source(key: str) -> Source:
        if key in known:
            return "stated"
        if key in from_study:
            return "study"
        default = defaults.get(key)
        default = list(default) if isinstance(default, tuple) else default
        return "preset" if key in by_preset and by_preset[key] != default else "default"

    return {key: source(key) for key in _values(spec)}


def _counted(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table whose lengths are numbers of encounter periods: 2 or '2 T', 0.33 or '0.33 /T'."""

    def bare(value: Any) -> Any:
        if isinstance(value, list | tuple):
            return [bare(each) for each in value]
        return value.value if isinstance(value, Length) else value

    return {key: bare(value) if key in IN_PERIODS else value for key, value in table.items()}
