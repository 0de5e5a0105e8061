"""Runs whose law is known."""

from dataclasses import dataclass, replace

import numpy as np
from records import record
from scipy import signal

from seakeep import HankelDMDc


@dataclass(frozen=True)
class Oscillator:
    """A mass, a spring and a damper under a force held over each step; s and rad/s."""

    ratio: float = 0.06
    dt: float = 0.25
    frequency: float = 2.0

    @property
    def system(self):
        """Exact discretisation, with position and velocity as states and the position as output."""
        a = [[0.0, 1.0], [-(self.frequency**2), -2 * self.ratio * self.frequency]]
        law = signal.StateSpace(a, [[0.0], [1.0]], [1.0, 0.0], 0.0).to_discrete(self.dt)
        return law.A, law.B, law.C, law.D

    @property
    def arx(self):
        """Coefficients (a0, a1, b0, b1) of y' = a0 y + a1 y₋₁ + b0 u + b1 u₋₁."""
        (numerator,), denominator = signal.ss2tf(*self.system)
        return np.concatenate([-denominator[1:], numerator[1:]])

    def run(self, samples=200, seed=0):
        """Motion under the random force ``eta_fwd``, from a random start."""
        rng = np.random.default_rng(seed)
        force = rng.standard_normal(samples)
        *_, state = signal.dlsim((*self.system, self.dt), force, x0=2 * rng.standard_normal(2))
        attrs = {"encounter_period": 3.0}
        return record(self.dt, attrs, heave=state[:, 0], heave_rate=state[:, 1], eta_fwd=force)


def growing_model(run, factor, delays=0):
    """A model of heave that grows by a factor a step, whatever the wave."""
    model = HankelDMDc(delays, 0, 1e-9, delay_rows="exact").fit(run, ["heave"], ["eta_fwd"])
    return replace(model, coefficients=factor * np.eye(1, delays + 2))


OF_ARX = ["heave"], ["eta"]
"""States and inputs of :func:`arx_run`."""


def arx_run(seed, a, b, samples, period, noise=0.0):
    """Heave x(k + 1) = a · (x(k), x(k − 1), …) + b · (u(k), …) of a white wave u, by 0.1 s.

    It is measured with a white noise of this part of its standard deviation.
    """
    eta, rest = np.random.default_rng(seed).standard_normal((2, samples))
    heave = signal.lfilter([0.0, *b], [1.0, *np.negative(a)], eta)
    attrs = {"encounter_period": period}
    return record(0.1, attrs, heave=heave + noise * heave.std() * rest, eta=eta)
