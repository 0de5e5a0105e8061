"""Surge, heave and pitch from a video of a white panel on the vessel.

Source: the paper's section "Motion measurements": thresholds in RGB, opening, closing, hole
filling, the largest component, its centroid and orientation, frame by frame, then a low-pass
filter. Every frame carries a quality figure and a flag; a frame that is flagged gives no motion,
and a gap is bridged only when asked. Needs OpenCV, the extra ``video``.

Frame: x downstream, z up, pitch positive bow up, the bow pointing upstream. With downstream to
the right of the picture the camera looks along +y and sees the vessel's port side; with
downstream to the left it stands on the other side of the tank.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import scipy
import xarray as xr

from seakeep.arrays import FloatArray, positive
from seakeep.errors import DataError, RequestError, SeakeepWarning
from seakeep.signals.filters import low_pass
from seakeep.signals.frames import Video, open_video
from seakeep.signals.panel import Segmentation, Sighting, find_panel
from seakeep.signals.sightings import FLAGS, Limits, Reference, judge, reference_panel
from seakeep.signals.time_axis import stretches

__all__ = ["TrackingSettings", "track_video"]

Progress = Callable[[int, int, str], None]

REPORT_EVERY = 150
"""Frames between two reports of progress."""


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
    level : float
        Pitch that the picture shows of a vessel that is level, rad: the camera's own roll.
    origin : (float, float) or None
        Pixel of the panel's centre while the vessel is at rest; None makes the means of surge
        and heave over the first `rest` seconds zero.
    rest : float
        s, where `origin` is None.
    lower, upper : (int, int, int)
        Least and greatest red, green and blue of the panel, 0 to 255.
    opening, closing : int
        Sides of the squares of opening and closing, pixels; 0 leaves the step out.
    refine : bool
        Whether pixels at the panel's edge count by their brightness; False is the paper's binary
        mask, with about five times the error in pitch.
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
    passband, stopband : float or None
        Edges of the low-pass filter, Hz; a `passband` of None filters nothing, a `stopband` of
        None is 1.5 times the `passband`.
    """

    metres_per_pixel: float | None = None
    panel: tuple[float, float] = (0.30, 0.10)
    panel_place: tuple[float, float] = (0.0, 0.25)
    downstream: Literal["right", "left"] = "right"
    level: float = 0.0
    origin: tuple[float, float] | None = None
    rest: float = 1.0
    lower: tuple[int, int, int] = (150, 150, 150)
    upper: tuple[int, int, int] = (255, 255, 255)
    opening: int = 5
    closing: int = 9
    refine: bool = True
    region: tuple[int, int, int, int] | None = None
    lamp: tuple[float, float, float] | None = None
    tolerance: float = 0.02
    max_speed: float = 3.0
    bridge: float = 0.0
    passband: float | None = 4.0
    stopband: float | None = None

    def __post_init__(self) -> None:
        for name, unit in (("rest", "s"), ("tolerance", "a part"), ("max_speed", "m/s")):
            positive(getattr(self, name), name, unit)
        if self.metres_per_pixel is not None:
            positive(self.metres_per_pixel, "metres_per_pixel", "m")
        if len(self.panel) != 2 or not self.panel[0] > 1.2 * self.panel[1] > 0:
            raise RequestError(
                f"panel is (length, height) in metres, the length at least 1.2 times the height, "
                f"or its orientation means nothing; received {self.panel}."
            )
        if self.downstream not in ("right", "left"):
            raise RequestError(
                f"downstream is 'right' or 'left' in the picture; received {self.downstream!r}."
            )
        _check_colours(self.lower, self.upper)
        if self.opening < 0 or self.closing < 0:
            raise RequestError(
                f"opening and closing are sides in pixels, 0 for none; received {self.opening} "
                f"and {self.closing}."
            )
        if self.region is not None and (min(self.region) < 0 or min(self.region[2:]) < 1):
            raise RequestError(
                f"region is (left, top, width, height) in pixels; received {self.region}."
            )
        if not self.bridge >= 0:
            raise RequestError(f"bridge is a time in s, 0 for none; received {self.bridge!r}.")

    def segmentation(self) -> Segmentation:
        """Return the part of the settings that one frame needs."""
        return Segmentation(
            self.lower, self.upper, self.opening, self.closing, self.region, self.refine
        )


def _check_colours(lower: tuple[int, int, int], upper: tuple[int, int, int]) -> None:
    if not (len(lower) == len(upper) == 3) or not all(
        0 <= low <= high <= 255 for low, high in zip(lower, upper, strict=True)
    ):
        raise RequestError(
            f"lower (--threshold) and upper are (red, green, blue), each 0 to 255 and lower not "
            f"above upper; received {lower} and {upper}."
        )


def track_video(
    path: Path | str,
    settings: TrackingSettings | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
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
    Dataset
        Over ``time`` (s from the first frame): ``surge``, ``heave`` (m) and ``pitch`` (rad) of
        the centre of gravity, filtered, NaN where the frame was flagged and not bridged;
        ``quality`` (1 like the others, below 0.5 flagged, 0 lost); ``flag`` (its attributes
        ``flag_values`` and ``flag_meanings`` say what); ``bridged`` (0 or 1); ``lamp`` (0 to 1)
        where asked; and what was measured, unfiltered, of each frame: ``centroid_x``,
        ``centroid_y``, ``panel_length``, ``panel_height`` (pixel), ``panel_angle`` (rad,
        positive clockwise as seen), ``panel_area`` (pixel²), ``panel_fill`` and ``saturation``
        (saturated part of the picture). The attributes hold the calibration and the settings.

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
    with open_video(path) as video:
        _check_fit(video, how)
        frames, rows, lamp = _measure(video, how, progress)
        size, rate = video.size, video.rate
    count = int(frames[-1]) + 1
    if count < 2:
        raise DataError(f"{path} holds one frame; a motion needs at least two. Export it again.")
    seen = _on_grid(frames, rows, count)
    reference = reference_panel(seen, how.panel, how.metres_per_pixel, str(path))
    width, height = size if how.region is None else how.region[2:]
    limits = Limits(how.tolerance, how.max_speed, 1.0 / rate, width * height, not how.refine)
    flag, quality = judge(seen, reference, limits)
    _tell(path, flag)
    motion, bridged = _motions(seen, flag, reference, how, rate, str(path))
    out = _dataset(seen, motion, rate, width * height)
    out = out.assign(_judgement(flag, quality, bridged, frames))
    if how.lamp is not None:
        level = np.full(count, np.nan)
        level[frames] = lamp
        out["lamp"] = ("time", level, {"units": "1", "long_name": "brightness of the lamp"})
    return out.assign_attrs(_attributes(path, how, reference, rate))


def _check_fit(video: Video, how: TrackingSettings) -> None:
    width, height = video.size
    if how.region is not None:
        left, top, wide, high = how.region
        if left + wide > width or top + high > height:
            raise RequestError(
                f"the region {how.region} (left, top, width, height) leaves the picture of "
                f"{video.path}, {width} × {height} pixels. Make it smaller."
            )
    if how.lamp is not None:
        x, y, radius = how.lamp
        if not (0 <= x < width and 0 <= y < height and radius > 0):
            raise RequestError(
                f"the lamp {how.lamp} (x, y, radius) lies outside the picture of {video.path}, "
                f"{width} × {height} pixels. Correct its place."
            )
    stop = _stopband(how)
    if stop is not None and stop >= 0.5 * video.rate:
        raise RequestError(
            f"{video.path} has {video.rate:g} frames a second, so the low-pass filter cannot stop "
            f"at {stop:g} Hz. Lower the passband (--passband) so that the stopband, 1.5 times as "
            f"high unless stated, lies below {0.5 * video.rate:g} Hz, or filter nothing "
            "(passband None; --passband 0)."
        )


def _stopband(how: TrackingSettings) -> float | None:
    if how.passband is None:
        return None
    return 1.5 * how.passband if how.stopband is None else how.stopband


def _measure(
    video: Video, how: TrackingSettings, progress: Progress | None
) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]:
    """Numbers of the frames, what was seen in each (frame, field), and the lamp."""
    numbers: list[int] = []
    rows: list[tuple[float, ...]] = []
    lamp: list[float] = []
    at_rest = how.origin is None
    segmentation = how.segmentation()
    disc = None if how.lamp is None else _disc(how.lamp, video.size)
    for number, frame in video.frames():
        if at_rest and number >= how.rest * video.rate:
            at_rest = False
            _check_rest(video, how, np.array(rows))
        numbers.append(number)
        rows.append(find_panel(frame, segmentation).row())
        if disc is not None:
            lamp.append(float(np.mean(frame[disc])) / 255.0)
        if progress is not None and len(numbers) % REPORT_EVERY == 0:
            progress(len(numbers), max(video.announced, len(numbers)), "frames")
    if progress is not None:
        progress(len(numbers), len(numbers), "frames")
    return np.array(numbers), np.array(rows), np.array(lamp)


def _check_rest(video: Video, how: TrackingSettings, rows: FloatArray) -> None:
    """Refuse after the first frames what would be refused after the last one."""
    if rows.size == 0:
        return
    seen = _on_grid(np.arange(len(rows)), rows, len(rows))
    where = f"{video.path}, first {how.rest:g} s (unless the origin is stated, zero lies there)"
    reference_panel(seen, how.panel, how.metres_per_pixel, where)


def _disc(
    lamp: tuple[float, float, float], size: tuple[int, int]
) -> tuple[npt.NDArray[np.intp], ...]:
    x, y, radius = lamp
    rows, columns = np.mgrid[: size[1], : size[0]]
    return np.nonzero((columns - x) ** 2 + (rows - y) ** 2 <= radius**2)


def _on_grid(frames: npt.NDArray[np.int64], rows: FloatArray, count: int) -> dict[str, FloatArray]:
    """What was seen, by name, on the uniform grid; dropped frames are NaN."""
    table = np.full((count, rows.shape[1]), np.nan)
    table[frames] = rows
    return {field.name: table[:, i] for i, field in enumerate(fields(Sighting))}


def _tell(path: Path | str, flag: npt.NDArray[np.int64]) -> None:
    bad = int(np.sum(flag != FLAGS["good"]))
    if 2 * bad <= flag.size:
        return
    counts = ", ".join(
        f"{np.sum(flag == code)} {name}" for name, code in FLAGS.items() if np.any(flag == code)
    )
    warnings.warn(
        f"{path}: {bad} of {flag.size} frames are flagged ({counts}). Look at the contact sheet; "
        "mend the thresholds, state a region, or raise tolerance for a lens that distorts.",
        SeakeepWarning,
        stacklevel=3,
    )


def _motions(
    seen: dict[str, FloatArray],
    flag: npt.NDArray[np.int64],
    reference: Reference,
    how: TrackingSettings,
    rate: float,
    name: str,
) -> tuple[dict[str, FloatArray], npt.NDArray[np.int8]]:
    """Surge, heave and pitch of the centre of gravity, filtered, and what was bridged."""
    good = flag == FLAGS["good"]
    side = 1.0 if how.downstream == "right" else -1.0
    pitch = side * seen["angle"] - how.level
    along, up = how.panel_place
    scale = reference.metres_per_pixel
    # Where the panel's centre would be if the vessel had turned about its centre of gravity alone.
    x = side * scale * seen["x"] - along * np.cos(pitch) - up * np.sin(pitch)
    z = -scale * seen["y"] + along * np.sin(pitch) - up * np.cos(pitch)
    if how.origin is not None:
        at = side * scale * how.origin[0] - along, -scale * how.origin[1] - up
    else:
        rest = good & (np.arange(good.size) < max(1, round(how.rest * rate)))
        if not rest.any():
            raise DataError(
                f"{name}: no good frame among the first {how.rest:g} s, over which surge and heave "
                "would be made zero. State the origin, or a longer rest."
            )
        at = float(np.mean(x[rest])), float(np.mean(z[rest]))
    raw = np.stack([x - at[0], z - at[1], pitch], axis=1)
    raw[~good] = np.nan
    table, bridged = _bridged(raw, good, how.bridge * rate)
    stop = _stopband(how)
    if how.passband is not None and stop is not None:
        for begin, end in stretches(np.isfinite(table[:, 0])):
            if end - begin > 1:
                table[begin:end] = low_pass(table[begin:end], 1.0 / rate, how.passband, stop)
    motions = dict(zip(("surge", "heave", "pitch"), table.T, strict=True))
    return motions, bridged.astype(np.int8)


def _bridged(
    table: FloatArray, good: npt.NDArray[np.bool_], longest: float
) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
    """Fill inner gaps of at most `longest` frames; say which frames were filled."""
    filled = np.zeros(good.size, dtype=bool)
    for begin, end in stretches(~good):
        if begin > 0 and end < good.size and end - begin <= longest + 1e-9:
            filled[begin:end] = True
    if filled.any():
        at = np.flatnonzero(good)
        between = scipy.interpolate.PchipInterpolator(at, table[at], axis=0)
        table = table.copy()
        table[filled] = between(np.flatnonzero(filled))
    return table, filled


def _dataset(
    seen: dict[str, FloatArray],
    motion: dict[str, FloatArray],
    rate: float,
    pixels: int,
) -> xr.Dataset:
    measured = {
        "centroid_x": ("x", "pixel", "panel centroid, to the right"),
        "centroid_y": ("y", "pixel", "panel centroid, downwards"),
        "panel_angle": ("angle", "rad", "panel orientation, clockwise as seen"),
        "panel_length": ("length", "pixel", "panel length as seen"),
        "panel_height": ("height", "pixel", "panel height as seen"),
        "panel_area": ("area", "pixel^2", "panel area as seen"),
        "panel_fill": ("fill", "1", "panel area by that of the rectangle around it"),
        "saturation": ("saturation", "1", "saturated part of the picture"),
    }
    units = {"surge": "m", "heave": "m", "pitch": "rad"}
    data = {
        key: ("time", value, {"units": units[key], "long_name": key})
        for key, value in motion.items()
    }
    for name, (field, unit, label) in measured.items():
        values = seen[field] / pixels if name == "saturation" else seen[field]
        data[name] = ("time", values, {"units": unit, "long_name": label})
    time = np.arange(seen["x"].size) / rate
    return xr.Dataset(data, {"time": ("time", time, {"units": "s", "long_name": "time"})})


def _judgement(
    flag: npt.NDArray[np.int64],
    quality: FloatArray,
    bridged: npt.NDArray[np.int8],
    frames: npt.NDArray[np.int64],
) -> dict[str, tuple[str, npt.NDArray[Any], dict[str, object]]]:
    """Variables that say what a frame is worth, and which picture of the file it is."""
    picture = np.full(flag.size, -1)
    picture[frames] = np.arange(frames.size)
    labels: dict[str, tuple[npt.NDArray[Any], str]] = {
        "quality": (quality, "quality of the frame"),
        "bridged": (bridged, "whether the frame is bridged"),
        "picture": (picture, "count of the frame in the file"),
    }
    out: dict[str, tuple[str, npt.NDArray[Any], dict[str, object]]] = {
        name: ("time", values, {"units": "1", "long_name": label})
        for name, (values, label) in labels.items()
    }
    out["flag"] = ("time", flag.astype(np.int8), _flag_attributes())
    return out


def _flag_attributes() -> dict[str, object]:
    return {
        "units": "1",
        "long_name": "flag of the frame",
        "flag_values": np.array(list(FLAGS.values()), dtype=np.int8),
        "flag_meanings": " ".join(FLAGS),
    }


def _attributes(
    path: Path | str, how: TrackingSettings, reference: Reference, rate: float
) -> dict[str, object]:
    return {
        "source": Path(path).name,
        "frame": "x downstream, z up, pitch positive bow up; motions of the centre of gravity",
        "camera": f"downstream to the {how.downstream} of the picture",
        "frame_rate": rate,
        "metres_per_pixel": reference.metres_per_pixel,
        "calibration": "stated" if how.metres_per_pixel is not None else "size of the panel",
        "panel_length_seen": reference.length,
        "panel_height_seen": reference.height,
        "settings": json.dumps(asdict(how)),
    }
