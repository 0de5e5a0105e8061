"""The tank's raw files through the whole measurement chain, held against the truth."""

import chain_on_tank
import pytest
from chain_on_tank import CLOCKS, MOTIONS
from said import warned

from seakeep.study import fit_campaign

pytest.importorskip("numba")

RUNS = ("irregular_1", "irregular_2", "irregular_3")
of_each_run = pytest.mark.parametrize("name", RUNS)


def test_a_campaign_without_its_truth_is_prepared_and_fitted(delivered, prepared):
    assert not list(delivered.campaign.path.parent.glob("**/truth*"))
    assert tuple(prepared) == RUNS
    # 20 encounter periods of each run train, and the vessel surges on its moorings in 30 s.
    with warned(r"hold [23]\.\d periods of the slow motion of surge"):
        model = fit_campaign(delivered.campaign)
    assert set(model.training.runs) == set(RUNS)
    assert set(MOTIONS) <= set(model.states)


def test_the_chain_adds_nothing_to_the_noise_of_the_sensors(delivered, prepared, tmp_path):
    run, truth = prepared["irregular_1"], delivered.truth["irregular_1"]
    period = run.attrs["encounter_period"]
    noise = chain_on_tank.noise_alone(delivered, "irregular_1", tmp_path, period)
    floor = chain_on_tank.floor(noise, run, truth)
    found = chain_on_tank.errors(run, truth)
    for motion in MOTIONS:
        # Asked for: 1.2. The same noise on the same clocks: filters that passed the motion whole
        # leave a ratio of one; a delay of 2 ms alone would add 0.007 to each motion.
        assert found[motion] <= 1.05 * floor[motion], motion
        assert found[motion] >= 0.95 * floor[motion], motion


def test_periods_against_the_truth(delivered, prepared):
    found, true = chain_on_tank.periods(delivered, prepared)
    assert found == pytest.approx(true, rel=0.01)  # asked for; found within 0.0001
    for run in prepared.values():
        assert run.attrs["dt"] == found / 32


@of_each_run
def test_celerities_against_the_sea_that_was_played(delivered, prepared, name):
    for found, true in chain_on_tank.celerities(delivered, name, prepared[name]).values():
        assert found == pytest.approx(true, rel=0.03)  # asked for; found within 0.006


@of_each_run
def test_clocks_against_the_truth(delivered, prepared, name):
    run = prepared[name]
    for clock, (offset, drift) in chain_on_tank.clocks(run, delivered.truth[name]).items():
        # Asked for: 2 ms for loggers of 500 Hz, a tenth of a sample for the others, 10 ppm.
        assert abs(offset) < (2e-3 if CLOCKS[clock] >= 500 else 0.1 / CLOCKS[clock])
        assert abs(drift) < 10
        assert abs(drift) < 4 * run.attrs[f"clock_{clock}_drift_error_ppm"]
        assert abs(offset) < 4 * run.attrs[f"clock_{clock}_offset_error"]
    assert "trigger pulses, drift of 3 runs" in run.attrs["clock_mru"]
    assert run.attrs["clock_video_drift_ppm"] != 0  # −40 ppm, known to 3
    # The load cells' clock is the reference's: what was found is not certain, and not applied.
    assert run.attrs["clock_loads_drift_ppm"] == 0
    assert "offset only: a drift of" in run.attrs["clock_loads"]
