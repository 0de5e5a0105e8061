r"""Waves from one place to another: celerity, probes apart, elevations carried, and carriers.

A record at x is a sum of waves; at x + d it is the same sum with each wave turned by
:math:`e^{-i k(\omega) d}`. Waves run downstream, towards +x, so that a positive distance delays
them. The wavenumber follows linear dispersion, or one celerity c for all frequencies,
:math:`k = \omega/c` (the paper's section System identification setup,
:math:`\eta(t) = \eta_{kn}(t - d(t)/c)`).

A carrier reads the wave at another place without the whole record: a filter of some samples about
an instant whose output comes nearest, in mean square over a spectrum, to the elevation at a
distance and a lead from there, by least squares over the products of waves
:math:`\cos(kx - \omega t)`: :math:`R h = r`. The spectrum is that of training, so that nothing is
spent on waves that do not occur; noise on the diagonal keeps the filter short and calm. The
distance is that to the slow position of the vessel.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
import scipy
from numpy.polynomial import chebyshev
from scipy import fft, linalg, signal

from seakeep.arrays import (
    ArrayLike,
    ComplexArray,
    FloatArray,
    IntArray,
    as_pair,
    as_series,
    number,
    positive,
    time_step,
)
from seakeep.errors import DataError, RequestError
from seakeep.signals.calculus import predicted_extension
from seakeep.signals.lags import correlation_peak, parabola_peak
from seakeep.signals.waves import encounter_period, is_regular
from seakeep.waves import group_speed, phase_speed, wavenumber

EARLIEST = 1e-3
"""Part of a step below which a lag is none: rounding leaves either sign of nought."""


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


def effective_celerity(
    upstream: ArrayLike,
    downstream: ArrayLike,
    dt: float,
    separation: float,
    depth: float,
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
    first, second = as_pair(upstream, downstream, minimum=8, moving=True)
    step, apart = time_step(dt), positive(separation, "the separation", "m")
    cycle = encounter_period(first, step)
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


MOST_PLACES, MOST_TERMS = 100_000, 4000
"""Distances tried for a pair of probes, and polynomials in the distance of a carried wave: beyond
them positions are not in metres, or the record is sampled far finer than its waves."""
GROUPS = 10
"""Groups of frequencies, each left out once for the spread."""
NEIGHBOURS = 4
"""Neighbouring frequencies that stay in one group, since the taper makes them depend on another."""
REACH = 0.25
"""Part of the record that the waves of the mean period may take from probe to probe."""
SURELY = 3.0
"""Spreads by which a match must be better than the one nearest to what is stated."""
NEARLY = 0.9
"""Part of the highest match that another one must have to be taken for it."""
ENERGY = 0.01
"""Frequencies with less than this part of the greatest cross-spectrum are noise."""
PLACES, FINER = 16, 20
"""Places tried in a shortest wavelength, and again between two of them around the best."""
LEAST_WAVES = 20
"""Fewer waves in a record cover too few of the sea's frequencies."""
LEAST_CORRELATION = 0.8
"""Below it, six tenths of the second record are not the first one carried to it."""
COHERENT = 0.92
"""Coherence of probes that surely record the same waves: where noise, reflections or short crests
let right positions correlate below 0.8, it is 0.87 or less."""
BEYOND_THEORY = 0.01
"""Fraction of a separation by which waves of a steepness ka of 0.14 are faster than in linear
theory, (ka)²/2; a current of a hundredth of the phase speed does the same."""
MATTERS = 0.2
"""Error of a carried elevation, in its standard deviations, below which a wrong position is hidden
by what a model of waves leaves over in any case (0.16 for heave on the virtual tank)."""


@dataclass(frozen=True)
class ProbeSeparation:
    """How far one probe stands downstream of another, by the waves.

    Parameters
    ----------
    separation : float
        m, positive where the second probe stands downstream of the first.
    spread : float
        Its standard error, m.
    correlation : float
        Correlation of the second record with the first one carried there by linear dispersion;
        the separation means nothing where it is low.
    stated : float
        What was stated, m.
    input_error : float
        NRMSE of an elevation that is carried with the stated separation instead: the error
        that a model's input gets.
    coherence : float
        Correlation with each frequency carried at a speed of its own, as far as the phase goes
        on evenly from one to the next: near 1 for the same waves whatever their speed.
    """

    separation: float
    spread: float
    correlation: float
    stated: float
    input_error: float
    coherence: float

    @property
    def known(self) -> bool:
        """Whether the records match well enough to determine a separation."""
        return self.correlation >= LEAST_CORRELATION

    @property
    def disagrees(self) -> bool:
        """Whether the stated separation is surely wrong, and by as much as matters to a model.

        Or none fits waves that both have surely recorded, as with a wrong depth, sign or clock.
        """
        if not self.known:
            return self.coherence >= COHERENT
        doubt = SURELY * self.spread + BEYOND_THEORY * abs(self.separation)
        return abs(self.separation - self.stated) > doubt and self.input_error > MATTERS


@dataclass(frozen=True)
class Misplaced:
    """A probe whose stated position does not fit the waves.

    Parameters
    ----------
    probe, other : str
        The probe, and the one that it was compared with.
    separation : ProbeSeparation
        From `other` to `probe`.
    certain : bool
        Whether it is this probe: the other one agrees with a third, and this one with none.
    """

    probe: str
    other: str
    separation: ProbeSeparation
    certain: bool


def misplaced_probes(
    elevations: Mapping[str, ArrayLike],
    positions: Mapping[str, float],
    dt: float,
    depth: float,
) -> list[Misplaced]:
    r"""Find probes whose stated positions do not fit the irregular waves that passed them.

    Each probe is compared with its neighbours by position, the last with the first. Two of them
    disagree where :func:`probe_separation` differs from what is stated by more than three standard
    errors and a hundredth of the separation, which is surely more than linear dispersion is wrong,
    and where the error of a carried elevation,

    .. math:: \left(\sum_f S(f) |1 - e^{i k(f) \delta}|^2 / \sum_f S(f)\right)^{1/2},

    is above 0.2: less is hidden by what a model leaves over in any case.

    Parameters
    ----------
    elevations : mapping of str to array_like, each shape (time,)
        Elevations, uniformly sampled at the same instants, without gaps.
    positions : mapping of str to float
        Stated positions along the waves, m.
    dt : float
        Time step, s.
    depth : float
        Water depth, m.

    Returns
    -------
    list of Misplaced
        One for each probe that is surely misplaced, and one for each pair of which either may be.
        Records that are constant, short (20 waves) or regular, and pairs that correlate below 0.8,
        say nothing, unless their coherence is 0.92: a reflection turns the phase of a single
        frequency, and only over many of them does it average out.

    Raises
    ------
    RequestError
        As :func:`probe_separation`.

    Notes
    -----
    On three probes in seas of the paper's band (Tp 2.05 s, depth 3.6 m, 20 seeds each of 210 s
    with 2 % noise, with reflections of 10 and of 20 %, with noise of 20 %, and of 60 s) no right
    position and none wrong by 0.05 m was doubted, and 0.18 m was found with the right probe in all.
    Regular waves before a model are left out for a reason: on the measured ship section their
    phases move by up to a fifth of a wavelength with what the model reflects.
    """
    telling = {
        name: series
        for name, each in elevations.items()
        if name in positions and _telling(series := as_series(each))
    }
    names = sorted(telling, key=positions.__getitem__)
    pairs = list(pairwise(names))
    if len(names) > 2:
        pairs.append((names[0], names[-1]))
    separations = {
        (a, b): probe_separation(telling[a], telling[b], dt, depth, positions[b] - positions[a])
        for a, b in pairs
    }
    against = [pair for pair, each in separations.items() if each.disagrees]
    backed = {end for pair, each in separations.items() if each.known and pair not in against
              for end in pair}  # fmt: skip
    out: dict[tuple[str, ...], Misplaced] = {}
    for a, b in sorted(against, key=lambda pair: separations[pair].spread):
        probe, other, own = b, a, separations[a, b]
        if a not in backed and b in backed:
            probe, other = a, b
            own = replace(own, separation=-own.separation, stated=-own.stated)
        certain = probe not in backed and other in backed
        out.setdefault((probe,) if certain else (a, b), Misplaced(probe, other, own, certain))
    return list(out.values())


def _telling(series: FloatArray) -> bool:
    """Whether a record holds irregular waves, and enough of them."""
    if series.size < 64 or np.ptp(series) == 0:
        return False
    rises = np.diff(np.sign(series - series.mean())) > 0
    return bool(rises.sum() >= LEAST_WAVES) and not is_regular(series)


def probe_separation(
    first: ArrayLike, second: ArrayLike, dt: float, depth: float, stated: float
) -> ProbeSeparation:
    r"""Separation of two wave probes from the phases of their cross-spectrum.

    The separation d is where the correlation of the second record with the first, carried by
    linear dispersion,

    .. math:: \rho(d) = \frac{\mathrm{Re}\sum_f \bar X_1 X_2 e^{i k(f) d}}
                             {\sqrt{\sum_f |X_1|^2 \sum_f |X_2|^2}}

    is greatest. It is sought as far as the waves' groups get in a quarter of the record, upstream
    too, and over 100,000 places at most. In a narrow band neighbouring maxima, a wavelength apart,
    are nearly as high: of those within a tenth of the highest, and not lower by three standard
    errors of the difference, the one nearest to the stated separation is taken. So regular waves
    determine a separation within half a wavelength only.

    Parameters
    ----------
    first, second : array_like, shape (time,)
        Elevations, uniformly sampled, without gaps, at the same instants.
    dt : float
        Time step, s.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.
    stated : float
        Position of the second probe less that of the first, m, positive downstream; of any sign.

    Returns
    -------
    ProbeSeparation
        Its spread comes from leaving out a tenth of the frequencies at a time (jackknife), so
        that reflections, which turn the phases by frequency, are in it.

    Raises
    ------
    RequestError
        If the records differ in length, are shorter than 64 samples, or a number is out of range.
    DataError
        If a record is constant or holds no waves.

    Examples
    --------
    >>> import numpy as np
    >>> from seakeep.waves import wavenumber
    >>> rng = np.random.default_rng(0)
    >>> omega, phase = 2 * np.pi * np.linspace(0.3, 1.0, 80), rng.uniform(0, 6.28, 80)
    >>> t, k = np.arange(0, 200, 0.1), wavenumber(omega, 3.6)
    >>> waves = lambda x: np.cos(np.outer(t, omega) - k * x + phase).sum(axis=1)
    >>> result = probe_separation(waves(0.0), waves(3.85), 0.1, 3.6, stated=3.67)
    >>> round(result.separation, 2)
    3.85
    """
    a, b = as_pair(first, second, minimum=64, moving=True)
    interval, place = time_step(dt), number(stated, "the stated separation")
    # Cross-spectrum over the records' norms, and wavenumbers, where there is energy.
    taper = scipy.signal.windows.tukey(a.size, 0.2)
    one, other = (fft.rfft(taper * (each - each.mean())) for each in (a, b))
    frequency = fft.rfftfreq(a.size, interval)
    cross = np.conj(one) * other / (np.linalg.norm(one[1:]) * np.linalg.norm(other[1:]))
    smooth = np.convolve(np.abs(cross), np.ones(9) / 9, mode="same")
    energetic = (smooth > ENERGY * smooth[1:].max()) & (frequency > 0)
    cross, k = cross[energetic], wavenumber(2 * np.pi * frequency[energetic], depth)
    omega = 2 * np.pi / encounter_period(a, interval)
    reach = float(group_speed(omega, depth)) * REACH * a.size * interval
    least = abs(place) + np.pi / k[np.argmax(np.abs(cross))]
    step = 2 * np.pi / k[-1] / PLACES
    most = 0.5 * MOST_PLACES * step
    if not least <= most:
        raise RequestError(
            f"the stated separation of {place:g} m is too far for waves of {16 * step:.3g} m and a "
            f"record of {a.size * interval:.4g} s. Correct the positions of the probes (m)."
        )
    reach = max(min(reach, most), least)
    coarse = np.arange(-reach, reach, step)
    scores = _scores(cross, k, coarse)
    best = coarse[_chosen(scores, np.argmin(np.abs(coarse - place)))]
    fine = best + step * np.arange(-2 * FINER, 2 * FINER + 1) / FINER
    scores = _scores(cross, k, fine)
    total = scores.sum(axis=0)
    separation, *without = (
        fine[0] + parabola_peak(values)[0] * step / FINER for values in (total, *(total - scores))
    )
    turned = np.abs(1.0 - np.exp(1j * k * (separation - place))) ** 2
    weight = np.abs(cross)
    turns = cross[1:] * np.conj(cross[:-1])
    even = np.abs(np.convolve(turns, np.ones(9) / 9)).sum() / np.abs(turns).sum()
    return ProbeSeparation(
        separation=float(separation),
        spread=float(_jackknife(np.array(without))),
        correlation=float(total.max()),
        stated=place,
        input_error=math.sqrt(np.sum(weight * turned) / np.sum(weight)),
        coherence=float(weight.sum() * even),
    )


def _scores(cross: ComplexArray, k: FloatArray, distances: FloatArray) -> FloatArray:
    """Parts of the correlation that the groups of frequencies make, shape (group, distance).

    Distances are equally spaced: each is a start and an offset, whose phases multiply.
    """
    group = (np.arange(k.size) // NEIGHBOURS) % GROUPS
    length = math.isqrt(distances.size)
    starts, offsets = distances[::length], distances[:length] - distances[0]
    out = np.empty((GROUPS, distances.size))
    for each, row in enumerate(out):
        own = k[group == each]
        turned = cross[group == each] * np.exp(1j * np.outer(starts, own))
        row[:] = (turned @ np.exp(1j * np.outer(own, offsets))).real.ravel()[: row.size]
    return out


def _jackknife(values: FloatArray) -> FloatArray:
    """Standard error of a sum from its values without, or the parts of, each group."""
    return np.sqrt((GROUPS - 1) / GROUPS * np.sum((values - values.mean(axis=0)) ** 2, axis=0))


def _chosen(scores: FloatArray, stated: np.intp) -> np.intp:
    """Of the maxima that may be the highest, the one nearest to what is stated."""
    total = scores.sum(axis=0)
    peaks = scipy.signal.find_peaks(total)[0]
    best = peaks[np.argmax(total[peaks])]
    parts = scores[:, [best]] - scores[:, peaks]
    alike = total[peaks] >= NEARLY * total[best]
    near = peaks[alike & (parts.sum(axis=0) <= SURELY * _jackknife(parts))]
    return near[np.argmin(np.abs(near - stated))]


WAVE_SHARE = 0.999
"""Waves are what lies below the frequency that holds this part of a record's variance."""


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

    def at(self, distance: ArrayLike, sample: int | slice | IntArray = slice(None)) -> FloatArray:
        """Elevation at a distance from where it was measured."""
        half = 0.5 * (self.highest - self.lowest)
        place = np.asarray(distance, float) - 0.5 * (self.highest + self.lowest)
        scaled = np.clip(place / half, -1.0, 1.0) if half > 0 else np.zeros_like(place)
        x = scaled[:, None] if scaled.ndim else scaled
        return np.asarray(chebyshev.chebval(x, self.terms[:, sample], tensor=False))


def band_limit(series: ArrayLike, dt: float, share: float = WAVE_SHARE) -> float:
    """Frequency below which a given part of a record's variance lies."""
    array = as_series(series, channels=True)
    flat = array.reshape(len(array), -1)
    # Tapered, since a wave that the record's end cuts would leak into all frequencies.
    taper = np.hanning(len(flat) + 2)[1:-1, None]
    power = np.abs(fft.rfft(taper * (flat - flat.mean(axis=0)), axis=0)) ** 2
    grown = np.cumsum(power.sum(axis=1))
    if not grown[-1] > 0:
        raise DataError(
            "the elevation is constant: there are no waves in it. Look for a dead probe."
        )
    frequency = fft.rfftfreq(len(flat), time_step(dt))
    return float(frequency[np.searchsorted(grown, share * grown[-1])])


def carry_by_dispersion(
    series: ArrayLike,
    dt: float,
    distances: tuple[float, float],
    depth: float,
    highest_frequency: float | None = None,
) -> CarriedElevation:
    """Prepare a record to be carried over a range of distances (m) by linear dispersion.

    Above `highest_frequency` (Hz), by default :func:`band_limit`, lie noise and bound crests, whose
    wavenumber goes on along the tangent.
    """
    limit = band_limit(series, dt) if highest_frequency is None else highest_frequency
    edge = 2 * np.pi * positive(limit, "the highest frequency", "Hz")

    def numbers(omega: FloatArray) -> FloatArray:
        beyond = np.maximum(omega - edge, 0.0) / group_speed(edge, depth)
        return wavenumber(np.minimum(omega, edge), depth) + beyond

    return _carried(series, dt, distances, numbers)


def carry_by_celerity(
    series: ArrayLike, dt: float, distances: tuple[float, float], celerity: float
) -> CarriedElevation:
    """Prepare a record to be carried over a range of distances (m) at one celerity (m/s)."""
    speed = positive(celerity, "the celerity", "m/s")
    return _carried(series, dt, distances, lambda omega: omega / speed)


def _carried(
    series: ArrayLike,
    dt: float,
    distances: tuple[float, float],
    numbers: Callable[[FloatArray], FloatArray],
) -> CarriedElevation:
    """Interpolate the waves in the distance, by Chebyshev polynomials.

    A plane wave exp(−ikhξ) is Σ (2 − δ_p0) (−i)^p J_p(kh) T_p(ξ) (Jacobi and Anger), so that its
    coefficients vanish beyond p = kh faster than any power.
    """
    step, (lowest, highest) = time_step(dt), distances
    array = as_series(series, minimum=4, channels=True)
    flat = array.reshape(len(array), -1)
    mean = flat.mean(axis=0)
    centre, half = 0.5 * (lowest + highest), 0.5 * (highest - lowest)
    # The slowest energy of interest travels at half the lowest phase speed. What is predicted at
    # either end fades out once no delay reaches it. In samples:
    top = numbers(np.array([np.pi / step]))[0]
    delay = 2.0 * max(abs(lowest), abs(highest)) * top / np.pi
    period = 1.0 / max(band_limit(flat, 1.0, 0.5), 2.0 / len(flat))
    whole, order = math.ceil(delay + period), min(math.ceil(2.0 * period), 500)
    padding, fitted = whole + math.ceil(4.0 * period), max(8 * order, 64)
    extended = np.apply_along_axis(
        predicted_extension, 0, flat - mean, padding, fitted, order, whole
    )
    size = fft.next_fast_len(len(extended), real=True)
    spectrum = fft.rfft(extended, n=size, axis=0)
    k = numbers(2 * np.pi * fft.rfftfreq(size, step))
    reach = k[-1] * half
    # Bessel functions of order p fall below 1e-9 from here on.
    count = math.ceil(reach + 8.0 * np.cbrt(reach) + 9.0) if half > 0 else 1
    if count > MOST_TERMS:
        raise RequestError(
            f"distances from {lowest:g} to {highest:g} m span {reach / np.pi:.0f} of the shortest "
            f"wavelengths that a step of {step:g} s resolves. Check that they are in metres, or "
            "resample the elevation to some 30 samples per wave period first."
        )
    records = np.empty((count, *flat.shape))
    for record, node in zip(records, centre + half * chebyshev.chebpts1(count), strict=True):
        carried = fft.irfft(spectrum * np.exp(-1j * k * node)[:, None], n=size, axis=0)
        record[:] = carried[padding : padding + len(flat)]
    terms = fft.dct(records[::-1], axis=0) / count
    terms[0] *= 0.5
    terms[0] += mean
    return CarriedElevation(lowest, highest, terms)


NOISE = 1e-2
"""Noise of the probes that carriers are designed for, per variance of the waves.

Between 1e-3 and 1e-2 forecasts on the virtual tank are alike; below, taps grow."""
FLOOR = 3e-3
"""Least power, per that of the peak, between 0.3 and 3 times the frequency of the encounters."""
EDGES = (0.2, 4.0)
"""Lowest and highest frequency of the design, per encounter frequency."""
LINES = 240
"""Frequencies of the design: their sum repeats after 60 encounter periods, which no carrier is."""
CUTOFF = 0.2
"""The slow position is the surge below this frequency, per encounter period.

Surge at wave frequency is part of the response that the model learns from the wave; following its
prediction too feeds its error back. Between 0.1 and 0.33 the skill on the virtual tank is flat."""
RIDGE = 1e-3
"""λ of the taps of the slow position, per sample, on the standardised surge."""
SETTLED = 5.0
"""Encounter periods at either end of a record in which its zero-phase filter has not settled."""


def mean_spectrum(
    records: Sequence[FloatArray], dt: float, period: float, highest: float = np.inf
) -> tuple[FloatArray, FloatArray]:
    """Frequencies and powers that carriers are designed for.

    Parameters
    ----------
    records : sequence of ndarray, each of shape (time, probe)
        Elevations of training.
    dt : float
        Time step, s.
    period : float
        Encounter period, s.
    highest : float, optional
        Highest frequency of free waves, Hz.

    Returns
    -------
    omega : ndarray, shape (LINES,)
        rad/s.
    power : ndarray, shape (LINES,)
        Mean over records and probes; they sum to one.
    """
    low, high = EDGES
    frequency = np.linspace(low / period, min(high / period, highest, 0.5 / dt), LINES)
    power = np.zeros(LINES)
    for record in records:
        length = min(len(record), round(16 * period / dt))
        known, density = signal.welch(record, 1.0 / dt, nperseg=length, axis=0)
        power += np.interp(frequency, known, density.mean(axis=1))
    waves = (frequency >= 0.3 / period) & (frequency <= 3.0 / period)
    power += FLOOR * power.max() * waves
    return 2 * np.pi * frequency, power / power.sum()


def carriers(
    omega: FloatArray,
    power: FloatArray,
    depth: float,
    dt: float,
    *,
    targets: FloatArray,
    probes: Sequence[float],
    back: int,
    ahead: int,
    leads: IntArray,
) -> tuple[FloatArray, FloatArray]:
    """Filters that read the elevation at other places.

    Parameters
    ----------
    omega, power : ndarray, shape (line,)
        From :func:`mean_spectrum`.
    depth : float
        Water depth, m; ``numpy.inf`` for deep water.
    dt : float
        Time step, s.
    targets : ndarray, shape (place,)
        Places that are read, m, positive downstream.
    probes : sequence of float
        Places of the probes, m.
    back, ahead : int
        Samples before and after an instant that its filter reads.
    leads : ndarray of int, shape (place,)
        Samples after the instant at which the elevation is wanted at each place.

    Returns
    -------
    taps : ndarray, shape (place, probe, back + ahead + 1)
        Weights of the samples, oldest first.
    errors : ndarray, shape (place,)
        Root mean square error in these waves, per their standard deviation.
    """
    k, lags = wavenumber(omega, depth), np.arange(-back, ahead + 1)
    amplitude = np.sqrt(power)

    def waves(place: FloatArray, instant: FloatArray) -> FloatArray:
        phase = np.outer(place, k) - np.outer(instant, omega)
        return np.concatenate([np.cos(phase) * amplitude, np.sin(phase) * amplitude], 1)

    read = waves(np.repeat(probes, lags.size), np.tile(lags * dt, len(probes)))
    wanted = waves(targets, leads.astype(float) * dt)
    products = read @ read.T
    products[np.diag_indices_from(products)] += NOISE
    crossed = wanted @ read.T
    taps = linalg.solve(products, crossed.T, assume_a="pos").T
    errors = np.sqrt(np.maximum(np.sum((wanted - taps @ read) ** 2, axis=1), 0.0))
    return taps.reshape(len(targets), len(probes), lags.size), errors


def slow_position(surge: FloatArray, period: float) -> FloatArray:
    """Surge below ``CUTOFF`` without delay; `period` in samples."""
    sections = signal.butter(4, 2 * CUTOFF / period, output="sos")
    return signal.sosfiltfilt(sections, surge, padlen=min(len(surge) - 1, round(SETTLED * period)))


def position_taps(
    surges: Sequence[FloatArray], period: float, count: int, ahead: int
) -> FloatArray:
    """Weights of the last surges that come nearest to the slow position some samples later.

    They sum to one, so that a vessel at rest is where it is.

    Parameters
    ----------
    surges : sequence of ndarray, each of shape (time,)
        Surge of training, m.
    period : float
        Encounter period, samples.
    count : int
        Number of weights.
    ahead : int
        Samples after the newest surge at which the position is wanted.

    Returns
    -------
    ndarray, shape (count,)
        Newest first.
    """
    spread = np.concatenate(surges).std()
    gram, right, total = np.zeros((count, count)), np.zeros(count), 0
    for surge in surges:
        slow = slow_position(surge, period)
        edge = min(round(SETTLED * period), len(surge) // 8)
        windows = np.lib.stride_tricks.sliding_window_view(surge, count)[:, ::-1]
        first, last = max(edge, count - 1), len(surge) - max(edge, ahead)
        rows = windows[first - count + 1 : last - count + 1 - ahead]
        middle = surge.mean()
        apart, wanted = (rows - middle) / spread, (slow[first + ahead : last] - middle) / spread
        gram += apart.T @ apart
        right += apart.T @ wanted
        total += len(apart)
    gram[np.diag_indices_from(gram)] += RIDGE * total
    # Least squares under the condition that the weights sum to one.
    free, ones = linalg.solve(gram, np.stack([right, np.ones(count)], axis=1), assume_a="pos").T
    return free + ones * (1.0 - free.sum()) / ones.sum()
