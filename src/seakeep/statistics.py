"""Statistics of forecasts and measurements: bootstrap, densities, divergence, coverage, trend.

Series are arrays or one-dimensional DataArrays of uniform samples without gaps.
:func:`moving_block_bootstrap`, :func:`jsd_interval` and :func:`coverage` take Datasets too, channel
by channel; words, such as the status of an ensemble's members, are no channels. Every draw comes
from the `numpy.random.Generator` that is passed.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import as_generator
from seakeep.core import bootstrap as _bootstrap
from seakeep.core import coverage as _coverage
from seakeep.core import divergence as _divergence
from seakeep.core.bands import BandErrors, band_error_over_time, split_bands
from seakeep.core.bootstrap import (
    BlockChoice,
    BlockRule,
    block_length,
    choose_block_length,
    lag_one_correlation,
)
from seakeep.core.calibration import ConformalMargin, band_scores, conformal_margin
from seakeep.core.coverage import BandCoverage, BoxStatistics, box_statistics
from seakeep.core.density import (
    Bandwidth,
    DensityInterval,
    density_grid,
    density_interval,
    kernel_bandwidth,
    kernel_density,
)
from seakeep.core.divergence import JsdInterval, jensen_shannon
from seakeep.core.trend import TrendTest, trend_test
from seakeep.errors import DataError, RequestError, SeakeepWarning
from seakeep.pairing import channel_names, pair

__all__ = [
    "BandCoverage",
    "BandErrors",
    "BlockChoice",
    "BoxStatistics",
    "ConformalMargin",
    "DensityInterval",
    "JsdInterval",
    "TrendTest",
    "band_error_over_time",
    "band_scores",
    "block_length",
    "box_statistics",
    "choose_block_length",
    "conformal_margin",
    "coverage",
    "density_grid",
    "density_interval",
    "jensen_shannon",
    "jsd_interval",
    "kernel_bandwidth",
    "kernel_density",
    "lag_one_correlation",
    "moving_block_bootstrap",
    "split_bands",
    "trend_test",
]

Labelled = npt.ArrayLike | xr.Dataset


def _all_or_none(named: dict[str, object]) -> bool:
    labelled = [isinstance(item, xr.Dataset) for item in named.values()]
    if any(labelled) and not all(labelled):
        received = ", ".join(f"{name}: {type(item).__name__}" for name, item in named.items())
        raise RequestError(f"give Datasets throughout, or arrays throughout; received {received}.")
    return all(labelled)


def moving_block_bootstrap(
    series: npt.ArrayLike | xr.DataArray | xr.Dataset,
    n_series: int,
    block_length: int,
    rng: np.random.Generator,
    *,
    segments: Sequence[int] | None = None,
) -> Any:
    """Redraw a series, or several side by side, from overlapping blocks.

    Parameters
    ----------
    series : array_like, shape (time,) or (time, channel), DataArray or Dataset over time
        Uniform samples without gaps; all channels are redrawn from the same blocks.
    n_series : int
        Number of redrawn series (100 in the paper).
    block_length : int
        Samples of a block; :func:`block_length` proposes one.
    rng : numpy.random.Generator
        Source of the block starts.
    segments : sequence of int, optional
        Lengths of the joined pieces. No block then crosses a join; by default it may, as in the
        paper.

    Returns
    -------
    ndarray, shape (n_series, time) or (n_series, time, channel), DataArray or Dataset
        Labelled results have the dimensions (draw, time) and keep the times.

    Raises
    ------
    RequestError
        If the block does not fit, or a setting is out of range.
    DataError
        If a value is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> drawn = moving_block_bootstrap(np.arange(8.0), 3, 4, np.random.default_rng(0))
    >>> drawn.shape
    (3, 8)
    """
    if isinstance(series, xr.DataArray):
        name = "series" if series.name is None else str(series.name)
        whole = series.rename(name).to_dataset()
        drawn = moving_block_bootstrap(whole, n_series, block_length, rng, segments=segments)
        return drawn[name].rename(series.name)
    if not isinstance(series, xr.Dataset):
        return _bootstrap.moving_block_bootstrap(
            series, n_series, block_length, rng, segments=segments
        )
    names = channel_names(series, "series")
    wrong = [name for name in names if series[name].dims != ("time",)]
    if wrong:
        raise RequestError(
            f"'{wrong[0]}' has the dimensions {series[wrong[0]].dims}; ('time',) is needed. "
            "Select one run and one member."
        )
    columns = np.stack([series[name].values for name in names], axis=-1)
    values = _bootstrap.moving_block_bootstrap(
        columns, n_series, block_length, rng, segments=segments
    )
    coords = {"time": series["time"]} if "time" in series.coords else None
    return xr.Dataset(
        {
            name: (("draw", "time"), values[..., column], series[name].attrs)
            for column, name in enumerate(names)
        },
        coords=coords,
    )


def _divergence_of(
    name: str,
    p: npt.NDArray[np.float64],
    measured: npt.NDArray[np.float64],
    block: int | BlockRule,
    rng: np.random.Generator,
    settings: dict[str, Any],
) -> JsdInterval:
    # The array core, its messages and warnings with the channel's name.
    try:
        if isinstance(block, str):
            choice = choose_block_length(measured, block, segments=settings["segments"])
            block = choice.samples
            if choice.capped:
                message = f"channel '{name}': {_bootstrap.too_long(choice, measured.size)}"
                warnings.warn(message, SeakeepWarning, stacklevel=4)
        return _divergence.jsd_interval(
            p.reshape(-1, p.shape[-1]), measured, block_length=block, rng=rng, **settings
        )
    except DataError as error:
        raise DataError(f"channel '{name}': {error}") from error


def jsd_interval(
    predicted: Labelled,
    measured: Labelled,
    *,
    block_length: int | BlockRule,
    rng: np.random.Generator,
    n_series: int = 100,
    bandwidth: Bandwidth = "paper",
    grid: npt.ArrayLike | None = None,
    segments: Sequence[int] | None = None,
) -> Any:
    """Jensen–Shannon divergence with its interval, always beside its noise floor.

    Parameters
    ----------
    predicted : array_like, shape (time,) or (series, time), or Dataset
        Predictions at the instants of `measured`; several of a channel are pooled. With Datasets,
        its channels are judged, each against the one of that name.
    measured : array_like, shape (time,), or Dataset over time
        Measurement.
    block_length : int, "carlstein" or "politis_white"
        Samples of a block, or the rule, applied to each measured channel.
    rng : numpy.random.Generator
        Source of the block starts; of Datasets each channel has a spawned child, in their order.
    n_series : int
        Number of redrawn series (100 in the paper).
    bandwidth : {"paper", "silverman"} or float
        As for :func:`kernel_bandwidth`.
    grid : array_like, shape (grid,), optional
        Evenly spaced values that cover all series; by default 512 over their pooled range and
        three bandwidths on either side. Not with Datasets, whose channels have their own.
    segments : sequence of int, optional
        Lengths of the joined pieces; no block then crosses a join.

    Returns
    -------
    JsdInterval, or Dataset over ``channel``
        The Dataset holds the numbers without the draws, and ``uncertainty``.

    Raises
    ------
    RequestError
        If channels, lengths or settings do not fit.
    DataError
        If a series is constant, has gaps, or units or instants differ.
    """
    settings: dict[str, Any] = {
        "n_series": n_series,
        "bandwidth": bandwidth,
        "segments": segments,
    }
    if not _all_or_none({"predicted": predicted, "measured": measured}):
        return _divergence.jsd_interval(
            predicted, measured, block_length=block_length, rng=rng, grid=grid, **settings
        )
    assert isinstance(predicted, xr.Dataset)
    assert isinstance(measured, xr.Dataset)
    if grid is not None:
        raise RequestError("channels of a Dataset have grids of their own; leave grid out.")
    pairs = pair(predicted=predicted, measured=measured)
    names, series = pairs.names, pairs.arrays
    if series["measured"].ndim > 2:
        raise RequestError(
            f"measured has the dimensions {measured[names[0]].dims}; ('time',) is needed. Select "
            "one run."
        )
    children = as_generator(rng).spawn(len(names))
    found = [
        _divergence_of(
            name,
            series["predicted"][..., column],
            series["measured"][:, column],
            block_length,
            child,
            settings,
        )
        for column, (name, child) in enumerate(zip(names, children, strict=True))
    ]
    numbers = [
        field.name
        for field in fields(_divergence.JsdInterval)
        if field.name not in ("draws", "noise")
    ]
    return xr.Dataset(
        {
            key: ("channel", [getattr(item, key) for item in found])
            for key in (*numbers, "uncertainty")
        },
        coords={"channel": names},
        attrs={"units": "nat", "n_series": n_series, "bandwidth": bandwidth},
    )


def coverage(lower: Labelled, upper: Labelled, measured: Labelled) -> Any:
    """Part of the instants at which a band holds the measurement, and the band's mean width.

    Parameters
    ----------
    lower, upper : array_like, shape (…, time, channel) or (time,), or Dataset
        Bounds of the band, in the units of `measured`.
    measured : array_like, shape (…, time, channel) or (time,), or Dataset
        Measurement, or on the tank the truth.

    Returns
    -------
    BandCoverage, or Dataset over the leading dimensions and ``channel``
        Part inside, below and above; mean width, in the channel's unit (coordinate ``unit``) and
        in measured standard deviations.

    Raises
    ------
    RequestError
        If shapes or channels do not fit, or the bounds are swapped.
    DataError
        If the measurement has gaps, or units or instants differ.
    """
    if not _all_or_none({"lower": lower, "upper": upper, "measured": measured}):
        return _coverage.coverage(lower, upper, measured)
    assert isinstance(lower, xr.Dataset)
    assert isinstance(upper, xr.Dataset)
    assert isinstance(measured, xr.Dataset)
    pairs = pair(lower=lower, upper=upper, measured=measured)
    names, lead = pairs.names, pairs.lead
    m = pairs.arrays["measured"]
    for column, name in enumerate(names):
        if not np.all(np.isfinite(m[..., column])):
            raise DataError(
                f"channel '{name}' of measured holds values that are NaN or infinite. Fill its "
                "gaps first, or judge a window without them."
            )
    band = _coverage.coverage(**pairs.arrays)
    units = [str(measured[name].attrs.get("units", "")) for name in names]
    return xr.Dataset(
        {
            field.name: ((*lead, "channel"), getattr(band, field.name))
            for field in fields(_coverage.BandCoverage)
        },
        coords={
            "channel": names,
            "unit": ("channel", units),
            **{dim: lower[dim] for dim in lead if dim in lower.coords},
        },
    )
