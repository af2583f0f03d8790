# SPDX-License-Identifier: MIT
"""Experiments that show a loop of a connected robot: what it wants, what comes of it, and what the model predicts.

Each takes a robot, a plan, the room there is and a function that is told what happens. It says first what it will use,
refuses before the robot arms, and leaves it disarmed. The command ``omni experiment`` is one user of it.
"""

from omniwheel.experiments.outcome import Figure, Outcome
from omniwheel.experiments.position import PositionPlan, PushPlan, disturbance, position_step, position_sweep
from omniwheel.experiments.wheel import WheelPlan
from omniwheel.experiments.wheel_experiments import LOWEST_HZ, wheel_chirp, wheel_step

__all__ = [
    "LOWEST_HZ",
    "Figure",
    "Outcome",
    "PositionPlan",
    "PushPlan",
    "WheelPlan",
    "disturbance",
    "position_step",
    "position_sweep",
    "wheel_chirp",
    "wheel_step",
]
