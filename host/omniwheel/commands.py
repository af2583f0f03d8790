# SPDX-License-Identifier: MIT
"""MAVLink commands and their acknowledgements: sent again until answered, a refusal raised with its reasons.

Arm and disarm are the same command, and COMMAND_ACK has no copy of the parameters. A late or repeated answer to "arm"
looks like one to "disarm". So every command carries a number in param5, which no command of the robot uses. The robot
answers with the CRC-32 of all parameters in ``result_param2``. A robot that answers 0 there does not know this: it is
believed until it has shown once that it does.

A command keeps its number through all of its copies, also after "temporarily rejected". By it the robot knows a copy
of what it has executed already, and of what somebody's stop has made void (docs/reference/protocol.md, Commands).
"""

from __future__ import annotations

import struct
import zlib
from collections import deque
from collections.abc import Callable

from omniwheel.connection import Connection
from omniwheel.dialect import Message, enum_name, mavlink
from omniwheel.errors import ArmingRefusedError, CommandRefusedError, LinkTimeoutError, SetpointError
from omniwheel.hub import notices
from omniwheel.monitored import monitored
from omniwheel.texts import STOPPED_BY, TextLog

ACK_TIMEOUT_S = 1.0
TRIES = 10
"""On a radio that loses a fifth of the packets, half of the exchanges fail."""
HURRIED, HURRY_S = 3, 0.12
"""Copies of a command in a hurry, and the time between them: all are sent within SAFE_CMD_TO, 0.5 s by default."""
BUSY_TIMEOUT_S = 2.0
ARMING_TIMEOUT_S = 5.0
"""It is not armed while a wheel turns: after full speed those of `fast_three_wheel` coast for 3.4 s."""
BUSY_PERIOD_S = 0.05
USED_PARAMS = 4
CANCELLED = "CANCELLED"
"""Result of a command that is not repeated any more, because another station or program has stopped the robot."""
_LAST_NUMBER = 65535
_LAST_CONFIRMATION = 255
_RECEIPTS_KEPT = 64
_BUSY = mavlink.MAV_RESULT_TEMPORARILY_REJECTED


def begins_motion(command: int, first: float) -> bool:
    """Return whether a command with this first parameter begins a motion, or releases an emergency stop."""
    if command == mavlink.MAV_CMD_OMNI_ESTOP:
        return first == 0.0
    if command in (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, mavlink.MAV_CMD_OMNI_EXCITE):
        return first != 0.0
    return bool(command == mavlink.MAV_CMD_OMNI_TRAJECTORY_START)


@monitored("_connection")
class Commander:
    """Sends commands to the connected robot."""

    def __init__(self, connection: Connection, texts: TextLog) -> None:
        self._connection = connection
        self._texts = texts
        # Another program of this station may have used the first numbers a moment ago.
        self._number = int(connection.clock() * 1e3) % _LAST_NUMBER
        self._receipts = False  # the robot has given one
        self._sent: deque[int] = deque(maxlen=_RECEIPTS_KEPT)

    def send(
        self,
        command: int,
        *params: float,
        what: str,
        last: tuple[float, float] = (0.0, 0.0),
        after_own_stop: bool = False,
        hurry: bool = False,
    ) -> None:
        """Send a COMMAND_LONG and wait for its COMMAND_ACK.

        ``params`` are up to four, ``last`` the sixth and seventh. ``what`` describes it in errors ("to arm"). A command
        that begins a motion is not repeated once the robot has said that another station stopped it, or the hub that
        another program did. With ``after_own_stop`` the first copy, too, counts as a repetition: the robot refuses it
        if the latest stop within 15 s came from another sender. With ``hurry`` the first copies follow each other
        quickly: for a command that has to be there before a setpoint grows old. Raises CommandRefusedError
        (ArmingRefusedError for arming), LinkTimeoutError, or SetpointError for a number that fits no float32.
        """
        mark = self._texts.mark()
        numbered, receipt = self._numbered(params, last, what)
        self._connection.beat()  # after a silence the robot must hear first that somebody is there
        arming = command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and bool(params and params[0])
        refusal = ArmingRefusedError if arming else CommandRefusedError
        stops_void = begins_motion(command, numbered[0])
        answers: list[Message] = []
        end_s = self._connection.clock() + (ARMING_TIMEOUT_S if arming else BUSY_TIMEOUT_S)

        def before_repeating() -> None:
            if stops_void and self._is_stopped(mark):
                raise refusal(what, CANCELLED, self._texts.reasons_since(mark))

        remove = self._connection.add_listener(
            lambda m: answers.append(m) if self._answers(m, command, receipt) else None
        )
        try:
            if hurry:
                self._hurry(command, numbered, answers)
            ack = self._settled(command, numbered, answers, end_s, before_repeating, int(after_own_stop))
        finally:
            remove()
        if ack is None:
            raise LinkTimeoutError(f"the robot does not answer the command {what}")
        if ack.result != mavlink.MAV_RESULT_ACCEPTED:
            result = enum_name("MAV_RESULT", ack.result, "MAV_RESULT_")
            raise refusal(what, result, self._texts.reasons_since(mark))

    def _settled(
        self,
        command: int,
        numbered: list[float],
        answers: list[Message],
        end_s: float,
        before_repeating: Callable[[], None],
        first_confirmation: int,
    ) -> Message | None:
        """Send copies until one is answered; "temporarily rejected" is tried again until ``end_s``.

        ``answers`` get the answers as they come. ``first_confirmation`` is that of the first copy. Returns the one
        that counts, or None after ten silent tries.
        """
        if (answer := _final(answers)) is not None:
            return answer
        copies = silent = 0
        while silent < TRIES:
            if copies:
                before_repeating()
            known = len(answers)
            self._send_copy(command, numbered, first_confirmation + copies)
            copies += 1
            self._await_answer(answers, known)
            silent = silent + 1 if len(answers) == known else 0
            over = not silent and self._connection.clock() >= end_s
            if over and len(answers) < copies:  # this may be the answer to an earlier copy
                self._await_answer(answers, len(answers))
            elif not silent and not over and _final(answers) is None:
                self._connection.wait(lambda _: False, BUSY_PERIOD_S)
            final = _final(answers)
            if final is not None or over:
                return final or answers[-1]
        return None

    def _hurry(self, command: int, numbered: list[float], answers: list[Message]) -> None:
        """Send copies until one is answered. The robot knows copies of a command that it has executed."""
        for _ in range(HURRIED):
            self._send_copy(command, numbered, 0)
            self._connection.wait(lambda _: bool(answers), HURRY_S)
            if answers:
                return

    def _send_copy(self, command: int, numbered: list[float], confirmation: int) -> None:
        target = self._connection.target_system, self._connection.target_component
        count = min(confirmation, _LAST_CONFIRMATION)
        self._connection.send(mavlink.MAVLink_command_long_message(*target, command, count, *numbered))

    def _await_answer(self, answers: list[Message], known: int) -> None:
        self._connection.wait(lambda _: len(answers) > known, ACK_TIMEOUT_S)

    def _is_stopped(self, mark: int) -> bool:
        texts = [text.text for text in self._texts.since(mark)]
        return any(text.startswith(STOPPED_BY) or notices.is_stop(text) for text in texts)

    def _numbered(self, params: tuple[float, ...], last: tuple[float, float], what: str) -> tuple[list[float], int]:
        """Return all seven parameters with the next number in the fifth, and the receipt that answers them."""
        self._number = self._number % _LAST_NUMBER + 1
        numbered = [*params, *[0.0] * (USED_PARAMS - len(params)), float(self._number), *last]
        try:
            packed = struct.pack("<7f", *numbered)
        except (OverflowError, struct.error) as error:
            raise SetpointError(f"a parameter of the command {what} does not fit a float32: {error}") from error
        (receipt,) = struct.unpack("<i", struct.pack("<I", zlib.crc32(packed)))
        self._sent.append(receipt)
        return numbered, receipt

    def is_of_another(self, ack: Message) -> bool:
        """Return whether a COMMAND_ACK answers the command of another sender, as a hub or a shared radio brings it."""
        return ack.result_param2 not in self._sent and (self._receipts or ack.result_param2 != 0)

    def _answers(self, message: Message, command: int, receipt: int) -> bool:
        if message.get_type() != "COMMAND_ACK" or message.command != command:
            return False
        if message.result_param2 == receipt:
            self._receipts = True
            return True
        return message.result_param2 == 0 and not self._receipts

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


def _final(answers: list[Message]) -> Message | None:
    """Return the first answer that is more than "temporarily rejected"."""
    return next((answer for answer in answers if answer.result != _BUSY), None)


def message_id(name: str) -> int:
    """Return the id of the message called ``name``; raise SetpointError if the dialect has none."""
    for number, message in mavlink.mavlink_map.items():
        if message.msgname == name:
            return int(number)
    raise SetpointError(f"there is no MAVLink message {name} in the dialect")
