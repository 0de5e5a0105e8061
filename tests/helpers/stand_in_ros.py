"""Stand-in of rclpy: nodes under an executor whose clock is that of a bag, with real messages."""

import sys
from types import SimpleNamespace

from bags import STORE, message
from rosbags.rosbag2 import Reader

SECOND = 1_000_000_000  # ns


def instant(kind):
    """Class of a Time or Duration of rclpy."""

    def of(seconds):
        sec, nanosec = divmod(round(seconds * SECOND), SECOND)
        return SimpleNamespace(to_msg=lambda: message(kind)(sec=sec, nanosec=nanosec))

    return of


TIME = instant("builtin_interfaces/msg/Time")


class Node:
    """Node with simulated time, whose parameters are set before it is made."""

    given: dict = {}  # noqa: RUF012

    def __init__(self, name):
        self.parameters, self.subscriptions, self.timers = {}, [], []
        self.published, self.warnings, self.clock = {}, [], 0

    def declare_parameter(self, name, default):
        self.parameters[name] = self.given.get(name, default)

    def get_parameter(self, name):
        return SimpleNamespace(value=self.parameters[name])

    def create_subscription(self, kind, topic, callback, qos):
        self.subscriptions.append((topic, kind, callback))

    def create_publisher(self, kind, topic, depth):
        def publish(each):
            name = each.__msgtype__
            sent = STORE.deserialize_cdr(STORE.serialize_cdr(each, name), name)
            self.published.setdefault(topic, []).append(sent)

        return SimpleNamespace(publish=publish)

    def create_timer(self, period, callback):
        self.timers.append([None, round(period * SECOND), callback])

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=self.clock))

    def get_logger(self):
        return SimpleNamespace(warning=self.warnings.append)

    def play(self, bag):
        """Run timers and callbacks at the instants at which a bag's messages were received."""
        with Reader(bag) as reader:
            for connection, received, data in reader.messages():
                self._run_timers(received)
                for topic, kind, callback in self.subscriptions:
                    if topic == connection.topic:
                        assert kind == connection.msgtype
                        callback(STORE.deserialize_cdr(data, kind))

    def _run_timers(self, until):
        for timer in self.timers:
            timer[0] = timer[0] or until + timer[1]
        while (timer := min(self.timers, key=lambda each: each[0]))[0] <= until:
            self.clock = timer[0]
            timer[0] += timer[1]
            timer[2]()
        self.clock = until


def status(*, level, **given):
    """Message of a status; rclpy has its level, a byte, as bytes."""
    return message("diagnostic_msgs/msg/DiagnosticStatus")(level=ord(level), **given)


status.OK, status.WARN = b"\0", b"\1"


def install(monkeypatch):
    """Put the stand-in where `import rclpy` looks."""
    modules = {
        "diagnostic_msgs": {},
        "diagnostic_msgs.msg": {
            "DiagnosticArray": message("diagnostic_msgs/msg/DiagnosticArray"),
            "DiagnosticStatus": status,
            "KeyValue": message("diagnostic_msgs/msg/KeyValue"),
        },
        "rclpy": {},
        "rclpy.duration": {"Duration": instant("builtin_interfaces/msg/Duration")},
        "rclpy.node": {"Node": Node},
        "rclpy.qos": {"qos_profile_sensor_data": None},
        "rclpy.time": {"Time": TIME},
        "rosidl_runtime_py": {},
        "rosidl_runtime_py.utilities": {"get_message": lambda kind: kind},
        "sensor_msgs": {},
        "sensor_msgs.msg": {"JointState": message("sensor_msgs/msg/JointState")},
        "trajectory_msgs": {},
        "trajectory_msgs.msg": {
            name: message(f"trajectory_msgs/msg/{name}")
            for name in ("JointTrajectory", "JointTrajectoryPoint")
        },
    }
    for name, content in modules.items():
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**content))
