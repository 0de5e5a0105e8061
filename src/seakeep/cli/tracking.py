"""``seakeep track``: surge, heave and pitch from a video."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Literal

import typer
from typer import Argument, Option

from seakeep.cli.console import progress_bar, say
from seakeep.errors import RequestError
from seakeep.files import check_output


def track(
    video: Annotated[Path, Argument(help="Video of the vessel.", metavar="VIDEO.mp4")],
    out: Annotated[
        Path | None,
        Option("-o", "--out", help="Result, .csv or .nc; by default CSV on standard output."),
    ] = None,
    sheet: Annotated[
        Path | None,
        Option("--contact-sheet", help="PNG of tracked frames, including the worst."),
    ] = None,
    metres_per_pixel: Annotated[
        float | None,
        Option(help="Calibration; by default from the panel's size as seen."),
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
    mru: Annotated[
        Path | None,
        Option(help="Record with heave and pitch to compare with."),
    ] = None,
    max_lag: Annotated[
        float | None,
        Option(
            help="Longest lag searched against --mru, s; by default 10, or a quarter of the "
            "record.",
        ),
    ] = None,
) -> None:
    """Track surge, heave and pitch of a vessel in a video.

    Finds a white panel on the vessel in each frame, and states the quality of each frame.
    x points downstream, z up, pitch is positive bow up. Flagged frames (occluded, overexposed,
    lost …) give no motion unless --bridge is given. Needs the extra 'video'.

    Example: seakeep track side_view.mp4 -o track.csv --contact-sheet sheet.png
    """
    if out is not None and out.suffix not in (".nc", ".csv"):
        raise RequestError(f"{out} ends in '{out.suffix}'; a track is written as .csv or .nc.")
    if sheet is not None and sheet.suffix.lower() != ".png":
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

    inputs = [each for each in (video, mru) if each is not None]
    for place, kind in ((out, TRACK), (sheet, CONTACT_SHEET)):
        if place is not None:
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
    reference = None if mru is None else read_table(mru, columns=("heave", "pitch"))
    with progress_bar("Tracking") as progress:
        track = track_video(video, settings, progress)
    if sheet is not None:
        write_contact_sheet(contact_sheet(video, track), sheet)
    if out is None:
        typer.echo(track_text(track), nl=False)
    else:
        write_track(track, out)
    say(track_words(track))
    if written := [str(path) for path in (out, sheet) if path is not None]:
        say("Wrote " + ", ".join(written))
    if reference is not None:
        for words, style in agreement_words(track, reference, max_lag):
            say(words, style=style)
