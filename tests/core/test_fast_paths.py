"""Each trick of the fast core equals the plain formula over random shapes."""

from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seakeep.core import gram as gram_module
from seakeep.core import identify, rollout, snapshot_matrices
from seakeep.core.embedding import TrainingWindow
from seakeep.core.gram import Piece, gram_trace, primal_system, snapshot_gram
from seakeep.core.lagged import lagged_response, lagged_sums

# Sums of at most a few hundred products of order one: 1e-12 is a thousand roundings.
TIGHT = 1e-12
# The house rule for results; the condition number here is below 1e4.
RESULT = 1e-10


@st.composite
def problems(draw):
    """Runs, windows and delays: one to three runs, Q, s and z down to zero."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    N, Q = draw(st.integers(1, 3)), draw(st.integers(0, 3))
    s, z = draw(st.integers(0, 6)), draw(st.integers(0, 6))
    states, inputs, windows = [], [], []
    for _ in range(draw(st.integers(1, 3))):
        count = draw(st.integers(1, 40))
        before, after = draw(st.integers(0, 3)), draw(st.integers(0, 3))
        first = max(s, z) + before
        length = first + count + 1 + after
        # A gap where no snapshot reaches is none of our business.
        x, u = rng.normal(size=(length, N)), rng.normal(size=(length, Q))
        x[: first - s], u[: first - z] = np.nan, np.nan
        states.append(x)
        inputs.append(u)
        windows.append(TrainingWindow(first, first + count, first))
    return states, inputs, windows, s, z


def built(problem, all_rows=True):
    states, inputs, windows, s, z = problem
    pieces = [
        snapshot_matrices(x, u, window, s, z, all_rows)
        for x, u, window in zip(states, inputs, windows, strict=True)
    ]
    return (np.concatenate(group, axis=1) for group in zip(*pieces, strict=True))


def pieces_of(problem):
    states, inputs, windows, _, _ = problem
    return [
        Piece(x, u, window.first_column, window.columns)
        for x, u, window in zip(states, inputs, windows, strict=True)
    ]


# Rows of a panel: these matrices are smaller than the usual height, and must have joints too.
panels = st.sampled_from([1, 2, 5, gram_module.PANEL])


@settings(deadline=None)
@given(problems(), panels)
def test_the_displaced_gram_is_the_gram(problem, panel):
    states, _, _, s, z = problem
    regressors, targets = built(problem)
    N, extended = states[0].shape[1], states[0].shape[1] * (s + 1)
    # Inputs stand first.
    turned = np.concatenate([regressors[extended:], regressors[:extended]])
    with patch.object(gram_module, "PANEL", panel):
        system = primal_system(pieces_of(problem), s, z)
    gram, right = system.gram, system.right
    np.testing.assert_allclose(np.triu(gram), np.triu(turned @ turned.T), atol=TIGHT, rtol=TIGHT)
    np.testing.assert_allclose(right, targets[:N] @ turned.T, atol=TIGHT, rtol=TIGHT)


@settings(deadline=None)
@given(problems(), panels)
def test_the_diagonal_sums_are_the_gram_of_the_snapshots(problem, panel):
    *_, s, z = problem
    regressors, _ = built(problem)
    with patch.object(gram_module, "PANEL", panel):
        gram = snapshot_gram(pieces_of(problem), s, z)
    np.testing.assert_allclose(
        np.triu(gram), np.triu(regressors.T @ regressors), atol=TIGHT, rtol=TIGHT
    )


@settings(deadline=None)
@given(problems())
def test_the_trace_is_the_sum_of_squares(problem):
    *_, s, z = problem
    regressors, _ = built(problem)
    assert gram_trace(pieces_of(problem), s, z) == pytest.approx(np.sum(regressors**2), rel=TIGHT)


@settings(deadline=None)
@given(problems(), st.floats(0.5, 200.0), st.booleans())
def test_every_form_gives_the_papers_formula(problem, ridge, all_rows):
    states, inputs, windows, s, z = problem
    regressors, targets = built(problem, all_rows)
    plain = regressors @ regressors.T + ridge * np.eye(len(regressors))
    expected = np.linalg.solve(plain, regressors @ targets.T).T
    for method in ("primal", "dual", "svd", None):
        found = identify(
            states,
            inputs,
            windows,
            state_delays=s,
            input_delays=z,
            ridge=ridge,
            all_rows=all_rows,
            method=method,
        )
        np.testing.assert_allclose(found.coefficients, expected, atol=RESULT)


@settings(deadline=None)
@given(
    st.integers(0, 2**32 - 1),
    st.integers(1, 30),
    st.integers(1, 4),
    st.integers(0, 300),
    st.integers(0, 5),
)
def test_lagged_sums_are_products_with_a_hankel_matrix(seed, count, channels, lags, rows):
    rng = np.random.default_rng(seed)
    series = rng.normal(size=(count + lags + 2, channels))
    first = max(lags - 1, 0) + 1
    left = rng.normal(size=(count, rows))
    hankel = np.concatenate(
        [
            np.zeros((0, count)),
            *(series[first - lag : first - lag + count].T for lag in range(lags)),
        ]
    )
    np.testing.assert_allclose(
        lagged_sums(left, series, first, lags), left.T @ hankel.T, atol=TIGHT
    )
    weights = rng.normal(size=lags * channels)
    np.testing.assert_allclose(
        lagged_response(series, weights, first, count), weights @ hankel, atol=10 * TIGHT
    )


def stepwise(a, b, state, inputs, delays, steps, count):
    """The loop of the paper over the extended state."""
    out = np.empty((steps, count))
    for k in range(steps):
        extended = inputs[k : k + delays + 1][::-1].ravel()
        state = a @ state + b @ extended
        out[k] = state[:count]
    return out


@st.composite
def free_runs(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    N, Q = draw(st.integers(1, 4)), draw(st.integers(0, 3))
    s, z = draw(st.integers(0, 5)), draw(st.integers(0, 5))
    windows, steps = draw(st.integers(1, 4)), draw(st.integers(1, 90))
    size = N * (s + 1)
    kind = draw(st.sampled_from(["full", "shift", "mirrored"]))
    a = rng.normal(size=(size, size)) / (2 * size)
    b = rng.normal(size=(size, Q * (z + 1)))
    if kind != "full":
        a[N:] = np.eye(size - N, size)
    if kind == "shift":
        b[N:] = 0.0
        a[:N] *= 0.5
    if kind == "mirrored" and s:
        half = rng.normal(size=(size - N, size - N)) / (4 * size)
        a[N:, : size - N] = 0.5 * np.eye(size - N) + half + half.T
    histories = rng.normal(size=(windows, s + 1, N))
    inputs = rng.normal(size=(windows, z + steps, Q))
    return a, b, histories, inputs, z, steps, N


@settings(deadline=None)
@given(free_runs())
def test_free_runs_are_the_loop_over_the_extended_state(case):
    a, b, histories, inputs, z, steps, N = case
    expected = [
        stepwise(a, b, history[::-1].ravel(), series, z, steps, N)
        for history, series in zip(histories, inputs, strict=True)
    ]
    if inputs.shape[2] == 0:
        inputs = np.zeros((len(histories), steps, 0))
    found = rollout(a, b, histories, inputs, n_states=N)
    np.testing.assert_allclose(found, expected, atol=RESULT)


@pytest.mark.parametrize("windows", [1, 2, 12])
@pytest.mark.parametrize("kind", ["full", "mirrored"])
def test_free_runs_of_the_papers_size_are_the_loop(kind, windows):
    rng = np.random.default_rng(6)
    N, s, z, steps = 4, 49, 5, 400
    size = N * (s + 1)
    a, b = rng.normal(size=(size, size)) / (2 * size), rng.normal(size=(size, 2 * (z + 1)))
    if kind == "mirrored":
        half = rng.normal(size=(size - N, size - N)) / (4 * size)
        a[N:, : size - N] = 0.5 * np.eye(size - N) + half + half.T
    histories = rng.normal(size=(windows, s + 1, N))
    inputs = rng.normal(size=(windows, z + steps, 2))
    expected = [
        stepwise(a, b, history[::-1].ravel(), series, z, steps, N)
        for history, series in zip(histories, inputs, strict=True)
    ]
    np.testing.assert_allclose(rollout(a, b, histories, inputs), expected, atol=RESULT)


def test_a_gap_in_the_inputs_does_not_reach_back_beyond_its_block_of_steps():
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(360, 360)) / 30, rng.normal(size=(360, 2 * 161)) / 10
    histories, inputs = rng.normal(size=(12, 90, 4)), rng.normal(size=(12, 160 + 400, 2))
    whole = rollout(a, b, histories, inputs)
    inputs[3, 160 + 200] = np.nan
    found = rollout(a, b, histories, inputs)
    # Step 201 is the first to read the instant 200 after the start; no block is longer than 64.
    np.testing.assert_allclose(found[3, :128], whole[3, :128], atol=RESULT)
    assert np.isnan(found[3, 200:]).all()


def test_a_long_run_in_pieces_is_the_run_in_one(monkeypatch):
    import sys

    rng = np.random.default_rng(5)
    a, b = rng.normal(size=(6, 6)) / 8, rng.normal(size=(6, 4))
    for rows in (2, 6):
        histories, inputs = rng.normal(size=(2, 3, 2)), rng.normal(size=(2, 1003, 1))
        whole = rollout(a[:rows], b[:rows], histories, inputs)
        monkeypatch.setattr(sys.modules["seakeep.core.rollout"], "PIECE", 5000)
        np.testing.assert_allclose(
            rollout(a[:rows], b[:rows], histories, inputs), whole, atol=1e-13
        )
        monkeypatch.undo()
