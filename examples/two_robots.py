# SPDX-License-Identifier: MIT
"""Drive two robots at the same time, each from a thread of its own, towards each other."""

from concurrent.futures import ThreadPoolExecutor

import omniwheel


def drive(robot: omniwheel.Robot, x: float) -> omniwheel.Driven:
    """Arm a robot and drive it ahead."""
    robot.arm()
    return robot.drive_to(x, 0.0, speed=0.1)


with (
    omniwheel.simulate("fast_three_wheel", seed=1, speed="max") as one,  # real ones: connect("/dev/ttyACM0") ...
    omniwheel.simulate("four_wheel", seed=2, speed="max") as other,
    ThreadPoolExecutor() as threads,
):
    drives = [threads.submit(drive, one, 0.5), threads.submit(drive, other, -0.3)]
    for number, done in enumerate(drives, start=1):
        print(f"robot {number}: {done.result()}")
