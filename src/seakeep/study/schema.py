"""What the file of a study holds: one table of its variables, and the classes of its settings.

A checksum says that a file is what was written, not that a study wrote it. What is read is
therefore compared with this table once, so that figures, tables and pages need not.
"""

from __future__ import annotations

import json
import sys
import types
import typing
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from typing import Annotated, Any, get_args, get_origin

import numpy as np
import xarray as xr
from pydantic import AfterValidator, BaseModel, Field, TypeAdapter

from seakeep.arrays import GREATEST, LONGEST_STEP
from seakeep.campaign.settings import PreparationSettings
from seakeep.errors import SHOWN, SeakeepError
from seakeep.models import KINDS
from seakeep.models.checks import parsed, typed
from seakeep.models.observables import OBSERVABLES
from seakeep.study.resolve import Source, check_settings
from seakeep.study.settings import Preset, StudySettings
from seakeep.toml import Table

__all__ = ["check_contents"]


class _Value(Table):
    value: Any
    source: Source


class _Model(Table):
    kind: str
    preset: Preset | None
    ensemble: bool
    n_members: Annotated[int, Field(ge=1)]
    settings: dict[str, _Value]


def _instant(text: str) -> str:
    try:
        datetime.fromisoformat(text)
    except ValueError:
        raise ValueError("an instant is written like 2026-01-31T12:00:00+00:00") from None
    return text


Time = Annotated[float, Field(gt=0, le=LONGEST_STEP)]
ATTRIBUTES: dict[str, Any] = {
    **dict.fromkeys(("study", "description", "campaign", "digest", "campaign_digest"), str),
    **dict.fromkeys(("encounter_period", "dt", "longest_training"), Time),
    "preset": Preset,
    "seed": Annotated[int, Field(ge=0, lt=2**64)],
    "conditional_on": str,
    "created": Annotated[str, AfterValidator(_instant)],
    "format": int,
}
"""Types of the attributes that are no JSON."""
DOCUMENTS: dict[str, Any] = {
    "settings": StudySettings,
    "preparation": PreparationSettings,
    "models": dict[str, _Model],
    "versions": dict[str, str],
    "groups": list[str],
}
"""Types of those that are."""

GROUPS = {
    "channels": """
        text    name: name units long_name symbol source positive use
        text    channel: channel
    """,
    "training": """
        text    training: training left_out
        text    of_run: of_run
        number  training of_run: begin end
        text?   training: run
        number? training: stop reads
    """,
    "runs": """
        text    run: run sea_state waves role file_sha256
        text    name: name
        flag    run: trains
        number  run: water_depth wave_frequency train_begin train_end test_begin test_end duration
        number  run: samples
        number  run name: mean sd min max constant slack
    """,
    "prepared": "number time: time",
    "spectra": """
        text    run: run
        number  run: significant_height
        attrs   : channel
    """,
    "tests": """
        text    training: training
        text    window: run
        text    channel: channel
        number  window: window start
        number  time: time
        flag    training window: judged
        number  window time channel: measured
        number? window time channel: truth
        number  training channel: training_mean training_std
        number  window channel: noise_std
        number? window time: wave_height
        number? shown: shown
    """,
    "chosen": """
        text    training: training words
        number  training: look_ahead
    """,
    "eigenvalues": """
        number  member mode: real imag
        attrs   : training dt
    """,
    "draws": """
        number  member: member
        attrs   : ensemble redrawn
    """,
    "calibration": """
        text    training: training
        text    channel: channel
        number  training channel: margin blocks warranted
        number  training: windows
        number? training channel: floor
        number? training law channel: law
        attrs   : level
    """,
    "statistics/boxes": """
        text    model: model
        text    measure: measure
        text    channel: channel
        number  model measure channel: mean median lower_quartile upper_quartile lower_whisker
        number  model measure channel: upper_whisker count left_out
    """,
    "statistics/differences": """
        text    model: model
        text    other: other
        text    measure: measure
        text    channel: channel
        number  model other measure channel: change lower upper
        attrs   : blocks
    """,
    "statistics/coverage": """
        text    model: model
        text    against: against
        text    channel: channel
        number  model against channel: inside below above relative_width
        number? model against channel: calibrated_inside calibrated_below calibrated_above
        number? model against channel: calibrated_relative_width
    """,
    "statistics/bands": """
        text    model: model
        text    band: band
        text    part: part
        text    channel: channel
        number  model band part channel: inside width relative_width winkler crps
    """,
    "statistics/trend": """
        text    band: band
        text    model: model
        number  time: time
        number  band model: slope lower upper change kendall_tau p_value block_length
        number  band model time: error_mean lower_quartile upper_quartile
    """,
    "statistics/response": """
        text    model: model
        text    channel: channel
        number  channel: sd_ratio mean_shift
        number  model channel: error_offset error_wave error_rest amplitude_ratio phase_lead
        number  model: celerity celerity_phase
        attrs   : frequency phase_speed surge_shift height_ratio energy_share
    """,
    "statistics/divergence": """
        text    model: model
        text    variant: variant
        text    channel: channel
        number  model variant channel: mean lower upper uncertainty of_series noise_floor
        number  model variant channel: noise_floor_lower noise_floor_upper block_length
        number  model: diverged_series
        attrs   : test
    """,
    "statistics/densities": """
        text    model: model
        text    channel: channel
        number  model channel grid: value measured_mean measured_lower measured_upper
        number  model channel grid: predicted_mean predicted_lower predicted_upper
        attrs   : test
    """,
    "statistics/lost": """
        text    cell: model test training run
        number  cell: window start
    """,
}
"""Variables by group: what they hold, their dimensions, and their names; ``?`` may be missing."""
OF_MODEL = """
    number  training window time channel: {0}_mean
    number  training window channel: {0}_nrmse {0}_nammae {0}_training_nrmse
    number  training window time: {0}_error_over_time {0}_error_low {0}_error_wave
"""
OF_ENSEMBLE = """
    number  training window time channel: {0}_std {0}_lower {0}_upper
    number  training window member: {0}_lost
    number  training window member channel: {0}_member_nrmse {0}_member_nammae
    number? training window time: {0}_envelope
    number? shown member time channel: {0}_members
"""
OF_SPECTRUM = "number {0}: {0}_frequency {0}_density"
NEEDED = {
    "tests": ("tests", "statistics/boxes", "statistics/differences", "statistics/trend"),
    "models": ("chosen",),
    "runs": ("prepared",),
    "all": ("channels", "training", "runs", "statistics/divergence", "statistics/densities"),
}
"""Groups that a study always has: one for each of its tests, models and runs, or one in all."""


def _is_bounded(x: Any) -> bool:
    """Whether numbers are NaN (what was not judged), infinite (some margins) or measurable."""
    if x.dtype.kind != "f" or x.itemsize < 8:
        return x.dtype.kind in "fiu"
    beyond = np.abs(x) > GREATEST
    return not beyond.any() or bool(np.isinf(x[beyond]).all())


SOUND: Mapping[str, Callable[[Any], bool]] = {
    "text": lambda x: x.dtype.kind in "OU" and all(isinstance(each, str) for each in x.flat),
    "flag": lambda x: x.dtype.kind == "b",
    "number": _is_bounded,
}


def check_contents(attrs: Mapping[str, Any], groups: Mapping[str, xr.Dataset]) -> dict[str, Any]:
    """Compare what a file of a study holds with what a study writes.

    Parameters
    ----------
    attrs : mapping
        Attributes of the file.
    groups : mapping of str to Dataset
        Its groups.

    Returns
    -------
    dict
        The attributes; settings that came after the file was written have their defaults.

    Raises
    ------
    ValueError
        If anything is missing, of another type or shape, or does not fit to the rest.
    """
    told = _check_attrs(attrs)
    models, tests = told["models"], told["settings"]["tests"]
    stated, kinds = (
        {name: each["kind"] for name, each in held.items()}
        for held in (told["settings"]["models"], models)
    )
    if kinds != stated:
        raise ValueError(
            f"models: received {kinds!s:.{SHOWN}}, and the settings have {stated!s:.{SHOWN}}"
        )
    for name, each in models.items():
        _check_model(each, f"models.{name}", attrs["encounter_period"], attrs["dt"])
    _check_group("runs", groups, models, {})
    owners = {"tests": tests, "models": models, "runs": _texts(groups["runs"], "run"), "all": [""]}
    for owner, rooms in NEEDED.items():
        for room in (f"{room}/{name}".strip("/") for room in rooms for name in owners[owner]):
            if room not in groups:
                raise ValueError(f"the group {room} is missing")
    _check_group("channels", groups, models, {})
    _check_group("training", groups, models, {})
    known = {
        "model": set(models),
        "test": set(tests),
        "run": set(owners["runs"]),
        "training": set(_texts(groups["training"], "training")),
        "channel": {*_texts(groups["channels"], "channel"), "average"},
        "name": set(_texts(groups["channels"], "name")),
    }
    for name in groups:
        _check_group(name, groups, models, known)
    if told["settings"] == json.loads(attrs["settings"]):
        return dict(attrs)
    return {**attrs, "settings": json.dumps(told["settings"])}


def _check_attrs(attrs: Mapping[str, Any]) -> dict[str, Any]:
    """Check the types of the attributes; return those that are JSON."""
    told = {}
    for key, kind in (ATTRIBUTES | DOCUMENTS).items():
        if key not in attrs:
            raise ValueError(f"{key} is missing")
        value = attrs[key]
        if key in DOCUMENTS:
            value = told[key] = parsed(str(value), key, sys.float_info.max)
        _check_value(kind, value, key)
    return told


def _check_model(told: Mapping[str, Any], place: str, period: float, dt: float) -> None:
    """Let the class of a kind judge the settings; kinds that were added elsewhere are not known."""
    values = {key: each["value"] for key, each in told["settings"].items()}
    observables = values.get("observables")
    tables = observables if isinstance(observables, list) else []
    added = any(
        isinstance(each, dict) and str(each.get("kind")) not in OBSERVABLES for each in tables
    )
    if told["kind"] not in KINDS or added:
        return
    try:
        spec = check_settings(told["kind"], values, period, dt)
    except (SeakeepError, LookupError, TypeError, ValueError, ArithmeticError) as error:
        raise ValueError(f"{place}: {error}") from error
    made = {"ensemble": spec.is_ensemble, "n_members": getattr(spec, "n_members", 1)}
    for key, value in made.items():
        if told[key] != value:
            raise ValueError(f"{place}.{key}: received {told[key]!r}, and its settings say {value}")


def _texts(group: xr.Dataset, name: str) -> list[str]:
    return [str(each) for each in group[name].values]


def _check_group(
    name: str,
    groups: Mapping[str, xr.Dataset],
    models: Mapping[str, Any],
    known: Mapping[str, set[str]],
) -> None:
    """Check the variables of a group, and that its labels are known to the study."""
    group = groups.get(name, xr.Dataset())
    room = next((each for each in GROUPS if f"{name}/".startswith(f"{each}/")), None)
    for kind, dims, variables in _rows(room, group, models):
        for each in variables:
            place = f"{name}/{each}"
            if kind == "attrs":
                if each not in group.attrs:
                    raise ValueError(f"{place} is missing")
            elif each in group.variables:
                x = group.variables[each]
                if x.dims != dims or not SOUND[kind.rstrip("?")](x.values):
                    held = " ".join(map(str, x.dims))
                    raise ValueError(
                        f"{place} holds {x.dtype} over ({held}), not each a sound "
                        f"{kind.rstrip('?')} over ({' '.join(dims)})"
                    )
                _check_labels(place, each, x.values, known)
            elif not kind.endswith("?"):
                raise ValueError(f"{place} is missing")


def _check_labels(place: str, name: str, values: Any, known: Mapping[str, set[str]]) -> None:
    of = {"other": "model", "of_run": "run"}.get(name, name)
    if of in known and (strange := {str(each) for each in values} - known[of] - {""}):
        raise ValueError(
            f"{place} names {sorted(strange)[0]!r:.{SHOWN}}, which the study does not have"
        )
    if name == "time" and not np.all(np.diff(values) > 0):
        raise ValueError(f"{place} does not increase")


def _rows(
    room: str | None, group: xr.Dataset, models: Mapping[str, Any]
) -> Iterator[tuple[str, tuple[str, ...], list[str]]]:
    """Lines of the table that a group must fit to."""
    lines = GROUPS.get(room or "", "")
    if room == "tests":
        for model, each in models.items():
            lines += (OF_MODEL + OF_ENSEMBLE * each["ensemble"]).format(model)
    if room == "spectra":
        drawn = [n.removesuffix("_frequency") for n in map(str, group) if n.endswith("_frequency")]
        drawn += [n.removesuffix("_density") for n in map(str, group) if n.endswith("_density")]
        lines += "\n".join(["", *(OF_SPECTRUM.format(each) for each in dict.fromkeys(drawn))])
    if room in ("prepared", "draws"):
        dim = {"prepared": "time", "draws": "member"}[room]
        lines += f"\nnumber {dim}: " + " ".join(str(n).replace(" ", "\0") for n in group.data_vars)
    for line in filter(None, map(str.strip, lines.splitlines())):
        head, _, names = line.partition(":")
        kind, *dims = head.split()
        yield kind, tuple(dims), [each.replace("\0", " ") for each in names.split(" ") if each]


def _check_value(kind: Any, value: Any, place: str) -> None:
    """Compare a value with the type of a key; keys that are newer than the file are filled in."""
    bare = get_args(kind)[0] if get_origin(kind) is Annotated else kind
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        for name, each in typed(dict[str, Any], value, place).items():
            if name not in kind.model_fields:
                raise ValueError(
                    f"{place}.{name:.{SHOWN}}: received {each!r:.{SHOWN}}, and there is no such key"
                )
        for name, field in kind.model_fields.items():
            if name not in value and not field.is_required():
                default = field.get_default(call_default_factory=True)
                value[name] = TypeAdapter(Any).dump_python(default, mode="json")
            if name not in value:
                raise ValueError(f"{place}.{name} is missing")
            inner: Any = field.annotation
            inner = Annotated[inner, *field.metadata] if field.metadata else inner
            _check_value(inner, value[name], f"{place}.{name}")
    elif get_origin(bare) is dict and isinstance(value, dict) and value:
        for name, each in value.items():
            _check_value(get_args(bare)[1], each, f"{place}.{name}")
    elif tables := [each for each in _choices(kind) if isinstance(each, type)
                    and issubclass(each, BaseModel) and isinstance(value, dict)]:  # fmt: skip
        _check_value(tables[0], value, place)
    else:
        typed(kind, value, place)


def _choices(kind: Any) -> tuple[Any, ...]:
    """Types of which a value may have one."""
    if get_origin(kind) is Annotated:
        return _choices(get_args(kind)[0])
    return get_args(kind) if get_origin(kind) in (typing.Union, types.UnionType) else (kind,)
