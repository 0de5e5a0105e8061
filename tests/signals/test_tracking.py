"""Tracking of a rendered side view, whose motion is known, and what is said of bad videos."""

from math import tau

import numpy as np
import pytest
import xarray as xr
from near import assert_near
from numpy.testing import assert_allclose, assert_array_equal
from records import rms
from said import data_error, request_error
from small_tank import write_csv

from seakeep.campaign import read_table
from seakeep.signals import TrackingSettings, compare_motion, contact_sheet, track_video
from seakeep.signals.tracking import FLAGS

cv2 = pytest.importorskip("cv2")
pytest.importorskip("numba")

from seakeep.tank import play as tank_video  # noqa: E402

cv2.setNumThreads(1)
RATE, FRAMES = 30.0, 60
COG = 0.03  # m above still water
OCCLUDED = range(12, 16)
BURNT = range(24, 28)
WASHED = range(36, 38)  # brighter by half: the panel alone saturates
DARK = range(46, 56)


def motion(t):
    """Surge, heave (m) and pitch (rad) of a vessel in waves of 0.6 Hz that drifts slowly."""
    phase = tau * 0.6 * t
    surge = 0.2 + 0.1 * np.sin(tau * t / 20) + 0.05 * np.sin(phase)
    return surge, 0.05 * np.sin(phase + 1), np.deg2rad(5) * np.sin(phase + 2)


def writer_of(path):
    return cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), RATE, (1280, 720))


def render(path, hook=None, frames=FRAMES):
    """Write a video with noise; return the panel's place in pixels, frame by frame."""
    rng, place = np.random.default_rng(1), np.linspace(-1.0, 2.2, 41)
    light, stock = tank_video._light(), tank_video._noise(cv2, rng)
    writer = writer_of(path)
    for i in range(frames):
        surface = 0.05 * np.sin(3 * place - tau * 0.6 * i / RATE)
        frame = tank_video.frame_of(cv2, motion(i / RATE), surface, float(20 <= i < 30), COG)
        lit = cv2.multiply(frame.astype(np.float32), light)
        lit = hook(i, lit) if hook else lit
        lit += np.roll(stock[i % len(stock)], rng.integers(1280), axis=1)[:, :, None]
        writer.write(np.clip(lit, 0, 255).astype(np.uint8))
    writer.release()
    surge, heave, pitch = motion(np.arange(frames) / RATE)
    return tank_video.pixel_of(
        surge + tank_video.PANEL_HEIGHT * np.sin(pitch),
        heave + COG + tank_video.PANEL_HEIGHT * np.cos(pitch),
    )


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """Path of an undisturbed video, and the panel's true place."""
    path = tmp_path_factory.mktemp("video") / "side_view.mp4"
    return path, render(path)


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory):
    """A video with a pole before the panel, floods of light, and darkness; the place, the track."""

    def hook(i, lit):
        if i in OCCLUDED:
            lit[200:420, 500:530] = 60
        if i in BURNT:
            return lit * 2.5
        if i in WASHED:
            return lit * 1.5
        return lit * (0.2 if i in DARK else 1.0)

    path = tmp_path_factory.mktemp("video") / "disturbed.mp4"
    return path, render(path, hook), track_video(path)


@pytest.fixture(scope="module")
def tracked(plain):
    reports = []
    out = track_video(plain[0], progress=lambda *said: reports.append(said))
    assert reports == [(FRAMES, FRAMES, "frames")]
    return out


def centroid_error(tracked, place):
    return np.hypot(tracked["centroid_x"] - place[:, 0], tracked["centroid_y"] - place[:, 1])


def test_motions_of_the_centre_of_gravity(plain, tracked):
    """Absolute by a stated origin; else surge and heave count from their means over a second."""
    x, y = tank_video.pixel_of(0.0, COG + tank_video.PANEL_HEIGHT)
    how = TrackingSettings(metres_per_pixel=0.0025, origin=(float(x), float(y)), lamp=(40, 40, 8))
    out = track_video(plain[0], how)
    assert_allclose(tracked.time, np.arange(FRAMES) / RATE, rtol=1e-12)
    limits = {"surge": 1e-3, "heave": 1e-3, "pitch": np.deg2rad(0.05)}  # 1 mm is 0.4 pixel
    for (name, limit), true in zip(limits.items(), motion(out.time), strict=True):
        # Without half a filter length, where its end conditions show.
        absolute, error = ((track[name] - true)[8:-8] for track in (out, tracked))
        assert rms(absolute) < limit, name
        assert rms(error - error.mean() * (name != "pitch")) < limit, name
    on = (np.arange(FRAMES) >= 20) & (np.arange(FRAMES) < 30)
    assert np.all(out["lamp"][on] > 2 * out["lamp"][~on].max())


def hide_corner(i, lit, corner, leg):
    """A dark triangle of two legs along the panel's sides (pixels), over one of its corners."""
    surge, heave, pitch = motion(i / RATE)
    beyond = tank_video.METRES_PER_PIXEL * np.array([[2, 2], [-leg - 2, 2], [2, -leg - 2]])
    side = [(-1, 1), (1, 1), (1, -1), (-1, -1)][corner]
    triangle = side * (0.5 * np.array(tank_video.PANEL) + beyond)
    triangle[:, 1] += tank_video.PANEL_HEIGHT
    points = tank_video._turned(triangle, (surge, heave + COG), pitch)
    hidden = np.ascontiguousarray(lit)
    cv2.fillPoly(
        hidden, [tank_video._corners(points)], (60, 60, 60), cv2.LINE_AA, tank_video.FRACTION_BITS
    )
    return hidden


def test_a_hidden_corner_is_flagged_before_it_spoils_the_pitch(tmp_path):
    """Every third frame hides a corner, each of the four in turn; the others are sound."""
    hidden = range(1, 36, 3)

    def hook(i, lit):
        return hide_corner(i, lit, i // 3 % 4, 10) if i in hidden else lit

    path = tmp_path / "corners.mp4"
    place = render(path, hook, frames=36)
    out = track_video(path)
    bad = np.isin(np.arange(36), hidden)
    assert_array_equal(out["flag"] == FLAGS["occluded"], bad)
    assert np.all(out["flag"][~bad] == FLAGS["good"])
    # What is flagged here was wrong by more than what is asked for, and looks sound otherwise.
    _, _, pitch = motion(out.time)
    assert np.all(np.rad2deg(np.abs(out["panel_angle"] - pitch))[bad] > 0.2)
    assert np.all(out["panel_fill"][bad] > 0.93)
    assert np.all(centroid_error(out, place)[~bad] < 0.5)


def test_a_camera_on_the_other_side(plain, tmp_path, tracked):
    """Mirrored, with downstream to the left, a video shows the same motion."""
    path = tmp_path / "mirrored.mp4"
    writer = writer_of(path)
    capture = cv2.VideoCapture(str(plain[0]))
    while (read := capture.read())[0]:
        writer.write(cv2.flip(read[1], 1))
    writer.release()
    out = track_video(path, TrackingSettings(downstream="left"))
    for name in ("surge", "heave", "pitch"):
        # Encoded twice; rad and m, both far below what is asked.
        assert rms(out[name] - tracked[name]) < 5e-4, name


def test_flags_of_bad_frames(disturbed):
    _, place, out = disturbed
    expected = np.full(FRAMES, FLAGS["good"])
    expected[OCCLUDED] = FLAGS["occluded"]
    expected[BURNT] = FLAGS["overexposed"]
    expected[WASHED] = FLAGS["overexposed"]
    expected[DARK] = FLAGS["lost"]
    assert_array_equal(out["flag"], expected)
    bad = expected != FLAGS["good"]
    assert np.all(out["quality"][bad] < 0.5)
    assert np.all(out["quality"][~bad] > 0.8)
    assert np.all(np.isnan(out["surge"][bad]))
    assert np.all(np.isfinite(out["surge"][~bad]))
    assert not out["bridged"].any()
    # The asked 0.5 pixel holds for the frames that count.
    assert rms(centroid_error(out, place)[~bad]) < 0.2


@pytest.mark.parametrize("region", [(1, 2), (1000, 0, 400, 100), (-1, 0, 40, 100)])
def test_a_region_has_four_numbers_within_the_picture(plain, region):
    with request_error(r"no part of the picture .* 1280 × 720 .* left, top"):
        track_video(plain[0], TrackingSettings(region=region))


def test_a_lag_one_wave_period_off_is_told():
    t = np.arange(0, 60, 0.05)

    def found(frequencies, late, **settings):
        wave = sum(np.sin(a * t + i) for i, a in enumerate(frequencies))
        mru = sum(np.sin(a * (t + late) + i) for i, a in enumerate(frequencies))
        return compare_motion(wave + 0.25, t, mru, t, **settings)

    regular, period = found([4.0], 0.3), tau / 4.0
    assert regular.ambiguous
    apart = abs(regular.lag - regular.rival_lag) / period
    assert_near(apart, round(apart), 0.04)  # two steps of 0.05 s in a period
    # A sea: components that are not multiples of one another leave one peak that fits.
    sea = found([3.1, 3.6, 4.0, 4.7, 5.3], 2.1)
    assert sea.max_lag == 10.0
    assert_near(sea.lag, 2.1, 1e-3)  # a fiftieth of a step: noiseless
    assert_near(sea.offset, 0.25, 1e-3)
    assert not sea.ambiguous
    assert abs(sea.rival_lag - 2.1) > 1.0
    assert sea.enclosed
    # Searched within 1 s, a peak a period off is the best there is.
    near = found([3.1, 3.6, 4.0, 4.7, 5.3], 2.1, max_lag=1.0)
    assert_allclose(near.period, tau / 4.2, rtol=0.05)
    assert not near.enclosed
    assert found([1.0], 1.0, max_lag=0.5).at_limit


def test_a_contact_sheet_shows_bad_frames_too(disturbed, tmp_path):
    path, _, flagged = disturbed
    picture = cv2.imdecode(np.frombuffer(contact_sheet(path, flagged), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (4 * 270, 3 * 480, 3)
    # Four of the twelve are the worst ones; frames spread evenly may be bad too.
    borders = [tuple(picture[270 * r + 1, 480 * c + 1]) for r in range(4) for c in range(3)]
    assert 5 <= borders.count((60, 200, 60)) <= 8
    render(tmp_path / "short.mp4", frames=5)
    with data_error("it is not the video that was tracked"):
        contact_sheet(tmp_path / "short.mp4", flagged)


def test_the_command_writes_what_a_campaign_reads(plain, tracked, monkeypatch, command):
    """The example of its help, on a video of that name."""
    monkeypatch.chdir(plain[0].parent)
    example = command("track", "--help")[0].partition("Example: seakeep ")[2].split()[:6]
    assert " ".join(example) == "track side_view.mp4 -o track.csv --contact-sheet sheet.png"
    _, err = command(*example)
    assert "Tracking 60/60: frames" in err
    assert "60 frames at 30 Hz; flagged: none (0 bridged); 2.49" in err
    table = read_table(plain[0].parent / "track.csv")
    assert table["pitch"].attrs["units"] == "deg"
    # Written with six decimals of a metre, five of a degree and six of a second.
    assert_near(table["surge"], tracked["surge"], 1e-6)
    assert_near(np.deg2rad(table["pitch"]), tracked["pitch"], 1e-6)
    assert_near(table["time"], tracked.time, 1e-6)
    assert cv2.imread("sheet.png").shape[1] == 1440


def test_the_command_compares_bridges_short_gaps_and_writes_netcdf(disturbed, tmp_path, command):
    time = np.arange(0, 5, 0.02) - 0.5
    _, heave, pitch = motion(time)
    columns = {"time [s]": time, "heave [m]": heave, "pitch [deg]": np.rad2deg(pitch)}
    mru = write_csv(tmp_path / "mru.csv", columns)
    out = tmp_path / "track.nc"
    words = ["-o", out, "--bridge", 0.2, "--mru", mru, "--max-lag", 0.4]
    _, err = command("track", disturbed[0], *words)
    assert "flagged: 10 lost, 4 occluded, 6 overexposed (10 bridged)" in err
    assert "pitch against the MRU: correlation 1.0" in err
    assert "Note: pitch: the lags searched (within 0.4 s) do not reach a wave period (1." in err
    stored = xr.load_dataset(out)
    assert '"bridge": 0.2' in stored.attrs["settings"]
    short = np.isin(np.arange(FRAMES), [*OCCLUDED, *BURNT, *WASHED])
    assert_array_equal(stored["bridged"], short)
    assert_array_equal(np.isnan(stored["heave"]), np.isin(np.arange(FRAMES), DARK))
    _, _, pitch = motion(stored["time"])
    # Four frames of a 1.67 s period, by cubics whose slope is estimated from one side.
    assert np.rad2deg(rms((stored["pitch"] - pitch)[short])) < 0.5


def test_frames_that_the_camera_dropped(plain, monkeypatch):
    """Time stamps that skip a step leave a gap in the record, not a shorter record."""

    class Dropping:
        """A video whose tenth frame was lost."""

        def __init__(self, path, opened=cv2.VideoCapture):
            self.inner, self.count = opened(path), -1

        def __getattr__(self, name):
            return getattr(self.inner, name)

        def read(self):
            self.count += 1
            if self.count == 10:
                self.inner.read()
            return self.inner.read()

    monkeypatch.setattr(cv2, "VideoCapture", Dropping)
    out = track_video(plain[0])
    assert out.time.size == FRAMES
    assert list(np.flatnonzero(out["flag"] == FLAGS["dropped"])) == [10]
    assert out["picture"][10] == -1
    assert np.isnan(out["surge"][10])
    assert np.isfinite(out["surge"][11])
