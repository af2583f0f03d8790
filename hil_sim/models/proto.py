# SPDX-License-Identifier: MIT
"""A robot as a Webots PROTO file (R2023b)."""

from __future__ import annotations

import math
from collections.abc import Iterable

from hil_sim.models.parts import RobotParts, RollerPart, Solid, WheelPart
from hil_sim.models.text import motor_note, numbers

_GREY, _BLACK, _BLUE = "0.5 0.5 0.5", "0.15 0.15 0.15", "0.2 0.3 0.45"


def proto(parts: RobotParts) -> str:
    """Return the robot as text. A barrel is a row of spheres, as Webots has no ellipsoids that collide."""
    reach = min(wheel.distance_m for wheel in parts.wheels) - 0.6 * parts.wheels[0].radius_m
    children = [
        _shape(f"Cylinder {{ radius {numbers(reach)} height {numbers(0.5 * parts.wheels[0].radius_m)} }}", _BLUE),
        *(_wheel(parts, wheel, number) for number, wheel in enumerate(parts.wheels, 1)),
        'Gyro { name "gyro" }',
        'Accelerometer { name "accelerometer" }',
    ]
    lines = [
        "#VRML_SIM R2023b utf8",
        f"# {motor_note(parts, friction=False)}",
        f"PROTO {parts.name} [",
        f"  field SFVec3f translation 0 0 {numbers(parts.wheels[0].radius_m)}",
        "  field SFRotation rotation 0 0 1 0",
        f'  field SFString name "{parts.name}"',
        '  field SFString controller "<generic>"',
        "]",
        "{",
        "  Robot {",
        *(f"    {field} IS {field}" for field in ("translation", "rotation", "name", "controller")),
        f"    children [\n{_indented(children, 6)}\n    ]",
        f"    physics {_physics(parts.chassis, (0.0, 0.0, parts.chassis_height_m))}",
        "  }",
        "}",
    ]
    return "\n".join(lines) + "\n"


def _wheel(parts: RobotParts, wheel: WheelPart, number: int) -> str:
    cosine, sine = math.cos(wheel.bearing_rad), math.sin(wheel.bearing_rad)
    place = numbers(wheel.distance_m * cosine, wheel.distance_m * sine, 0)
    hub = _shape(
        f"Cylinder {{ radius {numbers(wheel.radius_m - 2.0 * parts.roller_radius_m)} "
        f"height {numbers(parts.hub_length_m)} }}",
        _GREY,
    )
    turned = f"Pose {{ rotation 0 1 0 {numbers(0.5 * math.pi)} children [ {hub} ] }}"
    rollers = [_roller(parts, wheel, number, index, part) for index, part in enumerate(parts.rollers, 1)]
    return (
        "HingeJoint {\n"
        f"  jointParameters HingeJointParameters {{ axis {numbers(-cosine, -sine, 0)} anchor {place} "
        f"dampingConstant {numbers(parts.motor_viscous_N_m_s)} staticFriction {numbers(parts.motor_dry_N_m)} }}\n"
        f'  device [ RotationalMotor {{ name "motor_{number}" }} PositionSensor {{ name "angle_{number}" }} ]\n'
        "  endPoint Solid {\n"
        f"    translation {place}\n"
        f"    rotation 0 0 1 {numbers(wheel.bearing_rad)}\n"
        f'    name "wheel_{number}"\n'
        f"    children [\n{_indented([turned, *rollers], 6)}\n    ]\n"
        f"    physics {_physics(wheel.hub)}\n"
        "  }\n"
        "}"
    )


def _roller(parts: RobotParts, wheel: WheelPart, number: int, index: int, part: RollerPart) -> str:
    place = numbers(*parts.roller_place(wheel, part))
    cosine, sine = math.cos(part.angle_rad), math.sin(part.angle_rad)
    spheres = [
        f"Pose {{ translation 0 0 {numbers(offset)} children [ "
        + _shape(f"Sphere {{ radius {numbers(radius)} subdivision 2 }}", _BLACK)
        + " ] }"
        for offset, radius in parts.barrel_spheres(wheel)
    ]
    bounds = " ".join(
        f"Pose {{ translation 0 0 {numbers(offset)} children [ Sphere {{ radius {numbers(radius)} }} ] }}"
        for offset, radius in parts.barrel_spheres(wheel)
    )
    return (
        "HingeJoint {\n"
        f"  jointParameters HingeJointParameters {{ axis {numbers(0, sine, -cosine)} anchor {place} "
        f"dampingConstant {numbers(wheel.drag * parts.roller_viscous_N_m_s)} "
        f"staticFriction {numbers(wheel.drag * parts.roller_dry_N_m)} }}\n"
        "  endPoint Solid {\n"
        f"    translation {place}\n"
        f"    rotation 1 0 0 {numbers(math.remainder(part.angle_rad + math.pi, 2.0 * math.pi))}\n"
        f'    name "roller_{number}_{index}"\n'
        f"    children [\n{_indented(spheres, 6)}\n    ]\n"
        f"    boundingObject Group {{ children [ {bounds} ] }}\n"
        f"    physics {_physics(parts.roller)}\n"
        "  }\n"
        "}"
    )


def _shape(geometry: str, colour: str) -> str:
    look = f"PBRAppearance {{ baseColor {colour} roughness 0.7 metalness 0 }}"
    return f"Shape {{ appearance {look} geometry {geometry} }}"


def _physics(solid: Solid, centre: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> str:
    return (
        f"Physics {{ density -1 mass {numbers(solid.mass_kg)} centerOfMass [ {numbers(*centre)} ] "
        f"inertiaMatrix [ {numbers(*solid.inertia_kg_m2)}, 0 0 0 ] }}"
    )


def _indented(blocks: Iterable[str], spaces: int) -> str:
    return "\n".join(" " * spaces + line for block in blocks for line in block.split("\n"))
