# SPDX-License-Identifier: MIT
"""Which robot the hub serves, where several share a radio and a client may give one another SYS_ID."""

from __future__ import annotations

from omniwheel.dialect import Message

SILENCE_S = 10.0
"""A robot that is silent for so long may be another one from then on."""


class FollowedRobot:
    """The robot that was heard first; another one counts once this one is silent. Times are the hub's clock's.

    ``source`` is its (system, component). If a ``system_id`` was chosen, it is the only one that counts.
    """

    def __init__(self, system_id: int | None = None) -> None:
        self.source = (system_id or 1, 1)
        self._chosen = system_id is not None
        self._heard_s = float("-inf")
        self._requested_s: dict[int, float] = {}
        """When a client asked for a system id that the robot has neither refused nor used yet."""

    def lose(self) -> None:
        """Forget when it was heard: the port has gone."""
        self._heard_s = float("-inf")

    def watch_request(self, message: Message, now_s: float) -> None:
        """Remember a client's request for another SYS_ID."""
        if message.get_type() == "PARAM_SET" and message.param_id == "SYS_ID" and 1.0 <= message.param_value <= 254.0:
            self._requested_s[int(message.param_value)] = now_s

    def watch_parameter(self, message: Message) -> None:
        """Take a PARAM_VALUE of this robot: if it is still SYS_ID's old one, the request was refused."""
        if message.param_id == "SYS_ID":
            self._requested_s.clear()

    def accept_heartbeat(self, source: tuple[int, int], now_s: float) -> bool:
        """Return whether an autopilot's heartbeat is this robot's; follow it if it has a new id or is the next one."""
        asked_s = self._requested_s.get(source[0], float("-inf"))
        renamed = source[1] == self.source[1] and now_s - asked_s < SILENCE_S
        if source != self.source and not renamed and (self._chosen or now_s - self._heard_s < SILENCE_S):
            return False
        if source != self.source:
            self._requested_s.clear()
        self.source, self._heard_s = source, now_s
        return True
