"""Surge, heave and pitch from a video of a white panel on the vessel.

Source: the paper's section "Motion measurements". In each frame thresholds in RGB, opening, closing
and hole filling find the panel, the largest component, with its centroid and orientation; then
comes a low-pass filter. Every frame carries a quality figure and a flag; a frame that is flagged
gives no motion, and a gap is bridged only when asked. Needs OpenCV, the extra ``video``.

Places in a frame are in pixels to the right and downwards from the centre of the upper left pixel.

Motions: x downstream, z up, pitch positive bow up, the bow pointing upstream. With downstream to
the right of the picture the camera looks along +y and sees the vessel's port side; with
downstream to the left it stands on the other side of the tank.
"""

import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.arrays import BoolArray, FloatArray, IntArray, Progress, positive
from seakeep.errors import DataError, RequestError, needing, warn
from seakeep.files import reading
from seakeep.signals.filters import low_pass
from seakeep.signals.time_axis import stretches
from seakeep.toml import packaged

Image = npt.NDArray[np.uint8]
Weights = npt.NDArray[np.float32]

SATURATED = 250
"""A pixel is saturated where red, green and blue are all at least this."""
SMALLEST = 20
"""A component of fewer pixels has no orientation worth a name."""
OPENING, CLOSING = 5, 9
"""Sides of the squares of opening and closing, pixels."""
MARGIN = 8
"""Pixels around a component in which its background is looked at."""
EDGE, CLEAR = 5, 11
"""Sides of the squares by which a component grows to take in its edge, and to leave it behind."""
CORNERS = ("left_top", "left_bottom", "right_top", "right_bottom")
"""Fields that say how much of each corner is seen."""
SIDES = ("panel_length", "panel_height")
PANEL = ("centroid_x", "centroid_y", "panel_angle", *SIDES, "panel_area", "panel_fill")
"""Measurements of the panel: centroid, pixels; orientation of the long axis, rad in (−π/2, π/2],
positive clockwise as seen; sides of the rectangle of the same second moments; pixels, holes
included; area by that of the smallest rectangle around it."""
FIELDS = (*PANEL, "cut", "saturation", "brightness", *CORNERS, "picture", "lamp")
"""Measurements of a frame: further, one where the panel touches the border of the region; saturated
pixels; mean of the colours; part seen of squares of half the rectangle's height at its corners."""


@dataclass(frozen=True)
class TrackingSettings:
    """How a video is tracked.

    Parameters
    ----------
    metres_per_pixel : float or None
        Calibration, m; None takes it from the panel's size as seen.
    panel : (float, float)
        Length and height of the panel, m.
    panel_place : (float, float)
        The panel's centre from the centre of gravity: downstream and up, m. The motions are
        those of the centre of gravity.
    downstream : {"right", "left"}
        Side of the picture to which the waves run.
    camera_pitch : float
        Pitch that the picture shows of a vessel that is level, rad: the camera's own roll.
    origin : (float, float) or None
        Pixel of the panel's centre while the vessel is at rest; None makes the means of surge
        and heave over the first `rest` seconds zero.
    rest : float
        s, where `origin` is None.
    lower : (int, int, int)
        Smallest red, green and blue of the panel, 0 to 255.
    region : (int, int, int, int) or None
        Part of the picture that is searched: left, top, width, height in pixels.
    lamp : (float, float, float) or None
        Place and radius of a lamp that shows the trigger: x, y, radius in pixels.
    tolerance : float
        Part of the panel's length by which the sides seen may differ from their medians over the
        run before a frame is flagged. Raise it for a lens that distorts.
    max_speed : float
        The panel's greatest speed, m/s; further from its neighbours a frame is flagged.
    bridge : float
        Gaps up to this length (s) are bridged by monotone cubics; the default bridges none.
    passband : float or None
        Edge of the low-pass filter, Hz, which stops at 1.5 times that; None filters nothing.
    """

    metres_per_pixel: float | None = None
    panel: tuple[float, float] = (0.30, 0.10)
    panel_place: tuple[float, float] = (0.0, 0.25)
    downstream: Literal["right", "left"] = "right"
    camera_pitch: float = 0.0
    origin: tuple[float, float] | None = None
    rest: float = 1.0
    lower: tuple[int, int, int] = (150, 150, 150)
    region: tuple[int, int, int, int] | None = None
    lamp: tuple[float, float, float] | None = None
    tolerance: float = 0.02
    max_speed: float = 3.0
    bridge: float = 0.0
    passband: float | None = 4.0

    def __post_init__(self) -> None:
        units = {"metres_per_pixel": "m", "tolerance": "a part", "max_speed": "m/s",
                 "passband": "Hz"}  # fmt: skip
        for name, unit in units.items():
            if getattr(self, name) is not None:
                positive(getattr(self, name), name, unit)
        if not self.panel[0] > 1.2 * self.panel[1] > 0:
            raise RequestError(
                "panel is (length, height) in metres, the length at least 1.2 times the height, or "
                f"its orientation means nothing; received {self.panel}."
            )
        if self.downstream not in ("right", "left"):
            raise RequestError(
                f"downstream is 'right' or 'left' in the picture; received {self.downstream!r}."
            )

    @property
    def stop(self) -> float | None:
        """Edge of the stop band in use, Hz; None where nothing is filtered."""
        return self.passband and 1.5 * self.passband


def opencv(doing: str = "reading") -> Any:
    """Return OpenCV's module with a quiet decoder.

    Raises
    ------
    RequestError
        If it is not installed; `doing` says what it is needed for.
    """
    # What FFmpeg prints about a damaged file, our own message says in a sentence.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
    with needing(f"{doing} a video", "video"):
        import cv2
    return cv2


def find_panel(frame: Image, how: TrackingSettings) -> dict[str, float]:
    """Find the largest component of the panel's colour in a frame (blue, green, red)."""
    cv2 = opencv()
    left, top, width, height = how.region or (0, 0, frame.shape[1], frame.shape[0])
    part = frame[top : top + height, left : left + width]
    panel = {
        "panel_area": 0.0,
        "cut": 0.0,
        "saturation": cv2.countNonZero(cv2.inRange(part, (SATURATED,) * 3, (255,) * 3)),
        "brightness": np.mean(cv2.mean(part)[:3]),
    }
    mask = cv2.inRange(part, how.lower[::-1], (255,) * 3)
    for side, step in ((OPENING, cv2.MORPH_OPEN), (CLOSING, cv2.MORPH_CLOSE)):
        mask = cv2.morphologyEx(mask, step, np.ones((side, side), np.uint8))
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return panel
    # A contour without what lies inside it is a component with its holes filled.
    outline = max(contours, key=cv2.contourArea)
    x, y, wide, high = cv2.boundingRect(outline)
    x0, y0 = max(0, x - MARGIN), max(0, y - MARGIN)
    patch = part[y0 : y + high + MARGIN, x0 : x + wide + MARGIN]
    filled = np.zeros(patch.shape[:2], np.uint8)
    cv2.drawContours(filled, [outline], -1, 255, cv2.FILLED, offset=(-x0, -y0))
    area = cv2.countNonZero(filled)
    if area < SMALLEST:
        return panel
    weights = _weights(patch, filled)
    moments = cv2.moments(weights)
    mass = moments["m00"]
    centre = moments["m10"] / mass, moments["m01"] / mass
    xx, xy, yy = (moments[name] / mass for name in ("mu20", "mu11", "mu02"))
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    long_side, short_side = (np.sqrt(12 * (mean + sign * half)) for sign in (1, -1))
    _, sides, _ = cv2.minAreaRect(outline)  # runs through the centres of the outermost pixels
    return panel | {
        "centroid_x": left + x0 + centre[0],
        "centroid_y": top + y0 + centre[1],
        "panel_angle": angle,
        "panel_length": long_side,
        "panel_height": short_side,
        "panel_area": area,
        "panel_fill": area / ((sides[0] + 1.0) * (sides[1] + 1.0)),
        "cut": min(x, y) == 0 or x + wide == mask.shape[1] or y + high == mask.shape[0],
        **_corners(weights, centre, angle, long_side, short_side),
    }


def _corners(
    seen: Weights, centre: tuple[float, float], angle: float, length: float, height: float
) -> dict[str, float]:
    """Part seen of the corners of a rectangle."""
    rows, columns = np.indices(seen.shape, dtype=np.float32)
    x, y = columns - centre[0], rows - centre[1]
    along, down = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    side = 0.5 * height
    out = []
    for end in (-1.0, 1.0):
        # Pixels that a border divides count in part, or the sum would depend on the grid.
        near = np.clip(end * along - (0.5 * length - side) + 0.5, 0.0, 1.0)
        for half in (-1.0, 1.0):
            out.append(np.sum(near * np.clip(half * down + 0.5, 0.0, 1.0) * seen) / side**2)
    return dict(zip(CORNERS, out, strict=True))


def _weights(patch: Image, filled: Image) -> Weights:
    """Part of each pixel that the component covers, from its brightness if it has an inside.

    A binary mask shows an edge that runs nearly along the rows as one step or none, which turns a
    panel of 120 × 40 pixels by up to 0.7 degrees; the brightness of the edge's pixels says where
    it runs.
    """
    cv2 = opencv()
    edge, clear = np.ones((EDGE, EDGE), np.uint8), np.ones((CLEAR, CLEAR), np.uint8)
    inside = cv2.erode(filled, edge, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    near = cv2.dilate(filled, edge) > 0
    outside = cv2.dilate(filled, clear) == 0
    grey = cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY).astype(np.float32)
    if inside.any() and outside.any():
        bright, dark = np.median(grey[inside]), np.median(grey[outside])
        if bright > dark:
            part = np.clip((grey - dark) / (bright - dark), 0.0, 1.0)
            return np.where(inside, 1.0, np.where(near, part, 0.0)).astype(np.float32)
    return (filled > 0).astype(np.float32)


Seen = dict[str, FloatArray]
"""Fields of all frames."""
_TRACK = packaged("signals/track.toml")
FLAGS = _TRACK["flags"]
"""Flags of a frame."""
LABELS = _TRACK["channels"]
"""Unit and long name of each channel of a track."""

FRAMES = 12
"""Frames of a contact sheet, three in a row, of which a third are the worst."""
REPORT_EVERY = 150
"""Frames between two reports of progress."""
SLOWEST, FASTEST = 0.1, 2000.0
"""Frames per second that a header may state and be believed."""
ASPECT_BAND = 0.15
"""Part by which the aspect of what is taken for the panel may differ from the panel's."""
SIZE_BAND = 0.10
"""Part by which its length may differ from what a stated calibration makes it."""
LEAST_FILL = 0.85
"""Least fill of what is taken for the panel; a turned rectangle of pixels has about 0.97."""
FILL_DROP = 0.05
"""Fill below the run's median that is flagged."""
CORNER_DROP = 0.01
"""Part of a corner's square below the run's median that is flagged: a hidden corner that large
turns a panel three times as long as high by 0.2 degrees, the accuracy asked of the pitch."""
CORNER_NOISE = 6.0
"""Robust standard deviations of the corners seen that are never flagged, for panels of few pixels;
Gaussian noise reaches 4.3 in one of 100 000 frames."""
GLARE, FLOOD, BRIGHTER = 0.25, 0.10, 1.3
"""Overexposure: saturated pixels above the run's median, in panel areas, where the shape is off or
the picture is brighter than its median by the last factor; and as part of the picture whatever the
shape."""
NEIGHBOURS = 15
"""Frames over whose median a jump is measured."""
FLAGGED_QUALITY = 0.49
"""Greatest quality of a flagged frame."""


@dataclass(frozen=True, eq=False)
class Track:
    """A track, frame by frame.

    Parameters
    ----------
    time : ndarray, shape (frame,)
        s from the first frame.
    channels : mapping of str to ndarray, shape (frame,)
        ``surge``, ``heave`` (m) and ``pitch`` (rad) of the centre of gravity, filtered, NaN where
        the frame was flagged and not bridged; ``quality`` (1 like the others, below 0.5 flagged, 0
        lost); ``flag`` (see :data:`FLAGS`); ``bridged`` (0 or 1); ``lamp`` (0 to 1) where asked;
        ``picture``, the count of the frame in the file; and what was measured, unfiltered, of each
        frame: ``centroid_x``, ``centroid_y``, ``panel_length``, ``panel_height`` (pixel),
        ``panel_angle`` (rad, positive clockwise as seen), ``panel_area`` (pixel²), ``panel_fill``
        and ``saturation`` (saturated fraction of the picture).
    attributes : mapping of str to object
        Calibration and settings.
    """

    time: FloatArray
    channels: Mapping[str, npt.NDArray[Any]]
    attributes: Mapping[str, Any]

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        """Channel of a name."""
        return self.channels[name]


@dataclass
class _Video:
    """An open video; `announced` is the number of frames its header states, or 0."""

    path: Path
    rate: float
    announced: int
    size: tuple[int, int]
    capture: Any

    def frames(self) -> Iterator[tuple[int, Image]]:
        """Yield the frames with their numbers, which skip a step where the time stamps do."""
        import cv2

        first, previous, count = 0.0, -1, 0
        while (read := self.capture.read())[0]:
            stamp = 1e-3 * self.capture.get(cv2.CAP_PROP_POS_MSEC)
            first = stamp if count == 0 else first
            number = round((stamp - first) * self.rate)
            if count and stamp <= first:
                number = previous + 1  # a container without time stamps
            if number <= previous:
                raise DataError(
                    f"{self.path}: frames {count - 1} and {count} are less than half a step of "
                    f"{1 / self.rate:.4g} s apart, so the frame rate varies. Encode the video "
                    "again with a constant rate."
                )
            yield number, read[1]
            previous, count = number, count + 1
        if count == 0:
            raise DataError(f"{self.path} holds no frame that can be decoded. Export it again.")
        # Headers of some containers are off by a frame or two.
        if self.announced - count > max(2, 0.01 * self.announced):
            warn(
                f"{self.path} announces {self.announced} frames and ends after {count}: it was cut "
                "off or is damaged. What is there was used; copy the file again."
            )


@contextmanager
def _open_video(path: Path | str) -> Iterator[_Video]:
    """Open a video that OpenCV reads, such as MP4, AVI or MOV."""
    cv2 = opencv()
    with reading(path) as path:
        if path.stat().st_size == 0:
            raise DataError(f"{path} is empty (0 bytes). Copy the video again.")
    capture = cv2.VideoCapture(str(path))
    try:
        if not capture.isOpened():
            raise DataError(
                f"{path} cannot be opened as a video: it holds no frames, was cut off (an MP4 file "
                "has its table of frames at the end), or is a file of another kind. Copy or export "
                "it again."
            )
        rate = capture.get(cv2.CAP_PROP_FPS)
        if not SLOWEST <= rate <= FASTEST:
            raise DataError(
                f"{path} states {rate:g} frames per second, which is impossible. Encode it again "
                "with its true, constant rate."
            )
        width, height, announced = (
            int(capture.get(getattr(cv2, f"CAP_PROP_FRAME_{each}")))
            for each in ("WIDTH", "HEIGHT", "COUNT")
        )
        yield _Video(path, rate, max(announced, 0), (width, height), capture)
    finally:
        capture.release()


def track_video(
    path: Path | str,
    settings: TrackingSettings | None = None,
    progress: Progress | None = None,
) -> Track:
    """Track the white panel of a video.

    Parameters
    ----------
    path : path
        The video.
    settings : TrackingSettings, optional
        How; the default suits the virtual tank's side view.
    progress : callable, optional
        Called with the frames done, the frames announced (0 if unknown), and words.

    Returns
    -------
    Track

    Raises
    ------
    RequestError
        If OpenCV is not installed, the file does not exist, or settings do not fit the video.
    DataError
        If the file is empty, cut off, no video or of varying rate, or the panel is not in it.

    Examples
    --------
    >>> tracked = track_video("side_view.mp4")  # doctest: +SKIP
    """
    how = settings or TrackingSettings()
    with _open_video(path) as video:
        _check_fit(video, how)
        seen = _measure(video, how, progress)
        size, rate = video.size, video.rate
    count = seen["panel_area"].size
    if count < 2:
        raise DataError(f"{path} holds one frame; a motion needs at least two. Export it again.")
    usual = _usual_panel(seen, how, str(path))
    pixels = int(np.prod(how.region[2:] if how.region else size))
    flag, quality = _judge(seen, usual, how, 1.0 / rate, pixels)
    counts = {name: np.sum(flag == code) for name, code in FLAGS.items()}
    bad = count - counts["good"]
    if 2 * bad > count:
        words = ", ".join(f"{number} {name}" for name, number in counts.items() if number)
        warn(
            f"{path}: {bad} of {count} frames are flagged ({words}). Look at the contact "
            "sheet; correct the thresholds, state a region, or raise tolerance for a lens that "
            "distorts."
        )
    motion, bridged = _motions(seen, flag == FLAGS["good"], usual, how, rate, str(path))
    channels: dict[str, npt.NDArray[Any]] = {
        **motion,
        **{name: seen[name] for name in PANEL},
        "saturation": seen["saturation"] / pixels,
        "quality": quality,
        "bridged": bridged.astype(np.int8),
        "picture": np.nan_to_num(seen["picture"], nan=-1.0).astype(int),
        "flag": flag.astype(np.int8),
    }
    if how.lamp:
        channels["lamp"] = seen["lamp"]
    attributes = {
        "source": Path(path).name,
        "frame": "x downstream, z up, pitch positive bow up; motions of the centre of gravity",
        "camera": f"downstream to the {how.downstream} of the picture",
        "frame_rate": rate,
        "metres_per_pixel": usual["scale"],
        "calibration": "stated" if how.metres_per_pixel else "size of the panel",
        **{f"{side}_seen": usual[side] for side in SIDES},
        "settings": json.dumps(asdict(how)),
    }
    return Track(np.arange(count) / rate, channels, attributes)


def _check_fit(video: _Video, how: TrackingSettings) -> None:
    width, height = video.size
    if how.region:
        left, top, wide, high = how.region if len(how.region) == 4 else (0, 0, 0, 0)
        if min(left, top) < 0 or not (0 < wide <= width - left and 0 < high <= height - top):
            raise RequestError(
                f"region = {how.region} is no part of the picture of {video.path}, {width} × "
                f"{height} pixels. State left, top, width and height of one."
            )
    if how.lamp:
        x, y, radius = how.lamp
        if not (0 <= x < width and 0 <= y < height and radius > 0):
            raise RequestError(
                f"the lamp {how.lamp} (x, y, radius) lies outside the picture of {video.path}, "
                f"{width} × {height} pixels. Correct its place."
            )
    if (stop := how.stop) and stop >= 0.5 * video.rate:
        raise RequestError(
            f"{video.path} has {video.rate:g} frames per second, so the low-pass filter cannot "
            f"stop at {stop:g} Hz. Lower the passband (--passband) so that the stopband, 1.5 times "
            f"as high, lies below {0.5 * video.rate:g} Hz, or filter nothing "
            "(passband None; --passband 0)."
        )


def _measure(video: _Video, how: TrackingSettings, progress: Progress | None) -> Seen:
    """What was seen of the panel and of the lamp in each frame; NaN of one that was dropped."""
    numbers: list[int] = []
    rows: list[list[float]] = []
    at_rest = not how.origin
    if how.lamp:
        x, y, radius = how.lamp
        below, right = np.ogrid[: video.size[1], : video.size[0]]
        disc = np.nonzero((right - x) ** 2 + (below - y) ** 2 <= radius**2)

    def seen() -> Seen:
        table = np.full((numbers[-1] + 1, len(FIELDS)), np.nan)
        table[numbers] = rows
        return dict(zip(FIELDS, table.T, strict=True))

    for number, frame in video.frames():
        if at_rest and rows and number >= how.rest * video.rate:
            at_rest = False  # refuse after the first frames what would be refused after the last
            where = f"first {how.rest:g} s (unless the origin is stated, zero lies there)"
            _usual_panel(seen(), how, f"{video.path}, {where}")
        row = find_panel(frame, how) | {"picture": len(rows)}
        if how.lamp:
            row["lamp"] = float(np.mean(frame[disc])) / 255.0
        numbers.append(number)
        rows.append([row.get(field, np.nan) for field in FIELDS])
        if progress and len(rows) % REPORT_EVERY == 0:
            progress(len(rows), max(video.announced, len(rows)), "frames")
    if progress:
        progress(len(rows), len(rows), "frames")
    return seen()


def _usual_panel(seen: Seen, how: TrackingSettings, name: str) -> dict[str, float]:
    """Medians over the frames in which the largest component looks like the panel.

    Of the fields of a frame; `scale` is m per pixel, `corner_noise` the robust standard deviation
    of the corner seen least.
    """
    panel, known = how.panel, how.metres_per_pixel
    length, height = (seen[side] for side in SIDES)
    aspect = (length / height) / (panel[0] / panel[1])
    like = (abs(aspect - 1) < ASPECT_BAND) & (seen["panel_fill"] > LEAST_FILL) & (seen["cut"] == 0)
    if known:
        like &= abs(length / (panel[0] / known) - 1) < SIZE_BAND
    if not like.any():
        there, wanted = seen["panel_area"] > 0, f"{panel[0]:g} × {panel[1]:g} m"
        if known:
            wanted += f", {panel[0] / known:.0f} × {panel[1] / known:.0f} pixels"
        why = (
            "nothing is as bright as the thresholds ask. Reduce the least red, green and blue "
            "(lower; --threshold), or correct the region."
        )
        if there.any():
            why = (
                "the largest bright component measures "
                f"{np.median(length[there]):.0f} × {np.median(height[there]):.0f} pixels "
                f"(median of {there.sum()} frames), which is not its shape. Raise the least red, "
                "green and blue (lower; --threshold), state a region that holds no other bright "
                "thing, or correct the panel's size."
            )
        raise DataError(
            f"{name}: the panel ({wanted}) was not found in any of {there.size} frames: {why}"
        )
    usual = {field: float(np.median(values[like])) for field, values in seen.items()}
    lowest = np.min([seen[corner][like] - usual[corner] for corner in CORNERS], axis=0)
    usual["corner_noise"] = 1.4826 * np.median(abs(lowest - np.median(lowest)))
    square = panel[0] * panel[1] / (usual["panel_length"] * usual["panel_height"])
    usual["scale"] = known or np.sqrt(square)
    return usual


def _judge(
    seen: Seen, usual: Mapping[str, float], how: TrackingSettings, step: float, pixels: int
) -> tuple[IntArray, FloatArray]:
    """Flag frames that cannot be trusted, and give each a quality figure.

    Quality is one less half the largest deviation in units of what is allowed: at 0.5 and above
    the shape is good; 0 where there is nothing to see. A flagged frame has less than 0.5.
    """
    length, height = (usual[side] for side in SIDES)
    tolerance, panel_area = how.tolerance * length, length * height
    less = {field: usual[field] - values for field, values in seen.items()}
    drop = max(CORNER_DROP, CORNER_NOISE * usual["corner_noise"])
    hidden = np.max([less[corner] for corner in CORNERS], axis=0) / drop
    sides = (abs(less[side]) / tolerance for side in SIDES)
    shape = np.max([hidden, *sides, less["panel_fill"] / FILL_DROP], axis=0)
    shape[np.isnan(shape)] = np.inf
    cut, area, excess = seen["cut"] > 0, seen["panel_area"], np.nan_to_num(-less["saturation"])
    off, glare = (shape > 1) | cut, excess > GLARE * panel_area
    brighter = seen["brightness"] > BRIGHTER * usual["brightness"]
    kinds = {
        "dropped": np.isnan(area),
        "lost": (area == 0) & ~glare,
        "overexposed": (excess > FLOOD * pixels) | ((off | brighter) & glare),
        "occluded": off & ((area < panel_area) | ~(hidden <= 1) | cut),
        "misshapen": off,
    }
    flag = np.select(list(kinds.values()), [FLAGS[kind] for kind in kinds], FLAGS["good"])
    # From the middle of the neighbours to either end; twice that where some of them are flagged.
    reach = how.max_speed * step * NEIGHBOURS / usual["scale"] + tolerance
    at = np.flatnonzero(flag == FLAGS["good"])
    if at.size >= NEIGHBOURS:
        place = np.stack([seen["centroid_x"][at], seen["centroid_y"][at]])
        middle = scipy.ndimage.median_filter(place, (1, NEIGHBOURS), mode="nearest")
        flag[at[np.hypot(*(place - middle)) > reach]] = FLAGS["jump"]
    quality = np.clip(1.0 - 0.5 * shape, 0.0, 1.0)
    return flag, np.minimum(quality, np.where(flag == FLAGS["good"], 1.0, FLAGGED_QUALITY))


def _motions(
    seen: Seen,
    good: BoolArray,
    usual: Mapping[str, float],
    how: TrackingSettings,
    rate: float,
    name: str,
) -> tuple[dict[str, FloatArray], BoolArray]:
    """Surge, heave and pitch of the centre of gravity, filtered, and what was bridged."""
    side = 1.0 if how.downstream == "right" else -1.0
    pitch = side * seen["panel_angle"] - how.camera_pitch
    (along, up), scale = how.panel_place, usual["scale"]
    # Where the panel's centre would be if the vessel had turned about its centre of gravity alone.
    x = side * scale * seen["centroid_x"] - along * np.cos(pitch) - up * np.sin(pitch)
    z = -scale * seen["centroid_y"] + along * np.sin(pitch) - up * np.cos(pitch)
    table = np.stack([x, z, pitch], axis=1)
    if how.origin:
        table[:, :2] -= side * scale * how.origin[0] - along, -scale * how.origin[1] - up
    else:
        rest = good & (np.arange(good.size) < max(1, round(how.rest * rate)))
        if not rest.any():
            raise DataError(
                f"{name}: no good frame among the first {how.rest:g} s, over which surge and heave "
                "would be made zero. State the origin, or a longer rest."
            )
        table[:, :2] -= table[rest, :2].mean(axis=0)
    table[~good] = np.nan
    filled = np.zeros(good.size, bool)
    for begin, end in stretches(~good):
        inner = begin > 0 and end < good.size
        filled[begin:end] = inner and end - begin <= how.bridge * rate + 1e-9
    if filled.any():
        there = np.flatnonzero(good)
        between = scipy.interpolate.PchipInterpolator(there, table[there])
        table[filled] = between(np.flatnonzero(filled))
    if how.passband:
        for begin, end in stretches(good | filled):
            if end - begin > 1:
                table[begin:end] = low_pass(table[begin:end], 1.0 / rate, how.passband, how.stop)
    return dict(zip(("surge", "heave", "pitch"), table.T, strict=True)), filled


def contact_sheet(path: Path | str, track: Track) -> bytes:
    """Frames of a video with the tracked panel outlined, the worst ones among them, as PNG.

    Parameters
    ----------
    path : path
        The video.
    track : Track
        From :func:`track_video`.

    Returns
    -------
    bytes
        The picture: green frames count, red ones are flagged.

    Raises
    ------
    DataError
        If the video is not the one that was tracked.
    """
    cv2 = opencv()
    there = np.flatnonzero(track["picture"] >= 0)
    worst = there[np.argsort(track["quality"][there], kind="stable")][: FRAMES // 3]
    rest = np.setdiff1d(there, worst)
    spread = rest[np.linspace(0, rest.size - 1, min(FRAMES - worst.size, rest.size)).astype(int)]
    tiles = []
    with _open_video(path) as video:
        for index in np.union1d(worst, spread):
            here = {name: float(values[index]) for name, values in track.channels.items()}
            video.capture.set(cv2.CAP_PROP_POS_FRAMES, here["picture"])
            read, frame = video.capture.read()
            if not read:
                raise DataError(
                    f"{path} has no frame {here['picture']:.0f}: it is not the video that "
                    "was tracked, or was changed since. Track it again."
                )
            name = next(key for key, code in FLAGS.items() if code == here["flag"])
            colour = (60, 200, 60) if name == "good" else (40, 40, 240)
            if np.isfinite(here["centroid_x"]):
                box = cv2.boxPoints((
                    (here["centroid_x"], here["centroid_y"]),
                    (here["panel_length"], here["panel_height"]),
                    np.rad2deg(here["panel_angle"]),
                ))  # fmt: skip
                cv2.polylines(frame, [np.round(box).astype(np.int32)], True, colour, 2, cv2.LINE_AA)
            small = cv2.resize(frame, (480, round(480 * frame.shape[0] / frame.shape[1])))
            text = f"{track.time[index]:.2f} s  {name}  quality {here['quality']:.2f}"
            cv2.putText(small, text, (6, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, 1, cv2.LINE_AA)
            cv2.rectangle(small, (0, 0), (small.shape[1] - 1, small.shape[0] - 1), colour, 3)
            tiles.append(small)
    tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % 3)
    rows = [np.hstack(tiles[i : i + 3]) for i in range(0, len(tiles), 3)]
    return bytes(cv2.imencode(".png", np.vstack(rows))[1])
