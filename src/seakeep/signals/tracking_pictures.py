"""What was tracked, drawn on the frames: a contact sheet and an overlay video.

Needs OpenCV, the extra ``video``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.errors import DataError, RequestError
from seakeep.files import replacing
from seakeep.signals.frames import open_video, opencv
from seakeep.signals.sightings import FLAGS

__all__ = ["contact_sheet", "overlay_video", "write_picture"]

Image = npt.NDArray[np.uint8]
Progress = Callable[[int, int, str], None]

GOOD, FLAGGED, BRIDGED = (60, 200, 60), (40, 40, 240), (0, 165, 255)
"""Colours, blue, green, red: of a frame that counts, one that does not, one that was bridged."""
TILE_WIDTH = 480
"""Width of a frame on the contact sheet, pixels."""


def contact_sheet(
    path: Path | str, tracked: xr.Dataset, frames: int = 12, columns: int = 3
) -> Image:
    """Frames of a video with what was tracked, side by side.

    A third of the frames are the worst ones, of each flag in turn; the others are spread evenly.

    Parameters
    ----------
    path : path
        The video.
    tracked : Dataset
        From :func:`seakeep.signals.tracking.track_video`.
    frames : int, optional
        Number of frames.
    columns : int, optional
        Frames in a row.

    Returns
    -------
    ndarray of uint8, shape (row, column, 3)
        Blue, green, red, as OpenCV keeps pictures; :func:`write_picture` writes it.

    Raises
    ------
    RequestError
        If OpenCV is not installed, or the numbers are not positive.
    DataError
        If the video is not the one that was tracked.
    """
    if frames < 1 or columns < 1:
        raise RequestError(
            f"a contact sheet has at least one frame and one column; received {frames} and "
            f"{columns}."
        )
    cv2 = opencv()
    tiles = []
    with open_video(path) as video:
        for index in _chosen(tracked, frames):
            frame = video.frame(int(tracked["picture"][index]))
            if frame is None:
                raise DataError(
                    f"{path} has no frame {int(tracked['picture'][index])}: it is not the video "
                    "that was tracked, or was changed since. Track it again."
                )
            drawn = _drawn(cv2, frame, tracked, int(index))
            height = round(TILE_WIDTH * frame.shape[0] / frame.shape[1])
            small = cv2.resize(drawn, (TILE_WIDTH, height), interpolation=cv2.INTER_AREA)
            tiles.append(_captioned(cv2, small, tracked, int(index)))
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % columns)
    rows = [np.hstack(tiles[i : i + columns]) for i in range(0, len(tiles), columns)]
    return np.vstack(rows)


def _chosen(tracked: xr.Dataset, frames: int) -> list[int]:
    """Indices in the record: the worst of each flag in turn, then evenly spread ones."""
    flag, there = tracked["flag"].to_numpy(), tracked["picture"].to_numpy() >= 0
    quality = tracked["quality"].to_numpy()
    kinds = [
        list(at[np.argsort(quality[at], kind="stable")])
        for code in FLAGS.values()
        if code != FLAGS["good"] and (at := np.flatnonzero((flag == code) & there)).size
    ]
    worst: list[int] = []
    while any(kinds) and len(worst) < frames // 3:
        for kind in kinds:
            if kind and len(worst) < frames // 3:
                # The middle of what is left shows more than neighbours of one bad moment.
                worst.append(int(kind.pop(len(kind) // 2)))
    rest = np.setdiff1d(np.flatnonzero(there), worst)
    count = min(frames - len(worst), rest.size)
    spread = rest[np.unique(np.linspace(0, rest.size - 1, count).round().astype(int))]
    return sorted({*worst, *map(int, spread)})


def overlay_video(
    path: Path | str, tracked: xr.Dataset, out: Path, progress: Progress | None = None
) -> Path:
    """Write a video with what was tracked drawn on every frame.

    Parameters
    ----------
    path : path
        The video.
    tracked : Dataset
        From :func:`seakeep.signals.tracking.track_video`.
    out : Path
        MP4 file to write.
    progress : callable, optional
        Called with the frames done, their number, and words.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If OpenCV is not installed, cannot write MP4 files, or `out` cannot be written.
    """
    cv2 = opencv()
    if out.suffix.lower() != ".mp4":
        raise RequestError(f"an overlay is written as MP4; received {out}. Name it NAME.mp4.")
    index = {int(number): i for i, number in enumerate(tracked["picture"].to_numpy())}
    # OpenCV chooses the format by the suffix, so the video is made under a name of its own.
    with open_video(path) as video, TemporaryDirectory() as folder, replacing(out) as temporary:
        part = Path(folder) / "overlay.mp4"
        code = cv2.VideoWriter_fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(part), code, video.rate, video.size)
        if not writer.isOpened():
            raise RequestError(
                "OpenCV cannot write MP4 files here. Install a build with FFmpeg: "
                "pip install opencv-python-headless"
            )
        for count, (_, frame) in enumerate(video.frames()):
            if count not in index:
                break
            writer.write(_lettered(cv2, _drawn(cv2, frame, tracked, index[count]), tracked,
                                   index[count]))  # fmt: skip
            if progress is not None and count % 150 == 0:
                progress(count, len(index), "overlay")
        writer.release()
        temporary.write_bytes(part.read_bytes())
    return out


def write_picture(picture: Image, out: Path) -> Path:
    """Write a picture as PNG.

    Parameters
    ----------
    picture : ndarray of uint8, shape (row, column, 3)
        Blue, green, red.
    out : Path
        File to write, ``.png``.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    RequestError
        If the name is not that of a PNG file, or the file cannot be written.
    """
    cv2 = opencv()
    if out.suffix.lower() != ".png":
        raise RequestError(f"a picture is written as PNG; received {out}. Name it NAME.png.")
    _, encoded = cv2.imencode(".png", picture)
    with replacing(out) as temporary:
        temporary.write_bytes(encoded.tobytes())
    return out


def _colour(tracked: xr.Dataset, index: int) -> tuple[int, int, int]:
    if int(tracked["bridged"][index]):
        return BRIDGED
    return GOOD if int(tracked["flag"][index]) == FLAGS["good"] else FLAGGED


def _drawn(cv2: Any, frame: Image, tracked: xr.Dataset, index: int) -> Image:
    """Frame with the tracked rectangle, its centre and its long axis, and where it has been."""
    out = frame.copy()
    before = slice(max(0, index - 60), index + 1)
    seen = tracked.isel(time=before)
    good = seen["flag"].to_numpy() == FLAGS["good"]
    trail = np.stack([seen["centroid_x"], seen["centroid_y"]], axis=1)[good]
    if len(trail) > 1:
        cv2.polylines(out, [np.round(trail).astype(np.int32)], False, (255, 200, 0), 1, cv2.LINE_AA)
    here = tracked.isel(time=index)
    x, y, angle = (float(here[k]) for k in ("centroid_x", "centroid_y", "panel_angle"))
    if not np.isfinite(x):
        return out
    along = 0.5 * float(here["panel_length"]) * np.array([np.cos(angle), np.sin(angle)])
    across = 0.5 * float(here["panel_height"]) * np.array([-np.sin(angle), np.cos(angle)])
    centre, colour = np.array([x, y]), _colour(tracked, index)
    corners = np.stack([centre + a * along + b * across
                        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])  # fmt: skip
    cv2.polylines(out, [_fine(corners)], True, colour, 2, cv2.LINE_AA, shift=4)
    axis = _fine(np.stack([centre - 1.3 * along, centre + 1.3 * along]))
    cv2.polylines(out, [axis], False, colour, 1, cv2.LINE_AA, shift=4)
    cross = (round(x), round(y))
    cv2.drawMarker(out, cross, (200, 0, 200), cv2.MARKER_CROSS, 14, 2)
    return out


def _fine(points: npt.NDArray[np.float64]) -> npt.NDArray[np.int32]:
    """Points in sixteenths of a pixel."""
    return np.round(16 * points).astype(np.int32)


def _caption(tracked: xr.Dataset, index: int) -> str:
    here = tracked.isel(time=index)
    name = next(key for key, code in FLAGS.items() if code == int(here["flag"]))
    name += ", bridged" if int(here["bridged"]) else ""
    text = f"{float(here['time']):.2f} s  {name}  quality {float(here['quality']):.2f}"
    if np.isfinite(here["surge"]):
        pitch = np.rad2deg(float(here["pitch"]))
        text += (
            f"  x {float(here['surge']):+.3f}  z {float(here['heave']):+.3f} m  {pitch:+.1f} deg"
        )
    return text


def _captioned(cv2: Any, tile: Image, tracked: xr.Dataset, index: int) -> Image:
    bar = np.full((24, tile.shape[1], 3), 255, np.uint8)
    text, colour = _caption(tracked, index), _colour(tracked, index)
    cv2.putText(bar, text, (4, 17), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (0, 0, 0), 1, cv2.LINE_AA)
    framed = np.vstack([bar, tile])
    cv2.rectangle(framed, (0, 0), (framed.shape[1] - 1, framed.shape[0] - 1), colour, 3)
    return np.asarray(framed, dtype=np.uint8)


def _lettered(cv2: Any, frame: Image, tracked: xr.Dataset, index: int) -> Image:
    rows = frame.shape[0]
    text, colour = _caption(tracked, index), _colour(tracked, index)
    cv2.rectangle(frame, (0, rows - 34), (frame.shape[1], rows), (30, 30, 30), cv2.FILLED)
    at = (10, rows - 11)
    cv2.putText(frame, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.7, colour, 1, cv2.LINE_AA)
    return frame
