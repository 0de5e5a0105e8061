"""``seakeep tank``, ``track``, ``init``, ``prepare`` and ``datasets``."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from typer import Argument, Option

from seakeep.cli.console import CampaignFile, progress_bar, results, say, say_written
from seakeep.errors import RequestError, SeakeepError
from seakeep.files import check_output, is_there, write_text

if TYPE_CHECKING:
    from seakeep.campaign import Campaign


def tank(
    out: Annotated[Path, Option("-o", "--out", help="Folder for raw files and campaign.toml.")],
    seed: Annotated[
        int | None, Option(min=0, max=2**64 - 1, help="Seed of waves and noise.")
    ] = None,
    settings: Annotated[
        Path | None, Option(help="Tank settings (TOML); by default the CK-14e's.")
    ] = None,
    run: Annotated[list[str] | None, Option(help="Play this run only; may be repeated.")] = None,
    kind: Annotated[
        Literal["csv", "nc"], Option("--raw-format", help="Format of the raw files.")
    ] = "csv",
    one_logger: Annotated[
        bool, Option("--one-logger", help="One file and one clock per run, for all instruments.")
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

    chosen = read_tank(settings) if settings else default_settings()
    chosen = with_waves(chosen, seed, spacing)
    with progress_bar("Playing") as progress:
        files = play(
            chosen, out, kind=kind, one_logger=one_logger, names=run or None, videos=video or (),
            progress=progress,
        )  # fmt: skip
    count = sum(map(len, files.values()))
    say(f"Wrote {count} raw files and {out / 'campaign.toml'} (truth apart).")


def track(
    video: Annotated[Path, Argument(help="Video of the vessel.", metavar="VIDEO.mp4")],
    out: Annotated[
        Path | None,
        Option("-o", "--out", help="Result, .csv or .nc; by default CSV on standard output."),
    ] = None,
    sheet: Annotated[
        Path | None, Option("--contact-sheet", help="PNG of tracked frames, including the worst.")
    ] = None,
    metres_per_pixel: Annotated[
        float | None, Option(help="Calibration; by default from the panel's size as seen.")
    ] = None,
    panel: Annotated[
        tuple[float, float],
        Option(
            metavar="LENGTH HEIGHT",
            help="Length and height of the panel, m: two numbers separated by a space.",
        ),
    ] = (0.30, 0.10),
    panel_place: Annotated[
        tuple[float, float],
        Option(
            metavar="X Z",
            help="Panel's centre from the centre of gravity, downstream and up, m: two numbers "
            "separated by a space.",
        ),
    ] = (0.0, 0.25),
    downstream: Annotated[
        Literal["right", "left"], Option(help="Side of the picture to which waves run.")
    ] = "right",
    camera_pitch: Annotated[
        float, Option(help="Pitch that the picture shows of a level vessel, deg.")
    ] = 0.0,
    origin: Annotated[
        tuple[float, float] | None,
        Option(
            metavar="X Y",
            help="Pixel of the panel's centre at rest, two numbers separated by a space; by "
            "default from the first second.",
        ),
    ] = None,
    threshold: Annotated[
        tuple[int, int, int],
        Option(
            metavar="RED GREEN BLUE",
            help="Smallest red, green and blue of the panel, each 0 to 255: three numbers "
            "separated by spaces.",
        ),
    ] = (150, 150, 150),
    region: Annotated[
        tuple[int, int, int, int] | None,
        Option(
            metavar="LEFT TOP WIDTH HEIGHT",
            help="Part of the picture searched, pixels: four numbers separated by spaces.",
        ),
    ] = None,
    lamp: Annotated[
        tuple[float, float, float] | None,
        Option(
            metavar="X Y RADIUS",
            help="Lamp that shows the trigger, pixels from the upper left corner: three numbers "
            "separated by spaces, such as 40 40 12.",
        ),
    ] = None,
    tolerance: Annotated[
        float, Option(help="Fraction by which the panel's length may differ.")
    ] = 0.02,
    bridge: Annotated[float, Option(help="Bridge gaps up to this long, s; by default none.")] = 0.0,
    passband: Annotated[
        float, Option(help="Edge of the low-pass filter, Hz; 0 filters nothing.")
    ] = 4.0,
    mru: Annotated[Path | None, Option(help="Record with heave and pitch to compare with.")] = None,
    max_lag: Annotated[
        float | None,
        Option(
            help="Longest lag searched against --mru, s; by default 10, or a quarter of the record."
        ),
    ] = None,
) -> None:
    """Track surge, heave and pitch of a vessel in a video.

    Finds a white panel on the vessel in each frame, and states the quality of each frame.
    x points downstream, z up, pitch is positive bow up. Flagged frames (occluded, overexposed,
    lost …) give no motion unless --bridge is given. Needs the extra 'video'.

    Example: seakeep track side_view.mp4 -o track.csv --contact-sheet sheet.png
    """
    if out and out.suffix not in (".nc", ".csv"):
        raise RequestError(f"{out} ends in '{out.suffix}'; a track is written as .csv or .nc.")
    if sheet and sheet.suffix.lower() != ".png":
        raise RequestError(f"a contact sheet is written as PNG; received {sheet}.")
    from seakeep.report.track import (
        CONTACT_SHEET,
        HEADER,
        TRACK,
        agreement_words,
        track_text,
        track_words,
        write_contact_sheet,
        write_track,
    )

    inputs = [*filter(None, (video, mru))]
    for place, kind in ((out, TRACK), (sheet, CONTACT_SHEET)):
        if place:
            check_output(place, kind, inputs, HEADER)
    from seakeep.campaign import read_table
    from seakeep.signals import TrackingSettings, contact_sheet, track_video

    settings = TrackingSettings(
        metres_per_pixel=metres_per_pixel,
        panel=panel,
        panel_place=panel_place,
        downstream=downstream,
        camera_pitch=math.radians(camera_pitch),
        origin=origin,
        lower=threshold,
        region=region,
        lamp=lamp,
        tolerance=tolerance,
        bridge=bridge,
        passband=passband if passband != 0 else None,
    )
    reference = read_table(mru, columns=("heave", "pitch")) if mru else None
    with progress_bar("Tracking") as progress:
        track = track_video(video, settings, progress)
    if sheet:
        write_contact_sheet(contact_sheet(video, track), sheet)
    if out is None:
        typer.echo(track_text(track), nl=False)
    else:
        write_track(track, out)
    say(track_words(track))
    if written := [*filter(None, (out, sheet))]:
        say_written(written)
    if reference is not None:
        for words, style in agreement_words(track, reference, max_lag):
            say(words, style=style)


SHOWN = 12
"""Findings that prepare prints at most: what fits a screen beside the files' names."""


def init(
    files: Annotated[list[Path], Argument(help="Files of measured runs.", metavar="FILE…")],
    out: Annotated[
        Path | None, Option("-o", "--out", help="File to write; by default standard output.")
    ] = None,
    force: Annotated[bool, Option("--force", help="Overwrite an earlier draft.")] = False,
    skip_rows: Annotated[int | None, Option(min=0, help="Lines to skip above the header.")] = None,
    delimiter: Annotated[
        Literal[",", ";", "tab", "blank"] | None, Option(help="Mark between columns.")
    ] = None,
    decimal: Annotated[Literal[".", ","] | None, Option(help="Decimal mark.")] = None,
    group: Annotated[str | None, Option(help="Group of HDF5 or TDMS, topic of ROS.")] = None,
) -> None:
    """Draft a campaign file from measured files' headers.

    Columns, units and canonical names are guessed: read the draft before you use it.

    Example: seakeep init docs/tutorial/run1.csv docs/tutorial/run2.csv -o campaign.toml
    """
    from seakeep.campaign import draft_campaign

    if out:
        if is_there(out) and not force:
            raise RequestError(f"{out} exists already. Give another name, or --force.")
        check_output(out, "draft", files)
    folder = out.parent if out else Path()
    marks = {"tab": "\t", "blank": " "}
    mark = delimiter and marks.get(delimiter, delimiter)
    options = {"skip_rows": skip_rows, "delimiter": mark, "decimal": decimal, "group": group}
    text = draft_campaign(files, folder, options)
    if out is None:
        typer.echo(text, nl=False)
        return
    write_text(out, text)
    say(f"Wrote {out}. Read it, then: seakeep prepare {out}")


def prepare(
    campaign: CampaignFile,
    out: Annotated[
        Path | None,
        Option(
            "-o",
            "--out",
            help="Folder; by default 'prepared' beside the campaign, the only folder that other "
            "commands read.",
        ),
    ] = None,
    anew: Annotated[
        bool, Option("--anew", help="Prepare all runs again, up-to-date ones too.")
    ] = False,
    sheet: Annotated[
        bool, Option("--sheet/--no-sheet", help="Write the data-quality sheet.")
    ] = True,
) -> None:
    """Prepare runs from raw files, with a data-quality sheet.

    Raw files become analysis-ready runs, one NetCDF file each.

    Each run is written when it is finished: after an interruption, the same command continues.
    A run that cannot be read is reported at the end, with exit status 1.

    The other commands use these files while settings and raw files are unchanged, and prepare
    missing runs in memory.

    Example: seakeep prepare docs/tutorial/campaign.toml
    """
    from seakeep.campaign import read_campaign, write_prepared
    from seakeep.campaign.prepare import prepared_folder
    from seakeep.campaign.survey import as_one
    from seakeep.report.quality_sheet import SHEET

    read = read_campaign(campaign)
    folder = prepared_folder(read, out)
    for name in ("quality.html", *(f"quality_{run}.png" for run in read.runs)):
        if sheet and is_there(folder / name):
            check_output(folder / name, SHEET)
    with progress_bar("Preparing") as progress:
        failures: dict[str, SeakeepError] = {}
        files = write_prepared(read, out, progress=progress, anew=anew, failures=failures)
    for path in files.values():
        typer.echo(str(path))
    if files:
        _report_runs(read, files, failures, sheet)
    if folder.resolve() != prepared_folder(read).resolve():
        say(
            f"Note: other commands look for prepared runs in {prepared_folder(read)} alone, and "
            f"prepare anew what is not there. Those in {out} are for load_prepared.",
            style="yellow",
        )
    if failures:
        raise as_one(failures)


def _report_runs(
    read: Campaign, files: Mapping[str, Path], failures: Mapping[str, SeakeepError], sheet: bool
) -> None:
    """Print steps and findings of prepared runs, and write their sheet unless it is fresh."""
    from seakeep.campaign import load_prepared
    from seakeep.quality import findings_of
    from seakeep.report.quality_sheet import is_newer, steps_of, write_quality_sheet

    folder = next(iter(files.values())).parent
    runs = load_prepared(read, folder, list(files))
    words = steps_of(next(iter(runs.values())))
    say(f"{words[0].upper()}{words[1:]}.")
    # What the checks found and no warning said: one line per channel and kind.
    groups = defaultdict(list)
    for run in runs.values():
        for each in findings_of(run):
            if not each.kind.remedy:
                groups[each.channel, each.kind.name].append(each)
    for same in list(groups.values())[:SHOWN]:
        others = len({each.run for each in same}) - 1
        alike = f" (and in {others} more run{'s' * (others > 1)})" if others else ""
        say(f"Found in {same[0].run}: {same[0].channel}: {same[0].text}{alike}")
    if len(groups) > SHOWN:
        say(f"Found {len(groups) - SHOWN} more: the sheet lists them.")
    page = folder / "quality.html"
    pictures = {path.stem.removeprefix("quality_") for path in folder.glob("quality_*.png")}
    fresh = pictures == set(files) and all(is_newer(page, file) for file in files.values())
    if not sheet or (fresh and not failures):
        return
    unread = {name: str(error) for name, error in failures.items()}
    try:
        write_quality_sheet(runs, read.settings, read.name, folder, unread)
    except RequestError as error:
        say(f"Note: no data-quality sheet: {error}", style="yellow")
        return
    say(f"Wrote {page}: check it before you use the runs.")


datasets = typer.Typer(
    help=("List the public data sets of the examples, or fetch one.\n\nExample: seakeep datasets"),
    invoke_without_command=True,
    rich_markup_mode=None,
)


@datasets.callback()
def _list(context: typer.Context) -> None:
    if context.invoked_subcommand:
        return
    from rich import box
    from rich.table import Table

    from seakeep.campaign.datasets import DATASETS, data_folder, state_of

    folder = data_folder()
    table = Table(box=box.SIMPLE_HEAD, show_header=False)
    table.add_column("key", style="bold")
    table.add_column("value", overflow="fold")
    for each in DATASETS:
        table.add_row("name", each.name, style="bold")
        facts = {"what": each.title, "origin": each.origin, "licence": each.licence}
        facts |= {"cite": each.reference, "here": state_of(each, folder), "note": each.note}
        listed = (f"{name}  {checksum}" for name, checksum in each.files.items())
        facts["files"] = "\n".join(["with their SHA-256", *listed])
        for key, value in facts.items():
            if value:
                table.add_row(key, value)
        table.add_section()
    results().print(table)


@datasets.command("fetch")
def _fetch(
    name: Annotated[str, Argument(help="Name of the data set.")],
    to: Annotated[Path | None, Option(help="Data folder; by default SEAKEEP_DATA_DIR.")] = None,
) -> None:
    """Fetch a data set from its origin and check it; the one command that uses the network.

    Example: seakeep datasets fetch ntnu_ship_section --to data
    """
    from seakeep.campaign.datasets import data_folder, fetch, find_dataset

    dataset = find_dataset(name)
    folder = to or data_folder()
    if not folder:
        raise RequestError(
            "no data folder is known. Give --to DIR, or set the environment variable "
            "SEAKEEP_DATA_DIR."
        )
    with progress_bar("Fetching") as progress:
        place = fetch(dataset, folder, progress)
    typer.echo(str(place))
    say(f"Set SEAKEEP_DATA_DIR={folder.resolve()} so that the examples find it.")
