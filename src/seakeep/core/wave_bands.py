"""Energy of series in bands of frequency that all series share."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy import fft

from seakeep.arrays import BoolArray, FloatArray, IntArray

__all__ = ["band_edges", "band_energy"]

PER_OCTAVE = 6
"""Bands per octave: each is 12 % wide, as wide as the peak of a record of eight waves."""


def band_energy(series: FloatArray, dt: float, first: int, count: int) -> FloatArray:
    """Energy of series (time, channel) in `count` bands from the number `first` on.

    Returns
    -------
    ndarray, shape (channel, band)
        Sums of a Hann-tapered periodogram; they add up to about the variance times the length.
    """
    taper, bands, inside = _taper_and_bands(len(series), dt, first, count)
    power = np.abs(fft.rfft(taper * (series - series.mean(axis=0)), axis=0)) ** 2
    out = np.zeros((series.shape[1], count))
    for channel, column in enumerate(power[1:].T):
        out[channel] = np.bincount(bands, column[inside], count) / len(series)
    return out


@lru_cache(maxsize=8)
def _taper_and_bands(
    length: int, dt: float, first: int, count: int
) -> tuple[FloatArray, IntArray, BoolArray]:
    """Hann taper, band of each frequency that lies in one, and which do."""
    frequency = fft.rfftfreq(length, dt)[1:]
    bands = np.floor(PER_OCTAVE * np.log2(frequency)).astype(np.intp) - first
    inside = (bands >= 0) & (bands < count)
    return np.hanning(length + 2)[1:-1, None], bands[inside], inside


def band_edges(first: int, count: int) -> FloatArray:
    """Edges of the bands, Hz, shape (count + 1,)."""
    edges: FloatArray = 2.0 ** ((first + np.arange(count + 1)) / PER_OCTAVE)
    return edges
