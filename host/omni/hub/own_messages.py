# SPDX-License-Identifier: MIT
"""What the hub asks of a robot by itself, with a number of its own in each command."""

from __future__ import annotations

from typing import Any

from omniwheel.dialect import HUB_COMPONENT, Message, mavlink

HUB_SYSTEM = 255
_LAST_NUMBER = 65535
_NO_INDEX = -1


class OwnMessages:
    """Makes them for the robot with this (system, component)."""

    def __init__(self) -> None:
        self._codec: Any = mavlink.MAVLink(None, HUB_SYSTEM, HUB_COMPONENT)
        self._number = 0

    def interval(self, robot: tuple[int, int], message: int, interval_us: float) -> Message:
        """Return a request for the interval of one message."""
        return self._command(robot, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, float(message), interval_us)

    def trial(self, robot: tuple[int, int], action: float) -> Message:
        """Return a command for the trial of parameters."""
        return self._command(robot, mavlink.MAV_CMD_OMNI_TRIAL, action, 0.0)

    def hold(self, robot: tuple[int, int]) -> Message:
        """Return a command that ends a path, one that waits for arming, too."""
        return self._command(robot, mavlink.MAV_CMD_OMNI_TRAJECTORY_STOP, 0.0, 0.0)

    def read(self, robot: tuple[int, int], parameter: str) -> Message:
        """Return a request for a parameter."""
        return self._packed(mavlink.MAVLink_param_request_read_message(*robot, parameter.encode(), _NO_INDEX))

    def _command(self, robot: tuple[int, int], command: int, first: float, second: float) -> Message:
        self._number = self._number % _LAST_NUMBER + 1
        numbers = (first, second, 0.0, 0.0, float(self._number), 0.0, 0.0)
        return self._packed(mavlink.MAVLink_command_long_message(*robot, command, 0, *numbers))

    def _packed(self, message: Any) -> Message:
        message.pack(self._codec)
        self._codec.seq = (self._codec.seq + 1) % 256
        packed: Message = message
        return packed
