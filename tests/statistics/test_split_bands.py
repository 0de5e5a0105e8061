"""ε(t) in bands: the parts add up, and each kind of error is found in its own band."""

from math import tau

import numpy as np
from near import assert_near

from seakeep import statistics

DT, SPLIT = 0.05, 0.2
TIME = np.arange(480) * DT


def test_the_parts_add_up_to_the_series():
    x = np.random.default_rng(0).standard_normal((3, 480, 2))
    low, high = statistics.split_bands(x, DT, SPLIT)
    np.testing.assert_allclose(low + high, x, rtol=0, atol=1e-12)  # rounding


def test_the_gain_is_that_of_the_butterworth_filter_both_ways():
    # Analytic: |H|² of order 4, warped by the bilinear transform, since it runs to and fro.
    long = np.arange(8000) * DT
    for frequency in (0.1, 0.2, 0.3):
        low, _ = statistics.split_bands(np.sin(tau * frequency * long)[:, None], DT, SPLIT)
        ratio = np.tan(np.pi * frequency * DT) / np.tan(np.pi * SPLIT * DT)
        expected = 1 / (1 + ratio**8)
        found = np.sqrt(2) * low[2000:6000, 0].std()
        assert_near(found, expected, 1e-3)  # 4000 samples hold whole periods


def test_waves_are_not_forced_to_nothing_at_the_ends():
    # A point reflection would hold the slow part on the series there, and the fast part at zero.
    phases = np.linspace(0, tau, 64, endpoint=False)
    waves = np.sin(tau * 0.7 * TIME + phases[:, None])[..., None]
    _, high = statistics.split_bands(waves, DT, SPLIT)
    sizes = np.abs(high[..., 0]).mean(axis=0)
    # The mean of |sin| over all phases is 2/π; the mirror image takes a fifth of it at most.
    assert sizes.min() > 0.8 * 2 / np.pi
    assert sizes.max() < 1.2 * 2 / np.pi
