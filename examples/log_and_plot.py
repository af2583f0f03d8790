# SPDX-License-Identifier: MIT
"""Record a drive, save it in three forms, read it back and draw it."""

import omniwheel

with omniwheel.simulate("fast_three_wheel", speed="max") as robot:
    robot.arm()
    robot.drive(0.3, 0.0, 1.0, duration=3.0)
    run = robot.run  # everything since the connection

for name in ("drive.csv", "drive.npz", "drive.tlog"):  # the last one is for MAVProxy and QGroundControl, too
    run.save(name)
table = omniwheel.load("drive.csv").to_numpy()
print(f"{len(table)} rows from {table['time_s'][0]:.2f} s on; x is {table['x_m'][-1]:.3f} m at the end")
for time_s, what in run.events:
    print(f"{time_s:6.2f} s  {what}")
run.plot("drive.png")  # without a name: on the screen
