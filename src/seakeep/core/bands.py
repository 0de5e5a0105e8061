"""ε(t) in a low-frequency and a wave-frequency band: slow drift and waves err differently.

Energy of series in bands of frequency that all series share.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt
import scipy
from scipy import fft

from seakeep.arrays import FloatArray, IntArray, as_real, number, time_step
from seakeep.errors import RequestError

LEAST_SPLIT = 1e-6
"""Split frequency over the sampling rate: below it the filter's coefficients are rounding."""
ORDER = 4
"""Of the Butterworth filter; forwards and backwards its gain at the split frequency is one half."""


def split_bands(
    series: npt.ArrayLike, dt: float, frequency: float
) -> tuple[FloatArray, FloatArray]:
    """Split histories at a frequency into a slow and a fast part that add up to them.

    Parameters
    ----------
    series : array_like, shape (…, time, channel)
        Uniform samples; a series with a NaN is NaN in both parts.
    dt : float
        Time step, s.
    frequency : float
        Where they are split, Hz, between 0 and half the sampling rate.

    Returns
    -------
    low, high : ndarray, shape (…, time, channel)
        Slow part (zero-phase Butterworth filter) and the rest. Within about two periods of
        the split frequency of either end both rest on a mirror image of the series.

    Raises
    ------
    RequestError
        If the frequency does not fit the time step, or there are fewer than eight samples.

    Examples
    --------
    >>> t = np.arange(600) * 0.05
    >>> slow, fast = np.sin(2 * np.pi * 0.02 * t), np.sin(2 * np.pi * 0.6 * t)
    >>> low, high = split_bands((slow + fast)[:, None], 0.05, 0.2)
    >>> bool(np.abs(low[100:-100, 0] - slow[100:-100]).max() < 0.01)
    True
    """
    x = as_real(series, "series")
    if x.ndim < 2 or x.shape[-2] < 8:
        raise RequestError(
            f"series has shape {x.shape}; (…, time, channel) with at least eight samples is needed."
        )
    dt, frequency = time_step(dt), number(frequency, "the frequency")
    if not LEAST_SPLIT < frequency * dt < 0.5:
        raise RequestError(
            f"bands split at {frequency:g} Hz do not fit a time step of {dt:g} s; the split must "
            "lie between a millionth of the sampling rate and half the sampling rate."
        )
    sections = scipy.signal.butter(ORDER, frequency, fs=1.0 / dt, output="sos")
    reach = min(x.shape[-2] - 1, round(1.0 / (frequency * dt)))
    low = scipy.signal.sosfiltfilt(sections, x, axis=-2, padtype="even", padlen=reach)
    low = np.where(np.isfinite(x).all(axis=-2, keepdims=True), low, np.nan)
    return low, x - low


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
    return 2.0 ** ((first + np.arange(count + 1)) / PER_OCTAVE)
