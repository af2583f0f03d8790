# SPDX-License-Identifier: MIT
"""Drive a square of half a metre, and say how well."""

import omniwheel

with omniwheel.simulate("fast_three_wheel", speed="max") as robot:  # a real one: omniwheel.connect()
    robot.arm()
    for x, y in [(0.5, 0), (0.5, 0.5), (0, 0.5), (0, 0)]:
        side = robot.drive_to(x, y, speed=0.5)
        print(f"{side}; largest error {side.largest_error_m * 1e3:.1f} mm")
    print(robot.pose, robot.battery_V, robot.state)
