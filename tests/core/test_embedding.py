"""Delay embedding: its order, its inverse, and which samples a window uses."""

import numpy as np
import pytest

from seakeep.core import embed, training_window


def test_blocks_are_lag_major_the_newest_first():
    columns = embed(np.array([[0.0, 10], [1, 11], [2, 12], [3, 13]]), delays=1, first=2, count=2)
    np.testing.assert_array_equal(columns.T, [[2, 12, 1, 11], [3, 13, 2, 12]])


@pytest.mark.parametrize(
    ("last", "window", "history", "first", "first_column", "columns"),
    [
        (999, 640, "before", 360, 360, 639),  # all m − 1 pairs: the history lies before
        (700, 640, "before", 61, 160, 540),  # the run starts 99 samples too late for that
        (639, 640, "before", 0, 160, 479),  # nothing lies before
        (799, 640, "inside", 160, 320, 479),
        (799, None, "before", 0, 160, 639),
        (799, None, "inside", 0, 160, 639),
    ],
)
def test_windows_at_the_papers_delays(last, window, history, first, first_column, columns):
    place = training_window(last, window, 32, 160, history)
    assert (place.first, place.first_column, place.columns) == (first, first_column, columns)
    assert place.samples == slice(first, last + 1)
