r"""Distance between two wave probes, as the waves that pass both of them tell it.

A wave of frequency ω needs the phase :math:`k(\omega)\,d` from one probe to the next one, d
downstream of it. Which d makes the measured phases those of linear dispersion is a check of the
positions that somebody wrote down.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy
from scipy import fft

from seakeep.errors import DataError, RequestError
from seakeep.signals.filters import as_series, positive
from seakeep.signals.repeats import is_regular
from seakeep.signals.spectra import encounter_period
from seakeep.waves import group_speed, wavenumber

__all__ = ["Misplaced", "ProbeSeparation", "misplaced_probes", "probe_separation"]

FloatArray = npt.NDArray[np.float64]
ComplexArray = npt.NDArray[np.complex128]

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
"""Fewer waves in a record tell too little of the sea's frequencies."""
LEAST_CORRELATION = 0.8
"""Below it, six tenths of the second record are not the first one carried to it."""
BEYOND_THEORY = 0.01
"""Part of a separation by which waves of a steepness ka of 0.14 are faster than linear theory has
it, (ka)²/2; a current of a hundredth of the phase speed does the same."""
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
    """

    separation: float
    spread: float
    correlation: float
    stated: float
    input_error: float

    @property
    def excess(self) -> float:
        """Measured less stated separation, m."""
        return self.separation - self.stated

    def reversed(self) -> ProbeSeparation:
        """Return the same from the second probe to the first."""
        return replace(self, separation=-self.separation, stated=-self.stated)

    @property
    def told(self) -> bool:
        """Whether the records match well enough to tell a separation."""
        return self.correlation >= LEAST_CORRELATION

    @property
    def disagrees(self) -> bool:
        """Whether the stated separation is surely wrong, and by as much as matters to a model."""
        doubt = SURELY * self.spread + BEYOND_THEORY * abs(self.separation)
        return self.told and abs(self.excess) > doubt and self.input_error > MATTERS


@dataclass(frozen=True)
class Misplaced:
    """A probe whose stated position does not fit the waves.

    Parameters
    ----------
    probe, other : str
        The probe, and the one that it was compared with.
    found : ProbeSeparation
        From `other` to `probe`.
    sure : bool
        Whether it is this probe: the other one agrees with a third, and this one with none.
    """

    probe: str
    other: str
    found: ProbeSeparation
    sure: bool

    def describe(self) -> str:
        """What was stated, what the waves say, and what it would do."""
        found = self.found
        whose = "" if self.sure else ", or the other probe is misplaced"
        return (
            f"stated to stand {found.stated:+.3f} m from {self.other}, and the phases of the waves "
            f"fit {found.separation:+.3f} ± {found.spread:.3f} m{whose}; an elevation carried by "
            f"the stated distance is wrong by {found.input_error:.2f} of its standard deviation"
        )


def misplaced_probes(
    elevations: Mapping[str, npt.ArrayLike],
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
        say nothing: a reflection turns the phase of a single frequency, and only over many of
        them does it average out.

    Raises
    ------
    RequestError
        As :func:`probe_separation`.

    Notes
    -----
    On three probes in seas of the paper's band (Tp 2.05 s, depth 3.6 m, 20 seeds each of 210 s
    with 2 % noise, with reflections of 10 and of 20 %, with noise of 20 %, and of 60 s) no right
    position and none wrong by 0.05 m was doubted, and 0.18 m was told with the right probe in all.
    Regular waves before a model are left out for a reason: on the measured ship section their
    phases move by up to a fifth of a wavelength with what the model reflects.
    """
    telling = {
        name: series
        for name, series in elevations.items()
        if name in positions and _telling(as_series(series))
    }
    names = sorted(telling, key=lambda name: positions[name])
    pairs = list(pairwise(names))
    if len(names) > 2:
        pairs.append((names[0], names[-1]))
    found = {
        (a, b): probe_separation(telling[a], telling[b], dt, depth, positions[b] - positions[a])
        for a, b in pairs
    }
    against = [pair for pair, each in found.items() if each.disagrees]
    backed = {end for pair, each in found.items() if each.told and pair not in against
              for end in pair}  # fmt: skip
    out: dict[tuple[str, ...], Misplaced] = {}
    for a, b in sorted(against, key=lambda pair: found[pair].spread):
        if a not in backed and b in backed:
            out.setdefault((a,), Misplaced(a, b, found[a, b].reversed(), sure=True))
        else:
            sure = b not in backed and a in backed
            out.setdefault((b,) if sure else (a, b), Misplaced(b, a, found[a, b], sure))
    return list(out.values())


def _telling(series: FloatArray) -> bool:
    """Whether a record holds irregular waves, and enough of them."""
    if series.size < 64 or np.ptp(series) == 0:
        return False
    rises = np.diff(np.sign(series - series.mean())) > 0
    return int(rises.sum()) >= LEAST_WAVES and not is_regular(series)


def probe_separation(
    first: npt.ArrayLike, second: npt.ArrayLike, dt: float, depth: float, stated: float
) -> ProbeSeparation:
    r"""Separation of two wave probes from the phases of their cross-spectrum.

    The separation d is where the correlation of the second record with the first, carried by
    linear dispersion,

    .. math:: \rho(d) = \frac{\mathrm{Re}\sum_f \bar X_1 X_2 e^{i k(f) d}}
                             {\sqrt{\sum_f |X_1|^2 \sum_f |X_2|^2}}

    is greatest. It is sought as far as the waves' groups get in a quarter of the record, upstream
    too. In a narrow band neighbouring maxima, a wavelength apart, are nearly as high: of those
    within a tenth of the highest, and not lower by three standard errors of the difference, the
    one nearest to the stated separation is taken. So regular waves tell a separation within half
    a wavelength only.

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
    >>> found = probe_separation(waves(0.0), waves(3.85), 0.1, 3.6, stated=3.67)
    >>> round(found.separation, 2)
    3.85
    """
    a, b = as_series(first, minimum=64), as_series(second, minimum=64)
    if a.ndim != 1 or a.shape != b.shape:
        raise RequestError(
            f"two records of the same length are needed, shape (time,); received {a.shape} and "
            f"{b.shape}. Cut them to their common time."
        )
    interval, place = positive("the time step", dt, "s"), float(stated)
    if not np.isfinite(place):
        raise RequestError(f"the stated separation must be a number (m); received {stated!r}.")
    for name, each in (("first", a), ("second", b)):
        if np.ptp(each) == 0:
            raise DataError(
                f"the {name} record is constant ({each[0]:g}): no wave passes it. Look for a dead "
                "probe."
            )
    cross, power, k = _spectra(a, b, interval, depth)
    period = encounter_period(a, interval)
    reach = float(group_speed(2 * np.pi / period, depth)) * REACH * a.size * interval
    reach = max(reach, abs(place) + np.pi / float(k[np.argmax(np.abs(cross))]))
    step = 2 * np.pi / float(k[-1]) / PLACES
    coarse = np.arange(-reach, reach, step)
    scores = _scores(cross, power, k, coarse)
    best = coarse[_chosen(scores, int(np.argmin(np.abs(coarse - place))))]
    fine = best + step * np.arange(-2 * FINER, 2 * FINER + 1) / FINER
    scores = _scores(cross, power, k, fine)
    total = scores.sum(axis=0)
    found = _highest(fine, total)
    left_out = np.array([_highest(fine, total - each) for each in scores])
    count = GROUPS
    spread = np.sqrt((count - 1) / count * np.sum((left_out - left_out.mean()) ** 2))
    turned = np.abs(1.0 - np.exp(1j * k * (found - place))) ** 2
    weight = np.abs(cross)
    return ProbeSeparation(
        separation=found,
        spread=float(spread),
        correlation=float(total.max()),
        stated=place,
        input_error=float(np.sqrt(np.sum(weight * turned) / np.sum(weight))),
    )


def _spectra(
    a: FloatArray, b: FloatArray, dt: float, depth: float
) -> tuple[ComplexArray, float, FloatArray]:
    """Cross-spectrum where there is energy, the product of the records' norms, wavenumbers."""
    taper = scipy.signal.windows.tukey(a.size, 0.2)
    first, second = (fft.rfft(taper * (each - each.mean())) for each in (a, b))
    frequency = fft.rfftfreq(a.size, dt)
    cross = np.conj(first) * second
    norm = float(np.sqrt(np.sum(np.abs(first[1:]) ** 2) * np.sum(np.abs(second[1:]) ** 2)))
    smooth = np.convolve(np.abs(cross), np.ones(9) / 9, mode="same")
    kept = (smooth > ENERGY * smooth[1:].max()) & (frequency > 0)
    return cross[kept], norm, wavenumber(2 * np.pi * frequency[kept], depth)


def _scores(cross: ComplexArray, norm: float, k: FloatArray, distances: FloatArray) -> FloatArray:
    """Parts of the correlation that the groups of frequencies make, shape (group, distance)."""
    group = (np.arange(k.size) // NEIGHBOURS) % GROUPS
    out = np.zeros((GROUPS, distances.size))
    for number in range(GROUPS):
        own = group == number
        turned = np.exp(1j * np.outer(distances, k[own]))
        out[number] = (turned @ cross[own]).real / norm
    return out


def _chosen(scores: FloatArray, stated: int) -> int:
    """Of the maxima that may be the highest, the one nearest to what is stated."""
    total = scores.sum(axis=0)
    inner = total[1:-1]
    peaks = np.flatnonzero((inner >= total[:-2]) & (inner >= total[2:])) + 1
    best = peaks[np.argmax(total[peaks])]
    parts = scores[:, [best]] - scores[:, peaks]
    # Jackknife of a sum over groups: leaving one out leaves its part out.
    error = np.sqrt((GROUPS - 1) / GROUPS * np.sum((parts - parts.mean(axis=0)) ** 2, axis=0))
    alike = (total[peaks] >= NEARLY * total[best]) & (parts.sum(axis=0) <= SURELY * error)
    near = peaks[alike]
    return int(near[np.argmin(np.abs(near - stated))])


def _highest(places: FloatArray, values: FloatArray) -> float:
    """Place of the maximum, by the parabola through it and its neighbours."""
    at = int(np.clip(np.argmax(values), 1, values.size - 2))
    before, here, after = values[at - 1 : at + 2]
    bend = before - 2 * here + after
    shift = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(places[at] + np.clip(shift, -1.0, 1.0) * (places[1] - places[0]))
