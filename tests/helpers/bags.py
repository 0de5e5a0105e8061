"""Bags of ROS 2, by rosbags."""

from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)


def write_bag(path, sent, plugin=StoragePlugin.MCAP):
    """Write messages, each with the instant of its reception in ns and its topic."""
    topics = {}
    with Writer(path, version=9, storage_plugin=plugin) as writer:
        for received, topic, message in sent:
            kind = message.__msgtype__
            if topic not in topics:
                topics[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(topics[topic], received, STORE.serialize_cdr(message, kind))
    return path
