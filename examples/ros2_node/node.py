"""ROS 2 node: measured topics in, estimates and forecasts out. Edit CHANNELS for your vessel.

source /opt/ros/jazzy/setup.bash
python3 node.py --ros-args -p model:=model.nc -p run:=run.nc -p state:=live.nc
"""

from collections import Counter
from functools import partial
from math import asin, atan2, hypot, nan
from pathlib import Path

import numpy as np
import rclpy
import xarray as xr
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from follower import Follower
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from rclpy.time import Time
from rosidl_runtime_py.utilities import get_message
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

import seakeep
from seakeep.errors import DataError

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
# Inputs that are no waves: {"thrust": "known"} is forecast by the plan in ~/plan, "constant" stays.
ROLES = {}


class SeakeepNode(Node):
    """Publishes an estimate at every step of the model, a forecast and its validity each second."""

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
        start = partial(model.live, like=run, roles=ROLES)
        self.follower = Follower(start, self.saved(model), patience=self.value("patience"))
        self.lead = model.signature.lead_samples
        self.horizon, self.reported = max(round(self.value("horizon") / model.dt), 1), Counter()
        for channel in [*model.inputs, *model.states]:
            topic, kind, field, factor = CHANNELS[channel]
            self.create_subscription(
                get_message(kind),
                topic,
                partial(self.receive, channel, field.split("."), factor),
                qos_profile_sensor_data,
            )
        self.known = [name for name, role in ROLES.items() if role == "known"]
        self.planned = {}  # of known inputs: instants and values
        self.create_subscription(JointTrajectory, "~/plan", self.receive_plan, 10)
        self.estimates, self.forecasts = (
            [self.create_publisher(kind, name + of, 10) for of in ("", "_std")]
            for kind, name in ((JointState, "~/estimate"), (JointTrajectory, "~/forecast"))
        )
        self.diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(model.dt, self.estimate)
        self.create_timer(1.0, self.forecast)
        self.create_timer(10.0, self.report)

    def value(self, parameter):
        return self.get_parameter(parameter).value

    def now(self):
        return 1e-9 * self.get_clock().now().nanoseconds

    def saved(self, model):
        """State to go on from, if there is one; a damaged file is put aside."""
        try:
            return seakeep.load_live(model, self.file) if self.file and self.file.exists() else None
        except DataError as error:
            aside = self.file.replace(self.file.with_suffix(".damaged"))
            self.get_logger().warning(f"starting anew; the state is kept as {aside}: {error}")
            return None

    def receive(self, channel, fields, factor, message):
        stamp, value = seconds(message.header.stamp), factor * read(message, fields)
        self.follower.receive(channel, stamp, value, self.now())

    def estimate(self):
        for instant, *numbers in self.follower.advance(self.now()):
            for publisher, values in zip(self.estimates, numbers, strict=True):
                message = JointState(name=self.follower.states, position=values.tolist())
                message.header.stamp = Time(seconds=instant).to_msg()
                publisher.publish(message)

    def receive_plan(self, message):
        """Take a plan; one without a stamp begins now."""
        start = seconds(message.header.stamp) or self.now()
        at = [start + seconds(point.time_from_start) for point in message.points]
        rows = np.transpose([point.positions for point in message.points])
        self.planned = dict(zip(message.joint_names, ((at, row) for row in rows), strict=False))

    def forecast(self):
        live = self.follower.live
        if not live.ready:
            return
        instants = live.time + self.follower.dt * np.arange(1, self.horizon + self.lead)
        plan = {
            name: np.interp(instants, *self.planned[name])  # its last value holds on
            for name in self.known
            if name in self.planned
        }
        if len(plan) < len(self.known):
            self.diagnose(f"no forecast: ~/plan must give {', '.join(self.known)}")
        else:
            found = live.forecast(self.horizon, plan)
            self.diagnose(found.attrs["validity"])
            for publisher, statistic in zip(self.forecasts, ("mean", "std"), strict=True):
                publisher.publish(self.trajectory(found.sel(statistic=statistic)))
        if self.file is not None:
            live.save(self.file)

    def trajectory(self, found):
        """One statistic of a forecast as a message."""
        names = self.follower.states
        message = JointTrajectory(joint_names=names)
        message.header.stamp = Time(seconds=self.follower.live.time).to_msg()
        for number, row in enumerate(found[names].to_array().values.T, 1):
            after = Duration(seconds=number * self.follower.dt).to_msg()
            point = JointTrajectoryPoint(positions=row.tolist(), time_from_start=after)
            message.points.append(point)
        return message

    def diagnose(self, words):
        """Publish whether forecasts hold, and the consistency of each state in free runs."""
        level = DiagnosticStatus.OK if words == "inside" else DiagnosticStatus.WARN
        rows = zip(self.follower.states, self.follower.live.consistency_by_state[1], strict=True)
        values = [KeyValue(key=f"consistency of {name}", value=f"{row:.3g}") for name, row in rows]
        status = DiagnosticStatus(level=level, name="seakeep", message=words, values=values)
        message = DiagnosticArray(status=[status])
        message.header.stamp = Time(seconds=self.follower.live.time).to_msg()
        self.diagnostics.publish(message)

    def report(self):
        lost = self.follower.lost - self.reported
        self.reported = self.follower.lost.copy()
        words = [f"{channel} {why}: {count}" for (channel, why), count in sorted(lost.items())]
        if words:
            self.get_logger().warning(f"lost in the last 10 s: {', '.join(words)}")


def seconds(stamp):
    """Time or duration of a message in seconds."""
    return stamp.sec + 1e-9 * stamp.nanosec


def read(message, fields):
    """Number in a message, NaN where it says that there is none.

    It says so by a covariance that starts with -1, or a quaternion that is not of length 1.
    """
    for field in fields:
        if getattr(message, f"{field}_covariance", [0.0])[0] == -1:
            return nan
        if field in ANGLES:
            size = hypot(message.w, message.x, message.y, message.z)
            return ANGLES[field](message) if abs(size - 1) < 0.01 else nan
        message = getattr(message, field)
    return message


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
