# SPDX-License-Identifier: MIT
"""The one place on the host where our frames and MAVLink's meet.

World: x, y on the floor, theta counter-clockwise. MAVLink's local NED: x_ned = x, y_ned = -y, yaw_ned = -theta.
Body: x forward, y left; MAVLink's body FRD has y to the right: vy_frd = -vy, yaw rate_frd = -wz.
The conversion is its own inverse, and the same for poses and twists.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class Pose(NamedTuple):
    """World pose: metres, metres, radians counter-clockwise."""

    x: float
    y: float
    theta: float


class Twist(NamedTuple):
    """Rate of a pose: m/s, m/s, rad/s. Which frame, the name of the variable says."""

    vx: float
    vy: float
    wz: float


def flip(x: float, y: float, turn: float) -> tuple[float, float, float]:
    """Convert a pose or twist between our frame and MAVLink's, in either direction."""
    return x, -y, -turn


def relative_pose(origin: Pose, pose: Pose) -> Pose:
    """Return a world pose in the body frame of another; the turn is within -pi..pi [m, m, rad]."""
    c, s = math.cos(origin.theta), math.sin(origin.theta)
    x, y = pose.x - origin.x, pose.y - origin.y
    return Pose(c * x + s * y, -s * x + c * y, math.remainder(pose.theta - origin.theta, math.tau))
