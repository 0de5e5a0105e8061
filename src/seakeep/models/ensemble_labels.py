"""Names, units and words on what an ensemble forecasts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.models.forecasting import ForecastWindow, status_text
from seakeep.models.labelled import ChannelLabel

__all__ = ["label_channels", "statuses", "verdict", "window_coords"]

FloatArray = npt.NDArray[np.float64]


def label_channels(
    labels: Sequence[ChannelLabel], spread: FloatArray, values: FloatArray, dims: tuple[str, ...]
) -> dict[str, xr.Variable]:
    """Variables of values of shape (…, N), with units and spread in training."""
    return {
        label.name: xr.Variable(
            dims,
            values[..., column],
            {
                "units": label.units,
                "long_name": label.long_name,
                "training_std": float(spread[column]),
            },
        )
        for column, label in enumerate(labels)
    }


def window_coords(windows: Sequence[ForecastWindow], dt: float) -> dict[str, xr.Variable]:
    """Start of each of several windows, and the time after it."""
    lead = dt * np.arange(1, windows[0].steps + 1)
    starts = np.array([window.start for window in windows])
    return {
        "start": xr.Variable(("window",), starts, {"units": "s", "long_name": "start"}),
        "lead": xr.Variable(("lead",), lead, {"units": "s", "long_name": "time after start"}),
    }


def statuses(lost: npt.NDArray[np.int64], time: FloatArray, dt: float) -> npt.NDArray[np.str_]:
    """Status of each member from its first lost instant, or −1."""
    return np.array([status_text(int(at), time, dt) for at in lost], dtype=str)


def verdict(lost: npt.NDArray[np.int64]) -> dict[str, Any]:
    """Attributes that count the members that were lost."""
    diverged = int(np.count_nonzero(lost >= 0))
    status = f"{diverged} of {len(lost)} members diverged" if diverged else "ok"
    return {"status": status, "diverged": diverged}
