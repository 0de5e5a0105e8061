"""Coverage on ensembles of known spread; boxes against matplotlib."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal
from scipy import integrate
from scipy.stats import norm

from seakeep.statistics import band_crps, box_statistics, coverage, coverage_table, winkler_score

# --- coverage ------------------------------------------------------------------------------------


def test_each_channel_and_window_is_judged_alone():
    measured = default_rng(1).standard_normal((3, 50, 2))
    found = coverage(measured - np.array([1.0, -0.5]), measured + np.array([2.0, 1.5]), measured)
    assert_array_equal(found.inside, [[1.0, 0.0]] * 3)
    assert_array_equal(found.below, [[0.0, 1.0]] * 3)
    # Differences of sums of numbers of order one.
    assert_allclose(found.width, [[3.0, 1.0]] * 3, rtol=1e-12)
    expected = np.array([3.0, 1.0]) / measured.std(axis=1, ddof=1)
    assert_allclose(found.relative_width, expected, rtol=1e-12)


def test_a_band_with_gaps_and_a_constant_measurement_give_nan():
    measured = np.stack([np.arange(4.0), np.ones(4)], axis=1)
    lower = measured - 1
    lower[2, 0] = np.nan
    found = coverage(lower, measured + 1, measured)
    assert_array_equal([found.inside, found.width], [[np.nan, 1.0], [np.nan, 2.0]])
    assert np.isnan(found.relative_width[1])


# --- scores and tables ---------------------------------------------------------------------------


@pytest.mark.parametrize("y", [-3.0, 0.0, 0.4, 5.0])
def test_the_crps_is_the_integral_that_defines_it(y):
    centre, spread, level = 0.3, 1.7, 0.9
    half = norm.ppf(0.5 + level / 2) * spread
    # ∫ (F(x) − 1{x ≥ y})² dx
    below = integrate.quad(lambda x: norm.cdf(x, centre, spread) ** 2, -40, y)[0]
    above = integrate.quad(lambda x: norm.sf(x, centre, spread) ** 2, y, 40)[0]
    assert_allclose(band_crps(centre - half, centre + half, y, level), below + above, rtol=1e-7)


def test_the_score_of_the_true_band_is_that_of_the_normal_distribution():
    y = default_rng(2).standard_normal(200_000)
    half = norm.ppf(0.975)
    # (2/α)·2φ(z) of the true quantiles. 200 000 numbers: 0.5 %.
    assert_allclose(winkler_score(-half, half, y).mean(), 80 * norm.pdf(half), rtol=0.01)


def test_scores_of_bands_without_width_lost_or_infinite():
    lower, upper = np.array([1.0, np.nan, -np.inf]), np.array([1.0, 2.0, np.inf])
    assert_array_equal(band_crps(lower, upper, 3.0), [2.0, np.nan, np.inf])
    assert_array_equal(winkler_score(lower, upper, 3.0, 0.5), [8.0, np.nan, np.inf])


def test_a_table_by_wave_height_and_horizon_by_hand():
    rng = default_rng(3)
    y = rng.standard_normal((4, 30, 2)) * [1.0, 10.0]
    waves = rng.uniform(size=(4, 30))
    lower, upper = np.full_like(y, -1.0), np.full_like(y, 2.0)
    lower[3, 5] = np.nan  # the last window is lost
    table = coverage_table(lower, upper, y, 0.9, waves)
    assert table.parts[0] == "all"
    assert table.instants.tolist() == [90] + 6 * [30]
    y, waves = y[:3], waves[:3]
    edges, third = np.quantile(waves, [1 / 3, 2 / 3]), np.tile(np.arange(30) // 10, (3, 1))
    places = {
        "all": third >= 0,
        "lowest waves": waves < edges[0],
        "highest waves": waves > edges[1],
        "first third": third == 0,
        "last third": third == 2,
    }
    spread = y.reshape(-1, 2).std(axis=0, ddof=1)
    for part, place in places.items():
        row, each = table.parts.index(part), y[place]
        found = table.inside[row], table.winkler[row], table.crps[row], table.relative_width[row]
        inside = (each >= -1) & (each <= 2)
        scores = inside, winkler_score(-1, 2, each, 0.9), band_crps(-1, 2, each, 0.9)
        assert_allclose(found, (*(score.mean(axis=0) for score in scores), 3 / spread), rtol=1e-12)
    lower[0, 2, 1] = np.nan  # of one channel alone
    parted = coverage_table(lower[:3], upper[:3], y, 0.9)
    for k, kept in ((0, slice(3)), (1, slice(1, 3))):
        alone = coverage_table(*(each[kept, :, [k]] for each in (lower, upper, y)), 0.9)
        for key in ("inside", "width", "winkler", "crps"):
            assert_allclose(getattr(parted, key)[:, k], getattr(alone, key)[:, 0])
    without = coverage_table(lower, upper, np.where(np.isnan(lower), 0, lower), 0.9)
    assert without.parts == ("all", "first third", "middle third", "last third")


# --- boxes ---------------------------------------------------------------------------------------


@pytest.mark.oracle
@settings(max_examples=200)
@given(values=st.lists(st.integers(-1000, 1000), min_size=1, max_size=40))
def test_boxes_are_matplotlibs_for_any_numbers(values):
    cbook = pytest.importorskip("matplotlib.cbook")
    theirs, ours = cbook.boxplot_stats(np.asarray(values, dtype=float))[0], box_statistics(values)
    # Both interpolate linearly in one order statistic or two; the last digit may differ.
    names = ["median", "lower_quartile", "upper_quartile", "mean", "lower_whisker", "upper_whisker"]
    expected = [theirs[key] for key in ("med", "q1", "q3", "mean", "whislo", "whishi")]
    assert_allclose([getattr(ours, name) for name in names], expected, atol=1e-9)
    assert_array_equal(ours.outliers, np.sort(theirs["fliers"]))


def test_infinite_values_count_and_nan_does_not():
    box = box_statistics([[1.0, np.nan, 2.0], [np.inf, 3.0, 4.0]])
    assert (box.count, box.left_out) == (5, 1)
    assert (box.median, box.upper_quartile, box.upper_whisker) == (3.0, 4.0, 4.0)
    most = box_statistics([np.inf, 1.0, np.inf, np.inf, np.inf])
    assert (most.lower_whisker, most.lower_quartile, most.median) == (1.0, np.inf, np.inf)
