"""A system that is in the model class is found exactly; the first step of the truth ladder."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from oscillators import Oscillator

from seakeep import HankelDMDc

VESSEL = Oscillator()
FORCED = {"states": ["heave"], "inputs": ["eta_fwd"]}
# The channels are not standardised here: a constant offset (the mean of a finite window is not a
# fixed point of the system) is not in the model class, the raw recursion is.
EXACT = 1e-9  # what the method promises; rounding times the condition number (1e2) is 1e-13


def top_row(model):
    return np.concatenate([model.A[0], model.B[0]])


@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
def test_a_position_only_oscillator_gives_its_arx_coefficients(delay_rows):
    spec = HankelDMDc(1, 1, 0.0, standardize=False, delay_rows=delay_rows)
    model = spec.fit(VESSEL.run(), **FORCED)
    assert_allclose(model.A, [VESSEL.arx[:2], [1, 0]], rtol=0, atol=EXACT)
    assert_allclose(model.B, [VESSEL.arx[2:], [0, 0]], rtol=0, atol=EXACT)


def test_no_snapshot_pair_crosses_a_joint():
    # Two columns a run and four unknowns: one run leaves the system open, three close it.
    runs = [VESSEL.run(samples=4, seed=seed) for seed in (4, 5, 6)]
    spec = HankelDMDc(1, 1, 0.0, standardize=False)
    assert np.max(np.abs(top_row(spec.fit(runs[0], **FORCED)) - VESSEL.arx)) > 1e-3
    pooled = spec.fit({"a": runs[0], "b": runs[1], "c": runs[2]}, **FORCED)
    # Six columns of random data: the condition number may reach 1e4, so 1e-12 and a margin.
    assert_allclose(top_row(pooled), VESSEL.arx, rtol=0, atol=EXACT)
    assert pooled.training.runs == ("a", "b", "c")
