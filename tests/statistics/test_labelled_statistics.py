"""The labelled face: Datasets in, the arrays' numbers out."""

import numpy as np
import pytest
import xarray as xr

from seakeep import statistics
from seakeep.core import bootstrap as core_bootstrap
from seakeep.core import coverage as core_coverage
from seakeep.core import density as core_divergence
from seakeep.errors import DataError, SeakeepWarning

TIME = np.arange(400) / 32
HEAVE, PITCH = np.random.default_rng(0).standard_normal((2, 400)).cumsum(axis=1)
MEASURED = xr.Dataset(
    {
        "heave": ("time", HEAVE, {"units": "m"}),
        "pitch": ("time", PITCH, {"units": "deg"}),
        "surge": ("time", PITCH + HEAVE, {"units": "m"}),
    },
    coords={"time": TIME},
)
PREDICTED = 0.9 * MEASURED[["pitch", "heave"]]


def test_a_dataset_is_redrawn_in_step():
    drawn = statistics.moving_block_bootstrap(MEASURED, 5, 20, np.random.default_rng(1))
    plain = core_bootstrap.moving_block_bootstrap(HEAVE, 5, 20, np.random.default_rng(1))
    assert drawn["heave"].dims == ("draw", "time")
    assert np.array_equal(drawn["heave"], plain)
    # Sums of the same numbers.
    assert np.array_equal(drawn["surge"], drawn["pitch"] + drawn["heave"])
    assert drawn["pitch"].attrs["units"] == "deg"
    assert np.array_equal(drawn["time"], TIME)
    alone = statistics.moving_block_bootstrap(MEASURED["heave"], 5, 20, np.random.default_rng(1))
    assert alone.identical(drawn["heave"])
    gap = MEASURED.where(MEASURED.time != TIME[3])
    with pytest.raises(DataError, match="channel 'heave' holds 1 value"):
        statistics.moving_block_bootstrap(gap, 5, 20, np.random.default_rng(1))


def test_divergence_of_each_channel():
    found = statistics.jsd_interval(
        PREDICTED, MEASURED, block_length=40, rng=np.random.default_rng(2), n_series=10
    )
    children = np.random.default_rng(2).spawn(2)
    assert found["channel"].values.tolist() == ["pitch", "heave"]
    for name, child in zip(["pitch", "heave"], children, strict=True):
        alone = core_divergence.jsd_interval(
            PREDICTED[name].values,
            MEASURED[name].values,
            block_length=40,
            rng=child,
            n_series=10,
        )
        row = found.sel(channel=name)
        for key in ("mean", "lower", "upper", "uncertainty", "noise_floor", "block_length"):
            assert float(row[key]) == getattr(alone, key)


def test_warnings_and_errors_name_the_channel():
    rng = np.random.default_rng(0)
    slow = MEASURED.assign(heave=MEASURED["heave"] * 0 + np.cos(TIME / 4))
    with pytest.warns(SeakeepWarning, match="channel 'heave': the rule 'carlstein' asks for"):
        statistics.jsd_interval(
            0.9 * slow[["heave"]], slow, block_length="carlstein", rng=rng, n_series=5
        )
    slack = MEASURED.assign(heave=MEASURED["heave"] * 0)
    with pytest.raises(DataError, match=r"channel 'heave': the series is constant \(0\)"):
        statistics.jsd_interval(PREDICTED, slack, block_length="politis_white", rng=rng)
    gap = MEASURED.assign(heave=MEASURED["heave"].where(MEASURED.time > 1))
    with pytest.raises(DataError, match="channel 'heave' of measured holds values that are NaN"):
        statistics.coverage(PREDICTED - 1, PREDICTED + 1, gap)


def test_coverage_of_each_channel():
    whole = MEASURED[["heave", "pitch"]]
    shift = xr.DataArray([0.0, 50.0], dims="window", coords={"window": ["near", "far"]})
    found = statistics.coverage(whole - 1 + shift, whole + 1 + shift, MEASURED)
    assert found["inside"].dims == ("window", "channel")
    assert found["inside"].sel(window="near").values.tolist() == [1.0, 1.0]
    assert found["inside"].sel(window="far").values.tolist() == [0.0, 0.0]
    assert found["unit"].values.tolist() == ["m", "deg"]
    # The difference of numbers of order 100.
    assert found["width"].values == pytest.approx(2.0, rel=1e-12)


def test_a_coverage_table_has_parts_channels_and_units():
    waves = xr.DataArray(np.linspace(1.0, 2.0, TIME.size), dims="time", coords={"time": TIME})
    band = PREDICTED.isel(time=slice(10, 100))
    found = statistics.coverage_table(band - 1, band + 1, MEASURED, level=0.9, waves=waves)
    names, part = ["pitch", "heave"], slice(10, 100)
    low, y = (np.stack([d[n].values[part] for n in names], 1) for d in (PREDICTED - 1, MEASURED))
    alone = core_coverage.coverage_table(low, low + 2, y, 0.9, waves.values[part])
    assert found["part"].values.tolist() == list(alone.parts)
    for key in ("inside", "width", "relative_width", "winkler", "crps"):
        np.testing.assert_allclose(found[key], getattr(alone, key), rtol=1e-12)
    assert found["unit"].values.tolist() == [MEASURED[name].attrs["units"] for name in names]
    assert found.attrs["level"] == 0.9
