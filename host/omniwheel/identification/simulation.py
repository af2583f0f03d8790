# SPDX-License-Identifier: MIT
"""Old place of ``hil_sim.known_robot``, for one more release."""

from omniwheel.moved import moved

_NAMES = (
    "SimulatedRobot",
    "SUPPLY_SD_V",
    "SPREAD",
    "GEOMETRY_SPREAD",
    "MOTION_CAPTURE",
    "FREE_WHEEL_FRICTION",
    "SUPPLY_TICKS",
)

__getattr__ = moved(__name__, dict.fromkeys(_NAMES, "hil_sim.known_robot"))
