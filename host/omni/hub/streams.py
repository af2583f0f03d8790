# SPDX-License-Identifier: MIT
"""The clients' wishes for telemetry, merged: the robot hears of each message the fastest rate that anybody wants.

A client without a wish wants the rate at boot. So no other client makes a message slower for it, or switches it off.
"""

from __future__ import annotations

from collections import Counter

from omni.hub.boot_rates import BootRates, messages_of
from omni.hub.pending import Question
from omni.hub.rules import NO_CLIENT
from omniwheel.dialect import Message, mavlink

OFF_US = -1.0
AT_BOOT_US = 0.0
TRY_S = 1.0
TRIES = 10
MOST_HZ = 1000
"""A faster group the robot ignores."""
RADIO_FRAME_BYTES = 100
"""On a radio the robot streams longer frames only if they are asked for by name (firmware/app/link/link.h)."""
_FRAME_BYTES = 25
"""Of a frame beside its payload: header, checksum, signature."""


class Streams:
    """Wishes per message (``SET_MESSAGE_INTERVAL``: µs; −1 off, 0 as at boot) and group (``REQUEST_DATA_STREAM``: Hz).

    A wish for a group is one for each of its messages. ``in_force`` are the intervals that the robot was asked for
    last, and ``accepted`` whether it has accepted.
    """

    def __init__(self) -> None:
        self.in_force: dict[int, float] = {}
        self.accepted: set[int] = set()
        self._wishes: dict[int, dict[int, float]] = {}
        self._boot = BootRates()
        self._tries: Counter[tuple[int, float]] = Counter()
        self._tried_s = float("-inf")

    def hear(self, message: int, boot_ms: int) -> None:
        """Take note of a message from the robot, and of the robot's clock."""
        if self.in_force.get(message, AT_BOOT_US) == AT_BOOT_US:
            self._boot.hear(message, boot_ms)

    def is_new(self, client: int, message: int, interval_us: float, clients: set[int], now_s: float) -> bool:
        """Record a client's requested rate of one message; return whether it is the highest and goes to the robot."""
        self._wish(client, message, interval_us)
        wanted = self._merged(message, clients, now_s)
        if self.in_force.get(message) == wanted and message in self.accepted:
            return False
        if wanted != interval_us:
            return False
        self.in_force[message] = wanted
        return True

    def group(self, client: int, request: Message) -> None:
        """Take a client's REQUEST_DATA_STREAM. Of what it comes to the robot is asked by message (:meth:`due`)."""
        rate_hz = int(request.req_message_rate) if request.start_stop else 0
        if rate_hz > MOST_HZ:
            return
        interval_us = 1e6 / rate_hz if rate_hz else OFF_US
        for message in messages_of(int(request.req_stream_id)):
            wanted = rate_hz == 0 or self._boot.is_heard(message) or not _is_long(message)
            if wanted and self._wishes.get(message, {}).get(client) != interval_us:
                self._wish(client, message, interval_us)
                self.hurry()  # not for a repetition, of which some programs send many

    def is_muted(self, client: int, message: int) -> bool:
        """Return whether a client wants none of these messages."""
        return self._wishes.get(message, {}).get(client) == OFF_US

    def answered(self, question: Question, result: int) -> None:
        """Take the robot's answer to a wish."""
        if question.about is None:
            return
        number, interval_us = question.about
        if result == mavlink.MAV_RESULT_ACCEPTED:
            self.in_force[number] = interval_us
            self.accepted.add(number)
            self._tries.clear()
        elif result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
            pass
        elif question.client == NO_CLIENT:
            self.in_force[number] = interval_us  # asking again would be of no use
        else:
            self._wishes.get(number, {}).pop(question.client, None)
            self.in_force.pop(number, None)

    def leave(self, client: int) -> None:
        """Forget a client's wishes."""
        for wishes in self._wishes.values():
            wishes.pop(client, None)
        self.hurry()

    def due(self, clients: set[int], now_s: float) -> list[tuple[int, float]]:
        """Return messages and intervals that the robot must be asked for now, since the wishes have changed."""
        if now_s - self._tried_s < TRY_S:
            return []
        self._tried_s = now_s
        now = {message: self._merged(message, clients, now_s) for message in self._wishes}
        outdated = [(message, us) for message, us in now.items() if us != self.in_force.get(message, AT_BOOT_US)]
        self._tries.update(outdated)
        return [wish for wish in outdated if self._tries[wish] <= TRIES]

    def hurry(self) -> None:
        """Ask the robot at once for what has changed."""
        self._tried_s = float("-inf")

    def restart(self) -> None:
        """The robot has restarted: nothing is in force any more."""
        self.in_force.clear()
        self.accepted.clear()
        self._tries.clear()
        self.hurry()

    def _wish(self, client: int, message: int, interval_us: float) -> None:
        if interval_us == AT_BOOT_US:
            self._wishes.get(message, {}).pop(client, None)
        else:
            self._wishes.setdefault(message, {})[client] = interval_us

    def _merged(self, message: int, clients: set[int], now_s: float) -> float:
        """Return the interval that serves all ``clients``: the shortest, off if all want that.

        If a client without a wish is among them, the shortest may be the one at boot. It is taken, too, until it is
        known.
        """
        wishes = self._wishes.get(message, {})
        fastest_us = min((interval for interval in wishes.values() if interval > 0.0), default=None)
        if clients and clients <= wishes.keys():
            return OFF_US if fastest_us is None else fastest_us
        if fastest_us is None:
            return AT_BOOT_US
        boot_us = self._boot.interval_us(message, now_s)
        return fastest_us if boot_us is not None and fastest_us < boot_us else AT_BOOT_US


def _is_long(message: int) -> bool:
    payload = int(mavlink.mavlink_map[message].unpacker.size)
    return payload + _FRAME_BYTES > RADIO_FRAME_BYTES
