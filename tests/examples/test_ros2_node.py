"""The ROS 2 example: which samples become which step, and the node under a stand-in of rclpy."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from loaded import loaded
from numpy.testing import assert_allclose, assert_array_equal
from places import ROOT
from records import table
from scipy.spatial.transform import Rotation

from seakeep import HankelDMDc

pytest.importorskip("rosbags")

import stand_in_ros
from bags import message, quaternion, write_bag
from near import assert_near

EXAMPLE = ROOT / "examples/ros2_node"
DT = 0.05
CLOCK = 1.7e9  # seconds since 1970, as ROS counts them
COUNT = 60
PATIENCE = 0.3
FOLLOWER = loaded(EXAMPLE / "follower.py")
Follower = FOLLOWER.Follower


@pytest.fixture(scope="module")
def model(make_run):
    spec = HankelDMDc(3, 8, 1.0, delay_rows="exact")
    return spec.fit(make_run(), ["heave", "pitch"], ["eta_fwd", "eta_cog"])


@pytest.fixture(scope="module")
def run(make_run):
    return make_run(seed=5)


def messages(model, run, samples=range(COUNT), jitter=0.0, delay=0.01):
    """Values of a run as (arrival, channel, stamp, value)."""
    rng, found = np.random.default_rng(0), []
    for sample in samples:
        for channel in [*model.inputs, *model.states]:
            stamp = CLOCK + (sample + jitter * rng.uniform(-0.45, 0.45)) * DT
            found.append((stamp + delay, channel, stamp, float(run[channel].values[sample])))
    return found


def play(follower, sent):
    """Estimates of messages in the order of their arrival, by instant."""
    found = []
    for arrival, channel, stamp, value in sorted(sent):
        found += follower.advance(arrival)
        follower.receive(channel, stamp, value, arrival)
    last = max(stamp for arrival, _, stamp, _ in sent if stamp <= arrival)
    return found + follower.advance(last + follower.patience + 0.9 * DT)


def states(found):
    return np.array([state for _, state, _ in found])


def test_complete_samples_are_the_steps_of_the_live_model(model, run):
    expected, follower = model.live(), Follower(model.live)
    found = play(follower, messages(model, run, jitter=0.2))
    inputs, outputs = (table(run, names) for names in (model.inputs, model.states))
    for sample, (instant, *estimate) in enumerate(found):
        state = expected.step(inputs[sample], outputs[sample])
        assert_array_equal(estimate, [state, np.sqrt(np.diagonal(expected.covariance))])
        assert_near(instant, CLOCK + sample * DT, 0.1 * DT)
    assert len(found) == COUNT
    assert not follower.lost


def test_any_order_of_arrival_within_patience_gives_the_same_estimates(model, run):
    sent = messages(model, run, range(30), jitter=1.0, delay=0.0)
    within = arrays(float, len(sent), elements=st.floats(0, 0.99 * PATIENCE))

    @settings(max_examples=25)
    @given(within)
    def same(delays):
        late = [(each[2] + delay, *each[1:]) for each, delay in zip(sent, delays, strict=True)]
        both = [Follower(model.live, patience=PATIENCE) for _ in range(2)]
        found = [play(each, stream) for each, stream in zip(both, (sent, late), strict=True)]
        assert [each[0] for each in found[0]] == [each[0] for each in found[1]]
        assert_array_equal(states(found[0]), states(found[1]))
        assert both[0].lost == both[1].lost

    same()


def test_what_is_lost_is_estimated_and_counted(model, run):
    """A stamp an hour ahead, one that comes late, a value that is none, and messages never sent."""
    odd = {  # what comes later, how much later its stamp is, and a factor of its value
        ("heave", 20): (0.0, 3600.0, 1.0),
        ("pitch", 25): (0.5, 0.0, 1.0),
        ("eta_cog", 30): (0.5, 0.0, 1.0),
        ("heave", 35): (0.0, 0.0, np.nan),
    }
    sent, kept = [], []
    for each in messages(model, run, [*range(40), *range(41, COUNT)]):
        arrival, channel, stamp, value = each
        late, ahead, factor = odd.get((channel, round((stamp - CLOCK) / DT)), (0.0, 0.0, 1.0))
        sent.append((arrival + late, channel, stamp + ahead, factor * value))
        if sent[-1] == each:
            kept.append(each)
    follower = Follower(model.live)
    found = play(follower, sent)
    assert len(found) == COUNT
    assert_array_equal(states(found), states(play(Follower(model.live), kept)))
    assert follower.lost == {
        ("heave", "early"): 1,
        ("pitch", "late"): 1,
        ("eta_cog", "late"): 1,
        ("heave", "not finite"): 1,
        ("heave", "missing"): 3,
        ("pitch", "missing"): 2,
        ("eta_cog", "missing"): 2,
        ("eta_fwd", "missing"): 1,
    }
    differs = np.any(states(found) != table(run, model.states)[:COUNT], axis=1)
    assert set(np.flatnonzero(differs)) == {20, 25, 35, 40}


@pytest.fixture
def node(monkeypatch):
    stand_in_ros.install(monkeypatch)
    monkeypatch.setitem(sys.modules, "follower", FOLLOWER)
    return loaded(EXAMPLE / "node.py")


@pytest.fixture
def started(node, model, tmp_path):
    """Make a node of the model, with other parameters."""

    def start(**given):
        model.save(tmp_path / "model.nc")
        node.SeakeepNode.given = {"model": tmp_path / "model.nc"} | given
        return node.SeakeepNode()

    return start


def stamp(seconds):
    return stand_in_ros.TIME(seconds).to_msg()


def recorded(path, run, samples, lost=()):
    """Record a run as a vessel would: odometry, and two probes, messages out of order."""

    def point(channel, at):
        return message("geometry_msgs/msg/Point")(z=float(run[channel].values[at]))

    sent, rng = [], np.random.default_rng(0)
    for at in samples:
        seconds = CLOCK + at * DT
        head = {"header": message("std_msgs/msg/Header")(stamp=stamp(seconds))}
        turned = quaternion([0.3, float(run["pitch"].values[at]), 0.02])
        pose = message("geometry_msgs/msg/Pose")(position=point("heave", at), orientation=turned)
        odometry = message("geometry_msgs/msg/PoseWithCovariance")(pose=pose)
        each = {"/vessel/odometry": message("nav_msgs/msg/Odometry")(**head, pose=odometry)}
        for name in ("fwd", "cog"):
            stamped = message("geometry_msgs/msg/PointStamped")
            each[f"/wave_probe/{name}"] = stamped(**head, point=point(f"eta_{name}", at))
        for topic, made in each.items():
            if (topic, at) not in lost:
                sent.append((round(1e9 * seconds) + int(rng.integers(80_000_000)), topic, made))
    return write_bag(path, sent)


def test_the_node_follows_a_recorded_bag(node, started, model, make_run, tmp_path):
    run = make_run(seed=5).assign_attrs(water_depth=3.0)
    for name, place in (("eta_fwd", -1.0), ("eta_cog", 0.0)):
        run[name].attrs["x_position"] = place
    run.to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    lost = {("/wave_probe/fwd", 50), ("/vessel/odometry", 60), ("/vessel/odometry", 61)}
    vessel = started(run=tmp_path / "run.nc")
    vessel.play(recorded(tmp_path / "bag", run, range(240), lost))
    estimates = vessel.published["~/estimate"]
    assert len(estimates) > 230
    for at, each in enumerate(estimates):
        assert_near(node.seconds(each.header.stamp), CLOCK + at * DT, 1e-6)
        assert list(each.name) == model.states
        if at not in (60, 61):
            assert_near(each.position, table(run, model.states)[at], 1e-12)  # via a quaternion
    assert vessel.warnings == [
        "lost in the last 10 s: eta_fwd missing: 1, heave missing: 2, pitch missing: 2"
    ]
    assert vessel.follower.live.forecast(2).attrs["predictable"] > 0  # it serves in this rig


@pytest.mark.parametrize("turn", [(0.4, -0.2, 0.7), (0.0, np.pi / 2, 0.0), (-3.0, 0.1, 3.1)])
def test_angles_of_a_quaternion(node, turn):
    angles = [node.read(quaternion(turn), [name]) for name in ("yaw", "pitch", "roll")]
    # asin is steep where the bow points upwards.
    found, turned = Rotation.from_euler("ZYX", [angles, turn]).as_quat()
    assert_near(found, turned, 1e-7)


@pytest.mark.parametrize(("w", "covariance"), [(np.nan, 0.0), (0.0, 0.0), (1.02, 0.0), (1.0, -1.0)])
def test_an_orientation_or_a_rate_that_is_not_there_is_missing(node, w, covariance):
    """By its length, or its covariance."""
    turn, absent = message("geometry_msgs/msg/Quaternion")(w=w), [covariance] * 9
    imu = message("sensor_msgs/msg/Imu")(
        orientation=turn, orientation_covariance=absent, angular_velocity_covariance=absent
    )
    assert all(np.isnan(node.read(imu, ["orientation", angle])) for angle in node.ANGLES)
    assert np.isnan(node.read(imu, ["angular_velocity", "x"])) == (covariance == -1)
    assert node.read(imu, ["linear_acceleration", "z"]) == 0.0


def assert_sent(trajectory, forecast, model, statistic, atol=0.0):
    found = [each.positions for each in trajectory.points]
    expected = table(forecast.sel(statistic=statistic), model.states)
    assert_allclose(found, expected, rtol=1e-7, atol=atol)


def test_deviations_and_validity_are_those_of_the_live_model(started, model, run, tmp_path):
    steep = run.assign({name: 3 * run[name] for name in model.inputs})
    unseen = {("/vessel/odometry", at) for at in range(225, 240)}
    vessel = started()
    vessel.play(recorded(tmp_path / "bag", steep, range(240), unseen))
    vessel.forecast()
    live, found = vessel.follower.live, vessel.published
    assert_array_equal(found["~/estimate_std"][-1].position, np.sqrt(np.diagonal(live.covariance)))
    expected = live.forecast(200)
    for topic, statistic in (("~/forecast", "mean"), ("~/forecast_std", "std")):
        assert_sent(found[topic][-1], expected, model, statistic)
    assert list(found["~/forecast"][-1].joint_names) == model.states
    (status,) = found["/diagnostics"][-1].status
    assert (status.level, status.message) == (1, expected.attrs["validity"])
    assert "height" in status.message
    free = live.consistency_by_state[1]
    assert_allclose([float(each.value) for each in status.values], free, rtol=0.01)


def test_a_known_input_is_forecast_by_its_plan(node, started, model, run, tmp_path, monkeypatch):
    monkeypatch.setitem(node.ROLES, "eta_cog", "known")
    vessel = started(horizon=1.0)
    vessel.play(recorded(tmp_path / "bag", run, range(120)))
    (status,) = vessel.published["/diagnostics"][-1].status
    assert (status.level, status.message) == (1, "no forecast: ~/plan must give eta_cog")
    assert "~/forecast" not in vessel.published

    live, point = vessel.follower.live, message("trajectory_msgs/msg/JointTrajectoryPoint")
    points = [point(positions=[0.2 * at], time_from_start=stamp(at)) for at in (0.0, 0.5)]
    plan = message("trajectory_msgs/msg/JointTrajectory")(joint_names=["eta_cog"], points=points)
    plan.header.stamp = stamp(live.time)
    vessel.receive_plan(plan)
    vessel.forecast()
    leads = DT * np.arange(1, 20 + model.lead_samples)
    expected = live.forecast(20, {"eta_cog": 0.2 * np.minimum(leads, 0.5)})
    # Stamps count ns, and a float of 1.7e9 s has 0.2 µs.
    assert_sent(vessel.published["~/forecast"][-1], expected, model, "mean", atol=1e-6)


def test_a_damaged_state_is_put_aside_and_the_next_one_is_gone_on_from(
    node, started, run, tmp_path
):
    state = tmp_path / "state.nc"
    state.write_bytes(b"cut off")
    vessel = started(state=state)
    assert state.with_suffix(".damaged").read_bytes() == b"cut off"
    assert "starting anew" in vessel.warnings[0]
    vessel.play(recorded(tmp_path / "first", run, range(120)))
    again = started(state=state)
    saved = again.follower.live.time
    assert_near(saved, CLOCK + 119 * DT, 1.5)
    again.play(recorded(tmp_path / "second", run, range(120, 180)))
    assert_near(node.seconds(again.published["~/estimate"][0].header.stamp), saved + DT, 1e-6)
