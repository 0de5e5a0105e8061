"""Three forms of one regression, and the choice between them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seakeep.core import solve
from seakeep.core.regression import GRAM_LIMIT, choose_method

SHAPES = [(6, 40), (40, 6), (20, 20)]


def problem(rows, columns, seed=0, targets=3):
    rng = np.random.default_rng(seed)
    y = rng.standard_normal((rows, columns)) * np.logspace(0, -3, rows)[:, None]
    return y, rng.standard_normal((targets, columns))


def largest_squared(y):
    return np.linalg.svd(y, compute_uv=False)[0] ** 2


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("part", [1.01e-6, 1e-3, 1.0])
def test_primal_dual_and_svd_agree_where_a_gram_matrix_is_chosen(shape, part):
    y, x = problem(*shape)
    # A residual as small as that of a fitted model; with pure noise as target the coefficients
    # are of order 1/√λ and their rounding grows with them.
    x = np.ones((3, shape[0])) @ y + 1e-3 * x
    ridge = part * largest_squared(y)
    assert choose_method(y, ridge) in ("primal", "dual")
    primal, dual, svd = (
        solve(y, x, ridge, method=form).coefficients for form in ("primal", "dual", "svd")
    )
    # Condition numbers up to 1e6 leave ten digits (the reason for GRAM_LIMIT).
    np.testing.assert_allclose(primal, svd, rtol=0, atol=1e-10)
    np.testing.assert_allclose(dual, svd, rtol=0, atol=1e-10)


@pytest.mark.parametrize(("shape", "form"), [((6, 40), "primal"), ((40, 6), "dual")])
def test_the_gram_matrix_is_used_from_the_limit_on_and_singular_values_below(shape, form):
    y, _ = problem(*shape)
    limit = GRAM_LIMIT * largest_squared(y)
    assert GRAM_LIMIT == 1e-6
    # The eigenvalue that decides is computed to rounding; a millionth is beyond it.
    assert choose_method(y, limit * (1 + 1e-6)) == form
    assert choose_method(y, limit * (1 - 1e-6)) == "svd"
    assert choose_method(y, 0.0) == "svd"


@pytest.mark.parametrize("shape", SHAPES)
def test_the_paper_formula_in_plain_numpy(shape):
    y, x = problem(*shape)
    ridge = 0.3
    expected = x @ y.T @ np.linalg.inv(y @ y.T + ridge * np.eye(shape[0]))
    # Condition number about 1e3 here.
    np.testing.assert_allclose(solve(y, x, ridge).coefficients, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("shape", SHAPES)
def test_without_ridge_the_solution_of_least_norm_is_taken(shape):
    y, x = problem(*shape)
    expected = x @ np.linalg.pinv(y, rcond=1e-14)
    # Least singular value about 1e-3 of the largest, coefficients up to 1e3 of order one.
    np.testing.assert_allclose(solve(y, x, 0.0).coefficients, expected, rtol=1e-9, atol=1e-9)


def test_without_ridge_dependent_regressors_share_their_weight():
    y = np.vstack([np.arange(1.0, 6.0)] * 2)
    solution = solve(y, 3.0 * y[:1], 0.0)
    assert solution.rank == 1
    np.testing.assert_allclose(solution.coefficients, [[1.5, 1.5]], rtol=1e-14)  # rounding


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("rank", [1, 4, 6])
def test_a_rank_equals_truncated_singular_values_in_plain_numpy(shape, rank):
    y, x = problem(*shape)
    left, values, right = np.linalg.svd(y, full_matrices=False)
    inverse = right[:rank].T @ np.diag(1 / values[:rank]) @ left[:, :rank].T
    solution = solve(y, x, 0.0, rank=rank)
    assert (solution.rank, solution.method) == (rank, "svd")
    np.testing.assert_allclose(solution.coefficients, x @ inverse, rtol=1e-9, atol=1e-9)


def test_a_rank_beyond_the_data_is_cut_to_what_there_is():
    y, x = problem(6, 40)
    solution = solve(y, x, 0.0, rank=100)
    assert solution.rank == 6
    np.testing.assert_allclose(
        solution.coefficients, solve(y, x, 0.0).coefficients, rtol=1e-12, atol=1e-12
    )  # the same arithmetic


@settings(max_examples=40, deadline=None)
@given(
    rows=st.integers(1, 12),
    columns=st.integers(1, 12),
    ridge=st.floats(1e-3, 1e3),
    seed=st.integers(0, 1000),
)
def test_the_gradient_vanishes_at_the_solution(rows, columns, ridge, seed):
    rng = np.random.default_rng(seed)
    y, x = rng.standard_normal((rows, columns)), rng.standard_normal((2, columns))
    g = solve(y, x, ridge).coefficients
    gradient = (g @ y - x) @ y.T + ridge * g
    # The terms are sums of up to a dozen products of order ten.
    np.testing.assert_allclose(gradient, 0, atol=1e-10)


@settings(max_examples=20, deadline=None)
@given(small=st.floats(1e-3, 10), factor=st.floats(1.1, 100), seed=st.integers(0, 100))
def test_more_ridge_shrinks_the_coefficients(small, factor, seed):
    y, x = problem(8, 15, seed)
    norms = [np.linalg.norm(solve(y, x, ridge).coefficients) for ridge in (small, small * factor)]
    assert norms[1] < norms[0]
