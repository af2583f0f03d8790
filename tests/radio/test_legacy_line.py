# SPDX-License-Identifier: MIT
"""The original robot's setpoint lines on the radio, in lockstep, among MAVLink frames and noise."""

from __future__ import annotations

import random
from collections.abc import Iterator
from typing import Any

import pytest

from omniwheel.dialect import mavlink
from tests.firmware.client import Client
from tests.radio.memory_robot import RADIO, USB, MemoryRobot
from tests.radio.station import KEY

REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
ARMED, FAILSAFE = 2, 3


class MemoryClient(Client):
    """The lockstep client of the firmware tests, on a MemoryRobot's USB port."""

    def __init__(self, robot: MemoryRobot, radio: int = RADIO) -> None:
        self.robot = robot
        self.radio = radio
        super().__init__(socket=None)  # type: ignore[arg-type]

    def write(self, data: bytes) -> None:
        self.robot.write(USB, data)

    def pump(self, timeout_s: float = 0.0) -> bool:
        self.robot.run(1)
        data = self.robot.read(USB)
        self.inbox += self.mav.parse_buffer(data) or []
        return bool(data)

    def line(self, text: str | bytes) -> None:
        """Send bytes on the radio and let the robot read them."""
        self.robot.write(self.radio, text.encode() if isinstance(text, str) else text)
        self.robot.background()

    def refused_lines(self) -> int:
        assert self.command(REQUEST, mavlink.MAVLINK_MSG_ID_OMNI_SIGNING) == mavlink.MAV_RESULT_ACCEPTED
        return int(self.wait("OMNI_SIGNING").refused_lines)

    def reference(self) -> tuple[float, float, float]:
        x, y, theta = self.tick().actuators.reference
        return x, y, theta


@pytest.fixture
def client() -> Iterator[MemoryClient]:
    """A robot in lockstep that understands lines, disarmed."""
    with MemoryRobot(lockstep=True) as robot:
        client = MemoryClient(robot)
        client.wait("HEARTBEAT")
        assert client.set("LINK2_LEGACY", 1) == 1
        yield client


def drive(client: MemoryClient, lines: Any, seconds: float) -> Any:
    """Send a line every 50 ms, as the original host did; return the last tick's answer."""
    tick = None
    for n in range(round(seconds * 1000)):
        if n % 50 == 0:
            client.line(lines())
        tick = client.tick().actuators
    return tick


@pytest.mark.full
def test_the_robot_drives_to_the_point_with_nothing_but_lines(client: MemoryClient) -> None:
    client.armed()
    tick = drive(client, lambda: "0.3,-0.2,0.5*", 6.0)
    assert tick.state == ARMED  # longer than SAFE_LINK_TO: a line is a sign of life
    assert list(tick.pose) == pytest.approx([0.3, -0.2, 0.5], abs=2e-3)
    assert client.refused_lines() == 1  # the first: there was none before it to compare with


def test_six_numbers_feed_the_velocity_forward(client: MemoryClient) -> None:
    client.armed()
    drive(client, lambda: "0,0,0,0.1,0,0*\r\n", 1.0)
    assert client.refused_lines() == 1
    assert client.tick().actuators.state == ARMED


def test_silence_stops_the_robot_like_any_stream_and_half_lines_are_silence(client: MemoryClient) -> None:
    client.armed()
    drive(client, lambda: "0.3,0,0*", 1.0)
    tick = drive(client, lambda: "0.3,0,", 1.0)
    assert tick.state == FAILSAFE


def test_lines_never_arm(client: MemoryClient) -> None:
    client.heartbeat()
    tick = drive(client, lambda: "0.3,0,0*", 1.0)
    assert tick.state == 1
    assert list(tick.wheel_reference) == [0.0] * 4


def test_lines_mean_nothing_unless_asked_for() -> None:
    with MemoryRobot(lockstep=True) as robot:
        client = MemoryClient(robot)
        client.wait("HEARTBEAT")
        client.armed()
        drive(client, lambda: "0.3,0,0*", 0.4)
        assert client.reference() == (0.0, 0.0, 0.0)
        assert client.refused_lines() == 0


def test_lines_mean_nothing_while_a_signing_key_is_set(client: MemoryClient) -> None:
    client.mav.setup_signing_send(1, 1, list(KEY), 0)
    client.armed()
    drive(client, lambda: "0.3,0,0*", 0.4)
    assert client.reference() == (0.0, 0.0, 0.0)


BAD_LINES = [
    "nan,0,0*", "inf,0,0*", "0,0*", "0,0,0,0*", "0,0,0,0,0*", "0,0,0,0,0,0,0*", ",,*", "*", "0,,0*",
    "0 1,0,0*", "--1,0,0*",
    "1e,0,0*", "1e99,0,0*", ".,0,0*", "0,0,0,*", "0x1,0,0*", "1,0,0;*", "+,0,0*", "1.2.3,0,0*",
    "0,0," + "0" * 200 + "*", "0.1,\n0,0*",
]  # fmt: skip


@pytest.mark.parametrize("text", BAD_LINES)
def test_what_is_no_line_is_refused_and_counted_and_the_next_one_counts(client: MemoryClient, text: str) -> None:
    client.line("0.1,0,0*0.1,0,0*")
    before = client.refused_lines()
    client.line(text)
    assert client.refused_lines() == before + 1
    client.line("0.2,0.1,0.3*")
    assert client.refused_lines() == before + 1


@pytest.mark.parametrize("text", ["25,0,0*", "0,-25,0*", "0,0,0,5,0,0*", "0,0,0,0,0,9*", "3e30,0,0*"])
def test_a_point_beyond_the_limits_is_refused_with_its_reason(client: MemoryClient, text: str) -> None:
    client.armed()
    client.line(text + text)
    assert any("setpoint refused" in said for said in heard_texts(client))
    assert client.reference() == (0.0, 0.0, 0.0)


def heard_texts(client: MemoryClient) -> list[str]:
    return [m.text for tick in client.ticks(5) for m in tick.others if m.get_type() == "STATUSTEXT"]


@pytest.mark.full
@pytest.mark.parametrize(
    "text",
    ["0.25,-0.15,0.3125*", "+.25, -.150 ,3.125e-1*", "25e-2,-15E-2,0.0003125e+3*", "0.2500000000001,-0.15,.3125*"],
)
def test_numbers_may_be_written_as_programs_write_them(client: MemoryClient, text: str) -> None:
    client.armed()
    tick = drive(client, lambda: text, 5.0)
    assert list(tick.reference) == pytest.approx([0.25, -0.15, 0.3125], abs=2e-4)


@pytest.mark.full
def test_lines_and_frames_share_the_stream(client: MemoryClient) -> None:
    """A parameter is read over the radio between lines; a frame inside a line ends that line."""
    codec = mavlink.MAVLink(None, 255, 190)
    ask = bytes(mavlink.MAVLink_param_request_read_message(1, 1, b"WHEELS", -1).pack(codec))
    client.line(b"0.1,0,0*" + ask + b"0.1,0,0*" + ask)
    before = client.refused_lines()
    client.line(b"0.2," + ask + b"0,0*0.1,0,0*")
    assert client.refused_lines() == before + 2  # the half before the frame and the half behind it
    client.ticks(3000)  # the radio is paced by simulated time
    answers = mavlink.MAVLink(None).parse_buffer(client.robot.read(RADIO)) or []
    assert sum(m.get_type() == "PARAM_VALUE" and m.param_id == "WHEELS" for m in answers) == 3


def test_noise_between_lines_never_makes_another_point(client: MemoryClient) -> None:
    client.armed()
    draw = random.Random(5)
    for n in range(2000):
        noise = bytes(draw.randrange(256) for _ in range(draw.randrange(6)))
        client.line((b"*0.05,0,0*" if n % 3 == 0 else b"") + noise)
        tick = client.tick().actuators
        assert tick.state == ARMED
        assert abs(tick.reference[0]) <= 0.0501
        assert (tick.reference[1], tick.reference[2]) == (0.0, 0.0)


@pytest.mark.parametrize("radio", [1, 2, 3])
def test_lines_and_baud_rate_belong_to_the_radio_on_whichever_port_it_is(radio: int) -> None:
    with MemoryRobot(lockstep=True, radio=radio) as robot:
        client = MemoryClient(robot, radio)
        client.wait("HEARTBEAT")
        assert client.set("LINK2_BAUD", 57600) == 57600
        for _ in range(1000):  # what was said at the old speed leaves first
            client.tick()
        assert robot.baud == 57600
        assert client.set("LINK2_LEGACY", 1) == 1
        client.armed()
        for port in range(1, radio):  # lines elsewhere are noise
            for _ in range(3):
                robot.write(port, b"0.9,0.9,0*")
                robot.background()
        assert drive(client, lambda: "0.1,0,0*", 0.2).reference[0] > 0.0
        assert client.refused_lines() == 1
        assert client.reference()[1] == 0.0


@pytest.mark.parametrize("text", ["nan,0,0*", "0,0*", "*"])
def test_a_bad_line_before_any_good_one_is_refused(client: MemoryClient, text: str) -> None:
    before = client.refused_lines()
    client.line(text)
    assert client.refused_lines() == before + 1
