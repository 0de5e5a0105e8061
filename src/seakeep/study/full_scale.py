"""Runs and forecasts at full scale, by Froude's law."""

from __future__ import annotations

import xarray as xr

from seakeep.errors import RequestError
from seakeep.signals.froude import froude_factor

ATTRIBUTES = {"dt": "s", "start": "s", "encounter_period": "s", "train_span": "s",
               "test_span": "s", "water_depth": "m",
               "reads_input_until": "s", "input_predicted_from": "s", "diverged_at": "s",
               "probe_offset": "m", "probe_offset_spread": "m"}  # fmt: skip
"""Times and lengths among the attributes of a run, with their units."""


def to_full_scale(run: xr.Dataset, scale: float, density_ratio: float = 1.0) -> xr.Dataset:
    """Convert a run, or a forecast, from model to full scale.

    Parameters
    ----------
    run : Dataset
        With a coordinate ``time`` in seconds and ``units`` on each variable.
    scale : float
        Scale factor, full-scale length over model length.
    density_ratio : float, optional
        As in :func:`seakeep.signals.froude_factor`.

    Returns
    -------
    Dataset
        Times and values at full scale; units keep their names. ``attrs["scale"]`` says
        ``"full"``; times and lengths among the attributes are converted with them.

    Raises
    ------
    RequestError
        If the run is at full scale already, or a unit does not scale.

    Examples
    --------
    >>> run = xr.Dataset(
    ...     {"heave": ("time", [0.1, 0.2], {"units": "m"})},
    ...     {"time": ("time", [0.0, 1.0], {"units": "s"})},
    ... )
    >>> full = to_full_scale(run, 100.0)
    >>> full["heave"].values, full["time"].values
    (array([10., 20.]), array([ 0., 10.]))
    """
    if run.attrs.get("scale") == "full":
        raise RequestError("the run is at full scale already; convert it once.")
    clock = froude_factor("s", scale)
    out = run.assign_coords(time=run["time"] * clock)
    out["time"].attrs = dict(run["time"].attrs)
    for name, variable in run.data_vars.items():
        factor = froude_factor(str(variable.attrs.get("units", "1")), scale, density_ratio)
        out[name] = times(variable.assign_coords(time=out["time"]), factor)
        if "x_position" in variable.attrs:
            out[name].attrs["x_position"] = scale * float(variable.attrs["x_position"])
    out.attrs = dict(run.attrs) | {"scale": "full", "scale_factor": float(scale)}
    for key in ATTRIBUTES.keys() & run.attrs:
        by = clock if ATTRIBUTES[key] == "s" else scale
        value = run.attrs[key]
        pair = isinstance(value, tuple | list)
        out.attrs[key] = tuple(by * float(v) for v in value) if pair else by * float(value)
    return out


def times(channel: xr.DataArray, factor: float) -> xr.DataArray:
    """Multiply a channel, and the standard deviations among its attributes, by a factor."""
    known = {"training_std", "noise_std"} & set(channel.attrs)
    spreads = {key: factor * float(channel.attrs[key]) for key in known}
    return (channel * factor).assign_attrs(channel.attrs | spreads)
