"""The labelled face: Datasets in, the arrays' numbers out."""

import numpy as np
import pytest
import xarray as xr
from numpy.random import default_rng
from records import record
from said import data_error

from seakeep import statistics
from seakeep.core import bootstrap as core_bootstrap
from seakeep.core import density as core_divergence

HEAVE, PITCH = default_rng(0).standard_normal((2, 400)).cumsum(axis=1)
MEASURED = record(1 / 32, heave=HEAVE, pitch=PITCH, surge=PITCH + HEAVE)
PREDICTED = 0.9 * MEASURED[["pitch", "heave"]]


def redrawn(series, room=statistics):
    return room.moving_block_bootstrap(series, 5, 20, default_rng(1))


def test_a_dataset_is_redrawn_in_step():
    drawn, plain = redrawn(MEASURED), redrawn(HEAVE, core_bootstrap)
    assert drawn["heave"].dims == ("draw", "time")
    assert np.array_equal(drawn["heave"], plain)
    # Sums of the same numbers.
    assert np.array_equal(drawn["surge"], drawn["pitch"] + drawn["heave"])
    assert drawn["pitch"].attrs["units"] == "rad"
    assert drawn["time"].equals(MEASURED["time"])
    assert redrawn(MEASURED["heave"]).identical(drawn["heave"])
    gap = MEASURED.where(MEASURED.time != MEASURED.time[3])
    with data_error("channel 'heave' holds 1 value"):
        redrawn(gap)


def test_divergence_of_each_channel():
    found = statistics.jsd_interval(
        PREDICTED, MEASURED, block_length=40, rng=default_rng(2), n_series=10
    )
    assert found["channel"].values.tolist() == ["pitch", "heave"]
    for name, child in zip(["pitch", "heave"], default_rng(2).spawn(2), strict=True):
        alone = core_divergence.jsd_interval(
            PREDICTED[name].values, MEASURED[name].values, block_length=40, rng=child, n_series=10
        )
        row = found.sel(channel=name)
        for key in ("mean", "lower", "upper", "uncertainty", "noise_floor", "block_length"):
            assert row[key] == getattr(alone, key)


def test_coverage_of_each_channel():
    whole = MEASURED[["heave", "pitch"]]
    shift = xr.DataArray([0.0, 50.0], dims="window", coords={"window": ["near", "far"]})
    found = statistics.coverage(whole - 1 + shift, whole + 1 + shift, MEASURED)
    assert found["inside"].dims == ("window", "channel")
    assert found["inside"].values.tolist() == [[1.0, 1.0], [0.0, 0.0]]
    assert found["unit"].values.tolist() == ["m", "rad"]
    # The difference of numbers of order 100.
    assert found["width"].values == pytest.approx(2.0, rel=1e-12)
    frames = [each.to_dataframe() for each in (whole - 1, whole + 1, MEASURED)]
    assert statistics.coverage(*frames).inside.values.tolist() == [1.0, 1.0]


def test_heights_of_waves_are_given_with_instants_or_one_per_instant():
    height, bounds = np.abs(MEASURED["surge"]), (PREDICTED - 1, PREDICTED + 1, MEASURED)
    expected = statistics.coverage_table(*bounds, waves=height)
    assert expected.sizes["part"] > statistics.coverage_table(*bounds).sizes["part"]
    for waves in (height.values, height.values.tolist()):
        assert statistics.coverage_table(*bounds, waves=waves).equals(expected)
