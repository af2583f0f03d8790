# SPDX-License-Identifier: MIT
"""The same drive in twenty worlds: how far off is the robot, really? (thousands: `omni montecarlo`)."""

import omniwheel

off_mm = []
for seed in range(20):
    with omniwheel.simulate("fast_three_wheel", seed=seed, speed="max") as robot:
        robot.arm()
        robot.drive_to(0.5, 0.2, speed=0.5)
        off_mm.append(1e3 * abs(complex(*robot.simulation.true_pose[:2]) - complex(0.5, 0.2)))
print(f"median {sorted(off_mm)[10]:.1f} mm, worst {max(off_mm):.1f} mm")
