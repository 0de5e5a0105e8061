"""Slow motions of which training holds too few periods: told, and only where they govern."""

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_allclose
from records import record
from said import warned

from seakeep.models.validity import slow_motions, warn_of_slow_motions

DT, PERIOD = 0.1, 1.64


def run_of(seed, seconds, slow=1.0, regular=False):
    """Surge of waves and a slow drift of a random envelope; heave of waves alone."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, DT)

    def sum_of(low, high):
        f, phase = rng.uniform(low, high, 40), rng.uniform(0, 2 * np.pi, 40)
        return np.cos(2 * np.pi * np.outer(t, f) + phase).sum(axis=1) / np.sqrt(20)

    f0 = 1 / 30
    drift = sum_of(0.8 * f0, 1.2 * f0) if not regular else np.cos(2 * np.pi * f0 * t)
    return record(DT, surge=slow * drift + 0.3 * sum_of(0.4, 0.9), heave=sum_of(0.4, 0.9))


@pytest.mark.parametrize("seed", range(8))
def test_the_period_of_a_slow_drift_is_found(seed):
    runs = {"a": run_of(seed, 600), "b": run_of(seed + 9, 600)}
    (found,) = slow_motions(runs, ["heave", "surge"], 33.0, PERIOD)
    assert found.channel == "surge"
    # The drift's own frequencies lie within ±20 %, and so does their mean in any realisation.
    assert_allclose(found.period, 30.0, rtol=0.2)
    assert_allclose(found.cycles, 33.0 / found.period)
    assert found.share > 0.8


def test_a_regular_drift_is_counted_exactly():
    (found,) = slow_motions({"a": run_of(0, 600, regular=True)}, ["surge"], 600.0, PERIOD)
    assert_near(found.cycles, 20.0, 0.6)  # half a cycle at either end


@pytest.mark.parametrize("seed", range(8))
def test_few_periods_warn_and_enough_do_not(seed):
    runs = {"a": run_of(seed, 210), "b": run_of(seed + 100, 210)}
    # The paper's window of 20 T in one run: about one slow period.
    with warned(r"32\.8 s in all, hold (0|1)\.\d periods .* surge"):
        warn_of_slow_motions({"a": runs["a"]}, ["surge", "heave"], 32.8, PERIOD)
    warn_of_slow_motions(runs, ["surge", "heave"], 420.0, PERIOD)


def test_waves_alone_and_a_drift_that_does_not_govern_are_left_alone():
    assert slow_motions({"a": run_of(1, 210, slow=0.1)}, ["surge", "heave"], 33.0, PERIOD) == []
