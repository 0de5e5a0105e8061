"""Checks of settings that several modules share."""

from __future__ import annotations

import numbers
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

from seakeep.errors import RequestError, did_you_mean

__all__ = ["check_choice", "check_integer", "settings_of"]

Settings = TypeVar("Settings")


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
        raise RequestError(f"{name} must be {', '.join(first)} or {last}; received {value!r}.")


def check_integer(name: str, value: object, least: int, optional: bool = False) -> None:
    """Refuse a setting that is not an integer of at least `least` (or None, if `optional`)."""
    if optional and value is None:
        return
    if isinstance(value, bool) or not isinstance(value, numbers.Integral) or value < least:
        hint = " Round it to an integer." if isinstance(value, float) else ""
        raise RequestError(
            f"{name} must be an integer of at least {least}{' or None' if optional else ''}; "
            f"received {value!r}.{hint}"
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
            f"{name} must be a seakeep.{kind.__name__} or None; received {value!r}. Write "
            f"{name}=seakeep.{kind.__name__}({example})."
        )
    dataclass: Any = kind
    known = [each.name for each in fields(dataclass)]
    for key in value:
        if key not in known:
            raise RequestError(
                f"{name}: unknown key '{key}'.{did_you_mean(str(key), known)} Keys: "
                f"{', '.join(known)}."
            )
    return kind(**value)
