"""Block lengths and the moving-block bootstrap against closed forms and the arch package."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.testing import assert_allclose
from records import autoregressive
from said import warned

from seakeep import DataError, RequestError
from seakeep.statistics import block_length, lag_one_correlation, moving_block_bootstrap


def series(phi, samples, seed):
    return autoregressive(default_rng(seed).standard_normal(samples + 500), phi)[500:]


# --- block lengths -------------------------------------------------------------------------------


@pytest.mark.parametrize("phi", [0.5, 0.8, 0.9, -0.8])
def test_carlstein_finds_the_closed_form_of_an_autoregression(phi):
    samples = 40_000
    expected = (2 * abs(phi) / (1 - phi**2)) ** (2 / 3) * samples ** (1 / 3)
    # The standard error of φ is √((1 − φ²)/T) = 0.002 to 0.004; the optimum's logarithm moves by
    # up to 7 times that at φ = 0.9: 6 % is more than three standard errors.
    assert_allclose(block_length(series(phi, samples, 1)), expected, rtol=0.06)


def test_the_lag_one_correlation_is_the_printed_sum_with_its_square():
    x = np.concatenate([series(0.9, 200, 3), 50 + series(0.9, 200, 4)])
    centred = x - x.mean()
    pairs = [i for i in range(399) if i != 199]
    by_hand = 400 * sum(centred[i + 1] * centred[i] for i in pairs) / (398 * sum(centred**2))
    # Two orders of summation.
    assert_allclose(lag_one_correlation(x, [200, 200]), by_hand, rtol=1e-12)


@pytest.mark.oracle
@pytest.mark.parametrize("phi", [0.3, 0.6, 0.9])
def test_politis_white_agrees_with_arch(phi):
    arch = pytest.importorskip("arch.bootstrap")
    ratios = []
    for seed in range(20):
        x = series(phi, 2000, seed)
        theirs = float(arch.optimal_block_length(x)["circular"].iloc[0])
        ratios.append(block_length(x, "politis_white") / round(theirs))
    # The same sums: equal, unless a correlation lies so near its threshold that the two
    # normalisations (by the whole series, and by its two ends) judge it differently.
    assert np.median(np.abs(np.array(ratios) - 1)) == 0
    assert max(abs(np.array(ratios) - 1)) < 0.05 + 1 / min(ratios)


def test_a_slow_series_is_capped_at_a_quarter_with_a_warning():
    slow = np.cos(np.linspace(0, np.pi, 400))
    with warned(r"rule 'carlstein' asks for blocks of .* cut to 100"):
        assert block_length(slow) == 100
    with warned("cut to 60"):  # the shortest segment
        assert block_length(slow, segments=[140, 60, 200]) == 60


# --- the moving-block bootstrap ------------------------------------------------------------------


@settings(max_examples=60)
@given(
    samples=st.integers(2, 60),
    data=st.data(),
    n_series=st.integers(1, 4),
    seed=st.integers(0, 2**31),
)
def test_length_and_values_are_kept_and_blocks_run_on(samples, data, n_series, seed):
    length = data.draw(st.integers(1, samples))
    x = np.arange(samples, dtype=float)
    drawn = moving_block_bootstrap(x, n_series, length, default_rng(seed))
    assert drawn.shape == (n_series, samples)
    assert np.isin(drawn, x).all()
    assert np.array_equal(drawn, moving_block_bootstrap(x, n_series, length, default_rng(seed)))
    inner = np.arange(1, samples) % length != 0
    assert np.all(np.diff(drawn, axis=1)[:, inner] == 1)


def test_no_block_crosses_a_join_of_segments():
    which = np.repeat([0.0, 1.0, 2.0], [20, 30, 12])
    drawn = moving_block_bootstrap(which, 200, 12, default_rng(0), segments=[20, 30, 12])
    blocks = drawn[:, :60].reshape(200, 5, 12)
    assert np.all(blocks == blocks[..., :1])
    assert set(np.unique(blocks)) == {0.0, 1.0, 2.0}


# --- what is refused -----------------------------------------------------------------------------

NOISE = default_rng(0).standard_normal(100)


def redrawn(length, segments=None):
    return moving_block_bootstrap(NOISE, 3, length, default_rng(0), segments=segments)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: block_length(NOISE[:5]), DataError, r"5 sample\(s\); at least 8 are needed"),
        (lambda: block_length(np.full(40, 3.0)), DataError, r"the series is constant \(3\)"),
        (lambda: block_length(NOISE, "carlsten"), RequestError, "unknown rule 'carlsten'.* Did"),
        (lambda: redrawn(101), RequestError, "of 101 samples does not fit into the series of 100"),
        (lambda: block_length(NOISE, segments=[50, 60]), RequestError, "add up to 110 samples and"),
        (lambda: redrawn(40, [70, 30]), RequestError, "not fit into the shortest segment of 30"),
        (lambda: redrawn(2.5), RequestError, "block_length must be an integer of at least 1"),
    ],
)
def test_what_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()
