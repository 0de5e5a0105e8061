"""Statistics of forecasts and measurements: bootstrap, densities, divergence, coverage, trend.

Series are arrays or one-dimensional DataArrays of uniform samples without gaps.
:func:`moving_block_bootstrap`, :func:`jsd_interval` and :func:`coverage` take Datasets too, channel
by channel; text, such as the status of an ensemble's members, is left out. All draws come from the
`numpy.random.Generator` that is passed.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from seakeep.arrays import FloatArray
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
from seakeep.core.coverage import (
    BandCoverage,
    BoxStatistics,
    CoverageTable,
    band_crps,
    box_statistics,
    winkler_score,
)
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
from seakeep.core.two_way import overlap_block, two_way_interval
from seakeep.errors import DataError, RequestError, warn
from seakeep.pairing import channel_names, pair

__all__ = [
    "BandCoverage",
    "BandErrors",
    "BlockChoice",
    "BoxStatistics",
    "ConformalMargin",
    "CoverageTable",
    "DensityInterval",
    "JsdInterval",
    "TrendTest",
    "band_crps",
    "band_error_over_time",
    "band_scores",
    "block_length",
    "box_statistics",
    "choose_block_length",
    "conformal_margin",
    "coverage",
    "coverage_table",
    "density_grid",
    "density_interval",
    "jensen_shannon",
    "jsd_interval",
    "kernel_bandwidth",
    "kernel_density",
    "lag_one_correlation",
    "moving_block_bootstrap",
    "overlap_block",
    "split_bands",
    "trend_test",
    "two_way_interval",
    "winkler_score",
]


def _labelled(**sides: object) -> bool:
    """Whether all are Datasets; refuse a mixture."""
    kinds = [isinstance(side, xr.Dataset) for side in sides.values()]
    if any(kinds) and not all(kinds):
        received = ", ".join(f"{name}: {type(side).__name__}" for name, side in sides.items())
        raise RequestError(f"give Datasets throughout, or arrays throughout; received {received}.")
    return all(kinds)


@functools.wraps(_bootstrap.moving_block_bootstrap)
def moving_block_bootstrap(
    series: Any,
    n_series: int,
    block_length: int,
    rng: np.random.Generator,
    *,
    segments: Sequence[int] | None = None,
) -> Any:
    """Take DataArrays and Datasets too; the docstring shown is that of the array function."""
    redraw = functools.partial(
        _bootstrap.moving_block_bootstrap,
        n_series=n_series,
        block_length=block_length,
        rng=rng,
        segments=segments,
    )
    if isinstance(series, xr.DataArray):
        name = "series" if series.name is None else str(series.name)
        whole = series.rename(name).to_dataset()
        drawn = moving_block_bootstrap(whole, n_series, block_length, rng, segments=segments)
        return drawn[name].rename(series.name)
    if not isinstance(series, xr.Dataset):
        return redraw(series)
    names = channel_names(series, "series")
    wrong = [name for name in names if series[name].dims != ("time",)]
    if wrong:
        raise RequestError(
            f"'{wrong[0]}' has the dimensions {series[wrong[0]].dims}; ('time',) is needed. "
            "Select one run and one member."
        )
    values = redraw(np.stack([series[name].values for name in names], axis=-1))
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
    p: FloatArray,
    measured: FloatArray,
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
                warn(message)
        return _divergence.jsd_interval(
            p.reshape(-1, p.shape[-1]), measured, block_length=block, rng=rng, **settings
        )
    except DataError as error:
        raise DataError(f"channel '{name}': {error}") from error


@functools.wraps(_divergence.jsd_interval)
def jsd_interval(
    predicted: Any,
    measured: Any,
    *,
    block_length: int | BlockRule,
    rng: np.random.Generator,
    n_series: int = 100,
    bandwidth: Bandwidth = "paper",
    grid: npt.ArrayLike | None = None,
    segments: Sequence[int] | None = None,
) -> Any:
    """Take Datasets too; the docstring shown is that of the array function."""
    settings: dict[str, Any] = {
        "n_series": n_series,
        "bandwidth": bandwidth,
        "segments": segments,
    }
    if not _labelled(predicted=predicted, measured=measured):
        return _divergence.jsd_interval(
            predicted, measured, block_length=block_length, rng=rng, grid=grid, **settings
        )
    if grid is not None:
        raise RequestError("channels of a Dataset have grids of their own; leave grid out.")
    pairs = pair(predicted=predicted, measured=measured)
    names, series = pairs.names, pairs.arrays
    if series["measured"].ndim > 2:
        raise RequestError(
            f"measured has the dimensions {measured[names[0]].dims}; ('time',) is needed. Select "
            "one run."
        )
    children = rng.spawn(len(names))
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
        if field.name not in ("draws", "noise", "grid", "predicted", "measured")
    ]
    return xr.Dataset(
        {
            key: ("channel", [getattr(item, key) for item in found])
            for key in (*numbers, "uncertainty")
        },
        coords={"channel": names},
        attrs={"units": "nat", "n_series": n_series, "bandwidth": bandwidth},
    )


@functools.wraps(_coverage.coverage)
def coverage(lower: Any, upper: Any, measured: Any) -> Any:
    """Take Datasets too; the docstring shown is that of the array function."""
    if not _labelled(lower=lower, upper=upper, measured=measured):
        return _coverage.coverage(lower, upper, measured)
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
    return xr.Dataset(
        {
            field.name: ((*lead, "channel"), getattr(band, field.name))
            for field in fields(_coverage.BandCoverage)
        },
        coords=_channels(names, measured)
        | {dim: lower[dim] for dim in lead if dim in lower.coords},
    )


def _channels(names: Sequence[str], measured: xr.Dataset) -> dict[str, Any]:
    """Channels and their units, as coordinates."""
    units = [str(measured[name].attrs.get("units", "")) for name in names]
    return {"channel": list(names), "unit": ("channel", units)}


@functools.wraps(_coverage.coverage_table)
def coverage_table(
    lower: Any, upper: Any, measured: Any, level: float = 0.95, waves: Any = None
) -> Any:
    """Take Datasets too; the docstring shown is that of the array function."""
    if not _labelled(lower=lower, upper=upper, measured=measured):
        return _coverage.coverage_table(lower, upper, measured, level, waves)
    pairs = pair(lower=lower, upper=upper, measured=measured)
    heights = None
    if waves is not None:
        if not isinstance(waves, xr.DataArray):
            raise RequestError(
                f"waves is a {type(waves).__name__}; with Datasets it must be a DataArray with the "
                "dimension 'time'."
            )
        first = pairs.names[0]  # a height beside the bounds of a channel, at their instants
        alone = xr.Dataset({first: waves.assign_attrs(units="")})
        heights = pair(lower=lower[[first]], waves=alone).arrays["waves"][..., 0]
    found = _coverage.coverage_table(**pairs.arrays, level=level, waves=heights)
    dims = {"parts": ("part",), "instants": ("part",)}
    table = xr.Dataset(
        {
            field.name: (dims.get(field.name, ("part", "channel")), getattr(found, field.name))
            for field in fields(CoverageTable)
            if field.name != "parts"
        },
        coords={"part": list(found.parts), **_channels(pairs.names, measured)},
    )
    return table.assign_attrs(level=level)
