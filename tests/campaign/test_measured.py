"""The measured data sets, where they are."""

import contextlib
import os
from pathlib import Path

import numpy as np
import pytest
from said import warned
from small_tank import campaign_of

from seakeep.campaign import draft_campaign

pytestmark = pytest.mark.data
FLUME, BASIN = "ntnu_ship_section", "sjtu_semisub"


@pytest.mark.parametrize("name", [FLUME, BASIN])
def test_draft(tmp_path, name):
    files = sorted((Path(os.environ["SEAKEEP_DATA_DIR"]) / name).glob("*.csv"))
    if not files:
        pytest.skip(f"{name} is not in SEAKEEP_DATA_DIR")
    campaign = campaign_of(tmp_path, draft_campaign(files, tmp_path))
    # The position of the flume's wavemaker is the one column whose header says no unit.
    bare = [n for n, each in campaign.settings.channels.items() if each.unit_assumed]
    assert bare == (["wm_position"] if name == FLUME else [])
    if name == FLUME:  # files are called PERIOD and HEIGHT_REPETITION
        assert campaign.test_runs == ["3041_2"]  # T 1.21 s, between 1.158 and 1.238 s
        assert campaign.settings.runs["3041_2"].span[0] > 25  # until then the water is still
    told = warned("wm_position is taken as")
    with told if bare else contextlib.nullcontext():
        used = [n for n, each in campaign.settings.runs.items() if each.role != "unused"]
        runs = campaign.prepare(used[:3])
    assert len({run.attrs["dt"] for run in runs.values()}) == 1
    assert "heave" in campaign.model().states
    assert "eta_1" in campaign.model().inputs
    for run in runs.values():
        assert all(np.isfinite(each).all() for each in run.values())
