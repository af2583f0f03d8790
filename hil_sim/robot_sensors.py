# SPDX-License-Identifier: MIT
"""Sensors that a robot file names: the simulated robot has them, as the file says that they are."""

from __future__ import annotations

import math
from collections.abc import Mapping

from omni_schema import FlowWiring, GyroWiring, Robot

GYRO_RATE_HZ, FLOW_RATE_HZ = 1000.0, 50.0
"""How often the firmware's drivers read them."""

TRACKED = {"tracked_x_m": "FIX_X", "tracked_y_m": "FIX_Y", "tracked_heading_rad": "FIX_TH"}


def sensor_numbers(robot: Robot) -> dict[str, float]:
    """Return the world's numbers of the robot's tracked point, gyro and floor odometry sensor; none without."""
    values = robot.parameter_values()
    found = {name: values[parameter] for name, parameter in TRACKED.items() if values[parameter] != 0.0}
    if robot.board.gyro is not None:
        found |= _gyro(robot.board.gyro, values)
    if robot.board.flow is not None:
        found |= _flow(robot.board.flow, values)
    return found


def _gyro(gyro: GyroWiring, values: Mapping[str, float]) -> dict[str, float]:
    return {
        "gyro_rate_Hz": GYRO_RATE_HZ,
        "gyro_axis": float(gyro.axis),
        "gyro_noise_density": math.radians(gyro.chip.noise_dps),
        "gyro_bias_rad_s": math.radians(gyro.chip.offset_dps),
        "gyro_scale_error": 1.0 / values["GYRO_SCALE"] - 1.0,
    }


def _flow(flow: FlowWiring, values: Mapping[str, float]) -> dict[str, float]:
    found = {
        "flow_rate_Hz": FLOW_RATE_HZ,
        "flow_x_m": values["FLOW_X"],
        "flow_y_m": values["FLOW_Y"],
        "flow_angle_rad": math.radians(values["FLOW_ANGLE"]),
        "flow_delay_s": values["FLOW_DELAY"],
        "flow_scale_error": 1.0 / values["FLOW_SCALE"] - 1.0,
    }
    if flow.chip.wheels:
        found |= {"flow_step_m": 1e-3 / flow.steps_per_mm, "flow_turn_step_rad": 0.0}
    return found
