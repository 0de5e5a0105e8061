"""Integrals, derivatives and envelopes of series, and the join of two sensors of one motion."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import scipy
from scipy import fft

from seakeep.arrays import (
    ArrayLike,
    BoolArray,
    ComplexArray,
    FloatArray,
    as_pair,
    as_series,
    time_step,
)
from seakeep.errors import RequestError
from seakeep.signals.time_axis import stretches

SHORTEST_RECORD = 0.05
"""Part of the slowest period kept that a record must last."""


def rising(place: FloatArray) -> FloatArray:
    """Raised cosine from 0 at places up to zero to 1 at those from one on."""
    return 0.5 - 0.5 * np.cos(np.pi * np.clip(place, 0.0, 1.0))


def autoregression(series: FloatArray, order: int, noise: float = 0.0) -> tuple[FloatArray, float]:
    """Filter that leaves the innovations of a series of zero mean, and their power.

    As if white noise of a part of its power were added to the series. The order is at most a third
    of the number of samples. The inverse of the filter is stable. The power is that in data that
    were not fitted, (n + p)/(n − p) times what is left (Akaike, 1970).

    Notes
    -----
    J. P. Burg, Maximum entropy spectral analysis (1975): each reflection coefficient minimises the
    sum of forward and backward prediction errors. All lie between −1 and 1.
    """
    order = max(1, min(order, series.size // 3))
    forward, backward, out = series[1:], series[:-1], np.zeros(order + 1)
    out[0], whole = 1.0, float(series @ series)
    left, floor = whole / series.size, np.finfo(float).eps * whole
    added = 2.0 * noise * left
    for place in range(order):
        power = float(forward @ forward + backward @ backward)
        # Below this errors are rounding: a pure tone needs two coefficients and gets no more.
        if power <= floor:
            break
        reflection = -2.0 * float(forward @ backward) / (power + added * forward.size)
        left *= 1.0 - reflection**2
        block = out[: place + 2]  # Levinson's recursion
        block += reflection * block[::-1]
        forward, backward = (
            (forward + reflection * backward)[1:],
            (backward + reflection * forward)[:-1],
        )
    return out, left * (series.size + order) / (series.size - order)


def continued(past: FloatArray, whitening: FloatArray, count: int) -> FloatArray:
    """The `count` values that are expected after a series of zero mean."""
    order = len(whitening) - 1
    state = -whitening[1:] @ scipy.linalg.toeplitz(past[: -order - 1 : -1], np.zeros(order))
    return scipy.signal.lfilter([1.0], whitening, np.zeros(count), zi=state)[0]


def predicted_extension(
    series: FloatArray, count: int, fitted: int, order: int, whole: int = 0
) -> FloatArray:
    """Lengthen a series at both ends by linear prediction from its own last samples.

    A record that stops in the middle of a wave is continued by waves, so that a filter with a
    long response is not fed a jump. The continuation fades out as a half cosine once it is `whole`
    samples long.
    """
    window = rising((count - np.arange(float(count))) / (count - whole + 1))
    series = np.ascontiguousarray(series)  # so that a channel has the same bits beside others
    before, after = (
        continued(each, autoregression(each, order)[0], count) * window
        for each in (series[::-1][-fitted:], series[-fitted:])
    )
    return np.concatenate([before[::-1], series, after])


def expected_in_gaps(series: FloatArray, lost: BoolArray) -> FloatArray:
    """Series with the values expected at its lost samples, given those on either side.

    A filter with a long response, such as a double integral, is then right beside a gap; after a
    curve that crosses the gap without waves it would be wrong for long.

    Notes
    -----
    A. J. E. M. Janssen, R. N. J. Veldhuis and L. B. Vries, Adaptive interpolation of discrete-time
    signals that can be modeled as autoregressive processes (1986): the values with the least
    squared innovations, of a process fitted to the longest stretch without loss, then to all.
    """
    if lost.all() or not lost.any():
        return series
    mean, gaps = series[~lost].mean(), stretches(lost)
    out = series - mean
    bounds = out[~lost].min(), out[~lost].max()
    order = min(4 * max(end - begin for begin, end in gaps), 2000)
    begin, end = max(stretches(~lost), key=lambda part: part[1] - part[0])
    # Without any noise, as in a simulation, waves seem to be known for good.
    noise = 1e-3 * out.std() * np.random.default_rng(0).standard_normal(out.size)
    for fitted in (slice(begin, max(end, begin + 16)), slice(None)):
        whitening = autoregression((out + noise)[fitted], order)[0]
        reach = whitening.size - 1
        weights = scipy.signal.oaconvolve(whitening, whitening[::-1])
        for first, after in gaps:
            out[first:after] = 0.0
            near = np.pad(out, reach)[first : after + 2 * reach]
            known = scipy.signal.oaconvolve(near, weights, mode="valid")
            own = np.pad(weights[reach:], (0, known.size))[: known.size]
            out[first:after] = scipy.linalg.solve_toeplitz(own, -known)
        out = np.clip(out, *bounds)  # tones fitted to a few waves resonate in a long gap
    return out + mean


def _transformed(
    series: FloatArray, dt: float, slowest: float, name: str
) -> tuple[FloatArray, ComplexArray, Callable[[ComplexArray], FloatArray]]:
    """Frequencies (Hz) and spectrum of a series continued at either end, and what takes it back.

    Refuses a frequency `slowest` (Hz) whose period is so long that eight of them, added to the
    record, take all memory.
    """
    lasts = dt * len(series)
    if slowest * lasts < SHORTEST_RECORD:
        raise RequestError(
            f"{name} ({slowest:g} Hz) has a period of {1 / slowest:g} s, and the record lasts "
            f"{lasts:g} s; at least {SHORTEST_RECORD:g} of a period is needed to separate "
            "it from a drift. Raise it, or give a longer record."
        )
    # Eight periods outlast the ringing of a flank there; a prediction needs to look back one and
    # a half of them to separate the slowest wave from a trend.
    padding = math.ceil(8.0 / (slowest * dt))
    order = min(math.ceil(1.6 / (slowest * dt)), 2000)
    extended = predicted_extension(series, padding, fitted=padding, order=order)
    frequency = fft.rfftfreq(len(extended), dt)

    def back(spectrum: ComplexArray) -> FloatArray:
        return fft.irfft(spectrum, n=len(extended))[padding:-padding]

    return frequency, fft.rfft(extended), back


def band_pass(series: ArrayLike, dt: float, band: tuple[float, float]) -> FloatArray:
    """Keep a band of frequencies, without phase shift.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps.
    dt : float
        Time step, s.
    band : (float, float)
        Lower and upper edge, Hz; the gain is one half there.

    Returns
    -------
    ndarray
        The series in the band, same shape and unit.

    Raises
    ------
    RequestError
        As :func:`integrate`, of which this is the case of no integration.
    """
    return integrate(series, dt, band, 0)


def integrate(
    series: ArrayLike, dt: float, band: tuple[float, float], times: int = 1
) -> FloatArray:
    r"""Integrate once or twice within a band of frequencies.

    The spectrum is divided by :math:`(i\omega)^n` inside the band and removed outside it, with
    raised-cosine flanks. Drift, offset and slow trends lie below the band and go; so does true
    motion that is slower than it. Before that, either end of the record is continued by linear
    prediction (Burg), because a record that stops in mid-wave otherwise spoils seconds of the
    integral.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps, such as an acceleration in m/s².
    dt : float
        Time step, s.
    band : (float, float)
        Lower and upper edge of the band kept, Hz; the gain is one half there.
    times : int, optional
        How often to integrate.

    Returns
    -------
    ndarray
        The integral, same shape; the unit is the series' times s, or s² where `times` is two.

    Raises
    ------
    RequestError
        If the band is empty, negative or above the Nyquist frequency.
    DataError
        If the series has gaps.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 60, 0.01)
    >>> omega = 2 * np.pi * 0.8
    >>> heave = integrate(-omega**2 * np.cos(omega * t) + 0.3, 0.01, (0.3, 5.0), times=2)
    >>> bool(np.max(np.abs(heave - np.cos(omega * t))) < 0.01)  # to the very ends
    True
    """
    array = as_series(series, minimum=4, channels=True)
    (low, high), nyquist = band, 0.5 / time_step(dt)
    if not 0 < low < high <= nyquist:
        raise RequestError(
            f"a band needs 0 < low < high, and high at most the Nyquist frequency ({nyquist:g} "
            f"Hz); received ({low:g}, {high:g}) Hz. The lower edge keeps drift out: set it below "
            "the slowest wave and above the drift."
        )

    def integral(x: FloatArray) -> FloatArray:
        centred = x - x.mean()
        frequency, spectrum, back = _transformed(centred, dt, low, "the lower edge of the band")
        # The lower flank is half the lower edge wide, the upper one a fifth of the upper edge.
        gain = rising((frequency - 0.75 * low) / (0.5 * low))
        gain *= rising((1.1 * high - frequency) / (0.2 * high))
        omega = 2 * np.pi * np.where(gain > 0, frequency, 1.0)
        return back(spectrum * (gain / (1j * omega) ** times))

    return np.apply_along_axis(integral, 0, array)


def differentiate(series: ArrayLike, dt: float) -> FloatArray:
    """First derivative by fourth-order central differences.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray
        The derivative, same shape. The first and last two samples use one-sided formulas of the
        same order, which have six times the noise of the inner ones.

    Raises
    ------
    DataError
        If the series has gaps or fewer than five samples.

    Notes
    -----
    The paper's section Motion measurements takes the pitch acceleration this way. The error of
    the inner samples is dt⁴ f⁗′/30.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 1, 0.1)
    >>> bool(np.allclose(differentiate(t**4, 0.1), 4 * t**3))
    True
    """
    x, step = as_series(series, minimum=5, channels=True), time_step(dt)
    # The slope of the quartic through five samples: a filter of Savitzky and Golay.
    return scipy.signal.savgol_filter(x, 5, 4, deriv=1, delta=step, axis=0)


def envelope_squared(series: ArrayLike, dt: float) -> FloatArray:
    r"""Squared envelope of a narrow-banded series, :math:`|x + i\,\mathcal H x|^2`.

    The slow part of the squared wave elevation, to which mean drift and slow drift are
    proportional, is half of it.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps; its mean is removed first.
    dt : float
        Time step, s.

    Returns
    -------
    ndarray
        The squared envelope, same shape; the unit is the square of the series'.

    Raises
    ------
    DataError
        If the series has gaps.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 100, 0.05)
    >>> envelope = envelope_squared(0.2 * np.sin(2 * np.pi * 0.6 * t), 0.05)
    >>> bool(np.max(np.abs(envelope - 0.04)[500:-500]) < 2e-3)
    True
    """
    array = as_series(series, minimum=4, channels=True)
    time_step(dt)
    array = array - array.mean(axis=0)
    padding = array.shape[0] - 1
    extended = np.concatenate([array[:0:-1], array, array[-2::-1]])
    return np.abs(scipy.signal.hilbert(extended, axis=0)[padding:-padding]) ** 2


def complementary_filter(
    position: ArrayLike,
    acceleration: ArrayLike,
    dt: float,
    crossover: float,
    times: int = 1,
) -> FloatArray:
    r"""Integrate an acceleration, its slow part replaced by that of a measured position.

    An integrated acceleration drifts; a tracked position is noisy where it moves fast. With a
    raised-cosine weight w that falls from one to zero about the crossover, the spectrum of the
    result is :math:`w\,(i\omega)^{2-n} X + (1 - w)\,A / (i\omega)^n`: no drift has to be removed,
    because none is integrated, and slow motion that is true stays.

    Parameters
    ----------
    position : array_like, shape (time,)
        Measured position, m (or an angle, rad).
    acceleration : array_like, shape (time,)
        Measured acceleration in the same direction, of the same point.
    dt : float
        Time step, s.
    crossover : float
        Frequency at which both count half, Hz: below the waves, above the drift of the
        acceleration. The change runs from 0.75 to 1.25 times it.
    times : {1, 2}, optional
        How often to integrate: 1 gives the rate, 2 the position.

    Returns
    -------
    ndarray, shape (time,)
        Rate or position; the position keeps the mean of `position`.

    Raises
    ------
    RequestError
        If the series differ in length, or the crossover does not fit.
    DataError
        If a series has gaps.

    Notes
    -----
    A pair of complementary filters. Either end is continued by linear prediction, as in
    :func:`seakeep.signals.integrate`.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 120, 0.05)
    >>> slow, fast = 2 * np.pi / 30, 2 * np.pi * 0.6
    >>> x = np.sin(slow * t) + 0.1 * np.cos(fast * t)
    >>> a = -(slow**2) * np.sin(slow * t) - 0.1 * fast**2 * np.cos(fast * t) + 0.2  # and an offset
    >>> rate = slow * np.cos(slow * t) - 0.1 * fast * np.sin(fast * t)
    >>> bool(np.max(np.abs(complementary_filter(x, a, 0.05, 0.2) - rate)[100:-100]) < 0.01)
    True
    """
    if times not in (1, 2):
        raise RequestError(
            f"complementary_filter gives a rate or a position: times is 1 or 2; received {times!r}."
        )
    x, a = as_pair(position, acceleration, minimum=8)
    nyquist = 0.5 / time_step(dt)
    if not 0 < crossover < 0.8 * nyquist:
        raise RequestError(
            f"the crossover must lie between 0 and {0.8 * nyquist:g} Hz (0.8 of the Nyquist "
            f"frequency); received {crossover:g} Hz. Set it below the slowest wave."
        )
    at = np.arange(x.size) - 0.5 * (x.size - 1)
    slope = at @ x / (at @ at)
    trend = x.mean() + slope * at
    (frequency, position, back), (_, acceleration, _) = (
        _transformed(each, dt, crossover, "the crossover") for each in (x - trend, a - a.mean())
    )
    fast = rising((frequency / crossover - 0.75) / 0.5)
    omega = 2j * np.pi * frequency
    integral = acceleration / np.where(frequency > 0, omega, 1.0) ** times
    joined = back((1 - fast) * omega ** (2 - times) * position + fast * integral)
    return joined + (slope / dt if times == 1 else trend)
