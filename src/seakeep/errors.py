"""Errors and warnings of seakeep.

Every message says the symptom, what was received, and how to fix it. The command line prints
the message alone; ``exit_status`` is what it returns to the shell.
"""

import difflib
import sys
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

__all__ = [
    "SHOWN",
    "DataError",
    "MissingFileError",
    "RequestError",
    "SeakeepError",
    "SeakeepWarning",
    "did_you_mean",
    "quiet",
    "wanted",
    "warn",
]

SHOWN = 60
"""Characters of a received value that a message shows at most."""


class SeakeepError(Exception):
    """Base of all errors that seakeep raises on purpose."""

    exit_status = 1


class RequestError(SeakeepError, ValueError):
    """The request is wrong: an unknown name, a setting out of range, a key that does not exist."""

    exit_status = 2


class MissingFileError(RequestError):
    """A file that the request names is not there, or cannot be read."""


class DataError(SeakeepError, ValueError):
    """The data are wrong: gaps, unsorted times, a constant channel, a damaged file."""

    exit_status = 1


class SeakeepWarning(UserWarning):
    """A result was produced, but something about it needs attention."""


@contextmanager
def needing(doing: str, extra: str) -> Iterator[None]:
    """Say how to install a package that an import within lacks: with an extra of seakeep."""
    try:
        yield
    except ImportError as error:
        raise RequestError(
            f"{doing} needs {error.name}, which is not installed. Install it with: pip install "
            f"'seakeep[{extra}]'"
        ) from error


@contextmanager
def naming(place: str) -> Iterator[None]:
    """Put the place of what is done within before the words of its errors."""
    try:
        yield
    except SeakeepError as error:
        raise type(error)(f"{place}: {error}") from None


@contextmanager
def quiet() -> Iterator[None]:
    """Give no SeakeepWarning of what is done within."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SeakeepWarning)
        yield


def warn(message: str) -> None:
    """Give a SeakeepWarning whose place is the line outside seakeep that led to it."""
    level, frame = 1, sys._getframe()
    while frame.f_back and frame.f_globals.get("__name__", "").partition(".")[0] in _WITHIN:
        level, frame = level + 1, frame.f_back
    warnings.warn(message, SeakeepWarning, stacklevel=level)


_WITHIN = ("seakeep", "functools", "contextlib")


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return ``" Did you mean 'x'?"`` for the known name nearest to `name`, or an empty string.

    Parameters
    ----------
    name : str
        What was received.
    known : iterable of str
        The names that exist.

    Returns
    -------
    str
        A sentence with a leading space, ready to be appended, or ``""``.

    Examples
    --------
    >>> did_you_mean("heeve", ["heave", "pitch"])
    " Did you mean 'heave'?"
    """
    candidates = list(known)
    lowered = {candidate.lower(): candidate for candidate in candidates}
    near = difflib.get_close_matches(name.lower(), list(lowered), n=1, cutoff=0.6)
    return f" Did you mean '{lowered[near[0]]}'?" if near else ""


def wanted(message: str) -> str:
    """What pydantic says that a value should be, in our words."""
    words = message.removeprefix("Input ").removeprefix("Dictionary ").replace("valid ", "")
    for theirs, ours in _WORDS:
        words = words.replace(theirs, ours)
    return words


_WORDS = (("a array", "a list"), ("an object", "a table"), ("a integer", "an integer"))
