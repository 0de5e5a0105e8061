"""Where the series of all members stand, in pieces of time: in memory or in a temporary file.

Whoever forecasts a member puts its series into their place, so that a worker process hands nothing
back but the instants at which its member was lost.
"""

from __future__ import annotations

import errno
import math
import os
import tempfile
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import numpy.typing as npt

from seakeep.errors import RequestError

__all__ = ["Layout", "Shelf", "open_shelf"]

FloatArray = npt.NDArray[np.float64]

HELD = 32 * 2**20
"""Bytes of member series that are held in memory; more is spilled to a temporary file."""
CHUNK = 8 * 2**20
"""Bytes of the pieces in time that are reduced at a time, of all members."""


@dataclass(frozen=True)
class Layout:
    """Order in which series are kept: (window, piece, member, instant, channel).

    Parameters
    ----------
    windows, members, steps, channels : int
        What there is.
    length : int
        Instants of a piece; the last one may be shorter.
    """

    windows: int
    members: int
    steps: int
    channels: int
    length: int

    @classmethod
    def in_pieces(
        cls, windows: int, members: int, steps: int, channels: int, hands: int = 1
    ) -> Layout:
        """Layout of which `hands` pieces at a time are read in bounded memory."""
        room = CHUNK // max(1, 8 * channels * members * hands)
        length = max(1, min(math.ceil(steps / hands), room))
        return cls(windows, members, steps, channels, length)

    @property
    def pieces(self) -> int:
        """Pieces of a window."""
        return -(-self.steps // self.length)

    @property
    def shape(self) -> tuple[int, int, int, int, int]:
        """Shape of all that is kept."""
        return self.windows, self.pieces, self.members, self.length, self.channels

    @property
    def bytes(self) -> int:
        """Size of all that is kept."""
        return 8 * math.prod(self.shape)

    def instants(self, piece: int) -> slice:
        """Instants of a piece."""
        return slice(piece * self.length, min((piece + 1) * self.length, self.steps))

    def parts(self, series: FloatArray) -> Iterator[tuple[int, int, FloatArray]]:
        """Window, piece and values of each part of a member's series, (window, steps, N)."""
        length, pieces = self.length, range(self.pieces)
        for window, values in enumerate(series):
            for piece in pieces:
                yield window, piece, values[piece * length : (piece + 1) * length]


class Shelf(ABC):
    """Series of all members; :func:`open_shelf` makes one.

    Parameters
    ----------
    layout : Layout
        What is kept in which order.
    """

    def __init__(self, layout: Layout) -> None:
        self.layout = layout

    @abstractmethod
    def put(self, member: int, series: FloatArray) -> None:
        """Put a member's series, shape (window, steps, N), into its place."""

    @abstractmethod
    def _read(self, window: int, piece: int, windows: int) -> FloatArray:
        """From a window and a piece on, so many windows of one piece, with their padding."""

    def get(self, window: int, piece: int) -> FloatArray:
        """A piece of all members, shape (member, instants, N)."""
        instants = self.layout.instants(piece)
        return self._read(window, piece, 1)[0, :, : instants.stop - instants.start]

    def all(self) -> FloatArray:
        """All series of a layout of one piece, shape (window, member, steps, N)."""
        assert self.layout.pieces == 1
        return self._read(0, 0, self.layout.windows)


class _Held(Shelf):
    """Series in memory."""

    def __init__(self, layout: Layout) -> None:
        super().__init__(layout)
        self._values = np.empty(layout.shape)

    def put(self, member: int, series: FloatArray) -> None:
        for window, piece, part in self.layout.parts(series):
            self._values[window, piece, member, : len(part)] = part

    def _read(self, window: int, piece: int, windows: int) -> FloatArray:
        found: FloatArray = self._values[window : window + windows, piece]
        return found


class _Spilled(Shelf):
    """Series in a file; read and written, not mapped, so that memory holds one piece alone.

    With a path it can be pickled, and a copy in another process uses the same file.
    """

    def __init__(self, layout: Layout, place: BinaryIO | Path) -> None:
        super().__init__(layout)
        self._place = place
        self._lock = threading.Lock()  # reading and writing move the place in an open file

    def __reduce__(self) -> tuple[Any, ...]:
        return _Spilled, (self.layout, self._place)

    def reserve(self) -> None:
        """Take the room now where that can be done: a full disk is told before the work."""
        with _spilling(self.layout.bytes), self._opened() as file:
            try:
                os.posix_fallocate(file.fileno(), 0, self.layout.bytes)
            except (AttributeError, OSError) as error:
                if isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT):
                    raise
                file.truncate(self.layout.bytes)

    @contextmanager
    def _opened(self) -> Iterator[BinaryIO]:
        if isinstance(self._place, Path):
            with self._place.open("r+b", buffering=0) as file:
                yield file
        else:
            with self._lock:
                yield self._place

    def put(self, member: int, series: FloatArray) -> None:
        # Without the helpers above: they would cost as much as the writing.
        try:
            if isinstance(self._place, Path):
                with open(self._place, "r+b", buffering=0) as file:  # noqa: PTH123
                    self._write(file, member, series)
            else:
                with self._lock:
                    self._write(self._place, member, series)
        except OSError as error:
            raise _no_room(self.layout.bytes, error) from error

    def _write(self, file: BinaryIO, member: int, series: FloatArray) -> None:
        for window, piece, part in self.layout.parts(series):
            left = np.ascontiguousarray(part).data.cast("B")
            file.seek(self._offset(window, piece, member))
            while left:
                left = left[file.write(left) :]

    def _read(self, window: int, piece: int, windows: int) -> FloatArray:
        shape = (windows, *self.layout.shape[2:])
        with self._opened() as file:
            file.seek(self._offset(window, piece, 0))
            found = np.fromfile(file, dtype=np.float64, count=math.prod(shape))
        return found.reshape(shape)

    def _offset(self, window: int, piece: int, member: int) -> int:
        """Byte at which a piece of a member begins."""
        layout = self.layout
        number = (window * layout.pieces + piece) * layout.members + member
        return 8 * number * layout.length * layout.channels


@contextmanager
def _spilling(size: int) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise _no_room(size, error) from error


def _no_room(size: int, error: OSError) -> RequestError:
    return RequestError(
        f"cannot keep {size / 2**20:.0f} MiB of members in the temporary folder "
        f"{tempfile.gettempdir()}: {error.strerror or error}. Free space there, name a folder on "
        "another disk in the environment variable TMPDIR, or ask for fewer steps, windows or "
        "members at a time."
    )


@contextmanager
def open_shelf(layout: Layout, *, shared: bool = False, whole: bool = False) -> Iterator[Shelf]:
    """Make room for the series of all members.

    Parameters
    ----------
    layout : Layout
        What will be kept.
    shared : bool, optional
        Whether other processes will put members into it: then it is a file of a known path.
    whole : bool, optional
        Whether the series will be read all at once, so that a file would save nothing.

    Yields
    ------
    Shelf
        Gone with all that it holds when the block is left.

    Raises
    ------
    RequestError
        If the temporary folder has no room.
    """
    if not shared and (whole or layout.bytes <= HELD):
        yield _Held(layout)
        return
    with ExitStack() as stack:
        with _spilling(layout.bytes):
            place: BinaryIO | Path
            if shared:
                folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="seakeep-"))
                place = Path(folder) / "members"
                place.touch()
            else:
                place = stack.enter_context(tempfile.TemporaryFile(prefix="seakeep-", buffering=0))
        shelf = _Spilled(layout, place)
        shelf.reserve()
        yield shelf
