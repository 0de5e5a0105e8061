"""``seakeep tank``: the virtual campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from typer import Option

from seakeep.cli.console import progress_bar, say


def tank(
    out: Annotated[Path, Option("-o", "--out", help="Folder for raw files and campaign.toml.")],
    seed: Annotated[
        int | None, Option(min=0, max=2**64 - 1, help="Seed of waves and noise.")
    ] = None,
    settings: Annotated[
        Path | None,
        Option(help="Tank settings (TOML); by default the CK-14e's."),
    ] = None,
    run: Annotated[list[str] | None, Option(help="Play this run only; may be repeated.")] = None,
    kind: Annotated[
        Literal["csv", "nc"], Option("--raw-format", help="Format of the raw files.")
    ] = "csv",
    one_logger: Annotated[
        bool,
        Option("--one-logger", help="One file and one clock per run, for all instruments."),
    ] = False,
    spacing: Annotated[
        Literal["equal", "jittered"] | None,
        Option(help="Frequencies of irregular seas; jittered never repeat."),
    ] = None,
    video: Annotated[list[str] | None, Option(help="Render this run's side view as MP4.")] = None,
) -> None:
    """Play a virtual campaign: raw files and campaign.toml.

    Raw files are like those of a towing tank. The folder truth holds the true motions; no command
    reads it to identify a model.

    Example: seakeep tank --out virtual --seed 0
    """
    from seakeep.tank.play import play
    from seakeep.tank.settings import default_settings, read_tank, with_waves

    chosen = default_settings() if settings is None else read_tank(settings)
    chosen = with_waves(chosen, seed, spacing)
    with progress_bar("Playing") as progress:
        files = play(
            chosen, out, kind=kind, one_logger=one_logger, names=run or None, videos=video or (),
            progress=progress,
        )  # fmt: skip
    count = sum(map(len, files.values()))
    say(f"Wrote {count} raw files and {out / 'campaign.toml'} (truth apart).")
