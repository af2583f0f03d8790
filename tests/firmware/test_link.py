# SPDX-License-Identifier: MIT
"""Streams, small services, damaged input and connections."""

from __future__ import annotations

import collections
import contextlib
import socket
import struct
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.firmware.client import WAIT_S, Client, connect, firmware, lockstep_robot, mav
from tests.firmware.test_commands import ARM, DISARMED
from tests.waiting import wait_until

REQUEST = mav.MAV_CMD_REQUEST_MESSAGE
INTERVAL = mav.MAV_CMD_SET_MESSAGE_INTERVAL
HIL = mav.MAV_CMD_OMNI_HIL
ESTOP = 4


def rates(robot: Client, ticks: int = 2000) -> dict[str, float]:
    counts = collections.Counter(m.get_type() for t in robot.ticks(ticks) for m in t.others)
    return {name: count * 1000 / ticks for name, count in counts.items()}


@pytest.mark.pc_only
def test_a_heartbeat_greets_each_new_connection(robot: Client) -> None:
    beat = robot.wait("HEARTBEAT")
    assert (beat.type, beat.autopilot) == (mav.MAV_TYPE_GROUND_ROVER, mav.MAV_AUTOPILOT_GENERIC)
    assert beat.base_mode & mav.MAV_MODE_FLAG_HIL_ENABLED
    assert (beat.get_srcSystem(), beat.get_srcComponent()) == (1, 1)


@pytest.mark.full
def test_streams_come_at_their_rates_and_are_adjustable(robot: Client) -> None:
    robot.set("SR1_STATE", 20)
    seen = rates(robot)
    assert seen["HEARTBEAT"] == pytest.approx(1, abs=0.5)
    assert seen["LOCAL_POSITION_NED"] == pytest.approx(20, abs=0.5)
    assert seen["OMNI_WHEELS"] == pytest.approx(5, abs=0.5)
    assert robot.command(INTERVAL, mav.MAVLINK_MSG_ID_OMNI_WHEELS, 10_000) == mav.MAV_RESULT_ACCEPTED
    assert robot.command(INTERVAL, mav.MAVLINK_MSG_ID_ATTITUDE, -1) == mav.MAV_RESULT_ACCEPTED
    assert robot.command(INTERVAL, mav.MAVLINK_MSG_ID_OMNI_CONTROL, 5) == mav.MAV_RESULT_DENIED
    assert robot.command(INTERVAL, 99_999, 10_000) == mav.MAV_RESULT_UNSUPPORTED
    seen = rates(robot)
    assert seen["OMNI_WHEELS"] == pytest.approx(100, abs=1)
    assert "ATTITUDE" not in seen
    robot.mav.request_data_stream_send(1, 1, 0, 4, 1)
    assert rates(robot)["LOCAL_POSITION_NED"] == pytest.approx(4, abs=0.5)


def test_messages_on_request(robot: Client) -> None:
    robot.tick()
    for name in (
        "ODOMETRY",
        "BATTERY_STATUS",
        "SYS_STATUS",
        "OMNI_STATUS",
        "POSITION_TARGET_LOCAL_NED",
        "OMNI_CONTROL",
    ):
        number = getattr(mav, f"MAVLINK_MSG_ID_{name}")
        assert robot.command(REQUEST, number) == mav.MAV_RESULT_ACCEPTED
        robot.wait(name)
    assert robot.command(REQUEST, 1e9) == mav.MAV_RESULT_DENIED
    assert robot.command(REQUEST, 24) == mav.MAV_RESULT_UNSUPPORTED


def test_the_version_tells_firmware_and_parameter_table_apart(robot: Client) -> None:
    assert robot.command(REQUEST, mav.MAVLINK_MSG_ID_AUTOPILOT_VERSION) == mav.MAV_RESULT_ACCEPTED
    version = robot.wait("AUTOPILOT_VERSION")
    assert version.flight_sw_version >> 8 > 0
    assert version.middleware_sw_version >= 1
    assert version.capabilities & mav.MAV_PROTOCOL_CAPABILITY_MAVLINK2


def test_small_services(robot: Client) -> None:
    robot.tick(step_us=5000)
    robot.mav.timesync_send(0, 1234)
    sync = robot.wait("TIMESYNC")
    assert (sync.tc1, sync.ts1) == (5_000_000, 1234)
    robot.mav.ping_send(1, 5, 0, 0)
    assert robot.wait("PING").seq == 5
    robot.mav.mission_request_list_send(1, 1)
    assert robot.wait("MISSION_COUNT").count == 0
    request = struct.pack("<HBBBBBBI", 7, 0, 4, 1, 0, 0, 0, 0).ljust(251, b"\0")
    robot.mav.file_transfer_protocol_send(0, 1, 1, list(request))
    answer = bytes(robot.wait("FILE_TRANSFER_PROTOCOL").payload)
    assert (answer[0], answer[3], answer[5]) == (8, 129, 4)


@pytest.fixture(scope="module")
def noisy() -> Iterator[Client]:
    with contextlib.ExitStack() as stack:
        client = stack.enter_context(lockstep_robot())
        yield client


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(noise=st.binary(max_size=300))
def test_nothing_whole_is_lost_behind_garbage(noisy: Client, noise: bytes) -> None:
    noisy.write(noise)
    # A false beginning may claim up to 280 bytes: enough pings follow to fill it, and each of them must be answered.
    for number in range(20):
        noisy.mav.ping_send(1, number, 0, 0)
    for number in range(20):
        noisy.wait("PING", seq=number)
    noisy.inbox.clear()


def test_a_noise_byte_does_not_swallow_a_stop(robot: Client) -> None:
    """0xFE claims 261 bytes of an unknown MAVLink 1 message; that another frame begins behind them proves nothing."""
    claimed = 261
    robot.armed()
    robot.mav.seq = 3  # becomes the number of the message that seems to begin: no message has it
    stop = mav.MAVLink_command_long_message(1, 1, mav.MAV_CMD_OMNI_ESTOP, 0, 1, 0, 0, 0, 0, 0, 0)
    data = b"\xfe" + bytes(stop.pack(robot.mav))
    pings: list[int] = []
    while len(data) < claimed:
        ping = bytes(mav.MAVLink_ping_message(1, len(pings), 0, 0).pack(robot.mav))
        pings.append(len(pings))
        data += ping
    surplus = len(data) - claimed
    data = data[: 1 + len(stop.get_msgbuf())] + b"\0" * (len(ping) - surplus) + data[1 + len(stop.get_msgbuf()) :]
    assert data[claimed] == 0xFD
    robot.write(data)
    assert robot.wait("COMMAND_ACK", command=mav.MAV_CMD_OMNI_ESTOP).result == mav.MAV_RESULT_ACCEPTED
    for number in pings:
        robot.wait("PING", seq=number)
    assert robot.tick().actuators.state == ESTOP


def test_a_half_frame_costs_nothing_but_itself(robot: Client) -> None:
    whole = mav.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0).pack(robot.mav)
    robot.write(whole[: len(whole) // 2])
    robot.heartbeat()
    assert robot.ticks(20)[-1].actuators.state == DISARMED


def test_mavlink_1_is_understood(robot: Client) -> None:
    message = mav.MAVLink_ping_message(1, 77, 0, 0)
    robot.write(message.pack(robot.mav, force_mavlink1=True))
    assert robot.wait("PING").seq == 77


@pytest.mark.pc_only
def test_a_second_client_is_sent_away_and_the_first_goes_on() -> None:
    with firmware("--lockstep") as running:
        first = connect(running)
        first.wait("HEARTBEAT")
        with socket.create_connection(running.address(), timeout=WAIT_S) as second:
            assert second.recv(100) == b""
        assert first.tick().actuators.sequence == 1
        first.socket.close()


@pytest.mark.pc_only
def test_a_client_that_leaves_disarms_the_robot_for_the_next_one() -> None:
    with firmware("--lockstep") as running:
        first = connect(running).armed()
        first.socket.close()
        second = connect(running)
        beat = second.wait("HEARTBEAT")
        assert not beat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED
        # It starts at time zero, with the chip's power-up sequence.
        assert second.tick().i2c[0][1] == bytes([0xFD, 0x10])
        second.socket.close()


def run_recorded(ticks: int) -> bytes:
    """Run a short session and return every byte that the robot sent."""
    with lockstep_robot() as robot:
        received = bytearray()
        parse = robot.mav.parse_buffer

        def record(data: bytes) -> object:
            received.extend(data)
            return parse(data)

        robot.mav.parse_buffer = record
        robot.armed()
        robot.command(mav.MAV_CMD_OMNI_TRAJECTORY_START, 3, -1)
        robot.ticks(ticks)
        robot.set("ISMC_LAM_XY", 7.0)
        robot.ticks(ticks)
        return bytes(received)


def test_two_equal_sessions_in_lockstep_are_equal_byte_by_byte() -> None:
    assert run_recorded(300) == run_recorded(300)


def out_of_the_loop(robot: Client) -> Any:
    """Return the first heartbeat of a robot that no host has in its loop."""
    return robot.wait_for(
        lambda one: one.get_type() == "HEARTBEAT" and not one.base_mode & mav.MAV_MODE_FLAG_HIL_ENABLED,
        "it stays in the loop",
    )


def test_host_in_the_loop_is_entered_and_left_by_command() -> None:
    with firmware() as running:
        robot = connect(running)
        robot.wait("HEARTBEAT")
        assert robot.command(HIL, 1) == mav.MAV_RESULT_ACCEPTED
        assert robot.tick().i2c[0][1] == bytes([0xFD, 0x10])
        robot.armed()
        assert robot.command(HIL, 0) == mav.MAV_RESULT_ACCEPTED
        out_of_the_loop(robot)
        robot.socket.close()


@pytest.mark.pc_only
def test_a_host_that_vanishes_from_the_loop_leaves_a_robot_on_its_own_clock() -> None:
    with firmware(links=("tcp:127.0.0.1:0", "tcp:127.0.0.1:0")) as running:
        watcher, host = connect(running, 0), connect(running, 1)
        watcher.wait("HEARTBEAT")
        assert host.command(HIL, 1) == mav.MAV_RESULT_ACCEPTED
        host.armed()
        assert watcher.command(HIL, 1) == mav.MAV_RESULT_DENIED
        host.socket.close()
        watcher.wait_for(lambda one: "HIL left" in getattr(one, "text", ""), "the loop is not left")
        beat = out_of_the_loop(watcher)
        assert not beat.base_mode & mav.MAV_MODE_FLAG_SAFETY_ARMED
        watcher.socket.close()


def test_a_tight_budget_drops_telemetry_but_no_reply_and_no_list() -> None:
    with firmware() as running:
        robot = connect(running)
        assert robot.set("LINK1_BUDGET", 400) == 400
        robot.mav.param_request_list_send(1, 1)
        wanted = robot.wait("PARAM_VALUE").param_count
        for index in range(1, min(wanted, 20)):
            robot.wait("PARAM_VALUE", param_index=index)
        assert robot.command(REQUEST, mav.MAVLINK_MSG_ID_OMNI_STATUS) == mav.MAV_RESULT_ACCEPTED
        robot.wait("OMNI_STATUS")

        def dropped() -> int:
            robot.command(REQUEST, mav.MAVLINK_MSG_ID_OMNI_STATUS)
            return int(robot.wait("OMNI_STATUS").tx_dropped)

        # Requests without a pause use the whole budget: no telemetry is sent, and what is left out counts once it is.
        wait_until(dropped, "nothing is dropped", pause=lambda: robot.wait("HEARTBEAT"))
        robot.socket.close()


def test_nobody_arms_a_robot_that_is_about_to_reboot(robot: Client) -> None:
    """A board leaves its last words some time to go out; motors that start meanwhile would run on through the reset."""
    robot.heartbeat()
    robot.ticks(20)
    encode = robot.mav.command_long_encode
    reboot = encode(1, 1, mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 0, 1, 0, 0, 0, 0, 0, 0)
    arm = encode(1, 1, mav.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, 0, 0, 0, 0, 0, 0)
    robot.write(reboot.pack(robot.mav) + arm.pack(robot.mav))
    ack = robot.wait("COMMAND_ACK", command=mav.MAV_CMD_COMPONENT_ARM_DISARM)
    assert ack.result == mav.MAV_RESULT_DENIED
    robot.wait("STATUSTEXT", text="cannot arm: rebooting")


def test_a_reboot_keeps_the_connection_and_forgets_what_was_not_stored(robot: Client) -> None:
    default = robot.get("ISMC_LAM_XY")
    robot.set("ISMC_LAM_XY", 7.0)
    robot.ticks(10)
    assert robot.command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == mav.MAV_RESULT_ACCEPTED
    assert robot.get("ISMC_LAM_XY") == default
    assert robot.armed().command(mav.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, 1) == mav.MAV_RESULT_DENIED


def test_the_rate_of_the_status_alone_can_be_changed(robot: Client) -> None:
    robot.set("SR1_STATUS", 20)
    assert rates(robot, 1500)["SYS_STATUS"] > 4  # once a second before, and the next one is still due then


@pytest.mark.parametrize("interval_us", [-1.0, 2147483648.0, 2.1e6, float("nan"), float("inf")])
def test_the_heartbeat_cannot_be_switched_off(robot: Client, interval_us: float) -> None:
    assert robot.command(INTERVAL, mav.MAVLINK_MSG_ID_HEARTBEAT, interval_us) == mav.MAV_RESULT_DENIED
    assert count_heartbeats(robot, 6000) >= 5


def test_a_heartbeat_every_two_seconds_is_the_slowest(robot: Client) -> None:
    assert robot.command(INTERVAL, mav.MAVLINK_MSG_ID_HEARTBEAT, 2e6) == mav.MAV_RESULT_ACCEPTED
    for group in (0, 2, 6, 10):
        robot.mav.request_data_stream_send(1, 1, group, 0, 0)
    assert count_heartbeats(robot, 6000) >= 3


def count_heartbeats(robot: Client, ticks: int) -> int:
    return sum(m.get_type() == "HEARTBEAT" for tick in robot.ticks(ticks) for m in tick.others)
