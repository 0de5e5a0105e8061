r"""Channels derived from measured ones: integrals, derivatives, envelopes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import fft

from seakeep.errors import RequestError
from seakeep.signals.filters import as_series, positive

__all__ = ["differentiate", "envelope_squared", "integrate"]

FloatArray = npt.NDArray[np.float64]


def band_gain(
    frequency: FloatArray, band: tuple[float, float], transition: float = 0.25
) -> FloatArray:
    """Gain of a band with raised-cosine flanks of `transition` times each edge outside it."""
    low, high = band
    below = np.clip((frequency - (1 - transition) * low) / (transition * low), 0.0, 1.0)
    above = np.clip(((1 + transition) * high - frequency) / (transition * high), 0.0, 1.0)
    gain: FloatArray = np.sin(0.5 * np.pi * below) ** 2 * np.sin(0.5 * np.pi * above) ** 2
    return gain


def _filtered(array: FloatArray, dt: float, transfer: FloatArray, padding: int) -> FloatArray:
    # Mirrored, not point-reflected: a reflection about the end value would shift the mean.
    extended = np.pad(array, [(padding, padding)] + [(0, 0)] * (array.ndim - 1), mode="reflect")
    shape = (-1,) + (1,) * (array.ndim - 1)
    spectrum = fft.rfft(extended, axis=0) * transfer.reshape(shape)
    out: FloatArray = fft.irfft(spectrum, n=extended.shape[0], axis=0)
    return out[padding : padding + array.shape[0]]


def integrate(
    series: npt.ArrayLike, dt: float, band: tuple[float, float], times: int = 1
) -> FloatArray:
    r"""Integrate once or twice within a band of frequencies.

    The spectrum is divided by :math:`(i\omega)^n` inside the band and removed outside it, with
    raised-cosine flanks a quarter of each edge wide. Drift, offset and slow trends lie below the
    band and go; so does true motion that is slower than it.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps, such as an acceleration in m/s².
    dt : float
        Time step, s.
    band : (float, float)
        Lower and upper edge of the band kept, Hz.
    times : {1, 2}, optional
        How often to integrate.

    Returns
    -------
    ndarray
        The integral, same shape, its mean zero; the unit is the series' times s or s².

    Raises
    ------
    RequestError
        If the band is empty, negative or above the Nyquist frequency, or the series has gaps.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 60, 0.01)
    >>> omega = 2 * np.pi * 0.8
    >>> heave = integrate(-omega**2 * np.cos(omega * t) + 0.3, 0.01, (0.3, 5.0), times=2)
    >>> bool(np.max(np.abs(heave - np.cos(omega * t))[2000:-2000]) < 0.02)
    True
    """
    array = as_series(series, minimum=4)
    low, high = band
    if times not in (1, 2):
        raise RequestError(f"integrate once or twice: times must be 1 or 2; received {times!r}.")
    nyquist = 0.5 / positive("the time step", dt, "s")
    if not 0 < low < high <= nyquist:
        raise RequestError(
            f"an integration band needs 0 < low < high, and high at most the Nyquist frequency "
            f"({nyquist:g} Hz); received ({low:g}, {high:g}) Hz. The lower edge keeps drift out: "
            "set it below the slowest wave and above the drift."
        )
    # The flank of the band rings for about the inverse of its width.
    padding = min(array.shape[0] - 1, int(np.ceil(4.0 / (0.25 * low * dt))))
    count = array.shape[0] + 2 * padding
    frequency = fft.rfftfreq(count, dt)
    omega = 2 * np.pi * np.maximum(frequency, 0.5 * low)
    transfer = band_gain(frequency, (low, high)) / (1j * omega) ** times
    return _filtered(array - array.mean(axis=0), dt, transfer, padding)


def differentiate(series: npt.ArrayLike, dt: float) -> FloatArray:
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
        same order.

    Raises
    ------
    RequestError
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
    x = as_series(series, minimum=5)
    step = positive("the time step", dt, "s")
    out = np.empty_like(x)
    out[2:-2] = (x[:-4] - 8 * x[1:-3] + 8 * x[3:-1] - x[4:]) / 12
    first = np.array([-25.0, 48, -36, 16, -3]) / 12
    second = np.array([-3.0, -10, 18, -6, 1]) / 12
    out[0], out[1] = np.tensordot(first, x[:5], 1), np.tensordot(second, x[:5], 1)
    out[-1] = -np.tensordot(first[::-1], x[-5:], 1)
    out[-2] = -np.tensordot(second[::-1], x[-5:], 1)
    return out / step


def envelope_squared(series: npt.ArrayLike, dt: float) -> FloatArray:
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
    RequestError
        If the series has gaps.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 100, 0.05)
    >>> envelope = envelope_squared(0.2 * np.sin(2 * np.pi * 0.6 * t), 0.05)
    >>> bool(np.max(np.abs(envelope - 0.04)[500:-500]) < 2e-3)
    True
    """
    array = as_series(series, minimum=4)
    positive("the time step", dt, "s")
    array = array - array.mean(axis=0)
    padding = array.shape[0] - 1
    count = array.shape[0] + 2 * padding
    frequency = fft.rfftfreq(count)
    quadrature = _filtered(array, dt, np.where(frequency > 0, -1j, 0.0), padding)
    squared: FloatArray = array**2 + quadrature**2
    return squared
