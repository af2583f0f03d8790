# SPDX-License-Identifier: MIT
"""Follow a drawn path: a figure eight, as a NumPy array and from a file."""

import numpy as np

import omniwheel

turn = np.linspace(0.0, 2.0 * np.pi, 60)
eight = np.column_stack((0.5 * np.sin(turn), 0.25 * np.sin(2.0 * turn)))  # x, y [m]
np.savetxt("eight.csv", eight, delimiter=",", header="x,y", comments="")

with omniwheel.simulate("fast_three_wheel", speed="max") as robot:
    robot.arm()
    once = robot.follow(eight, speed=0.3, heading=0.0)
    again = robot.follow("eight.csv", speed=0.3, heading=0.0)
    for drive in (once, again):
        print(f"{drive}; largest error {drive.largest_error_m * 1e3:.1f} mm")
