# SPDX-License-Identifier: MIT
"""Odometry geometry from encoder counts beside measured poses: no IMU, no motor duties.

``wheel_model`` turns geometry into the matrix from wheel angles to body motion. ``windows`` integrates it over windows
of a run and compares the path with the poses. ``clock`` finds the offset, rate and warp between the two clocks.
``solve`` fits parameters to windows. ``study`` splits the runs before any fit, chooses among the models by runs that
were left out, and scores dead reckoning on them (``scores``). ``result_data`` turns a study into text and JSON.
"""
