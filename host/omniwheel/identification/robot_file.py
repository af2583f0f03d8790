# SPDX-License-Identifier: MIT
"""Writes what was identified into a copy of a robot file: numbers are replaced, comments stay."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from omniwheel import files
from omniwheel.errors import OmniError, RobotFileError
from omniwheel.identification.pipeline import Identification
from omniwheel.robots import find_robot_file, new_robot_file, read_robot

Changes = Mapping[str, tuple[float | list[float], str]]
"""section.key: the new value and what is said of it in a comment."""

DIGITS = 6
_HEADING = re.compile(r"^\s*\[([a-z_]+)\]")
_ENTRY = re.compile(r"^\s*([a-zA-Z_0-9]+)\s*=")


def write_robot_file(found: Identification, name: str, template: str, folder: Path) -> Path:
    """Write NAME.toml and return its path; it passes ``omni robots check``. Never overwrites.

    Raises RobotFileError, OutputFileError; there is no file then.
    """
    path = new_robot_file(name, str(find_robot_file(template)), folder)
    try:
        text = edited(path.read_text(encoding="utf-8"), changes(found))
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


def edited(text: str, replaced: Changes) -> str:
    """Return a robot file's text with these keys replaced in place, or added at the end of their section."""
    lines: list[str] = []
    left = dict(replaced)
    section = ""
    for line in text.splitlines():
        heading, entry = _HEADING.match(line), _ENTRY.match(line)
        if heading:
            _add_missing(lines, section, left)
            section = heading.group(1)
        key = f"{section}.{entry.group(1)}" if entry else ""
        lines.append(_line(key, *left.pop(key)) if key in left else line)
    _add_missing(lines, section, left)
    for key in left:
        raise RobotFileError(f"the template has no section [{key.partition('.')[0]}] for {key}")
    return "\n".join(lines) + "\n"


def _line(key: str, value: float | list[float], comment: str) -> str:
    numbers = value if isinstance(value, list) else [value]
    texts = [f"{number:.{DIGITS}g}" for number in numbers]
    texts = [text if "." in text or "e" in text else f"{text}.0" for text in texts]
    shown = f"[{', '.join(texts)}]" if isinstance(value, list) else texts[0]
    return f"{key.partition('.')[2]} = {shown}  # {comment}"


def _add_missing(lines: list[str], section: str, left: dict[str, tuple[float | list[float], str]]) -> None:
    """Add the section's keys that were not in it, before the empty lines at its end."""
    keys = [key for key in left if key.partition(".")[0] == section]
    at = len(lines)
    while at > 0 and not lines[at - 1].strip():
        at -= 1
    lines[at:at] = [_line(key, *left.pop(key)) for key in keys]
