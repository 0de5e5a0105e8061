"""Energy of series in bands of frequency that all series share."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import fft

from seakeep.arrays import FloatArray, IntArray

PER_OCTAVE = 6
"""Bands per octave: each is 12 % wide, as wide as the peak of a record of eight waves."""


def band_energy(series: FloatArray, dt: float, first: int, count: int) -> FloatArray:
    """Energy of series (time, channel) in `count` bands from the number `first` on.

    Returns
    -------
    ndarray, shape (channel, band)
        Sums of a Hann-tapered periodogram; they add up to about the variance times the length.
    """
    taper, bands, begins, stop = _taper_and_bands(len(series), dt, first, count)
    tapered = np.ascontiguousarray(series.T)
    tapered = taper * (tapered - tapered.mean(axis=1, keepdims=True))
    power = np.abs(fft.rfft(tapered)) ** 2
    out = np.zeros((len(power), count))
    out[:, bands] = np.add.reduceat(power[:, :stop], begins, axis=1) / len(series)
    return out


@lru_cache(maxsize=8)
def _taper_and_bands(
    length: int, dt: float, first: int, count: int
) -> tuple[FloatArray, IntArray, IntArray, int]:
    """Hann taper, bands that hold frequencies, the first of each, and the one after the last."""
    frequency = fft.rfftfreq(length, dt)[1:]
    band = np.floor(PER_OCTAVE * np.log2(frequency)).astype(np.intp) - first
    inside = 1 + np.flatnonzero((band >= 0) & (band < count))
    bands, begins = np.unique(band[inside - 1], return_index=True)
    return np.hanning(length + 2)[1:-1], bands, inside[begins], int(inside[-1]) + 1


def band_edges(first: int, count: int) -> FloatArray:
    """Edges of the bands, Hz, shape (count + 1,)."""
    edges: FloatArray = 2.0 ** ((first + np.arange(count + 1)) / PER_OCTAVE)
    return edges
