# SPDX-License-Identifier: MIT
"""What a set of sensors sees of the wheels' slip, computed from the robot's kinematics.

A wheel with slip ratio s that rolls by m moves its contact by m (1 - s). With n wheels the body's motion is
``B+ (m (1 - s))``, where ``B+`` is the pseudo-inverse of the wheels' rows. Each thing that a sensor tells of the body
is a row h of that, and a measurement ``h diag(m) s``. With more than three wheels their own motions must fit together,
which gives the rows that are orthogonal to all motions of the body. The rank of all rows is the number of combinations
of slip that show at one moment, while every wheel rolls. A wheel that stands still shows nothing.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from omniwheel.capability.drive_model import DriveModel

GYRO, FLOW, FLOW_TURN, FIXES = "gyro", "floor odometry", "floor odometry with turn", "fixes"
_AXES = {GYRO: (2,), FLOW: (0, 1), FLOW_TURN: (0, 1, 2), FIXES: (0, 1, 2)}
"""Axes of the body's motion, x, y, theta, that each tells."""

_NUMBERS = ("no", "one", "two", "three", "four")


def slip_rank(model: DriveModel, sensors: Collection[str]) -> int:
    """Return how many combinations of the wheels' slip ratios show at one moment with encoders and these sensors."""
    inverse = np.linalg.pinv(model.rows)
    consistency = np.eye(model.wheels) - model.rows @ inverse
    axes = sorted({axis for sensor in sensors for axis in _AXES[sensor]})
    return int(np.linalg.matrix_rank(np.vstack((consistency, inverse[axes])), tol=1e-9))


def slip_words(model: DriveModel, sensors: Collection[str]) -> str:
    """Return that number in words."""
    rank = slip_rank(model, sensors)
    if rank == model.wheels:
        return "each wheel's slip"
    if rank == 0:
        return "no slip"
    kinds = "combination" if rank == 1 else "combinations"
    return f"{_NUMBERS[rank]} {kinds} of the {_NUMBERS[model.wheels]} wheels' slips"
