"""The score of free runs by a plain loop of forecasts."""

import numpy as np

from seakeep import metrics


def loop_score(model, run, states, steps, first):
    """Mean NRMSE of forecasts one after the other, each at most 1: no worse than the mean."""
    errors = []
    for at in range(first, run.sizes["time"] - max(model.lead_samples, 1) - steps + 1, steps):
        forecast = model.forecast(run, float(run["time"][at]), steps)
        measured = run[states].isel(time=slice(at + 1, at + 1 + steps))
        found = metrics.nrmse(predicted=forecast, measured=measured)
        errors += [min(float(found[state]), 1.0) for state in states]
    return np.mean(errors)
