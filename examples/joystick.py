# SPDX-License-Identifier: MIT
"""Drive with a joystick (Linux): left stick moves, right stick turns, any button ends."""

import os
import struct
import sys

import omniwheel

EVENT = struct.Struct("IhBB")  # time [ms], value, type, number: linux/joystick.h
BUTTON, AXIS = 1, 2
SPEED, TURN = 0.4, 1.5  # m/s, rad/s

with (
    open(sys.argv[1] if len(sys.argv) > 1 else "/dev/input/js0", "rb", buffering=0) as stick,
    omniwheel.simulate("fast_three_wheel", speed="max") as robot,
):
    os.set_blocking(stick.fileno(), False)
    axes = [0.0] * 16
    robot.arm()
    while True:
        event = stick.read(EVENT.size)
        if event:
            _, value, kind, number = EVENT.unpack(event)
            if kind == BUTTON and value:
                break
            if kind == AXIS:
                axes[number] = value / 32767.0
            robot.velocity(-SPEED * axes[1], -SPEED * axes[0], -TURN * axes[3])  # goes on until the next
        robot.sleep(0.02)
    robot.stop()
    print(robot.pose)
