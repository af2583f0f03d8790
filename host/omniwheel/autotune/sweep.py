# SPDX-License-Identifier: MIT
"""The margins that a robot really has with its new values: a sweep of all wheels alike, while it turns on the spot.

The model knows neither that wheels slip, nor what its own measurement missed. The sweep shows both, as
``omni experiment wheel-chirp`` does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from omniwheel.autotune.wheel_loop import Margins
from omniwheel.drive_log import is_slow
from omniwheel.errors import LimitError
from omniwheel.experiments import WheelPlan, wheel_chirp
from omniwheel.robot import Robot
from omniwheel.tuning import ExperimentError

WHEEL_S = 7.5
"""Length of the sweep times wheels: so much fits into the robot's memory."""
STOPPED = ("failsafe", "estop")


@dataclass(frozen=True)
class Swept:
    """Margins of the wheel loops with the load of turning; None, and ``why``, if a sweep cannot show them."""

    margins: Margins | None
    why: str = ""


def sweep(robot: Robot, room_m: float, tell: Callable[[str], None]) -> Swept:
    """Sweep with the values that the robot has. Raises ExperimentError if it stopped itself."""
    if is_slow(robot.url):
        return Swept(None, "the link is too slow for a sweep")
    try:
        found = wheel_chirp(robot, WheelPlan(duration_s=WHEEL_S / robot.parameters["WHEELS"]), room_m, tell)
    except (LimitError, ExperimentError) as error:
        if robot.status.state in STOPPED:
            raise
        return Swept(None, str(error))
    return Swept(Margins(*(found[name].measured for name in ("gain_margin", "phase_margin_rad", "distance"))))
