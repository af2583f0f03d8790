# SPDX-License-Identifier: MIT
"""Whose path waits at a disarmed robot for its arming (docs/reference/safety.md).

Clients with the same ids are one station to the robot: it would start the path of a client that has gone when another
one arms. So the hub lets the robot forget it first.
"""

from __future__ import annotations

from collections.abc import Callable

from omni.hub.rules import target_of
from omniwheel.dialect import Message, is_command, mavlink

Address = tuple[int, int]


class WaitingPath:
    """The client whose path waits, and the robot where it does. ``forget`` lets a robot forget a path."""

    def __init__(self, forget: Callable[[Address], None]) -> None:
        self._forget = forget
        self._client: int | None = None
        self._robot: Address = (0, 0)

    def moves(self, client: int, message: Message, robot: Address, *, armed: bool) -> None:
        """Take a motion of a client, before it goes to the robot that is followed; ``armed`` is what it said last."""
        if armed:
            self._client = None  # it has started
            return
        if client != self._client:
            self._drop()
        command = message.command if is_command(message) else 0
        if command == mavlink.MAV_CMD_OMNI_TRAJECTORY_START:
            self._client, self._robot = client, target_of(message).or_robot(robot)
        elif command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            self._client = None

    def leave(self, client: int, *, armed: bool) -> None:
        """Take note that a client has gone."""
        if client == self._client and not armed:
            self._drop()

    def _drop(self) -> None:
        if self._client is not None:
            self._client = None
            self._forget(self._robot)
