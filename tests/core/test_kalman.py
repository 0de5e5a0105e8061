"""The filter of a delay model against a textbook one, and what its covariance must do."""

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose

from seakeep.core.kalman import DelayFilter, process_noise

N, S = 2, 2
SIZE = N * (S + 1)
A = np.array([[0.1, 0.0, -0.4, 0.2, 1.1, 0.1], [0.0, -0.1, 0.1, -0.3, 0.05, 0.9]])
PROCESS = np.array([[0.04, 0.01], [0.01, 0.02]])
START = np.diag(np.arange(1.0, SIZE + 1))


def companion():
    return np.concatenate([np.eye(SIZE - N, SIZE, N), A])


@pytest.mark.oracle
def test_it_is_the_textbook_filter_with_rows_missing():
    kalman = pytest.importorskip("filterpy.kalman")
    noise = np.array([0.3, 0.1]) ** 2
    textbook = kalman.KalmanFilter(dim_x=SIZE, dim_z=N)
    textbook.x, textbook.P, textbook.F = np.zeros(SIZE), START.copy(), companion()
    textbook.Q = np.zeros((SIZE, SIZE))
    textbook.Q[-N:, -N:] = PROCESS
    rng = np.random.default_rng(3)
    measured = rng.standard_normal((120, N))
    measured[rng.uniform(size=measured.shape) < 0.3] = np.nan
    measured[40:60] = np.nan
    ours, state = DelayFilter(A, PROCESS, noise), np.zeros(SIZE)
    ours.covariance[:] = START
    for y in measured:
        state = np.concatenate([state[N:], A @ state])
        ours.shift()
        gain = ours.measure(np.isfinite(y))
        state = state + gain @ np.nan_to_num(y - state[-N:])
        textbook.predict()
        seen = np.flatnonzero(np.isfinite(y))
        if seen.size:
            textbook.update(y[seen], R=np.diag(noise[seen]), H=np.eye(N, SIZE, SIZE - N)[seen])
        # Hundreds of products of numbers of order one.
        assert_near(state, textbook.x, 1e-10)
        assert_near(ours.covariance, textbook.P, 1e-10)


def test_errors_of_today_are_carried_as_the_model_carries_them():
    raised, units = np.array([1.0, 3.0]), np.tile([1.0, 1e9], S + 1)  # m, and a load in N
    own = units[-N:]
    filter_ = DelayFilter(own[:, None] * A / units, PROCESS, np.zeros(N))
    filter_.covariance[:] = START * np.outer(units, units)
    found = filter_.ahead(5, raised)
    carried = np.linalg.matrix_power(companion(), 5) * np.resize(raised, SIZE)
    expected = own**2 * np.diagonal(carried @ START @ carried.T)[-N:]
    assert_allclose(found[-1], expected, rtol=1e-12)  # rounding


@pytest.mark.parametrize(("exactly", "factors"), [(False, [0.5, 1.0]), (True, [0.5, 2.0])])
def test_a_limit_scales_a_state_with_its_correlations(exactly, factors):
    covariance = START + 0.1
    filter_ = DelayFilter(A, PROCESS, np.zeros(N))
    filter_.covariance[:] = covariance
    filter_.limit(np.diagonal(covariance)[-N:] * [0.25, 4.0], exactly=exactly)
    scale = np.append(np.ones(SIZE - N), factors)
    assert_allclose(filter_.covariance, covariance * np.outer(scale, scale), rtol=1e-14)


def test_residuals_less_measurement_noise_are_process_noise():
    noise = np.array([0.02, 0.01])
    residual = PROCESS + np.diag(noise) + (A * np.tile(noise, S + 1)) @ A.T
    assert_allclose(process_noise(residual, A, noise), PROCESS, rtol=1e-12)
    assert np.linalg.eigvalsh(process_noise(PROCESS, A, 10 * noise)).min() > 0
