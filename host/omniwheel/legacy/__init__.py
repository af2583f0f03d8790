# SPDX-License-Identifier: MIT
"""The report's first architecture: the controller on the host at 50 Hz, poses from motion capture, PWM over the radio.

The controllers, filter, kinematics and trajectories are the control core's own (``omniwheel._core``), run here instead
of on the robot.
"""

from omniwheel.legacy.controller import LegacyController, LegacySettings
from omniwheel.legacy.loop import Goal, LegacyLoop, LegacyRun
from omniwheel.legacy.pwm_line import PwmRadio, format_line, parse_line

__all__ = [
    "Goal",
    "LegacyController",
    "LegacyLoop",
    "LegacyRun",
    "LegacySettings",
    "PwmRadio",
    "format_line",
    "parse_line",
]
