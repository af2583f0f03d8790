# SPDX-License-Identifier: MIT
"""Identify the motors of a robot on a stand, wheels off the floor, from steps of voltage (needs SciPy)."""

import omniwheel
from omniwheel.identification.excitation import stand_steps
from omniwheel.identification.live import excite
from omniwheel.identification.motor_steps import identify_motors

with omniwheel.simulate("three_wheel", scenario="stand", speed="max") as robot:
    wheels = int(robot.parameters["WHEELS"])
    data = excite(robot, {"steps of voltage": stand_steps(wheels)}, print)

found = identify_motors(data)
print(f"all wheels as one motor: {found.together.estimate}")
for wheel, fit in enumerate(found.each, start=1):
    print(f"wheel {wheel}: model and measured speed differ by {fit.rmse_rad_s:.3f} rad/s RMS")
for band in found.deadbands:
    print(f"wheel {band.wheel + 1}, direction {band.direction:+d}: turns from {band.moving_V:.2f} V on")
