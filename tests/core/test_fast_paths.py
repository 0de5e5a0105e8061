"""Each trick of the fast core equals the plain formula over random shapes."""

import sys
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from matrices import Problem
from near import assert_near

from seakeep.core import rollout
from seakeep.core.embedding import TrainingWindow, gram_trace

# Sums of at most a few hundred products of order one: 1e-12 is a thousand roundings.
TIGHT = 1e-12
# The house rule for results; the condition number here is below 1e4.
RESULT = 1e-10

GENERATORS = st.integers(0, 2**32 - 1).map(np.random.default_rng)
FEW, DELAYS = st.integers(0, 3), st.integers(0, 6)


@st.composite
def problems(draw):
    """Runs, windows and delays: one to three runs, Q, D, s and z down to zero."""
    rng = draw(GENERATORS)
    N, Q, D = draw(st.integers(1, 3)), draw(FEW), draw(FEW)
    s, z = draw(DELAYS), draw(DELAYS)
    runs = []
    for _ in range(draw(st.integers(1, 3))):
        count = draw(st.integers(1, 40))
        before, after = draw(FEW), draw(FEW)
        first = max(s, z) + before
        length = first + count + 1 + after
        x, u, d = (rng.normal(size=(length, width)) for width in (N, Q, D))
        # A gap where no snapshot reaches is none of our business.
        x[: first - s], u[: first - z], d[:first] = np.nan, np.nan, np.nan
        runs.append((x, u, d, TrainingWindow(first, first + count, first)))
    return Problem(*zip(*runs, strict=True), s, z)


@given(problems())
def test_the_trace_is_the_sum_of_squares(problem):
    assert gram_trace(problem.delayed) == pytest.approx(problem.trace, rel=TIGHT)


@given(problems(), st.floats(0.5, 200.0), st.sampled_from(["all rows", "newest", "a filter"]))
def test_every_form_gives_the_papers_formula(problem, ridge, kind):
    """A filter has inputs alone among its regressors."""
    all_rows, delays = kind == "all rows", problem.s
    regressors, targets = problem.matrices(all_rows)
    if kind == "a filter":
        assume(problem.inputs[0].shape[1] + problem.direct[0].shape[1] > 0)
        regressors, delays = regressors[problem.states[0].shape[1] * (problem.s + 1) :], None
    plain = regressors @ regressors.T + ridge * np.eye(len(regressors))
    expected = np.linalg.solve(plain, regressors @ targets.T).T
    for method in ("primal", "dual", "svd", None):
        found = problem.solved(ridge, all_rows=all_rows, method=method, state_delays=delays)
        assert_near(found.coefficients, expected, RESULT)


@given(problems(), st.integers(1, 9))
def test_a_rank_is_that_of_the_truncated_matrix(problem, rank):
    regressors, targets = problem.matrices()
    left, values, right = np.linalg.svd(regressors, full_matrices=False)
    kept = min(rank, int(np.sum(values > values[0] * 1e-12)))
    expected = targets @ right[:kept].T / values[:kept] @ left[:, :kept].T
    found = problem.solved(0.0, rank=rank).coefficients
    assert_near(found, expected, 1e-8 * np.abs(expected).max())


def stepwise(a, b, state, inputs, delays, direct, count):
    """The loop of the paper over the extended state."""
    out = []
    for k, beside in enumerate(direct):
        state = a @ state + b @ np.append(inputs[k : k + delays + 1][::-1], beside)
        out.append(state[:count])
    return out


@st.composite
def free_runs(draw):
    rng = draw(GENERATORS)
    N, Q = draw(st.integers(1, 4)), draw(FEW)
    s, z = draw(DELAYS), draw(DELAYS)
    windows, steps = draw(st.integers(1, 4)), draw(st.integers(1, 90))
    size, D = N * (s + 1), draw(FEW)
    shifts = draw(st.booleans())
    a = rng.normal(size=(size, size)) / (2 * size)
    b = rng.normal(size=(size, Q * (z + 1) + D))
    if shifts:
        a[N:] = np.eye(size - N, size)
        b[N:] = 0.0
        a[:N] *= 0.5
    histories = rng.normal(size=(windows, s + 1, N))
    inputs = rng.normal(size=(windows, z + steps, Q))
    direct = rng.normal(size=(windows, steps, D))
    rows = N if shifts and draw(st.booleans()) else size
    return a, b, rows, histories, inputs, direct, z, steps, N


@given(free_runs(), st.sampled_from([200, 10**6]))
def test_free_runs_are_the_loop_over_the_extended_state(case, piece):
    a, b, rows, histories, inputs, direct, z, steps, N = case
    expected = [
        stepwise(a, b, history[::-1].ravel(), series, z, beside, N)
        for history, series, beside in zip(histories, inputs, direct, strict=True)
    ]
    driving = inputs if inputs.shape[2] else np.zeros((len(histories), steps, 0))
    options = {"direct": direct} if direct.shape[2] else {}
    extended = histories[:, ::-1].reshape(len(histories), -1)
    embedded = [inputs[:, z - lag : z - lag + steps] for lag in range(z + 1)]
    with patch.object(sys.modules["seakeep.core.rollout"], "PIECE", piece):
        found = [
            rollout(a[:rows], b[:rows], start, series, n_states=N, **options)
            for start, series in ((histories, driving), (extended, np.concatenate(embedded, 2)))
        ]
    assert_near(found, [expected] * 2, RESULT)
