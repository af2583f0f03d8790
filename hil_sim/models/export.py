# SPDX-License-Identifier: MIT
"""A robot as a file for another simulator, by the name of its format."""

from __future__ import annotations

from collections.abc import Callable

from hil_sim.models.mjcf import mjcf
from hil_sim.models.parts import robot_parts
from hil_sim.models.proto import proto
from hil_sim.models.sdf import sdf
from hil_sim.models.text import left_out
from hil_sim.models.urdf import urdf
from hil_sim.world import world_config
from omni_schema import Robot


def _mjcf(robot: Robot) -> str:
    config = world_config(robot)
    seconds = config.motor_inductance_H / config.motor_resistance_ohm
    return mjcf(robot_parts(robot, config), seconds, config.motor_constant_N_m_A)


FORMATS: dict[str, Callable[[Robot], str]] = {
    "urdf": lambda robot: urdf(robot_parts(robot)),
    "sdf": lambda robot: sdf(robot_parts(robot)),
    "proto": lambda robot: proto(robot_parts(robot)),
    "mjcf": _mjcf,
}
"""What makes the text of each. Raises PartsError, WorldError."""

_WITH_FRICTION = ("sdf", "mjcf")
_WITH_ROTOR = ("mjcf",)


def missing_in(robot: Robot, wanted: str) -> list[str]:
    """Return what a format of FORMATS cannot have of this robot, as sentences without a full stop.

    Raises PartsError, WorldError.
    """
    return left_out(robot_parts(robot), friction=wanted in _WITH_FRICTION, rotor=wanted in _WITH_ROTOR)
