# SPDX-License-Identifier: MIT
"""ROS bags through the library ``rosbags`` (the extra ``rosbag``): joint states as wheels, a pose topic as truth.

Reads rosbag2 (a folder, or an .mcap file) and ROS 1 bags (.bag). No ROS installation is needed.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omni_schema.errors import did_you_mean
from omniwheel.errors import LogError
from omniwheel.logs.log import Array
from omniwheel.quaternion import find_wrong_length, heading

LIBRARY = "rosbags"
JOINTS = "sensor_msgs/msg/JointState"
POSES = {
    "nav_msgs/msg/Odometry": ("pose", "pose"),
    "geometry_msgs/msg/PoseWithCovarianceStamped": ("pose", "pose"),
    "geometry_msgs/msg/PoseStamped": ("pose",),
    "geometry_msgs/msg/TransformStamped": ("transform",),
}
"""Message types that are poses, and where in the message the pose is."""
MCAP_MAGIC = b"\x89MCAP0\r\n"
TOPICS_SHOWN = 20
HEADER, RECEIVED = "header", "received"
CLOCKS = (HEADER, RECEIVED)
MOST_DROPPED = 0.05
"""Share of the poses that may be left out because they are not finite: a tracker that now and then sees nothing."""


@dataclass(frozen=True)
class BagTopics:
    """Topics of the ``wheels`` (JointState) and the ``truth`` ("": none), and which ``clock`` gives the times.

    The clock is that of the messages' headers, or when the recorder received them.
    """

    wheels: str
    truth: str
    clock: str


@dataclass(frozen=True)
class BagPoses:
    """Poses of the truth topic: ``time_s`` (n,) [s], ``xy`` (n, 2) [m], ``theta`` (n,) [rad] unwrapped.

    Where a message had no pose, place and heading are NaN.
    """

    time_s: Array
    xy: Array
    theta: Array


def is_bag(path: Path) -> bool:
    """Say whether a path is a ROS bag: a folder with metadata.yaml, an .mcap file of ROS, or a .bag file.

    Raises LogError for an .mcap file that cannot be read.
    """
    if (path / "metadata.yaml").is_file():
        return True
    return path.is_file() and (path.suffix == ".bag" or (path.suffix == ".mcap" and _profile(path).startswith(b"ros")))


def _profile(path: Path) -> bytes:
    """Return the profile of an MCAP file, which its header begins with: ros1, ros2, or empty. Raises LogError."""
    try:
        with path.open("rb") as file:
            head = file.read(64)
    except OSError as error:
        raise LogError(f"{path} cannot be read: {error.strerror}") from error
    at = len(MCAP_MAGIC) + 1 + 8  # a record's opcode and length
    length = int.from_bytes(head[at : at + 4], "little")
    return head[at + 4 : at + 4 + length] if head.startswith(MCAP_MAGIC) else b""


def read_bag(
    path: Path, topics: BagTopics, joints: tuple[str, ...], field: str
) -> tuple[Array, Array, BagPoses | None]:
    """Return the times (n,) [s] of the joint states, their values (n, joints) and the truth; time 0 is the first row.

    ``field`` of the joint state is position or velocity. Raises LogError.
    """
    with _opened(path) as reader:
        wheels = _topic(path, reader, topics.wheels, (JOINTS,), "bag.wheels")
        stamps, values = _joint_rows(path, reader, wheels, topics, joints, field)
        poses = None
        if topics.truth:
            poses = _poses(
                path, reader, _topic(path, reader, topics.truth, tuple(POSES), "bag.truth"), topics, stamps[0]
            )
    return 1e-9 * (stamps - stamps[0]), values, poses


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a bag. Raises LogError where the library is missing, or the bag is damaged."""
    try:
        highlevel, typesys = (importlib.import_module(f"{LIBRARY}.{part}") for part in ("highlevel", "typesys"))
    except ImportError as error:
        hint = "pip install 'omniwheel[rosbag]'"
        raise LogError(
            f"{path} is a ROS bag, and the library {LIBRARY} is not usable here: {error}", hint=hint
        ) from error
    try:
        types = typesys.get_typestore(typesys.Stores.LATEST)
        with highlevel.AnyReader([path], default_typestore=types) as reader:
            yield reader
    except LogError:
        raise
    except Exception as error:  # the library passes on errors of SQLite, MCAP, YAML and its own
        raise LogError(f"{path} cannot be read as a ROS bag: {error}", hint="check it with: ros2 bag info") from error


def _topic(path: Path, reader: Any, name: str, types: tuple[str, ...], key: str) -> Any:
    """Return the connections of a topic with a message of one of these types. Raises LogError."""
    found = [each for each in reader.connections if each.topic == name]
    if not found:
        listed = sorted({f"{each.topic} ({each.msgtype})" for each in reader.connections})
        raise LogError(
            f"{path} has no topic {name!r}{did_you_mean(name, [each.topic for each in reader.connections])}",
            hint=f"correct {key} in the column mapping; topics: {', '.join(listed[:TOPICS_SHOWN])}",
        )
    wrong = [each.msgtype for each in found if each.msgtype not in types]
    if wrong:
        raise LogError(f"{path}: {name} is {wrong[0]}", hint=f"{key} must be a topic of {' or '.join(types)}")
    return found


def _joint_rows(
    path: Path, reader: Any, wheels: Any, topics: BagTopics, joints: tuple[str, ...], field: str
) -> tuple[Array, Array]:
    """Return stamps (n,) [ns] and values (n, joints) of the messages that have all joints. Raises LogError."""
    stamps, rows = [], []
    names: dict[str, None] = {}
    for message, received in _messages(reader, wheels):
        names.update(dict.fromkeys(message.name))
        numbers = dict(zip(message.name, getattr(message, field), strict=False))
        if all(joint in numbers for joint in joints):
            stamps.append(_stamp(path, topics, message, received))
            rows.append([float(numbers[joint]) for joint in joints])
    if not rows:
        missing = [joint for joint in joints if joint not in names]
        if missing:
            raise LogError(
                f"{path}: {topics.wheels} has no joint {missing[0]!r}{did_you_mean(missing[0], list(names))}",
                hint=f"correct wheels.columns in the column mapping; the joints are {', '.join(names) or 'missing'}",
            )
        raise LogError(
            f"{path}: no message of {topics.wheels} has a {field} of all wheels",
            hint="a quantity of speed needs velocities, counts need positions: correct wheels.quantity",
        )
    return np.array(stamps, dtype=np.int64), np.array(rows, dtype=np.float64)


def _poses(path: Path, reader: Any, truth: Any, topics: BagTopics, start_ns: int) -> BagPoses:
    """Return the poses of a topic in the order of their stamps.

    Raises LogError where a quaternion's length is not 1, or where many poses are not finite.
    """
    found = []
    for message, received in _messages(reader, truth):
        pose = message
        for name in POSES[truth[0].msgtype]:
            pose = getattr(pose, name)
        place = pose.translation if hasattr(pose, "translation") else pose.position
        turn = pose.rotation if hasattr(pose, "rotation") else pose.orientation
        time_s = 1e-9 * (_stamp(path, topics, message, received) - start_ns)
        found.append((time_s, place.x, place.y, turn.x, turn.y, turn.z, turn.w))
    if not found:
        raise LogError(f"{path}: {topics.truth} has no messages", hint="correct bag.truth in the column mapping")
    table = np.array(found, dtype=np.float64)
    table = table[np.argsort(table[:, 0], kind="stable")]
    known = np.all(np.isfinite(table), axis=1)
    if np.mean(~known) > MOST_DROPPED:
        raise LogError(
            f"{path}: {np.sum(~known)} of the {len(known)} poses of {topics.truth} are not finite",
            hint="record while the tracker sees the robot, or cut the bag to that time",
        )
    poses = np.full((len(table), 3), np.nan)
    poses[known, :2] = table[known, 1:3]
    poses[known, 2] = np.unwrap(_headings(path, topics.truth, table[known, 0], table[known, 3:]))
    return BagPoses(table[:, 0], poses[:, :2], poses[:, 2])


def _headings(path: Path, topic: str, time_s: Array, quaternions: Array) -> Array:
    """Return the headings (n,) [rad] of quaternions (n, 4) x y z w. Raises LogError where a length is not 1."""
    if (wrong := find_wrong_length(quaternions)) is not None:
        row, length = wrong
        raise LogError(
            f"{path}: a quaternion of {topic} at {time_s[row]:.3f} s has the length {length:.3g} instead of 1",
            hint="correct the program that publishes these poses: 0, 0, 0, 0 is no orientation",
        )
    return np.array([heading((w, x, y, z)) for x, y, z, w in quaternions])


def _messages(reader: Any, connections: Any) -> Iterator[tuple[Any, int]]:
    """Yield each message and when it was received [ns]."""
    for connection, received, raw in reader.messages(connections=connections):
        yield reader.deserialize(raw, connection.msgtype), received


def _stamp(path: Path, topics: BagTopics, message: Any, received: int) -> int:
    """Return the message's time [ns]. Raises LogError where its header has none."""
    if topics.clock == RECEIVED:
        return received
    stamp = int(message.header.stamp.sec) * 1_000_000_000 + int(message.header.stamp.nanosec)
    if stamp == 0:
        raise LogError(
            f"{path}: a header of {topics.wheels if hasattr(message, 'name') else topics.truth} has no time stamp",
            hint=f'use the time of recording: clock = "{RECEIVED}" under [bag] in the column mapping',
        )
    return stamp
