"""Tables in recordings of ROS 2: bags (a folder, or its file) and MCAP.

A topic is a table: one row per message, one column per number in it. Needs rosbags, the extra
``ros``; no installation of ROS.
"""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from seakeep.errors import DataError, RequestError, did_you_mean, needing, warn
from seakeep.formats.columns import UNITS, WHICH, Columns, Options, decoding

_STANDARD = ("sensor_msgs/", "geometry_msgs/", "nav_msgs/")
LARGEST_ARRAY = 64
"""Elements of an array field beyond which it is a picture or a cloud, not channels."""


def read_recording(path: Path, options: Options) -> Columns:
    """Read one topic of a ROS 2 bag (its folder or ``.db3`` file) or an MCAP file.

    A column per number, named by its place in the message: ``angular_velocity.y``, ``data[0]``.
    Units where the message is a standard one, whose units are fixed. ``time``: the header's stamps
    where the message has a header that is stamped, else the times of reception; ``receive_time``
    beside it in the first case. Both count seconds from the recording's first message, of
    any topic. `group` is the topic; it may be left out where only one holds numbers.
    """
    with needing(f"{path} is a recording of ROS 2; reading it", "ros"):
        from rosbags import highlevel, typesys
    beside = path.parent / "metadata.yaml"
    place = path.parent if path.suffix.lower() == ".db3" and beside.is_file() else path
    store = typesys.get_typestore(typesys.Stores.LATEST)
    with (
        decoding(
            path,
            "a recording of ROS 2: cut off, damaged or of another kind",
            "Copy it again; `ros2 bag reindex` repairs a bag that was not closed.",
        ),
        highlevel.AnyReader([place], default_typestore=store) as reader,
    ):
        return _read_topic(path, reader, options.group)


def _read_topic(path: Path, reader: Any, wanted: str | None) -> Columns:
    """Columns of a topic: times of reception, stamps of its headers, and its numbers."""
    connections = list(reader.connections)
    topics = {connection.topic for connection in connections}
    if wanted is not None and wanted not in topics:
        raise RequestError(
            f"{path} has no topic '{wanted}'.{did_you_mean(wanted, sorted(topics))} Its topics: "
            f"{', '.join(sorted(topics)) or 'none'}. Correct 'group' in [files]."
        )
    if wanted is None:
        wanted = _only_topic(path, reader, connections)
    chosen = [connection for connection in connections if connection.topic == wanted]
    received, stamps, numbers = [], [], []
    for connection, instant, raw in reader.messages(chosen):
        message = reader.deserialize(raw, connection.msgtype)
        received.append(instant)
        # Stamp of the header, ns; none where there is none or it was not stamped.
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        stamps.append((stamp and int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)) or None)
        numbers.append(dict(_flat(message, "")))
    announced = sum(connection.msgcount for connection in chosen)
    if len(received) < announced:
        raise DataError(
            f"{path} announces {announced} messages of the topic '{wanted}' and holds "
            f"{len(received)}: it was cut off. Copy it again; `ros2 bag reindex` repairs a bag "
            "that was not closed."
        )
    if not any(numbers):
        raise DataError(
            f"{path}: the topic '{wanted}' ({chosen[0].msgtype}, {len(received)} messages) holds "
            "no numbers. State another topic with group = 'NAME' in [files]."
        )
    held = Counter(name for row in numbers for name in row)
    values = {n: np.array([row[n] for row in numbers]) for n in held if held[n] == len(numbers)}
    faults = {
        name: f"{path}: '{name}' of the topic '{wanted}' is in {count} of {len(numbers)} messages, "
        "since the array varies in length. Map another column."
        for name, count in held.items()
        if name not in values
    }
    kind = chosen[0].msgtype
    # Subtracted as integers: a count of nanoseconds since 1970 has more digits than a float.
    times = {
        name: 1e-9 * np.array([instant - reader.start_time for instant in own], float)
        for name, own in _times(path, wanted, kind, received, stamps).items()
    }
    units = {name: unit for name in values if (unit := _unit(kind, name)) is not None}
    return Columns(times | values, units | dict.fromkeys(times, "s"), faults)


def _only_topic(path: Path, reader: Any, connections: list[Any]) -> str:
    """The one topic whose messages hold numbers; an error that lists them if there are more."""
    types = {}
    for connection in connections:
        kind = connection.msgtype
        first = next(iter(reader.messages([connection])), None)
        if first and next(_flat(reader.deserialize(first[2], kind), ""), None):
            types[connection.topic] = f"{kind}, {connection.msgcount}"
    if not types:
        topics = ", ".join(sorted({connection.topic for connection in connections})) or "none"
        raise DataError(f"{path} holds no messages with numbers (topics: {topics}). Record again.")
    if len(types) > 1:
        listed = ", ".join(f"'{topic}' ({what} messages)" for topic, what in sorted(types.items()))
        raise RequestError(
            f"{path} holds several topics, each with times of its own: {listed}. {WHICH}"
        )
    return next(iter(types))


def _flat(value: Any, name: str) -> Iterator[tuple[str, float]]:
    """Numbers of a message with their places in it; headers and covariances are left out."""
    if isinstance(value, bool | int | float | np.number | np.bool_):
        yield name, float(value)
    elif isinstance(value, np.ndarray):
        if value.dtype.kind in "fiub" and value.size <= LARGEST_ARRAY:
            for i, each in enumerate(value.ravel()):
                yield f"{name}[{i}]", float(each)
    elif hasattr(value, "__dataclass_fields__"):
        for field in value.__dataclass_fields__:
            if field in ("header", "__msgtype__") or "covariance" in field:
                continue
            yield from _flat(getattr(value, field), f"{name}.{field}" if name else field)


def _times(
    path: Path, topic: str, kind: str, received: list[int], headers: list[int | None]
) -> dict[str, list[int]]:
    """Instants (ns) of messages by the name of their column: as stamped, else as received."""
    stamps = [stamp for stamp in headers if stamp is not None]
    if len(stamps) == len(headers):
        return {"time": stamps, "receive_time": received}
    if stamps:
        raise DataError(
            f"{path}: {len(headers) - len(stamps)} of {len(headers)} messages of the topic "
            f"'{topic}' have no stamp in their header. Correct the node that publishes them."
        )
    if kind.endswith("Stamped") or kind.startswith("sensor_msgs/"):
        warn(
            f"{path}: the headers of the topic '{topic}' are not stamped; the times are those "
            "of reception, late by what the transport took."
        )
    return {"time": received}


def _unit(kind: str, name: str) -> str | None:
    """Unit of a field of a standard message; None where the message does not fix it."""
    if not kind.startswith(_STANDARD) or kind.endswith("JointState"):
        return None
    table = UNITS["ros"] | (UNITS["ros_accelerations"] if "Accel" in kind else {})
    return next((table[part] for part in reversed(name.split(".")) if part in table), None)
