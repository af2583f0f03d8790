# SPDX-License-Identifier: MIT
"""A controller of one's own at 50 Hz: its law in Python, the robot's geometry and limits from the control core."""

import math

import omniwheel
from hil_sim.core import robot_config
from omniwheel._core import ffi, lib
from omniwheel.robots import parameter_table

GOAL, GAIN, PERIOD_S = (0.4, 0.3, 1.0), 2.0, 0.02

with omniwheel.simulate("fast_three_wheel", speed="max") as robot:
    config = robot_config(dict(robot.parameters), parameter_table(), 0)
    wheel = ffi.new("omni_real_t[]", lib.OMNI_MAX_WHEELS)
    robot.arm()
    for _ in range(150):
        x, y, theta = robot.pose
        ex, ey, turn = GOAL[0] - x, GOAL[1] - y, math.remainder(GOAL[2] - theta, math.tau)
        c, s = math.cos(theta), math.sin(theta)
        body = ffi.new("omni_twist_t *", [GAIN * (c * ex + s * ey), GAIN * (c * ey - s * ex), GAIN * turn])
        lib.omni_kinematics_inverse(ffi.addressof(config, "kinematics"), body, ffi.NULL, wheel)
        share = lib.omni_saturate_direction(wheel, config.kinematics.wheels, config.limits.wheel_rad_s)
        robot.set_velocity(share * body.vx, share * body.vy, share * body.wz)
        robot.sleep(PERIOD_S)
    robot.stop()
    print(robot.pose, "wanted", GOAL)
