"""``seakeep track``: surge, heave and pitch from a video."""

from __future__ import annotations

import math
import struct
import zlib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from seakeep.cli.console import progress_bar, say
from seakeep.errors import RequestError
from seakeep.files import MARK, check_output, replacing, write_netcdf

if TYPE_CHECKING:
    import xarray as xr

    from seakeep.signals import MotionAgreement, Track

TRACK, SHEET = "track", "contact sheet"
HEADER = r"time \[s\],surge \[m\],heave \[m\],pitch \[deg\],centroid_x \[pixel\],"
DECIMALS = {"s": 6, "m": 6, "deg": 5, "pixel": 3, "pixel^2": 1, "1": 4}


def track(
    video: Annotated[Path, typer.Argument(help="Video of the vessel.", metavar="VIDEO.mp4")],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="Result, .csv or .nc; by default CSV on standard output."),
    ] = None,
    sheet: Annotated[
        Path | None,
        typer.Option("--contact-sheet", help="PNG of tracked frames, including the worst."),
    ] = None,
    metres_per_pixel: Annotated[
        float | None,
        typer.Option(help="Calibration; by default from the panel's size as seen."),
    ] = None,
    panel: Annotated[
        tuple[float, float],
        typer.Option(
            metavar="LENGTH HEIGHT",
            help="Length and height of the panel, m: two numbers separated by a space.",
        ),
    ] = (0.30, 0.10),
    panel_place: Annotated[
        tuple[float, float],
        typer.Option(
            metavar="X Z",
            help="Panel's centre from the centre of gravity, downstream and up, m: two numbers "
            "separated by a space.",
        ),
    ] = (0.0, 0.25),
    downstream: Annotated[
        Literal["right", "left"], typer.Option(help="Side of the picture to which waves run.")
    ] = "right",
    camera_pitch: Annotated[
        float, typer.Option(help="Pitch that the picture shows of a level vessel, deg.")
    ] = 0.0,
    origin: Annotated[
        tuple[float, float] | None,
        typer.Option(
            metavar="X Y",
            help="Pixel of the panel's centre at rest, two numbers separated by a space; by "
            "default from the first second.",
        ),
    ] = None,
    threshold: Annotated[
        tuple[int, int, int],
        typer.Option(
            metavar="RED GREEN BLUE",
            help="Smallest red, green and blue of the panel, each 0 to 255: three numbers "
            "separated by spaces.",
        ),
    ] = (150, 150, 150),
    region: Annotated[
        tuple[int, int, int, int] | None,
        typer.Option(
            metavar="LEFT TOP WIDTH HEIGHT",
            help="Part of the picture searched, pixels: four numbers separated by spaces.",
        ),
    ] = None,
    lamp: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="X Y RADIUS",
            help="Lamp that shows the trigger, pixels from the upper left corner: three numbers "
            "separated by spaces, such as 40 40 12.",
        ),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(help="Fraction by which the panel's length may differ.")
    ] = 0.02,
    bridge: Annotated[
        float, typer.Option(help="Bridge gaps up to this long, s; by default none.")
    ] = 0.0,
    passband: Annotated[
        float, typer.Option(help="Edge of the low-pass filter, Hz; 0 filters nothing.")
    ] = 4.0,
    mru: Annotated[
        Path | None,
        typer.Option("--mru", help="Record with heave and pitch to compare with."),
    ] = None,
    max_lag: Annotated[
        float | None,
        typer.Option(
            "--max-lag",
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
    inputs = [each for each in (video, mru) if each is not None]
    for place, kind in ((out, TRACK), (sheet, SHEET)):
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
        with replacing(sheet) as temporary:
            temporary.write_bytes(_marked(contact_sheet(video, track)))
    tracked = _labelled(track)
    if out is None:
        typer.echo(_as_csv(tracked), nl=False)
    else:
        with replacing(out) as temporary:
            if out.suffix == ".nc":
                write_netcdf(temporary, tracked.assign_attrs({MARK: TRACK}))
            else:
                temporary.write_text(_as_csv(tracked), encoding="utf-8", newline="\n")
    _summary(track, [path for path in (out, sheet) if path is not None])
    if reference is not None:
        _compare(track, reference, max_lag)


def _labelled(track: Track) -> xr.Dataset:
    import xarray as xr

    from seakeep.signals.tracking import FLAGS, LABELS

    data = {
        name: ("time", values, {"units": LABELS[name][0], "long_name": LABELS[name][1]})
        for name, values in track.channels.items()
    }
    time = ("time", track.time, {"units": "s", "long_name": "time"})
    out = xr.Dataset(data, {"time": time}, dict(track.attributes))
    out["flag"].attrs |= {"flag_values": list(FLAGS.values()), "flag_meanings": " ".join(FLAGS)}
    return out


def _marked(picture: bytes) -> bytes:
    """PNG with a comment, before its last chunk of twelve bytes, that says what it is."""
    text = b"tEXtComment\0" + f"{MARK}: {SHEET}".encode("ascii")
    chunk = struct.pack(">I", len(text) - 4) + text + struct.pack(">I", zlib.crc32(text))
    return picture[:-12] + chunk + picture[-12:]


def _as_csv(tracked: xr.Dataset) -> str:
    """Columns with units in brackets; angles in degrees, as loggers write them; NaN is empty."""
    import numpy as np
    import pandas as pd

    columns = {}
    for name, values in {"time": tracked["time"], **tracked.data_vars}.items():
        unit, numbers = str(values.attrs["units"]), values.to_numpy()
        if unit == "rad":
            unit, numbers = "deg", np.rad2deg(numbers)
        if np.issubdtype(numbers.dtype, np.floating):
            numbers = np.round(numbers, DECIMALS[unit]) + 0.0
        columns[f"{name} [{'-' if unit == '1' else unit}]"] = numbers
    text: str = pd.DataFrame(columns).to_csv(index=False, lineterminator="\n")
    return text


def _summary(track: Track, written: list[Path]) -> None:
    from seakeep.signals.tracking import FLAGS

    flagged = [
        f"{count} {name}"
        for name, code in FLAGS.items()
        if name != "good" and (count := int((track["flag"] == code).sum()))
    ]
    facts = track.attributes
    say(
        f"{track.time.size} frames at {facts['frame_rate']:g} Hz; flagged: "
        f"{', '.join(flagged) or 'none'} ({int(track['bridged'].sum())} bridged); "
        f"{1e3 * facts['metres_per_pixel']:.4g} mm per pixel ({facts['calibration']}); "
        f"{facts['camera']}."
    )
    if written:
        say("Wrote " + ", ".join(map(str, written)))


def _compare(track: Track, reference: xr.Dataset, max_lag: float | None) -> None:
    from seakeep.conventions import conversion, displayed
    from seakeep.signals import compare_motion
    from seakeep.signals.tracking import LABELS

    for name in ("heave", "pitch"):
        other, unit = reference[name], LABELS[name][0]
        factor = conversion(str(other.attrs.get("units", unit)), unit, f"'{name}'")
        time = reference["time"].to_numpy()
        found = compare_motion(track[name], track.time, factor * other.to_numpy(), time, max_lag)
        shown, unit = (1e3, "mm") if unit == "m" else displayed(unit)
        say(
            f"{name} against the MRU: correlation {found.correlation:.4f}, video late by "
            f"{found.lag:+.3f} s, RMS difference {shown * found.rms:.3g} {unit}, "
            f"{found.samples} samples"
        )
        if doubt := _doubt(found):
            say(f"Note: {name}: {doubt}", style="yellow")


def _doubt(found: MotionAgreement) -> str:
    """Why the lag may be wrong; empty if there is no reason."""
    searched = f"the lags searched (within {found.max_lag:g} s)"
    if found.at_limit:
        return f"the lag is at the end of {searched}; the true one may be longer. Raise --max-lag."
    if found.ambiguous:
        return (
            f"at {found.rival_lag:+.3f} s the correlation is {found.rival_correlation:.4f}, nearly "
            "as high: the lag is known only up to whole wave periods. Let a trigger that both "
            "recorded decide (--lamp), or take an irregular run."
        )
    if not found.enclosed:
        return (
            f"{searched} do not reach a wave period ({found.period:.3g} s) beyond this one, where "
            "the two may fit better. Raise --max-lag."
        )
    return ""
