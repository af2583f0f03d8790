# SPDX-License-Identifier: MIT
"""A hub on a clock that the test moves, clients made of a pymavlink codec each, and a robot that only answers."""

from __future__ import annotations

from typing import Any

from omni.hub.core import Hub, HubSettings
from omniwheel.dialect import HUB_COMPONENT, TRIAL_ASK, TRIAL_BEGIN, mavlink
from omniwheel.signing import Signer

TRIAL = mavlink.MAV_CMD_OMNI_TRIAL
ARM = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
DENIED, ACCEPTED = mavlink.MAV_RESULT_DENIED, mavlink.MAV_RESULT_ACCEPTED
LATER = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
WIDE = HubSettings("port", 200_000.0, 20_000.0)


def command(number: int, *parameters: float, count: int = 0) -> Any:
    """Return a COMMAND_LONG; ``count`` is the number that asks for a receipt."""
    padded = [*parameters, *[0.0] * (4 - len(parameters)), float(count), 0.0, 0.0]
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *padded)


def setpoint(speed: float = 0.1) -> Any:
    """Return a velocity setpoint."""
    return mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 8, 0b0000011111000111, 0, 0, 0, speed, 0, 0, 0, 0, 0, 0, 0
    )


def beat() -> Any:
    """Return a ground station's heartbeat."""
    return mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)


class Station:
    """A client: what it sends goes into the hub at once, what it got is :attr:`inbox` after :meth:`Bench.run`."""

    def __init__(self, bench: Bench, name: str, system: int = 255) -> None:
        self.bench = bench
        self.number = bench.hub.join(name)
        self.codec: Any = mavlink.MAVLink(self, system, 190)
        self.inbox: list[Any] = []
        self.raw = bytearray()

    def write(self, frame: bytes) -> None:
        """Give a frame to the hub (the codec calls this)."""
        self.bench.hub.from_client(self.number, bytes(frame))

    def send(self, *messages: Any) -> None:
        """Send messages one after the other."""
        for message in messages:
            self.codec.send(message)

    def collect(self) -> None:
        """Take what the hub has for this client."""
        data = self.bench.hub.to_client(self.number)
        self.raw += data
        self.inbox += self.codec.parse_buffer(data) or ()

    def got(self, name: str) -> list[Any]:
        """Return the messages of this name that have come so far."""
        return [message for message in self.inbox if message.get_type() == name]

    def texts(self) -> list[str]:
        """Return the status texts so far."""
        return [message.text for message in self.got("STATUSTEXT")]

    def results(self, number: int = ARM) -> list[int]:
        """Return the results of the acknowledgements of a command."""
        return [message.result for message in self.got("COMMAND_ACK") if message.command == number]


def _is_look(message: Any) -> bool:
    if message.get_srcComponent() != HUB_COMPONENT:
        return False
    asks = message.get_type() == "COMMAND_LONG" and (message.command, message.param1) == (TRIAL, TRIAL_ASK)
    return asks or message.get_type() == "PARAM_REQUEST_READ"


class Bench:
    """Hub, robot and clock. ``sent`` is what went to the robot: (second, message).

    ``looks`` are apart: what the hub itself asks of a robot that it begins to serve. ``everything`` is both.
    """

    def __init__(self, settings: HubSettings = WIDE, signer: Signer | None = None, *, opened: bool = True) -> None:
        self.now_s = 0.0
        self.hub = Hub(settings, lambda: self.now_s, signer)
        self.sent: list[tuple[float, Any]] = []
        self.looks: list[tuple[float, Any]] = []
        self.everything: list[Any] = []
        self.frames: list[tuple[float, bytes]] = []
        self.stations: list[Station] = []
        self.answers = True
        self.trial_goes_on = False
        self._robot: Any = mavlink.MAVLink(self, 1, 1)
        self._parser: Any = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        if opened:
            self.hub.port_opened()

    def join(self, name: str, system: int = 255) -> Station:
        """Add a client."""
        self.stations.append(Station(self, name, system))
        return self.stations[-1]

    def leave(self, station: Station) -> None:
        """Let a client go."""
        station.collect()
        self.stations.remove(station)
        self.hub.leave(station.number)

    def write(self, frame: bytes) -> None:
        """Take a frame of the robot (its codec calls this)."""
        self.hub.from_port(bytes(frame))

    def robot_sends(self, message: Any) -> None:
        """Let the robot say something."""
        self._robot.send(message)

    def robot_system(self, number: int) -> None:
        """Give the robot another SYS_ID."""
        self._robot.srcSystem = number

    def robot_is(self, *, armed: bool) -> None:
        """Let the robot's heartbeat come."""
        mode = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        self.robot_sends(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GROUND_ROVER, mavlink.MAV_AUTOPILOT_GENERIC, mode, 0, 4, 3
            )
        )

    def run(self, duration_s: float = 0.01, step_s: float = 0.001) -> None:
        """Move the clock on; what the hub has for the robot and for the clients arrives."""
        for _ in range(max(1, round(duration_s / step_s))):
            self.now_s += step_s
            while frame := self.hub.to_port():
                self.frames.append((self.now_s, frame))
                for message in self._parser.parse_buffer(frame) or ():
                    self.everything.append(message)
                    (self.looks if _is_look(message) else self.sent).append((self.now_s, message))
                    self._answer(message)
            for station in self.stations:
                station.collect()

    def _answer(self, message: Any) -> None:
        if self.answers and message.get_type() == "COMMAND_LONG":
            from omni.hub.rules import receipt_of

            whom = (message.get_srcSystem(), message.get_srcComponent())
            receipt = receipt_of(message)
            if message.command == TRIAL and message.target_system != self._robot.srcSystem:
                return
            result = self._try_parameters(message.param1) if message.command == TRIAL else ACCEPTED
            self.robot_sends(mavlink.MAVLink_command_ack_message(message.command, result, 0, receipt, *whom))

    def _try_parameters(self, action: float) -> int:
        """Answer as firmware/app/services/parameter_trial.cpp does to the station of the trial."""
        accepted, denied = int(ACCEPTED), int(DENIED)
        if self.trial_goes_on == (action == TRIAL_BEGIN):
            return denied
        self.trial_goes_on = action in (TRIAL_BEGIN, TRIAL_ASK)
        return accepted

    def names(self) -> list[str]:
        """Return the names of what went to the robot."""
        return [message.get_type() for _, message in self.sent]

    def commands(self, number: int) -> list[Any]:
        """Return the commands with this number that went to the robot."""
        return [m for _, m in self.sent if m.get_type() == "COMMAND_LONG" and m.command == number]
