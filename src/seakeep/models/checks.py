"""Checks of settings that several modules share."""

from __future__ import annotations

import functools
import json
import numbers
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass, fields
from typing import Any, TypeVar

from pydantic import TypeAdapter, ValidationError

from seakeep.arrays import GREATEST
from seakeep.errors import SHOWN, RequestError, did_you_mean, wanted

__all__ = [
    "check_choice",
    "check_integer",
    "check_keys",
    "of_json",
    "parsed",
    "settings_of",
    "typed",
]

Settings = TypeVar("Settings")
Made = TypeVar("Made")


def check_choice(name: str, value: object, choices: Sequence[str]) -> None:
    """Refuse a setting that is none of two or more words.

    Parameters
    ----------
    name : str
        What the message calls the setting.
    value : object
        What was received.
    choices : sequence of str
        The words.

    Raises
    ------
    RequestError
        If it is none of them.
    """
    if not isinstance(value, str) or value not in choices:
        *first, last = (f"'{word}'" for word in choices)
        raise RequestError(
            f"{name} must be {', '.join(first)} or {last}; received {value!r:.{SHOWN}}."
        )


def check_integer(name: str, value: object, least: int, optional: bool = False) -> None:
    """Refuse a setting that is not an integer of at least `least` (or None, if `optional`)."""
    if optional and value is None:
        return
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < least:
        hint = " Round it to an integer." if isinstance(value, float) else ""
        raise RequestError(
            f"{name} must be an integer of at least {least}{' or None' if optional else ''}; "
            f"received {value!r:.{SHOWN}}.{hint}"
        )


def settings_of(kind: type[Settings], name: str, value: object, example: str) -> Settings | None:
    """Return settings as they are, or made of a table of their keys; None stays None.

    Parameters
    ----------
    kind : type
        Dataclass of the settings.
    name : str
        What messages call the setting.
    value : kind, mapping or None
        What was received.
    example : str
        Arguments of a call that makes such settings.

    Returns
    -------
    kind or None

    Raises
    ------
    RequestError
        If it is something else, or a key is not known.
    """
    if value is None or isinstance(value, kind):
        return value
    if not isinstance(value, Mapping):
        raise RequestError(
            f"{name} must be a seakeep.{kind.__name__} or None; received {value!r:.{SHOWN}}. Write "
            f"{name}=seakeep.{kind.__name__}({example})."
        )
    check_keys(kind, value, f"{name}: ")
    return kind(**value)


def check_keys(kind: type, table: Mapping[str, object], what: str = "") -> None:
    """Refuse a table that has a key which a dataclass lacks, or lacks one that it needs.

    Parameters
    ----------
    kind : type
        The dataclass.
    table : mapping
        Its arguments.
    what : str, optional
        Start of the message, such as ``"alignment: "``.

    Raises
    ------
    RequestError
        Of the first such key.
    """
    taken = [each for each in fields(kind) if each.init]
    known = [each.name for each in taken]
    needed = [
        each.name for each in taken if each.default is MISSING and each.default_factory is MISSING
    ]
    listed = f"Keys: {', '.join(known)}."
    for key in table:
        if key not in known:
            near = did_you_mean(str(key), known)
            raise RequestError(f"{what}unknown key '{key}'.{near} {listed}")
    if missing := [key for key in needed if key not in table]:
        raise RequestError(f"{what}the key '{missing[0]}' is missing. {listed}")


def of_json(kind: type[Made], content: Mapping[str, Any]) -> Made:
    """Rebuild a dataclass from its fields as JSON values, those of dataclasses in it included."""
    made: Made = _adapter(kind).validate_python(content)  # type: ignore[arg-type]
    return made


def parsed(text: str, name: str, greatest: float = GREATEST) -> Any:
    """JSON value of a text that a file keeps; numbers that nothing measures are refused.

    Parameters
    ----------
    text : str
        The text.
    name : str
        What a message calls it.
    greatest : float, optional
        Magnitude above which finite numbers are refused.

    Raises
    ------
    ValueError
        If it is no JSON, or holds such a number.
    """

    def bounded(kind: type[float]) -> Callable[[str], float | _Odd]:
        return lambda each: kind(each) if abs(float(each)) <= greatest else _Odd(each)

    try:
        found = json.loads(
            text, parse_constant=_constant, parse_float=bounded(float), parse_int=bounded(int)
        )
        _refuse_odd(found, name)
    except json.JSONDecodeError:
        raise ValueError(f"{name}: received {text!r:.{SHOWN}}, which is no JSON") from None
    except RecursionError:
        raise ValueError(f"{name} is nested hundreds of levels deep") from None
    return found


@dataclass(frozen=True)
class _Odd:
    """A number that nothing measures, until its key is known."""

    text: str


def _constant(text: str) -> float | _Odd:
    return _Odd(text) if text == "NaN" else float(text)


def _refuse_odd(value: object, place: str) -> None:
    if isinstance(value, _Odd):
        raise ValueError(f"{place}: received {value.text:.{SHOWN}}, which nothing measures")
    if isinstance(value, dict | list):
        for key, each in value.items() if isinstance(value, dict) else enumerate(value):
            _refuse_odd(each, f"{place}.{key}")


def typed(kind: type[Made], content: object, place: str = "") -> Made:
    """Rebuild a dataclass from JSON values; its annotations say of which types they must be.

    Parameters
    ----------
    kind : type
        The dataclass.
    content : object
        JSON values.
    place : str, optional
        What a message calls them; by default the name of the class.

    Raises
    ------
    ValueError
        If a value is missing, or of another type.
    """
    anything: Any = kind  # mypy takes no type for hashable
    whole = place or kind.__name__
    try:
        text = json.dumps(content)
    except TypeError:
        raise ValueError(f"{whole}: received {content!r:.{SHOWN}}, which is no JSON") from None
    try:
        made: Made = _adapter(anything).validate_json(text, strict=True)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        key = ".".join([whole, *_keys(first["loc"], content)])
        if first["type"] == "missing":
            raise ValueError(f"{key}.{first['loc'][-1]} is missing") from None
        received = f"received {first['input']!r:.{SHOWN}}"
        if first["type"] == "value_error":
            said = str(first["ctx"]["error"])
            known = "received" in said
            raise ValueError(f"{key}: {said}" if known else f"{key}: {received}; {said}") from None
        said = "is no JSON" if first["type"] == "json_invalid" else wanted(first["msg"])
        raise ValueError(f"{key}: {received}, which {said}") from None
    return made


def _keys(place: Sequence[str | int], content: Any) -> Iterator[str]:
    """Keys of a place without the names of types, which pydantic puts between them."""
    for each in place:
        with suppress(LookupError, TypeError):
            content = content[each]
            yield str(each)


@functools.cache
def _adapter(kind: Any) -> Any:
    return TypeAdapter(kind)
