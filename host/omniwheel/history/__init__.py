# SPDX-License-Identifier: MIT
"""Every change of a robot's parameters: who, when, why; and how to get back to any earlier state."""

from omniwheel.history.recorder import ChangeRecorder, history_of
from omniwheel.history.robot_history import Entry, RobotHistory, history_file

__all__ = ["ChangeRecorder", "Entry", "RobotHistory", "history_file", "history_of"]
