r"""Celerity of waves between two probes: at each frequency, and one for all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy
from scipy import fft

from seakeep.errors import DataError, RequestError
from seakeep.signals.filters import as_series, positive
from seakeep.signals.spectra import encounter_period, welch_segments
from seakeep.waves import phase_speed, wavenumber

__all__ = [
    "EffectiveCelerity",
    "PhaseCelerity",
    "correlation_peak",
    "effective_celerity",
    "phase_celerity",
]

FloatArray = npt.NDArray[np.float64]

EARLIEST = 1e-3
"""Part of a step below which a lag is none: rounding leaves either sign of nought."""


@dataclass(frozen=True, eq=False)
class PhaseCelerity:
    """Phase speed of the waves between two probes, frequency by frequency.

    Parameters
    ----------
    frequency : ndarray, shape (frequency,)
        Hz, above zero.
    celerity : ndarray
        Phase speed, m/s.
    coherence : ndarray
        Squared coherence of the two records, 0 to 1; the celerity means little where it is low.
    spread : ndarray
        Standard error of the celerity, m/s, from the coherence and the number of segments.
    """

    frequency: FloatArray
    celerity: FloatArray
    coherence: FloatArray
    spread: FloatArray

    def at(self, frequency: float) -> float:
        """Celerity at a frequency (Hz), m/s, between its neighbours."""
        return float(np.interp(frequency, self.frequency, self.celerity))


@dataclass(frozen=True)
class EffectiveCelerity:
    """One celerity for all waves between two probes.

    Parameters
    ----------
    celerity : float
        m/s.
    lag : float
        Time by which the record downstream is later, s.
    correlation : float
        Normalised correlation at that lag.
    bounds : (float, float)
        Lags among which the peak was sought, s.
    """

    celerity: float
    lag: float
    correlation: float
    bounds: tuple[float, float]


def phase_celerity(
    upstream: npt.ArrayLike,
    downstream: npt.ArrayLike,
    dt: float,
    separation: float,
    depth: float,
    segment: int | None = None,
) -> PhaseCelerity:
    r"""Phase speed between two probes from the phase of their cross-spectrum.

    The phase is known up to whole turns; the turn nearest to linear dispersion is taken, so that
    probes may stand several wavelengths apart.

    Parameters
    ----------
    upstream, downstream : array_like, shape (time,)
        Elevations at the two probes, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    separation : float
        Distance between the probes, m.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.
    segment : int, optional
        Samples a segment of Welch's method; by default 60 s, or half the record if it is shorter
        than two such segments. Segments overlap by half.

    Returns
    -------
    PhaseCelerity
        Frequencies, celerities :math:`2\pi f d/\varphi(f)`, coherence and spread.

    Raises
    ------
    RequestError
        If the records differ in length or a number is out of range.
    DataError
        If a record is constant.

    Notes
    -----
    Spread of the phase: :math:`\sqrt{(1-\gamma^2)/(2 n \gamma^2)}` for n independent segments
    (Bendat and Piersol, Random Data).
    """
    first, second = _pair(upstream, downstream)
    step, apart = positive("the time step", dt, "s"), positive("the separation", separation, "m")
    length = segment
    if length is None:
        length = min(round(60.0 / step), first.size // 2)
    length, shared = welch_segments(first.size, step, length, None)
    options = {"fs": 1.0 / step, "window": "hamming", "nperseg": length, "noverlap": shared}
    frequency, cross = scipy.signal.csd(first, second, **options)
    power = [scipy.signal.welch(each, **options)[1] for each in (first, second)]
    kept = frequency > 0
    frequency, cross = frequency[kept], cross[kept]
    coherence = np.abs(cross) ** 2 / np.maximum(power[0][kept] * power[1][kept], 1e-300)
    coherence = np.clip(coherence, 0.0, 1.0)
    expected = wavenumber(2 * np.pi * frequency, depth) * apart
    # csd takes conj(first) · second, so that a later second record has a negative phase.
    phase = expected + np.angle(np.conj(cross) * np.exp(-1j * expected))
    phase = np.maximum(phase, 1e-9)
    celerity = 2 * np.pi * frequency * apart / phase
    segments = first.size / length
    with np.errstate(divide="ignore"):
        error = np.sqrt((1.0 - coherence) / (2.0 * segments * coherence))
    return PhaseCelerity(frequency, celerity, coherence, celerity * error / phase)


def effective_celerity(
    upstream: npt.ArrayLike,
    downstream: npt.ArrayLike,
    dt: float,
    separation: float,
    depth: float,
    period: float | None = None,
) -> EffectiveCelerity:
    r"""One celerity between two probes from the peak of their normalised cross-correlation.

    :math:`c = d/\Delta t` with :math:`\Delta t = \arg\max\,\mathrm{corr}[\eta_1(t), \eta_2(t +
    \Delta t)]`, sought within half a period around the lag of linear dispersion, its place
    between samples from a parabola.

    Parameters
    ----------
    upstream, downstream : array_like, shape (time,)
        Elevations at the two probes, as they were measured, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    separation : float
        Distance between the probes, m.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.
    period : float, optional
        Period of the waves whose phase speed centres the search, s; by default the
        zero-up-crossing period of the upstream record.

    Returns
    -------
    EffectiveCelerity
        Celerity, lag, correlation and bounds.

    Raises
    ------
    RequestError
        If the records differ in length or a number is out of range.
    DataError
        If a record is constant, no peak lies within the bounds, or the downstream record is not
        the later one.

    Notes
    -----
    The paper prints corr[η_fwd(t), η_cog(t − Δt)], whose peak lies at a negative lag, and no
    bound; the highest peak of a narrow-banded sea can lie a period away.
    """
    first, second = _pair(upstream, downstream)
    step, apart = positive("the time step", dt, "s"), positive("the separation", separation, "m")
    cycle = encounter_period(first, step) if period is None else positive("period", period, "s")
    centre = apart / float(phase_speed(2 * np.pi / cycle, depth))
    bounds = (max(centre - 0.5 * cycle, 0.0), centre + 0.5 * cycle)
    lag, height = correlation_peak(first, second, step, bounds)
    if lag < EARLIEST * step:
        raise DataError(
            f"the downstream record is not later than the upstream one (lag {lag:.4f} s, "
            f"correlation {height:.3f}), so there is no celerity between them. Check that the two "
            "are not the same record, which probe stands upstream, and their positions."
        )
    return EffectiveCelerity(apart / lag, lag, height, bounds)


def correlation_peak(
    first: npt.ArrayLike, second: npt.ArrayLike, dt: float, bounds: tuple[float, float]
) -> tuple[float, float]:
    r"""Highest peak of :math:`\mathrm{corr}[a(t), b(t+\Delta t)]` among given lags.

    Parameters
    ----------
    first, second : array_like, shape (time,)
        Two records a and b, uniformly sampled, without gaps.
    dt : float
        Time step, s.
    bounds : (float, float)
        Least and greatest lag, s.

    Returns
    -------
    lag, correlation : float
        Lag of the peak, s, between samples by a parabola through three of them; and its height.
        At each lag the correlation is normalised over the samples that both records have there.

    Raises
    ------
    RequestError
        If the records differ in length, or the bounds reach beyond half of them.
    DataError
        If a record is constant, or the correlation has no peak within the bounds.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(0, 60, 0.05)
    >>> lag, height = correlation_peak(np.sin(3 * t), np.sin(3 * t - 1.0), 0.05, (0.0, 1.0))
    >>> round(lag, 3), round(height, 3)
    (0.333, 1.0)
    """
    a, b = _pair(first, second)
    step = positive("the time step", dt, "s")
    low, high = (int(np.floor(bounds[0] / step)), int(np.ceil(bounds[1] / step)))
    if not low < high or max(abs(low), abs(high)) > a.size // 2:
        raise RequestError(
            f"lags from {bounds[0]:g} to {bounds[1]:g} s cannot be sought in records of "
            f"{a.size * step:g} s: give a rising range within half their length."
        )
    lags = np.arange(low - 1, high + 2)
    values = _correlation(a, b, lags)
    inner = values[1:-1]
    peaks = np.flatnonzero((inner >= values[:-2]) & (inner >= values[2:]))
    if not peaks.size:
        raise DataError(
            f"the correlation of the two records has no peak between lags of {bounds[0]:g} and "
            f"{bounds[1]:g} s (highest {inner.max():.2f}, at an end). Check which probe stands "
            "upstream, their positions, and the water depth."
        )
    best = int(peaks[np.argmax(inner[peaks])]) + 1
    before, here, after = values[best - 1 : best + 2]
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    height = float(here - 0.25 * (before - after) * shift)
    return float((lags[best] + shift) * step), height


def _correlation(a: FloatArray, b: FloatArray, lags: npt.NDArray[np.int64]) -> FloatArray:
    """Correlation of a(t) and b(t + lag) over their common samples."""
    size = fft.next_fast_len(2 * a.size, real=True)

    def summed(x: FloatArray, y: FloatArray) -> FloatArray:
        product = np.conj(fft.rfft(x, size)) * fft.rfft(y, size)
        out: FloatArray = fft.irfft(product, size)[lags]  # negative lags stand at the end
        return out

    one = np.ones(a.size)
    count = a.size - np.abs(lags)
    mean_a, mean_b = summed(a, one) / count, summed(one, b) / count
    power_a = summed(a**2, one) / count - mean_a**2
    power_b = summed(one, b**2) / count - mean_b**2
    covariance = summed(a, b) / count - mean_a * mean_b
    result: FloatArray = covariance / np.sqrt(np.maximum(power_a * power_b, 1e-300))
    return result


def _pair(first: npt.ArrayLike, second: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    a, b = as_series(first, minimum=8), as_series(second, minimum=8)
    if a.ndim != 1 or a.shape != b.shape:
        raise RequestError(
            f"two records of the same length are needed, shape (time,); received {a.shape} and "
            f"{b.shape}. Cut them to their common time."
        )
    for name, each in (("first", a), ("second", b)):
        if np.ptp(each) == 0:
            raise DataError(
                f"the {name} record is constant ({each[0]:g}), so it correlates with nothing. "
                "Look for a dead probe."
            )
    return a - a.mean(), b - b.mean()
