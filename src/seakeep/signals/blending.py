"""Rate or position from two sensors: one that knows the slow part, one that knows the fast."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy import fft

from seakeep.errors import RequestError
from seakeep.signals.derive import predicted_extension
from seakeep.signals.filters import as_series, positive

__all__ = ["blend"]

FloatArray = npt.NDArray[np.float64]


def blend(
    position: npt.ArrayLike,
    acceleration: npt.ArrayLike,
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
        If the series differ in length or have gaps, or the crossover does not fit.

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
    >>> bool(np.max(np.abs(blend(x, a, 0.05, 0.2) - rate)[100:-100]) < 0.01)
    True
    """
    if times not in (1, 2):
        raise RequestError(
            f"blend gives a rate or a position: times is 1 or 2; received {times!r}."
        )
    x, a = as_series(position, minimum=8), as_series(acceleration, minimum=8)
    if x.shape != a.shape or x.ndim != 1:
        raise RequestError(
            f"position and acceleration must be one channel each, of one length; received shapes "
            f"{x.shape} and {a.shape}."
        )
    nyquist = 0.5 / positive("the time step", dt, "s")
    if not 0 < crossover < 0.8 * nyquist:
        raise RequestError(
            f"the crossover must lie between 0 and {0.8 * nyquist:g} Hz (0.8 of the Nyquist "
            f"frequency); received {crossover:g} Hz. Set it below the slowest wave."
        )
    padding = int(np.ceil(8.0 / (crossover * dt)))
    order = min(int(np.ceil(1.6 / (crossover * dt))), 2000)
    mean, trend = _line(x)
    both = np.column_stack([x - trend, a - a.mean()])
    long = predicted_extension(both, padding, fitted=padding, order=order)
    frequency = fft.rfftfreq(long.shape[0], dt)
    spectrum = fft.rfft(long, axis=0)
    weight = 0.5 + 0.5 * np.cos(np.pi * np.clip((frequency / crossover - 0.75) / 0.5, 0.0, 1.0))
    omega = 2j * np.pi * frequency
    safe = np.where(frequency > 0, omega, 1.0)
    slow = spectrum[:, 0] * (omega if times == 1 else 1.0)
    fast = np.where(weight < 1, spectrum[:, 1] / safe**times, 0.0)
    joined = fft.irfft(weight * slow + (1 - weight) * fast, n=long.shape[0])
    out: FloatArray = joined[padding : padding + x.size]
    return out + (mean / dt if times == 1 else trend)


def _line(x: FloatArray) -> tuple[float, FloatArray]:
    """Slope a sample and values of the straight line through a series."""
    at = np.arange(x.size) - 0.5 * (x.size - 1)
    slope = float(at @ x / (at @ at))
    return slope, x.mean() + slope * at
