"""Linear-phase filters whose delay is compensated.

All functions filter along the first axis, take one series or several side by side, and return an
array of the shape they were given.
"""

from __future__ import annotations

import math

import numpy as np
import scipy
from scipy import special

from seakeep.arrays import ArrayLike, FloatArray, as_series, number, positive, time_step
from seakeep.errors import DataError, RequestError
from seakeep.signals.time_axis import check_order, span_text, uniform_step


def lowpass_taps(
    sampling_rate: float, passband: float, stopband: float, attenuation: float = 60.0
) -> FloatArray:
    """Taps of a Kaiser-window low-pass filter that meets a specification.

    Parameters
    ----------
    sampling_rate : float
        Samples per second, Hz.
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
    positive(sampling_rate, "the sampling rate", "Hz")
    passband, stopband = number(passband, "passband"), number(stopband, "stopband")
    if not 0 < passband < stopband < sampling_rate / 2:
        raise RequestError(
            f"a low-pass filter needs 0 < passband < stopband < half the sampling rate; received "
            f"passband {passband:g} Hz, stopband {stopband:g} Hz, half the sampling rate "
            f"{sampling_rate / 2:g} Hz. Lower the edges, or filter before resampling."
        )
    low, high = passband / sampling_rate, stopband / sampling_rate
    for extra in range(7):  # Kaiser's formula is a fit, some 3 dB short for short filters
        count, beta = scipy.signal.kaiserord(attenuation + extra, 2 * (high - low))
        count += 1 - count % 2
        taps = scipy.signal.firwin(count, (low + high) / 2, window=("kaiser", beta), fs=1.0)
        # Distances of the gain from one in the pass band and from zero in the stop band.
        points = 64 * taps.size
        gain, frequency = np.abs(np.fft.rfft(taps, points)), np.fft.rfftfreq(points)
        at_low, at_high = np.abs(scipy.signal.freqz(taps, worN=(low, high), fs=1.0)[1])
        passing = np.append(gain[frequency <= low], at_low)
        stopped = np.append(gain[frequency >= high], at_high)
        if max(np.abs(passing - 1).max(), stopped.max()) <= 10 ** (-attenuation / 20):
            break
    return taps


def odd_extension(array: FloatArray, count: int) -> FloatArray:
    """Lengthen a series at both ends by its point reflections, keeping value and slope there.

    Series shorter than `count` are continued by their end values beyond the reflection.
    """
    reflected, beside = min(count, array.shape[0] - 1), [(0, 0)] * (array.ndim - 1)
    near = [(reflected, reflected), *beside]
    far = [(count - reflected, count - reflected), *beside]
    return np.pad(np.pad(array, near, mode="reflect", reflect_type="odd"), far, mode="edge")


def low_pass(
    series: ArrayLike,
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
        If the band edges do not fit the time step.
    DataError
        If the series has gaps.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 20, 0.01)
    >>> slow, fast = np.sin(2 * np.pi * 0.5 * t), np.sin(2 * np.pi * 8 * t)
    >>> out = low_pass(slow + fast, 0.01, passband=3.0, stopband=5.0)
    >>> bool(np.max(np.abs(out - slow)[200:-200]) < 2e-3)
    True
    """
    array = as_series(series, channels=True)
    edge = 1.25 * passband if stopband is None else stopband
    taps = lowpass_taps(1.0 / time_step(dt), passband, edge, attenuation)
    extended = odd_extension(array, taps.size // 2)  # so that length and phase are unchanged
    columns = taps.reshape((-1,) + (1,) * (array.ndim - 1))
    return scipy.signal.oaconvolve(extended, columns, mode="valid", axes=0)


PASSBAND = 0.8
"""Part of the lower Nyquist frequency up to which resampling keeps what there is."""


def resample(
    series: ArrayLike,
    time: ArrayLike,
    new_time: ArrayLike,
    attenuation: float = 60.0,
    anti_alias: bool = True,
) -> FloatArray:
    """Band-limited resampling of a uniform series onto another uniform time axis.

    Each new sample is a Kaiser-windowed sinc sum over the old ones. Its cut lies between
    0.8 times the lower of the two Nyquist frequencies and that frequency itself, so that
    going to a larger step does not alias; phase is kept, and constants are kept exactly.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps.
    time : array_like, shape (time,)
        Its instants, s.
    new_time : array_like, shape (new_time,)
        The instants wanted, s, uniform and inside the span of `time`.
    attenuation : float, optional
        Attenuation above the new Nyquist frequency, dB; less than 50 is taken as 50.
    anti_alias : bool, optional
        False cuts at the old Nyquist frequency: samples are taken as they are, and what lies
        above the new one is folded into the result, as in the paper's chain.

    Returns
    -------
    ndarray, shape (new_time,) or (new_time, channel)
        The series at the new instants. Where the instants coincide and the step is the same, the
        samples are returned untouched.

    Raises
    ------
    DataError
        If a time axis is not uniform, new instants lie outside the old span, or the series has
        gaps.

    Examples
    --------
    >>> import numpy as np
    >>> old, new = np.arange(0, 30, 0.01), np.arange(0, 29, 0.05)
    >>> out = resample(np.sin(old), old, new)
    >>> bool(np.max(np.abs(out - np.sin(new))[40:-40]) < 1e-3)
    True
    """
    array = as_series(series, channels=True)
    t, wanted = check_order(time, "the series"), check_order(new_time, "the new time axis")
    dt, new_dt = uniform_step(t, "the series"), uniform_step(wanted, "the new time axis")
    slack = 1e-6 * dt
    if wanted[0] < t[0] - slack or wanted[-1] > t[-1] + slack:
        raise DataError(
            f"new instants from {span_text(wanted[0], wanted[-1], dt)} lie outside the series, "
            f"which runs from {span_text(t[0], t[-1], dt)}. Shorten the new time axis."
        )
    position = (wanted - t[0]) / dt
    nearest = np.rint(position)
    if abs(new_dt - dt) < 1e-9 * dt and np.max(np.abs(position - nearest)) < 1e-6:
        return array[nearest.astype(int)]

    # The lower one, in cycles per old sample.
    nyquist = 0.5 * min(1.0, dt / new_dt if anti_alias else 1.0)
    return _sinc_sums(array, position, nyquist, attenuation)


PHASES = 256
"""Places between two samples at which the kernel is tabulated."""
AT_ONCE = 500_000
"""Weights formed at once: they stay in the processor's cache."""


def _sinc_sums(
    array: FloatArray, position: FloatArray, nyquist: float, attenuation: float
) -> FloatArray:
    """Low-passed values of a series between its samples.

    `position` counts in old samples; what lies above `nyquist` (cycles per sample) is stopped.
    """
    attenuation = max(positive(attenuation, "the attenuation", "dB"), 50.0)
    passed = PASSBAND * nyquist
    width = nyquist - passed
    half = math.ceil((attenuation - 7.95) / (4.57 * np.pi * width) + 1)  # by Kaiser's formula
    bank = _kernels(half, 0.1102 * (attenuation - 8.7), passed + nyquist)
    base = np.floor(position).astype(int)
    place = (position - base) * PHASES
    phase = np.minimum(place.astype(int), PHASES - 1)
    x = place - phase
    # Weights of the cubic through rows at -1, 0, 1 and 2 of the bank.
    cubic = np.stack(
        [
            -x * (x - 1) * (x - 2) / 6,
            (x + 1) * (x - 1) * (x - 2) / 2,
            -(x + 1) * x * (x - 2) / 2,
            (x + 1) * x * (x - 1) / 6,
        ]
    )
    columns = odd_extension(array, half).reshape(array.shape[0] + 2 * half, -1).T
    views = [
        np.lib.stride_tricks.sliding_window_view(np.ascontiguousarray(each), 2 * half)
        for each in columns
    ]
    out = np.empty((position.size, len(views)))
    rows_at_once = max(1, AT_ONCE // (2 * half))
    for first in range(0, position.size, rows_at_once):
        rows = slice(first, first + rows_at_once)
        weights = sum(cubic[each, rows, None] * bank[phase[rows] + each] for each in range(4))
        for column, view in enumerate(views):
            out[rows, column] = np.einsum("ij,ij->i", weights, view[base[rows] + 1])
    return out.reshape((position.size, *array.shape[1:]))


def _kernels(half: int, beta: float, band: float) -> FloatArray:
    """Kaiser-windowed sincs, row by row later by 1 / PHASES of a sample, the first by minus one.

    Each row sums to one, so that constants are kept, between the rows too. A cubic through four
    rows is the kernel to 1e-9: its fourth derivative is (2 pi 0.55)^4 / 5 at most.
    """
    lag = np.arange(-1, PHASES + 2)[:, None] / PHASES - np.arange(-half + 1, half + 1)
    inside = 1.0 - (lag / half) ** 2
    # Beyond its ends by a row, the window goes on analytically: I0(i y) is J0(y).
    window = np.where(
        inside >= 0,
        special.i0(beta * np.sqrt(np.maximum(inside, 0.0))),
        special.j0(beta * np.sqrt(np.maximum(-inside, 0.0))),
    )
    kernels = window * np.sinc(band * lag)
    return kernels / kernels.sum(axis=1, keepdims=True)
