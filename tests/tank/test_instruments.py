from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from altered import altered
from near import assert_near
from numpy.random import default_rng
from numpy.testing import assert_allclose

from seakeep.tank.instruments import _immersed, clock_instants, record_run, slap_pulses, trigger
from seakeep.tank.play import generator, play_run, truth
from seakeep.tank.settings import SlapSettings

pytest.importorskip("numba")


@pytest.fixture(scope="module")
def records(short, played):
    return record_run(played, generator(short, "irregular_1", "instruments"))


def test_trigger_is_a_smooth_pulse():
    t = np.arange(0.0, 60.0, 1e-3)
    pulse = trigger(t, 20.0, 0.5)
    assert pulse.max() == 1.0
    assert_allclose(np.trapezoid(pulse, t), 3 * 0.25, rtol=1e-6)  # raised cosines
    assert np.abs(np.diff(pulse)).max() < 2 * np.pi / 0.5 * 0.5 * 1e-3 * 1.01


def test_noise_is_what_is_stated(records, played, short):
    noise = short.instruments
    mru, clock = records["mru"], noise.clocks["mru"]
    _, instants = clock_instants(clock, played.length)
    q, v, a = played.states(instants)
    n = instants.size
    for column, true, sigma in (
        ("heave", q[1], noise.heave_noise),
        ("pitch", np.rad2deg(q[2]), np.rad2deg(noise.angle_noise)),
        ("rate_y", np.rad2deg(v[2]), np.rad2deg(noise.rate_noise)),
        ("acceleration_x", a[0], noise.acceleration_noise),
        ("acceleration_z", a[1], noise.acceleration_noise),
        ("roll", 0.0, np.rad2deg(noise.angle_noise)),
    ):
        error = mru[column].values - true
        # A sample deviation scatters by 1/√(2n); four of these.
        assert_allclose(error.std(), sigma, rtol=4 / np.sqrt(2 * n))
        assert abs(error.mean()) < 4 * sigma / np.sqrt(n)


def test_second_order_crest_of_a_regular_wave(settings, rig):
    steady = altered(settings.runs["regular_2"], unsteadiness=0.0)
    played = play_run(altered(settings, runs={"one": steady}), "one", rig)
    t = np.arange(30.0, 40.0, 0.01)
    k, a = played.sea.wavenumber[0], played.sea.amplitude[0]
    angle = k * (50.0 - 52.09) - played.sea.omega[0] * t + played.sea.phase[0]
    # Stokes' bound second harmonic in deep water.
    assert_near(played.crest(50.0, t), 0.5 * k * a**2 * np.cos(2 * angle), 1e-12)


def test_dropouts_take_the_stated_share(settings, rig):
    probes = {"us": altered(settings.instruments.probes["us_fwd"], dropouts=0.05)}
    made = altered(settings, instruments=altered(settings.instruments, probes=probes))
    record = record_run(play_run(made, "irregular_1", rig), default_rng(0))["wave_probes"]
    lost = np.isnan(record["us"].values)
    # About 120 bursts of uniform length: the share scatters by a tenth.
    assert_allclose(lost.mean(), 0.05, rtol=0.3)
    edges = np.flatnonzero(np.diff(lost.astype(int)))
    assert_near(np.median(edges[1::2] - edges[::2]) / 500.0, 0.11, 0.04)


def test_slap_is_on_the_measured_load_alone(records, played, short):
    _, t = clock_instants(short.instruments.clocks["loads"], played.length)
    instruments = altered(short.instruments, slap={})
    quiet = replace(played, settings=altered(short, instruments=instruments))
    spread, alone = (
        np.std(each["loads"]["mooring_bow"].values - played.loads(t)[0])
        for each in (records, record_run(quiet, default_rng(1)))
    )
    assert spread > 1.2 * short.instruments.load_noise
    assert_allclose(alone, short.instruments.load_noise, rtol=0.02)


def test_slap_pulses_start_where_the_line_is_wetted():
    time = np.arange(0.0, 100.0, 0.002)
    wet = (time % 5.0) > 4.0
    slap = SlapSettings(mean=0.2)
    pulses = slap_pulses(time, wet, slap, default_rng(0))
    assert_near(time[np.flatnonzero(pulses)[0]], 4.002, 0.005)
    heights = [np.abs(pulses[np.abs(time - at - 0.15) < 0.15]).max() for at in np.arange(4, 99, 5)]
    # Exponential with mean 0.2 N, less what the decay takes before the first crest.
    assert 0.05 < np.mean(heights) < 0.25
    assert np.all(slap_pulses(time, wet & False, slap, default_rng(0)) == 0.0)


def test_truth_holds_what_the_chain_is_judged_against(played):
    data = truth(played, "irregular_1")
    assert {"surge", "heave_rate", "pitch_acceleration", "mooring_bow", "eta_vessel"} <= set(data)
    assert data.attrs["clock_mru_offset"] == 0.370
    assert data.attrs["clock_video_drift_ppm"] == -40.0
    time = data["time"].values
    assert_near(data["eta_vessel"], played.elevation(52.09 + data["surge"].values, time), 1e-12)
    # The state is consistent: rates are the motions' derivatives.
    assert_near(np.gradient(data["heave"].values, time)[5:-5], data["heave_rate"][5:-5], 1e-3)


@pytest.mark.parametrize("line", ["bow", "stern"])
def test_a_pitch_that_lifts_the_bow_lifts_the_eye_of_its_line(played, line):
    """A line's middle under still water: eye and pole at the waterline, the vessel pitched."""
    own, time = played.settings.moorings[line], np.arange(0.0, 5.0, 0.5)

    def immersed(pitch):
        q = np.zeros((5, time.size))
        q[2] = pitch
        level = np.full(time.size, 0.5 * (own.eye[1] + own.pole[1]))
        ways = {"states": lambda at: (q, q, q), "elevation": lambda x, at: level}
        still = SimpleNamespace(settings=played.settings, rig=played.rig, **ways)
        return _immersed(still, time, line)

    lifted = -np.sign(own.eye[0]) * 0.1  # the bow points against x
    assert not immersed(lifted).any()
    assert immersed(-lifted).all()
