"""Many ridge regressions from one Gram matrix: folds, columns and λ."""

import numpy as np

from seakeep.core.path import Moments, lagged, ridge_path


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
