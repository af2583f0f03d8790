# SPDX-License-Identifier: MIT
"""From a motor's data sheet to the numbers of a robot file."""

from omniwheel.datasheet.catalogue import catalogue, find_motor
from omniwheel.datasheet.motor import GearMotor, MotorModel, motor_model
from omniwheel.datasheet.new_robot import RobotAnswers, sheet_warnings, write_designed_robot

__all__ = [
    "GearMotor",
    "MotorModel",
    "RobotAnswers",
    "catalogue",
    "find_motor",
    "motor_model",
    "sheet_warnings",
    "write_designed_robot",
]
