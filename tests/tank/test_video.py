import numpy as np
import pytest
from altered import altered
from near import assert_near

from seakeep.campaign import load_prepared, read_campaign, write_prepared
from seakeep.signals import TrackingSettings, track_video
from seakeep.tank.instruments import clock_instants
from seakeep.tank.play import PANEL_HEIGHT, pixel_of, play, play_run

pytest.importorskip("cv2")
pytest.importorskip("numba")


@pytest.fixture(scope="module")
def filmed(settings):
    run = altered(settings.runs["regular_2"], startup=0.0, duration=11.0)
    clocks = dict(settings.instruments.clocks)
    clocks["video"] = altered(clocks["video"], rate=10.0)  # fewer frames to render
    instruments = altered(settings.instruments, clocks=clocks)
    return altered(settings, runs={"one": run}, instruments=instruments)


@pytest.fixture(scope="module")
def played(filmed, rig):
    return play_run(filmed, "one", rig)


# The camera starts late by more than a twentieth of this short run, which is told.
@pytest.mark.filterwarnings("ignore:one. video starts at:seakeep.SeakeepWarning")
def test_a_filmed_campaign_is_prepared_and_its_film_shows_motion_and_trigger(
    filmed, played, tmp_path
):
    film = play(filmed, tmp_path, videos=["one"])["one"]["side_view"]
    campaign = read_campaign(tmp_path / "campaign.toml")
    assert "side_view" not in campaign.settings.runs["one"].files  # no table of a logger
    assert "# Filmed: raw/one/side_view.mp4" in campaign.path.read_text("utf-8")
    assert write_prepared(campaign)
    assert "surge" in load_prepared(campaign)["one"]
    clock = played.settings.instruments.clocks["video"]
    readings, instants = clock_instants(clock, played.length)
    surge, heave, pitch = played.states(instants)[0][:3]
    found = track_video(film, TrackingSettings(lamp=(40, 40, 8), passband=None))
    place = pixel_of(
        surge + PANEL_HEIGHT * np.sin(pitch), 0.03 + heave + PANEL_HEIGHT * np.cos(pitch)
    )
    # A pixel is 2.5 mm.
    assert_near(found["centroid_x"], place[:, 0], 0.5)
    assert_near(found["centroid_y"], place[:, 1], 0.5)
    assert_near(found["panel_angle"], pitch, np.deg2rad(0.2))
    lit = round((10.0 + clock.offset) * clock.rate)  # the pulse at 10 s of the reference clock
    assert_near(readings[lit], 8.8, 0.05)
    assert found["lamp"][lit] > 2.5 * max(found["lamp"][[lit - 10, lit + 10]])
