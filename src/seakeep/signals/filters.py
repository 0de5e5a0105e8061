"""Linear-phase filters whose delay is compensated.

All functions filter along the first axis, take one series or several side by side, and return an
array of the shape they were given.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy

from seakeep.errors import RequestError

__all__ = ["low_pass", "lowpass_taps"]

FloatArray = npt.NDArray[np.float64]


def as_series(series: npt.ArrayLike, minimum: int = 2) -> FloatArray:
    """Return `series` as floats with time along the first axis; refuse gaps and short series."""
    array = np.asarray(series, dtype=float)
    if array.ndim == 0 or array.shape[0] < minimum:
        raise RequestError(
            f"the series has {array.shape[0] if array.ndim else 0} samples along its first axis, "
            f"at least {minimum} are needed; received shape {array.shape}. "
            "Series run along the first axis: (time,) or (time, channel)."
        )
    if not np.all(np.isfinite(array)):
        first = int(np.flatnonzero(~np.isfinite(array.reshape(array.shape[0], -1)).all(axis=1))[0])
        raise RequestError(
            f"the series holds {int(np.sum(~np.isfinite(array)))} values that are not finite, the "
            f"first at sample {first}. Fill or cut the gap before filtering: a filter would spread "
            "it over its whole length."
        )
    return array


def positive(name: str, value: float, unit: str) -> float:
    """Return `value` as a float if it is finite and positive, else say so."""
    if not np.isfinite(value) or value <= 0:
        raise RequestError(f"{name} must be positive ({unit}); received {value!r}.")
    return float(value)


def lowpass_taps(
    sampling_rate: float, passband: float, stopband: float, attenuation: float = 60.0
) -> FloatArray:
    """Taps of a Kaiser-window low-pass filter that meets a specification.

    Parameters
    ----------
    sampling_rate : float
        Samples a second, Hz.
    passband, stopband : float
        Edges of the pass and stop bands, Hz, ``0 < passband < stopband < sampling_rate / 2``.
    attenuation : float, optional
        Least attenuation in the stop band, dB. The ripple in the pass band is the same in
        linear terms (0.009 dB at 60 dB).

    Returns
    -------
    ndarray
        An odd number of symmetric taps whose sum is one (unit gain at 0 Hz).

    Raises
    ------
    RequestError
        If the band edges are not in the stated order.

    Notes
    -----
    The paper's filter (section Instrumentation: pass 10 Hz, stop 10.75 Hz, 60 dB at 500 Hz) has
    about 2 400 taps.
    """
    positive("the sampling rate", sampling_rate, "Hz")
    if not 0 < passband < stopband < sampling_rate / 2:
        raise RequestError(
            f"a low-pass filter needs 0 < passband < stopband < half the sampling rate; received "
            f"passband {passband:g} Hz, stopband {stopband:g} Hz, half the sampling rate "
            f"{sampling_rate / 2:g} Hz. Lower the edges, or filter before resampling."
        )
    edges = (passband / sampling_rate, stopband / sampling_rate)
    for extra in range(7):  # Kaiser's formula is a fit, some 3 dB short for short filters
        taps = _kaiser_taps(edges, attenuation + extra)
        if _deviation(taps, edges) <= 10 ** (-attenuation / 20):
            break
    return taps


def _kaiser_taps(edges: tuple[float, float], attenuation: float) -> FloatArray:
    count, beta = scipy.signal.kaiserord(attenuation, 2 * (edges[1] - edges[0]))
    count += 1 - count % 2
    taps: FloatArray = scipy.signal.firwin(
        count, sum(edges) / 2, window=("kaiser", beta), fs=1.0, scale=True
    )
    return taps


def _deviation(taps: FloatArray, edges: tuple[float, float]) -> float:
    """Largest distance of the gain from one in the pass band and from zero in the stop band."""
    points = 64 * taps.size
    gain, frequency = np.abs(np.fft.rfft(taps, points)), np.fft.rfftfreq(points)
    at_edges = np.abs(np.exp(-2j * np.pi * np.outer(edges, np.arange(taps.size))) @ taps)
    passing = np.append(gain[frequency <= edges[0]], at_edges[0])
    stopped = np.append(gain[frequency >= edges[1]], at_edges[1])
    return float(max(np.abs(passing - 1).max(), stopped.max()))


def odd_extension(array: FloatArray, count: int) -> FloatArray:
    """Lengthen a series at both ends by its point reflections, keeping value and slope there.

    Series shorter than `count` are continued by their end values beyond the reflection.
    """
    reflected = min(count, array.shape[0] - 1)
    head = 2 * array[:1] - array[reflected:0:-1]
    tail = 2 * array[-1:] - array[-2 : -reflected - 2 : -1]
    rest = [(count - reflected, count - reflected)] + [(0, 0)] * (array.ndim - 1)
    return np.pad(np.concatenate([head, array, tail]), rest, mode="edge")


def low_pass(
    series: npt.ArrayLike,
    dt: float,
    passband: float,
    stopband: float | None = None,
    attenuation: float = 60.0,
) -> FloatArray:
    """Low-pass filter with linear phase, its delay compensated.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps.
    dt : float
        Time step, s.
    passband : float
        Edge of the pass band, Hz.
    stopband : float, optional
        Edge of the stop band, Hz; the default is 1.25 times `passband`.
    attenuation : float, optional
        Attenuation in the stop band, dB.

    Returns
    -------
    ndarray
        The filtered series, same shape. Within half a filter length of either end the result
        rests on a point reflection of the series.

    Raises
    ------
    RequestError
        If the series has gaps, or the band edges do not fit the time step.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 20, 0.01)
    >>> slow, fast = np.sin(2 * np.pi * 0.5 * t), np.sin(2 * np.pi * 8 * t)
    >>> out = low_pass(slow + fast, 0.01, passband=3.0, stopband=5.0)
    >>> bool(np.max(np.abs(out - slow)[200:-200]) < 2e-3)
    True
    """
    array = as_series(series)
    edge = 1.25 * passband if stopband is None else stopband
    taps = lowpass_taps(1.0 / positive("the time step", dt, "s"), passband, edge, attenuation)
    return apply_taps(array, taps)


def apply_taps(array: FloatArray, taps: FloatArray) -> FloatArray:
    """Filter along the first axis with symmetric taps, without delay and at unchanged length."""
    half = taps.size // 2
    extended = odd_extension(array, half)
    columns = taps.reshape((-1,) + (1,) * (array.ndim - 1))
    filtered: FloatArray = scipy.signal.oaconvolve(extended, columns, mode="valid", axes=0)
    return filtered
