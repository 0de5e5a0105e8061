"""Faults put into runs of the virtual tank: each is found, and a sound run is left alone."""

import numpy as np
import pytest

import quality
from quality import FAULTS
from seakeep.core.metrics import slack_share
from seakeep.signals.waves import noise_floor
from seakeep.tank.play import play_run, truth

pytest.importorskip("numba")


@pytest.fixture(scope="module", params=["irregular_1", "regular_3"])
def heaves(request, settings, rig):
    return quality.heaves(settings, rig, request.param)


def test_a_sound_run_gives_no_alarm(heaves):
    measured, trusted, dt = heaves
    assert quality.kinds(measured, trusted, dt) == set()


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_found_and_what_is_below_a_limit_is_not(heaves, fault):
    measured, trusted, dt = heaves
    put, kind, size, _ = FAULTS[fault]
    found = kind in quality.kinds(put(measured, dt, np.random.default_rng(1), size), trusted, dt)
    assert found is not ("below" in fault or "finer" in fault)


@pytest.mark.parametrize("name", ["irregular_1", "regular_1_5", "regular_2"])
def test_the_share_of_a_slack_line_is_that_of_the_truth(settings, rig, name):
    load = truth(play_run(settings, name, rig), name, 0.05)["mooring_stern"].values
    noise = settings.instruments.load_noise * np.random.default_rng(0).normal(size=load.size)
    found = slack_share(load + noise, noise_floor(load + noise))
    # Pulses are noise to the noise floor, and loads below it count as slack.
    assert found == pytest.approx(np.mean(load <= 0), abs=0.07)
