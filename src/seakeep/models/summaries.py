"""Mean, standard deviation and quantiles of an ensemble, piece by piece in time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from seakeep.arrays import FloatArray, IntArray, fraction

STATISTICS = ("mean", "std", "lower", "upper")
CHUNK = 8 * 2**20
"""Bytes of all members that are reduced at a time."""
SORTED = 512
"""Members up to which sorting them all is faster than selecting the few that are asked for."""


def statistics_of(values: FloatArray, level: float) -> FloatArray:
    """Statistics over the first axis.

    Parameters
    ----------
    values : ndarray, shape (member, …)
        Members.
    level : float
        Probability between the two quantiles.

    Returns
    -------
    ndarray, shape (4, …)
        Mean, standard deviation (ddof = 1; zero for one member) and the quantiles
        (1 ∓ `level`)/2, exact with linear interpolation between order statistics. NaN without
        members.
    """
    out = np.full((4, *values.shape[1:]), np.nan)
    if not len(values):
        return out
    out[0] = values.mean(axis=0)
    out[1] = values.std(axis=0, ddof=1) if len(values) > 1 else 0.0
    probabilities = 0.5 - level / 2, 0.5 + level / 2
    if len(values) > SORTED:
        out[2:] = np.quantile(values, probabilities, axis=0)
        return out
    # As numpy.quantile gives them to the last bit.
    ordered = np.sort(values, axis=0)
    for row, probability in zip(out[2:], probabilities, strict=True):
        place = probability * (len(ordered) - 1)
        below = int(place)
        low, high, part = ordered[below], ordered[min(below + 1, len(ordered) - 1)], place - below
        np.subtract(high, low, out=row)
        if part < 0.5:  # from the nearer of the two, as NumPy does
            row *= part
            row += low
        else:
            row *= part - 1.0
            row += high
    return out


def statistic_coordinate(level: float, bounds: str = "") -> xr.Variable:
    """Coordinate of the statistics, which says what the bounds of the band are."""
    quantiles = f"the quantiles {0.5 - level / 2:g} and {0.5 + level / 2:g} of the members"
    bounds = bounds or quantiles
    attrs = {
        "long_name": "statistic over the members",
        "comment": f"lower and upper are {bounds}; members that diverged are left out of all four",
    }
    return xr.Variable(("statistic",), list(STATISTICS), attrs)


def reduce_members(series: FloatArray, lost: IntArray, level: float) -> FloatArray:
    """Reduce members to statistics, piece by piece in time.

    A member that is lost (NaN) anywhere in a window is left out of that window's statistics from
    its first instant on: what is left of it would weigh in one part of the band and not in the
    other.

    Parameters
    ----------
    series : ndarray, shape (member, window, steps, N)
        Series of the members, from :func:`seakeep.models.engine.member_series`.
    lost : ndarray of int, shape (member, window)
        First instant lost, or −1.
    level : float
        Probability between the two quantiles.

    Returns
    -------
    ndarray, shape (window, 4, steps, N)
        As :func:`statistics_of`.
    """
    members, windows, steps, channels = series.shape
    out = np.empty((windows, 4, steps, channels))
    length = max(1, CHUNK // (8 * members * channels))
    for window in range(windows):
        complete = np.flatnonzero(lost[:, window] < 0)
        for first in range(0, steps, length):
            piece = slice(first, first + length)
            out[window, :, piece] = statistics_of(
                np.asarray(series[complete, window, piece]), level
            )
    return out


def summarize(forecast: xr.Dataset, level: float = 0.95) -> xr.Dataset:
    """Mean, standard deviation and band of an ensemble forecast.

    Parameters
    ----------
    forecast : Dataset
        With the dimension ``member``, from ``forecast`` of an ensemble.
    level : float, optional
        Probability between ``lower`` and ``upper``.

    Returns
    -------
    Dataset
        The variables of `forecast` with ``statistic`` (mean, std, lower, upper) instead of
        ``member``. Members that diverged are left out of all instants; ``attrs["members"]`` and
        ``attrs["diverged"]`` count them.

    Raises
    ------
    RequestError
        If `level` is not between 0 and 1.

    Examples
    --------
    >>> import xarray as xr
    >>> two = xr.Dataset({"heave": (("member", "time"), [[1.0, 2.0], [3.0, 4.0]])})
    >>> summarize(two).heave.sel(statistic="mean").values
    array([2., 3.])
    """
    level = fraction(level, "level")
    channels = [
        name
        for name, variable in forecast.data_vars.items()
        if "member" in variable.dims and variable.dtype.kind in "iuf"
    ]
    lost = xr.zeros_like(forecast["member"], dtype=bool)
    for name in channels:
        others = [d for d in forecast[name].dims if d not in ("member", "window")]
        lost = lost | forecast[name].isnull().any(others)
    variables = {}
    for name in channels:
        variables[name] = _statistics_variable(forecast[name].transpose("member", ...), lost, level)
    members, dropped = forecast.sizes["member"], int(lost.sum())
    coords: Mapping[str, object] = {
        str(name): coordinate
        for name, coordinate in forecast.coords.items()
        if "member" not in coordinate.dims
    }
    return xr.Dataset(
        variables,
        coords={**coords, "statistic": statistic_coordinate(level)},
        attrs={**forecast.attrs, "level": level, "members": members, "diverged": dropped},
    )


def _statistics_variable(values: xr.DataArray, lost: xr.DataArray, level: float) -> xr.Variable:
    """Statistics of a channel (member, …) without the members that are lost, window by window."""
    if "window" in lost.dims:
        windows = range(lost.sizes["window"])
        pairs = ((values.isel(window=each), lost.isel(window=each)) for each in windows)
        rows = [_statistics_variable(*pair, level) for pair in pairs]
        dims = ("window", *rows[0].dims)
        return xr.Variable(dims, np.stack([row.values for row in rows]), values.attrs)
    result = statistics_of(values.values[~lost.values], level)
    return xr.Variable(("statistic", *values.dims[1:]), result, values.attrs)
