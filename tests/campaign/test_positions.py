"""A campaign that states a probe's position wrongly is told so, by findings and one warning."""

import numpy as np
import pytest
import xarray as xr
from said import findings, warned
from seas import sea
from small_tank import campaign_of, write_csv
from tutorial_study import edit

import seakeep
from seakeep.quality import findings_of

PLACES = {"fwd": 48.42, "mid": 50.2, "cog": 52.09}
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
        waves = sea(seed, (0.3, 1.0), components=60)
        columns = {f"{probe} [m]": 0.05 * waves.at(time, x) for probe, x in PLACES.items()}
        write_csv(tmp_path / f"{name}.csv", {"time [s]": time, **columns})

    def make(stated, waves="irregular"):
        return campaign_of(tmp_path, CAMPAIGN.format(stated=stated, waves=waves))

    return make


def test_a_wrong_position_is_warned_of_once_and_is_a_finding_of_every_run(campaign):
    with warned(
        r"one: eta_fwd is stated to stand -1\.960 m from eta_mid, .* -1\.7.* "  # by the waves
        r"Check \[rig\.positions\] of the campaign, which count along the waves"
    ) as caught:
        runs = campaign(48.24).prepare()
    assert len(caught) == 1
    for run in runs.values():
        found = [(each.channel, each.kind.word) for each in findings_of(run)]
        assert found[:1] == [("eta_fwd", "position")]
        assert len(found) == 1 + len(findings(run, "CELERITY"))  # some waves are short for it


def test_where_no_position_fits_the_waves_depth_and_sign_are_to_be_checked(campaign):
    path = edit(campaign(48.42).path, ('"cog"', '"cog"\nsign = -1'))
    with warned(
        r"one: eta_cog is stated to stand [+-]\d\.\d+ m from eta_\w+, and at no distance do the "
        r"phases .* at best\)\. Check the water depth, \[rig\.positions\], and signs and clocks"
    ):
        seakeep.read_campaign(path).prepare(["one"])


def test_still_water_and_noise_place_no_probes(campaign, tmp_path):
    path, rng = tmp_path / "two.csv", np.random.default_rng(0)
    time = np.arange(0, 90, 0.05)
    still = {f"{probe} [m]": 1e-3 * rng.standard_normal(time.size) for probe in PLACES}
    write_csv(path, {"time [s]": time, **still})
    for waves in ("still", "irregular"):
        assert not findings(campaign(-400.0, waves).prepare(["two"])["two"], "POSITION")


def test_a_probe_in_another_unit_is_kept_until_its_file_is_repaired(campaign, tmp_path):
    sound, path = campaign(48.42), tmp_path / "two.csv"
    text = path.read_text("utf-8")

    def kept():
        run = xr.load_dataset(seakeep.campaign.write_prepared(sound)["two"])
        return [each.channel for each in findings_of(run)]

    path.write_text(text.replace("cog [m]", "cog [cm]"), "utf-8")
    with pytest.warns(
        match=r"one: eta_cog moves 10\d times as much beside eta_fwd as in most other runs\."
    ):
        assert kept() == ["eta_cog"]
    path.write_text(text, "utf-8")
    assert kept() == []


def test_right_positions_and_regular_waves_give_no_finding(campaign):
    for run in campaign(48.42).prepare().values():
        assert findings_of(run) == findings(run, "CELERITY")
    assert not findings_of(campaign(48.24, "regular").prepare(["two"])["two"])
