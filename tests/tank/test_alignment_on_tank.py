"""The alignment on the virtual tank's raw files: what it brings, and what it reads."""

import chain_on_tank
import numpy as np
import pytest
from alignment_on_tank import ALIGNMENTS, STATES, paired, window_errors

pytest.importorskip("numba", reason="needs the extra tank")


@pytest.fixture(scope="module")
def runs(prepared):
    return {name: chain_on_tank.used(run) for name, run in prepared.items()}


@pytest.fixture(scope="module")
def period(runs):
    return next(iter(runs.values())).attrs["encounter_period"]


@pytest.fixture(scope="module")
def windows(runs, period):
    """Errors of all windows of 15 periods of each run, by models of the two others."""
    names = ("measured, effective", "none")
    return {name: window_errors(runs, period, "paper", ALIGNMENTS[name]) for name in names}


@pytest.mark.filterwarnings("ignore::seakeep.SeakeepWarning")
def test_alignment_with_measured_surge_lowers_the_error_of_unseen_windows(windows):
    aligned, none = (each.mean(axis=1) for each in windows.values())
    assert none.size >= 21
    middle, _, high = paired(aligned, none, np.random.default_rng(0))
    # The interval is asked for; its figures stand in benchmarks/results/alignment_on_tank.md.
    assert middle < 0
    assert high < 0


@pytest.mark.filterwarnings("ignore::seakeep.SeakeepWarning")
def test_the_paper_s_model_forecasts_heave_and_pitch_of_unseen_windows(windows):
    medians = np.median(windows["measured, effective"], axis=0)
    found = dict(zip(STATES, medians, strict=True))
    assert found["heave"] <= 0.4  # asked for; found 0.12
    assert found["pitch"] <= 0.4  # found 0.21
