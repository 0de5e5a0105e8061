r"""Records in frequency: cross-spectra, coherence, bands, and harmonics of regular waves.

Coherence says what no linear map can explain; bands part ε(t) into a slow and a fast one (Bendat
and Piersol, Random Data (2010), chapters 7 and 9).

Tests of residuals: whiteness (Ljung and Box, 1978), and correlation with past inputs (Ljung, System
Identification (1999), section 16.6).

In regular waves amplitude and phase of a response follow by least squares. Their uncertainty is
that of ITTC 7.5-02-07-02.1 (seakeeping experiments) and of the guide that it rests on (JCGM
100:2008): type A from windows of whole periods, type B from the accuracy of the instruments, an
expanded uncertainty at 95 % with the degrees of freedom by Welch and Satterthwaite.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import scipy
from scipy import optimize, signal, stats

from seakeep.arrays import ComplexArray, FloatArray, as_real, number, ratio, time_step, undefined
from seakeep.errors import DataError, RequestError

OVERLAP_CORRELATION = 1 / 36
"""Squared correlation of the spectra of two Hann segments that share a half (Welch, 1967)."""

MIXED = 1 + 2 * (2 / 3) ** 2 + 2 * (1 / 6) ** 2
"""Sum of the squared correlations of a frequency with its neighbours, by a Hann window."""


@dataclass(frozen=True, eq=False)
class Spectra:
    """Spectra of inputs and outputs.

    Parameters
    ----------
    frequency : ndarray, shape (frequency,)
        Cycles per unit of time.
    inputs : ndarray of complex, shape (frequency, input, input)
        Cross-spectra of the inputs, :math:`S_{ij} = E[U_i^* U_j]`, one-sided densities.
    cross : ndarray of complex, shape (frequency, input, output)
        :math:`E[U_i^* X_n]`.
    outputs : ndarray, shape (frequency, output)
        Spectra of the outputs.
    averages : float
        Number of independent segments.
    """

    frequency: FloatArray
    inputs: ComplexArray
    cross: ComplexArray
    outputs: FloatArray
    averages: float

    @property
    def input_power(self) -> FloatArray:
        """Spectra of the inputs, shape (frequency, input)."""
        return np.diagonal(self.inputs, axis1=1, axis2=2).real

    def of_first(self, count: int) -> Spectra:
        """Those of the first inputs alone."""
        return replace(self, inputs=self.inputs[:, :count, :count], cross=self.cross[:, :count])

    def ordinary(self) -> FloatArray:
        """Coherence of each pair, shape (frequency, input, output)."""
        both = self.input_power[:, :, None] * self.outputs[:, None]
        return ratio(np.abs(self.cross) ** 2, both, 0.0)

    def unexplained(self) -> FloatArray:
        """Spectra of what no linear map of the inputs explains, shape (frequency, output)."""
        size = self.inputs.shape[1]
        if self.averages <= size + 1:
            raise DataError(
                f"the records hold {self.averages:.1f} independent segments, and coherence with "
                f"{size} input{'s' * (size > 1)} takes {size + 2} or more. Give longer records, or "
                "a shorter segment."
            )
        # Relative to the power of each input, so that units do not matter.
        scale = ratio(1.0, np.sqrt(self.input_power), 0.0)
        scaled = self.inputs * scale[:, :, None] * scale[:, None]
        cross = self.cross * scale[:, :, None]
        gain = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True) @ cross
        explained = np.sum(np.conj(cross) * gain, axis=1).real
        left = np.clip(self.outputs - explained, 0.0, None)
        return left * self.averages / (self.averages - size)

    def share(self) -> FloatArray:
        r"""Share of the power of each output that no linear map of the inputs explains.

        Returns
        -------
        ndarray, shape (3, output)
            The share, at most one, and its bounds of 95 %; NaN without power. The spectrum R that
            is left has :math:`2 (\sum R)^2 (n - q) / (c \sum R^2)` degrees of freedom, with
            c = 1.94 for the frequencies that a Hann window mixes. The power of the output is taken
            as it is.
        """
        rest, total = self.unexplained(), self.outputs.sum(axis=0)
        left = rest.sum(axis=0)
        with undefined():
            freedom = left**2 / (rest**2).sum(axis=0)
            freedom *= 2 * (self.averages - self.inputs.shape[1]) / MIXED
            limits = [freedom / stats.chi2.ppf(p, freedom) for p in (0.975, 0.025)]
            return np.minimum([left, *(left * each for each in limits)] / total, 1.0)

    def gain(self) -> tuple[ComplexArray, FloatArray]:
        r"""Transfer function of each pair, and the radius of its 95 % circle.

        Returns
        -------
        gain : ndarray of complex, shape (frequency, input, output)
            :math:`S_{ux}/S_{uu}`.
        radius : ndarray, shape (frequency, input, output)
            :math:`\sqrt{F_{2,\,n-2}\;2/(n-2)\,(1-\gamma^2) S_{xx}/S_{uu}}` with n twice the
            number of averages (Bendat and Piersol, equation 9.90); infinite without power.
        """
        power = self.input_power[:, :, None]
        freedom = max(2 * self.averages - 2, 1e-3)
        quantile = float(stats.f.ppf(0.95, 2, freedom))
        left = (1.0 - self.ordinary()) * self.outputs[:, None]
        squares = ratio(2 / freedom * quantile * left, power, np.inf)
        return ratio(self.cross, power, 0.0), np.sqrt(squares)


def segment_length(samples: float, averages: int, period: float, longest: int) -> int:
    """Samples of Welch's segments: as long as `averages` of them allow, in 16 to `longest` periods.

    Segments share a half; `period` is that of the waves, in samples.
    """
    return round(min(max(2 * samples / averages, 16 * period), longest * period))


def cross_spectra(
    pieces: Sequence[tuple[FloatArray, FloatArray]], dt: float, segment: int
) -> Spectra:
    """Spectra by Welch's method, averaged over records: Hann segments that share a half.

    Parameters
    ----------
    pieces : sequence of (ndarray, ndarray)
        Inputs (time, input) and outputs (time, output) of each record, without gaps. The mean of
        each record is removed, not that of each segment: slow motions count.
    dt : float
        Time step, s.
    segment : int
        Samples of a segment; records that are shorter are left out.

    Returns
    -------
    Spectra

    Raises
    ------
    DataError
        If no record holds a segment.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal((9000, 1))
    >>> found = cross_spectra([(u, u + rng.standard_normal((9000, 1)))], 1.0, 90)
    >>> round(float(found.share()[0, 0]), 1)  # half of the variance is noise
    0.5
    """
    long_enough = [piece for piece in pieces if len(piece[0]) >= segment]
    if not long_enough:
        longest = max((len(u) for u, _ in pieces), default=0)
        raise DataError(
            f"the longest record without gaps has {longest * dt:.4g} s, and spectra take a segment "
            f"of {segment * dt:.4g} s. Give longer records, or a shorter segment."
        )
    size, averages, weight = long_enough[0][0].shape[1], 0.0, 0
    driven: Any = 0.0
    power: Any = 0.0
    how = {"fs": 1.0 / dt, "nperseg": segment, "window": "hann", "detrend": False}
    for inputs, outputs in long_enough:
        both = np.concatenate([inputs, outputs], axis=1)
        series = (both - both.mean(axis=0)).T
        frequency, density = signal.csd(series[:size, None], series[None], **how)
        count = (len(inputs) - segment // 2) // (segment - segment // 2)
        driven = driven + count * density
        power = power + count * signal.welch(series[size:], **how)[1]
        weight += count
        averages += count / (1 + 2 * OVERLAP_CORRELATION * (count - 1) / count)
    spectra = np.moveaxis(driven / weight, 2, 0).astype(complex)
    return Spectra(
        frequency=frequency,
        inputs=spectra[:, :, :size],
        cross=spectra[:, :, size:],
        outputs=(power / weight).T,
        averages=averages,
    )


def autocorrelation(pieces: Sequence[FloatArray], lags: int) -> FloatArray:
    """Autocorrelation of records of the same process, shape (lags + 1, channel).

    Parameters
    ----------
    pieces : sequence of ndarray, each (time, channel)
        Records; the mean of each is removed, and products do not cross a joint.
    lags : int
        Largest lag, samples; at most that of the longest record, to which shorter ones add nothing
        beyond their own ends.

    Returns
    -------
    ndarray
        One at lag 0; NaN of a channel without variance.
    """
    lags = min(lags, max(map(len, pieces)) - 1)
    centred = [x - x.mean(axis=0) for x in pieces]
    total = np.sum([_products(x, x, lags) for x in centred], axis=0)
    return ratio(total, total[:1])


def ljung_box(correlation: FloatArray, samples: int) -> tuple[FloatArray, FloatArray]:
    r"""Ljung and Box's test of whiteness up to the last lag.

    Parameters
    ----------
    correlation : ndarray, shape (lags + 1, channel)
        From :func:`autocorrelation`.
    samples : int
        Length n of the records together.

    Returns
    -------
    statistic, probability : ndarray, shape (channel,)
        :math:`Q = n(n+2)\sum_k \rho_k^2/(n-k)`, and how likely white noise exceeds it.
    """
    lags = np.arange(1, len(correlation))
    statistic = samples * (samples + 2) / (samples - lags) @ correlation[1:] ** 2
    return statistic, stats.chi2.sf(statistic, lags.size)


def input_correlation(
    pieces: Sequence[tuple[FloatArray, FloatArray]], lags: int
) -> tuple[FloatArray, FloatArray]:
    r"""Correlation of residuals with past inputs, and its 95 % limit where there is none.

    Parameters
    ----------
    pieces : sequence of (ndarray, ndarray)
        Residuals (time, channel) and inputs (time, input) of each record.
    lags : int
        Largest lag of the input, samples.

    Returns
    -------
    correlation : ndarray, shape (lags + 1, channel, input)
    limit : ndarray, shape (channel, input)
        :math:`1.96\sqrt{\sum_k \rho_e(k)\rho_u(k)/n}` (Ljung, equation 16.71), the sum at least
        one, its value for white residuals.
    """
    residuals = [e - e.mean(axis=0) for e, _ in pieces]
    inputs = [u - u.mean(axis=0) for _, u in pieces]
    samples, lags = sum(map(len, inputs)), min(lags, max(map(len, inputs)) - 1)
    e, u = autocorrelation(residuals, lags), autocorrelation(inputs, lags)
    both = e[:, :, None] * u[:, None]
    limit = 1.96 * np.sqrt(np.maximum(both[0] + 2 * both[1:].sum(axis=0), 1.0) / samples)
    both_of = zip(residuals, inputs, strict=True)
    total = sum(_products(r[:, :, None], v[:, None], lags) for r, v in both_of)
    of_e, of_u = (sum((part**2).sum(axis=0) for part in side) for side in (residuals, inputs))
    return ratio(total, np.sqrt(np.multiply.outer(of_e, of_u))), limit


def _products(x: FloatArray, past: FloatArray, lags: int) -> FloatArray:
    """Sums of x at an instant times `past` lag samples before, shape (lags + 1, …)."""
    products = signal.fftconvolve(x, past[::-1], axes=0)[len(x) - 1 : len(x) + lags]
    return np.concatenate([products, np.zeros((lags + 1 - len(products), *products.shape[1:]))])


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
        return float(np.linalg.lstsq(_basis(time, frequency), x, rcond=None)[1].sum())

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
