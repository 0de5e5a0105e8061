"""Memory for what a computation holds on its way, from large pages, and used again.

A fresh array of some megabytes costs a page fault for every 4 KiB when it is first written: about
half a millisecond a megabyte, as much as the arithmetic on it. NumPy asks the system for large
pages (2 MiB, one fault) for allocations of 4 MiB or more. So temporary arrays are cut out of one
large block, which can serve the next computation too.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

__all__ = ["LINE", "Scratch"]

FloatArray = npt.NDArray[np.float64]

PAGE = 2**21
BLOCK = 2**24
"""Bytes of a block at least; memory that is never written is not taken from the system."""
LINE = 8
"""Numbers to which an array begins: a line of cache."""


class Scratch:
    """Blocks of memory out of which temporary arrays are cut.

    One computation at a time may use it: :meth:`reset` gives all arrays taken so far to the next.

    Examples
    --------
    >>> scratch = Scratch()
    >>> scratch.take((3, 4)).shape
    (3, 4)
    """

    def __init__(self) -> None:
        self._blocks: list[FloatArray] = []
        self._block = 0
        self._at = 0

    def take(self, shape: tuple[int, ...]) -> FloatArray:
        """Cut out an array; its values are whatever stood there.

        Parameters
        ----------
        shape : tuple of int
            Shape.

        Returns
        -------
        ndarray
            Contiguous, valid until :meth:`reset`.
        """
        size = math.prod(shape)
        while self._block < len(self._blocks):
            block = self._blocks[self._block]
            if self._at + size <= block.size:
                begin, self._at = self._at, self._at + size + (-size) % LINE
                return block[begin : begin + size].reshape(shape)
            self._block, self._at = self._block + 1, 0
        self._blocks.append(_aligned(max(8 * size, BLOCK)))
        return self.take(shape)

    def zeros(self, shape: tuple[int, ...]) -> FloatArray:
        """As :meth:`take`, filled with zeros."""
        out = self.take(shape)
        out[...] = 0.0
        return out

    def mark(self) -> tuple[int, int]:
        """Where the next array will be cut, for :meth:`release`."""
        return self._block, self._at

    def release(self, mark: tuple[int, int]) -> None:
        """Give back what was taken since `mark`."""
        self._block, self._at = mark

    def reset(self) -> None:
        """Start again from the first block: arrays taken before must no longer be used."""
        self._block = self._at = 0


def _aligned(size: int) -> FloatArray:
    raw = np.empty((size + PAGE) // 8)
    offset = (-raw.ctypes.data) % PAGE // 8
    return raw[offset : offset + size // 8]
