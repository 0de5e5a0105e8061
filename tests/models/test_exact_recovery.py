"""A system that is in the model class is found exactly; the first step of the truth ladder."""

import pytest
from near import assert_near
from oscillators import Oscillator

from seakeep import HankelDMDc

VESSEL = Oscillator()
# The channels are not standardised here: a constant offset (the mean of a finite window is not a
# fixed point of the system) is not in the model class, the raw recursion is.
EXACT = 1e-9  # what the method promises; rounding times the condition number (1e2) is 1e-13


@pytest.mark.parametrize("delay_rows", ["ridge", "exact"])
def test_a_position_only_oscillator_gives_its_arx_coefficients(delay_rows):
    spec = HankelDMDc(1, 1, 0.0, standardize=False, delay_rows=delay_rows)
    model = spec.fit(VESSEL.run(), ["heave"], ["eta_fwd"])
    assert_near(model.A, [VESSEL.arx[:2], [1, 0]], EXACT)
    assert_near(model.B, [VESSEL.arx[2:], [0, 0]], EXACT)
