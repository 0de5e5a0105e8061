"""What would take more memory than there is, is refused before it does."""

import numpy as np
import pytest

from seakeep import signals, statistics
from seakeep.errors import RequestError

X = np.sin(np.arange(0, 60, 0.05))
RNG = np.random.default_rng


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: signals.low_pass(X, 0.05, 1.0, 1.0 + 1e-9), r"passband|stopband.* taps; at most"),
        (lambda: signals.lowpass_taps(500.0, 10.0, 10.0001), "Move stopband away from passband"),
        (lambda: signals.lowpass_taps(20.0, 1.0, 2.0, 1e9), "taps; at most 100000 are allowed"),
        (
            lambda: signals.resample(
                X, np.arange(1200), np.arange(10, 900, 1.5), passband=1 - 1e-9
            ),
            "taps; at most .* or lower passband",
        ),
        (
            lambda: signals.resample(X, np.arange(1200), np.arange(9, 90, 1.5), passband=2),
            "fraction of",
        ),
        (lambda: signals.integrate(X, 0.05, (1e-9, 1.0)), r"lower edge .*1e-09 Hz.* period of"),
        (lambda: signals.complementary_filter(X, X, 0.05, 1e-9), r"the crossover \(1e-09 Hz\)"),
        (lambda: signals.delay_by_celerity(X, 0.05, 1e6, 1e-3), "Correct the distance"),
        (lambda: signals.delay_by_dispersion(X, 0.05, 1e9, 3.6), "Correct the distance"),
        (lambda: signals.wave_spectrum(X, 0.05, padded=10**12), "padded = 1000000000000 points"),
        (
            lambda: statistics.moving_block_bootstrap(X, 10**8, 9, RNG(0)),
            "n_series = 100000000 series of 1200 samples take 960 GB",
        ),
        (lambda: statistics.density_grid(X, points=10**9), "received points = 1000000000"),
    ],
)
def test_sizes_are_judged_first(call, message):
    with pytest.raises(RequestError, match=message):
        call()
