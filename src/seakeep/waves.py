r"""Linear gravity waves in water of constant depth.

The dispersion relation is :math:`\omega^2 = g k \tanh(k h)`. Frequencies are angular (rad/s),
lengths in metres; all functions take scalars or arrays and broadcast.
"""

from __future__ import annotations

import numpy as np

from seakeep.arrays import ArrayLike, FloatArray, as_real, undefined
from seakeep.errors import RequestError

__all__ = ["GRAVITY", "group_speed", "phase_speed", "wavelength_to_frequency", "wavenumber"]

GRAVITY = 9.81
"""Acceleration of gravity, m/s²."""


def _checked(
    name: str, value: ArrayLike, depth: ArrayLike, positive: bool = False
) -> tuple[FloatArray, FloatArray]:
    """A quantity that is zero or positive, beside the water depth at which it is wanted."""
    array, h = as_real(value, name), as_real(depth, "the water depth")
    if not np.all((array >= 0) & np.isfinite(array)) or (positive and not array.all()):
        raise RequestError(
            f"{name} must be {'positive' if positive else 'zero or positive, and finite'}; "
            f"received {value!r}. Check its sign and unit (rad/s for frequencies, m for lengths)."
        )
    if not np.all(h > 0):
        raise RequestError(
            f"the water depth must be positive; received {depth!r}. Give it in metres."
        )
    one, other = np.broadcast_arrays(array, h)
    return one, other


def wavenumber(frequency: ArrayLike, depth: ArrayLike = np.inf) -> FloatArray:
    r"""Wavenumber of the linear dispersion relation.

    Solves :math:`\omega^2 = g k \tanh(k h)` by Newton's method to rounding.

    Parameters
    ----------
    frequency : array_like
        Angular frequency ω, rad/s, zero or positive.
    depth : array_like, optional
        Water depth h, m; ``numpy.inf`` (the default) for deep water.

    Returns
    -------
    ndarray
        Wavenumber k, rad/m, in the broadcast shape of the arguments.

    Raises
    ------
    RequestError
        If a frequency is negative or not a number, or the depth is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> k = wavenumber(2 * np.pi * 0.86, depth=3.6)
    >>> round(float(2 * np.pi / k), 2)  # wavelength in metres
    2.11
    """
    omega, h = _checked("the frequency", frequency, depth)
    deep = omega**2 / GRAVITY
    k = np.array(deep, float)
    finite = np.isfinite(h) & (omega > 0)
    # In units of the depth: x tanh x = y. The start value is within 5 % for every y.
    y = deep[finite] * h[finite]
    x = np.maximum(np.sqrt(y), y)
    for _ in range(50):
        tanh = np.tanh(x)
        step = (x * tanh - y) / (tanh + x * (1.0 - tanh**2))
        x = x - step
        if np.all(np.abs(step) <= 4 * np.finfo(float).eps * x):
            break
    k[finite] = x / h[finite]
    return k


def phase_speed(frequency: ArrayLike, depth: ArrayLike = np.inf) -> FloatArray:
    r"""Phase speed :math:`c = \omega / k`, m/s; at ω = 0 its limit :math:`\sqrt{g h}`.

    Parameters
    ----------
    frequency : array_like
        Angular frequency, rad/s.
    depth : array_like, optional
        Water depth, m.

    Returns
    -------
    ndarray
        Phase speed, m/s.

    Raises
    ------
    RequestError
        As :func:`wavenumber`.
    """
    omega, h = _checked("the frequency", frequency, depth)
    k = wavenumber(omega, h)
    with undefined():
        return np.where(omega > 0, omega / k, np.sqrt(GRAVITY * h))


def group_speed(frequency: ArrayLike, depth: ArrayLike = np.inf) -> FloatArray:
    r"""Group speed :math:`c_g = \frac{c}{2}\left(1 + \frac{2kh}{\sinh 2kh}\right)`, m/s.

    Parameters
    ----------
    frequency : array_like
        Angular frequency, rad/s.
    depth : array_like, optional
        Water depth, m.

    Returns
    -------
    ndarray
        Group speed, m/s.

    Raises
    ------
    RequestError
        As :func:`wavenumber`.
    """
    omega, h = _checked("the frequency", frequency, depth)
    two_kh = np.where(omega > 0, 2.0 * wavenumber(omega, h) * np.where(omega > 0, h, 1.0), 0)
    # sinh overflows where the ratio has long been zero: 2kh/sinh(2kh) < 1e-300 for 2kh > 700.
    bounded = np.clip(two_kh, 1e-12, 700.0)
    ratio = np.where(two_kh > 700.0, 0.0, bounded / np.sinh(bounded))
    return 0.5 * phase_speed(omega, h) * (1.0 + ratio)


def wavelength_to_frequency(wavelength: ArrayLike, depth: ArrayLike = np.inf) -> FloatArray:
    r"""Angular frequency of a wave of given length, :math:`\omega = \sqrt{g k \tanh k h}`.

    Parameters
    ----------
    wavelength : array_like
        Wavelength λ = 2π/k, m, positive.
    depth : array_like, optional
        Water depth, m.

    Returns
    -------
    ndarray
        Angular frequency, rad/s.

    Raises
    ------
    RequestError
        If a wavelength or depth is not positive.
    """
    length, h = _checked("the wavelength", wavelength, depth, positive=True)
    k = 2.0 * np.pi / length
    return np.sqrt(GRAVITY * k * np.tanh(k * h))
