# SPDX-License-Identifier: MIT
"""MAVLink commands and their acknowledgements: sent again until answered, a refusal raised with its reasons."""

from __future__ import annotations

from omniwheel.connection import Connection
from omniwheel.dialect import Message, enum_name, mavlink
from omniwheel.errors import ArmingRefusedError, CommandRefusedError, LinkTimeoutError
from omniwheel.texts import TextLog

ACK_TIMEOUT_S = 1.0
TRIES = 10
"""On a radio that loses a fifth of the packets, half of the exchanges fail."""
BUSY_TIMEOUT_S = 2.0
BUSY_PERIOD_S = 0.05
PARAMS = 7


class Commander:
    """Sends commands to the connected robot."""

    def __init__(self, connection: Connection, texts: TextLog) -> None:
        self._connection = connection
        self._texts = texts

    def send(self, command: int, *params: float, what: str) -> None:
        """Send a COMMAND_LONG and wait for its COMMAND_ACK.

        ``what`` describes it in errors ("to arm"). Raises CommandRefusedError (ArmingRefusedError for arming) or
        LinkTimeoutError.
        """
        mark = self._texts.mark()
        ack = self._settled(command, [*params, *[0.0] * (PARAMS - len(params))])
        if ack is None:
            raise LinkTimeoutError(f"the robot does not answer the command {what}")
        if ack.result != mavlink.MAV_RESULT_ACCEPTED:
            result = enum_name("MAV_RESULT", ack.result, "MAV_RESULT_")
            arming = command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and bool(params and params[0])
            refusal = ArmingRefusedError if arming else CommandRefusedError
            raise refusal(what, result, self._texts.reasons_since(mark))

    def _settled(self, command: int, params: list[float]) -> Message | None:
        """Return the acknowledgement; "temporarily rejected", as while it starts up, is tried again for a while."""
        end = self._connection.clock() + BUSY_TIMEOUT_S
        while True:
            ack = self._acknowledged(command, params)
            busy = ack is not None and ack.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
            if not busy or self._connection.clock() >= end:
                return ack
            self._connection.pump(BUSY_PERIOD_S)

    def _acknowledged(self, command: int, params: list[float]) -> Message | None:
        for confirmation in range(TRIES):
            self._connection.send(
                mavlink.MAVLink_command_long_message(
                    self._connection.target_system, self._connection.target_component, command, confirmation, *params
                )
            )
            ack = self._connection.wait(lambda m: m.get_type() == "COMMAND_ACK" and m.command == command, ACK_TIMEOUT_S)
            if ack is not None:
                return ack
        return None

    def request_message(self, name: str, timeout_s: float) -> Message:
        """Have the robot send one message now and return it. Raises CommandRefusedError or LinkTimeoutError."""
        number = message_id(name)
        arrived: list[Message] = []
        remove = self._connection.add_listener(lambda m: arrived.append(m) if m.get_type() == name else None)
        try:
            self.send(mavlink.MAV_CMD_REQUEST_MESSAGE, number, what=f"to send {name}")
            if not arrived:
                self._connection.wait(lambda _: bool(arrived), timeout_s)
        finally:
            remove()
        if not arrived:
            raise LinkTimeoutError(f"the robot accepted the request for {name} but did not send it")
        return arrived[-1]


def message_id(name: str) -> int:
    """Return the id of the message called ``name``; raise ValueError if the dialect has none."""
    for number, message in mavlink.mavlink_map.items():
        if message.msgname == name:
            return int(number)
    raise ValueError(f"there is no MAVLink message {name} in the dialect")
