import numpy as np
import pytest

from seakeep.campaign import load_prepared, read_campaign, write_prepared
from seakeep.tank.delivery import METRES_PER_PIXEL, PANEL, PANEL_HEIGHT, pixel_of, render_side_view
from seakeep.tank.instruments import clock_instants
from seakeep.tank.play import play, play_run

cv2 = pytest.importorskip("cv2", reason="needs the extra video")
pytest.importorskip("numba", reason="needs the extra tank")


@pytest.fixture(scope="module")
def filmed(settings):
    run = settings.runs["regular_2"].model_copy(update={"startup": 0.0, "duration": 14.0})
    clocks = dict(settings.instruments.clocks)
    clocks["video"] = clocks["video"].model_copy(update={"rate": 10.0})  # fewer frames to render
    instruments = settings.instruments.model_copy(update={"clocks": clocks})
    return settings.model_copy(update={"runs": {"one": run}, "instruments": instruments})


@pytest.fixture(scope="module")
def played(filmed, rig):
    return play_run(filmed, "one", rig)


@pytest.fixture(scope="module")
def video(played, tmp_path_factory):
    path = tmp_path_factory.mktemp("video") / "side_view.mp4"
    return render_side_view(played, path, np.random.default_rng(0), length=10.0)


def frames(path, wanted):
    reader = cv2.VideoCapture(str(path))
    for index in range(int(reader.get(cv2.CAP_PROP_FRAME_COUNT))):
        good, frame = reader.read()
        assert good
        if index in wanted:
            yield index, frame
    reader.release()


def test_white_panel_is_where_the_vessel_is(video, played):
    _, instants = clock_instants(played.settings.instruments.clocks["video"], 10.0)
    position, _, _ = played.states(instants)
    for index, frame in frames(video, {0, 40, 55, 70, 99}):
        white = (frame.min(axis=2) > 150).astype(np.uint8)
        count, _, stats, centres = cv2.connectedComponentsWithStats(white)
        largest = 1 + np.argmax(stats[1:, cv2.CC_STAT_AREA])
        assert count >= 2
        surge, heave, pitch = position[:3, index]
        centre = pixel_of(
            surge + PANEL_HEIGHT * np.sin(pitch), 0.03 + heave + PANEL_HEIGHT * np.cos(pitch)
        )
        # The edge of a thresholded, compressed panel: a pixel is 2.5 mm.
        assert centres[largest] == pytest.approx(centre, abs=1.5)
        area = PANEL[0] * PANEL[1] / METRES_PER_PIXEL**2
        assert stats[largest, cv2.CC_STAT_AREA] == pytest.approx(area, rel=0.08)


def test_lamp_shows_the_trigger(video, played):
    clock = played.settings.instruments.clocks["video"]
    readings, _ = clock_instants(clock, 10.0)
    lit = round((10.0 + clock.offset) * clock.rate)  # the pulse at 10 s of the reference clock
    level = {i: f[30:50, 30:50, 2].mean() for i, f in frames(video, {lit, lit - 10, lit + 10})}
    assert readings[lit] == pytest.approx(8.8, abs=0.05)
    assert level[lit] > 2.5 * max(level[lit - 10], level[lit + 10])


# The camera starts late by more than a twentieth of this short run, which is told.
@pytest.mark.filterwarnings("ignore:one. video starts at:seakeep.SeakeepWarning")
def test_a_filmed_campaign_is_prepared(filmed, tmp_path):
    files = play(filmed, tmp_path, videos=["one"])["one"]
    assert files["side_view"].suffix == ".mp4"
    campaign = read_campaign(tmp_path / "campaign.toml")
    assert "side_view" not in campaign.settings.runs["one"].files  # no table of a logger
    assert "# Filmed: raw/one/side_view.mp4" in campaign.path.read_text(encoding="utf-8")
    assert write_prepared(campaign)
    assert "surge" in load_prepared(campaign)["one"]
