# SPDX-License-Identifier: MIT
"""Whether parameters are those of another robot: other wheels, geometry or wiring, which no tuning changes."""

from __future__ import annotations

from collections.abc import Mapping

from omni_schema import Parameter, ParameterTable
from omniwheel.errors import OtherRobotError
from omniwheel.parameter_file import format_value

WHEELS = "WHEELS"
_CALIBRATED = 0.05
"""A calibration changes radius and distance of the wheels by less than this share."""
_TURNED_DEG = 5.0
"""... and measured angles differ by less than this from those of the drawing."""
_EXACT = (
    "geometry.wheels",
    "encoder.counts_per_revolution",
    "encoder.direction",
    "motor.direction",
    "wiring.motor_driver",
    "wiring.in1_channel",
    "wiring.in2_channel",
)
"""Keys of the robot file whose parameters are the same as long as the robot is."""

Changes = Mapping[str, tuple[float, float]]


def _is_other(info: Parameter, before: float, after: float) -> bool:
    if info.robot_key in ("geometry.wheel_radius_m", "geometry.wheel_distance_m"):
        return abs(after - before) > _CALIBRATED * max(abs(before), abs(after))
    if info.robot_key == "geometry.wheel_angle_deg":
        return abs((after - before + 180.0) % 360.0 - 180.0) > _TURNED_DEG
    return info.robot_key in _EXACT


def hardware_changes(changes: Changes, wheels: float, table: ParameterTable) -> dict[str, tuple[float, float]]:
    """Return those of ``changes`` {name: (robot's, other value)} that mean another robot.

    ``wheels`` is how many the robot has: what belongs to a wheel that neither has counts for nothing.
    """
    most = max(wheels, *changes.get(WHEELS, (wheels,)))
    found = {}
    for name, (before, after) in changes.items():
        info = table.get(name)
        if info is not None and (info.wheel is None or info.wheel < most) and _is_other(info, before, after):
            found[name] = (before, after)
    return found


def require_same_hardware(changes: Changes, wheels: float, table: ParameterTable) -> None:
    """Raise OtherRobotError, which lists them, if any of ``changes`` means another robot."""
    found = hardware_changes(changes, wheels, table)
    if found:
        shown = ", ".join(
            f"{name} {format_value(table[name], before)} → {format_value(table[name], after)}"
            for name, (before, after) in found.items()
        )
        raise OtherRobotError(
            f"these are the parameters of another robot: wheels, geometry or wiring differ ({shown})",
            hint="nothing was set. `omni params load FILE --other-robot` sets them anyway",
        )
