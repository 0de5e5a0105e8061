"""ROS 2 bags and MCAP, written by rosbags."""

import numpy as np
import pytest
from near import assert_near
from numpy.testing import assert_array_equal
from said import data_error, request_error, warned
from small_tank import campaign_of

from seakeep.campaign import read_table
from seakeep.campaign.readers import checksum
from seakeep.campaign.settings import FileSettings

pytest.importorskip("rosbags")

from bags import STORE, message, quaternion, write_bag
from pages import page
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_types_from_msg

STORE.register(
    get_types_from_msg(
        "std_msgs/Header header\nfloat64 surge\nfloat32[2] loads\nfloat64[] cells\nstring remark\n",
        "tank_msgs/msg/Rig",
    )
)
BEGIN = 1_700_000_000_000_000_000  # ns
STEP = 20_000_000  # ns
COUNT = 100
T = 1e-9 * STEP * np.arange(COUNT)
RATE = np.sin(T)


def header(instant):
    stamp = STORE.types["builtin_interfaces/msg/Time"](*divmod(instant, 1_000_000_000))
    return message("std_msgs/msg/Header")(stamp=stamp)


def imu(i, stamped=True):
    vector, turn = (message(f"geometry_msgs/msg/{kind}") for kind in ("Vector3", "Quaternion"))
    return message("sensor_msgs/msg/Imu")(
        header=header(BEGIN + i * STEP if stamped else 0),
        orientation=turn(w=1.0),
        angular_velocity=vector(y=RATE[i]),
        linear_acceleration=vector(x=0.1, z=9.81),
    )


def rig(i, stamped=True):
    return STORE.types["tank_msgs/msg/Rig"](
        header=header(BEGIN + i * STEP if stamped else 0),
        surge=float(i),
        loads=np.array([i, -i], dtype=np.float32),
        cells=np.arange(2.0),
        remark="x",
    )


def text(i):
    return message("std_msgs/msg/String")()


def save(folder, plugin=StoragePlugin.MCAP, **topics):
    """Write topics, each a maker of messages; received 3 ms after they are stamped."""
    sent = (
        (BEGIN + i * STEP + 3_000_000, f"/{topic}", make(i))
        for topic, make in topics.items()
        for i in range(COUNT)
    )
    return write_bag(folder / "bag", sent, plugin)


@pytest.mark.parametrize("plugin", list(StoragePlugin), ids=lambda plugin: plugin.name)
@pytest.mark.parametrize("what", ["folder", "file"])
def test_a_standard_message(tmp_path, plugin, what):
    path = save(tmp_path, plugin, mru=imu, note=text)
    if what == "file":
        path = next(each for each in path.iterdir() if each.suffix in (".mcap", ".db3"))
    run = read_table(path)
    # Seconds from the first reception: header stamps are 3 ms earlier; a float of ns is exact here.
    assert_near(run["time"], T - 0.003, 1e-12)
    assert_near(run["receive_time"], T, 1e-12)
    assert_array_equal(run["angular_velocity.y"], RATE)
    units = {name: run[name].attrs.get("units") for name in run.data_vars}
    assert units["angular_velocity.y"] == "rad/s"
    assert units["linear_acceleration.z"] == "m/s^2"
    assert units["orientation.w"] is None
    assert not any("covariance" in name for name in units)


def test_the_times_of_reception_on_request(tmp_path):
    run = read_table(save(tmp_path, mru=imu), FileSettings(time="receive_time"))
    assert_near(run["time"], T, 1e-12)
    with request_error("the column 'time' cannot be a channel"):
        read_table(tmp_path / "bag", FileSettings(time="receive_time"), columns=["time"])


def test_a_message_of_ones_own(tmp_path):
    run = read_table(save(tmp_path, rig=rig))
    assert_array_equal(run["surge"], np.arange(COUNT))
    assert_array_equal(run["loads[1]"], -np.arange(COUNT))
    assert "units" not in run["surge"].attrs
    assert "remark" not in run


def test_topics(tmp_path):
    path = save(tmp_path, mru=imu, load=lambda i: message("std_msgs/msg/Float64")(), note=text)
    with request_error(
        r"several topics, each with times of its own: '/load' \(std_msgs/msg/Float64, 100 "
        r"messages\), '/mru' .*State which one with group = 'NAME' in .*--group NAME"
    ):
        read_table(path)
    assert list(read_table(path, FileSettings(group="/load")).data_vars) == ["data"]
    with request_error(r"no topic '/lod'\. Did you mean '/load'\? Its topics"):
        read_table(path, FileSettings(group="/lod"))
    with data_error(r"the topic '/note' .* holds no numbers"):
        read_table(path, FileSettings(group="/note"))


def test_headers_that_are_not_stamped(tmp_path):
    path = save(tmp_path, mru=lambda i: imu(i, stamped=False))
    with warned("the headers of the topic '/mru' are not stamped"):
        run = read_table(path)
    assert_near(run["time"], T, 1e-12)
    path = save(tmp_path / "some", rig=lambda i: rig(i, stamped=i > 4))
    with data_error("5 of 100 messages of the topic '/rig' have no stamp"):
        read_table(path)


def test_the_checksum_of_a_bag_follows_its_files(tmp_path):
    path = save(tmp_path, mru=imu)
    before = checksum(path)
    assert checksum(path) == before
    file = next(path.glob("*.mcap"))
    file.write_bytes(file.read_bytes() + b"x")
    assert checksum(path) != before


def test_topics_of_one_bag_are_loggers_as_the_page_says(tmp_path):
    """A probe at 20 Hz, stamped 3 ms after the samples of an IMU at 50 Hz, whose angles turn."""
    sent = []
    for t in np.arange(0, 60, 0.02):
        made = message("sensor_msgs/msg/Imu")(
            header=header(instant := BEGIN + round(1e9 * t)),
            orientation=quaternion([0.7, 0.1 * np.sin(2 * t), 0.02]),
            angular_velocity=message("geometry_msgs/msg/Vector3")(y=0.2 * np.cos(2 * t)),
        )
        sent.append((instant, "/imu/data", made))
    for t in np.arange(0.003, 60, 0.05):
        made = message("geometry_msgs/msg/PointStamped")(
            header=header(instant := BEGIN + round(1e9 * t)),
            point=message("geometry_msgs/msg/Point")(z=0.3 * np.sin(2 * t + 1)),
        )
        sent.append((instant, "/radar/fwd", made))
    write_bag(tmp_path / "bag_one", sent)
    shown = page("howto/data.md").partition("```toml\n")[2].partition("```")[0]
    head = '[campaign]\nname = "Bag"\nencounter_period = 3.14\n\n[preparation]\ndt = 0.05\n\n'
    run = campaign_of(tmp_path, head + shown).prepare()["one"]
    inside = run.isel(time=slice(20, -20))  # filters reach over the ends
    t = inside["time"].values
    # Between samples it is interpolated; the stamps of the probe are its own.
    assert_near(inside["eta_fwd"], 0.3 * np.sin(2 * t + 1), 1e-3)
    assert_near(inside["pitch_rate"], 0.2 * np.cos(2 * t), 1e-3)
    assert_near(inside["pitch"], np.sin(0.1 * np.sin(2 * t)), 1e-4)
