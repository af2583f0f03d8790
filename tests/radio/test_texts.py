# SPDX-License-Identifier: MIT
"""Who is told what, how often, and that the answer to a stop waits for none of it."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest

from omniwheel.dialect import mavlink
from tests.radio.answers import FLOODS, ack_ticks, flooded
from tests.radio.memory_robot import RADIO, MemoryRobot
from tests.radio.station import ARM, KEY, Station, usb

BAD_REQUESTS = 200
PERIOD_TICKS = 50
QUICK_TICKS = 200
"""At 9600 baud 35 signed bytes take 37 ms; a frame of 100 bytes that has begun takes 104 ms."""


def texts_of(messages: list[mavlink.MAVLink_message]) -> list[str]:
    return [m.text for m in messages if m.get_type() == "STATUSTEXT"]


def left_out(texts: list[str], what: str) -> int:
    return sum(int(found[1]) for text in texts if (found := re.match(rf"(\d+) {what} left out", text)))


@pytest.mark.parametrize("flood", FLOODS.values(), ids=FLOODS.keys())
@pytest.mark.parametrize("key", [None, KEY], ids=["open", "signed"])
def test_the_answer_to_a_stop_on_a_slow_radio_comes_before_everything(
    flood: Callable[[MemoryRobot, Station, Station, int], None], key: bytes | None
) -> None:
    assert ack_ticks(flood, key) <= QUICK_TICKS


def test_an_answer_that_overtakes_makes_no_signed_frame_too_old() -> None:
    with flooded(FLOODS["bad requests on USB and heartbeats at 100 Hz"], KEY) as (_, _, station):
        station.mav.command_long_send(1, 1, mavlink.MAV_CMD_OMNI_ESTOP, 0, 1, 0, 0, 0, 0, 0, 0)
        heard = station.run(3000)
        assert "COMMAND_ACK" in [m.get_type() for m in heard]
        assert [m for m in heard if m.get_type() == "BAD_DATA" or not m.get_signed()] == []
        assert station.mav.signing.badsig_count == 0


def test_refusals_go_to_the_asker_alone_a_few_at_a_time_and_what_is_left_out_is_counted() -> None:
    with MemoryRobot() as robot:
        robot.run(2000)
        station, radio = usb(robot), Station(robot)
        heard = station.run(1), radio.run(1)
        heard = [], []
        for _ in range(BAD_REQUESTS):
            station.mav.param_request_read_send(1, 1, b"NO_SUCH", -1)
            heard[0].extend(station.run(PERIOD_TICKS))
            heard[1].extend(radio.run(0))
        heard[0].extend(station.run(5000))
        heard[1].extend(radio.run(5000))
        texts = texts_of(heard[0])
        said = [text for text in texts if "unknown" in text]
        assert len(texts) <= 10 + BAD_REQUESTS * PERIOD_TICKS // 1000 + 5
        assert len(said) + left_out(texts, "more refusals") == BAD_REQUESTS
        assert texts_of(heard[1]) == []


REFUSED: dict[str, Callable[[mavlink.MAVLink], None]] = {
    "an unknown parameter": lambda m: m.param_set_send(1, 1, b"NO_SUCH", 1.0, 9),
    "a value out of range": lambda m: m.param_set_send(1, 1, b"SYS_ID", 0.0, 9),
    "a wrong type": lambda m: m.param_set_send(1, 1, b"SYS_ID", 2.0, 6),
    "a setpoint": lambda m: m.omni_setpoint_duty_send(1, 1, [9.0, 0.0, 0.0, 0.0]),
    "a pose fix": lambda m: m.vicon_position_estimate_send(0, float("nan"), 0.0, 0.0, 0.0, 0.0, 0.0),
    "a trajectory": lambda m: m.command_long_send(1, 1, mavlink.MAV_CMD_OMNI_TRAJECTORY_START, 0, 99, 0, 0, 0, 0, 0, 0),
    "a waypoint": lambda m: m.command_long_send(1, 1, mavlink.MAV_CMD_OMNI_WAYPOINT, 0, 9, 0, 0, 0, 0, 0, 0),
    "a mode": lambda m: m.set_mode_send(1, 1, 2),
    "a pose": lambda m: m.command_long_send(
        1, 1, mavlink.MAV_CMD_OMNI_SET_POSE, 0, float("inf"), 0, 0, 0, 0, 0, 0
    ),
    "an output-enable test": lambda m: m.command_long_send(1, 1, mavlink.MAV_CMD_OMNI_OE_TEST, 0, 9, 0, 0, 0, 0, 0, 0),
    "a key over the radio": lambda m: m.setup_signing_send(1, 1, list(KEY), 0),
}  # fmt: skip


@pytest.mark.parametrize("ask", REFUSED.values(), ids=REFUSED.keys())
def test_every_refusal_is_said_to_the_asker_and_to_nobody_else(ask: Callable[[mavlink.MAVLink], None]) -> None:
    with MemoryRobot() as robot:
        robot.run(3000)
        station, other = Station(robot, RADIO), usb(robot)
        station.run(0), other.run(0)
        ask(station.mav)
        heard, overheard = station.run(700), other.run(0)
        assert texts_of(heard) != []
        assert texts_of(overheard) == []
        for _ in range(60):  # 20 a second for three seconds
            ask(station.mav)
            robot.run(50)
        assert len(texts_of(station.run(2000))) <= 10 + 5 + 2


def test_news_goes_to_everybody_a_few_at_a_time_and_what_is_left_out_is_counted() -> None:
    """A program that arms and disarms as fast as it can."""
    with MemoryRobot() as robot:
        robot.run(2000)
        station, radio = usb(robot), Station(robot)
        radio.run(1), station.run(1)
        for number in range(200):
            station.mav.command_long_send(1, 1, ARM, 0, 1 - number % 2, 0, 0, 0, 0, 0, 0)
            robot.run(20)
        texts = texts_of(radio.run(5000))
        assert "armed" in texts
        assert len(texts) <= 10 + 2 * 9 + 3
        over_usb = texts_of(station.run(0))
        told, others = [
            sum("arm" in text and "cannot" not in text for text in link) + left_out(link, "messages")
            for link in (texts, over_usb)
        ]
        assert told == others > 2 * len(texts)


LOCKED_WHILE_ARMED = {
    "save": mavlink.MAV_CMD_PREFLIGHT_STORAGE,
    "set the pose": mavlink.MAV_CMD_OMNI_SET_POSE,
    "scan the bus": mavlink.MAV_CMD_OMNI_I2C_SCAN,
    "host-in-the-loop": mavlink.MAV_CMD_OMNI_HIL,
    "reboot": mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN,
}


@pytest.mark.parametrize("command", LOCKED_WHILE_ARMED.values(), ids=LOCKED_WHILE_ARMED.keys())
def test_a_command_right_behind_a_disarm_is_to_be_tried_again_not_denied(command: int) -> None:
    """The answer to a stop comes before the report that it is done."""
    with MemoryRobot() as robot:
        robot.run(100)
        station = usb(robot)
        assert station.command(ARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        assert station.command(command, 1) == mavlink.MAV_RESULT_DENIED
        station.run(20)
        station.mav.command_long_send(1, 1, ARM, 0, 0, 0, 0, 0, 0, 0, 0)
        station.mav.command_long_send(1, 1, command, 0, 1, 0, 0, 0, 0, 0, 0)
        heard = station.run(20)
        results = [m.result for m in heard if m.get_type() == "COMMAND_ACK"]
        assert results == [mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED]
        assert "disarm first" not in " ".join(texts_of(heard))
        assert station.command(command, 1) == mavlink.MAV_RESULT_ACCEPTED


@pytest.mark.parametrize(
    "ask",
    [lambda m: m.setup_signing_send(1, 1, list(KEY), 0), lambda m: m.param_set_send(1, 1, b"WHEELS", 3.0, 9)],
    ids=["a key", "a locked parameter"],
)
def test_what_has_no_result_says_right_behind_a_disarm_that_it_is_to_be_tried_again(
    ask: Callable[[mavlink.MAVLink], None],
) -> None:
    with MemoryRobot() as robot:
        robot.run(100)
        station = usb(robot)
        assert station.command(ARM, 1) == mavlink.MAV_RESULT_ACCEPTED
        ask(station.mav)
        assert any("disarm first" in text for text in texts_of(station.run(20)))
        station.mav.command_long_send(1, 1, ARM, 0, 0, 0, 0, 0, 0, 0, 0)
        ask(station.mav)
        refusals = [text for text in texts_of(station.run(20)) if "refused" in text]
        assert len(refusals) == 1
        assert "still stopping, try again" in refusals[0]
        ask(station.mav)
        assert [text for text in texts_of(station.run(20)) if "refused" in text] == []
