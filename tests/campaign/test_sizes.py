"""Lengths and bands that no record can hold are refused before the work."""

import numpy as np
import pytest

from seakeep import signals
from seakeep.errors import RequestError

X = np.sin(np.arange(0, 60, 0.05))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: signals.integrate(X, 0.05, (1e-9, 1.0)), r"lower edge .*1e-09 Hz.* period of"),
        (lambda: signals.complementary_filter(X, X, 0.05, 1e-9), r"the crossover \(1e-09 Hz\)"),
    ],
)
def test_a_band_outside_the_record_is_refused(call, message):
    with pytest.raises(RequestError, match=message):
        call()
