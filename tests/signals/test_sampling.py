"""What a coarser step takes from waves."""

import numpy as np
import pytest

from seakeep.signals.waves import WAVES, energy_above


def sea(seed, noise=0.0):
    """Pierson-Moskowitz sea with its peak at 1 Hz, 400 s at 50 Hz, and white noise."""
    random = np.random.default_rng(seed)
    t = np.arange(0, 400, 0.02)
    f = np.arange(0.4, 6.0, 1 / 400)
    heights = np.sqrt(f**-5 * np.exp(-1.25 * f**-4.0))
    spectrum = np.zeros(t.size // 2 + 1, complex)
    spectrum[np.rint(f * 400).astype(int)] = heights * np.exp(2j * np.pi * random.random(f.size))
    waves = np.fft.irfft(spectrum, t.size)
    return waves / waves.std() + noise * random.normal(size=t.size)


@pytest.mark.parametrize("edge", [1.0, 1.5, 2.0])
def test_the_spectrum_s_own_integral(edge):
    """Of Pierson and Moskowitz', 1 - exp(-1.25 (fp/f)^4) lies above f; seas scatter around it."""
    found = np.mean([energy_above(sea(seed), 0.02, edge)[0] for seed in range(8)])
    within = np.exp(-1.25 / WAVES[1] ** 4) - np.exp(-1.25 / edge**4)
    # Eight seas of 400 waves: their energy is known to some 3 %.
    assert found == pytest.approx(within / np.exp(-1.25 / WAVES[1] ** 4), abs=0.03)
    # Noise above three times the peak does not count, and a constant has no waves.
    assert energy_above(sea(0, noise=0.3), 0.02, 3.0)[0] == 0.0
    assert np.isnan(energy_above(np.ones(100), 0.1, 1.0)).all()
