# SPDX-License-Identifier: MIT
"""A robot as a URDF file: ROS, PyBullet, Isaac, MuJoCo and others read it."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET

from hil_sim.models.parts import RobotParts, Solid, WheelPart
from hil_sim.models.text import motor_note, numbers, xml_text

Place = tuple[float, float, float]
_NOWHERE: Place = (0.0, 0.0, 0.0)


def urdf(parts: RobotParts) -> str:
    """Return the robot as text. A barrel is a row of spheres: the format knows no ellipsoids, nor a motor's inertia."""
    root = ET.Element("robot", name=parts.name)
    root.append(ET.Comment(motor_note(parts, friction=False)))
    base = _link(root, "base_link", parts.chassis, (0.0, 0.0, parts.chassis_height_m))
    reach = min(wheel.distance_m for wheel in parts.wheels) - 0.6 * parts.wheels[0].radius_m
    _shape(ET.SubElement(base, "visual"), _NOWHERE, "cylinder", radius=reach, length=0.5 * parts.wheels[0].radius_m)
    for number, wheel in enumerate(parts.wheels, 1):
        _wheel(root, parts, wheel, number)
    return xml_text(root)


def _wheel(root: ET.Element, parts: RobotParts, wheel: WheelPart, number: int) -> None:
    name = f"wheel_{number}"
    link = _link(root, name, wheel.hub, _NOWHERE)
    visual = ET.SubElement(link, "visual")
    _shape(
        visual, _NOWHERE, "cylinder", (0.0, 0.5 * math.pi, 0.0),
        radius=wheel.radius_m - 2.0 * parts.roller_radius_m, length=parts.hub_length_m,
    )  # fmt: skip
    place = wheel.distance_m * math.cos(wheel.bearing_rad), wheel.distance_m * math.sin(wheel.bearing_rad), 0.0
    axle = _joint(root, f"axle_{number}", "base_link", name, place, (0.0, 0.0, wheel.bearing_rad), (-1.0, 0.0, 0.0))
    _dynamics(axle, parts.motor_viscous_N_m_s, parts.motor_dry_N_m)
    for index, part in enumerate(parts.rollers, 1):
        roller = f"roller_{number}_{index}"
        link = _link(root, roller, parts.roller, _NOWHERE)
        for offset, radius in parts.barrel_spheres(wheel):
            _shape(ET.SubElement(link, "visual"), (0.0, 0.0, offset), "sphere", radius=radius)
            _shape(ET.SubElement(link, "collision"), (0.0, 0.0, offset), "sphere", radius=radius)
        turned = part.angle_rad + math.pi, 0.0, 0.0
        pin = _joint(root, f"pin_{number}_{index}", name, roller, parts.roller_place(wheel, part), turned, (0, 0, 1))
        _dynamics(pin, wheel.drag * parts.roller_viscous_N_m_s, wheel.drag * parts.roller_dry_N_m)


def _link(root: ET.Element, name: str, solid: Solid, centre: Place) -> ET.Element:
    link = ET.SubElement(root, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=numbers(*centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=numbers(solid.mass_kg))
    x, y, z = solid.inertia_kg_m2
    ET.SubElement(
        inertial, "inertia", ixx=numbers(x), iyy=numbers(y), izz=numbers(z), ixy="0", ixz="0", iyz="0"
    )  # fmt: skip
    return link


def _shape(parent: ET.Element, place: Place, kind: str, turned: Place = _NOWHERE, **sizes: float) -> None:
    ET.SubElement(parent, "origin", xyz=numbers(*place), rpy=numbers(*turned))
    geometry = ET.SubElement(parent, "geometry")
    ET.SubElement(geometry, kind, {name: numbers(size) for name, size in sizes.items()})


def _joint(
    root: ET.Element, name: str, parent: str, child: str, place: Place, turned: Place, axis: Place
) -> ET.Element:
    joint = ET.SubElement(root, "joint", name=name, type="continuous")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "origin", xyz=numbers(*place), rpy=numbers(*turned))
    ET.SubElement(joint, "axis", xyz=numbers(*axis))
    return joint


def _dynamics(joint: ET.Element, damping: float, friction: float) -> None:
    ET.SubElement(joint, "dynamics", damping=numbers(damping), friction=numbers(friction))
