"""The problem of the paper's size that everything here is timed on: a linear system in waves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import signal

STATES, INPUTS = 11, 2
STATE_DELAYS, INPUT_DELAYS, SNAPSHOTS, RIDGE = 32, 160, 640, 100.0
STEPS = 480
DT = 1.64 / 32
NOISE = 0.05
"""White noise on the states, standard deviations."""
INPUT_NOISE = 0.01
"""The same on the measured inputs, as a wave probe has it.

Without any, a narrow-banded sea determines its own future from its past, and subspace methods
(N4SID), which take the future input out of the future output, are left with nothing to identify."""


@dataclass(frozen=True)
class Problem:
    """Arrays of one run and where it is cut.

    Parameters
    ----------
    states, inputs : ndarray, shapes (time, N) and (time, Q)
        The series.
    stop : int
        Last sample of the training window; forecasts start at it or later.
    """

    states: np.ndarray
    inputs: np.ndarray
    stop: int


def linear_system(samples: int = 4096, states: int = STATES, inputs: int = INPUTS, seed: int = 0):
    """Damped oscillators of 3 to 12 encounter periods' memory, driven by a narrow-banded sea.

    Returns
    -------
    Problem
        Unit-variance states and inputs, with white noise on top.
    """
    rng = np.random.default_rng(seed)
    time = np.arange(samples + 512) * DT
    frequencies = np.sort(rng.uniform(0.28, 1.13, 100))
    spectrum = np.exp(-0.5 * ((frequencies - 0.6) / 0.12) ** 2)
    phases = rng.uniform(0, 2 * np.pi, (inputs, 100))
    sea = np.stack(
        [np.cos(2 * np.pi * np.outer(time, frequencies) + p) @ spectrum for p in phases], axis=1
    )
    sea /= sea.std(axis=0)
    modes = max(states // 2 + 1, 2)
    modal = np.empty((time.size, 2 * modes))
    for mode in range(modes):
        frequency = 2 * np.pi * rng.uniform(0.1, 1.0)
        damping = rng.uniform(0.05, 0.3)
        plant = signal.cont2discrete(
            (
                np.array([[0, 1], [-(frequency**2), -2 * damping * frequency]]),
                np.vstack([np.zeros(inputs), frequency**2 * rng.normal(size=inputs)]),
                np.eye(2),
                np.zeros((2, inputs)),
            ),
            DT,
        )
        modal[:, 2 * mode : 2 * mode + 2] = signal.dlsim(plant, sea)[1]
    motions = modal @ rng.normal(size=(2 * modes, states))
    motions, sea = motions[512:], sea[512:]
    motions = motions / motions.std(axis=0) + NOISE * rng.normal(size=motions.shape)
    sea = sea + INPUT_NOISE * rng.normal(size=sea.shape)
    return Problem(np.ascontiguousarray(motions), np.ascontiguousarray(sea), samples // 2)


def names(states: int = STATES, inputs: int = INPUTS) -> tuple[list[str], list[str]]:
    """Channel names of the states and the inputs."""
    return [f"x{i}" for i in range(states)], [f"u{i}" for i in range(inputs)]


def as_run(problem: Problem) -> xr.Dataset:
    """The problem as the labelled run that the package takes."""
    states, inputs = names(problem.states.shape[1], problem.inputs.shape[1])
    columns = [*zip(states, problem.states.T, strict=True)]
    columns += [*zip(inputs, problem.inputs.T, strict=True)]
    time = np.arange(len(problem.states)) * DT
    attrs = {"units": "m"}
    return xr.Dataset(
        {name: ("time", np.array(values), attrs) for name, values in columns},
        coords={"time": ("time", time, {"units": "s"})},
        attrs={"run": "synthetic"},
    )
