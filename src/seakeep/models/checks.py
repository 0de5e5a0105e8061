"""Checks of settings that several modules share."""

from __future__ import annotations

import numbers
from collections.abc import Sequence

from seakeep.errors import RequestError

__all__ = ["check_choice", "check_integer"]


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
