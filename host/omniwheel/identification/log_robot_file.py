# SPDX-License-Identifier: MIT
"""A robot file with what its logs told, as a copy of the nominal one, and the calibration beside it."""

from __future__ import annotations

from pathlib import Path

from omni_schema.toml_file import read_toml
from omniwheel import files
from omniwheel.errors import LogError, OmniError
from omniwheel.identification.odometry_calibration import Odometry
from omniwheel.logs.calibration import calibration_path, save_calibration
from omniwheel.robot_text import Changes, edited
from omniwheel.robots import find_robot_file, read_robot

_FILTER = ("KF_MODE", "KF_Q_W", "KF_Q_I", "KF_R_W")
_MOTOR = {
    "inertia_kg_m2": ("MOT_J", "from the lag, R assumed"),
    "viscous_friction_N_m_s": ("MOT_B", "assumed"),
    "constant_N_m_A": ("MOT_K", "from the motor curve, b = 0"),
    "resistance_ohm": ("MOT_R", "assumed"),
    "inductance_H": ("MOT_L", "assumed"),
}


def write_robot_file(found: Odometry, nominal: str, target: Path) -> tuple[Path, Path]:
    """Write robot file and calibration and return their paths. Overwrites nothing.

    Raises LogError, RobotFileError, OutputFileError; there is no robot file then.
    """
    if target.suffix != ".toml":
        raise LogError(f"{target} is not a valid robot file name", hint="give a name that ends in .toml")
    source = find_robot_file(nominal)
    text = source.read_text(encoding="utf-8-sig")
    text += "".join(f"\n[{section}]\n" for section in ("motor", "parameters") if section not in read_toml(source))
    try:
        files.create(target, edited(text, changes(found)).encode("utf-8"))
    except FileExistsError:
        raise LogError(f"{target} exists already", hint="choose another name") from None
    calibration = calibration_path(target)
    try:
        read_robot(target)
        save_calibration(found.calibration, calibration)
    except OmniError:
        target.unlink()
        raise
    return target, calibration


def changes(found: Odometry) -> Changes:
    """Return what of a robot file the identification replaces."""
    values = found.robot.parameter_values()
    scales = [values[f"W{wheel + 1}_RSCALE"] for wheel in range(found.robot.wheels)]
    seen = "identified, in the truth's metres"
    return {
        "geometry.wheel_radius_m": (values["WHEEL_RADIUS"], seen),
        "geometry.wheel_radius_scale": (scales, "identified; by direction in the calibration"),
        "geometry.wheel_distance_m": (
            values["WHEEL_DIST"],
            seen if found.distance_seen else "nominal: the wheel never turned",
        ),
        **{f"motor.{key}": (values[name], said) for key, (name, said) in _MOTOR.items()},
        **{f"parameters.{name}": (values[name], "identified") for name in _FILTER},
    }
