"""Runs of a vessel that drifts, which many models of these tests learn from."""

import pytest
from drifting import drifting_run


@pytest.fixture(scope="session")
def drifts():
    """Runs of training; tests change copies of them."""
    return [drifting_run(seed) for seed in (1, 2)]


@pytest.fixture(scope="session")
def drift():
    return drifting_run(7)
