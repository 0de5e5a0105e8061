"""Three forms of one regression, and the choice between them."""

from dataclasses import replace

import numpy as np
import pytest
from matrices import Problem
from near import assert_near
from numpy.testing import assert_allclose

from seakeep.core import training_window
from seakeep.core.solve import GRAM_LIMIT, NARROW_LIMIT

LONG, WIDE, SQUARE = (1, 1, 40), (9, 19, 6), (4, 9, 20)
"""Delays of two states and one input, and columns: 6, 40 and 20 regressors."""


def of(states, inputs, s, z, columns):
    windows = [training_window(len(states) - 1, columns + 1, s, z, "before")]
    return Problem([states], [inputs], [inputs[:, :0]], windows, s, z)


def problem(shape):
    """Noise of three scales, so that the singular values spread over three decades."""
    s, z, columns = shape
    series = np.random.default_rng(0).standard_normal((columns + 1 + max(s, z), 3))
    series *= np.logspace(0, -3, 3)
    return of(series[:, :2], series[:, 2:], *shape)


def linear(shape):
    """A response with a residual a thousandth of it.

    With pure noise as target the coefficients are of order 1/√λ and their rounding grows with them.
    """
    found = problem(shape)
    (x,), (u,) = found.states, found.inputs
    for t in range(1, len(x)):
        x[t] *= 1e-3
        x[t] += [[0.5, 0.2], [-0.3, 0.6]] @ x[t - 1] + u[t - 1]
    return found


@pytest.mark.parametrize("shape", [LONG, WIDE, SQUARE])
@pytest.mark.parametrize("all_rows", [True, False])
def test_primal_dual_and_svd_agree_where_a_gram_matrix_is_chosen(shape, all_rows):
    """At the least λ for which one is; of larger ones: `test_fast_paths.py`."""
    made = linear(shape)
    ridge = 1.01 * GRAM_LIMIT * made.trace
    chosen = made.solved(ridge, all_rows=all_rows)
    assert chosen.method in ("primal", "dual")
    primal, dual, svd = (
        made.solved(ridge, method=form, all_rows=all_rows).coefficients
        for form in ("primal", "dual", "svd")
    )
    # Condition numbers up to 1e6 leave ten digits of the largest (the reason for GRAM_LIMIT); the
    # rows of the inverse from its structure lose up to two more where there are fewer columns than
    # regressors, where they are not chosen (5e-10 at the median of 60 draws, 2e-8 at the worst).
    largest = np.abs(svd).max()
    assert_near([chosen.coefficients, dual], [svd, svd], 1e-10 * largest)
    lost = 200 if all_rows and shape == WIDE else 1
    assert_near(primal, svd, lost * 1e-10 * largest)


@pytest.mark.parametrize(
    ("shape", "form", "all_rows"), [(LONG, "primal", True), (WIDE, "dual", False)]
)
def test_the_gram_matrix_is_used_from_the_limit_on_and_singular_values_below(shape, form, all_rows):
    made = problem(shape)
    limit = GRAM_LIMIT * made.trace
    assert GRAM_LIMIT == 1e-6
    # The trace is summed to rounding; a millionth is beyond it.
    ridges = limit * (1 + 1e-6), limit * (1 - 1e-6), 0.0
    methods = [made.solved(ridge, all_rows=all_rows).method for ridge in ridges]
    assert methods == [form, "svd", "svd"]


@pytest.mark.parametrize(("part", "digits"), [(1.01 * NARROW_LIMIT, 6), (1e-8, 8)])
def test_the_newest_rows_alone_are_regressed_with_less(part, digits):
    made = linear((3, 4, 200))
    # Twice summed noise is smooth: singular values of its delays spread over five decades.
    made = replace(made, inputs=[made.inputs[0].cumsum(axis=0).cumsum(axis=0)])
    assert np.linalg.cond(made.matrices()[0]) > 1e5
    found = made.solved(part * made.trace, all_rows=False)
    svd = made.solved(part * made.trace, all_rows=False, method="svd").coefficients
    assert found.method == "primal"
    # A condition number of 1e8 or 1e10 of sixteen digits, with a margin of five.
    assert_near(found.coefficients, svd, 5 * 10.0**-digits * np.abs(svd).max())
    assert made.solved(0.99 * NARROW_LIMIT * made.trace, all_rows=False).method == "svd"


def test_without_ridge_dependent_regressors_share_their_weight():
    states = np.repeat(3.0 ** np.arange(6.0)[:, None], 2, axis=1)
    solution = of(states, np.zeros((6, 0)), 0, 0, 5).solved(0.0)
    assert solution.rank == 1
    assert_allclose(solution.coefficients, np.full((2, 2), 1.5), rtol=1e-14)  # rounding
