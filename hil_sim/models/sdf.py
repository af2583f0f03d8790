# SPDX-License-Identifier: MIT
"""A robot as an SDF file (SDFormat 1.9), which Gazebo reads."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from hil_sim.models.parts import RobotParts, Solid, WheelPart
from hil_sim.models.text import motor_note, numbers, xml_text


def sdf(parts: RobotParts) -> str:
    """Return the robot as text. The format knows no inertia of a motor behind a gear; a comment says what it is."""
    root = ET.Element("sdf", version="1.9")
    model = ET.SubElement(root, "model", name=parts.name)
    model.append(ET.Comment(motor_note(parts)))
    _text(model, "pose", numbers(0, 0, parts.wheels[0].radius_m, 0, 0, 0))
    base = _link(model, "base_link", parts.chassis, (0.0, 0.0, parts.chassis_height_m))
    reach = min(wheel.distance_m for wheel in parts.wheels) - 0.6 * parts.wheels[0].radius_m
    visual = ET.SubElement(base, "visual", name="deck")
    _cylinder(visual, reach, 0.5 * parts.wheels[0].radius_m)
    for number, wheel in enumerate(parts.wheels, 1):
        _wheel(model, parts, wheel, number)
    return xml_text(root)


def _wheel(model: ET.Element, parts: RobotParts, wheel: WheelPart, number: int) -> None:
    name = f"wheel_{number}"
    x, y = wheel.distance_m * math.cos(wheel.bearing_rad), wheel.distance_m * math.sin(wheel.bearing_rad)
    link = _link(model, name, wheel.hub, (0.0, 0.0, 0.0), "base_link", (x, y, 0.0, 0.0, 0.0, wheel.bearing_rad))
    visual = ET.SubElement(link, "visual", name="hub")
    _text(visual, "pose", numbers(0, 0, 0, 0, 0.5 * math.pi, 0))
    _cylinder(visual, wheel.radius_m - 2.0 * parts.roller_radius_m, parts.hub_length_m)
    _joint(model, f"axle_{number}", "base_link", name, (-1.0, 0.0, 0.0), parts.motor_viscous_N_m_s, parts.motor_dry_N_m)
    radii = numbers(parts.roller_radius_m, parts.roller_radius_m, parts.barrel_half_axis_m(wheel))
    for index, part in enumerate(parts.rollers, 1):
        roller = f"roller_{number}_{index}"
        place = (*parts.roller_place(wheel, part), part.angle_rad + math.pi, 0.0, 0.0)
        link = _link(model, roller, parts.roller, (0.0, 0.0, 0.0), name, place)
        for kind in ("visual", "collision"):
            shape = ET.SubElement(link, kind, name=kind)
            _text(ET.SubElement(ET.SubElement(shape, "geometry"), "ellipsoid"), "radii", radii)
        surface = ET.SubElement(ET.SubElement(ET.SubElement(shape, "surface"), "friction"), "ode")
        _text(surface, "mu", numbers(wheel.friction))
        _text(surface, "mu2", numbers(wheel.friction))
        _joint(
            model, f"pin_{number}_{index}", name, roller, (0.0, 0.0, 1.0), wheel.drag * parts.roller_viscous_N_m_s,
            wheel.drag * parts.roller_dry_N_m,
        )  # fmt: skip


def _text(parent: ET.Element, tag: str, text: str, **attributes: str) -> None:
    ET.SubElement(parent, tag, attributes).text = text


def _cylinder(visual: ET.Element, radius: float, length: float) -> None:
    cylinder = ET.SubElement(ET.SubElement(visual, "geometry"), "cylinder")
    _text(cylinder, "radius", numbers(radius))
    _text(cylinder, "length", numbers(length))


def _link(
    model: ET.Element,
    name: str,
    solid: Solid,
    centre: tuple[float, float, float],
    parent: str = "",
    pose: tuple[float, ...] = (),
) -> ET.Element:
    link = ET.SubElement(model, "link", name=name)
    if parent:
        _text(link, "pose", numbers(*pose), relative_to=parent)
    inertial = ET.SubElement(link, "inertial")
    _text(inertial, "pose", numbers(*centre, 0, 0, 0))
    _text(inertial, "mass", numbers(solid.mass_kg))
    inertia = ET.SubElement(inertial, "inertia")
    for tag, moment in zip(("ixx", "iyy", "izz"), solid.inertia_kg_m2, strict=True):
        _text(inertia, tag, numbers(moment))
    for tag in ("ixy", "ixz", "iyz"):
        _text(inertia, tag, "0")
    return link


def _joint(
    model: ET.Element,
    name: str,
    parent: str,
    child: str,
    axis: tuple[float, float, float],
    damping: float,
    friction: float,
) -> None:
    joint = ET.SubElement(model, "joint", name=name, type="revolute")
    _text(joint, "parent", parent)
    _text(joint, "child", child)
    element = ET.SubElement(joint, "axis")
    _text(element, "xyz", numbers(*axis))
    dynamics = ET.SubElement(element, "dynamics")
    _text(dynamics, "damping", numbers(damping))
    _text(dynamics, "friction", numbers(friction))
