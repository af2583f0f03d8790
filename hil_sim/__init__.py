# SPDX-License-Identifier: MIT
"""The simulated world of the robot: plant, sensors, faults, host-in-the-loop runner and scenarios."""
