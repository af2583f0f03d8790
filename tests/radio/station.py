# SPDX-License-Identifier: MIT
"""A ground station of pymavlink's own codec and signing, on a port of a MemoryRobot."""

from __future__ import annotations

from typing import Any

from omniwheel.dialect import mavlink
from tests.radio.memory_robot import RADIO, USB, MemoryRobot

KEY = bytes(range(1, 33))
OTHER_KEY = bytes(range(101, 133))
YEAR = 100_000 * 86_400 * 365
START = 11 * YEAR
"""Signing clock at the tests' start [10 us since 2015]."""
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
GROUND_STATION = 255
PATIENCE_TICKS = 1500
"""At 9600 baud an answer may stand behind half a second of telemetry."""


class Station:
    """Sends frames and collects what the robot sends; ``time`` is the signing clock of pymavlink's codec."""

    def __init__(
        self,
        robot: MemoryRobot,
        port: int = RADIO,
        *,
        key: bytes | None = None,
        time: int = START,
        link_id: int = 0,
        system: int = GROUND_STATION,
    ) -> None:
        self.robot = robot
        self.port = port
        self.frames: list[bytes] = []
        self.mav = mavlink.MAVLink(self, system, 190)
        self.mav.robust_parsing = True
        if key is not None:
            self.mav.signing.secret_key = key
            self.mav.signing.sign_outgoing = True
            self.mav.signing.link_id = link_id
            self.mav.signing.timestamp = time

    def write(self, data: bytes) -> None:
        """Send a frame (pymavlink calls this)."""
        self.frames.append(bytes(data))
        self.robot.write(self.port, bytes(data))

    def run(self, ticks: int = 100) -> list[Any]:
        """Let the robot go on and return what it has said meanwhile."""
        self.robot.run(ticks)
        return list(self.mav.parse_buffer(self.robot.read(self.port)) or [])

    def command(self, number: int, *params: float) -> int | None:
        """Send a command and return the result of its acknowledgement, None if there was none."""
        self.mav.command_long_send(1, 1, number, 0, *[*params, *[0.0] * (7 - len(params))])
        for _ in range(PATIENCE_TICKS // 50):
            acks = [m for m in self.run(50) if m.get_type() == "COMMAND_ACK" and m.command == number]
            if acks:
                return int(acks[-1].result)
        return None

    def heartbeat(self) -> None:
        """Give a sign of life."""
        self.mav.heartbeat_send(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 0)

    def signing_status(self) -> Any:
        """Ask for OMNI_SIGNING."""
        self.mav.command_long_send(
            1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, mavlink.MAVLINK_MSG_ID_OMNI_SIGNING, 0, 0, 0, 0, 0, 0
        )
        return [m for m in self.run() if m.get_type() == "OMNI_SIGNING"][-1]

    def give_key(self, key: bytes, time: int = START) -> list[str]:
        """Send SETUP_SIGNING and return the status texts that follow."""
        self.mav.setup_signing_send(1, 1, list(key), time)
        return [m.text for m in self.run() if m.get_type() == "STATUSTEXT"]


def usb(robot: MemoryRobot) -> Station:
    """Return a station on the robot's USB port."""
    return Station(robot, USB)


def state_of(robot: MemoryRobot) -> str:
    """Return the robot's safety state, asked for over USB."""
    station = usb(robot)
    station.mav.command_long_send(
        1, 1, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, mavlink.MAVLINK_MSG_ID_OMNI_STATUS, 0, 0, 0, 0, 0, 0
    )
    status = [m for m in station.run() if m.get_type() == "OMNI_STATUS"][-1]
    return ("init", "disarmed", "armed", "failsafe", "estop")[status.state]
