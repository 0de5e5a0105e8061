"""Many windows from one response to an impulse: the parts, the whole, and where it is not used."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from seakeep.core import rollout
from seakeep.core.scratch import Scratch
from seakeep.core.superposition import (
    convolve,
    grows,
    impulse_states,
    state_at_rest,
    superposition_cost,
)

# The house rule for results; responses here are sums of a few hundred products of order one.
RESULT = 1e-10
ROLLOUT = sys.modules["seakeep.core.rollout"]


def loop(a, b, state, inputs, delays, steps):
    """States of the recursion after the start; inputs oldest first."""
    out = []
    for k in range(steps):
        state = a @ state + b @ inputs[k : k + delays + 1][::-1].ravel()
        out.append(state)
    return np.array(out)


@st.composite
def models(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    N, Q = draw(st.integers(1, 4)), draw(st.integers(1, 3))
    s, z = draw(st.integers(0, 5)), draw(st.integers(0, 6))
    size = N * (s + 1)
    a = rng.normal(size=(size, size)) / (2 * size)
    return a, rng.normal(size=(size, Q * (z + 1))), N, Q, z, rng


@settings(deadline=None)
@given(models())
def test_impulse_states_are_the_loop_after_one_unit_input(model):
    a, b, _, Q, z, _ = model
    found = impulse_states(a, b, Q, Scratch())
    for channel in range(Q):
        inputs = np.zeros((2 * z + 1, Q))
        inputs[z, channel] = 1.0
        expected = loop(a, b, np.zeros(len(a)), inputs, z, z + 1)
        np.testing.assert_allclose(found[:, channel], expected, atol=1e-13)  # rounding


@settings(deadline=None)
@given(models(), st.integers(1, 4))
def test_the_state_at_rest_is_what_earlier_inputs_lead_to(model, windows):
    a, b, _, Q, z, rng = model
    inputs = rng.normal(size=(windows, z + 3, Q))
    found = state_at_rest(impulse_states(a, b, Q, Scratch()), inputs)
    for window in range(windows):
        # Nothing before the oldest input that the first step reads; none from the start on.
        series = np.concatenate([np.zeros((z, Q)), inputs[window, :z]])
        expected = [np.zeros(len(a)), *loop(a, b, np.zeros(len(a)), series, z, z)][-1]
        np.testing.assert_allclose(found[window], expected, atol=1e-12)  # a dozen sums


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 40), st.integers(1, 60), st.integers(1, 3))
def test_the_convolution_is_the_sum(seed, delays, steps, channels):
    rng = np.random.default_rng(seed)
    kernel = rng.normal(size=(channels, 2, delays + steps))
    inputs = rng.normal(size=(3, delays + steps, channels))
    expected = np.zeros((3, 2, steps))
    for k in range(steps):
        for i in range(delays + k + 1):
            expected[:, :, k] += inputs[:, i] @ kernel[:, :, delays + k - i]
    np.testing.assert_allclose(convolve(kernel, inputs, steps), expected, atol=1e-11)


@settings(deadline=None)
@given(models(), st.integers(1, 4), st.integers(1, 90))
def test_superposed_free_runs_are_the_loop(model, windows, steps):
    a, b, N, Q, z, rng = model
    histories = rng.normal(size=(windows, len(a)))
    inputs = rng.normal(size=(windows, z + steps, Q))
    expected = [loop(a, b, x, u, z, steps)[:, :N] for x, u in zip(histories, inputs, strict=True)]
    used = []

    def superpose(*arguments):
        used.append(original(*arguments))
        return used[-1]

    original = ROLLOUT._superpose
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ROLLOUT, "superposition_cost", lambda *_: 0.0)
        patch.setattr(ROLLOUT, "_superpose", superpose)
        found = rollout(a, b, histories, inputs, n_states=N)
    assert len(used) == 1
    np.testing.assert_allclose(found, expected, atol=RESULT)


def paper_like(radius, windows=12, seed=0):
    """A full Â of 360 rows with the given spectral radius, 160 delays of two inputs."""
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(360, 360)) / np.sqrt(360)
    a *= radius / np.abs(np.linalg.eigvals(a)).max()
    b = rng.normal(size=(360, 2 * 161)) / 10
    return a, b, rng.normal(size=(windows, 360)), rng.normal(size=(windows, 160 + 400, 2))


@pytest.mark.parametrize("radius", [0.9, 1.05])
def test_windows_of_a_model_that_grows_keep_their_digits(radius, monkeypatch):
    a, b, histories, inputs = paper_like(radius)
    kernels = []
    monkeypatch.setattr(
        ROLLOUT,
        "grows",
        lambda kernel, delays: kernels.append(grows(kernel, delays)) or kernels[-1],
    )
    found = rollout(a, b, histories, inputs, n_states=4)
    assert kernels == [radius > 1]
    for window in range(3):
        expected = loop(a, b, histories[window], inputs[window], 160, 400)[:, :4]
        reached = np.maximum.accumulate(np.abs(expected).max(axis=1))[:, None]
        # Relative to what the run has reached so far: what it reaches later must not show.
        assert np.max(np.abs(found[window] - expected) / np.maximum(reached, 1.0)) < RESULT


def test_a_gap_in_the_inputs_does_not_reach_back_beyond_its_block_of_steps():
    a, b, histories, inputs = paper_like(0.9)
    whole = rollout(a, b, histories, inputs, n_states=4)
    inputs[3, 160 + 200] = np.nan
    found = rollout(a, b, histories, inputs, n_states=4)
    # Step 201 is the first to read the instant 200 after the start; no block is longer than 64.
    np.testing.assert_allclose(found[3, :128], whole[3, :128], atol=RESULT)
    assert np.isnan(found[3, 200:]).all()


def test_few_windows_and_long_runs_are_not_superposed():
    a, b, _, inputs = paper_like(0.9)
    assert ROLLOUT._superposes(a, b, 4, inputs, 400)
    assert not ROLLOUT._superposes(a, b, 4, inputs[:1], 400)
    many = np.broadcast_to(inputs[:1], (10**6, *inputs.shape[1:]))
    assert not ROLLOUT._superposes(a, b, 4, many, 400)
    costs = [superposition_cost(363, 11, 2, 160, windows, 480) for windows in (1, 10, 100)]
    assert costs == sorted(costs)
