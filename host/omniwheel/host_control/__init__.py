# SPDX-License-Identifier: MIT
"""The report's first architecture: the controller on the host at 50 Hz, poses from motion capture, PWM over the radio.

The controllers, filter, kinematics and trajectories are the control core's own (``omniwheel._core``), run here instead
of on the robot.
"""

from omniwheel.host_control.controller import HostController, HostControlSettings
from omniwheel.host_control.loop import Goal, HostControlLoop, HostControlRun
from omniwheel.host_control.pwm_line import PwmRadio, format_line, parse_line

__all__ = [
    "Goal",
    "HostControlLoop",
    "HostControlRun",
    "HostControlSettings",
    "HostController",
    "PwmRadio",
    "format_line",
    "parse_line",
]
