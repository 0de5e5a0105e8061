r"""Elevation carried from the place where it was measured to another one, which may move.

A record at x is a sum of waves; at x + d it is the same sum with each wave turned by
:math:`e^{-i k(\omega) d}`. Waves run downstream, towards +x, so that a positive distance delays
them. The wavenumber follows linear dispersion, or one celerity c for all frequencies,
:math:`k = \omega/c` (the paper's section System identification setup,
:math:`\eta(t) = \eta_{kn}(t - d(t)/c)`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy import fft, special

from seakeep.errors import DataError, RequestError
from seakeep.signals.derive import predicted_extension
from seakeep.signals.filters import as_series, positive
from seakeep.waves import group_speed, wavenumber

__all__ = [
    "CarriedElevation",
    "band_limit",
    "carry_by_celerity",
    "carry_by_dispersion",
    "delay_by_celerity",
    "delay_by_dispersion",
]

FloatArray = npt.NDArray[np.float64]

WAVE_SHARE = 0.999
"""Waves are what lies below the frequency that holds this part of a record's variance."""

MOST_TERMS = 4000


@dataclass(frozen=True, eq=False)
class CarriedElevation:
    """A record ready to be read at any distance within a range.

    Parameters
    ----------
    lowest, highest : float
        The range of distances, m, positive downstream.
    terms : ndarray, shape (term, time, channel)
        Coefficients of Chebyshev polynomials in the distance, sample by sample.
    """

    lowest: float
    highest: float
    terms: FloatArray = field(repr=False)

    def at(self, distance: npt.ArrayLike, sample: int | slice = slice(None)) -> FloatArray:
        """Elevation at a distance from where it was measured.

        Parameters
        ----------
        distance : array_like, scalar or shape (samples,)
            Distance at each of the samples, m; taken to the nearest end where it lies outside the
            range.
        sample : int or slice, optional
            Samples wanted.

        Returns
        -------
        ndarray, shape (channel,) for one sample, else (samples, channel)
            The elevation, in the unit of the record.
        """
        chosen = self.terms[:, sample]
        half = 0.5 * (self.highest - self.lowest)
        place = np.asarray(distance, dtype=float) - 0.5 * (self.highest + self.lowest)
        scaled = np.clip(place / half, -1.0, 1.0) if half > 0 else np.zeros_like(place)
        if chosen.ndim == 2 and not scaled.ndim:  # one sample: the sum itself is quicker
            polynomials = np.cos(np.arange(len(chosen)) * np.arccos(scaled))
            one: FloatArray = polynomials @ chosen
            return one
        x = scaled[:, None] if scaled.ndim and chosen.ndim == 3 else scaled
        # Clenshaw's recurrence from the highest polynomial down.
        newer, older = np.zeros_like(chosen[0]), np.zeros_like(chosen[0])
        for term in chosen[:0:-1]:
            newer, older = term + 2.0 * x * newer - older, newer
        result: FloatArray = chosen[0] + x * newer - older
        return result


def band_limit(series: npt.ArrayLike, dt: float, share: float = WAVE_SHARE) -> float:
    """Frequency below which a given part of a record's variance lies.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Uniformly sampled series without gaps; channels are judged together.
    dt : float
        Time step, s.
    share : float, optional
        Part of the variance.

    Returns
    -------
    float
        The frequency, Hz.

    Raises
    ------
    DataError
        If the series is constant.
    """
    array = as_series(series)
    flat = array.reshape(array.shape[0], -1)
    # Tapered, since a wave that the record's end cuts would leak into all frequencies.
    taper = np.hanning(flat.shape[0] + 2)[1:-1, None]
    power = np.abs(fft.rfft(taper * (flat - flat.mean(axis=0)), axis=0)) ** 2
    grown = np.cumsum(power.sum(axis=1))
    if not grown[-1] > 0:
        raise DataError(
            "the elevation is constant: there are no waves in it. Look for a dead probe."
        )
    frequency = fft.rfftfreq(flat.shape[0], positive("the time step", dt, "s"))
    return float(frequency[np.searchsorted(grown, share * grown[-1])])


def carry_by_dispersion(
    series: npt.ArrayLike,
    dt: float,
    distances: tuple[float, float],
    depth: float,
    highest_frequency: float | None = None,
) -> CarriedElevation:
    """Prepare a record to be carried frequency by frequency, by linear dispersion.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Elevation, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    distances : (float, float)
        Range of distances that may be asked for, m, positive downstream.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.
    highest_frequency : float, optional
        Highest frequency that obeys the dispersion relation, Hz; above it lie noise and bound
        crests, whose wavenumber goes on along the tangent. By default :func:`band_limit` of the
        series.

    Returns
    -------
    CarriedElevation
        To be read at any distance in the range.

    Raises
    ------
    RequestError
        If an argument is out of range or the series has gaps.
    DataError
        If the series is constant.
    """
    array = as_series(series, minimum=4)
    limit = band_limit(array, dt) if highest_frequency is None else highest_frequency
    edge = 2 * np.pi * positive("the highest frequency", limit, "Hz")

    def numbers(omega: FloatArray) -> FloatArray:
        beyond = np.maximum(omega - edge, 0.0) / group_speed(edge, depth)
        result: FloatArray = wavenumber(np.minimum(omega, edge), depth) + beyond
        return result

    return _carried(array, dt, distances, numbers)


def carry_by_celerity(
    series: npt.ArrayLike, dt: float, distances: tuple[float, float], celerity: float
) -> CarriedElevation:
    """Prepare a record to be carried at one celerity.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Elevation, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    distances : (float, float)
        Range of distances that may be asked for, m, positive downstream.
    celerity : float
        Speed of the waves, m/s.

    Returns
    -------
    CarriedElevation
        To be read at any distance in the range.

    Raises
    ------
    RequestError
        If an argument is out of range or the series has gaps.
    """
    speed = positive("the celerity", celerity, "m/s")
    return _carried(as_series(series, minimum=4), dt, distances, lambda omega: omega / speed)


def delay_by_dispersion(
    series: npt.ArrayLike,
    dt: float,
    distance: npt.ArrayLike,
    depth: float,
    highest_frequency: float | None = None,
) -> FloatArray:
    """Carry an elevation to a place at a distance, fixed or moving, by linear dispersion.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Elevation, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    distance : array_like, scalar or shape (time,)
        Distance of the place from the probe at each sample, m, positive downstream.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.
    highest_frequency : float, optional
        As in :func:`carry_by_dispersion`.

    Returns
    -------
    ndarray
        Elevation at the place, same shape and unit.

    Raises
    ------
    RequestError
        If an argument is out of range, or the series or the distance has gaps.
    DataError
        If the series is constant.

    Notes
    -----
    The record is continued by linear prediction at either end. What was at the probe before the
    record began reaches a place downstream later: the first d/c_g seconds are a guess there, and
    the last ones upstream.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 60, 0.05)
    >>> omega, k = 3.0, 3.0**2 / 9.81
    >>> carried = delay_by_dispersion(np.cos(omega * t), 0.05, 2.0, depth=np.inf)
    >>> bool(np.max(np.abs(carried - np.cos(omega * t - 2.0 * k))) < 3e-3)
    True
    """
    array = as_series(series, minimum=4)
    places = _distances(distance, array.shape[0])
    span = (float(places.min()), float(places.max()))
    carried = carry_by_dispersion(array, dt, span, depth, highest_frequency)
    return carried.at(places).reshape(array.shape)


def delay_by_celerity(
    series: npt.ArrayLike, dt: float, distance: npt.ArrayLike, celerity: float
) -> FloatArray:
    r"""Delay an elevation by the time waves of one celerity take, :math:`\eta(t - d(t)/c)`.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel)
        Elevation, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    distance : array_like, scalar or shape (time,)
        Distance of the place from the probe at each sample, m, positive downstream.
    celerity : float
        Speed of the waves, m/s.

    Returns
    -------
    ndarray
        Elevation at the place, same shape and unit; band-limited between samples.

    Raises
    ------
    RequestError
        As :func:`delay_by_dispersion`.
    """
    array = as_series(series, minimum=4)
    places = _distances(distance, array.shape[0])
    span = (float(places.min()), float(places.max()))
    return carry_by_celerity(array, dt, span, celerity).at(places).reshape(array.shape)


def _distances(distance: npt.ArrayLike, samples: int) -> FloatArray:
    places = np.asarray(distance, dtype=float)
    if places.shape not in ((), (samples,)):
        raise RequestError(
            f"the distance has shape {places.shape}; expected one number, or one a sample: "
            f"({samples},)."
        )
    if not np.all(np.isfinite(places)):
        raise RequestError(
            f"the distance holds {int(np.sum(~np.isfinite(places)))} values that are not finite. "
            "Fill the gap in the position first."
        )
    return places


def _carried(
    array: FloatArray,
    dt: float,
    distances: tuple[float, float],
    numbers: Callable[[FloatArray], FloatArray],
) -> CarriedElevation:
    """Expand the waves in the distance (Jacobi and Anger's expansion of a plane wave).

    exp(−ik(d₀ + hξ)) = exp(−ikd₀) Σ (2 − δ_p0) (−i)^p J_p(kh) T_p(ξ)
    """
    step = positive("the time step", dt, "s")
    lowest, highest = (float(value) for value in distances)
    if not (np.isfinite(lowest) and np.isfinite(highest) and lowest <= highest):
        raise RequestError(
            f"distances must be a range (lowest, highest) in metres; received {distances!r}."
        )
    flat = array.reshape(array.shape[0], -1)
    mean = flat.mean(axis=0)
    centre, half = 0.5 * (lowest + highest), 0.5 * (highest - lowest)
    # The slowest energy of interest travels at half the lowest phase speed.
    top = float(numbers(np.array([np.pi / step]))[0])
    farthest = max(abs(lowest), abs(highest))
    delay = 2.0 * farthest * top * step / np.pi
    period = 1.0 / max(band_limit(flat, step, 0.5), 2.0 / (flat.shape[0] * step))
    extended, padding = _continued(flat - mean, delay / step, period / step)
    size = fft.next_fast_len(extended.shape[0], real=True)
    spectrum = fft.rfft(extended, n=size, axis=0)
    k = numbers(2 * np.pi * fft.rfftfreq(size, step))
    reach = float(k[-1]) * half
    # Bessel functions of order p fall below 1e-9 from here on.
    count = int(np.ceil(reach + 8.0 * np.cbrt(reach) + 9.0)) if half > 0 else 1
    if count > MOST_TERMS:
        raise RequestError(
            f"distances from {lowest:g} to {highest:g} m span {reach / np.pi:.0f} of the shortest "
            f"wavelengths that a step of {step:g} s resolves. Resample the elevation to some 30 "
            "samples a wave period first."
        )
    turned = spectrum * np.exp(-1j * k * centre)[:, None]
    terms = np.empty((count, *flat.shape))
    for order in range(count):
        factor = (1 if order == 0 else 2) * (-1j) ** order * special.jv(order, k * half)
        record = fft.irfft(turned * factor[:, None], n=size, axis=0)
        terms[order] = record[padding : padding + flat.shape[0]]
    terms[0] += mean
    return CarriedElevation(lowest, highest, terms)


def _continued(deviations: FloatArray, delay: float, period: float) -> tuple[FloatArray, int]:
    """Lengthen at both ends by predicted waves that fade out once no delay reaches them."""
    kept, fading = int(np.ceil(delay + period)), int(np.ceil(4.0 * period))
    order = min(int(np.ceil(2.0 * period)), 500)
    padding = kept + fading
    extended = predicted_extension(
        deviations, padding, fitted=max(8 * order, 64), order=order, fade=False
    )
    fade = 0.5 * (1.0 + np.cos(np.pi * np.arange(1, fading + 1) / (fading + 1)))
    extended[padding + deviations.shape[0] + kept :] *= fade[:, None]
    extended[:fading] *= fade[::-1, None]
    return extended, padding
