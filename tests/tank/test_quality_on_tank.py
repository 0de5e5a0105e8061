"""What is judged of runs of the virtual tank, against their truth."""

import numpy as np
import pytest

from seakeep.core.metrics import slack_share
from seakeep.signals.waves import noise_floor
from seakeep.tank.play import play_run, truth

pytest.importorskip("numba")


@pytest.mark.parametrize("name", ["irregular_1", "regular_1_5", "regular_2"])
def test_the_share_of_a_slack_line_is_that_of_the_truth(settings, rig, name):
    load = truth(play_run(settings, name, rig), name, 0.05)["mooring_stern"].values
    noise = settings.instruments.load_noise * np.random.default_rng(0).normal(size=load.size)
    found = slack_share(load + noise, noise_floor(load + noise))
    # Pulses are noise to the noise floor, and loads below it count as slack.
    assert found == pytest.approx(np.mean(load <= 0), abs=0.07)
