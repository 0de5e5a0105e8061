"""The alignment on the virtual tank's raw files: what it brings."""

import chain_on_tank
import numpy as np
import pytest
from alignment_on_tank import ALIGNMENTS, STATES, paired, window_errors

pytest.importorskip("numba")


@pytest.mark.filterwarnings("ignore::seakeep.SeakeepWarning")
def test_alignment_with_measured_surge_lowers_the_error_of_unseen_windows(prepared):
    """Errors of all windows of 15 periods of each run, by the paper's models of the two others."""
    runs = {name: chain_on_tank.used(run) for name, run in prepared.items()}
    period = runs["irregular_1"].attrs["encounter_period"]
    aligned, none = (
        window_errors(runs, period, "paper", ALIGNMENTS[name])
        for name in ("measured, effective", "none")
    )
    assert len(none) >= 21
    # The interval is asked for; its figures stand in benchmarks/results/alignment_on_tank.md.
    _, _, high = paired(aligned.mean(axis=1), none.mean(axis=1), np.random.default_rng(0))
    assert high < 0
    medians = dict(zip(STATES, np.median(aligned, axis=0), strict=True))
    assert medians["heave"] <= 0.4  # asked for; found 0.12
    assert medians["pitch"] <= 0.4  # found 0.21
