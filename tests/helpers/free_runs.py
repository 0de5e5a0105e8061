"""Scores of free runs by plain loops of fits and forecasts."""

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


def held_out_scores(spec, runs, states, inputs, steps, first, groups=None):
    """Scores of runs by models that the others teach, or those of other groups."""
    groups = groups or {name: name for name in runs}
    found = []
    for name, run in runs.items():
        others = [runs[key] for key in runs if groups[key] != groups[name]]
        found.append(loop_score(spec.fit(others, states, inputs), run, states, steps, first))
    return found
