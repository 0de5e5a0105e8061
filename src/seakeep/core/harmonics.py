r"""Regular waves: amplitude and phase of a response by least squares, and how sure they are.

The uncertainty follows ITTC 7.5-02-07-02.1 (seakeeping experiments) and the guide that it rests on
(JCGM 100:2008): type A from windows of whole periods, type B from the accuracy of the instruments,
an expanded uncertainty at 95 % with the degrees of freedom by Welch and Satterthwaite.
"""

from typing import NamedTuple

import numpy as np
from scipy import optimize, stats

from seakeep.arrays import ComplexArray, FloatArray, undefined
from seakeep.errors import DataError

MOST = 10
"""Windows of a record: more would hold too few periods each."""
LEAST = 3
"""Periods of a window, and windows of a record, at least."""
COVERAGE = 0.95


class Estimate(NamedTuple):
    """Mean of complex ratios over windows, with expanded uncertainties at 95 %.

    Attributes
    ----------
    ratio : ndarray of complex, shape (channel,)
        Response over reference.
    amplitude : ndarray, shape (channel,)
        Expanded uncertainty of its modulus.
    phase : ndarray, shape (channel,)
        Expanded uncertainty of its phase, rad.
    """

    ratio: ComplexArray
    amplitude: FloatArray
    phase: FloatArray


def dominant_frequency(series: FloatArray, dt: float) -> float:
    """Frequency of a regular wave, Hz: where a sine fits best by least squares.

    Parameters
    ----------
    series : ndarray, shape (time,)
        A record of several periods.
    dt : float
        Time step, s.

    Returns
    -------
    float

    Raises
    ------
    DataError
        If the record is constant.

    Examples
    --------
    >>> t = np.arange(1200) * 0.05
    >>> round(dominant_frequency(np.sin(2 * np.pi * 0.8586 * t), 0.05), 6)
    0.8586
    """
    x = series - series.mean()
    if not np.any(np.abs(x) > 1e-12 * np.abs(series).max(initial=0.0)):
        raise DataError("the record is constant: it has no frequency. Look for a dead probe.")
    spectrum = np.abs(np.fft.rfft(x * np.hanning(x.size), 4 * x.size))
    coarse, width = np.argmax(spectrum) / (4 * x.size * dt), 1.0 / (x.size * dt)
    time = dt * np.arange(x.size)

    def unexplained(frequency: float) -> float:
        basis = _basis(time, frequency)
        return float(np.linalg.lstsq(basis, x, rcond=None)[1].sum())

    low = max(coarse - 0.5 * width, 0.1 * width)
    peak = optimize.minimize_scalar(
        unexplained, bounds=(low, coarse + 0.5 * width), method="bounded",
        options={"xatol": 1e-7 * coarse},
    )  # fmt: skip
    return float(peak.x)


def harmonic_fits(
    values: FloatArray, dt: float, frequency: float
) -> tuple[ComplexArray, FloatArray]:
    r"""Fit mean, trend and first harmonic in windows of whole periods.

    Parameters
    ----------
    values : ndarray, shape (time, channel)
        Records without gaps.
    dt : float
        Time step, s.
    frequency : float
        Of the wave, Hz.

    Returns
    -------
    harmonics : ndarray of complex, shape (window, channel)
        h of :math:`\mathrm{Re}(h\,e^{i\omega t})`, time counted from the start of the record.
    means : ndarray, shape (window, channel)
        Mean over each window.

    Raises
    ------
    DataError
        If the record has fewer than three windows of three periods.
    """
    periods = int(len(values) * dt * frequency + 1e-9)
    count = min(MOST, periods // LEAST)
    if count < LEAST:
        raise DataError(
            f"the record holds {len(values) * dt * frequency:.1f} periods of the wave "
            f"({1 / frequency:.3g} s); its scatter takes {LEAST * LEAST} or more. Record longer."
        )
    length = (periods // count) / (frequency * dt)
    harmonics, means = [], []
    for window in range(count):
        inside = slice(round(window * length), round((window + 1) * length))
        time = dt * np.arange(inside.start, inside.stop, dtype=float)
        coefficients = np.linalg.lstsq(_basis(time, frequency), values[inside], rcond=None)[0]
        harmonics.append(coefficients[2] - 1j * coefficients[3])
        means.append(coefficients[0])
    return np.array(harmonics), np.array(means)


def _basis(time: FloatArray, frequency: float) -> FloatArray:
    """Mean, trend, cosine and sine; time of the trend counts from the middle."""
    turn = 2 * np.pi * frequency * time
    ones = np.ones_like(time)
    return np.stack([ones, time - time.mean(), np.cos(turn), np.sin(turn)], axis=1)


def estimate(ratios: ComplexArray, type_b: FloatArray) -> Estimate:
    r"""Mean of ratios over windows, and its expanded uncertainty.

    Parameters
    ----------
    ratios : ndarray of complex, shape (…, window, channel)
        One per window.
    type_b : ndarray, shape (…, channel)
        Standard uncertainty of the modulus that all windows share: the instruments'.

    Returns
    -------
    Estimate
        :math:`U = t_{0.975}(\nu)\,\sqrt{s^2/n + u_B^2}` along the mean for its modulus and across
        it for its phase, :math:`\nu` by Welch and Satterthwaite.
    """
    count, mean = ratios.shape[-2], ratios.mean(axis=-2)
    modulus = np.abs(mean)
    with undefined():
        turned = ratios * np.conj(mean / modulus)[..., None, :]
        widths = []
        for part in (turned.real, turned.imag):
            type_a = part.std(axis=-2, ddof=1) / np.sqrt(count)
            both = np.hypot(type_a, type_b)
            freedom = np.where(type_a > 0, (count - 1) * (both / type_a) ** 4, np.inf)
            widths.append(stats.t.ppf(0.5 + 0.5 * COVERAGE, freedom) * both)
    return Estimate(mean, widths[0], half_angle(widths[1], modulus))


def half_angle(radius: FloatArray, modulus: FloatArray) -> FloatArray:
    """Most that the phase of a number differs from that of any within a radius of it, rad."""
    with undefined():
        return np.where(radius < modulus, np.arcsin(radius / modulus), np.pi)
