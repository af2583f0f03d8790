# SPDX-License-Identifier: MIT
"""Writes identified plain geometry into a copy of a robot file."""

from __future__ import annotations

import re
from pathlib import Path

from omniwheel import files
from omniwheel.errors import LogError, OmniError
from omniwheel.identification.pose_fit.study import GeometryStudy
from omniwheel.robot_text import Changes, edited
from omniwheel.robots import find_robot_file, read_robot

TRACKED = {"tracked_x_m": "FIX_X", "tracked_y_m": "FIX_Y", "tracked_heading_rad": "FIX_TH"}
"""Where a robot keeps what is tracked by the poses."""


def write_geometry(study: GeometryStudy, nominal: str, target: Path) -> Path:
    """Write a robot file with radii, wheel distance and tracked point of the plain geometry. Overwrites nothing.

    Raises LogError, RobotFileError, OutputFileError; there is no robot file then.
    """
    if target.suffix != ".toml":
        raise LogError(f"{target} is not a valid robot file name", hint="give a name that ends in .toml")
    text = find_robot_file(nominal).read_text(encoding="utf-8-sig")
    if re.search(r"^\[parameters\]", text, re.MULTILINE) is None:
        text += "\n[parameters]\n"
    text = edited(text, changes(study))
    try:
        files.create(target, text.encode("utf-8"))
    except FileExistsError:
        raise LogError(f"{target} exists already", hint="choose another name") from None
    try:
        read_robot(target)
    except OmniError:
        target.unlink()
        raise
    return target


def changes(study: GeometryStudy) -> Changes:
    """Return what of a robot file the identification replaces: what was refused keeps its nominal value."""
    layout, plain = study.layout, study.whole.plain
    values = dict(zip(layout.names, layout.nominal, strict=True)) | dict(zip(plain.names, plain.values, strict=True))
    radii = [float(values[name]) for name in layout.names[: layout.wheels]]
    radius = sum(radii) / len(radii)
    widest = max((plain.half_width(name) for name in layout.names[: layout.wheels] if name in plain.names), default=0.0)
    found: dict[str, tuple[float | list[float], str]] = {
        "geometry.wheel_radius_m": (radius, f"identified from poses, ± {widest:.2g}"),
        "geometry.wheel_radius_scale": ([each / radius for each in radii], "identified from poses"),
    }
    if "wheel_distance_m" in plain.names:
        width = plain.half_width("wheel_distance_m")
        found["geometry.wheel_distance_m"] = (
            float(values["wheel_distance_m"]),
            f"identified from poses, ± {width:.2g}",
        )
    for name, parameter in TRACKED.items():
        if name in plain.names:
            width = plain.half_width(name)
            found[f"parameters.{parameter}"] = (float(values[name]), f"identified from poses, ± {width:.2g}")
    return found
