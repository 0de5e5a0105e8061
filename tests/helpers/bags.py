"""Bags of ROS 2, by rosbags."""

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

STORE = get_typestore(Stores.ROS2_HUMBLE)


def message(kind):
    """Class of a message as ROS generates it: fields by keyword, with defaults."""
    zeros = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}

    def filled(field, given):
        node, content = field
        if node.name == "NAME":
            return message(content)() if given is None else given
        if node.name == "BASE":
            return zeros.get(content[0], 0) if given is None else given
        element, size = content
        is_float = element[1][0] == "float64"
        return np.array(given or [0.0] * size) if is_float else list(given or [])

    def made(**given):
        fields = STORE.fielddefs[kind][1]
        return STORE.types[kind](**{name: filled(each, given.get(name)) for name, each in fields})

    return made


def quaternion(angles):
    """Message of yaw, pitch and roll."""
    turned = Rotation.from_euler("ZYX", angles).as_quat().tolist()
    return message("geometry_msgs/msg/Quaternion")(**dict(zip("xyzw", turned, strict=True)))


def write_bag(path, sent, plugin=StoragePlugin.MCAP):
    """Write messages of any order, each with the instant of its reception in ns and its topic."""
    topics = {}
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        for received, topic, message in sorted(sent, key=lambda each: each[:2]):
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(topics[topic], received, STORE.serialize_cdr(message, kind))
    return path
