# SPDX-License-Identifier: MIT
"""Configurations and plans of the control core from parameter sets: what every Python program around the core needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from omni_schema import ParameterTable
from omniwheel._core import ffi, lib
from omniwheel.errors import CoreError

PLAN_REFUSED = "the trajectory cannot be planned; check the TRJ_ parameters"


def robot_config(values: Mapping[str, float], table: ParameterTable, sequence: int) -> Any:
    """Return a new ``omni_robot_config_t`` for a complete parameter set; raise CoreError if the core refuses it."""
    array = ffi.new("omni_real_t[]", [values[parameter.name] for parameter in table.parameters])
    config = ffi.new("omni_robot_config_t *")
    bad_index = ffi.new("int32_t *", -1)
    if lib.omni_robot_config(config, array, bad_index) != lib.OMNI_OK:
        raise refused_parameters(list(array), table, bad_index[0])
    config.sequence = sequence & 0xFFFF
    return config


def refused_parameters(values: Sequence[float], table: ParameterTable, bad_index: int) -> CoreError:
    """Return the error for a parameter set, in the table's order, of which the core refuses ``bad_index`` (-1: all)."""
    if bad_index < 0:
        return CoreError("the parameters do not fit together; check the geometry and the motor model")
    parameter = table.parameters[bad_index]
    return CoreError(f"{parameter.name} = {values[bad_index]:g} cannot be used; must be {parameter.allowed}")


def plan_trajectory(config: Any, pose: Any, waypoints: Any = ffi.NULL) -> Any:
    """Return a new ``omni_trajectory_t`` from ``pose`` (omni_pose_t *); raise CoreError if it cannot be planned.

    ``waypoints`` (omni_waypoints_t *) are for the paths that need some.
    """
    plan = ffi.new("omni_trajectory_t *")
    result = lib.omni_trajectory_plan(
        plan, ffi.addressof(config, "trajectory"), ffi.addressof(config, "kinematics"), waypoints, pose
    )
    if result != lib.OMNI_OK:
        raise CoreError(PLAN_REFUSED)
    return plan
