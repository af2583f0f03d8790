# SPDX-License-Identifier: MIT
"""The Python API against a robot made of Python, in simulated time."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import omniwheel
from omniwheel import Twist
from omniwheel.dialect import mavlink
from omniwheel.errors import (
    ArmingRefusedError,
    CommandRefusedError,
    LinkTimeoutError,
    OmniError,
    SetpointError,
)
from omniwheel.robot import Robot, connect
from omniwheel.telemetry import Sample, StatusText, Tracking
from omniwheel.tlog import TlogWriter

ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM


def send_tracking(fake: Any, x: float) -> None:
    fake.send(mavlink.MAVLink_omni_tracking_message(1500, [0, 0, 0], [0, 0, 0], [x, 2.0, 0.5], [0.1, 0.1, 0.2], 3.0, 2))


def test_every_exception_is_an_omni_error_with_message_and_hint() -> None:
    from omniwheel import errors

    found = [kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, Exception)]
    kinds = [kind for kind in found if issubclass(kind, OmniError)]
    assert kinds == found
    assert len(kinds) > 10
    assert all(kind.__name__ in (errors.__doc__ or "") for kind in kinds)
    assert all(kind.exit_code in (1, 2) for kind in kinds)
    assert str(errors.UnknownParameterError("no such", hint="list")) == "no such"


def test_connecting_to_silence_says_so(fake: Any) -> None:
    fake.silent = True
    with pytest.raises(LinkTimeoutError, match="no data from fake"):
        connect(fake, clock=fake.clock, timeout_s=2.0)
    assert fake.closed


def test_connecting_to_something_else_says_it_is_not_mavlink(fake: Any) -> None:
    fake.garbage = bytes(range(200))
    fake.heartbeat = lambda: None
    with pytest.raises(LinkTimeoutError, match="not MAVLink 2") as caught:
        connect(fake, clock=fake.clock, timeout_s=2.0)
    assert "baud" in caught.value.hint


def test_garbage_between_frames_does_no_lasting_harm(fake: Any) -> None:
    with connect(fake, clock=fake.clock) as robot:
        robot.connection.feed(b"\x00garbage\xff\xfe\x09\xfd\x10half a frame")
        assert robot.parameters["WHEELS"] == 3


def test_a_wanted_system_id_that_is_not_there_is_named(fake: Any) -> None:
    with pytest.raises(LinkTimeoutError, match="system id 9"):
        connect(fake, clock=fake.clock, timeout_s=3.0, system_id=9)


def test_heartbeats_are_sent_once_a_second_of_the_links_clock(fake: Any, robot: Robot) -> None:
    del fake.received[:]
    robot.pump(10.0)
    beats = [m for m in fake.received if m.get_type() == "HEARTBEAT"]
    assert 9 <= len(beats) <= 11
    assert all(m.type == mavlink.MAV_TYPE_GCS for m in beats)


def test_without_heartbeat_nothing_is_sent(fake: Any) -> None:
    with connect(fake, clock=fake.clock, heartbeat=False) as robot:
        robot.pump(3.0)
    assert fake.received == []


def test_arming_refused_carries_the_reasons(fake: Any, robot: Robot) -> None:
    fake.command_results[ARM] = mavlink.MAV_RESULT_DENIED
    fake.reasons = ["not armed: battery", "not armed: encoder"]
    with pytest.raises(ArmingRefusedError, match="battery; not armed: encoder") as caught:
        robot.arm()
    assert caught.value.result == "DENIED"
    assert caught.value.reasons == ("not armed: battery", "not armed: encoder")


def test_leaving_the_context_disarms_what_was_armed(fake: Any) -> None:
    with connect(fake, clock=fake.clock) as robot:
        robot.arm()
    assert fake.commands() == [(ARM, 1.0), (ARM, 0.0)]
    assert fake.closed


def test_an_error_in_the_context_disarms_too_and_is_not_hidden(fake: Any) -> None:
    def drive_and_fail() -> None:
        with connect(fake, clock=fake.clock) as robot:
            robot.arm()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        drive_and_fail()
    assert fake.commands()[-1] == (ARM, 0.0)


def test_an_interrupt_while_the_answer_to_arming_is_awaited_disarms_too(fake: Any, monkeypatch: Any) -> None:
    def interrupt() -> None:
        with connect(fake, clock=fake.clock) as robot:
            send = fake.send

            def answer(message: Any) -> None:
                if message.get_type() == "COMMAND_ACK" and robot.armed_here:
                    monkeypatch.setattr(fake, "send", send)
                    raise KeyboardInterrupt
                send(message)

            monkeypatch.setattr(fake, "send", answer)
            robot.arm()

    with pytest.raises(KeyboardInterrupt):
        interrupt()
    assert fake.commands() == [(ARM, 1.0), (ARM, 0.0)]


def test_leaving_the_context_leaves_a_robot_alone_that_someone_else_armed(fake: Any) -> None:
    with connect(fake, clock=fake.clock):
        pass
    assert fake.commands() == []


def test_a_lost_acknowledgement_is_asked_for_again(fake_robot: Callable[..., Any]) -> None:
    fake = fake_robot(loss=0.4, seed=3)
    with connect(fake, clock=fake.clock, timeout_s=30.0) as robot:
        robot.arm()
    assert (ARM, 1.0) in fake.commands()


def test_a_command_without_answer_times_out(fake: Any, robot: Robot) -> None:
    fake.silent = True
    with pytest.raises(LinkTimeoutError, match="to stop at once"):
        robot.estop()


def test_a_robot_that_is_busy_is_asked_again(fake: Any, robot: Robot) -> None:
    fake.command_results[ARM] = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
    with pytest.raises(ArmingRefusedError, match="temporarily rejected"):
        robot.arm()
    refused = len(fake.commands())
    assert refused > 5
    fake.command_results.clear()
    robot.arm()
    assert len(fake.commands()) == refused + 1


def test_unsupported_commands_are_refusals(fake: Any, robot: Robot) -> None:
    fake.command_results[mavlink.MAV_CMD_OMNI_HIL] = mavlink.MAV_RESULT_UNSUPPORTED
    with pytest.raises(CommandRefusedError, match="unsupported"):
        robot.enter_hil()


def last_target(fake: Any) -> Any:
    return [m for m in fake.received if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"][-1]


def test_velocity_setpoints_are_converted_to_mavlinks_frames(fake: Any, robot: Robot) -> None:
    robot.set_velocity(0.25, 0.5, -1.0)
    sent = last_target(fake)
    assert sent.coordinate_frame == mavlink.MAV_FRAME_BODY_FRD
    assert (sent.vx, sent.vy, sent.yaw_rate) == (0.25, -0.5, 1.0)
    assert sent.type_mask & 0b0000_0000_0001_1111 == 0b0000_0000_0000_0111
    assert sent.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_IGNORE
    assert not sent.type_mask & mavlink.POSITION_TARGET_TYPEMASK_YAW_RATE_IGNORE
    robot.set_velocity(0.25, 0.5, -1.0, frame="world")
    assert last_target(fake).coordinate_frame == mavlink.MAV_FRAME_LOCAL_NED


def test_pose_setpoints_are_converted_to_mavlinks_frames(fake: Any, robot: Robot) -> None:
    robot.set_pose(1.0, 2.0, 0.5)
    sent = last_target(fake)
    assert (sent.x, sent.y, sent.yaw) == (1.0, -2.0, -0.5)
    assert sent.type_mask & 0b011 == 0
    assert sent.type_mask & mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE
    robot.set_pose(1.0, 2.0, 0.5, feed_forward=Twist(0.1, 0.2, 0.3))
    sent = last_target(fake)
    assert (sent.vx, sent.vy, sent.yaw_rate) == pytest.approx((0.1, -0.2, -0.3))
    assert not sent.type_mask & mavlink.POSITION_TARGET_TYPEMASK_VX_IGNORE


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_setpoint_that_is_no_number_is_not_sent(fake: Any, robot: Robot, bad: float) -> None:
    sends: list[Callable[[], None]] = [
        lambda: robot.set_velocity(bad, 0.0, 0.0),
        lambda: robot.set_pose(0.0, bad, 0.0),
        lambda: robot.set_pose(0.0, 0.0, 0.0, feed_forward=Twist(0.0, 0.0, bad)),
        lambda: robot.send_pose_fix(0.0, 0.0, bad),
        lambda: robot.send_pose_fix(0.0, 0.0, 0.0, sd_xy_m=bad),
        lambda: robot.send_pose_fix(0.0, 0.0, 0.0, sd_theta_rad=-0.001),
        lambda: robot.set_pose_estimate(bad, 0.0, 0.0),
        lambda: robot.set_waypoints([(0.0, 0.0, bad)]),
        lambda: robot.set_velocity(0.0, 0.0, 0.0, frame="moon"),
    ]
    for send in sends:
        with pytest.raises(SetpointError):
            send()
    assert not [m for m in fake.received if m.get_type() not in ("HEARTBEAT", "TIMESYNC")]


def test_duties_are_sent_to_this_robot_one_per_wheel(fake: Any, robot: Robot) -> None:
    robot.set_duty([0.5, -0.25, 0.1])
    robot.pump()

    def sent() -> list[Any]:
        return [m for m in fake.received if m.get_type() == "OMNI_SETPOINT_DUTY"]

    message = sent()[-1]
    assert list(message.duty) == pytest.approx([0.5, -0.25, 0.1, 0.0])
    assert message.target_system == robot.connection.target_system
    robot.drive_duty([0.2] * 3, 0.3)
    assert len(sent()) >= 6
    assert list(sent()[-1].duty) == [0.0] * 4
    for wrong in ([], [0.0] * 5, [1.1], [math.nan]):
        with pytest.raises(SetpointError):
            robot.set_duty(wrong)


def test_samples_are_decoded(fake: Any, robot: Robot) -> None:
    values = (2_500_000, [1, -2, 3, 4], [12_000, -6_000, 0, 2**31 - 1], 11.5, [1.0, 2.0, 0.5], 2)
    fake.send(mavlink.MAVLink_omni_sample_message(*values))
    sample = robot.wait_for(Sample)
    assert sample.time_s == 2.5
    assert sample.counts == (1, -2, 3, 4)
    assert sample.volt_seconds == pytest.approx((0.012, -0.006, 0.0, 2147.483647))
    assert (sample.supply_V, sample.pose, sample.phase) == (11.5, (1.0, 2.0, 0.5), "path")


def test_a_repeated_velocity_is_sent_again_before_it_times_out(fake: Any, robot: Robot) -> None:
    robot.repeat(lambda: robot.set_velocity(0.1, 0.0, 0.0), 2.0)
    sent = [m for m in fake.received if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert len(sent) > 2.0 / 0.25


def test_trajectories_are_started_by_name(fake: Any, robot: Robot) -> None:
    robot.start_trajectory("rose", laps=2)
    robot.start_trajectory()
    started = [m for m in fake.received if m.get_type() == "COMMAND_LONG"]
    assert [(m.param1, m.param2) for m in started] == [(4.0, 2.0), (-1.0, -1.0)]


def test_telemetry_is_decoded_and_kept_while_the_loop_is_busy(fake: Any, robot: Robot) -> None:
    send_tracking(fake, 1.0)
    stream = robot.telemetry(Tracking, StatusText)
    first = next(stream)
    assert isinstance(first, Tracking)
    assert (first.pose, first.phase, first.time_s) == ((1.0, 2.0, 0.5), "path", 1.5)
    send_tracking(fake, 3.0)
    fake.say("hello")
    robot.pump(0.1)
    kinds = [type(next(stream)), type(next(stream))]
    assert kinds == [Tracking, StatusText]


def test_telemetry_that_does_not_come_times_out(robot: Robot) -> None:
    with pytest.raises(LinkTimeoutError, match="no OMNI_TRACKING"):
        next(robot.telemetry(Tracking, timeout_s=1.0))


def test_status_is_the_latest_of_everything(fake: Any, robot: Robot) -> None:
    assert robot.status.tracking is None
    send_tracking(fake, 4.0)
    fake.send(mavlink.MAVLink_omni_status_message(0, 9, 0b100 | 1 << 16, 0b1000, 0, 0, 0, 0, 1.0, 2.0, 3, 0))
    robot.pump(0.1)
    status = robot.status
    assert status.tracking is not None
    assert status.tracking.pose.x == 4.0
    assert status.state == "failsafe"
    assert len(status.faults) == 2
    assert "encoder" in status.faults
    assert status.heartbeat_age_s < 1.5


def test_other_systems_messages_are_not_taken_for_the_robots(fake: Any, robot: Robot) -> None:
    other = mavlink.MAVLink(None, 99, 1)
    stray = mavlink.MAVLink_statustext_message(0, b"stray")
    robot.connection.feed(bytes(stray.pack(other)))
    assert robot.texts.all == ()


def test_a_recording_opens_in_pymavlink_and_is_the_same_every_time(
    fake_robot: Callable[..., Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(path: Path) -> bytes:
        fake = fake_robot()
        log = TlogWriter(path, lambda: 1_000_000 + int(fake.now_s * 1e6))
        with log, connect(fake, clock=fake.clock, recorder=log.write) as robot:
            robot.parameters.download()
            robot.arm()
            robot.pump(2.0)
        return path.read_bytes()

    first, second = run(tmp_path / "a.tlog"), run(tmp_path / "b.tlog")
    assert first == second
    from pymavlink import mavutil

    omniwheel.dialect.install()
    log = mavutil.mavlink_connection(str(tmp_path / "a.tlog"))
    counts: dict[str, int] = {}
    while (message := log.recv_match()) is not None:
        counts[message.get_type()] = counts.get(message.get_type(), 0) + 1
    assert counts["PARAM_VALUE"] == len(fake_robot().values)
    assert counts["COMMAND_ACK"] == 2
    assert "BAD_DATA" not in counts


HUGE = 10**400
"""A Python int of any length is a number, too."""
BEYOND: dict[str, Any] = {
    "rate": lambda robot: robot.set_message_interval("OMNI_WHEELS", 1e-300),
    "message": lambda robot: robot.set_message_interval("NO_SUCH", 1.0),
    "pose estimate": lambda robot: robot.set_pose_estimate(1e300, 0.0, 0.0),
    "velocity": lambda robot: robot.set_velocity(1e300, 0.0, 0.0),
    "int velocity": lambda robot: robot.set_velocity(HUGE, 0.0, 0.0),
    "pose": lambda robot: robot.set_pose(1e300, 0.0, 0.0),
    "pose fix": lambda robot: robot.send_pose_fix(1e300, 0.0, 0.0),
    "deviation of a fix": lambda robot: robot.send_pose_fix(0.0, 0.0, 0.0, sd_xy_m=HUGE),
    "time of a fix": lambda robot: robot.send_pose_fix(0.0, 0.0, 0.0, time_us=2**70),
    "waypoint": lambda robot: robot.set_waypoints([(0.0, 1e300, 0.0)]),
    "burst": lambda robot: robot.start_burst(1e300),
    "burst's samples": lambda robot: robot.start_burst(1.0, every=HUGE),
    "burst's signal": lambda robot: robot.start_burst(1.0, ["no such"]),
    "burst's wheel": lambda robot: robot.start_burst(1.0, wheels=[-1]),
    "excitation": lambda robot: robot.excite("wheel", HUGE, 1.0, 1.0),
    "excitation's place": lambda robot: robot.excite("nowhere", 1, 1.0, 1.0),
    "parameter": lambda robot: robot.parameters.set_many({"LIM_V": HUGE}),
    "long parameter": lambda robot: robot.parameters.set_many({"LIM_V": 10**5000}),
    "trajectory": lambda robot: robot.start_trajectory("circle", laps=HUGE),
    "any message": lambda robot: robot.send(mavlink.MAVLink_ping_message(2**70, 0, 0, 0)),
}


@pytest.mark.parametrize("name", BEYOND)
def test_a_number_that_fits_nowhere_is_an_error_of_ours_and_sends_nothing(fake: Any, robot: Robot, name: str) -> None:
    fake.received.clear()
    with pytest.raises(OmniError):
        BEYOND[name](robot)
    sent = {message.get_type() for message in fake.received} - {"HEARTBEAT", "PARAM_REQUEST_READ"}
    assert not sent
