# SPDX-License-Identifier: MIT
"""A webcam as motion capture: tags on the floor say where the camera is, a tag on the robot says where the robot is.

The files come first. A person writes the camera file, of which :mod:`setup` reads what it says. The commands calibrate
and place write those of :mod:`lens` and :mod:`place`. The stream of poses is in :mod:`source`. All this needs the extra
``vision``.
"""
