# SPDX-License-Identifier: MIT
"""From bare boards to a driving robot: one check per step, each says pass or what to do (docs/guides/bring-up.md).

Every check is a function of a connected robot, and of a person where eyes and hands are needed, and returns a
:class:`Result`. None leaves the robot armed, whatever happens.
"""

from __future__ import annotations

from omniwheel.bringup.drive import check_drive
from omniwheel.bringup.encoders import check_encoders
from omniwheel.bringup.flow import check_flow
from omniwheel.bringup.gyro import check_gyro
from omniwheel.bringup.i2c import check_i2c
from omniwheel.bringup.link import check_link
from omniwheel.bringup.motors import check_motors
from omniwheel.bringup.output_enable import check_output_enable
from omniwheel.bringup.person import Assumed, HandMotion, Person
from omniwheel.bringup.radio import check_radio
from omniwheel.bringup.result import Finding, Result
from omniwheel.bringup.stop_button import check_stop_button
from omniwheel.bringup.stops import check_stops

__all__ = [
    "Assumed",
    "Finding",
    "HandMotion",
    "Person",
    "Result",
    "check_drive",
    "check_encoders",
    "check_flow",
    "check_gyro",
    "check_i2c",
    "check_link",
    "check_motors",
    "check_output_enable",
    "check_radio",
    "check_stop_button",
    "check_stops",
]
