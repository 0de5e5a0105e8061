"""Datasets side by side: what is a channel, at which instants, and what does not fit together."""

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_array_equal
from records import record
from said import data_error, request_error

from seakeep import metrics
from seakeep.pairing import pair

HEAVE, PITCH = np.random.default_rng(0).standard_normal((2, 6))
MEASURED = record(0.5, heave=HEAVE, pitch=PITCH)
WINDOWS = xr.concat([MEASURED, MEASURED + 1, MEASURED + 2], dim="window")


def test_dimensions_are_matched_by_name():
    members = xr.concat([WINDOWS, 2 * WINDOWS], dim="member")
    paired = pair(predicted=members.transpose("time", "window", "member"), measured=WINDOWS)
    assert paired.lead == ("window", "member")
    assert paired.arrays["predicted"].shape == (3, 2, 6, 2)
    assert_array_equal(paired.arrays["predicted"][:, 0], paired.arrays["measured"][:, 0])
    assert_array_equal(paired.arrays["measured"][2, 1, :, 1], PITCH + 2)
    # One measurement for all windows is not spread out.
    assert pair(predicted=members, measured=MEASURED).arrays["measured"].shape == (6, 2)
    slack = metrics.is_slack(predicted=WINDOWS, measured=WINDOWS * [[0.0], [1.0], [1.0]])
    assert slack.heave.dims == ("window",)
    assert slack.heave.values.tolist() == [True, False, False]


def test_samples_are_matched_where_no_instants_are_stated():
    bare = pair(predicted=MEASURED.drop_vars("time"), measured=MEASURED)
    assert_array_equal(bare.arrays["predicted"], bare.arrays["measured"])
    with request_error("measured has 6 samples along time and predicted 5"):
        pair(predicted=MEASURED.drop_vars("time").isel(time=slice(5)), measured=MEASURED)


@pytest.mark.parametrize(
    ("predicted", "measured", "message"),
    [
        (MEASURED, WINDOWS, r"measured has the dimension 'window' and predicted has not\. Select"),
        (WINDOWS, WINDOWS.isel(window=[0, 1]), r"along dimension 'window' .* sizes: \{2, 3\}"),
        (
            WINDOWS.assign_coords(window=[0, 1, 2]),
            WINDOWS.assign_coords(window=[2, 1, 0]),
            r"not equal along these coordinates \(dimensions\): 'window'",
        ),
        (WINDOWS.assign(pitch=MEASURED.pitch), MEASURED, r"channel 'pitch' of predicted has the"),
        (WINDOWS, WINDOWS.assign(pitch=MEASURED.pitch), r"channel 'pitch' of measured has the"),
    ],
)
def test_dimensions_that_do_not_fit_are_refused(predicted, measured, message):
    with pytest.raises(ValueError, match=message):
        metrics.nrmse(predicted=predicted, measured=measured)


def test_the_instants_of_a_message_can_be_told_apart():
    late = MEASURED.assign_coords(time=1.7e9 + MEASURED.time)
    message = (
        r"from 1700000000\.25 to 1700000002\.75 s and measured from 1700000000 to 1700000002\.5"
    )
    with data_error(message):
        pair(predicted=late.assign_coords(time=late.time + 0.25), measured=late)
