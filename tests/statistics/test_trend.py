"""The test of trend: its size without one, its power with one, its interval."""

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import kendalltau, linregress

from seakeep.statistics import moving_block_bootstrap, trend_test


def dependent(phi, samples, seed):
    noise = np.random.default_rng(seed).standard_normal(samples + 300)
    return np.abs(lfilter([1.0], [1.0, -phi], noise)[300:])


def test_slope_and_tau_are_scipys():
    x, t = dependent(0.5, 300, 0), np.arange(300) * 0.05
    found = trend_test(x, rng=np.random.default_rng(0), time=t, n_series=20)
    # Closed forms in another order of summation.
    assert found.slope == pytest.approx(linregress(t, x).slope, rel=1e-10)
    assert found.kendall_tau == pytest.approx(kendalltau(t, x).statistic, rel=1e-12)
    assert found.change == pytest.approx(found.slope * t[-1], rel=1e-12)


def test_p_value_and_interval_are_those_of_the_redrawn_residuals():
    x, t = dependent(0.8, 120, 3), np.arange(120.0)
    found = trend_test(x, rng=np.random.default_rng(4), block_length=7, n_series=40)
    line = linregress(t, x)
    residuals = x - line.intercept - line.slope * t
    drawn = moving_block_bootstrap(residuals, 40, 7, np.random.default_rng(4))
    slopes = np.array([linregress(t, row).slope for row in drawn])
    tau = np.array([kendalltau(t, row).statistic for row in drawn])
    low, high = np.quantile(slopes, [0.025, 0.975])
    # The same sums in another order; the slopes are of order 1e-3.
    assert found.lower == pytest.approx(line.slope - high, abs=1e-12)
    assert found.upper == pytest.approx(line.slope - low, abs=1e-12)
    assert found.p_value == (1 + np.sum(np.abs(tau) >= abs(found.kendall_tau))) / 41


@pytest.mark.parametrize(("phi", "most"), [(0.0, 0.13), (0.8, 0.17)])
def test_without_a_trend_it_seldom_finds_one(phi, most):
    rejected, held = [], []
    for seed in range(60):
        x = dependent(phi, 200, seed)
        found = trend_test(x, rng=np.random.default_rng(seed), n_series=99)
        rejected.append(found.p_value <= 0.05)
        held.append(found.lower <= 0 <= found.upper)
    # 5 % nominal; 60 cases have a standard error of 2.8 %, and blocks lose some dependence.
    assert np.mean(rejected) <= most
    assert np.mean(held) >= 1 - most - 0.05


def test_a_trend_is_found_and_moves_slope_and_interval_by_itself():
    t = np.arange(480) / 32
    x = dependent(0.8, 480, 1)
    flat = trend_test(x, rng=np.random.default_rng(0), time=t, n_series=200)
    steep = trend_test(x + 0.5 * t, rng=np.random.default_rng(0), time=t, n_series=200)
    assert steep.p_value < 0.01
    # The residuals are the same but for rounding, so everything moves by the added slope.
    for bound in ("slope", "lower", "upper"):
        assert getattr(steep, bound) - getattr(flat, bound) == pytest.approx(0.5, abs=1e-9)
    assert 0 < steep.upper - steep.lower < 0.5
