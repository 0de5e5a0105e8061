"""Bandwidths and kernel densities against their definitions."""

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose
from scipy.stats import norm

from seakeep.core.density import bootstrapped_densities
from seakeep.statistics import density_grid, kernel_bandwidth, kernel_density

RNG = np.random.default_rng(0)
NORMAL = RNG.standard_normal(900)
PEAKY = RNG.standard_t(2, size=900)


def rounding_of_bins(h):
    # Linear interpolation of the kernel between bins of h/32: 1/8 · (1/32)² of its peak.
    return 1.3e-4 / (h * np.sqrt(2 * np.pi))


def test_the_papers_bandwidth_lacks_the_divisor():
    quartiles = np.subtract(*np.quantile(PEAKY, [0.75, 0.25]))
    silverman = 0.9 * quartiles / 1.34 * 900**-0.2
    assert_allclose(kernel_bandwidth(PEAKY, "silverman"), silverman, rtol=1e-14)
    assert_allclose(kernel_bandwidth(PEAKY), 1.06 * quartiles * 900**-0.2, rtol=1e-14)
    assert_allclose(kernel_bandwidth(NORMAL), 1.06 * NORMAL.std(ddof=1) * 900**-0.2, rtol=1e-14)


@pytest.mark.parametrize("h", [1e-6, 0.003, 3.0])
@pytest.mark.parametrize("points", [2, 7, 512])
def test_bins_keep_their_promise_on_any_even_grid(h, points):
    # Also where the grid cuts the series off, and where it is coarser than the kernel.
    grid = np.linspace(-1.3, 0.7, points)
    found = kernel_density(NORMAL, grid, h)
    assert_near(found, norm.pdf(grid[:, None], NORMAL, h).mean(axis=1), rounding_of_bins(h))
    assert np.all(found >= 0)


def test_a_constant_series_has_a_density_of_a_stated_bandwidth_also_on_an_uneven_grid():
    grid = np.linspace(4.0, 7.0, 512) + 1e-4 * np.sin(np.arange(512))
    found = kernel_density(np.full(9, 5.0), grid, 0.4)
    assert_allclose(found, norm.pdf(grid, 5.0, 0.4), rtol=1e-12)  # rounding


def test_the_grid_ends_three_bandwidths_beyond_the_samples():
    grid = density_grid(NORMAL, PEAKY[:50])
    assert grid.size == 512
    h = max(kernel_bandwidth(NORMAL), kernel_bandwidth(PEAKY[:50]))
    assert_allclose(grid[0], min(NORMAL.min(), PEAKY[:50].min()) - 3 * h, rtol=1e-14)


def test_a_redraw_that_is_constant_has_the_bandwidth_of_its_series_beside_a_narrow_one():
    slack = np.zeros(400)
    slack[200:220] = np.linspace(1, 2, 20)
    positions = np.array([np.arange(400), np.full(400, 5), np.r_[np.full(399, 5), 205]])
    grid = density_grid(slack)
    own = kernel_bandwidth(slack)
    found = bootstrapped_densities(slack, positions, grid, "paper")
    for density, where in zip(found, positions, strict=True):
        h = kernel_bandwidth(slack[where]) if np.ptp(slack[where]) else own
        exact = norm.pdf(grid[:, None], slack[where], h).mean(axis=1)
        assert_near(density, exact, rounding_of_bins(h))
