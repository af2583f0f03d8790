# SPDX-License-Identifier: MIT
"""A robot as a MuJoCo model (MJCF): every roller a body with its hinge, motors as actuators of current."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass

from hil_sim.models.parts import RobotParts, Solid, WheelPart
from hil_sim.models.text import numbers, xml_text

STEP_s = 1e-3
CONTACT_TIME_s = 0.002
"""Time constant of a roller's rubber in the floor: the least that MuJoCo allows with this step."""
FLOOR_BIT, ROLLER_BIT = 1, 2


@dataclass(frozen=True)
class Bumps:
    """A floor as a square height field around 0, 0: points along a side, half of the side [m], greatest height [m].

    The heights themselves go into ``hfield_data`` of the compiled model, 0..1.
    """

    rows: int
    half_m: float
    height_m: float


def mjcf(
    parts: RobotParts, inductance_time_s: float = 5e-4, constant_N_m_A: float = 1.0, bumps: Bumps | None = None
) -> str:
    """Return the model as text. It stands at 0, 0, its x axis along the world's, on a flat floor or on ``bumps``.

    The actuator ``motor_N`` of wheel N takes the current [A] that its winding strives for. It has the winding's time
    constant ``inductance_time_s`` (L / R), and ``constant_N_m_A`` newton metres per ampere. Sensors: ``gyro``
    [rad/s], ``accelerometer`` [m/s^2], the body's pose, and angle [rad] and speed [rad/s] of each wheel.
    """
    root = ET.Element("mujoco", model=parts.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    ET.SubElement(
        root, "option", timestep=f"{STEP_s:g}", cone="elliptic", impratio="10", integrator="implicitfast",
        solver="Newton", jacobian="sparse", iterations="20",
    )  # fmt: skip
    visual = ET.SubElement(root, "visual")
    ET.SubElement(visual, "global", offwidth="1920", offheight="1080")
    _assets(root, bumps)
    world = ET.SubElement(root, "worldbody")
    ET.SubElement(world, "light", pos="0 0 3", dir="0 0 -1", directional="true")
    kind = {"type": "plane", "size": "0 0 0.1"} if bumps is None else {"type": "hfield", "hfield": "bumps"}
    ET.SubElement(
        world, "geom", kind, name="floor", material="floor", contype=str(FLOOR_BIT), conaffinity=str(ROLLER_BIT),
        friction=numbers(parts.friction, 0, 0), condim="3",
    )  # fmt: skip
    _robot(world, parts)
    _actuators(root, parts, inductance_time_s, constant_N_m_A)
    _sensors(root, parts)
    return xml_text(root)


def _assets(root: ET.Element, bumps: Bumps | None) -> None:
    assets = ET.SubElement(root, "asset")
    ET.SubElement(
        assets, "texture", name="tiles", type="2d", builtin="checker", width="256", height="256",
        rgb1="0.85 0.85 0.85", rgb2="0.7 0.72 0.75",
    )  # fmt: skip
    ET.SubElement(assets, "material", name="floor", texture="tiles", texrepeat="5 5", texuniform="true")
    if bumps is not None:
        size = numbers(bumps.half_m, bumps.half_m, bumps.height_m, 0.05)
        ET.SubElement(assets, "hfield", name="bumps", nrow=str(bumps.rows), ncol=str(bumps.rows), size=size)


def _robot(world: ET.Element, parts: RobotParts) -> None:
    body = ET.SubElement(world, "body", name="chassis", pos=numbers(0, 0, parts.wheels[0].radius_m))
    ET.SubElement(body, "freejoint", name="free")
    _inertial(body, parts.chassis, (0.0, 0.0, parts.chassis_height_m))
    ET.SubElement(body, "site", name="imu")
    reach = min(wheel.distance_m for wheel in parts.wheels) - parts.wheels[0].radius_m * 0.6
    for name, size, place, colour in (
        ("deck", (reach, 0.25 * parts.wheels[0].radius_m), (0.0, 0.0, parts.wheels[0].radius_m), "0.2 0.3 0.45 1"),
        ("nose", (0.1 * reach, 0.1 * reach), (0.7 * reach, 0.0, 1.35 * parts.wheels[0].radius_m), "0.9 0.5 0.1 1"),
    ):
        ET.SubElement(
            body, "geom", name=name, type="cylinder", size=numbers(*size), pos=numbers(*place), rgba=colour,
            contype="0", conaffinity="0", mass="0",
        )  # fmt: skip
    for number, wheel in enumerate(parts.wheels, 1):
        _wheel(body, parts, wheel, number)


def _wheel(chassis: ET.Element, parts: RobotParts, wheel: WheelPart, number: int) -> None:
    place = wheel.distance_m * math.cos(wheel.bearing_rad), wheel.distance_m * math.sin(wheel.bearing_rad), 0.0
    turned = math.cos(0.5 * wheel.bearing_rad), 0.0, 0.0, math.sin(0.5 * wheel.bearing_rad)
    body = ET.SubElement(chassis, "body", name=f"wheel_{number}", pos=numbers(*place), quat=numbers(*turned))
    ET.SubElement(
        body, "joint", name=f"axle_{number}", type="hinge", axis="-1 0 0", armature=numbers(wheel.armature_kg_m2),
        damping=numbers(parts.motor_viscous_N_m_s), frictionloss=numbers(parts.motor_dry_N_m),
    )  # fmt: skip
    _inertial(body, wheel.hub, (0.0, 0.0, 0.0))
    ET.SubElement(
        body, "geom", type="cylinder",
        size=numbers(wheel.radius_m - 2.0 * parts.roller_radius_m, 0.5 * parts.hub_length_m),
        quat=numbers(math.sqrt(0.5), 0, math.sqrt(0.5), 0), rgba="0.5 0.5 0.5 1", contype="0", conaffinity="0",
        mass="0",
    )  # fmt: skip
    for index, part in enumerate(parts.rollers, 1):
        cosine, sine = math.cos(part.angle_rad), math.sin(part.angle_rad)
        name = f"roller_{number}_{index}"
        roller = ET.SubElement(
            body, "body", name=name, pos=numbers(*parts.roller_place(wheel, part)),
            xyaxes=numbers(1, 0, 0, 0, -cosine, -sine),
        )  # fmt: skip
        ET.SubElement(
            roller, "joint", name=f"pin_{number}_{index}", type="hinge", axis="0 0 1",
            damping=numbers(wheel.drag * parts.roller_viscous_N_m_s), armature=numbers(parts.roller.inertia_kg_m2[2]),
        )  # fmt: skip
        _inertial(roller, parts.roller, (0.0, 0.0, 0.0))
        ET.SubElement(
            roller, "geom", name=name, type="ellipsoid",
            size=numbers(parts.roller_radius_m, parts.roller_radius_m, parts.barrel_half_axis_m(wheel)),
            contype=str(ROLLER_BIT), conaffinity=str(FLOOR_BIT), condim="3", priority="1",
            friction=numbers(wheel.friction, 0, 0), solref=numbers(CONTACT_TIME_s, 1),
            rgba="0.15 0.15 0.15 1" if part.row == 0 else "0.3 0.3 0.3 1",
        )  # fmt: skip


def _inertial(body: ET.Element, solid: Solid, place: tuple[float, float, float]) -> None:
    ET.SubElement(
        body, "inertial", pos=numbers(*place), mass=numbers(solid.mass_kg),
        diaginertia=numbers(*solid.inertia_kg_m2),
    )  # fmt: skip


def _actuators(root: ET.Element, parts: RobotParts, time_s: float, constant: float) -> None:
    actuators = ET.SubElement(root, "actuator")
    for number in range(1, len(parts.wheels) + 1):
        ET.SubElement(
            actuators, "general", name=f"motor_{number}", joint=f"axle_{number}", dyntype="filterexact",
            dynprm=numbers(time_s), gainprm=numbers(constant),
        )  # fmt: skip


def _sensors(root: ET.Element, parts: RobotParts) -> None:
    sensors = ET.SubElement(root, "sensor")
    ET.SubElement(sensors, "gyro", name="gyro", site="imu")
    ET.SubElement(sensors, "accelerometer", name="accelerometer", site="imu")
    for number in range(1, len(parts.wheels) + 1):
        ET.SubElement(sensors, "jointpos", name=f"angle_{number}", joint=f"axle_{number}")
        ET.SubElement(sensors, "jointvel", name=f"speed_{number}", joint=f"axle_{number}")
