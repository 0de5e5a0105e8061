"""An oscillator whose law is known."""

from dataclasses import dataclass

import numpy as np
from records import record
from scipy import linalg


@dataclass(frozen=True)
class Oscillator:
    """A mass, a spring and a damper under a force held over each step; s and rad/s."""

    ratio: float = 0.06
    dt: float = 0.25
    frequency: float = 2.0

    @property
    def discrete(self):
        """Exact discretisation of position and velocity, by the matrix exponential."""
        block = np.zeros((3, 3))
        block[0, 1] = 1.0
        block[1] = [-(self.frequency**2), -2 * self.ratio * self.frequency, 1.0]
        step = linalg.expm(block * self.dt)
        return step[:2, :2], step[:2, 2]

    @property
    def arx(self):
        """Coefficients (a0, a1, b0, b1) of y' = a0 y + a1 y₋₁ + b0 u + b1 u₋₁.

        Eliminating the velocity (Cayley and Hamilton): a0 = tr F, a1 = −det F, b0 = g₁,
        b1 = F₁₂ g₂ − F₂₂ g₁.
        """
        f, g = self.discrete
        return np.array([np.trace(f), -np.linalg.det(f), g[0], f[0, 1] * g[1] - f[1, 1] * g[0]])

    def run(self, samples=200, seed=0):
        """Motion under the random force ``eta_fwd``, from a random start."""
        rng = np.random.default_rng(seed)
        f, g = self.discrete
        force = rng.standard_normal(samples)
        state = np.empty((samples, 2))
        state[0] = 2 * rng.standard_normal(2)
        for k in range(samples - 1):
            state[k + 1] = f @ state[k] + g * force[k]
        attrs = {"encounter_period": 3.0}
        return record(self.dt, attrs, heave=state[:, 0], heave_rate=state[:, 1], eta_fwd=force)
