r"""Froude's law: what a model's value means at full scale.

With the scale factor :math:`\lambda` (full-scale length over model length), gravity the same:
lengths go with :math:`\lambda`, times with :math:`\lambda^{1/2}`, masses with
:math:`r\,\lambda^3`, r the ratio of the water's densities; angles do not change.
"""

from __future__ import annotations

import xarray as xr

from seakeep.conventions import base_powers
from seakeep.errors import RequestError

__all__ = ["froude_factor", "to_full_scale"]


def froude_factor(units: str, scale: float, density_ratio: float = 1.0) -> float:
    """Factor from a model's value to the full-scale one.

    Parameters
    ----------
    units : str
        Unit of the value, such as ``"m/s^2"`` or ``"N"``.
    scale : float
        Scale factor, full-scale length over model length.
    density_ratio : float, optional
        Density of the sea over that of the basin's water; 1.025 from fresh to sea water.

    Returns
    -------
    float
        The factor.

    Raises
    ------
    RequestError
        If a number is not positive, or the unit is not mechanical.

    Examples
    --------
    >>> froude_factor("m", 50), round(froude_factor("s", 50), 3), froude_factor("N", 50)
    (50.0, 7.071, 125000.0)
    >>> froude_factor("m/s^2", 50), round(froude_factor("rad/s", 50), 4)
    (1.0, 0.1414)
    """
    for name, value in (("the scale factor", scale), ("the density ratio", density_ratio)):
        if not 0 < value < float("inf"):
            raise RequestError(f"{name} must be positive; received {value!r}.")
    length, time, mass, others = base_powers(units)
    if others:
        raise RequestError(
            f"the unit '{units}' is not mechanical, so Froude's law does not scale it. Convert "
            "the channel to a mechanical unit first, or leave it out."
        )
    return float(scale ** (length + 0.5 * time + 3.0 * mass) * density_ratio**mass)


def to_full_scale(run: xr.Dataset, scale: float, density_ratio: float = 1.0) -> xr.Dataset:
    """Convert a run, or a forecast, from model to full scale.

    Parameters
    ----------
    run : Dataset
        With a coordinate ``time`` in seconds and ``units`` on each variable.
    scale : float
        Scale factor, full-scale length over model length.
    density_ratio : float, optional
        As in :func:`froude_factor`.

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
        out[name] = variable.assign_coords(time=out["time"]) * factor
        out[name].attrs = dict(variable.attrs)
        if "training_std" in variable.attrs:
            out[name].attrs["training_std"] = factor * float(variable.attrs["training_std"])
        if "x_position" in variable.attrs:
            out[name].attrs["x_position"] = scale * float(variable.attrs["x_position"])
    out.attrs = dict(run.attrs) | {"scale": "full", "scale_factor": float(scale)}
    for key, unit in _ATTRIBUTES.items():
        if key not in run.attrs:
            continue
        by = clock if unit == "s" else scale
        value = run.attrs[key]
        pair = isinstance(value, tuple | list)
        out.attrs[key] = tuple(by * float(v) for v in value) if pair else by * float(value)
    return out


_ATTRIBUTES = {"dt": "s", "start": "s", "encounter_period": "s", "train_span": "s",
               "test_span": "s", "probe_offset_span": "s", "water_depth": "m",
               "probe_offset": "m", "probe_offset_spread": "m"}  # fmt: skip
