# SPDX-License-Identifier: MIT
"""The clients' wishes for telemetry, merged: the robot hears of each message the fastest rate that anybody wants."""

from __future__ import annotations

OFF_US = -1.0
AT_BOOT_US = 0.0
REPEAT_S = 5.0
"""A group's rate that has not changed is passed on again after this time: nobody acknowledges it."""


class Streams:
    """Wishes per message (``SET_MESSAGE_INTERVAL``: µs; −1 off, 0 as at boot) and group (``REQUEST_DATA_STREAM``: Hz).

    ``in_force`` are the intervals that the robot was asked for last, and whether it has accepted.
    """

    def __init__(self) -> None:
        self.in_force: dict[int, float] = {}
        self.accepted: set[int] = set()
        self._wishes: dict[int, dict[int, float]] = {}
        self._groups: dict[int, dict[int, float]] = {}
        self._sent: dict[int, tuple[float, float]] = {}

    def wish(self, client: int, message: int, interval_us: float) -> None:
        """Take a client's wish for one message."""
        if interval_us == AT_BOOT_US:
            self._wishes.get(message, {}).pop(client, None)
        else:
            self._wishes.setdefault(message, {})[client] = interval_us

    def merged(self, message: int, clients: set[int]) -> float:
        """Return the interval that serves all ``clients``: the shortest, off if all want that, else as at boot."""
        wishes = self._wishes.get(message, {})
        wanted = [interval for interval in wishes.values() if interval > 0.0]
        if wanted:
            return min(wanted)
        return OFF_US if clients and clients <= wishes.keys() else AT_BOOT_US

    def is_muted(self, client: int, message: int) -> bool:
        """Return whether a client wants none of these messages."""
        return self._wishes.get(message, {}).get(client) == OFF_US

    def refused(self, client: int, message: int) -> None:
        """The robot has refused: forget the wish."""
        self._wishes.get(message, {}).pop(client, None)
        self.in_force.pop(message, None)

    def leave(self, client: int) -> None:
        """Forget a client's wishes."""
        for wishes in [*self._wishes.values(), *self._groups.values()]:
            wishes.pop(client, None)

    def outdated(self, clients: set[int]) -> list[tuple[int, float]]:
        """Return messages and intervals that the robot must be asked for now, since the wishes have changed."""
        now = {message: self.merged(message, clients) for message in self._wishes}
        return [(message, us) for message, us in now.items() if us != self.in_force.get(message, AT_BOOT_US)]

    def restart(self) -> None:
        """The robot has restarted: nothing is in force any more."""
        self.in_force.clear()
        self.accepted.clear()
        self._sent.clear()

    def group(self, client: int, group: int, rate_hz: float, now_s: float) -> bool:
        """Take a client's wish for a group; return whether the robot must hear it: nobody else wants it faster."""
        wishes = self._groups.setdefault(group, {})
        wishes[client] = rate_hz
        fastest = max(wishes.values())
        rate, at_s = self._sent.get(group, (float("nan"), float("-inf")))
        if rate_hz < fastest or (rate == fastest and now_s - at_s < REPEAT_S):
            return False
        self._sent[group] = (rate_hz, now_s)
        return True
