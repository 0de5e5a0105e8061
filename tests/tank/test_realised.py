"""What `benchmarks/tank_figures.py` says of what is played, and what is judged of it."""

import numpy as np
import pytest
from near import assert_near
from tank_figures import comparison, realise

from seakeep.metrics import slack_share
from seakeep.signals.waves import noise_floor
from seakeep.tank.play import play_run, truth

pytest.importorskip("numba")

pytest.importorskip("matplotlib")


@pytest.fixture(scope="module")
def realised(settings, rig):
    return [realise(play_run(settings, name, rig), name) for name in settings.runs]


def test_default_seed_realises_the_papers_waves(settings, realised):
    table = comparison(settings, realised)
    stated = {
        "significant height": (0.16, 0.01),
        "zero-up-crossing period": (1.64, 0.05),
        "peak period (paper's Welch)": (1.98, 0.15),
        "height, wavelength 2.10 m": (0.105, 0.01),
        "height, wavelength 2.80 m": (0.107, 0.01),
        "height, wavelength 4.20 m": (0.116, 0.01),
    }
    assert list(table.index) == list(stated)
    for name, (paper, tolerance) in stated.items():
        assert_near(table.here[name], paper, tolerance)


def test_motions_and_slack_of_the_page(realised):
    for run in realised[:3]:
        mean, spread, slack = (run.motions[each] for each in ("mean", "SD", "slack"))
        # Slow surge is a handful of swings per run.
        assert_near(spread["heave"], 0.032, 0.003)
        assert_near(np.rad2deg(spread["pitch"]), 2.9, 0.2)
        assert_near(spread["surge_fast"], 0.033, 0.003)
        assert_near(mean["surge"], 0.38, 0.05)
        assert_near(mean["mooring_bow"], 1.8, 0.2)
        assert slack["mooring_bow"] == 0.0
    slack = {run.run: run.motions.slack["mooring_stern"] for run in realised}
    assert 0.01 < max(slack[run.run] for run in realised[:3]) < 0.2  # at times
    assert 0.6 < slack["regular_1_5"] < 1.0  # mostly


@pytest.mark.parametrize("name", ["irregular_1", "regular_1_5", "regular_2"])
def test_the_share_of_a_slack_line_is_that_of_the_truth(settings, rig, name):
    load = truth(play_run(settings, name, rig), name, 0.05)["mooring_stern"].values
    noise = settings.instruments.load_noise * np.random.default_rng(0).normal(size=load.size)
    found = slack_share(load + noise, noise_floor(load + noise))
    # Pulses are noise to the noise floor, and loads below it count as slack.
    assert_near(found, np.mean(load <= 0), 0.07)
