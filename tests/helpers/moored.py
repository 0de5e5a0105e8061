"""A synthetic moored vessel, linear but for a line that may fall slack."""

import numpy as np
from records import record
from scipy import signal

DT, PERIOD = 0.1, 10  # s, samples
STATES, INPUTS = ["surge", "heave", "pitch", "mooring_bow", "mooring_stern"], ["eta"]
FLOOR, NOISE = 2.0, 0.5  # N


def moored_run(seed=0, slack=True):
    """70 s; surge, heave and pitch are filters of the wave; the stern line is taut where they pull.

    Its load is max(FLOOR, 8 + 20 surge + 4 pitch) with a noise of NOISE, or the same without the
    floor; the bow line is linear.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(900) * DT
    eta = np.zeros(t.size)
    for _ in range(12):
        eta += 0.1 * np.cos(2 * np.pi * rng.uniform(0.7, 1.3) * t + rng.uniform(0, 2 * np.pi))
    surge = signal.lfilter([0.0, 0.3], [1.0, -1.6, 0.75], eta)
    heave = signal.lfilter([0.0, 0.2], [1.0, -1.5, 0.8], eta)
    pitch = signal.lfilter([0.0, 0.0, 0.3], [1.0, -1.4, 0.7], eta)
    stern = 8.0 + 20.0 * surge + 4.0 * pitch
    if slack:
        stern = np.maximum(FLOOR, stern)
    loads = np.stack([40.0 - 20.0 * surge, stern]) + NOISE * rng.standard_normal((2, t.size))
    values = np.stack([surge, heave, pitch, *loads, eta])[:, 200:]
    attrs = {"encounter_period": PERIOD * DT, "run": f"run{seed}", "waves": "irregular"}
    return record(DT, attrs, **dict(zip(STATES + INPUTS, values, strict=True)))


def moored_runs(**more):
    """Three of them."""
    return {f"run{seed}": moored_run(seed, **more) for seed in range(3)}
