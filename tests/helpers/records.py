"""Runs made of arrays, arrays of runs, noise with a memory, and how large values are."""

import numpy as np
import xarray as xr
from scipy.signal import lfilter

from seakeep.conventions import canonical_channel


def record(step, /, attrs=None, **channels):
    """A run whose samples are `step` seconds apart; channels of free names are in metres."""
    samples = len(next(iter(channels.values())))
    return xr.Dataset(
        {
            name: ("time", x, {"units": getattr(canonical_channel(name), "units", "m")})
            for name, x in channels.items()
        },
        {"time": step * np.arange(samples)},
        attrs,
    )


def table(run, names):
    """Values of channels side by side, on the last axis."""
    return np.stack([run[name].values for name in names], axis=-1)


def arrays_at(model, run, start):
    """States and inputs up to a start, and the inputs after it, as `forecast_arrays` takes them."""
    now = round(start / model.dt) + 1
    x, u = table(run, model.states), table(run, model.inputs)
    return x[:now], u[:now], u[now:]


def fed(live, inputs, states):
    """A model in service, after these samples."""
    for sample in zip(inputs, states, strict=True):
        live.step(*sample)
    return live


def rms(values):
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def autoregressive(noise, part, axis=-1):
    """Series of which each value is a part of the one before, and noise."""
    return lfilter([1.0], [1.0, -part], noise, axis=axis)
