"""Checks of settings that several modules share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from typing import Any, TypeVar

import numpy as np

from seakeep.errors import SHOWN, RequestError, did_you_mean

Json = dict[str, Any]
"""Settings as JSON values."""
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
        raise RequestError(
            f"{name} must be {', '.join(first)} or {last}; received {value!r:.{SHOWN}}."
        )


def check_flag(name: str, value: object) -> None:
    """Refuse a setting that is neither true nor false."""
    if not isinstance(value, bool | np.bool_):
        raise RequestError(f"{name} must be True or False; received {value!r:.{SHOWN}}.")


def names_of(value: Any, what: str, example: str) -> tuple[str, ...]:
    """Names in a list, each once; refuses a text, which is no list, and an empty list."""
    is_list = isinstance(value, Iterable) and not isinstance(value, str)
    names = tuple(dict.fromkeys(value)) if is_list else ()
    if not names or not all(isinstance(name, str) for name in names):
        raise RequestError(
            f"{what} must be a list of one or more names; received {value!r:.{SHOWN}}. Write "
            f"{example}."
        )
    return names


def plain(value: Any) -> Any:
    """Return JSON values with numbers and arrays of numpy and tuples in them as plain ones."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


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
