# SPDX-License-Identifier: MIT
"""Try values of a gain on the same drive, and keep the best one."""

import numpy as np

import omniwheel

with omniwheel.simulate("fast_three_wheel", speed="max") as robot:
    robot.parameters["CTL_MODE"] = "pid"
    errors = {}
    for gain in (2.0, 4.0, 8.0):
        robot.parameters["FL_KP_XY"] = gain
        robot.arm()
        drives = [robot.drive_to(0.4, 0.0, speed=0.6), robot.drive_to(0.0, 0.0, speed=0.6)]
        robot.disarm()
        square = np.concatenate([drive.errors[:, :2] ** 2 for drive in drives])
        errors[gain] = float(np.sqrt(square.sum(axis=1).mean()))
        print(f"FL_KP_XY = {gain:g}: RMS error {errors[gain] * 1e3:.2f} mm")
    best = min(errors, key=lambda gain: errors[gain])
    robot.parameters["FL_KP_XY"] = best
    robot.store()  # over a restart
    print(f"stored FL_KP_XY = {best:g}")
