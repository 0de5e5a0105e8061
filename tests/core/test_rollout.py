"""Free runs: the recursion, its forms, and what becomes of one that grows without bound."""

import numpy as np
from numpy.testing import assert_array_equal

from seakeep.core import rollout


def test_a_window_that_diverges_is_nan_from_there_on_and_the_others_go_on():
    # 1e200 squared overflows at the second step; the neighbour is at rest.
    out = rollout([[1e200]], [[0.0]], [[1.0], [0.0]], np.zeros((2, 5, 1)))
    assert_array_equal(out[0, :, 0], [1e200, *[np.nan] * 4])
    assert_array_equal(out[1, :, 0], 0.0)


def test_a_window_that_was_given_up_does_not_come_back():
    driving = np.ones((1, 200, 1))  # several steps of a filter are one product
    driving[0, 1] = 1e200
    out = rollout([[0.0]], [[1e200]], [[0.0]], driving)
    assert_array_equal(out[0, :, 0], [1e200, *[np.nan] * 199])
