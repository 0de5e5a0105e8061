"""Many ridge regressions from one Gram matrix: folds, columns and λ."""

import numpy as np
import pytest

from seakeep.core.path import Moments, free_runs, lagged, ridge_path
from seakeep.core.rollout import rollout


def pairs(seed: int, count: int = 60, p: int = 7, n: int = 2) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    regressors = rng.normal(size=(count, p)) @ rng.normal(size=(p, p)) + rng.normal(size=p)
    return regressors, rng.normal(size=(count, n)) + 3.0


def test_moments_of_a_fold_are_those_of_its_own_standardised_pairs():
    parts = [pairs(seed, count) for seed, count in ((0, 40), (1, 70), (2, 55))]
    total = Moments.of(*parts[0]) + Moments.of(*parts[2])
    columns = np.array([5, 0, 3])
    y = np.concatenate([parts[0][0], parts[2][0]])[:, columns]
    x = np.concatenate([parts[0][1], parts[2][1]])
    mean, scale = y.mean(axis=0) + 0.1, y.std(axis=0)  # of the windows, not of the pairs alone
    middle, unit = x.mean(axis=0) - 0.2, x.std(axis=0)
    gram, right = total.chosen(columns).standardised(mean, scale, middle, unit)
    deviations, targets = (y - mean) / scale, (x - middle) / unit
    # Sums of a hundred products; the correction takes off numbers of their own size.
    np.testing.assert_allclose(gram, deviations.T @ deviations, rtol=1e-11, atol=1e-11)
    np.testing.assert_allclose(right, targets.T @ deviations, rtol=1e-11, atol=1e-11)


def test_the_path_gives_the_ridge_solution_at_every_lambda():
    regressors, targets = pairs(3)
    gram, right = regressors.T @ regressors, targets.T @ regressors
    ridges = [1e-3, 0.1, 10.0, 1e4]
    for ridge, found in zip(ridges, ridge_path(gram, right, ridges), strict=True):
        expected = np.linalg.solve(gram + ridge * np.eye(len(gram)), right.T).T
        # The Gram matrix has a condition number of some 1e5 at the least λ.
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10)


def test_lagged_rows_stand_newest_first():
    series = np.arange(10.0)[:, None] * [1.0, 10.0]
    np.testing.assert_array_equal(lagged(series, 3, 2, 2)[1], [4, 40, 3, 30, 2, 20])


def test_free_runs_of_several_models_are_those_of_one_after_the_other():
    rng = np.random.default_rng(4)
    N, s, q, windows, steps = 2, 3, 3, 4, 25
    tops = 0.2 * rng.normal(size=(3, N, N * (s + 1)))
    b = rng.normal(size=(3, N, q))
    histories = rng.normal(size=(windows, N * (s + 1)))
    inputs = rng.normal(size=(windows, steps, q))
    forcing = np.einsum("wtq,mnq->mwtn", inputs, b)
    found = free_runs(tops, histories, forcing)
    for model in range(3):
        expected = rollout(tops[model], b[model], histories, inputs)
        # Twenty-five steps of products in another order.
        np.testing.assert_allclose(found[model], expected, rtol=1e-10, atol=1e-12)


def test_a_free_run_that_grows_beyond_all_numbers_stays_alone():
    tops = np.array([[[1e200]], [[0.5]]])
    out = free_runs(tops, np.ones((1, 1)), np.zeros((2, 1, 5, 1)))
    assert not np.isfinite(out[0, 0, -1, 0])
    assert out[1, 0, -1, 0] == pytest.approx(0.5**5)
