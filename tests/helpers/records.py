"""Runs made of arrays, in metres, arrays of runs, and how large their values are."""

import numpy as np
import xarray as xr


def record(step, /, attrs=None, **channels):
    """A run whose samples are `step` seconds apart; rates are in m/s."""
    samples = len(next(iter(channels.values())))
    return xr.Dataset(
        {
            name: ("time", x, {"units": "m/s" if name.endswith("_rate") else "m"})
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


def rms(values):
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))
