# SPDX-License-Identifier: MIT
"""What a robot can do, computed from its robot file: speeds, accelerations, currents, and what limits each of them."""

from omniwheel.capability.card import Card, card, problems, sensor_warnings, warnings
from omniwheel.capability.drive_model import DriveModel, drive_model
from omniwheel.capability.speeds import Bound, top_speed, top_turn_rate

__all__ = [
    "Bound",
    "Card",
    "DriveModel",
    "card",
    "drive_model",
    "problems",
    "sensor_warnings",
    "top_speed",
    "top_turn_rate",
    "warnings",
]
