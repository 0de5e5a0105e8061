"""Shared by all commands: streams, progress, and error messages.

Options that several commands share.
"""

from __future__ import annotations

import math
import os
import sys
import time
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import lru_cache
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, Literal

from rich.console import Console
from typer import Argument, Option

from seakeep.errors import RequestError, SeakeepWarning

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from seakeep.arrays import Progress
    from seakeep.campaign import Campaign
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


DEFAULT_LEVEL = 0.95

CampaignFile = Annotated[Path, Argument(help="Campaign file.", metavar="CAMPAIGN.toml")]
FullScale = Annotated[
    bool,
    Option(
        "--full-scale",
        help="Convert results by Froude's law with the campaign's scale factor; START and STEPS "
        "stay at model scale.",
    ),
]
Level = Annotated[
    float | None,
    Option(
        help="For an ensemble: probability between the bounds of the band; by default 0.95, or "
        "what a calibrated band was made for."
    ),
]
Steps = Annotated[
    str | None,
    Option(help="Number of instants, or encounter periods such as '15 T'; by default to the end."),
]
Workers = Annotated[
    int | None,
    Option(
        help="Processes for the members of a large ensemble; by default this process alone.", min=1
    ),
]
ModelFile = Annotated[Path, Argument(help="Model file written by seakeep fit.", metavar="MODEL.nc")]
ModelKey = Annotated[
    str | None, Option("--model", help="Key in [models.NAME]; by default the table [model].")
]
Scheduler = Annotated[
    str | None,
    Option(
        help="Scheduler of a running Dask cluster to use instead: tcp://HOST:8786.",
        metavar="ADDRESS",
    ),
]
BandKind = Annotated[
    Literal["members", "calibrated"] | None,
    Option(
        "--band",
        help="For an ensemble: 'members', the quantiles of its members, or 'calibrated', which "
        "seakeep calibrate made; by default members.",
    ),
]
Degrees = Annotated[bool, Option("--degrees/--radians", help="Unit of angles.")]


def read_files(campaign: Campaign, *others: Path) -> list[Path]:
    """Files that a command on a campaign reads: its own, the raw ones, and the prepared ones."""
    from seakeep.campaign.prepare import prepared_folder

    files = [campaign.path, *others]
    for name in campaign.settings.runs:
        with suppress(RequestError):  # what cannot be found is not read
            files += campaign.files_of(name).values()
        files.append(prepared_folder(campaign) / f"{name}.nc")
    return files


def executor_of(
    workers: int | None, scheduler: str | None, usual: int = 1
) -> AbstractContextManager[Executor | None]:
    """Executor of a command: a Dask cluster, processes, or for one worker this process."""
    from seakeep.executor import cluster, processes

    if workers and scheduler:
        raise RequestError(
            f"--workers {workers} counts processes on this machine, and --scheduler {scheduler} "
            "hands all work to a cluster. Give one of the two."
        )
    if scheduler is not None:
        return cluster(scheduler)
    count = workers or usual
    return nullcontext() if count == 1 else processes(count)


def cores() -> int:
    """Cores that this process may use."""
    usable = getattr(os, "sched_getaffinity", None)  # Linux alone has it
    return len(usable(0)) if usable else os.cpu_count() or 1


def say_written(paths: Iterable[Path]) -> None:
    """Say which files were written."""
    say(f"Wrote {', '.join(map(str, paths))}")


def refuse(given: Mapping[str, object], words: str) -> None:
    """Refuse the first option that is given: with a value, or a flag that is set."""
    for option, value in given.items():
        if value is not None and value is not False:
            raise RequestError(f"{option} {words}")
