"""Unstable modes moved onto a radius, and nothing else."""

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose

from seakeep.core.solve import clip_modes


def companion(roots):
    """Top row of the companion matrix of one channel with these eigenvalues."""
    return -np.poly(roots).real[None, 1:]


PAIR = 1.02 * np.exp(0.4j)


@pytest.mark.parametrize(
    "roots",
    [
        [1.05, 0.9, 0.5],
        [-1.2, 0.9, 0.5],
        [PAIR, np.conj(PAIR), 0.9, -0.3],
        [PAIR, np.conj(PAIR), 1.1, -1.3, 0.95 * np.exp(1j), 0.95 * np.exp(-1j), 0.2],
    ],
)
def test_the_clipped_channel_has_the_polynomial_with_the_clipped_roots(roots):
    """With one channel the top row is the polynomial, so that there is only one answer."""
    roots = np.array(roots)
    found, moduli = clip_modes(companion(roots), 0.99)
    moved = np.where(np.abs(roots) > 0.99, 0.99 * roots / np.abs(roots), roots)
    # Roots as far apart as these are known to ten digits.
    assert_near(found, companion(moved), 1e-9)
    assert_allclose(moduli, sorted(np.abs(roots)[np.abs(roots) > 0.99])[::-1], rtol=1e-9)
