"""Error measures: by hand, by MATLAB's formula, by scikit-learn, and who is left out of them."""

import numpy as np
import pytest
import xarray as xr
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from records import autoregressive
from said import data_error, request_error

from seakeep.metrics import (
    anrmse,
    anrmse_differences,
    error_over_time,
    fit_percent,
    is_slack,
    nammae,
    normalised_extremes_error,
    nrmse,
)

MEASURED = np.array([[0.0, 10.0], [2.0, 30.0], [4.0, 20.0], [2.0, 40.0]])
PREDICTED = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 20.0], [2.0, 50.0]])
# SD with ddof = 1: √(8/3) and √(500/3). Squared errors: 1, 0, 1, 0 and 0, 100, 0, 100.
SD = np.sqrt(np.array([8.0, 500.0]) / 3)

OF_CHANNELS = nrmse, normalised_extremes_error, fit_percent
AVERAGES = anrmse, nammae


def labelled(values, dims=("time",), **attrs):
    return xr.Dataset(
        {name: (dims, values[..., k], attrs) for k, name in enumerate(("heave", "mooring_bow"))},
        coords={"time": 0.5 * np.arange(values.shape[-2])},
    )


def both(predicted=PREDICTED, measured=MEASURED):
    return {"predicted": predicted, "measured": measured}


ERRORS = np.array([[1.0, 0.0], [0.0, 10.0], [1.0, 0.0], [0.0, 10.0]])
# Minima 1 and 0, 10 and 10; maxima 3 and 4, 50 and 40.
EXTREMES = 0.5 * np.array([1.0 + 1.0, 0.0 + 10.0]) / SD


@pytest.mark.parametrize(
    ("measure", "expected"),
    [
        (nrmse, np.sqrt([0.5, 50.0]) / SD),
        (error_over_time, (ERRORS / SD).mean(axis=1)),
        (normalised_extremes_error, EXTREMES),
        (nammae, EXTREMES.mean()),
        # MATLAB's 100 (1 − ‖y − ŷ‖ / ‖y − mean(y)‖), as the help page of compare states it.
        (fit_percent, 100 * (1 - np.sqrt([2.0, 200.0]) / np.sqrt([8.0, 500.0]))),
    ],
)
def test_measures_by_hand(measure, expected):
    # Arithmetic of four numbers: rounding alone.
    assert_allclose(measure(**both()), expected, rtol=1e-13)


# Who is left out


@pytest.mark.parametrize("part", [0.0, 0.0099])
def test_a_slack_channel_is_nan_and_left_out_of_averages(part):
    training = [1.0, 1.0]
    slack = MEASURED.copy()
    slack[:, 1] = 7.0 + 0.0101 * (MEASURED[:, 1] - 25) / SD[1]
    assert np.isfinite(nrmse(**both(PREDICTED, slack), training_std=training)).all()
    slack[:, 1] = 7.0 + part * (MEASURED[:, 1] - 25) / SD[1]
    arguments = both(PREDICTED, slack) | {"training_std": training}
    alone = both(PREDICTED[:, :1], slack[:, :1])
    for measure in OF_CHANNELS:
        values = measure(**arguments)
        assert np.isnan(values[1])
        assert values[0] == measure(**alone)[0]
    for average in AVERAGES:
        assert average(**arguments) == average(**alone)
    assert_array_equal(error_over_time(**arguments), error_over_time(**alone))


@pytest.mark.parametrize("value", [0.0, 0.1, 1e5 / 3])
def test_a_constant_measurement_cannot_be_judged(value):
    # Of thirty samples the mean is off by rounding, and the spread with it.
    predicted, measured = np.tile(PREDICTED, (8, 1))[:30], np.tile(MEASURED, (8, 1))[:30]
    measured[:, 1] = value
    each = nrmse(**both(predicted, measured))
    assert np.isnan(each[1])
    assert anrmse(**both(predicted, measured)) == each[0]
    for average in AVERAGES:  # without any channel to judge
        assert np.isnan(average(**both(predicted[:, 1:], measured[:, 1:])))


def test_a_diverged_forecast_and_a_gap_are_nan_and_not_left_out():
    gap, diverged = MEASURED.copy(), PREDICTED.copy()
    gap[2, 1] = diverged[2:, 1] = np.nan
    for average in AVERAGES:
        for pair in (both(PREDICTED, gap), both(diverged)):
            assert np.isnan(average(**pair))
    for measure in OF_CHANNELS:
        values = measure(**both(diverged))
        assert np.isfinite(values[0])
        assert np.isnan(values[1])
    assert_array_equal(np.isnan(error_over_time(**both(diverged))), [False, False, True, True])


# Datasets


def test_datasets_give_what_arrays_give():
    datasets = both(labelled(PREDICTED), labelled(MEASURED))
    for measure in OF_CHANNELS:
        result = measure(**datasets)
        assert list(result.data_vars) == ["heave", "mooring_bow"]
        assert_array_equal([float(result.heave), float(result.mooring_bow)], measure(**both()))
    for average in AVERAGES:
        assert average(**datasets) == average(**both())
    over_time = error_over_time(**datasets)
    assert_array_equal(over_time, error_over_time(**both()))
    assert_array_equal(over_time.time, datasets["predicted"].time)
    members = labelled(np.stack([PREDICTED, MEASURED]), dims=("member", "time"))
    pair = both(members, datasets["measured"])
    assert nrmse(**pair).heave.dims == anrmse(**pair).dims == ("member",)
    assert error_over_time(**pair).dims == ("member", "time")


def test_channels_are_matched_by_name_and_instants_by_time():
    longer = np.concatenate([np.full((3, 2), 99.0), MEASURED, np.full((2, 2), -99.0)])
    measured = labelled(longer)[["mooring_bow", "heave"]]
    measured = measured.assign(other=measured.heave, time=measured.time - 1.5)
    predicted = labelled(PREDICTED)
    assert anrmse(predicted=predicted, measured=measured) == anrmse(**both())
    moved = predicted.assign_coords(time=predicted.time + 1e-9)
    assert anrmse(predicted=moved, measured=measured) == anrmse(**both())
    frame = predicted.to_dataframe()[["heave", "mooring_bow"]]
    stacked = predicted.to_dataarray("load")  # (load, time)
    for each in (frame, stacked, stacked.T):
        found = nrmse(predicted=each, measured=measured)
        assert found.equals(nrmse(predicted=predicted, measured=measured))
    means = stacked.expand_dims(statistic=["mean"]).transpose("load", ...)
    mean = nrmse(predicted=means, measured=measured).isel(statistic=0, drop=True)
    assert mean.equals(found)
    with request_error("received predicted: DataFrame, measured: ndarray"):
        nrmse(predicted=frame, measured=MEASURED)
    with data_error("no coordinate 'time' in channel 'heave'"):
        nrmse(predicted=frame.reset_index(drop=True), measured=measured)
    # A forecast carries the training spread that finds slack lines; what is passed comes first.
    predicted.heave.attrs["training_std"] = 1e3
    assert np.isnan(nrmse(predicted=predicted, measured=measured).heave)
    told = nrmse(predicted=predicted, measured=measured, training_std=[0.0, 0.0])
    assert np.isfinite(told.heave)


def remembering(rng):
    return autoregressive(rng.standard_normal(600), 0.9)[200:, None]


@pytest.mark.parametrize(("white", "least"), [(False, 0.85), (True, 0.75)])
def test_an_interval_holds_the_value_of_a_long_record_as_often_as_it_says(white, least):
    # Of white errors the spread of the measurement is what a short record does not know.
    rng, inside = default_rng(0), 0
    truth = 0.5  # an error of a quarter of the variance of the measurement
    for _ in range(60):
        measured = remembering(rng)
        error = remembering(rng)
        if white:
            error = rng.standard_normal((400, 1)) / np.sqrt(1 - 0.9**2)
        pair = both(measured + truth * error, measured)
        low, high = anrmse(**pair, interval=0.95)
        assert low < anrmse(**pair) < high
        inside += low <= truth <= high
    # Nominally 0.95; blocks cut some of the dependence: 60 trials have a standard error of 0.03.
    assert inside >= least * 60


def test_bounds_take_the_place_of_the_value():
    rng = default_rng(1)
    measured = rng.standard_normal((100, 2))
    pair = both(measured + 0.1 * rng.standard_normal((3, 100, 2)), measured)
    assert nrmse(**pair, interval=0.9).shape == (2, 3, 2)
    noise = np.full((3, 2), 0.1)
    noise[2, 1] = 9.0
    windows = pair | {"measured": np.stack([measured] * 3)}
    lost = np.isnan(nrmse(**windows, noise_std=noise, interval=0.9))
    assert_array_equal(np.argwhere(lost), [[0, 2, 1], [1, 2, 1]])
    of_sets = {key: labelled(measured) for key in ("predicted", "measured")}
    bounds = nrmse(**of_sets, interval=0.9)
    assert bounds["heave"].dims == ("bound",)
    assert list(bounds["bound"].values) == ["lower", "upper"]
    assert nammae(**of_sets, interval=0.9).sel(bound="upper") == 0.0  # a perfect forecast
    with request_error("a value at each instant, and no interval over time"):
        error_over_time(**pair, interval=0.9)
    with request_error("interval must be between 0 and 1"):
        nrmse(**pair, interval=95)
    with request_error("is_slack says yes or no, and has no interval"):
        is_slack(**pair, interval=0.9)


def test_a_forecast_that_ends_in_nan_has_no_interval():
    measured = default_rng(0).standard_normal((400, 2))
    predicted = 0.9 * measured
    predicted[-1, 1] = np.nan
    pair = both(predicted, measured)
    assert_array_equal(np.isnan(nrmse(**pair, interval=0.9)), [[False, True], [False, True]])
    assert np.isnan(anrmse(**pair, interval=0.9)).all()
    sets = [[labelled(0.9 * measured)], [labelled(predicted)]]
    found = anrmse_differences(sets, [labelled(measured)])
    for key in ("lower", "upper", "anrmse_lower", "all_upper"):
        assert_array_equal(np.isnan(found[key].values.ravel()), [False, True])


def test_errors_that_models_share_cancel_in_their_difference():
    rng = default_rng(0)
    measured, errors = ([labelled(rng.normal(size=(300, 2))) for _ in range(2)] for _ in range(2))
    first, half, equal = (
        [m + scale * e for m, e in zip(measured, errors, strict=True)] for scale in (0.2, 0.1, 0.2)
    )
    found = anrmse_differences([first, half, equal], measured)
    own = [anrmse(predicted=p, measured=m) for p, m in zip(first, measured, strict=True)]
    assert_array_equal(found["anrmse"][0], own)
    assert found["all_anrmse"][0] == np.mean(own)
    # Half the error in every sample is half the ANRMSE in every draw, to rounding.
    for key in ("change", "lower", "upper"):
        assert_near(found[key], [[0, 0], [-0.5, -0.5], [0, 0]], 1e-12)
        assert_near(found[f"all_{key}"], [0, -0.5, 0], 1e-12)


def test_the_bounds_of_an_error_are_those_of_its_model_whatever_stands_beside_it():
    rng = default_rng(0)
    *measured, white = (labelled(rng.normal(size=(400, 2))) for _ in range(3))
    slow = np.sin(2 * np.pi * np.arange(400) / 100)[:, None] * np.ones(2)
    near = [m + 0.1 * white for m in measured]
    far = [m + labelled(slow) for m in measured]  # whose blocks are longer
    found = anrmse_differences([near, far], measured)
    for k, of in enumerate((near, far)):
        own = [
            anrmse(predicted=p, measured=m, interval=0.95)
            for p, m in zip(of, measured, strict=True)
        ]
        assert_array_equal(np.stack([found["anrmse_lower"][k], found["anrmse_upper"][k]], 1), own)
    one = anrmse_differences([near[1:], far[1:]], measured[1:])
    for key in ("anrmse_lower", "anrmse_upper"):
        assert_array_equal(one[f"all_{key}"], found[key][:, 1])
    # Two records of as many blocks, each with draws of its own: narrower by √2.
    widths = [
        np.log(found[f"{k}_upper"] / found[f"{k}_lower"])[0] for k in ("anrmse", "all_anrmse")
    ]
    assert_near(widths[1] / widths[0].mean(), 0.5**0.5, 0.1)


def test_a_channel_is_judged_where_less_than_half_of_its_variance_is_noise():
    measured = np.tile([[1.0, 1.0], [-1.0, -1.0]], (50, 1))
    spread = measured.std(axis=0, ddof=1)
    for part, slack in ((0.49, False), (0.51, True)):
        found = is_slack(**both(measured, measured), noise_std=np.sqrt(part) * spread)
        assert_array_equal(found, [slack, slack])
    noisy = labelled(measured, noise_std=0.8)  # stated with the measurement
    assert all(is_slack(predicted=labelled(measured), measured=noisy).values())
