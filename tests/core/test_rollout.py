"""Free runs: the recursion, its forms, and what becomes of one that grows without bound."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from seakeep.core import embed, rollout


def problem(n=2, q=2, s=3, z=4, windows=3, steps=12, seed=0):
    """Top rows of a contracting model, histories and inputs as samples, oldest first."""
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((n, n * (s + 1)))
    a *= 0.9 / np.abs(a).sum(axis=1, keepdims=True)
    b = rng.standard_normal((n, q * (z + 1)))
    return (
        a,
        b,
        rng.standard_normal((windows, s + 1, n)),
        rng.standard_normal((windows, z + steps, q)),
    )


def shifted(a, n):
    size = a.shape[1]
    return np.vstack([a, np.eye(size - n, size)])


def extended(histories, inputs, s, z):
    """Both in the embedded form, newest block first."""
    x = np.stack([embed(one, s, s, 1)[:, 0] for one in histories])
    u = np.stack([embed(one, z, z, len(one) - z).T for one in inputs])
    return x, u


@settings(max_examples=30, deadline=None)
@given(
    n=st.integers(1, 3),
    q=st.integers(1, 3),
    s=st.integers(0, 5),
    z=st.integers(0, 5),
    windows=st.integers(1, 6),
    seed=st.integers(0, 99),
)
def test_every_form_of_the_same_run_agrees(n, q, s, z, windows, seed):
    a, b, histories, inputs = problem(n, q, s, z, windows, 8, seed)
    x, u = extended(histories, inputs, s, z)
    square, full = shifted(a, n), np.vstack([b, np.zeros((n * s, b.shape[1]))])
    expected = rollout(a, b, histories, inputs)
    assert expected.shape == (windows, 8, n)
    for form in (
        rollout(a, b, x, u),
        rollout(a, b, x, inputs),
        rollout(a, b, histories, u),
        rollout(square, full, histories, inputs),
        rollout(square, full, x, u, n_states=n),
    ):
        np.testing.assert_allclose(form, expected, rtol=0, atol=1e-11)  # rounding of eight steps


def test_a_window_that_diverges_is_nan_from_there_on_and_the_others_go_on():
    # 1e200 squared overflows at the second step; the neighbour is at rest.
    out = rollout([[1e200]], [[0.0]], [[1.0], [0.0]], np.zeros((2, 5, 1)))
    np.testing.assert_array_equal(out[0, :, 0], [1e200, *[np.nan] * 4])
    np.testing.assert_array_equal(out[1, :, 0], 0.0)


def test_a_window_that_was_given_up_does_not_come_back():
    driving = np.array([1.0, 1e200, 1.0])[None, :, None]
    out = rollout([[0.0]], [[1e200]], [[0.0]], driving)
    np.testing.assert_array_equal(out[0, :, 0], [1e200, np.nan, np.nan])


def test_a_square_matrix_returns_its_whole_state():
    a, size = np.random.default_rng(0).standard_normal((6, 6)) / 6, 6
    out = rollout(a, np.ones((size, 1)), np.ones((1, size)), np.zeros((1, 3, 1)))
    assert rollout(a, np.ones((size, 1)), np.ones((0, size)), np.zeros((0, 3, 1))).shape == (
        0,
        3,
        6,
    )
    expected = [np.linalg.matrix_power(a, step) @ np.ones(size) for step in (1, 2, 3)]
    np.testing.assert_allclose(out[0], expected, rtol=1e-13)  # rounding of three products
