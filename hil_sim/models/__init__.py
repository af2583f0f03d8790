# SPDX-License-Identifier: MIT
"""A robot file as bodies, hinges and rollers for other simulators: MJCF, URDF, SDF, Webots PROTO."""
