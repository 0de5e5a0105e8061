"""``seakeep tank``: the virtual campaign."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from seakeep.cli.console import print_table, progress_bar, say
from seakeep.errors import RequestError
from seakeep.files import check_output, is_there, make_folder

if TYPE_CHECKING:
    from seakeep.tank.dynamics import Rig
    from seakeep.tank.realised import Realised
    from seakeep.tank.settings import TankSettings


def tank(
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for raw files and campaign.toml.")
    ] = None,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, max=2**64 - 1, help="Seed of waves and noise.")
    ] = None,
    settings: Annotated[
        Path | None,
        typer.Option("--settings", help="Tank settings (TOML); by default the CK-14e's."),
    ] = None,
    run: Annotated[
        list[str] | None, typer.Option("--run", help="Play this run only; may be repeated.")
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
        typer.Option("--spacing", help="Frequencies of irregular seas; jittered never repeat."),
    ] = None,
    video: Annotated[
        list[str] | None, typer.Option("--video", help="Render this run's side view as MP4.")
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
    from seakeep.tank.play import check_settings, play
    from seakeep.tank.settings import default_settings, read_tank, with_waves

    made = default_settings() if settings is None else read_tank(settings)
    wanted = with_waves(made, seed, spacing)
    names = run or list(wanted.runs)
    drawn = ["hydrodynamics", "spectrum", *(f"run_{name}" for name in names)] if figures else []
    for path in [] if out is None else [out / "figures" / f"{name}.png" for name in drawn]:
        if is_there(path):
            check_output(path, "figure")
    rig = check_settings(wanted, names)
    if out is not None:
        with progress_bar("Playing") as progress:
            files = play(
                wanted, out, kind=kind, one_logger=one_logger, names=names, videos=video or (),
                progress=progress,
            )  # fmt: skip
        count = sum(map(len, files.values()))
        say(f"Wrote {count} raw files and {out / 'campaign.toml'} (truth apart).")
    if statistics or figures:
        measured = _measured(wanted, names, rig)
        if statistics:
            _print(wanted, measured)
        if figures and out is not None:
            _draw(wanted, rig, measured, out / "figures")


def _measured(settings: TankSettings, names: list[str], rig: Rig) -> list[Realised]:
    from seakeep.tank.play import play_run
    from seakeep.tank.realised import realise

    measured = []
    with progress_bar("Measuring") as progress:
        for done, name in enumerate(names):
            progress(done, len(names), name)
            measured.append(realise(play_run(settings, name, rig), name))
        progress(len(names), len(names), "done")
    return measured


def _print(settings: TankSettings, measured: list[Realised]) -> None:
    from seakeep.report.tables import Table
    from seakeep.tank.realised import comparison, matrix_rows

    matrix = matrix_rows(settings, measured)
    rows: tuple[tuple[str, ...], ...] = tuple(tuple(row.values()) for row in matrix)
    print_table(Table("matrix", "Test matrix", tuple(matrix[0]), rows, numeric=(0, 2, 3, 5)))
    heads: tuple[str, ...] = ("", "unit", "here", "paper", "tolerance", "")
    rows = tuple(
        (
            *(line.name, line.unit),
            *(f"{value:.3f}" for value in (line.ours, line.paper, line.tolerance)),
            "within" if line.agrees else "outside",
        )
        for line in comparison(settings, measured)
    )
    print_table(Table("waves", "Realised waves, forward probe", heads, rows, numeric=(2, 3, 4)))
    rows = tuple(
        (
            *(each.run, channel),
            *(f"{value + 0.0:.4f}" for value in (round(each.mean[channel], 4), spread)),
            "" if slack is None else f"{100 * slack:.0f} %",
        )
        for each in measured
        for channel, spread in each.spread.items()
        for slack in (each.slack.get(channel.removeprefix("mooring_")),)
    )
    heads = ("run", "channel", "mean", "SD", "slack")
    print_table(Table("truth", "True motions and loads", heads, rows, numeric=(2, 3, 4)))


def _draw(settings: TankSettings, rig: Rig, measured: list[Realised], folder: Path) -> None:
    from seakeep.report.figures.runs import (
        hydrodynamics_figure,
        run_figure,
        tank_spectrum_figure,
    )
    from seakeep.report.style import save_figure
    from seakeep.tank.play import play_run, truth

    make_folder(folder)
    written = [save_figure(hydrodynamics_figure(rig, settings), folder / "hydrodynamics.png")]
    if any(each.irregular for each in measured):
        written.append(
            save_figure(tank_spectrum_figure(settings, measured), folder / "spectrum.png")
        )
    for each in measured:
        data = truth(play_run(settings, each.run, rig), each.run, 0.02)
        written.append(save_figure(run_figure(data), folder / f"run_{each.run}.png"))
    for path in written:
        say(f"Wrote {path}")
