"""Single precision: how far it is from double, over the paper's horizon too, and where it ends."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seakeep.core import identify, rollout
from seakeep.core.embedding import TrainingWindow, training_window
from seakeep.errors import RequestError

# What the package states: a ten-thousandth of a standard deviation over 480 steps.
STATED = 1e-4


def sea(samples=1600, states=11, inputs=2, seed=0):
    """Standardised motions of damped oscillators in a narrow-banded sea, with 5 % noise."""
    rng = np.random.default_rng(seed)
    time = np.arange(samples)
    frequencies = rng.uniform(0.09, 0.35, 60)
    phases = rng.uniform(0, 2 * np.pi, (inputs, 60))
    weights = np.exp(-0.5 * ((frequencies - 0.19) / 0.04) ** 2)
    u = np.stack([np.cos(np.outer(time, frequencies) + p) @ weights for p in phases], axis=1)
    modes = np.exp(rng.uniform(-0.06, -0.01, 8) + 1j * rng.uniform(0.03, 0.3, 8))
    force, state = rng.normal(size=(inputs, 8)), np.zeros(8, complex)
    x = np.empty((samples, 8), complex)
    for k in range(samples):
        x[k], state = state, modes * state + u[k] @ force
    x = x.real @ rng.normal(size=(8, states))
    x, u = x / x.std(axis=0), u / u.std(axis=0)
    return x + 0.05 * rng.normal(size=x.shape), u


def fitted(x, u, precision, ridge=100.0, all_rows=True, window=640, **others):
    place = training_window(1000, window, 32, 160, "before")
    arguments = {"state_delays": 32, "input_delays": 160, "ridge": ridge, "all_rows": all_rows}
    return identify([x], [u], [place], precision=precision, **arguments, **others)


@pytest.mark.parametrize("windows", [1, 10])
@pytest.mark.parametrize("all_rows", [True, False])
def test_the_papers_horizon_in_single_precision(all_rows, windows):
    x, u = sea()
    starts = [1000 + 10 * k for k in range(windows)]
    histories = np.stack([x[k - 32 : k + 1] for k in starts])
    inputs = np.stack([u[k - 160 : k + 480] for k in starts])
    forecasts = {}
    for precision in ("double", "single"):
        found = fitted(x, u, precision, all_rows=all_rows).coefficients
        assert found.dtype == (np.float32 if precision == "single" else np.float64)
        forecasts[precision] = rollout(found[:, :363], found[:, 363:], histories, inputs)
    assert forecasts["single"].dtype == np.float64
    error = np.abs(forecasts["single"] - forecasts["double"]).max()
    # Not zero: single precision was really used.
    assert 1e-9 < error < STATED


@settings(deadline=None, max_examples=50)
@given(
    seed=st.integers(0, 2**32 - 1),
    s=st.integers(0, 6),
    z=st.integers(0, 6),
    columns=st.integers(1, 60),
    all_rows=st.booleans(),
    method=st.sampled_from(["primal", "dual", None]),
)
def test_coefficients_are_those_of_double_precision(seed, s, z, columns, all_rows, method):
    rng = np.random.default_rng(seed)
    first = max(s, z)
    x, u = rng.normal(size=(first + columns + 1, 2)), rng.normal(size=(first + columns + 1, 1))
    window = TrainingWindow(first, first + columns, first)
    single, double = (
        identify(
            [x],
            [u],
            [window],
            state_delays=s,
            input_delays=z,
            ridge=100.0,
            all_rows=all_rows,
            method=method,
            precision=precision,
        ).coefficients
        for precision in ("single", "double")
    )
    # Condition number below 20 here, rounding 6e-8, coefficients of order one.
    np.testing.assert_allclose(single, double, rtol=0, atol=5e-6)


def test_a_ridge_below_a_hundred_is_refused():
    x, u = sea(1100, 2, 1)
    with pytest.raises(RequestError, match=r"effective ridge of at least 100; received 99\."):
        fitted(x, u, "single", ridge=99.0)
    with pytest.raises(RequestError, match=r"Use precision='double', or raise ridge"):
        fitted(x, u, "single", ridge=0.1, per_snapshot=True)  # 639 columns
    assert fitted(x, u, "single", ridge=0.2, per_snapshot=True).ridge == pytest.approx(127.8)


def test_a_rank_is_refused():
    x, u = sea(1100, 2, 1)
    with pytest.raises(RequestError, match=r"does not go with rank = 5: .* precision='double'"):
        fitted(x, u, "single", ridge=0.0, rank=5)


def test_a_ridge_that_is_small_beside_the_data_is_refused():
    # Not standardised, a hundred times as large: the same λ is 10 000 times less.
    x, u = (100.0 * series for series in sea(1100, 2, 1))
    with pytest.raises(RequestError, match=r"0\.0001 of the largest squared singular value"):
        fitted(x, u, "single", all_rows=False)
    assert fitted(x, u, "double", all_rows=False).method in ("primal", "dual", "svd")
