"""Telling how far the work on members has come."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

__all__ = ["Progress", "told"]

Progress = Callable[[int, int, str], None]
"""Called as ``progress(done, total, what)``."""

Result = TypeVar("Result")


def told(results: Iterable[Result], total: int, progress: Progress | None) -> Iterator[Result]:
    """Hand results on, and tell of each.

    Parameters
    ----------
    results : iterable
        One a member.
    total : int
        Their number.
    progress : callable or None
        Called as ``progress(done, total, what)``.

    Yields
    ------
    object
        The results.
    """
    for done, result in enumerate(results, start=1):
        if progress is not None:
            progress(done, total, f"member {done}")
        yield result
