"""Intervals of differences over training sets and windows hold the truth as often as they say."""

import numpy as np
import pytest
from numpy.random import default_rng

from seakeep.statistics import overlap_block, two_way_interval


def mean(a, b=0.0):
    """Of each draw: errors, or their difference, where they are judged."""
    return np.nanmean(a - b, axis=(1, 2))


def table(rng, row, column, cell, overlap):
    """Errors of training sets and windows, neighbours of which share data."""

    def effect(spread):
        drawn = rng.normal(0, spread, 9 + overlap)
        return np.convolve(drawn, np.ones(overlap) / np.sqrt(overlap), "valid")

    return 1 + effect(row)[:, None] + effect(column) + rng.normal(0, cell, (10, 10))


@pytest.mark.parametrize(
    ("row", "column", "cell", "overlap"),
    [(0.1, 0.1, 0.1, 1), (0.0, 0.1, 0.1, 1), (0.1, 0.1, 0.0, 1), (0.1, 0.1, 0.1, 2)],
)
def test_the_interval_holds_the_truth_as_often_as_it_says(row, column, cell, overlap):
    rng, inside = default_rng(0), 0
    for _ in range(200):
        pair = (table(rng, row, column, cell, overlap) for _ in range(2))
        low, high = two_way_interval(mean, *pair, rng=rng, blocks=(overlap, overlap), n_series=200)
        inside += bool(low <= 0.0 <= high)
    # Nominally 0.95: 200 trials have a standard error of 0.015; overlapping neighbours leave five
    # blocks an axis, of which an interval falls short by some hundredths.
    assert inside / 200 > (0.92, 0.88)[overlap - 1]


def test_pairs_are_kept_and_further_axes_too():
    rng = default_rng(1)
    errors = rng.normal(1.0, 0.3, (6, 8, 2))
    low, high = two_way_interval(mean, errors + 0.5, errors, rng=rng)
    np.testing.assert_allclose([low, high], 0.5)  # the same cells on both sides: no spread at all
    assert low.shape == (2,)


def test_cells_that_are_not_judged_are_left_out():
    rng = default_rng(2)
    errors = rng.normal(1.0, 0.1, (3, 30))
    errors[np.arange(30) % 3 != np.arange(3)[:, None]] = np.nan  # runs are left out in turn
    low, high = two_way_interval(mean, errors, rng=rng)
    assert low < 1.0 < high


@pytest.mark.filterwarnings("ignore:Mean of empty")  # where the one judged is not drawn
def test_too_few_blocks_give_no_interval_and_one_cell_is_conditioned_on():
    rng = default_rng(3)
    errors = rng.normal(1.0, 0.1, (2, 30))
    assert np.isnan(two_way_interval(mean, errors, rng=rng)).all()
    assert np.isnan(two_way_interval(mean, errors[:1], rng=rng, blocks=(1, 12))).all()
    assert np.isfinite(two_way_interval(mean, errors[:1], rng=rng)).all()
    alone = np.where(np.arange(9)[:, None] == 4, errors[0], np.nan)  # one of nine rows is judged
    low, high = two_way_interval(mean, alone, rng=rng)
    assert low < errors[0].mean() < high


def test_blocks_are_as_long_as_windows_overlap():
    apart = [("a", 10.0 * k, 10.0 * k + 10) for k in range(5)]
    assert overlap_block(apart) == 1
    assert overlap_block([*apart, *apart]) == 2
    assert overlap_block([(run, 0.0, 10.0) for run in "abc"]) == 1


def test_neighbours_are_drawn_together():
    """Rows in pairs of one value each: drawn two by two their mean scatters √2 times as far."""
    rows = np.repeat(default_rng(0).normal(size=20), 2)[:, None] * np.ones((1, 1))
    widths = []
    for block in (1, 2):
        low, high = two_way_interval(
            mean, rows, rng=default_rng(1), blocks=(block, 1), n_series=4000
        )
        widths.append(float(high - low))
    # Blocks start anywhere, so that half of them hold two pairs: the variance is 1.5 times as
    # large, and fewer blocks move the quantiles out by 5 %. 4000 draws know a width to 2 %.
    assert 1.15 < widths[1] / widths[0] < 1.4
