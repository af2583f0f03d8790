# SPDX-License-Identifier: MIT
"""A webcam as motion capture: tags on the floor say where the camera is, a tag on the robot says where the robot is.

The files come first. :mod:`setup` is the camera file that a person writes, :mod:`lens` and :mod:`place` are what
``omni mocap calibrate`` and ``omni mocap place`` find out. :mod:`source` is the stream of poses. Needs the extra
``vision``.
"""
