# SPDX-License-Identifier: MIT
"""Commands, arming, stops and set-points, in lockstep."""

from __future__ import annotations

import math
import struct
import zlib
from typing import Any

import pytest

from tests.firmware.client import ALL_WHEELS, Client, mav

ARM = mav.MAV_CMD_COMPONENT_ARM_DISARM
DISARMED, ARMED, FAILSAFE, ESTOP = 1, 2, 3, 4
BODY_FRD = 12
LOCAL_NED = 1
VELOCITY_ONLY = 0b0101_1100_0111  # everything but vx, vy, vz and the yaw rate is ignored
POSITION_YAW = 0b1001_1111_1000


def send_velocity(robot: Client, vx: float, vy: float, yaw_rate: float, frame: int = BODY_FRD) -> None:
    robot.mav.set_position_target_local_ned_send(
        0, 1, 1, frame, VELOCITY_ONLY, 0, 0, 0, vx, vy, 0, 0, 0, 0, 0, yaw_rate
    )


def send_pose(robot: Client, x: float, y: float, yaw: float) -> None:
    robot.mav.set_position_target_local_ned_send(0, 1, 1, LOCAL_NED, POSITION_YAW, x, y, 0, 0, 0, 0, 0, 0, 0, yaw, 0)


def wheels(tick: Any) -> list[float]:
    return list(tick.actuators.wheel_reference[:3])


def receipt(form: str, *params: float) -> int:
    """CRC-32 of a command's seven parameters, as a signed number."""
    (signed,) = struct.unpack("<i", struct.pack("<I", zlib.crc32(struct.pack(form, *params))))
    return int(signed)


def test_a_numbered_command_gets_a_receipt_of_what_was_asked(robot: Client) -> None:
    """Arm and disarm are one command; their answers must differ, and those to two of a kind, too."""
    receipts = set()
    for number, wanted in enumerate((1.0, 0.0, 1.0, 0.0), start=1):
        params = (wanted, 0.0, 0.0, 0.0, float(number), 0.0, 0.0)
        robot.mav.command_long_send(1, 1, ARM, 0, *params)
        ack = robot.wait("COMMAND_ACK", command=ARM)
        assert ack.result_param2 == receipt("<7f", *params)
        receipts.add(ack.result_param2)
    assert len(receipts) == 4
    robot.mav.command_int_send(1, 1, 0, ARM, 0, 0, 0.0, 0.0, 0.0, 0.0, 7, -2, 0.5)
    assert robot.wait("COMMAND_ACK", command=ARM).result_param2 == receipt("<4f2if", 0.0, 0.0, 0.0, 0.0, 7, -2, 0.5)


def test_a_command_without_a_number_gets_no_receipt(robot: Client) -> None:
    robot.mav.command_long_send(1, 1, ARM, 0, 0, 0, 0, 0, 0, 3, 4)
    assert robot.wait("COMMAND_ACK", command=ARM).result_param2 == 0
    robot.mav.command_int_send(1, 1, 0, ARM, 0, 0, 0, 0, 0, 0, 0, 1, 1)
    assert robot.wait("COMMAND_ACK", command=ARM).result_param2 == 0


def test_unknown_commands_are_unsupported_and_every_command_is_answered(robot: Client) -> None:
    assert robot.command(31000) == mav.MAV_RESULT_UNSUPPORTED
    robot.mav.command_int_send(1, 1, 0, 22, 0, 0, 0, 0, 0, 0, 0, 0, 0)
    assert robot.wait("COMMAND_ACK", command=22).result == mav.MAV_RESULT_UNSUPPORTED


def test_commands_for_another_system_are_not_answered(robot: Client) -> None:
    robot.mav.command_long_send(9, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
    robot.mav.command_long_send(1, 1, 31000, 0, 0, 0, 0, 0, 0, 0, 0)
    assert robot.wait("COMMAND_ACK").command == 31000


def test_arming_needs_a_tick_and_a_healthy_driver(robot: Client) -> None:
    assert robot.command(ARM, 1) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    assert any("no sensor readings yet" in text for text in robot.texts())
    robot.tick()
    assert robot.command(ARM, 1) == mav.MAV_RESULT_TEMPORARILY_REJECTED
    assert any("starting up" in text for text in robot.texts())
    robot.ticks(20, nack=True)
    assert robot.command(ARM, 1) == mav.MAV_RESULT_DENIED
    assert any(text.startswith("cannot arm: ") and "driver" in text for text in robot.texts())
    robot.armed()


def test_arming_with_a_dead_encoder_names_it(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(100, valid=ALL_WHEELS & ~1)
    assert robot.command(ARM, 1) == mav.MAV_RESULT_DENIED
    assert any("encoder" in text for text in robot.texts())


def test_disarming_always_works(robot: Client) -> None:
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    robot.armed()
    assert robot.command(ARM, 0, 21196) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == DISARMED


def test_emergency_stop_is_latched_until_released(robot: Client) -> None:
    robot.armed()
    assert robot.command(mav.MAV_CMD_OMNI_ESTOP, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ESTOP
    assert all(robot.channel(c) == 0 for c in (2, 3, 8, 9, 13, 14))
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ESTOP
    assert robot.command(ARM, 1) == mav.MAV_RESULT_DENIED
    assert robot.command(mav.MAV_CMD_OMNI_ESTOP, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == DISARMED
    assert robot.command(mav.MAV_CMD_DO_FLIGHTTERMINATION, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.state == ESTOP


def test_silence_of_the_ground_station_stops_the_motors(robot: Client) -> None:
    robot.armed()
    ticks = robot.ticks(3200)
    assert ticks[2000].actuators.state == ARMED
    assert ticks[-1].actuators.state == FAILSAFE
    texts = [m.text for t in ticks for m in t.others if m.get_type() == "STATUSTEXT"]
    assert "failsafe: link loss" in texts
    assert all(robot.channel(c) == 0 for c in (2, 3, 8, 9, 13, 14))


def test_set_points_that_stop_coming_stop_the_motors(robot: Client) -> None:
    robot.armed()
    send_velocity(robot, 0.05, 0, 0)
    ticks = robot.ticks(600)
    assert ticks[300].actuators.state == ARMED
    assert ticks[-1].actuators.state == FAILSAFE


def test_body_velocity_drives_the_wheels_in_our_frame(robot: Client) -> None:
    robot.armed()
    send_velocity(robot, 0, 0, -0.2)  # FRD: counter-clockwise
    assert all(w > 0 for w in wheels(robot.ticks(300)[-1]))


def test_manual_control_turns_right_with_the_stick(robot: Client) -> None:
    robot.armed()
    robot.mav.manual_control_send(1, 0, 0, 0, 200, 0)
    assert all(w < 0 for w in wheels(robot.ticks(300)[-1]))


def test_a_pose_set_point_is_approached(robot: Client) -> None:
    robot.armed()
    send_pose(robot, 0.1, -0.2, 0.3)
    robot.ticks(200)
    reference = robot.tick().actuators.reference
    assert 0 < reference[0] <= 0.1
    assert 0 < reference[1] <= 0.2  # East is our -y
    assert -0.3 <= reference[2] < 0


def test_duties_reach_the_bridges_while_they_are_fresh(robot: Client) -> None:
    robot.armed()
    robot.mav.omni_setpoint_duty_send(1, 1, [0.5, -0.25, 0.0, 0.0])
    robot.ticks(20)
    assert robot.channel(9) - robot.channel(8) == pytest.approx(0.5 * 4096, abs=2)
    assert robot.channel(13) - robot.channel(14) == pytest.approx(-0.25 * 4096, abs=2)
    assert robot.channel(3) == robot.channel(2)
    robot.tick(step_us=1000)
    assert robot.ticks(600)[-1].actuators.state == FAILSAFE


@pytest.mark.parametrize("duty", [1.01, -math.inf, math.nan])
def test_a_duty_that_cannot_be_is_refused(robot: Client, duty: float) -> None:
    robot.armed()
    robot.mav.omni_setpoint_duty_send(1, 1, [0.1, duty, 0.0, 0.0])
    ticks = robot.ticks(50)
    assert ["duty beyond" in m.text for t in ticks for m in t.others if m.get_type() == "STATUSTEXT"] == [True]
    assert robot.channel(9) == robot.channel(8)


def test_duties_for_a_robot_that_is_not_armed_are_refused_and_do_not_wait_for_arming(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(20)
    robot.mav.omni_setpoint_duty_send(1, 1, [0.5, 0.5, 0.5, 0.0])
    ticks = robot.ticks(5)
    assert any("armed" in m.text for t in ticks for m in t.others if m.get_type() == "STATUSTEXT")
    robot.armed()
    robot.ticks(20)
    assert robot.channel(9) == robot.channel(8)


def test_what_is_locked_while_armed_is_locked_from_the_accepted_command_on(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(20)
    radius = robot.get("WHEEL_RADIUS")
    assert robot.command(ARM, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.set("WHEEL_RADIUS", 0.06) == radius
    assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.set("WHEEL_RADIUS", 0.06) == pytest.approx(0.06)


def test_a_sample_holds_what_identification_needs(robot: Client) -> None:
    sample = mav.MAVLINK_MSG_ID_OMNI_SAMPLE
    robot.armed()
    assert not [m for t in robot.ticks(200) for m in t.others if m.id == sample]
    assert robot.command(mav.MAV_CMD_SET_MESSAGE_INTERVAL, sample, 20000) == mav.MAV_RESULT_ACCEPTED
    robot.mav.omni_setpoint_duty_send(1, 1, [0.5, -0.25, 0.0, 0.0])
    got = [m for n in range(200) for m in robot.tick(counts=[3 * n, -n, 0, 0], battery_v=10.0).others if m.id == sample]
    assert len(got) in (10, 11)
    assert got[-1].supply == 10.0
    last, before = got[-1], got[-2]
    assert last.time_us - before.time_us == 20000
    assert [a - b for a, b in zip(last.counts, before.counts, strict=True)] == [60, -20, 0, 0]
    moved = [a - b for a, b in zip(last.volt_seconds, before.volt_seconds, strict=True)]
    assert moved == pytest.approx([0.5 * 10.0 * 20000, -0.25 * 10.0 * 20000, 0, 0], abs=20)


@pytest.mark.parametrize(
    ("velocity", "why"),
    [
        ((math.nan, 0, 0), "not finite"),
        ((0, math.inf, 0), "not finite"),
        ((99.0, 0, 0), "LIM_V"),
        ((0, 0, 99.0), "LIM_W"),
    ],
)
def test_a_bad_set_point_is_refused_and_moves_nothing(
    robot: Client, velocity: tuple[float, float, float], why: str
) -> None:
    robot.armed()
    send_velocity(robot, *velocity)
    ticks = robot.ticks(100)
    texts = [m.text for t in ticks for m in t.others if m.get_type() == "STATUSTEXT"]
    assert [why in text for text in texts] == [True]
    assert ticks[-1].actuators.faults & (1 << 18)
    assert wheels(ticks[-1]) == pytest.approx([0, 0, 0], abs=1e-6)


def test_refusals_are_said_once_a_second(robot: Client) -> None:
    robot.armed()
    texts = []
    for _ in range(1500):
        send_pose(robot, math.nan, 0, 0)
        texts += [m.text for m in robot.tick().others if m.get_type() == "STATUSTEXT"]
    assert 1 <= sum("setpoint refused" in text for text in texts) <= 2


def test_a_trajectory_asked_for_while_disarmed_starts_with_arming(robot: Client) -> None:
    robot.heartbeat()
    robot.ticks(20)
    assert robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, -1, -1) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.phase == 0
    robot.armed()
    assert robot.tick().actuators.phase in (1, 2)
    assert robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_STOP) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.phase == 0
    robot.command(ARM, 0)
    robot.tick()
    robot.armed()
    assert robot.tick().actuators.phase == 0


def test_waypoints_have_no_gaps(robot: Client) -> None:
    waypoint = mav.MAV_CMD_OMNI_WAYPOINT
    start = mav.MAV_CMD_OMNI_TRAJECTORY_START
    robot.armed()
    assert robot.command(start, 1, -1) == mav.MAV_RESULT_DENIED
    assert robot.command(waypoint, 0, 0, 0, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.command(waypoint, 2, 1, 0, 0) == mav.MAV_RESULT_DENIED
    assert robot.command(waypoint, 1, math.nan, 0, 0) == mav.MAV_RESULT_DENIED
    assert robot.command(waypoint, 1, 0.2, 0, 0) == mav.MAV_RESULT_ACCEPTED
    assert robot.command(start, 1, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.tick().actuators.phase in (1, 2)


def test_the_pose_estimate_is_set_while_disarmed_only(robot: Client) -> None:
    set_pose = mav.MAV_CMD_OMNI_SET_POSE
    robot.ticks(5)
    assert robot.command(set_pose, 0.5, -0.25, 1.0) == mav.MAV_RESULT_ACCEPTED
    assert list(robot.tick().actuators.pose) == pytest.approx([0.5, -0.25, 1.0], abs=1e-5)
    assert robot.command(set_pose, math.nan, 0, 0) == mav.MAV_RESULT_DENIED
    assert robot.armed().command(set_pose, 0, 0, 0) == mav.MAV_RESULT_DENIED


def test_a_vicon_fix_pulls_the_estimate_towards_it(robot: Client) -> None:
    robot.ticks(100)
    robot.mav.vicon_position_estimate_send(robot.time_us, 0.004, -0.003, 0, 0, 0, -0.002)
    pose = robot.ticks(2)[-1].actuators.pose
    assert 0 < pose[0] < 0.004
    assert 0 < pose[1] < 0.003
    assert 0 < pose[2] < 0.002


@pytest.mark.full
@pytest.mark.parametrize("disarmed", [False, True])
def test_a_path_that_waits_for_arming_is_forgotten_if_somebody_disarms(robot: Client, disarmed: bool) -> None:
    robot.heartbeat()
    robot.ticks(20)
    assert robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 4, 1) == mav.MAV_RESULT_ACCEPTED
    if disarmed:
        assert robot.command(ARM, 0) == mav.MAV_RESULT_ACCEPTED
    robot.armed()
    drives = any(w for tick in robot.ticks(800) for w in tick.actuators.wheel_reference)
    assert drives == (not disarmed)
