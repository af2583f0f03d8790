# SPDX-License-Identifier: MIT
"""Feed poses of a tracker to a robot that has no other: here of a simulated one, with noise of 2 mm."""

import random

import omniwheel
from omniwheel.telemetry import Tracking

noise = random.Random(1)

with omniwheel.simulate("fast_three_wheel", scenario="no_fixes", speed="max") as robot:

    def fix(_: Tracking) -> None:
        """Send what the tracker sees now; a real one: omniwheel.mocap."""
        x, y, theta = robot.simulation.true_pose
        robot.send_pose_fix(x + noise.gauss(0, 2e-3), y + noise.gauss(0, 2e-3), theta, sd_xy_m=2e-3, sd_theta_rad=5e-3)

    for tracked in (False, True):
        remove = robot.on(Tracking, fix) if tracked else None
        robot.arm()
        robot.follow([(0, 0), (1, 0), (1, 1), (0, 0)], speed=0.4)
        robot.disarm()
        (x, y, _), pose = robot.simulation.true_pose, robot.pose
        print(
            f"tracked: {tracked}; the estimate is off by {1e3 * ((x - pose.x) ** 2 + (y - pose.y) ** 2) ** 0.5:.1f} mm"
        )
