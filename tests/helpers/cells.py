"""Test sets of a study from arrays."""

import xarray as xr

from seakeep.study.judge import MEASURES

DIMS = {
    "error": "model measure training window channel",
    "error_over_time": "model band training window time",
    "growth": "model band training window channel",
    "judged": "training window",
    "level": "model band training window channel",
    "lower": "ensemble training window time channel",
    "mean": "model training window time channel",
    "measured": "window time channel",
    "run": "window",
    "start": "window",
    "training_std": "training channel",
    "upper": "ensemble training window time channel",
}


def cells(channels, time, models=("m",), **arrays):
    """Arrays by their names, over the dimensions that they have in a result."""
    coords = {"channel": channels, "time": time, "measure": list(MEASURES)}
    coords |= {"model": list(models), "ensemble": list(models)}
    return xr.Dataset({name: (DIMS[name].split(), x) for name, x in arrays.items()}, coords)
