"""``seakeep tank``: the virtual campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from seakeep.cli.console import print_table, progress_bar, say
from seakeep.errors import RequestError
from seakeep.files import check_output, is_there, make_folder


def tank(
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for raw files and campaign.toml.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option(min=0, max=2**64 - 1, help="Seed of waves and noise.")
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option(help="Tank settings (TOML); by default the CK-14e's."),
    ] = None,
    run: Annotated[
        list[str] | None, typer.Option(help="Play this run only; may be repeated.")
    ] = None,
    kind: Annotated[
        Literal["csv", "nc"], typer.Option("--raw-format", help="Format of the raw files.")
    ] = "csv",
    one_logger: Annotated[
        bool,
        typer.Option("--one-logger", help="One file and one clock per run, for all instruments."),
    ] = False,
    spacing: Annotated[
        Literal["equal", "jittered"] | None,
        typer.Option(help="Frequencies of irregular seas; jittered never repeat."),
    ] = None,
    video: Annotated[
        list[str] | None, typer.Option(help="Render this run's side view as MP4.")
    ] = None,
    figures: Annotated[
        bool, typer.Option("--figures", help="Draw runs, spectrum and coefficients as well.")
    ] = False,
    statistics: Annotated[
        bool,
        typer.Option("--statistics", help="Print realised waves beside the paper's numbers."),
    ] = False,
) -> None:
    """Play a virtual campaign: raw files and campaign.toml.

    Raw files are like those of a towing tank. The folder truth holds the true motions; no command
    reads it to identify a model.

    Example: seakeep tank --out virtual --seed 0
    """
    if out is None and not statistics:
        raise RequestError(
            "nothing to do: give --out DIR for the files of a campaign, or --statistics for the "
            "realised waves."
        )
    from seakeep.report.tank import realised_tables
    from seakeep.tank.play import check_settings, play
    from seakeep.tank.realised import realise_runs
    from seakeep.tank.settings import default_settings, read_tank, with_waves

    chosen = default_settings() if settings is None else read_tank(settings)
    chosen = with_waves(chosen, seed, spacing)
    names = run or list(chosen.runs)
    if out is not None and figures:
        _check_figures(out / "figures", names)
    rig = check_settings(chosen, names)
    if out is not None:
        with progress_bar("Playing") as progress:
            files = play(
                chosen, out, kind=kind, one_logger=one_logger, names=names, videos=video or (),
                progress=progress,
            )  # fmt: skip
        count = sum(map(len, files.values()))
        say(f"Wrote {count} raw files and {out / 'campaign.toml'} (truth apart).")
    if not (statistics or figures):
        return
    with progress_bar("Measuring") as progress:
        measured = realise_runs(chosen, rig, names, progress)
    if statistics:
        for table in realised_tables(chosen, measured):
            print_table(table)
    if figures and out is not None:
        from seakeep.report.tank import write_tank_figures

        for path in write_tank_figures(chosen, rig, measured, make_folder(out / "figures")):
            say(f"Wrote {path}")


def _check_figures(folder: Path, runs: list[str]) -> None:
    """Refuse, before any work, to replace pictures of the user."""
    for name in ("hydrodynamics", "spectrum", *(f"run_{run}" for run in runs)):
        if is_there(path := folder / f"{name}.png"):
            check_output(path, "figure")
