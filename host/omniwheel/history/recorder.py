# SPDX-License-Identifier: MIT
"""Writes a robot's history while a program changes its parameters."""

from __future__ import annotations

import getpass
import math
import os
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from typing import Any
from uuid import uuid4

from omniwheel.errors import CommandRefusedError, OutputFileError
from omniwheel.history.robot_history import RobotHistory, history_file
from omniwheel.robot import Robot


class ChangeRecorder:
    """Notes each change that a robot confirms, as it happens: what a program that is killed did is known, too.

    ``command`` is what the user typed, ``why`` what the user says about it. Nothing is written before the first change.
    A history that cannot be written keeps no change from the robot: ``warn`` is told, once.
    """

    def __init__(
        self, robot: Robot, history: RobotHistory, command: str, why: str, warn: Callable[[OutputFileError], None]
    ) -> None:
        self._history = history
        self._session = uuid4().hex
        self._command, self._why = command, why
        self._warn = warn
        self._began = self._failed = False
        robot.parameters.on_change = self.changed
        robot.on_store = self.stored

    def changed(self, changes: Mapping[str, tuple[float, float]]) -> None:
        """Note changes {name: (before, after)}."""
        self._write({"set": {name: list(pair) for name, pair in changes.items() if pair[0] != pair[1]}})

    def stored(self) -> None:
        """Note that the robot keeps its parameters over a restart."""
        if self._began:
            self._write({"stored": True})

    def measured(self, figures: Mapping[str, tuple[float, float]]) -> None:
        """Note what an experiment measured before and after the change; numbers that do not exist are left out."""
        known = {name: list(pair) for name, pair in figures.items() if all(map(math.isfinite, pair))}
        if self._began and known:
            self._write({"figures": known})

    def _write(self, line: Mapping[str, Any]) -> None:
        if line.get("set") == {} or self._failed:
            return
        lines = [{"session": self._session, **line}]
        if not self._began:
            lines.insert(0, {"session": self._session, **self._heading()})
        try:
            self._history.append(lines)
            self._began = True
        except OutputFileError as error:
            self._failed = True
            self._warn(error)

    def _heading(self) -> dict[str, str]:
        return {
            "time": datetime.now(timezone.utc).isoformat(timespec="seconds"),
            "who": _user(),
            "command": self._command,
            "why": self._why,
        }


def history_of(robot: Robot) -> RobotHistory:
    """Return the history of the parameters of a connected robot."""
    try:
        serial_number = robot.version.serial_number
    except CommandRefusedError:  # a firmware that tells no version
        serial_number = 0
    return RobotHistory(history_file(serial_number, robot.url))


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError, ImportError):  # a user without a name, as in a container
        return f"user {os.getuid()}" if hasattr(os, "getuid") else ""
