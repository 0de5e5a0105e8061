"""What a coarser step takes from waves."""

import numpy as np
import pytest
from seas import sea

from seakeep.signals.waves import WAVES, energy_above

T = np.arange(0, 400, 0.04)
SEAS = [sea(seed, (0.4, 6.0), peak=1.0, components=300).at(T) for seed in range(8)]


@pytest.mark.parametrize("edge", [1.0, 1.5, 2.0])
def test_the_spectrum_s_own_integral(edge):
    """Of Pierson and Moskowitz', 1 - exp(-1.25 (fp/f)^4) lies above f; seas scatter around it."""
    found = np.mean([energy_above(each, 0.04, edge)[0] for each in SEAS])
    within = np.exp(-1.25 / WAVES[1] ** 4) - np.exp(-1.25 / edge**4)
    # Eight seas of 400 waves: their energy is known to some 3 %.
    assert found == pytest.approx(within / np.exp(-1.25 / WAVES[1] ** 4), abs=0.03)
    # Noise above three times the peak does not count, and a constant has no waves.
    noise = 0.3 * np.random.default_rng(0).standard_normal(T.size)
    assert energy_above(SEAS[0] + noise, 0.04, 3.5)[0] == 0.0
    assert np.isnan(energy_above(np.ones(100), 0.1, 1.0)).all()
