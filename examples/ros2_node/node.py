"""ROS 2 node: measured topics in, estimates and forecasts out. Edit CHANNELS for your vessel.

source /opt/ros/jazzy/setup.bash
python3 node.py --ros-args -p model:=model.nc -p run:=run.nc -p state:=live.nc
"""

from collections import Counter
from functools import partial, reduce
from math import asin, atan2
from pathlib import Path

import rclpy
import xarray as xr
from follower import Follower
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time
from rosidl_runtime_py.utilities import get_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import seakeep

ANGLES = {
    "roll": lambda q: atan2(2 * (q.w * q.x + q.y * q.z), 1 - 2 * (q.x**2 + q.y**2)),
    "pitch": lambda q: asin(max(-1.0, min(1.0, 2 * (q.w * q.y - q.z * q.x)))),
    "yaw": lambda q: atan2(2 * (q.w * q.z + q.x * q.y), 1 - 2 * (q.y**2 + q.z**2)),
}
"""Angles of a quaternion, rad: turns about z, then y, then x."""

# Channel of the model: topic, type of its messages, field, and factor to the unit of the model.
# An angle is a field of a quaternion.
CHANNELS = {
    "eta_fwd": ("/wave_probe/fwd", "geometry_msgs/msg/PointStamped", "point.z", 1.0),
    "eta_cog": ("/wave_probe/cog", "geometry_msgs/msg/PointStamped", "point.z", 1.0),
    "surge": ("/vessel/odometry", "nav_msgs/msg/Odometry", "pose.pose.position.x", 1.0),
    "heave": ("/vessel/odometry", "nav_msgs/msg/Odometry", "pose.pose.position.z", 1.0),
    "roll": ("/vessel/odometry", "nav_msgs/msg/Odometry", "pose.pose.orientation.roll", 1.0),
    "pitch": ("/vessel/odometry", "nav_msgs/msg/Odometry", "pose.pose.orientation.pitch", 1.0),
}


class SeakeepNode(Node):
    """Publishes `~/estimate` at every step of the model, and `~/forecast` once a second."""

    def __init__(self):
        super().__init__("seakeep")
        self.declare_parameter("model", "model.nc")
        self.declare_parameter("run", "")  # a prepared run of the rig: depth and probe positions
        self.declare_parameter("state", "")
        self.declare_parameter("horizon", 10.0)  # s
        self.declare_parameter("patience", 0.1)  # s
        model = seakeep.load_model(self.value("model"))
        run = xr.load_dataset(self.value("run")) if self.value("run") else None
        self.file = Path(self.value("state")) if self.value("state") else None
        live = None
        if self.file is not None and self.file.exists():
            live = seakeep.load_live(model, self.file)
        start = partial(model.live, like=run)
        self.follower = Follower(start, live, patience=self.value("patience"))
        self.horizon, self.reported = max(round(self.value("horizon") / model.dt), 1), Counter()
        for channel in [*model.inputs, *model.states]:
            topic, kind, field, factor = CHANNELS[channel]
            self.create_subscription(
                get_message(kind),
                topic,
                partial(self.receive, channel, field.split("."), factor),
                qos_profile_sensor_data,
            )
        self.estimates = self.create_publisher(JointState, "~/estimate", 10)
        self.forecasts = self.create_publisher(JointTrajectory, "~/forecast", 10)
        self.create_timer(model.dt, self.estimate)
        self.create_timer(1.0, self.forecast)
        self.create_timer(10.0, self.report)

    def value(self, parameter):
        return self.get_parameter(parameter).value

    def now(self):
        return 1e-9 * self.get_clock().now().nanoseconds

    def receive(self, channel, fields, factor, message):
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        self.follower.receive(channel, stamp, factor * reduce(read, fields, message), self.now())

    def estimate(self):
        for instant, state in self.follower.advance(self.now()):
            message = JointState(name=self.follower.states, position=state.tolist())
            message.header.stamp = Time(seconds=instant).to_msg()
            self.estimates.publish(message)

    def forecast(self):
        live = self.follower.live
        if not live.ready:
            return
        found = live.forecast(self.horizon).sel(statistic="mean")
        names = self.follower.states
        message = JointTrajectory(joint_names=names)
        message.header.stamp = Time(seconds=live.time).to_msg()
        for number, row in enumerate(found[names].to_array().values.T, 1):
            after = Duration(seconds=number * self.follower.dt).to_msg()
            point = JointTrajectoryPoint(positions=row.tolist(), time_from_start=after)
            message.points.append(point)
        self.forecasts.publish(message)
        if self.file is not None:
            live.save(self.file)

    def report(self):
        lost = self.follower.lost - self.reported
        self.reported = self.follower.lost.copy()
        words = [f"{channel} {why}: {count}" for (channel, why), count in sorted(lost.items())]
        if words:
            self.get_logger().warning(f"lost in the last 10 s: {', '.join(words)}")


def read(message, field):
    """Value of a field of a message, or an angle of a quaternion."""
    return ANGLES[field](message) if field in ANGLES else getattr(message, field)


def main():
    rclpy.init()
    node = SeakeepNode()
    try:
        rclpy.spin(node)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
