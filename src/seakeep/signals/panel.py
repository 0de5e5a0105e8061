"""The white panel in one frame: segmentation, place, orientation and shape.

Source: the paper's section "Motion measurements": thresholds in RGB, opening, closing, hole
filling, the largest component, its centroid and orientation. Places are in pixels to the right and
downwards from the centre of the upper left pixel. Needs OpenCV, the extra ``video``.
"""

import os
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from seakeep.arrays import positive
from seakeep.errors import RequestError, needing

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
    cut = min(x, y) == 0 or x + wide == mask.shape[1] or y + high == mask.shape[0]
    return panel | {
        "centroid_x": left + x0 + centre[0],
        "centroid_y": top + y0 + centre[1],
        "panel_angle": angle,
        "panel_length": long_side,
        "panel_height": short_side,
        "panel_area": area,
        "panel_fill": area / ((sides[0] + 1.0) * (sides[1] + 1.0)),
        "cut": cut,
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
