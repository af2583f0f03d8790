# SPDX-License-Identifier: MIT
"""Writes what was identified into a copy of a robot file: numbers are replaced, comments stay."""

from __future__ import annotations

from pathlib import Path

from omniwheel import files
from omniwheel.errors import OmniError
from omniwheel.identification.pipeline import Identification
from omniwheel.robot_text import Changes, edited
from omniwheel.robots import find_robot_file, new_robot_file, read_robot


def write_robot_file(found: Identification, name: str, template: str, folder: Path) -> Path:
    """Write NAME.toml and return its path; it passes ``omni robots check``. Never overwrites.

    Raises RobotFileError, OutputFileError; there is no file then.
    """
    path = new_robot_file(name, str(find_robot_file(template)), folder)
    try:
        text = edited(path.read_text(encoding="utf-8-sig"), changes(found))
        files.write_text(path, text)
        read_robot(path)
    except OmniError:
        path.unlink()
        raise
    return path


def changes(found: Identification) -> Changes:
    """Return what of a robot file the identification replaces."""
    physical, known = found.physical, found.known

    def of(name: str) -> tuple[float, str]:
        return physical[name], f"identified, ± {physical.half_width(name):.2g}"

    values: dict[str, tuple[float | list[float], str]] = {
        "motor.inertia_kg_m2": of("motor_inertia_kg_m2"),
        "motor.viscous_friction_N_m_s": of("motor_viscous_N_m_s"),
        "motor.constant_N_m_A": of("motor_constant_N_m_A"),
        "motor.resistance_ohm": (known.resistance_ohm, "given"),
        "motor.inductance_H": (known.inductance_H, "given"),
        "simulation.mass_kg": (known.mass_kg, "given"),
        "simulation.inertia_kg_m2": of("inertia_kg_m2"),
        "simulation.coulomb_friction_N_m": of("motor_coulomb_N_m"),
    }
    if known.motor_constant_N_m_A is not None:
        values["motor.constant_N_m_A"] = (known.motor_constant_N_m_A, "given")
    if found.geometry is not None:
        radii = found.geometry.values[:-1]
        worst = max(found.geometry.half_width(name) for name in found.geometry.names[:-1])
        distance_width = found.geometry.half_width("wheel_distance_m")
        values["geometry.wheel_radius_m"] = (float(radii.mean()), f"identified, ± {worst:.2g}")
        values["geometry.wheel_radius_scale"] = ([float(r / radii.mean()) for r in radii], "identified")
        values["geometry.wheel_distance_m"] = (found.layout.distance_m, f"identified, ± {distance_width:.2g}")
    return values
