# SPDX-License-Identifier: MIT
"""Stops of other stations and programs while a check runs: such a stop ends the check and stays on.

The robot has one emergency stop for all stations. So a check releases only the stop that it made itself.
"""

from __future__ import annotations

from collections.abc import Callable

from omniwheel.dialect import Message, mavlink
from omniwheel.errors import CommandRefusedError, OmniError
from omniwheel.hub import notices
from omniwheel.robot import Robot
from omniwheel.telemetry import Status, StatusText, decode
from omniwheel.texts import STOPPED_BY

OPENED = "stop button open"
"""How the robot begins to say that its stop button was pressed."""
_SETTLE_S = 0.3
"""The robot's state may come before the text that says why."""
_HINT = "it is not released by this check; once it is safe: `omni stop --release`, then repeat the check"


def safety_of(robot: Robot) -> Status:
    """Ask for OMNI_STATUS."""
    status = decode(Status, robot.commands.request_message(Status.message, robot.timeout_s))
    assert status is not None
    return status


class OtherStopError(OmniError):
    """An emergency stop that this check did not make; it stays on."""


class OtherStops:
    """Listens for stops of others while the context lasts.

    What it takes for one: a text that the robot or the hub says of it, and the answer to an emergency stop, or to its
    release, that was not sent from here.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._who = ""
        self._mark = robot.texts.mark()
        self._remove: Callable[[], None] = lambda: None

    def __enter__(self) -> OtherStops:
        self._remove = self._robot.connection.add_listener(self._take)
        return self

    def __exit__(self, *_: object) -> None:
        self._remove()

    def _take(self, message: Message) -> None:
        text = decode(StatusText, message)
        if text is not None and (text.text.startswith(STOPPED_BY) or notices.names_program(text.text)):
            self._who = text.text
        elif message.get_type() == "COMMAND_ACK" and self._is_of_others_estop(message):
            self._who = self._who or "which one is unknown"

    def _is_of_others_estop(self, ack: Message) -> bool:
        accepted = ack.command == mavlink.MAV_CMD_OMNI_ESTOP and ack.result == mavlink.MAV_RESULT_ACCEPTED
        return accepted and self._robot.commands.is_of_another(ack)

    def require_none(self) -> None:
        """Raise OtherStopError if another station has stopped the robot since the context began."""
        if self._who:
            raise OtherStopError(f"another station or program stopped the robot ({self._who})", hint=_HINT)

    def require_no_estop(self) -> None:
        """Raise OtherStopError if the robot is in an emergency stop, from wherever: none was made here."""
        self.require_none()
        if safety_of(self._robot).state == "estop":
            self._robot.pump(_SETTLE_S)
            self.require_none()
            pressed = next((text for text in self._robot.texts.since(self._mark) if text.text.startswith(OPENED)), None)
            cause = "" if pressed is None else f" ({pressed.text})"
            raise OtherStopError(f"an e-stop is active that this check did not trigger{cause}", hint=_HINT)

    def release_own(self) -> None:
        """Release the emergency stop that this check has made. Raises OtherStopError if it is not the only one."""
        self.require_none()
        try:
            self._robot.estop_clear(after_own_stop=True)
        except CommandRefusedError as refusal:
            raise OtherStopError(f"the e-stop stays active: {refusal}", hint=_HINT) from refusal
