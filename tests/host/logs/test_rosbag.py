# SPDX-License-Identifier: MIT
"""ROS bags as logs: joint states of the wheels, and a topic of poses as truth."""

from __future__ import annotations

import errno
from collections.abc import Mapping
from pathlib import Path
from typing import IO, Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import omniwheel
from omni_schema import Robot
from omniwheel.errors import LogError
from omniwheel.log_sources import open_log
from omniwheel.logs.importer import import_log
from omniwheel.logs.mapping import read_mapping
from omniwheel.logs.rosbag import is_bag

TYPES = get_typestore(Stores.ROS2_HUMBLE)
ROWS = 200
PERIOD_S = 0.02
START_NS = 1_780_000_000_000_000_000
JOINTS = ("front", "left", "right")
MAPPING = """
[log]
name = "bag"
period_s = 0.02
[bag]
wheels = "/joint_states"
truth = "/mocap"
[wheels]
columns = ["left", "front", "right"]
quantity = "counts"
unit = "rad"
sign = [1, -1, 1]
scale = [1.0, 1.0, 0.5]
counts_per_revolution = 1000
"""


def stamp(time_s: float, *, stamped: bool) -> Any:
    time_ns = START_NS + round(1e9 * time_s) if stamped else 0
    time = TYPES.types["builtin_interfaces/msg/Time"](sec=time_ns // 10**9, nanosec=time_ns % 10**9)
    return TYPES.types["std_msgs/msg/Header"](stamp=time, frame_id="map")


def pose_message(
    kind: str, time_s: float, place: tuple[float, float], theta: float, *, stamped: bool, length: float = 1.0
) -> Any:
    types = TYPES.types
    header = stamp(time_s, stamped=stamped)
    turn = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, length * np.sin(0.5 * theta), length * np.cos(0.5 * theta))
    if kind == "geometry_msgs/msg/TransformStamped":
        moved = types["geometry_msgs/msg/Transform"](types["geometry_msgs/msg/Vector3"](*place, 0.1), turn)
        return types[kind](header, "robot", moved)
    pose = types["geometry_msgs/msg/Pose"](types["geometry_msgs/msg/Point"](*place, 0.1), turn)
    if kind == "geometry_msgs/msg/PoseStamped":
        return types[kind](header, pose)
    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    twist = types["geometry_msgs/msg/TwistWithCovariance"](types["geometry_msgs/msg/Twist"](zero, zero), np.zeros(36))
    return types[kind](header, "robot", types["geometry_msgs/msg/PoseWithCovariance"](pose, np.zeros(36)), twist)


def angles(time_s: Any) -> Any:
    """Angles (n, 3) [rad] of the joints, in the order of JOINTS."""
    return np.column_stack((np.sin(time_s), 2.0 * time_s, 4.0 * np.cos(time_s)))


def write_bag(
    folder: Path,
    kind: str = "nav_msgs/msg/Odometry",
    *,
    stamped: bool = True,
    mcap: bool = False,
    velocity_only: bool = False,
    lengths: Mapping[int, float] | None = None,
) -> Path:
    """Write wheels and poses; every other joint state is of an arm, which has joints of its own.

    ``lengths`` are those of the quaternions in some rows; the others have length 1.
    """
    storage = StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    with Writer(folder, version=9, storage_plugin=storage) as bag:
        wheels = bag.add_connection("/joint_states", "sensor_msgs/msg/JointState", typestore=TYPES)
        mocap = bag.add_connection("/mocap", kind, typestore=TYPES)
        for row, turned in enumerate(angles(PERIOD_S * np.arange(ROWS))):
            time_s = PERIOD_S * row
            now = START_NS + round(1e9 * time_s) + 3_000_000
            for names, values in ((JOINTS, turned), (("elbow",), np.array([0.3]))):
                position, speed = (np.zeros(0), values) if velocity_only else (values, np.zeros(0))
                state = TYPES.types["sensor_msgs/msg/JointState"](
                    stamp(time_s, stamped=stamped), list(names), position, speed, np.zeros(0)
                )
                bag.write(wheels, now, TYPES.serialize_cdr(state, state.__msgtype__))
            length = (lengths or {}).get(row, 1.0)
            place = (0.1 * time_s, -0.2)
            pose = pose_message(kind, time_s + 0.5, place, 2.0 * time_s, stamped=stamped, length=length)
            bag.write(mocap, now, TYPES.serialize_cdr(pose, kind))
    return folder


def mapping(tmp_path: Path, old: str = "", new: str = "") -> Path:
    assert old in MAPPING
    path = tmp_path / "mapping.toml"
    path.write_text(MAPPING.replace(old, new) if old else MAPPING, encoding="utf-8")
    return path


@pytest.mark.parametrize("mcap", [False, True])
@pytest.mark.parametrize(
    "kind", ["nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/TransformStamped"]
)
def test_wheels_and_poses_come_back(tmp_path: Path, robot: Robot, kind: str, mcap: bool) -> None:
    log = open_log(write_bag(tmp_path / "bag", kind, mcap=mcap), robot, mapping(tmp_path))
    time = PERIOD_S * np.arange(ROWS)
    turned = angles(time)[:, [1, 0, 2]] * [1.0, -1.0, 0.5]
    assert np.allclose(log.time_s, time, atol=1e-6)
    assert np.allclose(np.cumsum(log.counts, axis=0) * log.rad_per_count, turned - turned[0], atol=1e-9)
    assert log.truth is not None
    assert np.allclose(log.truth.time_s, time + 0.5, atol=1e-6)
    assert np.allclose(log.truth.xy, np.column_stack((0.1 * time, np.full(ROWS, -0.2))))
    assert np.allclose(log.truth.theta, 2.0 * time)


def test_poses_that_are_not_finite_are_left_out_and_counted(tmp_path: Path) -> None:
    unseen = [40, 41, 42, 120]
    bag = write_bag(tmp_path / "bag", lengths=dict.fromkeys(unseen, np.nan))
    log, summary = import_log(bag, read_mapping(mapping(tmp_path)))
    time = PERIOD_S * np.setdiff1d(np.arange(ROWS), unseen)
    assert summary.truth_dropped_rows == len(unseen)
    assert log.truth is not None
    assert np.allclose(log.truth.time_s, time + 0.5, atol=1e-6)
    assert np.allclose(log.truth.theta, 2.0 * time)


@pytest.mark.parametrize(
    "lengths",
    [
        dict.fromkeys(range(50, 100), np.nan),
        dict.fromkeys(range(ROWS), np.nan),
        {7: 0.0},
        {7: 1.5},
        dict.fromkeys(range(ROWS), 0.9),
    ],
    ids=["a quarter not finite", "none finite", "one without orientation", "one too long", "all too short"],
)
def test_poses_that_are_none_are_refused(tmp_path: Path, lengths: dict[int, float]) -> None:
    bag = write_bag(tmp_path / "bag", lengths=lengths)
    with pytest.raises(LogError) as caught:
        import_log(bag, read_mapping(mapping(tmp_path)))
    assert "/mocap" in str(caught.value)


def test_quaternions_are_normalised_within_the_tolerance(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", lengths=dict.fromkeys(range(ROWS), 1.004))
    log, _ = import_log(bag, read_mapping(mapping(tmp_path)))
    assert log.truth is not None
    assert np.allclose(log.truth.theta, 2.0 * PERIOD_S * np.arange(ROWS))


def test_a_bag_is_loaded_as_a_run_by_a_mapping(tmp_path: Path) -> None:
    run = omniwheel.load(write_bag(tmp_path / "bag"), mapping=mapping(tmp_path))
    assert run.name == "bag"
    assert np.allclose(run.wheel_time_s, PERIOD_S * np.arange(ROWS), atol=1e-6)


def test_a_file_that_cannot_be_opened_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "bag.mcap"
    path.write_bytes(b"")

    def refuse(*_: object) -> IO[bytes]:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(LogError) as caught:
        is_bag(path)
    assert str(path) in str(caught.value)


def test_the_time_of_recording_stands_in_for_missing_stamps(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", stamped=False)
    with pytest.raises(LogError) as caught:
        import_log(bag, read_mapping(mapping(tmp_path)))
    assert "received" in caught.value.hint
    columns = read_mapping(mapping(tmp_path, '"/mocap"', '"/mocap"\nclock = "received"'))
    assert np.allclose(import_log(bag, columns)[0].time_s, PERIOD_S * np.arange(ROWS), atol=1e-6)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('"/joint_states"', '"/joint_state"', "/joint_states"),
        ('"/joint_states"', '"/mocap"', "JointState"),
        ('"/mocap"', '"/joint_states"', "Odometry"),
        ('["left"', '["lift"', "left"),
        ('quantity = "counts"\nunit = "rad"', 'quantity = "speed"\nunit = "rad/s"', "velocit"),
    ],
)
def test_what_the_bag_does_not_have_is_named(tmp_path: Path, old: str, new: str, named: str) -> None:
    bag = write_bag(tmp_path / "bag")
    with pytest.raises(LogError) as caught:
        import_log(bag, read_mapping(mapping(tmp_path, old, new)))
    assert named in f"{caught.value} {caught.value.hint}"


def test_velocities_without_positions_are_named(tmp_path: Path) -> None:
    bag = write_bag(tmp_path / "bag", velocity_only=True)
    with pytest.raises(LogError) as caught:
        import_log(bag, read_mapping(mapping(tmp_path)))
    assert "position" in str(caught.value)


def test_a_damaged_bag_and_a_mapping_of_another_kind_are_refused(tmp_path: Path, robot: Robot, files: Path) -> None:
    bag = write_bag(tmp_path / "bag")
    for path in bag.glob("*.db3"):
        path.write_bytes(path.read_bytes()[:2000])
    for log, columns in (
        (bag, mapping(tmp_path)),
        (files / "run1.csv", mapping(tmp_path)),
        (bag, files / "mapping.toml"),
    ):
        with pytest.raises(LogError) as caught:
            open_log(log, robot, columns)
        assert str(log) in str(caught.value)
    with pytest.raises(LogError):
        open_log(bag, robot)


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ('"/mocap"', '"/mocap"\nclock = "sim"', "clock"),
        ("scale = [1.0, 1.0, 0.5]", "scale = [1.0, 1.0]", "scale"),
        ("scale = [1.0, 1.0, 0.5]", "scale = [1.0, 1.0, -0.5]", "scale"),
        ('unit = "rad"', 'unit = "rpm"', "unit"),
        ('quantity = "counts"', 'quantity = "increment"', "quantity"),
        ("period_s = 0.02", 'period_s = 0.02\ntime = {column = "t"}', "time"),
        ("[wheels]", '[heading]\ncolumn = "yaw"\n[wheels]', "heading"),
    ],
)
def test_wrong_keys_are_named(tmp_path: Path, old: str, new: str, key: str) -> None:
    with pytest.raises(LogError) as caught:
        read_mapping(mapping(tmp_path, old, new))
    assert key in str(caught.value)
