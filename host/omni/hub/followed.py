# SPDX-License-Identifier: MIT
"""Which robot the hub serves, where several share a radio and a client may give one another SYS_ID."""

from __future__ import annotations

from omniwheel.default_system import RENAMED_AFTER_S
from omniwheel.dialect import Message, is_command, mavlink

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
        self._others: set[int] = set()
        """System ids of other robots."""
        self._restart_s = float("-inf")
        """When a client last had the robot restarted: its stored SYS_ID may be another one."""
        self._requested_s: dict[int, float] = {}
        """When a client asked for a system id that the robot has neither refused nor used yet."""

    def lose(self) -> None:
        """Forget when it was heard: the port has gone."""
        self._heard_s = float("-inf")

    def watch_request(self, message: Message, now_s: float) -> None:
        """Remember a client's request for another SYS_ID, or for a restart, which may bring one."""
        if is_command(message) and message.command == mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN:
            self._restart_s = now_s
        if message.get_type() == "PARAM_SET" and message.param_id == "SYS_ID" and 1.0 <= message.param_value <= 254.0:
            self._requested_s[int(message.param_value)] = now_s

    def watch_parameter(self, message: Message) -> None:
        """Take a PARAM_VALUE of this robot: if it is still SYS_ID's old one, the request was refused."""
        if message.param_id == "SYS_ID":
            self._requested_s.clear()

    def accept_heartbeat(self, source: tuple[int, int], now_s: float) -> bool:
        """Return whether an autopilot's heartbeat is this robot's; follow it if it has a new id or is the next one."""
        if source != self.source and not (self._is_renamed(source, now_s) or self._is_next(now_s)):
            self._others.add(source[0])
            return False
        if source != self.source:
            self._requested_s.clear()
        self.source, self._heard_s = source, now_s
        return True

    def _is_next(self, now_s: float) -> bool:
        return not self._chosen and now_s - self._heard_s >= SILENCE_S

    def _is_renamed(self, source: tuple[int, int], now_s: float) -> bool:
        if source[1] != self.source[1]:
            return False
        silent = now_s - self._heard_s > RENAMED_AFTER_S
        is_known = source[0] in self._others
        if now_s - self._requested_s.get(source[0], float("-inf")) < SILENCE_S:
            return silent or not is_known  # the id may be that of a robot which is there already
        return silent and now_s - self._restart_s < SILENCE_S and not is_known
