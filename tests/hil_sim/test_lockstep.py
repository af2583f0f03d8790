# SPDX-License-Identifier: MIT
"""The lockstep runner against a small robot made of pymavlink, over a socket pair."""

from __future__ import annotations

import os
import socket
from typing import Any

import pytest

from hil_sim.faults import Fault
from hil_sim.record import Record
from hil_sim.world import PoseSensor
from omniwheel._core import ffi, lib
from tests.hil_sim.echo_robot import Bench, EchoRobot, answer


def test_sensors_go_out_and_bytes_come_back(bench: Bench, make_world: Any) -> None:
    robot, world, record = bench.robot(), make_world(), Record(100)
    world.c.counts[1] = -7
    assert bench.run(world, 50, record) == lib.HIL_OK
    assert (bench.done[0], world.c.steps, world.c.time_us) == (50, 50, 50000)
    assert world.c.chip.registers[0] == 0x21
    sensors = robot.of_type("OMNI_HIL_SENSORS")
    assert [message.sequence for message in sensors] == list(range(50))
    assert [message.time_us for message in sensors] == [1000 * k for k in range(50)]
    assert sensors[0].counts == [0, -7, 0, 0]
    assert sensors[0].counts_valid == 0b111
    assert sensors[0].battery_voltage == pytest.approx(12.0)
    assert (sensors[0].get_srcSystem(), sensors[0].get_srcComponent()) == (255, 190)


def test_record_has_what_the_robot_told(bench: Bench, make_world: Any) -> None:
    bench.robot()
    record = Record(10, every=5)
    bench.run(make_world(), 12, record)
    assert record.samples["time_s"].tolist() == pytest.approx([0.0, 0.005, 0.010])
    assert record.samples["reference"][0].tolist() == [1.0, 2.0, 3.0]
    assert record.samples["estimate"][0].tolist() == [4.0, 5.0, 6.0]
    assert record.samples["wheel_reference"][0].tolist() == [7.0, 8.0, 9.0, 0.0]
    row = record.samples[0]
    told = [row[name].item() for name in ("wheel_scale", "duty_scale", "config_sequence", "state", "phase")]
    assert told == [0.5, 0.25, 17, 2, 1]


def test_pose_fixes_travel_in_ned(bench: Bench, make_world: Any) -> None:
    robot = bench.robot()
    sensor = PoseSensor(rate_Hz=100, sd_xy_m=0, sd_theta_rad=0, delay_s=0.005)
    bench.run(make_world(pose_sensor=sensor, start_pose=(1.0, 2.0, 0.5)), 30)
    fixes = robot.of_type("VICON_POSITION_ESTIMATE")
    assert [fix.usec for fix in fixes] == [0, 10000, 20000]
    assert (fixes[0].x, fixes[0].y, fixes[0].z, fixes[0].yaw) == pytest.approx((1.0, -2.0, 0.0, -0.5))
    names = [message.get_type() for message in robot.seen[5:7]]
    assert names == ["VICON_POSITION_ESTIMATE", "OMNI_HIL_SENSORS"]


@pytest.mark.parametrize("how", ["silence", "switched off"])
def test_fixes_stay_away(bench: Bench, make_world: Any, how: str) -> None:
    robot = bench.robot()
    bench.link.send_fixes = how != "switched off"
    faults = [Fault("link_silence", 0.0)] if how == "silence" else []
    bench.run(make_world(pose_sensor=PoseSensor(delay_s=0.0), faults=faults), 30)
    assert len(robot.of_type("OMNI_HIL_SENSORS")) == 30
    assert not robot.of_type("VICON_POSITION_ESTIMATE")


def test_other_frames_are_collected_whole(bench: Bench, make_world: Any) -> None:
    sent = []

    def chatty(robot: EchoRobot, sensors: Any) -> None:
        frame = robot.heartbeat_bytes()
        sent.append(frame)
        robot.sock.sendall(frame + robot.answer_bytes(sensors))

    bench.robot(chatty)
    assert bench.run(make_world(), 20) == lib.HIL_OK
    assert bytes(ffi.buffer(bench.link.rx, bench.link.rx_length)) == b"".join(sent)


def test_answer_in_single_bytes(bench: Bench, make_world: Any) -> None:
    def slow(robot: EchoRobot, sensors: Any) -> None:
        for byte in robot.answer_bytes(sensors):
            robot.sock.sendall(bytes([byte]))

    bench.robot(slow)
    assert bench.run(make_world(), 3) == lib.HIL_OK


def test_garbage_and_broken_frames_are_skipped(bench: Bench, make_world: Any) -> None:
    def dirty(robot: EchoRobot, sensors: Any) -> None:
        broken = bytearray(robot.answer_bytes(sensors))
        broken[20] ^= 0xFF
        robot.sock.sendall(b"noise\xfe\x00" + bytes(broken) + robot.answer_bytes(sensors))

    bench.robot(dirty)
    assert bench.run(make_world(), 5) == lib.HIL_OK
    assert bench.link.bad_frames >= 5
    assert bench.link.rx_length == 0


def test_false_start_does_not_swallow_the_answer(bench: Bench, make_world: Any) -> None:
    """A stray 0xFD announces 255 bytes that never come."""

    def stray(robot: EchoRobot, sensors: Any) -> None:
        robot.sock.sendall(b"\xfd\xff\x00" + robot.answer_bytes(sensors)[:200])
        robot.sock.sendall(robot.answer_bytes(sensors)[200:])

    def once(robot: EchoRobot, sensors: Any) -> None:
        (stray if sensors.sequence == 0 else answer)(robot, sensors)

    robot = bench.robot(once)
    robot.mav.robust_parsing = True
    assert bench.run(make_world(), 3) == lib.HIL_OK


def test_run_returns_when_the_receive_buffer_is_nearly_full(bench: Bench, make_world: Any) -> None:
    def flood(robot: EchoRobot, sensors: Any) -> None:
        robot.sock.sendall(robot.heartbeat_bytes() * 100 + robot.answer_bytes(sensors))

    bench.robot(flood)
    world = make_world()
    assert bench.run(world, 1000) == lib.HIL_OK
    assert 20 < bench.done[0] < 40
    assert bench.link.lost_frames == 0
    bench.link.rx_length = 0
    assert bench.run(world, 5) == lib.HIL_OK
    assert bench.done[0] == 5


def test_silence_is_a_timeout_and_the_world_stands(bench: Bench, make_world: Any) -> None:
    def deaf(robot: EchoRobot, sensors: Any) -> None:
        if sensors.sequence < 3:
            answer(robot, sensors)

    bench.robot(deaf)
    world = make_world()
    assert bench.run(world, 3) == lib.HIL_OK, "with time to spare: a busy computer answers late"
    bench.link.timeout_s = 0.2
    assert bench.run(world, 7) == lib.HIL_ERR_TIMEOUT
    assert (bench.done[0], world.c.steps) == (0, 3)


def test_late_answers_of_a_timed_out_tick_are_stale(bench: Bench, make_world: Any) -> None:
    def late(robot: EchoRobot, sensors: Any) -> None:
        if sensors.sequence == 1:
            robot.sock.sendall(robot.answer_bytes(sensors, sequence=0))
        if sensors.sequence >= 1:
            answer(robot, sensors)

    bench.robot(late)
    bench.link.timeout_s = 0.2
    world = make_world()
    assert bench.run(world, 1) == lib.HIL_ERR_TIMEOUT
    bench.link.timeout_s = 20.0
    assert bench.run(world, 4) == lib.HIL_OK
    assert bench.link.stale_answers == 1


def heartbeat(robot: EchoRobot, *, in_loop: bool, autopilot: int) -> bytes:
    mode = robot.dialect.MAV_MODE_FLAG_HIL_ENABLED if in_loop else 0
    return bytes(robot.dialect.MAVLink_heartbeat_message(10, autopilot, mode, 0, 3, 3).pack(robot.mav))


@pytest.mark.parametrize(
    ("in_loop", "autopilot", "beats", "result"),
    [
        (False, 0, 2, "HIL_ERR_OUTSIDE"),
        (False, 0, 1, "HIL_ERR_TIMEOUT"),
        (True, 0, 3, "HIL_ERR_TIMEOUT"),
        (False, 8, 3, "HIL_ERR_TIMEOUT"),
    ],
    ids=["robot outside", "one from before", "robot in the loop", "a ground station"],
)
def test_two_heartbeats_from_outside_end_the_waiting(
    bench: Bench, make_world: Any, in_loop: bool, autopilot: int, beats: int, result: str
) -> None:
    def outside(robot: EchoRobot, sensors: Any) -> None:
        if sensors.sequence < 3:
            answer(robot, sensors)
        elif sensors.sequence == 3:
            robot.sock.sendall(heartbeat(robot, in_loop=in_loop, autopilot=autopilot) * beats)
        else:
            robot.sock.sendall(heartbeat(robot, in_loop=in_loop, autopilot=autopilot) + robot.answer_bytes(sensors))

    bench.robot(outside)
    world = make_world()
    assert bench.run(world, 3) == lib.HIL_OK
    if result == "HIL_ERR_TIMEOUT":
        bench.link.timeout_s = 0.2
    assert bench.run(world, 7) == getattr(lib, result)
    assert (bench.done[0], world.c.steps) == (0, 3)
    bench.link.timeout_s = 20.0
    assert bench.run(world, 10) == lib.HIL_OK, "a heartbeat per tick, each before its answer, is no reason to end"


@pytest.mark.parametrize("fault", ["later sequence", "unparsable bytes"])
def test_wrong_answers_are_protocol_errors(bench: Bench, make_world: Any, fault: str) -> None:
    def wrong(robot: EchoRobot, sensors: Any) -> None:
        if fault == "later sequence":
            robot.sock.sendall(robot.answer_bytes(sensors, sequence=sensors.sequence + 5))
        else:
            robot.sock.sendall(robot.answer_bytes(sensors, i2c=b"\x40\x07\x00"))

    bench.robot(wrong)
    world = make_world()
    assert bench.run(world, 3) == lib.HIL_ERR_PROTOCOL
    assert (bench.done[0], world.c.steps) == (0, 0)


def test_closed_link_is_reported(bench: Bench, make_world: Any) -> None:
    def hang_up(robot: EchoRobot, sensors: Any) -> None:
        if sensors.sequence == 2:
            robot.sock.shutdown(socket.SHUT_RDWR)
        else:
            answer(robot, sensors)

    bench.robot(hang_up)
    assert bench.run(make_world(), 10) == lib.HIL_ERR_LINK
    assert bench.done[0] == 2


def test_bad_descriptor_is_a_link_error(bench: Bench, make_world: Any) -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    os.close(write_end)
    bench.link.fd = write_end
    assert bench.run(make_world(), 1) == lib.HIL_ERR_LINK


def test_non_blocking_descriptor(bench: Bench, make_world: Any) -> None:
    bench.ours.setblocking(False)
    bench.robot()
    assert bench.run(make_world(), 20) == lib.HIL_OK


def test_paced_and_unpaced_runs_are_the_same_world(bench: Bench, make_world: Any) -> None:
    bench.robot()
    paced, free = make_world(slip_max=0.1), make_world(slip_max=0.1)
    bench.link.realtime_factor = 2.0
    assert bench.run(paced, 40) == lib.HIL_OK
    bench.link.realtime_factor = 0.0
    assert bench.run(free, 40) == lib.HIL_OK
    assert bytes(ffi.buffer(paced.c)) == bytes(ffi.buffer(free.c))
