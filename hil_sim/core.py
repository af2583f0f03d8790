# SPDX-License-Identifier: MIT
"""The control core as the simulations use it: parameter sets, plans and names. All control stays in C."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from omni_schema import ParameterTable
from omniwheel._core import ffi, lib
from omniwheel.core_config import plan_trajectory, robot_config
from omniwheel.errors import CoreError

__all__ = [
    "ENDLESS",
    "TICK_US",
    "CoreError",
    "fault_names",
    "path_ticks",
    "plan_summary",
    "plan_trajectory",
    "robot_config",
    "state_name",
    "warning_names",
]

TICK_US = 1000
ENDLESS = "the trajectory has no end (TRJ_LAPS = 0): give times in seconds and a duration"


def path_ticks(config: Any, share: float) -> int:
    """Return how many ticks the configured path takes, lead-in left out, until ``share`` of it is driven.

    Raises CoreError if the path cannot be planned or has no end.
    """
    plan_trajectory(config, ffi.new("omni_pose_t *"))
    ticks = int(lib.hil_path_ticks(ffi.new("hil_path_t *"), config, share))
    if ticks == 2**64 - 1:
        raise CoreError(ENDLESS)
    return ticks


def plan_summary(values: Mapping[str, float], table: ParameterTable) -> dict[str, float | None]:
    """Return what the planner says of the configured path: scale, needed scale, peak demands at scale 1.

    The duration of a path without end is None.
    """
    config = robot_config(values, table, 0)
    plan = plan_trajectory(config, ffi.new("omni_pose_t *"))
    return {
        "duration_s": float(plan.duration_s * plan.scale) if plan.duration_s >= 0.0 else None,
        "scale": float(plan.scale),
        "needed_scale": float(plan.needed_scale),
        "peak_wheel_rad_s": float(plan.peak_wheel_rad_s),
        "peak_voltage_V": float(plan.peak_voltage_V),
    }


def _bit_names(bits: int, mask: int) -> list[str]:
    return [ffi.string(lib.omni_fault_name(1 << i)).decode() for i in range(32) if bits & mask & (1 << i)]


def fault_names(bits: int) -> list[str]:
    """Return the names of the stop faults in a fault field."""
    return _bit_names(bits, lib.OMNI_FAULT_STOP_MASK)


def warning_names(bits: int) -> list[str]:
    """Return the names of the warnings in a fault field."""
    return _bit_names(bits, lib.OMNI_WARN_MASK)


def state_name(state: int) -> str:
    """Return the name of a safety state."""
    return str(ffi.string(lib.omni_safety_state_name(state)).decode())
