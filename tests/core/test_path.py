"""Many ridge regressions from one Gram matrix."""

import numpy as np

from seakeep.core.gram import ridge_path


def test_the_path_gives_the_ridge_solution_at_every_lambda_from_the_upper_triangle():
    rng = np.random.default_rng(3)
    regressors = rng.normal(size=(60, 7)) @ rng.normal(size=(7, 7)) + rng.normal(size=7)
    gram, right = regressors.T @ regressors, rng.normal(size=(2, 60)) @ regressors
    upper = np.where(np.tri(7, k=-1, dtype=bool), np.nan, gram)
    ridges = [1e-3, 0.1, 10.0, 1e4]
    for ridge, found in zip(ridges, ridge_path(upper, right, ridges), strict=True):
        expected = np.linalg.solve(gram + ridge * np.eye(len(gram)), right.T).T
        # The Gram matrix has a condition number of some 1e5 at the least λ.
        np.testing.assert_allclose(found, expected, rtol=1e-8, atol=1e-10)
