"""Coverage on ensembles of known spread; boxes against matplotlib."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from seakeep.errors import DataError, RequestError
from seakeep.statistics import box_statistics, coverage

# --- coverage ------------------------------------------------------------------------------------


@pytest.mark.parametrize("ratio", [1.0, 0.5, 2.0])
def test_coverage_of_an_ensemble_of_known_spread(ratio):
    rng = np.random.default_rng(0)
    samples, members = 20_000, 400
    centre = rng.standard_normal(samples)
    measured = centre + rng.standard_normal(samples)
    ensemble = centre + ratio * rng.standard_normal((members, samples))
    lower, upper = np.quantile(ensemble, [0.025, 0.975], axis=0)
    found = coverage(lower, upper, measured)
    # Binomial standard error 0.0015 to 0.003; quantiles of 400 members lie inside the true ones
    # by about 1/400 of probability at each end, and scatter: 0.012 holds all.
    assert found.inside == pytest.approx(2 * norm.cdf(1.96 * ratio) - 1, abs=0.012)
    assert found.width == pytest.approx(2 * 1.96 * ratio, rel=0.02)
    assert found.relative_width == pytest.approx(2 * 1.96 * ratio / np.sqrt(2), rel=0.03)
    assert found.below == pytest.approx(found.above, abs=0.012)


def test_each_channel_and_window_is_judged_alone():
    rng = np.random.default_rng(1)
    measured = rng.standard_normal((3, 50, 2))
    lower = measured - np.array([1.0, -0.5])
    upper = measured + np.array([2.0, 1.5])
    found = coverage(lower, upper, measured)
    assert found.inside.shape == (3, 2)
    assert np.all(found.inside == [1.0, 0.0])
    assert np.all(found.below == [0.0, 1.0])
    # Differences of sums of numbers of order one.
    assert found.width == pytest.approx(np.broadcast_to([3.0, 1.0], (3, 2)), rel=1e-12)
    expected = np.array([3.0, 1.0]) / measured.std(axis=1, ddof=1)
    assert found.relative_width == pytest.approx(expected, rel=1e-12)


def test_bounds_belong_to_the_band():
    found = coverage([0.0, 0.0], [1.0, 1.0], [0.0, 1.0])
    assert float(found.inside) == 1.0


def test_one_measurement_serves_many_bands():
    measured = np.arange(10.0)[:, None]
    lower = np.stack([measured - 1, measured + 1])
    found = coverage(lower, lower + 1.5, measured)
    assert found.inside.tolist() == [[1.0], [0.0]]


@pytest.mark.filterwarnings("error")
def test_an_infinite_margin_holds_everything():
    measured = np.array([[0.0, 0.0], [1.0, 5.0], [2.0, 0.0]])
    lower, upper = np.full((3, 2), [-np.inf, -1.0]), np.full((3, 2), [np.inf, 1.0])
    found = coverage(lower, upper, measured)
    assert found.inside.tolist() == [1.0, pytest.approx(2 / 3, rel=1e-15)]  # two roundings
    assert found.width.tolist() == [np.inf, 2.0]
    assert found.relative_width[0] == np.inf


def test_leading_axes_that_differ_are_refused():
    bounds = np.zeros((3, 4, 2))
    with pytest.raises(
        RequestError, match=r"\(3, 4, 2\) and measured \(2, 4, 2\); the axes before"
    ):
        coverage(bounds, bounds, np.zeros((2, 4, 2)))


def test_a_band_with_gaps_and_a_constant_measurement_give_nan():
    measured = np.stack([np.arange(4.0), np.ones(4)], axis=1)
    lower = measured - 1
    lower[2, 0] = np.nan
    found = coverage(lower, measured + 1, measured)
    assert np.isnan(found.inside[0])
    assert np.isnan(found.width[0])
    assert found.inside[1] == 1.0
    assert found.width[1] == 2.0
    assert np.isnan(found.relative_width[1])


@pytest.mark.parametrize(
    ("lower", "upper", "measured", "error", "message"),
    [
        ([0, 0], [1, 1], [1, 1, 1], RequestError, r"lower has shape \(2,\).* measured \(3,\)"),
        ([1, 1], [0, 0], [1, 1], RequestError, r"lower exceeds upper at 2 instant\(s\)"),
        ([0, 0], [1, 1], [1, np.nan], DataError, r"measured holds 1 value\(s\) that are NaN"),
        ([0], [1], [1], DataError, r"a window of 1 instant\(s\)"),
    ],
)
def test_what_coverage_refuses(lower, upper, measured, error, message):
    with pytest.raises(error, match=message):
        coverage(lower, upper, measured)


# --- boxes ---------------------------------------------------------------------------------------


def compare_with_matplotlib(values):
    cbook = pytest.importorskip("matplotlib.cbook")
    theirs = cbook.boxplot_stats(np.asarray(values, dtype=float))[0]
    ours = box_statistics(values)
    # Both interpolate linearly in one order statistic or two; the last digit may differ.
    size = 1e-12 * max(1.0, float(np.abs(values).max()))
    assert ours.median == pytest.approx(theirs["med"], abs=size)
    assert ours.lower_quartile == pytest.approx(theirs["q1"], abs=size)
    assert ours.upper_quartile == pytest.approx(theirs["q3"], abs=size)
    assert ours.interquartile_range == pytest.approx(theirs["iqr"], abs=size)
    assert ours.mean == pytest.approx(theirs["mean"], abs=size)
    assert ours.lower_whisker == theirs["whislo"]
    assert ours.upper_whisker == theirs["whishi"]
    assert ours.outliers == pytest.approx(np.sort(theirs["fliers"]), abs=0)


@pytest.mark.oracle
@settings(max_examples=200, deadline=None)
@given(values=st.lists(st.integers(-1000, 1000), min_size=1, max_size=40))
def test_boxes_are_matplotlibs_for_any_numbers(values):
    compare_with_matplotlib(values)


@pytest.mark.oracle
@pytest.mark.parametrize("seed", range(5))
def test_boxes_are_matplotlibs_for_heavy_tails(seed):
    compare_with_matplotlib(np.random.default_rng(seed).standard_t(2, size=100))


def test_a_whisker_does_not_end_inside_the_box():
    # No value lies between the upper fence and the box.
    compare_with_matplotlib([0.0, 0.0, 0.0, 10.0])
    compare_with_matplotlib([1.0, 1.0, 1.0, 1.0, 9.0])


def test_diverged_values_are_left_out_and_counted():
    box = box_statistics([[1.0, np.nan, 2.0], [np.inf, 3.0, 4.0]])
    assert (box.count, box.left_out, box.median) == (4, 2, 2.5)


def test_what_a_box_refuses():
    with pytest.raises(DataError, match=r"none of 2 value\(s\) is finite"):
        box_statistics([np.nan, np.inf])
    with pytest.raises(RequestError, match="reach must be zero or more; received -1"):
        box_statistics([1.0, 2.0], reach=-1)
