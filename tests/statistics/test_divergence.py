"""The Jensen–Shannon divergence against scipy; pairing and noise floor by their definitions."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose
from records import autoregressive
from scipy.spatial.distance import jensenshannon

from seakeep.core import density
from seakeep.core.bootstrap import bootstrap_indices
from seakeep.statistics import density_grid, jensen_shannon, jsd_interval, kernel_density

MEASURED = autoregressive(default_rng(1).standard_normal(2400), 0.9)


MASSES = arrays(
    float, 12, elements=st.floats(0, 1e6).map(lambda value: 0.0 if value < 1e-9 else value)
)


@settings(max_examples=200)
@given(p=MASSES, q=MASSES)
def test_it_is_bounded_symmetric_and_scipys_square(p, q):
    assume(p.sum() > 0)
    assume(q.sum() > 0)
    found = float(jensen_shannon(p, q))
    assert 0.0 <= found <= np.log(2)
    assert found == jensen_shannon(q, p)
    # scipy takes the root of a sum that cancels to about 1e-16, the rounding of its terms.
    assert_near(found, float(jensenshannon(p, q)) ** 2, 1e-14)


def test_masses_near_the_smallest_number_do_not_vanish():
    assert_allclose(float(jensen_shannon([1e-310, 0.0], [0.0, 1e300])), np.log(2))


@pytest.mark.parametrize("most", [density.MOST_BINS, 10_000])  # with room for all draws, or two
def test_the_bth_prediction_meets_the_bth_measurement_from_the_same_blocks(monkeypatch, most):
    monkeypatch.setattr(density, "MOST_BINS", most)
    predicted = np.stack([0.9 * MEASURED, MEASURED + 0.3])
    found = jsd_interval(predicted, MEASURED, block_length=50, n_series=5, rng=default_rng(7))
    positions = bootstrap_indices(MEASURED.size, 5, 50, default_rng(7))
    grid = density_grid(predicted, MEASURED)
    for model in range(2):
        for draw in range(5):
            where = positions[draw]
            p = kernel_density(predicted[model][where], grid)
            q = kernel_density(MEASURED[where], grid)
            # Bins are as wide as the narrowest of all draws asks, or of one: each errs 3e-5.
            assert_allclose(found.draws[model, draw], float(jensenshannon(p, q)) ** 2, rtol=1e-4)
    expected = found.draws.mean(), *np.quantile(found.draws, [0.025, 0.975])
    assert_allclose((found.mean, found.lower, found.upper), expected, rtol=1e-14)
    assert found.uncertainty == found.upper - found.lower


def test_a_perfect_prediction_is_zero_and_its_floor_is_not():
    found, again = (
        jsd_interval(MEASURED, MEASURED, block_length=50, rng=default_rng(0)) for _ in range(2)
    )
    np.testing.assert_array_equal(found.noise, again.noise)  # the same seed
    assert np.all(found.draws == 0.0)
    assert found.of_series == 0.0
    assert 0.0 < found.noise_floor_lower < found.noise_floor < found.noise_floor_upper < 0.05
