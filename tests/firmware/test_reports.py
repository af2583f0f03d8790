# SPDX-License-Identifier: MIT
"""The robot's messages say the same in each other's frames, and what MAVLink's definitions demand of them."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import pytest

from tests.firmware.client import mav
from tests.firmware.fake_robot import (
    ARM,
    EMERGENCY,
    HEARTBEAT,
    RADIO,
    USB,
    FakeRobot,
    command,
    duty,
    frame,
    velocity,
)
from tests.native import generated_dir

INT16_MAX, UINT16_MAX = 0x7FFF, 0xFFFF
START = command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 4.0, 1.0)
POSE = frame("set_position_target_local_ned", 0, 1, 1, 1, 0x9E0, 0.3, -0.2, 0, 0, 0, 0, 0, 0, 0, 0.6, 0)


@pytest.fixture
def robot() -> Iterator[FakeRobot]:
    one = FakeRobot()
    yield one
    one.close()


def driven(robot: FakeRobot, request: bytes, times: int = 60) -> None:
    for _ in range(times):
        robot.send(USB, HEARTBEAT, request)
        robot.tick(20)


def turned(vector: complex, angle: float) -> complex:
    return vector * complex(math.cos(angle), math.sin(angle))


@pytest.mark.parametrize("request_", [POSE, velocity(0.04, 0.02, 0.5)], ids=["pose", "velocity"])
def test_one_moment_in_all_frames(robot: FakeRobot, request_: bytes) -> None:
    """Ours is north, west, up: east and clockwise have the other sign, and the body's axes turn with the heading."""
    robot.armed()
    driven(robot, request_)
    names = ("OMNI_TRACKING", "POSITION_TARGET_LOCAL_NED", "LOCAL_POSITION_NED", "ATTITUDE", "ODOMETRY", "OMNI_SAMPLE")
    ours, target, local, attitude, odometry, sample = (robot.asked(name) for name in names)
    x, y, theta = ours.reference
    assert (target.x, target.y, target.yaw) == pytest.approx((x, -y, -theta))
    vx, vy, wz = ours.reference_rate
    assert min(abs(vx), abs(vy), abs(wz)) > 0.005
    assert (target.vx, target.vy, target.yaw_rate) == pytest.approx((vx, -vy, -wz))
    x, y, theta = ours.pose
    assert abs(theta) > 0.05
    assert (local.x, local.y, attitude.yaw) == pytest.approx((x, -y, -theta))
    assert (odometry.x, odometry.y) == (local.x, local.y)
    assert list(odometry.q) == pytest.approx(
        [math.cos(attitude.yaw / 2), 0.0, 0.0, math.sin(attitude.yaw / 2)], abs=1e-6
    )
    body = turned(complex(local.vx, local.vy), -attitude.yaw)
    assert abs(body) > 0.01
    assert (odometry.vx, odometry.vy) == pytest.approx((body.real, body.imag), abs=1e-6)
    assert odometry.yawspeed == attitude.yawspeed != 0.0
    assert math.copysign(1.0, attitude.yawspeed) == math.copysign(1.0, attitude.yaw)
    assert (local.vx, local.vy) == pytest.approx((target.vx, target.vy), abs=0.02)
    covariance = {place: value for place, value in enumerate(odometry.pose_covariance) if value != 0.0}
    sd_x, sd_y, sd_theta = ours.pose_sd
    assert abs(ours.pose_correlation) > 0.01
    xy = -ours.pose_correlation * sd_x * sd_y  # east is our -y
    assert covariance == {
        place: pytest.approx(m2) for place, m2 in zip((0, 1, 6, 20), (sd_x**2, xy, sd_y**2, sd_theta**2), strict=True)
    }
    assert math.isnan(odometry.velocity_covariance[0])
    assert (odometry.frame_id, odometry.child_frame_id) == (mav.MAV_FRAME_LOCAL_NED, mav.MAV_FRAME_BODY_FRD)
    assert list(sample.pose) == list(ours.pose)
    assert sample.supply == pytest.approx(12.0)
    assert odometry.time_usec // 1000 == ours.time_boot_ms == local.time_boot_ms == attitude.time_boot_ms


def test_a_trajectory_accelerates_as_its_speed_changes(robot: FakeRobot) -> None:
    robot.armed()
    assert robot.ask(USB, START) == mav.MAV_RESULT_ACCEPTED
    robot.tick(50)
    step_s = 0.001
    for _ in range(20):
        robot.send(USB, HEARTBEAT)
        robot.tick(100)
        before = robot.asked("POSITION_TARGET_LOCAL_NED")
        tracking = robot.asked("OMNI_TRACKING")
        robot.tick(1)
        now = robot.asked("POSITION_TARGET_LOCAL_NED")
        later = robot.asked("OMNI_TRACKING")
        between = (before.afx + now.afx) / 2, (before.afy + now.afy) / 2
        change = (now.vx - before.vx) / step_s, (now.vy - before.vy) / step_s
        assert between == pytest.approx(change, abs=2e-3)
        if tracking.phase == later.phase == 2:
            assert 0.0 < later.path_time - tracking.path_time <= step_s * 1.01
    assert later.phase in (1, 2)


def test_the_heartbeat_tells_what_moves_the_robot(robot: FakeRobot) -> None:
    custom, armed = mav.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mav.MAV_MODE_FLAG_SAFETY_ARMED
    guided, auto = mav.MAV_MODE_FLAG_GUIDED_ENABLED, mav.MAV_MODE_FLAG_AUTO_ENABLED

    def told() -> tuple[int, int, int]:
        beat = robot.asked("HEARTBEAT")
        assert (beat.type, beat.autopilot) == (mav.MAV_TYPE_GROUND_ROVER, mav.MAV_AUTOPILOT_GENERIC)
        assert beat.mavlink_version == 3
        return beat.base_mode, beat.custom_mode & 0xFFFF, beat.system_status

    robot.ready()
    assert told() == (custom, mav.OMNI_MODE_HOLD, mav.MAV_STATE_STANDBY)
    assert robot.ask(USB, ARM) == mav.MAV_RESULT_ACCEPTED
    robot.tick(5)
    assert told() == (custom | armed, mav.OMNI_MODE_HOLD, mav.MAV_STATE_ACTIVE)
    driven(robot, POSE, 3)
    assert told() == (custom | armed | guided, mav.OMNI_MODE_POSE, mav.MAV_STATE_ACTIVE)
    for axes_request in (velocity(0.01), frame("manual_control", 1, 10, 0, 0, 0, 0)):
        driven(robot, axes_request, 3)
        assert told() == (custom | armed | guided, mav.OMNI_MODE_VELOCITY, mav.MAV_STATE_ACTIVE)
    assert robot.ask(USB, START) == mav.MAV_RESULT_ACCEPTED
    robot.tick(5)
    assert told() == (custom | armed | auto, mav.OMNI_MODE_TRAJECTORY, mav.MAV_STATE_ACTIVE)
    robot.send(USB, duty(0.1))
    robot.tick(2)
    assert told() == (custom | armed, mav.OMNI_MODE_DUTY, mav.MAV_STATE_ACTIVE)
    robot.tick(1000)
    assert told()[0::2] == (custom, mav.MAV_STATE_CRITICAL)
    assert robot.ask(USB, EMERGENCY) == mav.MAV_RESULT_ACCEPTED
    robot.tick(3)
    assert told()[0::2] == (custom, mav.MAV_STATE_EMERGENCY)


def test_in_the_loop_the_heartbeat_and_the_answers_say_so(robot: FakeRobot) -> None:
    robot.in_loop(USB)
    driven_loop = velocity(0.03, 0.02, 0.4)
    for _ in range(20):
        robot.send(USB, HEARTBEAT, driven_loop)
        robot.hil_tick(USB, 20)
    assert robot.asked("HEARTBEAT").base_mode & mav.MAV_MODE_FLAG_HIL_ENABLED
    robot.said[USB].clear()
    robot.hil_tick(USB)
    actuators = [m for m in robot.said[USB] if m.get_type() == "OMNI_HIL_ACTUATORS"][-1]
    tracking, wheels = robot.asked("OMNI_TRACKING"), robot.asked("OMNI_WHEELS")
    assert list(actuators.reference) == list(tracking.reference)
    assert list(actuators.pose) == list(tracking.pose)
    assert all(abs(number) > 1e-4 for number in [*actuators.reference, *actuators.pose])
    assert (actuators.wheel_scale, actuators.duty_scale) == (wheels.wheel_scale, wheels.duty_scale)
    assert list(actuators.wheel_reference) == list(wheels.reference)
    assert (actuators.state, actuators.faults) == (2, robot.asked("OMNI_STATUS").faults)
    assert 0.0 < actuators.duty_scale <= 1.0


def test_the_health_of_the_parts(robot: FakeRobot) -> None:
    encoders, motors = mav.MAV_SYS_STATUS_SENSOR_ANGULAR_RATE_CONTROL, mav.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    battery, pose = mav.MAV_SYS_STATUS_SENSOR_BATTERY, mav.MAV_SYS_STATUS_SENSOR_VISION_POSITION
    robot.armed()
    status = robot.asked("SYS_STATUS")
    assert status.onboard_control_sensors_present == encoders | motors | battery | pose
    assert status.onboard_control_sensors_enabled == encoders | motors | battery
    health = mav.MAV_SYS_STATUS_GEOFENCE | encoders | motors | battery
    assert status.onboard_control_sensors_health & ~pose == health
    assert (status.voltage_battery, status.current_battery, status.battery_remaining) == (12_000, -1, -1)
    seen = set()
    for _ in range(30):
        robot.counts_jump(1000)  # more than can be true
        robot.tick()
        seen.add(robot.asked("SYS_STATUS").onboard_control_sensors_health & ~pose)
    assert seen == {health, health & ~encoders}


def test_noise_on_a_link_is_counted_on_that_link(robot: FakeRobot) -> None:
    robot.ready()
    robot.send(RADIO, b"\xfd" + bytes(range(1, 60)) * 3, HEARTBEAT)
    robot.tick(400)
    errors = robot.asked("SYS_STATUS", RADIO).errors_comm
    assert errors > 0
    assert errors == robot.asked("OMNI_STATUS", RADIO).rx_errors
    assert robot.asked("SYS_STATUS").errors_comm == 0
    assert list(robot.asked("OMNI_HEALTH").link_rx_errors) == [0, errors, 0, 0]


def test_the_battery_has_one_voltage_and_says_what_nobody_measures(robot: FakeRobot) -> None:
    robot.ready()
    battery = robot.asked("BATTERY_STATUS")
    assert list(battery.voltages) == [12_000] + [UINT16_MAX] * 9
    assert (battery.temperature, battery.battery_remaining) == (INT16_MAX, -1)
    assert (battery.current_battery, battery.current_consumed, battery.energy_consumed) == (-1, -1, -1)


def test_the_version_is_that_of_the_build(robot: FakeRobot) -> None:
    text = (generated_dir() / "include/omni/version_gen.h").read_text(encoding="utf-8")
    major, minor, patch = (
        int(re.findall(rf"OMNI_VERSION_{part} (\d+)", text)[0]) for part in ("MAJOR", "MINOR", "PATCH")
    )
    dirty = re.findall(r"OMNI_GIT_DIRTY (\d)", text)[0] != "0"
    robot.ready()
    version = robot.asked("AUTOPILOT_VERSION")
    assert version.flight_sw_version.to_bytes(4, "big") == bytes([major, minor, patch, 0 if dirty else 255])
    assert bytes(version.flight_custom_version).hex() == re.findall(r'GIT_HASH_STRING "(\w*)"', text)[0].ljust(16, "0")
    assert version.capabilities == (
        mav.MAV_PROTOCOL_CAPABILITY_MAVLINK2
        | mav.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
        | mav.MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST
        | mav.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    )
