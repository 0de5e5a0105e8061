"""A campaign that states a probe's position wrongly is told so, by findings and one warning."""

import warnings

import numpy as np
import pytest

import seakeep
from seakeep.quality import findings_of
from seakeep.waves import wavenumber

PLACES = {"eta_fwd": 48.42, "eta_mid": 50.2, "eta_cog": 52.09}
CAMPAIGN = """
[rig]
water_depth = 3.6
[rig.positions]
eta_fwd = {stated}
eta_mid = 50.2
eta_cog = 52.09
[channels.eta_fwd]
column = "fwd"
[channels.eta_mid]
column = "mid"
[channels.eta_cog]
column = "cog"
[runs.one]
file = "one.csv"
waves = "irregular"
[runs.two]
file = "two.csv"
waves = "{waves}"
"""


@pytest.fixture
def campaign(tmp_path):
    time = np.arange(0, 90, 0.05)
    for seed, name in enumerate(("one", "two")):
        rng = np.random.default_rng(seed)
        f, phase = rng.uniform(0.3, 1.0, 60), rng.uniform(0, 2 * np.pi, 60)
        k = wavenumber(2 * np.pi * f, 3.6)
        turn = np.outer(time, 2 * np.pi * f) + phase
        columns = [0.01 * np.cos(turn - k * x).sum(axis=1) for x in PLACES.values()]
        rows = np.column_stack([time, *columns])
        head = "time [s],fwd [m],mid [m],cog [m]"
        np.savetxt(tmp_path / f"{name}.csv", rows, "%.5f", ",", header=head, comments="")

    def make(stated, waves="irregular"):
        path = tmp_path / "campaign.toml"
        path.write_text(CAMPAIGN.format(stated=stated, waves=waves), encoding="utf-8")
        return seakeep.read_campaign(path)

    return make


def test_a_wrong_position_is_warned_of_once_and_is_a_finding_of_every_run(campaign):
    with pytest.warns(seakeep.SeakeepWarning, match="one: eta_fwd is stated to stand") as caught:
        runs = campaign(48.24).prepare()
    assert len(caught) == 1
    text = str(caught[0].message)
    assert "-1.960 m from eta_mid" in text  # as stated
    assert "-1.7" in text  # as the waves have it
    assert "Check [rig.positions]" in text
    for run in runs.values():
        assert [(each.channel, each.kind.word) for each in findings_of(run)] == [
            ("eta_fwd", "position")
        ]


def test_right_positions_and_regular_waves_give_no_finding(campaign):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        runs = campaign(48.42).prepare()
        assert not any(findings_of(run) for run in runs.values())
        assert not findings_of(campaign(48.24, "regular").prepare(["two"])["two"])
