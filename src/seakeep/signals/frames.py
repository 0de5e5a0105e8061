"""Frames of a video file, one after the other, with their instants.

Needs OpenCV, the extra ``video``.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from seakeep.errors import DataError, RequestError, SeakeepWarning

__all__ = ["Video", "open_video", "opencv"]

Image = npt.NDArray[np.uint8]

SLOWEST, FASTEST = 0.1, 2000.0
"""Frames a second that a header may state and be believed."""


def opencv() -> Any:
    """Return OpenCV's module, its decoder told to be quiet.

    Returns
    -------
    module
        ``cv2``.

    Raises
    ------
    RequestError
        If it is not installed.
    """
    # What FFmpeg prints about a damaged file, our own message says in a sentence.
    os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
    os.environ.setdefault("OPENCV_LOG_LEVEL", "ERROR")
    try:
        import cv2
    except ImportError as error:
        raise RequestError(
            "reading a video needs OpenCV, which is not installed. "
            "Install the extra: pip install 'seakeep[video]'."
        ) from error
    return cv2


@dataclass
class Video:
    """An open video; made by :func:`open_video`.

    Parameters
    ----------
    path : Path
        The file.
    rate : float
        Frames a second, as its header states.
    announced : int
        Number of frames that the header announces; 0 where it says nothing.
    size : (int, int)
        Width and height, pixels.
    capture : object
        OpenCV's reader.
    """

    path: Path
    rate: float
    announced: int
    size: tuple[int, int]
    capture: Any

    def frames(self) -> Iterator[tuple[int, Image]]:
        """Yield the frames with their numbers, colours in the order blue, green, red.

        The number counts steps of ``1 / rate`` from the first frame: where the time stamps skip a
        step, so do the numbers, and a frame that the camera dropped is one that is not there.

        Raises
        ------
        DataError
            If two frames fall into one step: the rate varies.
        """
        import cv2

        first, previous, count = 0.0, -1, 0
        while True:
            there, frame = self.capture.read()
            if not there:
                break
            stamp = 1e-3 * float(self.capture.get(cv2.CAP_PROP_POS_MSEC))
            first = stamp if count == 0 else first
            number = round((stamp - first) * self.rate)
            if not np.isfinite(stamp) or (count and stamp <= first):
                number = previous + 1  # a container without time stamps
            if number <= previous:
                raise DataError(
                    f"{self.path}: frames {count - 1} and {count} are less than half a step of "
                    f"{1 / self.rate:.4g} s apart, so the frame rate varies. Encode the video "
                    "again with a constant rate."
                )
            yield number, np.asarray(frame, dtype=np.uint8)
            previous, count = number, count + 1
        self._check_count(count)

    def _check_count(self, count: int) -> None:
        if count == 0:
            raise DataError(f"{self.path} holds no frame that can be decoded. Export it again.")
        # Headers of some containers are off by a frame or two.
        if self.announced - count > max(2, 0.01 * self.announced):
            warnings.warn(
                f"{self.path} announces {self.announced} frames and ends after {count}: it was cut "
                "off or is damaged. What is there was used; copy the file again.",
                SeakeepWarning,
                stacklevel=2,
            )

    def frame(self, number: int) -> Image | None:
        """Return one frame by its count from the first; None where it cannot be decoded."""
        import cv2

        self.capture.set(cv2.CAP_PROP_POS_FRAMES, number)
        there, frame = self.capture.read()
        return np.asarray(frame, dtype=np.uint8) if there else None


@contextmanager
def open_video(path: Path | str) -> Iterator[Video]:
    """Open a video file.

    Parameters
    ----------
    path : path
        MP4, AVI, MOV or what else OpenCV reads.

    Yields
    ------
    Video
        Closed on leaving.

    Raises
    ------
    RequestError
        If OpenCV is not installed, or the file does not exist.
    DataError
        If the file is empty, cut off, or no video.
    """
    cv2, path = opencv(), Path(path)
    if path.is_dir():
        raise RequestError(f"{path} is a folder; give the video in it.")
    if not path.exists():
        raise RequestError(f"the video {path} does not exist. Correct the name.")
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
        rate = float(capture.get(cv2.CAP_PROP_FPS))
        if not SLOWEST <= rate <= FASTEST:
            raise DataError(
                f"{path} states {rate:g} frames a second, which cannot be. Encode it again with "
                "its true, constant rate."
            )
        announced = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        size = (
            int(capture.get(cv2.CAP_PROP_FRAME_WIDTH)),
            int(capture.get(cv2.CAP_PROP_FRAME_HEIGHT)),
        )
        yield Video(path, rate, int(announced) if announced > 0 else 0, size, capture)
    finally:
        capture.release()
