"""The white panel in one frame: segmentation, place, orientation and shape.

Source: the paper's section "Motion measurements". Places are in pixels to the right and downwards
from the centre of the upper left pixel. Needs OpenCV, the extra ``video``.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np
import numpy.typing as npt

from seakeep.signals.frames import opencv

__all__ = ["CORNERS", "Segmentation", "Sighting", "binary_mask", "find_panel"]

Image = npt.NDArray[np.uint8]

SATURATED = 250
"""A pixel is saturated where red, green and blue are all at least this."""
SMALLEST = 20
"""A component of fewer pixels has no orientation worth a name."""
MARGIN = 8
"""Pixels around a component in which its background is looked at."""
EDGE, CLEAR = 5, 11
"""Sides of the squares by which a component grows to take in its edge, and to leave it behind."""
CORNERS = ("left_top", "left_bottom", "right_top", "right_bottom")
"""Fields of a :class:`Sighting` that say how much of each corner is seen."""


@dataclass(frozen=True)
class Segmentation:
    """How the panel's pixels are told from the others.

    Parameters
    ----------
    lower, upper : (int, int, int)
        Least and greatest red, green and blue (0 to 255) of the panel.
    opening, closing : int
        Side of the square, in pixels, of the morphological opening (removes specks) and closing
        (joins what a thin line divides); 0 leaves the step out.
    region : (int, int, int, int) or None
        Part of the picture that is searched: left, top, width, height in pixels.
    refine : bool
        Whether pixels at the edge count by their brightness, from the background's to the
        panel's, instead of wholly or not at all.
    """

    lower: tuple[int, int, int]
    upper: tuple[int, int, int]
    opening: int
    closing: int
    region: tuple[int, int, int, int] | None
    refine: bool


@dataclass(frozen=True)
class Sighting:
    """The largest component of a frame; NaN where there is none.

    Parameters
    ----------
    x, y : float
        Its centroid, pixels.
    angle : float
        Orientation of its long axis, rad in (−π/2, π/2], positive clockwise as seen (the right
        end lower), from its second moments.
    length, height : float
        Sides of the rectangle of the same second moments, pixels.
    area : float
        Pixels, holes included.
    fill : float
        Its area by that of the smallest rectangle around it: one for a rectangle.
    cut : float
        One where it touches the border of the region, else zero.
    saturation : float
        Saturated pixels in the region.
    brightness : float
        Mean of the region's colours, 0 to 255.
    left_top, left_bottom, right_top, right_bottom : float
        Part seen of each end's halves: squares of half the rectangle's height at its corners.
    """

    x: float = np.nan
    y: float = np.nan
    angle: float = np.nan
    length: float = np.nan
    height: float = np.nan
    area: float = 0.0
    fill: float = np.nan
    cut: float = 0.0
    saturation: float = 0.0
    brightness: float = 0.0
    left_top: float = np.nan
    left_bottom: float = np.nan
    right_top: float = np.nan
    right_bottom: float = np.nan

    def row(self) -> tuple[float, ...]:
        """Return the numbers in the order of the fields."""
        values: tuple[float, ...] = astuple(self)
        return values


def binary_mask(frame: Image, how: Segmentation) -> Image:
    """Pixels of the panel's colour after opening and closing, inside the region.

    Parameters
    ----------
    frame : ndarray of uint8, shape (row, column, 3)
        Blue, green, red.
    how : Segmentation
        Thresholds and steps.

    Returns
    -------
    ndarray of uint8, shape (row, column)
        0 or 255; of the region's shape.
    """
    cv2 = opencv()
    part = _part(frame, how)
    mask = cv2.inRange(part, how.lower[::-1], how.upper[::-1])
    for side, step in ((how.opening, cv2.MORPH_OPEN), (how.closing, cv2.MORPH_CLOSE)):
        if side > 1:
            mask = cv2.morphologyEx(mask, step, np.ones((side, side), np.uint8))
    return np.asarray(mask, dtype=np.uint8)


def _part(frame: Image, how: Segmentation) -> Image:
    if how.region is None:
        return frame
    left, top, width, height = how.region
    return frame[top : top + height, left : left + width]


def find_panel(frame: Image, how: Segmentation) -> Sighting:
    """Find the largest component of the panel's colour, its holes filled.

    Parameters
    ----------
    frame : ndarray of uint8, shape (row, column, 3)
        Blue, green, red.
    how : Segmentation
        Thresholds and steps.

    Returns
    -------
    Sighting
    """
    cv2 = opencv()
    part = _part(frame, how)
    saturation = float(cv2.countNonZero(cv2.inRange(part, (SATURATED,) * 3, (255,) * 3)))
    brightness = float(np.mean(cv2.mean(part)[:3]))
    nothing = Sighting(saturation=saturation, brightness=brightness)
    mask = binary_mask(frame, how)
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not contours:
        return nothing
    # A contour without what lies inside it is a component with its holes filled.
    outline = max(contours, key=cv2.contourArea)
    bounds = cv2.boundingRect(outline)
    left, top = (max(0, start - MARGIN) for start in bounds[:2])
    right, bottom = bounds[0] + bounds[2] + MARGIN, bounds[1] + bounds[3] + MARGIN
    patch = part[top:bottom, left:right]
    filled = np.zeros(patch.shape[:2], np.uint8)
    cv2.drawContours(filled, [outline], -1, 255, cv2.FILLED, offset=(-left, -top))
    area = float(cv2.countNonZero(filled))
    if area < SMALLEST:
        return nothing
    weights = _weights(patch, filled) if how.refine else None
    moments = cv2.moments(filled if weights is None else weights, binaryImage=weights is None)
    mass = moments["m00"]
    angle, long_side, short_side = _axes(
        moments["mu20"] / mass, moments["mu11"] / mass, moments["mu02"] / mass
    )
    seen = (filled > 0).astype(np.float32) if weights is None else weights
    centre = moments["m10"] / mass, moments["m01"] / mass
    corners = _corners(seen, centre, angle, long_side, short_side)
    _, sides, _ = cv2.minAreaRect(outline)  # runs through the centres of the outermost pixels
    rows, columns = mask.shape
    cut = min(bounds[:2]) == 0 or bounds[0] + bounds[2] == columns or bounds[1] + bounds[3] == rows
    origin = (0, 0) if how.region is None else how.region[:2]
    return Sighting(
        x=origin[0] + left + centre[0],
        y=origin[1] + top + centre[1],
        angle=angle,
        length=long_side,
        height=short_side,
        area=area,
        fill=area / ((sides[0] + 1.0) * (sides[1] + 1.0)),
        cut=float(cut),
        saturation=saturation,
        brightness=brightness,
        **dict(zip(CORNERS, corners, strict=True)),
    )


def _corners(
    seen: npt.NDArray[np.float32],
    centre: tuple[float, float],
    angle: float,
    length: float,
    height: float,
) -> list[float]:
    """Part seen of the corners of a rectangle, in the order of :data:`CORNERS`."""
    rows, columns = np.indices(seen.shape, dtype=np.float32)
    x, y = columns - centre[0], rows - centre[1]
    along, down = x * np.cos(angle) + y * np.sin(angle), y * np.cos(angle) - x * np.sin(angle)
    side = 0.5 * height
    out = []
    for end in (-1.0, 1.0):
        # Pixels that a border divides count in part, or the sum would depend on the grid.
        near = np.clip(end * along - (0.5 * length - side) + 0.5, 0.0, 1.0)
        for half in (-1.0, 1.0):
            inside = near * np.clip(half * down + 0.5, 0.0, 1.0)
            out.append(float(np.sum(inside * seen)) / side**2)
    return out


def _weights(patch: Image, filled: Image) -> npt.NDArray[np.float32] | None:
    """Part of each pixel that the component covers, from its brightness; None if it has no inside.

    A binary mask shows an edge that runs nearly along the rows as one step or none, which turns a
    panel of 120 × 40 pixels by up to 0.7 degrees; the brightness of the edge's pixels says where
    it runs.
    """
    cv2 = opencv()
    edge, clear = np.ones((EDGE, EDGE), np.uint8), np.ones((CLEAR, CLEAR), np.uint8)
    inside = cv2.erode(filled, edge, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    near = cv2.dilate(filled, edge) > 0
    outside = cv2.dilate(filled, clear) == 0
    if not inside.any() or not outside.any():
        return None
    grey = cv2.cvtColor(patch, cv2.COLOR_BGR2GRAY).astype(np.float32)
    bright, dark = float(np.median(grey[inside])), float(np.median(grey[outside]))
    if bright <= dark:
        return None
    weights = np.clip((grey - dark) / (bright - dark), 0.0, 1.0).astype(np.float32)
    weights[inside] = 1.0
    weights[~near] = 0.0
    return np.asarray(weights, dtype=np.float32)


def _axes(xx: float, xy: float, yy: float) -> tuple[float, float, float]:
    """Angle of the long axis, and sides of the rectangle of these second central moments."""
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    mean, half = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
    return float(angle), float(np.sqrt(12 * (mean + half))), float(np.sqrt(12 * (mean - half)))
