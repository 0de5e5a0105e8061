"""From a TOML file to settings, with one message that names every mistake in it."""

from __future__ import annotations

import tomllib
import typing
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from seakeep.campaign.chain_settings import InstrumentSettings, InstrumentsSettings
from seakeep.campaign.periods import counted
from seakeep.campaign.settings import CampaignSettings, ChannelSettings, DerivedSettings
from seakeep.conventions import canonical_channel, conversion, si_unit
from seakeep.errors import RequestError, did_you_mean
from seakeep.signals.expressions import parse

__all__ = [
    "derivation_order",
    "mistakes_of",
    "needed_channels",
    "read_settings",
    "read_toml",
    "sources_of",
    "validate",
]


def read_settings(path: Path) -> CampaignSettings:
    """Read and validate a campaign file.

    Parameters
    ----------
    path : Path
        The TOML file.

    Returns
    -------
    CampaignSettings
        Its contents.

    Raises
    ------
    RequestError
        If the file is missing, is no TOML, or says something that a campaign cannot say.
    """
    return validate(read_toml(path, "campaign", " Draft one with 'seakeep init FILE…'."), str(path))


def read_toml(path: Path, what: str, mend: str = "") -> dict[str, Any]:
    """Read a TOML file, with a message for what people do wrong to one.

    Parameters
    ----------
    path : Path
        The file.
    what : str
        What the messages call it: "campaign", "study".
    mend : str, optional
        A sentence with a leading space, added where the file does not exist.

    Returns
    -------
    dict
        What it says.

    Raises
    ------
    RequestError
        If the file is missing or no TOML.
    """
    try:
        text = path.read_bytes().decode("utf-8-sig")
    except FileNotFoundError:
        beside = [p.name for p in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        raise RequestError(
            f"the {what} file {path} does not exist.{did_you_mean(path.name, beside)}{mend}"
        ) from None
    except IsADirectoryError:
        raise RequestError(f"{path} is a folder; give the {what}'s TOML file in it.") from None
    except UnicodeDecodeError as error:
        line = path.read_bytes()[: error.start].count(b"\n") + 1
        raise RequestError(
            f"{path}, line {line}: not UTF-8, which TOML asks for. Save the file as UTF-8."
            + _if_no_toml(path, what)
        ) from None
    try:
        found = tomllib.loads(text.replace("\r\n", "\n"))
    except tomllib.TOMLDecodeError as error:
        raise RequestError(
            f"{path} is not valid TOML: {error}. Write texts in quotes, lists in [ ], "
            "one 'key = value' a line, and each table and key once." + _if_no_toml(path, what)
        ) from None
    _check_kind(found, path, what)
    return found


_TABLES = {"campaign": ("channels", "runs", "rig"), "study": ("study", "tests", "training")}
"""What the two kinds of files are known by."""


def _if_no_toml(path: Path, what: str) -> str:
    if path.suffix.lower() == ".toml":
        return ""
    return (
        f" If it holds measurements: a {what} file is expected here, whose name ends in .toml. "
        f"Draft a campaign with 'seakeep init {path.name}'."
    )


def _check_kind(found: Mapping[str, Any], path: Path, what: str) -> None:
    other = "study" if what == "campaign" else "campaign"
    tables = [f"[{key}]" for key in _TABLES[other] if key in found]
    if tables and not any(key in found for key in _TABLES[what]):
        mend = (
            "Name the campaign that it names." if other == "study" else "A study names a campaign."
        )
        raise RequestError(
            f"{path} is a {other} file (it has {', '.join(tables)}), and a {what} file is expected "
            f"here. {mend}"
        )


def validate(received: Mapping[str, Any], name: str) -> CampaignSettings:
    """Validate the contents of a campaign file.

    Parameters
    ----------
    received : mapping
        What the TOML says.
    name : str
        What the message calls the file.

    Returns
    -------
    CampaignSettings
        The same, checked.

    Raises
    ------
    RequestError
        With one line a mistake: key, value, mend.
    """
    try:
        settings = CampaignSettings.model_validate(received)
    except ValidationError as error:
        mistakes = mistakes_of(error, CampaignSettings)
    else:
        mistakes = list(_cross_checks(settings))
    if mistakes:
        heading = "1 mistake" if len(mistakes) == 1 else f"{len(mistakes)} mistakes"
        raise RequestError(
            f"{name}: {heading} in the campaign file\n" + "\n".join(f"  {m}" for m in mistakes)
        )
    return settings


def mistakes_of(error: ValidationError, root: type[BaseModel]) -> list[str]:
    """Turn what pydantic refused into lines of our own: key, value received, mend.

    Parameters
    ----------
    error : ValidationError
        The refusal.
    root : type
        The table of the whole file.

    Returns
    -------
    list of str
        One line a mistake.
    """
    lines: dict[str, None] = {}
    for item in error.errors(include_url=False):
        # Pydantic's own words in a place: '[key]' of a table, '<number>' for a branch of a union.
        place = [str(part) for part in item["loc"] if not str(part).startswith("<")]
        table, description, depth = _place(place, root)
        key = ".".join(p for p in place[:depth] if p != "[key]") or "the file"
        lines[f"{key}: {_reason(item, place, table, description)}"] = None
    return list(lines)


def _reason(item: Any, place: list[str], table: type[BaseModel] | None, description: str) -> str:
    kind, value = item["type"], item["input"]
    if kind == "extra_forbidden" and table is not None:
        known = [field.alias or name for name, field in table.model_fields.items()]
        near = did_you_mean(place[-1], known)
        return f"unknown key, received {_shown(value)}.{near} Keys here: {', '.join(known)}."
    if (kind == "missing" and place[-1].isdigit()) or kind == "too_long":
        mend = f" Give {description}." if description else ""
        return f"received {_shown(value)}, a list of the wrong length ({len(value)}).{mend}"
    if kind == "missing":
        return f"missing. Add it: {description}." if description else "missing. Add it."
    if kind == "value_error":
        return f"{item['ctx']['error']}; received {_shown(value)}."
    if kind == "string_pattern_mismatch":
        return (
            f"received the run name {value!r}; a name is made of letters, digits and '_', '-', "
            "'.', '+', and begins with a letter or digit, because files are named after it."
        )
    message = str(item["msg"]).removeprefix("Input ").replace("valid ", "")
    message = message.replace("a integer", "an integer")
    mend = f" Give {description}." if description else ""
    return f"received {_shown(value)}, which {message}.{mend}"


def _shown(value: object) -> str:
    if isinstance(value, str):
        return repr(value)
    if isinstance(value, dict):
        return "a table with " + (", ".join(map(str, value)) or "no keys")
    if isinstance(value, bool):
        return str(value).lower()
    return str(value)


def _place(loc: list[str], root: type[BaseModel]) -> tuple[type[BaseModel] | None, str, int]:
    """Table in which the last key stands, that key's description, and how many keys count."""
    table: type[BaseModel] | None = root
    owner, description, annotation = table, "", None
    for depth, key in enumerate(loc):
        if table is not None:
            owner = table
            fields = {field.alias or name: field for name, field in table.model_fields.items()}
            if key not in fields and table is InstrumentsSettings:
                table = InstrumentSettings
                continue
            if key not in fields:
                return owner, "", depth + 1
            annotation, description = fields[key].annotation, fields[key].description or ""
        elif typing.get_origin(annotation) is dict:
            annotation = typing.get_args(annotation)[1]
        else:
            return owner, description, depth
        table = _table_of(annotation)
    return owner, description, len(loc)


def _table_of(annotation: Any) -> type[BaseModel] | None:
    """Return the table that an annotation allows, behind unions and annotations."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    if typing.get_origin(annotation) is dict:
        return None
    found = (_table_of(each) for each in typing.get_args(annotation))
    return next((table for table in found if table is not None), None)


def derivation_order(
    derived: Mapping[str, DerivedSettings], channels: Collection[str] = ()
) -> list[str]:
    """Order derived channels so that each finds what it needs.

    Parameters
    ----------
    derived : mapping of str to DerivedSettings
        The tables ``[derived.NAME]``.
    channels : collection of str, optional
        All channels there are.

    Returns
    -------
    list of str
        Their names, sources first.

    Raises
    ------
    RequestError
        If they need one another in a circle; the message prints it.
    """
    order: list[str] = []

    def visit(name: str, trail: tuple[str, ...]) -> None:
        if name in trail:
            circle = " -> ".join((*trail[trail.index(name) :], name))
            raise RequestError(
                f"derived channels need one another in a circle: {circle}. Make one of them from "
                "measured channels."
            )
        if name in order or name not in derived:
            return
        for source in sources_of(name, derived[name], channels):
            visit(source, (*trail, name))
        order.append(name)

    for name in derived:
        visit(name, ())
    return order


_TURNS = ("roll", "pitch", "yaw")


def sources_of(name: str, settings: DerivedSettings, channels: Collection[str]) -> tuple[str, ...]:
    """Channels that a derived channel needs.

    Parameters
    ----------
    name : str
        Its name.
    settings : DerivedSettings
        Its table.
    channels : collection of str
        All channels there are: a step of the rigid body takes the angles it finds among them.

    Returns
    -------
    tuple of str
        Names, each once.
    """
    if settings.expression is not None:
        return parse(settings.expression).channels
    sources = [str(settings.source)]
    if settings.position is not None:
        sources.append(settings.position)
    sources += settings.components or ()
    if settings.step in ("transfer", "remove_gravity"):
        turning = ["", "_rate", "_acceleration"]
        if settings.step == "remove_gravity":
            turning = [""]
        elif (known := canonical_channel(sources[0]) or canonical_channel(name)) is not None:
            turning = turning[: {"m": 1, "m/s": 2}.get(known.units, 3)]
        sources += [turn + kind for kind in turning for turn in _TURNS if turn + kind in channels]
    return tuple(dict.fromkeys(each for each in sources if each != name))


def needed_channels(settings: CampaignSettings, wanted: Collection[str]) -> set[str]:
    """Names of channels and of all that they are derived from."""
    needed: set[str] = set()
    ahead = list(wanted)
    while ahead:
        name = ahead.pop()
        if name not in needed:
            needed.add(name)
            if name in settings.derived:
                ahead += sources_of(name, settings.derived[name], settings.channel_names)
    return needed


def _cross_checks(settings: CampaignSettings) -> Iterable[str]:
    yield from _channel_mistakes(settings)
    yield from _derived_mistakes(settings)
    names = settings.channel_names
    listed = f"Channels: {', '.join(names)}."
    for name in settings.rig.positions:
        if name not in names:
            yield f"rig.positions.{name}: no such channel.{did_you_mean(name, names)} {listed}"
    wave = settings.campaign.period_channel
    if wave is not None and wave not in names:
        yield f"campaign.period_channel: received {wave!r}, no such channel." + (
            f"{did_you_mean(wave, names)} {listed}"
        )
    yield from _model_mistakes(settings)
    if wave is None or wave in names:
        yield from _period_mistakes(settings)
    yield from _instrument_mistakes(settings)
    for run, each in settings.runs.items():
        for name in each.channels:
            if name not in settings.channels:
                near = did_you_mean(name, settings.channels)
                yield (
                    f"runs.{run}.channels.{name}: no table [channels.{name}] to change.{near} "
                    "Add it there first."
                )


def _period_mistakes(settings: CampaignSettings) -> Iterable[str]:
    """Keys in encounter periods where there is no period, or where it is measured with them."""
    places = list(counted(settings))
    wave = settings.wave_channel
    if not places or settings.campaign.encounter_period is not None:
        return
    if wave is None:
        yield (
            f"{'.'.join(places[0])}: counts in encounter periods, and the campaign has none. State "
            "encounter_period (s) or period_channel in [campaign], or name a channel eta_…"
        )
        return
    behind = needed_channels(settings, [wave])
    for place in places:
        head, name, *rest = place
        in_run = head == "runs" and name in settings.period_runs and rest != ["probe_offset_span"]
        behind_wave = head == "derived" and name in behind
        if in_run or behind_wave or head == "instruments" or name == "longest_gap":
            yield (
                f"{'.'.join(place)}: counts in encounter periods, and the period is measured with "
                f"it, as the zero-up-crossing period of {wave}. State encounter_period (s) in "
                "[campaign], or this in seconds or hertz."
            )


def _instrument_mistakes(settings: CampaignSettings) -> Iterable[str]:
    known = list(settings.instruments.loggers)
    used = {logger for run in settings.runs.values() for logger in run.files}
    reference = settings.instruments.reference
    if reference is not None and reference not in {*known, *used}:
        near = did_you_mean(reference, sorted(used))
        yield f"instruments.reference: received {reference!r}, which no run has a file of.{near}"
    for run, each in settings.runs.items():
        for logger in each.files:
            if known and logger not in known:
                yield (
                    f"runs.{run}.files.{logger}: no table [instruments.{logger}]."
                    f"{did_you_mean(logger, known)} Instruments: {', '.join(known)}."
                )
    names = settings.channel_names
    for key, pair in settings.redundant.items():
        for name in pair.channels:
            if name not in names:
                near = did_you_mean(name, names)
                yield f"redundant.{key}.channels: received {name!r}, no such channel.{near}"


def _model_mistakes(settings: CampaignSettings) -> Iterable[str]:
    names = settings.channel_names
    listed = f"Channels: {', '.join(names)}."
    for table, model in settings.all_models().items():
        for key in ("states", "inputs"):
            for name in getattr(model, key):
                if name not in names:
                    near = did_you_mean(name, names)
                    yield f"{table}.{key}: received {name!r}, no such channel.{near} {listed}"


def _channel_mistakes(settings: CampaignSettings) -> Iterable[str]:
    tables = [(f"channels.{name}", name, each) for name, each in settings.channels.items()]
    for run, settings_of_run in settings.runs.items():
        tables += [
            (f"runs.{run}.channels.{name}", name, each)
            for name, each in settings_of_run.channels.items()
        ]
    for key, name, each in tables:
        try:
            _check_unit(name, each)
        except RequestError as error:
            yield f"{key}.unit: {error}"


def _check_unit(name: str, settings: ChannelSettings | DerivedSettings) -> None:
    if settings.unit is None:
        return
    canonical = canonical_channel(name)
    conversion(settings.unit, canonical.units if canonical else si_unit(settings.unit), name)


def _derived_mistakes(settings: CampaignSettings) -> Iterable[str]:
    names = settings.channel_names
    sound = True
    for name, each in settings.derived.items():
        if name in settings.channels:
            yield f"derived.{name}: [channels.{name}] exists too. Rename one of them."
        try:
            _check_unit(name, each)
        except RequestError as error:
            yield f"derived.{name}.unit: {error}"
        try:
            sources = sources_of(name, each, settings.channel_names)
        except RequestError as error:
            sound = False
            yield f"derived.{name}.expression: {error}"
            continue
        key = "expression" if each.expression is not None else "from"
        for source in sources:
            if source not in names:
                near = did_you_mean(source, names)
                yield (
                    f"derived.{name}.{key}: the channel '{source}' does not exist.{near} "
                    f"Channels: {', '.join(names)}."
                )
        if each.expression is not None and each.unit is None and canonical_channel(name) is None:
            yield (
                f"derived.{name}.unit: missing. '{name}' is a free name; state the unit of the "
                "expression, such as unit = 'm' ('-' for none)."
            )
    if sound:
        try:
            derivation_order(settings.derived, settings.channel_names)
        except RequestError as error:
            yield f"derived: {error}"
