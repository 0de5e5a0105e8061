"""A heave that is linear in the wave, and a drift that goes with its slow square."""

import numpy as np
from records import record
from scipy import signal

DT, PERIOD = 0.1, 10  # s, samples
STATES, INPUTS = ["heave", "drift"], ["eta"]


def sea(seed, samples=700, frequency=None):
    """A run in irregular waves, or in regular ones of a `frequency` (Hz)."""
    rng = np.random.default_rng(seed)
    t = np.arange(samples) * DT
    eta = np.zeros(samples)
    for _ in range(12 if frequency is None else 1):
        omega = 2 * np.pi * (rng.uniform(0.7, 1.3) if frequency is None else frequency)
        eta += (0.1 if frequency is None else 0.3) * np.cos(omega * t + rng.uniform(0, 2 * np.pi))
    heave = signal.lfilter([0.0, 0.2], [1.0, -1.5, 0.8], eta)
    square = np.convolve(eta**2, np.hanning(31) / np.hanning(31).sum(), "same")
    drift = signal.lfilter([0.0, 0.5], [1.0, -0.97], square)
    channels = {"eta": eta, "heave": heave, "drift": drift}
    for x in channels.values():
        x += 0.03 * x.std() * rng.normal(size=samples)
    return record(DT, {"encounter_period": PERIOD * DT}, **channels)


def runs(count=3):
    return {f"run{number}": sea(number) for number in range(count)}
