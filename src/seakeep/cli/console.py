"""Shared by all commands: streams, progress, and error messages."""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import IO, TYPE_CHECKING, Any

from rich.console import Console

from seakeep.errors import SeakeepWarning

if TYPE_CHECKING:
    from seakeep.arrays import Progress
    from seakeep.report.tables import Table

SECONDS_BETWEEN_LINES = 5.0
PIPE_WIDTH = 140
"""Columns of a table that goes to a file or a pipe, where nobody can widen the window."""


def results() -> Console:
    """Console of results, on standard output."""
    width = None if sys.stdout.isatty() else PIPE_WIDTH
    return Console(file=sys.stdout, width=width, highlight=False, markup=False, emoji=False)


def print_table(table: Table, note: bool = True) -> None:
    """Print a table, its title above and its note below."""
    from seakeep.report.tables import rich_tables

    console = results()
    console.print(table.title, style="bold", soft_wrap=True)
    console.print(*rich_tables(table, console.width))
    if note and table.note:
        console.print(f"{table.note}\n", soft_wrap=True)


def messages() -> Console:
    """Console of messages, on standard error; long lines are left to the terminal.

    It is the same one while a bar is shown, which moves down for a message.
    """
    return _console(getattr(sys.stderr, "rich_proxied_file", sys.stderr))


def say(text: str, style: str | None = None) -> None:
    """Print a message."""
    messages().print(text, style=style)


def show(text: str) -> None:
    """Print a line of results, which the terminal may wrap."""
    results().print(text, soft_wrap=True)


@lru_cache(maxsize=1)
def _console(stream: IO[str]) -> Console:
    return Console(file=stream, highlight=False, soft_wrap=True, markup=False, emoji=False)


@contextmanager
def progress_bar(what: str) -> Iterator[Progress]:
    """Show progress: a bar on a terminal, else a line every few seconds, on standard error."""
    console = messages()
    if not console.is_terminal:
        last, began = -math.inf, (time.monotonic(), 0)

        def line(done: int, total: int, name: str) -> None:
            nonlocal last, began
            now = time.monotonic()
            if done < began[1]:  # a new count
                began = (now, done)
            if now - last < SECONDS_BETWEEN_LINES and done < total:
                return
            last = now
            left = (now - began[0]) / max(done - began[1], 1) * (total - done)
            words = f" (about {left:.0f} s left)" if done > began[1] and left >= 1 else ""
            console.print(f"{what} {done}/{total}: {name}{words}")

        yield line
        return
    from rich import progress as rich
    from rich.table import Column

    bar = rich.Progress(
        rich.TextColumn("{task.description}"),
        rich.BarColumn(bar_width=20),
        rich.MofNCompleteColumn(),
        rich.TimeRemainingColumn(),
        rich.TextColumn("{task.fields[name]}", table_column=Column(ratio=1, no_wrap=True)),
        console=console,
        transient=True,
        expand=True,
    )
    with bar:
        task = bar.add_task(what, total=None, name="")

        def advance(done: int, total: int, name: str) -> None:
            bar.update(task, total=total, completed=done, name=name)

        yield advance


@contextmanager
def tell_warnings() -> Iterator[None]:
    """Print warnings of seakeep as one line each, and leave the others to Python."""
    default_show, seen = warnings.showwarning, set[str]()

    def once(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
        if issubclass(category, SeakeepWarning):
            if str(message) in seen:  # of several models, once
                return
            seen.add(str(message))
            say(f"Note: {message}", style="yellow")
        else:
            default_show(message, category, *where, **more)

    with warnings.catch_warnings():
        warnings.simplefilter("always", SeakeepWarning)
        warnings.showwarning = once
        yield
