"""Error measures: by hand, by MATLAB's formula, by scikit-learn, and who is left out of them."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from seakeep import DataError, HankelDMDc, RequestError, metrics

MEASURED = np.array([[0.0, 10.0], [2.0, 30.0], [4.0, 20.0], [2.0, 40.0]])
PREDICTED = np.array([[1.0, 10.0], [2.0, 20.0], [3.0, 20.0], [2.0, 50.0]])
# SD with ddof = 1: √(8/3) and √(500/3). Squared errors: 1, 0, 1, 0 and 0, 100, 0, 100.
SD = np.sqrt(np.array([8.0, 500.0]) / 3)
ALL = [
    metrics.nrmse,
    metrics.anrmse,
    metrics.error_over_time,
    metrics.nammae,
    metrics.normalised_extremes_error,
    metrics.fit_percent,
]


def labelled(values, names=("heave", "mooring_bow"), dims=("time",), step=0.5, **attrs):
    return xr.Dataset(
        {name: (dims, values[..., column], attrs) for column, name in enumerate(names)},
        coords={"time": step * np.arange(values.shape[-2])},
    )


def both(predicted=PREDICTED, measured=MEASURED):
    return {"predicted": predicted, "measured": measured}


def test_nrmse_by_hand():
    # Arithmetic of four numbers: rounding alone, here and below.
    np.testing.assert_allclose(metrics.nrmse(**both()), np.sqrt([0.5, 50.0]) / SD, rtol=1e-14)


def test_anrmse_is_the_average_over_the_channels():
    expected = np.mean(np.sqrt([0.5, 50.0]) / SD)
    value = metrics.anrmse(**both())
    assert isinstance(value, float)
    assert value == pytest.approx(expected, rel=1e-14)


def test_error_over_time_by_hand():
    errors = np.array([[1.0, 0.0], [0.0, 10.0], [1.0, 0.0], [0.0, 10.0]])
    np.testing.assert_allclose(
        metrics.error_over_time(**both()), (errors / SD).mean(axis=1), rtol=1e-14
    )


def test_nammae_by_hand():
    # Minima 1 and 0, 10 and 10; maxima 3 and 4, 50 and 40.
    each = 0.5 * np.array([1.0 + 1.0, 0.0 + 10.0]) / SD
    np.testing.assert_allclose(metrics.normalised_extremes_error(**both()), each, rtol=1e-14)
    assert metrics.nammae(**both()) == pytest.approx(each.mean(), rel=1e-14)


def test_fit_percent_is_matlabs_formula():
    # 100 (1 − ‖y − ŷ‖ / ‖y − mean(y)‖), as the help page of compare states it.
    expected = 100 * (1 - np.sqrt([2.0, 200.0]) / np.sqrt([8.0, 500.0]))
    np.testing.assert_allclose(metrics.fit_percent(**both()), expected, rtol=1e-13)


def test_measures_of_a_perfect_forecast():
    perfect = both(MEASURED, MEASURED)
    assert metrics.anrmse(**perfect) == metrics.nammae(**perfect) == 0.0
    np.testing.assert_array_equal(metrics.fit_percent(**perfect), 100.0)
    np.testing.assert_array_equal(metrics.error_over_time(**perfect), 0.0)


def test_the_mean_as_forecast_has_no_fit():
    mean = np.broadcast_to(MEASURED.mean(axis=0), MEASURED.shape)
    np.testing.assert_allclose(metrics.fit_percent(**both(mean)), 0.0, atol=1e-12)  # of 100


@pytest.mark.oracle
def test_nrmse_and_fit_agree_with_scikit_learn():
    sklearn = pytest.importorskip("sklearn.metrics")
    rng = np.random.default_rng(0)
    measured = rng.standard_normal((200, 3)) * [1, 5, 0.1] + [0, 3, -1]
    predicted = measured + 0.3 * rng.standard_normal((200, 3))
    root = sklearn.root_mean_squared_error(measured, predicted, multioutput="raw_values")
    np.testing.assert_allclose(
        metrics.nrmse(**both(predicted, measured)), root / measured.std(axis=0, ddof=1), rtol=1e-12
    )
    # R² = 1 − (1 − fit)², as both are ratios of the same sums.
    fit = metrics.fit_percent(**both(predicted, measured)) / 100
    r2 = sklearn.r2_score(measured, predicted, multioutput="raw_values")
    np.testing.assert_allclose(1 - (1 - fit) ** 2, r2, rtol=1e-10)


@given(scale=st.floats(1e-3, 1e3), offset=st.floats(-100, 100), seed=st.integers(0, 50))
def test_measures_do_not_depend_on_unit_or_offset(scale, offset, seed):
    rng = np.random.default_rng(seed)
    predicted, measured = rng.standard_normal((2, 30, 2))
    moved = both(scale * predicted + offset, scale * measured + offset)
    for measure in ALL:
        # An offset of 100 on a spread of 1e-3 costs five digits of sixteen, twice squared.
        np.testing.assert_allclose(
            measure(**moved), measure(**both(predicted, measured)), rtol=1e-8, atol=1e-8
        )


@given(seed=st.integers(0, 50))
def test_the_mean_square_of_the_error_over_time_is_the_squared_nrmse_of_one_channel(seed):
    predicted, measured = np.random.default_rng(seed).standard_normal((2, 20, 1))
    over_time = metrics.error_over_time(**both(predicted, measured))
    whole = metrics.anrmse(**both(predicted, measured))
    assert np.sqrt(np.mean(over_time**2)) == pytest.approx(whole, rel=1e-12)


def test_arguments_must_be_named():
    for measure in ALL:
        with pytest.raises(TypeError, match="takes 0 positional arguments"):
            measure(PREDICTED, MEASURED)


# Who is left out


@pytest.mark.parametrize("part", [0.0, 0.0099])
def test_a_slack_channel_is_nan_and_left_out_of_averages(part):
    training = [1.0, 1.0]
    slack = MEASURED.copy()
    slack[:, 1] = 7.0 + part * (MEASURED[:, 1] - 25) / SD[1]
    arguments = both(PREDICTED, slack) | {"training_std": training}
    alone = both(PREDICTED[:, :1], slack[:, :1])
    for measure in (metrics.nrmse, metrics.normalised_extremes_error, metrics.fit_percent):
        values = measure(**arguments)
        assert np.isnan(values[1])
        assert values[0] == measure(**alone)[0]
    for average in (metrics.anrmse, metrics.nammae):
        assert average(**arguments) == average(**alone)
    np.testing.assert_array_equal(
        metrics.error_over_time(**arguments), metrics.error_over_time(**alone)
    )


def test_a_channel_just_above_the_limit_is_judged():
    tight = MEASURED.copy()
    tight[:, 1] = 7.0 + 0.0101 * (MEASURED[:, 1] - 25) / SD[1]
    values = metrics.nrmse(**both(PREDICTED, tight), training_std=[1.0, 1.0])
    assert np.all(np.isfinite(values))


@pytest.mark.parametrize("value", [0.0, 0.1, 1e5 / 3])
def test_a_constant_measurement_cannot_be_judged(value):
    # Of thirty samples the mean is off by rounding, and the spread with it.
    predicted, measured = np.tile(PREDICTED, (8, 1))[:30], np.tile(MEASURED, (8, 1))[:30]
    measured[:, 1] = value
    each = metrics.nrmse(**both(predicted, measured))
    assert np.isnan(each[1])
    assert metrics.anrmse(**both(predicted, measured)) == each[0]


def test_without_any_channel_to_judge_the_average_is_nan():
    flat = both(PREDICTED, np.full_like(MEASURED, 0.1))
    assert np.isnan(metrics.anrmse(**flat))
    assert np.isnan(metrics.nammae(**flat))
    assert np.all(np.isnan(metrics.error_over_time(**flat)))


def test_a_diverged_forecast_is_nan_and_not_left_out():
    diverged = PREDICTED.copy()
    diverged[2:, 1] = np.nan
    for measure in (metrics.nrmse, metrics.normalised_extremes_error, metrics.fit_percent):
        values = measure(**both(diverged))
        assert np.isfinite(values[0])
        assert np.isnan(values[1])
    assert np.isnan(metrics.anrmse(**both(diverged)))
    assert np.isnan(metrics.nammae(**both(diverged)))
    over_time = metrics.error_over_time(**both(diverged))
    np.testing.assert_array_equal(np.isnan(over_time), [False, False, True, True])


def test_a_gap_in_the_measurement_is_nan_and_not_left_out():
    gap = MEASURED.copy()
    gap[2, 1] = np.nan
    assert np.isnan(metrics.nrmse(**both(PREDICTED, gap))[1])
    assert np.isnan(metrics.anrmse(**both(PREDICTED, gap)))
    assert np.isnan(metrics.nammae(**both(PREDICTED, gap)))
    assert np.all(np.isnan(metrics.error_over_time(**both(PREDICTED, gap))))


# Members


def test_members_are_judged_one_by_one():
    members = np.stack([PREDICTED, MEASURED, 2 * MEASURED])
    for measure, shape in (
        (metrics.nrmse, (3, 2)),
        (metrics.fit_percent, (3, 2)),
        (metrics.anrmse, (3,)),
        (metrics.nammae, (3,)),
        (metrics.error_over_time, (3, 4)),
    ):
        together = measure(**both(members))
        assert together.shape == shape
        for one in range(3):
            np.testing.assert_array_equal(together[one], measure(**both(members[one])))


def test_labelled_members_keep_their_dimension():
    members = labelled(np.stack([PREDICTED, MEASURED]), dims=("member", "time"))
    measured = labelled(MEASURED)
    each = metrics.nrmse(predicted=members, measured=measured)
    assert each.heave.dims == ("member",)
    assert float(each.heave[1]) == 0.0
    average = metrics.anrmse(predicted=members, measured=measured)
    assert average.dims == ("member",)
    np.testing.assert_allclose(average, [metrics.anrmse(**both()), 0.0], rtol=1e-14)
    over_time = metrics.error_over_time(predicted=members, measured=measured)
    assert over_time.dims == ("member", "time")


# Datasets


def test_datasets_give_what_arrays_give():
    datasets = both(labelled(PREDICTED), labelled(MEASURED))
    for measure in (metrics.nrmse, metrics.normalised_extremes_error, metrics.fit_percent):
        result = measure(**datasets)
        assert list(result.data_vars) == ["heave", "mooring_bow"]
        np.testing.assert_array_equal(
            [float(result.heave), float(result.mooring_bow)], measure(**both())
        )
    assert metrics.anrmse(**datasets) == metrics.anrmse(**both())
    assert metrics.nammae(**datasets) == metrics.nammae(**both())
    over_time = metrics.error_over_time(**datasets)
    np.testing.assert_array_equal(over_time, metrics.error_over_time(**both()))
    np.testing.assert_array_equal(over_time.time, datasets["predicted"].time)


def test_channels_are_matched_by_name_and_instants_by_time():
    longer = np.concatenate([np.full((3, 2), 99.0), MEASURED, np.full((2, 2), -99.0)])
    measured = labelled(longer)[["mooring_bow", "heave"]]
    measured = measured.assign(other=measured.heave, time=measured.time - 1.5)
    predicted = labelled(PREDICTED)
    assert metrics.anrmse(predicted=predicted, measured=measured) == metrics.anrmse(**both())


def test_times_may_differ_by_rounding():
    measured = labelled(MEASURED)
    measured = measured.assign_coords(time=measured.time + 1e-9)
    assert metrics.anrmse(predicted=labelled(PREDICTED), measured=measured) == metrics.anrmse(
        **both()
    )


def test_a_forecast_carries_the_training_spread_that_finds_slack_lines(run, channels):
    model = HankelDMDc(3, 8, 1.0).fit(run, **channels)
    forecast = model.forecast(run, start=5.0, steps=100)
    measured = run.copy(deep=True)
    measured.pitch[:] = measured.pitch.mean() + 1e-4 * (measured.pitch - measured.pitch.mean())
    each = metrics.nrmse(predicted=forecast, measured=measured)
    assert np.isnan(float(each.pitch))
    assert metrics.anrmse(predicted=forecast, measured=measured) == float(each.heave)
    told = metrics.nrmse(predicted=forecast, measured=measured, training_std=[0.0, 0.0])
    assert np.isfinite(float(told.pitch))


# Refused


@pytest.mark.parametrize("measure", ALL)
def test_a_transposed_array_is_refused(measure):
    message = r"shape \(2, 4\) and measured \(4, 2\); .*\(time, channel\).* looks transposed"
    with pytest.raises(RequestError, match=message):
        measure(**both(PREDICTED.T))


@pytest.mark.parametrize("measure", ALL)
def test_lengths_that_differ_are_refused(measure):
    with pytest.raises(RequestError, match=r"predicted has shape \(3, 2\) and measured \(4, 2\)"):
        measure(**both(PREDICTED[:3]))


def test_leading_axes_that_differ_are_refused():
    with pytest.raises(
        RequestError, match=r"\(3, 4, 2\) and measured \(2, 4, 2\); the axes before"
    ):
        metrics.nrmse(**both(np.stack([PREDICTED] * 3), np.stack([MEASURED] * 2)))


def test_one_sample_has_no_spread():
    with pytest.raises(RequestError, match=r"a window of 1 sample\(s\) has no standard deviation"):
        metrics.nrmse(**both(PREDICTED[:1], MEASURED[:1]))


def test_a_dataset_and_an_array_are_refused():
    with pytest.raises(RequestError, match=r"both be Datasets .* received Dataset and ndarray"):
        metrics.nrmse(predicted=labelled(PREDICTED), measured=MEASURED)


def test_a_channel_that_was_not_measured_is_named():
    message = r"measured has no channel 'mooring_bow'\. Did you mean 'mooring_bo'\? It has: heave"
    with pytest.raises(RequestError, match=message):
        metrics.nrmse(
            predicted=labelled(PREDICTED), measured=labelled(MEASURED, ("heave", "mooring_bo"))
        )


@pytest.mark.parametrize("shift", [0.1, 0.5, 10.0])
def test_instants_that_were_not_measured_are_refused(shift):
    predicted = labelled(PREDICTED)
    predicted = predicted.assign_coords(time=predicted.time + shift)
    with pytest.raises(DataError, match=r"not every instant of the first is one of the second"):
        metrics.nrmse(predicted=predicted, measured=labelled(MEASURED))


@pytest.mark.parametrize("side", ["predicted", "measured"])
@pytest.mark.parametrize(
    ("time", "message"),
    [
        ([0.0, 1.0, 0.5, 1.5], r"the times of {} are not sorted"),
        ([0.0, 0.5, 0.5, 1.0], r"the times of {} repeat"),
    ],
)
def test_times_that_are_not_in_order_are_refused(side, time, message):
    datasets = both(labelled(PREDICTED), labelled(MEASURED))
    datasets[side] = datasets[side].assign_coords(time=time)
    with pytest.raises(DataError, match=message.format(side)):
        metrics.nrmse(**datasets)


@pytest.mark.parametrize("side", ["predicted", "measured"])
def test_a_dataset_without_time_is_refused(side):
    datasets = both(labelled(PREDICTED), labelled(MEASURED))
    datasets[side] = datasets[side].rename(time="sample")
    with pytest.raises(DataError, match=rf"{side} has no coordinate 'time' .*sample"):
        metrics.nrmse(**datasets)


def test_units_that_differ_are_refused():
    predicted, measured = labelled(PREDICTED, units="m"), labelled(MEASURED, units="mm")
    message = r"channel 'heave' is in 'm' in predicted and in 'mm' in measured\. Convert one"
    with pytest.raises(DataError, match=message):
        metrics.nrmse(predicted=predicted, measured=measured)


def test_training_spreads_must_be_one_a_channel():
    with pytest.raises(RequestError, match=r"training_std has shape \(3,\); .* 2 channels"):
        metrics.nrmse(**both(), training_std=[1.0, 1.0, 1.0])


def test_a_measure_is_added_by_one_function_and_one_line(tmp_path, monkeypatch):
    """As CONTRIBUTING shows it."""
    (tmp_path / "extra_measures.py").write_text(
        "import numpy as np\n"
        "from seakeep.core.metrics import paired\n"
        "from seakeep.metrics import labelled\n"
        "def mean_absolute_error(*, predicted, measured, training_std=None, noise_std=None):\n"
        "    p, m, spread, judged = paired(predicted, measured, training_std, noise_std)\n"
        "    return np.mean(np.abs(p - m), axis=-2) / spread\n"
        "mae = labelled(mean_absolute_error, keeps='channel', label='MAE')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    import extra_measures

    expected = np.array([0.5, 5.0]) / SD
    np.testing.assert_allclose(extra_measures.mae(**both()), expected, rtol=1e-14)
    each = extra_measures.mae(predicted=labelled(PREDICTED), measured=labelled(MEASURED))
    assert float(each.heave) == pytest.approx(expected[0], rel=1e-14)
    assert each.heave.attrs == {"units": "1", "long_name": "MAE of heave"}


@pytest.mark.parametrize("kind", [complex, "datetime64[s]", "timedelta64[s]"])
def test_channels_that_are_no_real_numbers_are_refused(kind):
    data = labelled(MEASURED)
    data["heave"] = ("time", np.arange(4).astype(kind))
    with pytest.raises(DataError, match=r"'heave' of predicted is of type .*, not a real number"):
        metrics.nrmse(predicted=data, measured=labelled(MEASURED))
    with pytest.raises(DataError, match=r"'heave' of measured is of type .*, not a real number"):
        metrics.nrmse(predicted=labelled(MEASURED), measured=data)


def test_a_channel_that_is_mostly_noise_is_not_judged():
    rng = np.random.default_rng(0)
    measured = np.sin(np.arange(400) / 5)[:, None] * [1.0, 0.1] + 0.1 * rng.standard_normal(
        (400, 2)
    )
    # SDs of 0.71 and 0.12 against noise of 0.1: √2 of it is more than the second moves.
    found = metrics.nrmse(predicted=0 * measured, measured=measured, noise_std=[0.1, 0.1])
    assert np.isfinite(found[0])
    assert np.isnan(found[1])
    noisy = labelled(measured)
    for name in noisy:
        noisy[name].attrs["noise_std"] = 0.1
    slack = metrics.is_slack(predicted=labelled(0 * measured), measured=noisy)
    assert [bool(slack[name]) for name in slack] == [False, True]
    with pytest.raises(RequestError, match=r"noise_std has shape \(3,\); one value for each"):
        metrics.nrmse(predicted=measured, measured=measured, noise_std=[1.0, 2.0, 3.0])


def autoregression(rng, size, phi=0.9):
    noise = rng.standard_normal(size + 200)
    out = np.empty_like(noise)
    last = 0.0
    for k, each in enumerate(noise):
        last = out[k] = phi * last + each
    return out[200:]


def test_an_interval_holds_the_value_of_a_long_record_as_often_as_it_says():
    rng, inside = np.random.default_rng(0), 0
    truth = 0.5  # an error of a quarter of the variance of the measurement
    for _ in range(60):
        measured = autoregression(rng, 400)[:, None]
        predicted = measured + truth * autoregression(rng, 400)[:, None]
        pair = both(predicted, measured)
        low, high = metrics.anrmse(**pair, interval=0.95)
        assert low < metrics.anrmse(**pair) < high
        inside += low <= truth <= high
    # Nominally 0.95; blocks cut some of the dependence: 60 trials have a standard error of 0.03.
    assert inside >= 0.85 * 60


def test_bounds_take_the_place_of_the_value():
    rng = np.random.default_rng(1)
    measured = rng.standard_normal((100, 2))
    pair = both(measured + 0.1 * rng.standard_normal((3, 100, 2)), measured)
    assert metrics.nrmse(**pair, interval=0.9).shape == (2, 3, 2)
    of_sets = {key: labelled(measured) for key in ("predicted", "measured")}
    bounds = metrics.nrmse(**of_sets, interval=0.9)
    assert bounds["heave"].dims == ("bound",)
    assert list(bounds["bound"].values) == ["lower", "upper"]
    assert metrics.nammae(**of_sets, interval=0.9).sel(bound="upper") == 0.0  # a perfect forecast
    with pytest.raises(RequestError, match="a value at each instant, and no interval over time"):
        metrics.error_over_time(**pair, interval=0.9)
    with pytest.raises(RequestError, match="interval must lie between 0 and 1"):
        metrics.nrmse(**pair, interval=95)
    with pytest.raises(RequestError, match="is_slack says yes or no, and has no interval"):
        metrics.is_slack(**pair, interval=0.9)


def test_a_forecast_that_ends_in_nan_has_no_interval():
    measured = np.random.default_rng(0).standard_normal((400, 2))
    predicted = 0.9 * measured
    predicted[-1, 1] = np.nan
    pair = both(predicted, measured)
    np.testing.assert_array_equal(
        np.isnan(metrics.nrmse(**pair, interval=0.9)), [[False, True], [False, True]]
    )
    assert np.isnan(metrics.anrmse(**pair, interval=0.9)).all()
    sets = [[labelled(0.9 * measured)], [labelled(predicted)]]
    found = metrics.anrmse_differences(sets, [labelled(measured)])
    for key in ("lower", "upper", "anrmse_lower", "all_upper"):
        assert np.isnan(found[key].values.ravel()[1])
        assert np.isfinite(found[key].values.ravel()[0])


def test_errors_that_models_share_cancel_in_their_difference():
    rng = np.random.default_rng(0)
    measured = [labelled(rng.normal(size=(300, 2))) for _ in range(2)]
    errors = [labelled(rng.normal(size=(300, 2))) for _ in measured]
    first, half, equal = (
        [m + scale * e for m, e in zip(measured, errors, strict=True)] for scale in (0.2, 0.1, 0.2)
    )
    found = metrics.anrmse_differences([first, half, equal], measured)
    for name, of in (("anrmse", first), ("all_anrmse", first)):
        own = [metrics.anrmse(predicted=p, measured=m) for p, m in zip(of, measured, strict=True)]
        np.testing.assert_array_equal(found[name][0], own if name == "anrmse" else np.mean(own))
    # Half the error in every sample is half the ANRMSE in every draw, to rounding.
    for key in ("change", "lower", "upper"):
        np.testing.assert_allclose(found[key], [[0, 0], [-0.5, -0.5], [0, 0]], atol=1e-12)
        np.testing.assert_allclose(found[f"all_{key}"], [0, -0.5, 0], atol=1e-12)


def test_the_interval_of_a_difference_holds_it_as_often_as_it_says():
    draws = np.random.default_rng(1).normal(size=(3, 500, 150, 1))
    measured, shared, own = ([labelled(each, ("heave",)) for each in of] for of in draws)
    first = [m + s for m, s in zip(measured, shared, strict=True)]
    second = [m + 0.8 * s + 0.3 * o for m, s, o in zip(measured, shared, own, strict=True)]
    found = metrics.anrmse_differences([first, second], measured).isel(model=1)
    truth = np.sqrt(0.8**2 + 0.3**2) - 1.0
    held = (found["lower"] <= truth) & (truth <= found["upper"])
    # 500 repetitions know a coverage of 95 % to 1 % (one SD).
    assert 0.92 <= float(held.mean()) <= 0.98


def test_the_interval_of_the_mean_over_runs_holds_it_as_often_as_it_says():
    draws = np.random.default_rng(2).normal(size=(150, 3, 2, 100, 1))
    truth, held = np.sqrt(0.8**2 + 0.3**2) - 1.0, 0
    for repetition in draws:
        measured, shared, own = ([labelled(each, ("heave",)) for each in of] for of in repetition)
        first = [m + s for m, s in zip(measured, shared, strict=True)]
        second = [m + 0.8 * s + 0.3 * o for m, s, o in zip(measured, shared, own, strict=True)]
        found = metrics.anrmse_differences([first, second], measured).isel(model=1)
        held += bool(found["all_lower"] <= truth <= found["all_upper"])
    # 150 repetitions know a coverage of 95 % to 1.8 % (one SD); 500 gave 92.6 %.
    assert 0.91 <= held / len(draws) <= 0.99


def test_a_channel_is_judged_where_less_than_half_of_its_variance_is_noise():
    measured = np.tile([[1.0, 1.0], [-1.0, -1.0]], (50, 1))
    spread = measured.std(axis=0, ddof=1)
    for part, slack in ((0.49, False), (0.51, True)):
        pair = both(measured, measured)
        found = metrics.is_slack(**pair, noise_std=np.sqrt(part) * spread)
        np.testing.assert_array_equal(found, [slack, slack])
