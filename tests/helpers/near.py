"""Numbers that are equal but for a stated error."""

from numpy.testing import assert_allclose


def assert_near(found, expected, error):
    """Compare to an absolute error: that of numpy would be added to one of 1e-7 of each number."""
    assert_allclose(found, expected, rtol=0, atol=error)
