"""Options that several commands share."""

from __future__ import annotations

import os
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from seakeep.errors import RequestError

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from seakeep.campaign import Campaign

DEFAULT_LEVEL = 0.95

CampaignFile = Annotated[Path, typer.Argument(help="Campaign file.", metavar="CAMPAIGN.toml")]
FullScale = Annotated[
    bool,
    typer.Option(
        "--full-scale",
        help="Convert results by Froude's law with the campaign's scale factor; START and STEPS "
        "stay at model scale.",
    ),
]
Level = Annotated[
    float | None,
    typer.Option(
        help="For an ensemble: probability between the bounds of the band; by default 0.95, or "
        "what a calibrated band was made for.",
    ),
]
Steps = Annotated[
    str | None,
    typer.Option(
        help="Number of instants, or encounter periods such as '15 T'; by default to the end.",
    ),
]
Workers = Annotated[
    int | None,
    typer.Option(
        help="Processes for the members of a large ensemble; by default this process alone.",
        min=1,
    ),
]
ModelFile = Annotated[
    Path, typer.Argument(help="Model file written by seakeep fit.", metavar="MODEL.nc")
]
ModelKey = Annotated[
    str | None,
    typer.Option("--model", help="Key in [models.NAME]; by default the table [model]."),
]
Scheduler = Annotated[
    str | None,
    typer.Option(
        help="Scheduler of a running Dask cluster to use instead: tcp://HOST:8786.",
        metavar="ADDRESS",
    ),
]
BandKind = Annotated[
    Literal["members", "calibrated"] | None,
    typer.Option(
        "--band",
        help="For an ensemble: 'members', the quantiles of its members, or 'calibrated', which "
        "seakeep calibrate made; by default members.",
    ),
]
Degrees = Annotated[bool, typer.Option("--degrees/--radians", help="Unit of angles.")]


def read_files(campaign: Campaign, *others: Path) -> list[Path]:
    """Files that a command on a campaign reads: its own, the raw ones, and the prepared ones."""
    from seakeep.campaign.store import prepared_folder

    files = [campaign.path, *others]
    for name in campaign.settings.runs:
        with suppress(RequestError):  # what cannot be found is not read
            files += campaign.files_of(name).values()
        files.append(prepared_folder(campaign) / f"{name}.nc")
    return files


def member_executor(
    workers: int | None, scheduler: str | None
) -> AbstractContextManager[Executor | None]:
    """Executor for the members of an ensemble; without either option this process."""
    from seakeep.models.executor import make_executor

    given = workers is not None or scheduler is not None
    return make_executor(checked_count(workers, scheduler) if given else 1, scheduler)


def checked_count(workers: int | None, scheduler: str | None) -> int:
    """Number of local workers: by default one per core, one where a cluster does the work."""
    if workers is not None and scheduler is not None:
        raise RequestError(
            f"--workers {workers} counts processes on this machine, and --scheduler {scheduler} "
            "hands all work to a cluster. Give one of the two."
        )
    if workers is None and scheduler is None:
        usable = getattr(os, "sched_getaffinity", None)  # Linux alone has it
        return len(usable(0)) if usable else os.cpu_count() or 1
    return workers or 1
