# SPDX-License-Identifier: MIT
"""Old place of ``hil_sim.pwm_robot``, for one more release."""

from omniwheel.moved import moved

_NAMES = ("SimulatedArduino", "SimulatedLink", "SimulatedRobot", "DEFAULT_CAMERAS", "ORIGIN")

__getattr__ = moved(__name__, dict.fromkeys(_NAMES, "hil_sim.pwm_robot"))
