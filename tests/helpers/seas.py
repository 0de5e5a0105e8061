"""Irregular seas whose components are known."""

from dataclasses import dataclass
from math import tau

import numpy as np

from seakeep.waves import wavenumber


@dataclass(frozen=True)
class Sea:
    """A sum of waves in water of some depth, frequencies in Hz."""

    frequency: np.ndarray
    amplitude: np.ndarray
    phase: np.ndarray
    depth: float = 3.6

    def at(self, time, place=0.0):
        """Elevation at a place, fixed or moving, m downstream."""
        omega = tau * self.frequency
        turn = np.outer(time, omega) - np.outer(place + 0 * time, wavenumber(omega, self.depth))
        return np.cos(turn + self.phase) @ self.amplitude


def sea(seed=0, band=(0.28, 1.13), peak=2.05, components=100, jitter=1.0):
    """Pierson and Moskowitz' spectrum in the paper's band, SD 1: a component in each part of it.

    Without jitter each stands in the middle of its part.
    """
    rng = np.random.default_rng(seed)
    edges = np.linspace(*band, components + 1)
    f = edges[:-1] + np.diff(edges) * (0.5 + jitter * rng.uniform(-0.5, 0.5, components))
    amplitude = np.sqrt(f**-5 * np.exp(-1.25 * (peak * f) ** -4))
    amplitude /= np.sqrt(0.5 * np.sum(amplitude**2))
    return Sea(f, amplitude, rng.uniform(0, tau, components))
