# SPDX-License-Identifier: MIT
"""Stops and other frames behind noise and inside half frames, in simulated time."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omniwheel.dialect import mavlink
from tests.radio.memory_robot import RADIO, USB, MemoryRobot
from tests.radio.noise import DAMAGE, V1, V2, bare_codec, driving_robot, study
from tests.radio.station import ARM, KEY, START, Station, state_of, usb

PROMISE_TICKS = 2
ESTOP = mavlink.MAV_CMD_OMNI_ESTOP
TERMINATE = mavlink.MAV_CMD_DO_FLIGHTTERMINATION
PIECES = 12

STOPS: dict[str, Callable[[], mavlink.MAVLink_message]] = {
    "disarm": lambda: mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 0, 0, 0, 0, 0, 0, 0),
    "e-stop": lambda: mavlink.MAVLink_command_long_message(1, 1, ESTOP, 0, 1, 0, 0, 0, 0, 0, 0),
    "e-stop by COMMAND_INT": lambda: mavlink.MAVLink_command_int_message(1, 1, 0, ESTOP, 0, 0, 1, 0, 0, 0, 0, 0, 0),
    "termination": lambda: mavlink.MAVLink_command_long_message(1, 1, TERMINATE, 0, 1, 0, 0, 0, 0, 0, 0),
    "disarm for everybody": lambda: mavlink.MAVLink_command_long_message(0, 0, ARM, 0, 0, 0, 0, 0, 0, 0, 0),
}


def half_frame() -> bytes:
    """The beginning of a long frame that the robot would understand."""
    message = mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, [0] * 250 + [1])
    return bytes(message.pack(bare_codec(7)))[:20]


@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE.keys())
def test_a_stop_behind_damage_acts_within_two_ticks(damage: Callable[[random.Random], bytes]) -> None:
    late = study(damage, PIECES, seed=7)
    assert [ticks for ticks in late if ticks is None or ticks > PROMISE_TICKS] == []


@settings(max_examples=60)
@given(noise=st.binary(max_size=300) | st.lists(st.sampled_from([V1, V2, 0, 1, 76, 253]), max_size=60).map(bytes),
       stop=st.sampled_from(sorted(STOPS)), v1=st.booleans(), port=st.sampled_from([USB, RADIO]))  # fmt: skip
def test_any_noise_then_a_stop(noise: bytes, stop: str, v1: bool, port: int) -> None:
    with driving_robot(port) as (robot, station):
        station.mav.omni_setpoint_duty_send(1, 1, [0.2, 0.2, 0.2, 0.0])
        robot.run(5)
        assert robot.driven
        robot.write(port, noise + bytes(STOPS[stop]().pack(station.mav, force_mavlink1=v1)))
        robot.run(PROMISE_TICKS)
        assert not robot.driven


def test_an_arm_command_that_waits_does_not_outlive_the_stop_behind_it() -> None:
    with MemoryRobot() as robot:
        robot.run(100)
        station = usb(robot)
        arm = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
        frames = [bytes(message.pack(station.mav)) for message in (arm, STOPS["disarm"]())]
        robot.write(USB, half_frame() + b"".join(frames))
        robot.run(300)
        assert state_of(robot) == "disarmed"


def test_only_stops_overtake_an_unfinished_frame() -> None:
    with MemoryRobot() as robot:
        robot.run(100)
        station = usb(robot)
        arm = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
        robot.write(USB, half_frame() + bytes(arm.pack(station.mav)))
        robot.run(150)
        assert "COMMAND_ACK" not in [m.get_type() for m in station.run(0)]
        robot.run(100)  # silence: it was no frame
        assert state_of(robot) == "armed"


@pytest.mark.parametrize(
    "carrier",
    [
        lambda data: mavlink.MAVLink_gps_rtcm_data_message(0, 180, data.ljust(180, b"\0")),
        lambda data: mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, list(data.ljust(251, b"\1"))),
    ],
    ids=["a message for others", "a message of ours"],
)
@pytest.mark.parametrize("pause", [False, True])
def test_a_command_in_the_payload_of_a_whole_frame_is_not_obeyed(
    carrier: Callable[[bytes], mavlink.MAVLink_message], pause: bool
) -> None:
    """A ground station forwards what it did not write: corrections from the internet, files."""
    with MemoryRobot() as robot:
        robot.run(100)
        station = usb(robot)
        arm = mavlink.MAVLink_command_long_message(1, 1, ARM, 0, 1, 0, 0, 0, 0, 0, 0)
        inner = bytes(arm.pack(station.mav))
        frame = bytes(carrier(b"\0" * 20 + inner).pack(station.mav))
        assert inner in frame
        half = frame.index(inner) + len(inner) + 1
        robot.write(USB, frame[:half])
        robot.run(50 if pause else 0)
        robot.write(USB, frame[half:])
        robot.run(300)
        assert state_of(robot) == "disarmed"


def test_signed_frames_in_front_of_an_early_stop_are_still_taken_and_nothing_is_called_old() -> None:
    with MemoryRobot() as robot:
        robot.run(100)
        usb(robot).give_key(KEY)
        station = Station(robot, key=KEY)
        assert station.command(ARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        setting = mavlink.MAVLink_param_set_message(1, 1, b"ISMC_LAM_XY", 7.0, mavlink.MAV_PARAM_TYPE_REAL32)
        frames = [bytes(message.pack(station.mav)) for message in (setting, STOPS["e-stop"]())]
        robot.write(RADIO, half_frame() + b"".join(frames))
        robot.run(PROMISE_TICKS)
        assert state_of(robot) == "estop"
        values = [m for m in station.run(800) if m.get_type() == "PARAM_VALUE"]
        assert [m.param_value for m in values] == [7.0]
        status = usb(robot).signing_status()
        assert (status.refused_unsigned, status.refused_wrong, status.refused_replayed) == (0, 0, 0)


def test_a_recorded_stop_in_a_half_frame_is_still_a_recording() -> None:
    with MemoryRobot() as robot:
        robot.run(100)
        usb(robot).give_key(KEY)
        station = Station(robot, key=KEY)
        assert station.command(ESTOP, 1) == mavlink.MAV_RESULT_ACCEPTED
        recording = station.frames[-1]
        assert station.command(ESTOP, 0) == mavlink.MAV_RESULT_ACCEPTED
        robot.write(RADIO, half_frame() + recording)
        robot.run(300)
        assert state_of(robot) == "disarmed"
        assert usb(robot).signing_status().refused_replayed == 1
        strange = bare_codec(0, bytes(32), START * 2)
        robot.write(
            RADIO, half_frame() + bytes(STOPS["e-stop"]().pack(strange)) + bytes(STOPS["e-stop"]().pack(bare_codec(0)))
        )
        robot.run(300)
        assert state_of(robot) == "disarmed"


@pytest.mark.parametrize("start", [V1, V2])
def test_noise_between_the_original_robots_lines_costs_one_line_and_no_stop(start: int) -> None:
    with MemoryRobot() as robot:
        robot.run(100)
        station = Station(robot)
        usb(robot).mav.param_set_send(1, 1, b"LINK2_LEGACY", 1.0, mavlink.MAV_PARAM_TYPE_REAL32)
        robot.run(10)
        assert station.command(ARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        robot.write(RADIO, b"0,0,0*0,0,0*")
        robot.run(5)
        before = usb(robot).signing_status().refused_lines
        robot.write(RADIO, bytes([start]) + b"0,0,0*0,0,0*" + bytes(STOPS["disarm"]().pack(station.mav)))
        robot.run(PROMISE_TICKS)
        assert state_of(robot) == "disarmed"
        assert usb(robot).signing_status().refused_lines == before + 1
