"""Judge what was seen of the panel, frame by frame: a flag and a quality figure each."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.arrays import FloatArray
from seakeep.errors import DataError
from seakeep.signals.panel import CORNERS

__all__ = ["FLAGS", "Limits", "Reference", "judge", "reference_panel"]

Flags = npt.NDArray[np.int64]

FLAGS = {
    "good": 0,
    "lost": 1,  # nothing of the panel's colour
    "occluded": 2,  # too small, a corner hidden, or cut by the border of the picture
    "overexposed": 3,  # shape off, or much more of the picture saturated than usual
    "misshapen": 4,  # too large or no rectangle, without saturation
    "jump": 5,  # further from its neighbours than the vessel can move
    "dropped": 6,  # not in the file
}
"""Flags of a frame."""

ASPECT_BAND = 0.15
"""Part by which the aspect of what is taken for the panel may differ from the panel's."""
SIZE_BAND = 0.10
"""Part by which its length may differ from what a stated calibration makes it."""
LEAST_FILL = 0.85
"""Least fill of what is taken for the panel; a turned rectangle of pixels has about 0.97."""
FILL_DROP = 0.05
"""Fill below the run's median that is flagged."""
CORNER_DROP, BINARY_CORNER_DROP = 0.01, 0.035
"""Part of a corner's square below the run's median that is flagged: a hidden corner that large
turns a panel three times as long as high by 0.2 degrees, the accuracy asked of the pitch; and by
0.7 degrees, by which the steps of a binary mask turn a sound one."""
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


@dataclass(frozen=True)
class Limits:
    """What is allowed of a frame.

    Parameters
    ----------
    tolerance : float
        Part of the panel's length by which its sides may differ from the reference.
    max_speed : float
        Its greatest speed, m/s.
    step : float
        Time between frames, s.
    pixels : int
        Pixels of the picture, or of the region.
    binary : bool
        Whether the panel was measured on a binary mask.
    """

    tolerance: float
    max_speed: float
    step: float
    pixels: int
    binary: bool = False


@dataclass(frozen=True)
class Reference:
    """The panel as it is usually seen.

    Parameters
    ----------
    length, height : float
        Its sides, pixels.
    fill : float
        Its area by that of the rectangle around it.
    saturation : float
        Saturated pixels of a frame.
    brightness : float
        Mean of a frame's colours, 0 to 255.
    metres_per_pixel : float
        Calibration, m.
    corners : tuple of float
        Part seen of each corner.
    corner_noise : float
        Robust standard deviation of the corner seen least.
    """

    length: float
    height: float
    fill: float
    saturation: float
    brightness: float
    metres_per_pixel: float
    corners: tuple[float, ...]
    corner_noise: float


def reference_panel(
    seen: Mapping[str, FloatArray],
    panel: tuple[float, float],
    metres_per_pixel: float | None,
    name: str,
) -> Reference:
    """Medians over the frames in which the largest component looks like the panel.

    Parameters
    ----------
    seen : mapping of str to ndarray, shape (frame,)
        Fields of :class:`seakeep.signals.panel.Sighting`.
    panel : (float, float)
        Length and height of the panel, m.
    metres_per_pixel : float or None
        Calibration if it is known, m; None takes it from the panel's area.
    name : str
        What a message calls the video.

    Returns
    -------
    Reference

    Raises
    ------
    DataError
        If no frame shows the panel.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        aspect = (seen["length"] / seen["height"]) / (panel[0] / panel[1])
        like = (np.abs(aspect - 1) < ASPECT_BAND) & (seen["fill"] > LEAST_FILL)
        like &= seen["cut"] == 0
        if metres_per_pixel is not None:
            expected = panel[0] / metres_per_pixel
            like &= np.abs(seen["length"] / expected - 1) < SIZE_BAND
    if not like.any():
        raise DataError(_not_found(seen, panel, metres_per_pixel, name))
    length, height, fill, saturation, brightness = (
        float(np.median(seen[field][like]))
        for field in ("length", "height", "fill", "saturation", "brightness")
    )
    seen_scale = float(np.sqrt(panel[0] * panel[1] / (length * height)))
    scale = seen_scale if metres_per_pixel is None else metres_per_pixel
    corners = np.stack([seen[name][like] for name in CORNERS])
    usual = np.median(corners, axis=1)
    lowest = np.min(corners - usual[:, None], axis=0)
    noise = 1.4826 * float(np.median(np.abs(lowest - np.median(lowest))))
    places = tuple(float(each) for each in usual)
    return Reference(length, height, fill, saturation, brightness, scale, places, noise)


def _not_found(
    seen: Mapping[str, FloatArray],
    panel: tuple[float, float],
    metres_per_pixel: float | None,
    name: str,
) -> str:
    count, there = seen["area"].size, seen["area"] > 0
    wanted = f"{panel[0]:g} × {panel[1]:g} m"
    if metres_per_pixel is not None:
        wanted += f", {panel[0] / metres_per_pixel:.0f} × {panel[1] / metres_per_pixel:.0f} pixels"
    if not there.any():
        return (
            f"{name}: the panel ({wanted}) was not found in any of {count} frames: nothing is as "
            "bright as the thresholds ask. Reduce the least red, green and blue (lower; "
            "--threshold), or correct the region."
        )
    length, height = np.median(seen["length"][there]), np.median(seen["height"][there])
    return (
        f"{name}: the panel ({wanted}) was not found in any of {count} frames: the largest bright "
        f"component measures {length:.0f} × {height:.0f} pixels (median of {int(there.sum())} "
        "frames), which is not its shape. Raise the least red, green and blue (lower; "
        "--threshold), state a region that holds no other bright thing, or correct the "
        "panel's size."
    )


def judge(
    seen: Mapping[str, FloatArray], reference: Reference, limits: Limits
) -> tuple[Flags, FloatArray]:
    """Flag frames that cannot be trusted, and give each a quality figure.

    Parameters
    ----------
    seen : mapping of str to ndarray, shape (frame,)
        Fields of :class:`seakeep.signals.panel.Sighting`; NaN where a frame is not in the file.
    reference : Reference
        The panel as it is usually seen.
    limits : Limits
        What is allowed.

    Returns
    -------
    flag : ndarray of int, shape (frame,)
        See :data:`FLAGS`.
    quality : ndarray, shape (frame,)
        One less half the largest deviation in units of what is allowed: at 0.5 and above the
        shape is good; 0 where there is nothing to see. A flagged frame has less than 0.5.
    """
    tolerance = limits.tolerance * reference.length
    panel_area = reference.length * reference.height
    excess = np.nan_to_num(seen["saturation"] - reference.saturation)
    usual = np.array(reference.corners)[:, None]
    corners = usual - np.stack([seen[name] for name in CORNERS])
    least = BINARY_CORNER_DROP if limits.binary else CORNER_DROP
    drop = max(least, CORNER_NOISE * reference.corner_noise)
    hidden = np.max(np.nan_to_num(corners, nan=np.inf), axis=0) / drop
    deviations = (
        hidden,
        np.abs(seen["length"] - reference.length) / tolerance,
        np.abs(seen["height"] - reference.height) / tolerance,
        (reference.fill - seen["fill"]) / FILL_DROP,
    )
    shape = np.max(np.nan_to_num(np.stack(deviations), nan=np.inf), axis=0)
    off = (shape > 1) | (seen["cut"] > 0)
    flag = np.full(shape.size, FLAGS["good"])
    flag[off] = FLAGS["misshapen"]
    small = (seen["area"] < panel_area) | (hidden > 1) | (seen["cut"] > 0)
    flag[off & small] = FLAGS["occluded"]
    brighter = seen["brightness"] > BRIGHTER * reference.brightness
    flag[(off | brighter) & (excess > GLARE * panel_area)] = FLAGS["overexposed"]
    flag[excess > FLOOD * limits.pixels] = FLAGS["overexposed"]
    flag[(seen["area"] == 0) & (excess <= GLARE * panel_area)] = FLAGS["lost"]
    flag[~np.isfinite(seen["area"])] = FLAGS["dropped"]
    flag[_jumps(seen, flag == FLAGS["good"], reference, limits)] = FLAGS["jump"]
    quality = np.clip(1.0 - 0.5 * shape, 0.0, 1.0)
    flagged = flag != FLAGS["good"]
    quality[flagged] = np.minimum(quality[flagged], FLAGGED_QUALITY)
    return flag, quality


def _jumps(
    seen: Mapping[str, FloatArray],
    good: npt.NDArray[np.bool_],
    reference: Reference,
    limits: Limits,
) -> npt.NDArray[np.intp]:
    """Good frames whose place is further from the median of their neighbours than can be."""
    at = np.flatnonzero(good)
    if at.size < NEIGHBOURS:
        return at[:0]
    away = np.zeros(at.size)
    for axis in ("x", "y"):
        place = seen[axis][at]
        away = np.hypot(
            away, place - scipy.ndimage.median_filter(place, NEIGHBOURS, mode="nearest")
        )
    # From the middle of the neighbours to either end; twice that where some of them are flagged.
    reach = limits.max_speed * limits.step * NEIGHBOURS / reference.metres_per_pixel
    return at[away > reach + limits.tolerance * reference.length]
