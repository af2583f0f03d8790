# SPDX-License-Identifier: MIT
"""MAVLink commands and their acknowledgements: sent again until answered, a refusal raised with its reasons.

Arm and disarm are the same command, and COMMAND_ACK has no copy of the parameters. A late or repeated answer to "arm"
looks like one to "disarm". So every command carries a number in param5, which no command of the robot uses. The robot
answers with the CRC-32 of all parameters in ``result_param2``. A robot that answers 0 there does not know this: it is
believed until it has shown once that it does.
"""

from __future__ import annotations

import struct
import zlib

from omniwheel.connection import Connection
from omniwheel.dialect import Message, enum_name, mavlink
from omniwheel.errors import ArmingRefusedError, CommandRefusedError, LinkTimeoutError
from omniwheel.texts import TextLog

ACK_TIMEOUT_S = 1.0
TRIES = 10
"""On a radio that loses a fifth of the packets, half of the exchanges fail."""
BUSY_TIMEOUT_S = 2.0
ARMING_TIMEOUT_S = 5.0
"""It is not armed while a wheel turns: after full speed those of `fast_three_wheel` coast for 3.4 s."""
BUSY_PERIOD_S = 0.05
USED_PARAMS = 4
_LAST_NUMBER = 65535


class Commander:
    """Sends commands to the connected robot."""

    def __init__(self, connection: Connection, texts: TextLog) -> None:
        self._connection = connection
        self._texts = texts
        self._number = 0
        self._receipts = False  # the robot has given one

    def send(self, command: int, *params: float, what: str, last: tuple[float, float] = (0.0, 0.0)) -> None:
        """Send a COMMAND_LONG and wait for its COMMAND_ACK.

        ``params`` are up to four, ``last`` the sixth and seventh. ``what`` describes it in errors ("to arm"). Raises
        CommandRefusedError (ArmingRefusedError for arming) or LinkTimeoutError.
        """
        mark = self._texts.mark()
        self._connection.beat()  # after a silence the robot must hear first that somebody is there
        arming = command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and bool(params and params[0])
        ack = self._settled(command, params, last, ARMING_TIMEOUT_S if arming else BUSY_TIMEOUT_S)
        if ack is None:
            raise LinkTimeoutError(f"the robot does not answer the command {what}")
        if ack.result != mavlink.MAV_RESULT_ACCEPTED:
            result = enum_name("MAV_RESULT", ack.result, "MAV_RESULT_")
            refusal = ArmingRefusedError if arming else CommandRefusedError
            raise refusal(what, result, self._texts.reasons_since(mark))

    def _settled(
        self, command: int, params: tuple[float, ...], last: tuple[float, float], timeout_s: float
    ) -> Message | None:
        """Return the acknowledgement; "temporarily rejected", as while it starts up, is tried again for a while."""
        end = self._connection.clock() + timeout_s
        while True:
            ack = self._acknowledged(command, params, last)
            busy = ack is not None and ack.result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED
            if not busy or self._connection.clock() >= end:
                return ack
            self._connection.pump(BUSY_PERIOD_S)

    def _numbered(self, params: tuple[float, ...], last: tuple[float, float]) -> tuple[list[float], int]:
        """Return all seven parameters with the next number in the fifth, and the receipt that answers them."""
        self._number = self._number % _LAST_NUMBER + 1
        numbered = [*params, *[0.0] * (USED_PARAMS - len(params)), float(self._number), *last]
        (receipt,) = struct.unpack("<i", struct.pack("<I", zlib.crc32(struct.pack("<7f", *numbered))))
        return numbered, receipt

    def _answers(self, message: Message, command: int, receipt: int) -> bool:
        if message.get_type() != "COMMAND_ACK" or message.command != command:
            return False
        if message.result_param2 == receipt:
            self._receipts = True
            return True
        return message.result_param2 == 0 and not self._receipts

    def _acknowledged(self, command: int, params: tuple[float, ...], last: tuple[float, float]) -> Message | None:
        numbered, receipt = self._numbered(params, last)
        for confirmation in range(TRIES):
            self._connection.send(
                mavlink.MAVLink_command_long_message(
                    self._connection.target_system, self._connection.target_component, command, confirmation, *numbered
                )
            )
            ack = self._connection.wait(lambda m: self._answers(m, command, receipt), ACK_TIMEOUT_S)
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
