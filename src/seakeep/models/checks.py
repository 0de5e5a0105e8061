"""Checks of settings that several modules share."""

from __future__ import annotations

from collections.abc import Sequence

from seakeep.errors import RequestError

__all__ = ["check_choice"]


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
