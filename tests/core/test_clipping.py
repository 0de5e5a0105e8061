"""Unstable modes moved onto a radius, and nothing else."""

import numpy as np
from near import assert_near
from numpy.testing import assert_allclose

from seakeep.core.solve import clip_modes


def companion(roots):
    """Top row of the companion matrix of one channel with these eigenvalues."""
    return -np.poly(roots).real[None, 1:]


def test_the_clipped_channel_has_the_polynomial_with_the_clipped_roots():
    """With one channel the top row is the polynomial, so that there is only one answer."""
    pairs = 1.02 * np.exp([0.4j, -0.4j]), 0.95 * np.exp([1j, -1j])
    roots = np.concatenate([*pairs, [1.1, -1.3, 0.2]])
    found, moduli = clip_modes(companion(roots), 0.99)
    moved = np.where(np.abs(roots) > 0.99, 0.99 * roots / np.abs(roots), roots)
    # Roots as far apart as these are known to ten digits.
    assert_near(found, companion(moved), 1e-9)
    assert_allclose(moduli, sorted(np.abs(roots)[np.abs(roots) > 0.99])[::-1], rtol=1e-9)
