r"""Head seas of the virtual tank: spectra, their components, elevation at any place and time.

Elevation is :math:`\eta = \sum a_n \cos(k_n x - \omega_n t + \varphi_n)` with x measured from
the vessel's position at rest, downstream.
"""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from seakeep.arrays import ArrayLike, ComplexArray, FloatArray
from seakeep.errors import RequestError
from seakeep.tank.settings import FacilitySettings, RunPlan, SpectrumSettings
from seakeep.waves import wavelength_to_frequency, wavenumber

BLOCK = 512  # instants evaluated at a time at a fixed place


@dataclass(frozen=True)
class Sea:
    """Components of a unidirectional linear sea, SI; phases (rad) at x = 0 and t = 0."""

    omega: FloatArray
    amplitude: FloatArray
    phase: FloatArray
    wavenumber: FloatArray

    def analytic(self, x: ArrayLike, time: ArrayLike) -> ComplexArray:
        """Complex elevation: its real part is the elevation, its modulus the envelope.

        Places (m) are broadcast against instants (s).
        """
        place, t = np.broadcast_arrays(x, time)
        if np.ndim(x) == 0 and t.ndim == 1 and t.size > BLOCK:
            steps = np.diff(t)
            if np.ptp(steps) < 1e-9 * abs(steps[0]) + 1e-11:
                return self._at_rest(place[0], t)
        out = np.zeros(t.shape, complex)
        for w, a, p, k in zip(self.omega, self.amplitude, self.phase, self.wavenumber, strict=True):
            out += a * np.exp(1j * (k * place - w * t + p))
        return out

    def _at_rest(self, x: float, time: FloatArray) -> ComplexArray:
        """Complex elevation at one place and uniform instants, block by block."""
        step = (time[-1] - time[0]) / (time.size - 1)
        starts = time[0] + step * BLOCK * np.arange(-(-time.size // BLOCK))
        heads = self.amplitude * np.exp(
            1j * (self.wavenumber * x + self.phase - np.outer(starts, self.omega))
        )
        inside = np.exp(-1j * np.outer(self.omega, step * np.arange(BLOCK)))
        # einsum, not a matrix product: its bits do not depend on the number of threads.
        return np.einsum("sn,nb->sb", heads, inside).ravel()[: time.size]

    def elevation(self, x: ArrayLike, time: ArrayLike) -> FloatArray:
        """Elevation at places and instants, m; a moving place has one x per instant."""
        return self.analytic(x, time).real

    @property
    def mean_wavenumber(self) -> float:
        """Wavenumber at the energy-weighted mean frequency, rad/m."""
        energy = self.amplitude**2
        if not energy.sum() > 0:
            return 0.0
        middle = np.argmin(np.abs(self.omega - np.average(self.omega, weights=energy)))
        return self.wavenumber[middle]


def pierson_moskowitz(frequency: FloatArray, height: float, peak_period: float) -> FloatArray:
    """Pierson–Moskowitz spectrum (m²/Hz; equation eq:pm of the paper) at frequencies in Hz.

    Examples
    --------
    >>> f = np.arange(0.005, 20, 0.001)
    >>> round(float(4 * np.sqrt(np.sum(pierson_moskowitz(f, 0.15, 2.12)) * 0.001)), 4)
    0.15
    """
    relative = (peak_period * frequency) ** -4.0
    return 5 / 16 * height**2 * relative / frequency * np.exp(-1.25 * relative)


def jonswap(
    frequency: FloatArray, height: float, peak_period: float, peak_enhancement: float = 3.3
) -> FloatArray:
    """JONSWAP spectrum (m²/Hz), normalised so that its significant height is `height`.

    A peak enhancement of 1 gives Pierson–Moskowitz.
    """

    def shape(f: FloatArray) -> FloatArray:
        relative = f * peak_period
        width = np.where(relative <= 1.0, 0.07, 0.09)
        peak = peak_enhancement ** np.exp(-0.5 * ((relative - 1.0) / width) ** 2)
        return pierson_moskowitz(f, height, peak_period) * peak

    grid = np.geomspace(0.1, 40.0, 8001) / peak_period
    variance = np.trapezoid(shape(grid), grid)
    return shape(frequency) * (height**2 / 16 / variance)


def spectral_density(settings: SpectrumSettings, frequency: FloatArray) -> FloatArray:
    """Density of a spectrum that settings describe, m²/Hz at frequencies in Hz.

    A table is interpolated linearly and is zero outside its span.
    """
    if settings.kind == "table":
        return np.interp(frequency, settings.frequencies, settings.densities, left=0.0, right=0.0)
    height, period = settings.height or 0.0, settings.peak_period or 0.0
    if settings.kind == "jonswap":
        return jonswap(frequency, height, period, settings.peak_enhancement)
    return pierson_moskowitz(frequency, height, period)


def irregular_sea(settings: SpectrumSettings, depth: float, rng: Generator) -> Sea:
    """Draw the components of an irregular sea, of amplitude √(2 E Δf) and random phase.

    Equal spacing repeats the sea's envelope after one over the spacing; jittered frequencies (one
    uniform in each bin) do not.
    """
    count, (low, high) = settings.components, settings.band
    if settings.spacing == "equal":
        frequency = np.linspace(low, high, count) if count > 1 else np.array([0.5 * (low + high)])
        width = (high - low) / max(count - 1, 1)
    else:
        width = (high - low) / count
        frequency = low + width * (np.arange(count) + rng.uniform(size=count))
    amplitude = np.sqrt(2.0 * spectral_density(settings, frequency) * width)
    omega = 2 * np.pi * frequency
    phase = rng.uniform(0.0, 2 * np.pi, count)
    return Sea(omega, amplitude, phase, wavenumber(omega, depth))


def regular_sea(
    wavelength: float, height: float, unsteadiness: float, depth: float, rng: Generator
) -> Sea:
    """Draw a regular wave, with a sideband at either side unless it is steady.

    The sidebands lie 3–6 % away in frequency, `unsteadiness` of the wave's amplitude each, and
    make the height wander as a real wave maker's does.
    """
    centre = wavelength_to_frequency(wavelength, depth)
    phase = rng.uniform(0.0, 2 * np.pi, 3)
    shift = rng.uniform(0.03, 0.06, 2)
    omega = centre * np.array([1.0, 1.0 - shift[0], 1.0 + shift[1]])
    amplitude = 0.5 * height * np.array([1.0, unsteadiness, unsteadiness])
    kept = slice(3 if unsteadiness > 0 else 1)
    omega = omega[kept]
    return Sea(omega, amplitude[kept], phase[kept], wavenumber(omega, depth))


def sea_of_run(name: str, run: RunPlan, facility: FacilitySettings, rng: Generator) -> Sea:
    """Sea of one run, checked against what the tank can make.

    Raises RequestError if a frequency or the height is beyond the wave maker.
    """
    low, high = facility.wave_band
    depth = facility.water_depth
    if run.spectrum:
        sea = irregular_sea(run.spectrum, depth, rng)
        asked = run.spectrum.band
        height = 4.0 * np.sqrt(0.5 * np.sum(sea.amplitude**2))
    else:
        length, height = run.wavelength or 0.0, run.height or 0.0
        sea = regular_sea(length, height, run.unsteadiness, depth, rng)
        asked = (sea.omega[0] / (2 * np.pi),) * 2
    if asked[0] < low or asked[1] > high:
        wanted = "–".join(dict.fromkeys(f"{f:.3g}" for f in asked))
        longest, shortest = 2 * np.pi / wavenumber([2 * np.pi * low, 2 * np.pi * high], depth)
        raise RequestError(
            f"runs.{name} asks for waves of {wanted} Hz; the wave maker covers {low:g}–{high:g} Hz "
            f"(wavelengths of {shortest:.2f}–{longest:.1f} m). Change the wave, or "
            "facility.wave_band."
        )
    if height > facility.greatest_height:
        raise RequestError(
            f"runs.{name} asks for waves {height:.3g} m high; the wave maker reaches "
            f"{facility.greatest_height:g} m. Lower the height, or raise facility.greatest_height."
        )
    return sea
