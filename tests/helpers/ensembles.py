"""Ensembles of few members, and runs for them."""

import numpy as np
from records import record

from seakeep import BayesianHankelDMDc, Uniform

STATES, INPUTS = ["heave", "pitch"], ["eta"]


def wave_run(seed=0, samples=900, name="irregular", noise=0.02):
    """Of 0.1 s: a linear response to a narrow-banded input, with noise that no member knows of."""
    rng = np.random.default_rng(seed)
    frequencies = rng.uniform(0.3, 1.0, 40)
    angles = 0.2 * np.pi * np.outer(np.arange(samples), frequencies) + rng.uniform(0, 2 * np.pi, 40)
    gain = 1 / (1 + (frequencies / 0.6) ** 4)
    series = {
        "heave": np.cos(angles - 0.4) @ gain,
        "pitch": np.sin(angles - 1.1) @ (gain * frequencies),
        "eta": np.cos(angles).sum(axis=1),
    }
    for key in STATES:
        series[key] += noise * rng.normal(size=samples)
    return record(0.1, {"run": name}, **series)


def few(**changes):
    """Settings of four members that all runs teach, changed as asked for."""
    settings = {
        "encounter_period": 1.6,
        "window": None,
        "state_delays": Uniform("0.2 T", "0.6 T"),
        "input_delays": Uniform("0.5 T", "1.5 T"),
        "ridge": Uniform(1, 10),
        "n_members": 4,
        "delay_rows": "exact",
    }
    return BayesianHankelDMDc(**settings | changes)
