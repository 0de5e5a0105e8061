"""Statistics of forecasts and measurements: bootstrap, densities, divergence, coverage.

Series are arrays or one-dimensional DataArrays of uniform samples without gaps.
:func:`moving_block_bootstrap`, :func:`jsd_interval` and :func:`coverage` take Datasets too, channel
by channel, and the last two DataFrames and DataArrays whose channels have names; text, such as the
status of an ensemble's members, is left out. All draws come from the `numpy.random.Generator` that
is passed.
"""

import functools
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from seakeep.arrays import finite
from seakeep.core import bands, bootstrap, density
from seakeep.core.bands import (
    BandCoverage,
    ConformalMargin,
    CoverageTable,
    band_crps,
    band_scores,
    conformal_margin,
    winkler_score,
)
from seakeep.core.bootstrap import (
    block_length,
    lag_one_correlation,
    overlap_block,
    two_way_interval,
)
from seakeep.core.density import (
    BoxStatistics,
    JsdInterval,
    box_statistics,
    density_grid,
    jensen_shannon,
    kernel_bandwidth,
    kernel_density,
)
from seakeep.core.spectra import split_bands
from seakeep.errors import DataError, RequestError, naming, warn
from seakeep.pairing import channel_names, named_sides, pair

__all__ = [
    "BandCoverage",
    "BoxStatistics",
    "ConformalMargin",
    "CoverageTable",
    "JsdInterval",
    "band_crps",
    "band_scores",
    "block_length",
    "box_statistics",
    "conformal_margin",
    "coverage",
    "coverage_table",
    "density_grid",
    "jensen_shannon",
    "jsd_interval",
    "kernel_bandwidth",
    "kernel_density",
    "lag_one_correlation",
    "moving_block_bootstrap",
    "overlap_block",
    "split_bands",
    "two_way_interval",
    "winkler_score",
]


@functools.wraps(bootstrap.moving_block_bootstrap)
def moving_block_bootstrap(
    series: Any,
    n_series: int,
    block_length: int,
    rng: np.random.Generator,
    *,
    segments: Sequence[int] | None = None,
) -> Any:
    """Take DataArrays and Datasets too; the docstring shown is that of the array function."""
    if not isinstance(series, xr.DataArray | xr.Dataset):
        return bootstrap.moving_block_bootstrap(
            series, n_series, block_length, rng, segments=segments
        )
    alone = isinstance(series, xr.DataArray)
    whole: Any = series.to_dataset(name="series") if alone else series
    whole = whole[channel_names(whole, "series")]
    for name, channel in whole.items():
        finite(channel.transpose("time", ...).values, f"channel '{name}'")
    at = xr.DataArray(
        bootstrap.bootstrap_indices(whole.sizes["time"], n_series, block_length, rng, segments),
        dims=("draw", "time"),
    )
    drawn = whole.drop_vars("time", errors="ignore").isel(time=at)
    if "time" in whole.coords:
        drawn = drawn.assign_coords(time=whole["time"])
    return drawn["series"].rename(series.name) if alone else drawn


@functools.wraps(density.jsd_interval)
def jsd_interval(
    predicted: Any, measured: Any, *, rng: np.random.Generator, **settings: Any
) -> Any:
    """Judge each channel with a child of the generator; one that has none is named."""
    if not (sides := named_sides(predicted=predicted, measured=measured)):
        return density.jsd_interval(predicted, measured, rng=rng, **settings)
    if settings.pop("grid", None) is not None:
        raise RequestError("channels of a Dataset have grids of their own; leave grid out.")
    pairs = pair(**sides)
    p, m = pairs.arrays["predicted"], pairs.arrays["measured"]
    if m.ndim > 2:
        raise RequestError(
            f"measured has the dimensions {sides['measured'][pairs.names[0]].dims}; ('time',) is "
            "needed. Select one run."
        )
    draws = []
    for column, (name, child) in enumerate(zip(pairs.names, rng.spawn(p.shape[-1]), strict=True)):
        rows = p[..., column].reshape(-1, len(m))
        with naming(f"channel '{name}'"), warnings.catch_warnings(record=True) as caught:
            draws.append(density.jsd_interval(rows, m[:, column], rng=child, **settings))
        for each in caught:
            warn(f"channel '{name}': {each.message}")
    return xr.Dataset(
        {key: ("channel", [getattr(item, key) for item in draws]) for key in density.NUMBERS},
        coords={"channel": pairs.names},
        attrs={
            "units": "nat",
            "n_series": draws[0].draws.shape[1],
            "bandwidth": settings.get("bandwidth", "paper"),
        },
    )


@functools.wraps(bands.coverage)
def coverage(lower: Any, upper: Any, measured: Any) -> Any:
    """Judge the channels of all; one with gaps is named."""
    if not (sides := named_sides(lower=lower, upper=upper, measured=measured)):
        return bands.coverage(lower, upper, measured)
    pairs = pair(**sides)
    names, lead = pairs.names, pairs.lead
    m = pairs.arrays["measured"]
    for column, name in enumerate(names):
        if not np.all(np.isfinite(m[..., column])):
            raise DataError(
                f"channel '{name}' of measured holds values that are NaN or infinite. Fill its "
                "gaps first, or judge a window without them."
            )
    band = bands.coverage(**pairs.arrays)
    return xr.Dataset(
        {key: ((*lead, "channel"), values) for key, values in vars(band).items()},
        coords=_channels(names, sides["measured"])
        | {dim: sides["lower"][dim] for dim in lead if dim in sides["lower"].coords},
    )


def _channels(names: Sequence[str], measured: xr.Dataset) -> dict[str, Any]:
    """Channels and their units, as coordinates."""
    units = [str(measured[name].attrs.get("units", "")) for name in names]
    return {"channel": list(names), "unit": ("channel", units)}


@functools.wraps(bands.coverage_table)
def coverage_table(
    lower: Any, upper: Any, measured: Any, level: float = 0.95, waves: Any = None
) -> Any:
    """Judge the channels of all, by parts of the horizon and by wave height."""
    if not (sides := named_sides(lower=lower, upper=upper, measured=measured)):
        return bands.coverage_table(lower, upper, measured, level, waves)
    pairs = pair(**sides)
    if isinstance(waves, xr.DataArray):
        first = pairs.names[0]  # a height beside the bounds of a channel, at their instants
        alone = xr.Dataset({first: waves.assign_attrs(units="")})
        waves = pair(lower=sides["lower"][[first]], waves=alone).arrays["waves"][..., 0]
    shares = bands.coverage_table(**pairs.arrays, level=level, waves=waves)
    return xr.Dataset(
        {
            key: (("part", "channel")[: np.ndim(values)], values)
            for key, values in vars(shares).items()
            if key != "parts"
        },
        coords={"part": list(shares.parts), **_channels(pairs.names, sides["measured"])},
        attrs={"level": level},
    )
