# SPDX-License-Identifier: MIT
"""The bodies that a robot file describes: chassis, wheels, and every roller with its hinge.

A wheel has one or two rows of barrel-shaped rollers. The rows stand side by side along the axle, the second turned by
half a pitch. Each roller covers its share of the rim, so that the wheel rolls on one roller after another.

Frames: the chassis' origin is on the axles' height in the robot's centre, x forward, z up. A wheel's x axis points
outward along its axle. It drives the body counter-clockwise when it turns about minus x.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from hil_sim.world import GRAVITY_M_S2, world_config
from omni_schema import Robot
from omniwheel.errors import OmniError

ROLLER_DENSITY_kg_m3 = 1100.0
"""Rubber or polyurethane on a thin core."""


@dataclass(frozen=True)
class Key:
    """A key of ``[simulation]`` about the wheels' shape: its unit, allowed range, and what it is.

    ``assumed`` says what stands there when the file is silent.
    """

    unit: str
    least: float
    most: float
    doc: str
    assumed: str
    whole: bool = False


KEYS: dict[str, Key] = {
    "wheel_rows": Key("", 1, 2, "Rows of rollers side by side on a wheel", "2", whole=True),
    "rollers_per_row": Key("", 3, 60, "Rollers in one row", "9; 18 where there is one row", whole=True),
    "row_distance_m": Key(
        "m", 0.0, 1.0, "From the middle of one row to the middle of the other, along the axle", "0.354 wheel radii"
    ),
    "roller_radius_m": Key("m", 1e-4, 1.0, "Radius of a roller at its thickest", "0.16 wheel radii"),
    "wheel_mass_kg": Key("kg", 1e-4, 1e4, "One wheel with its rollers", "as a 0.2 kg wheel of 101.6 mm, by volume"),
    "roller_bushing_friction": Key(
        "", 0.0, 10.0, "Dry friction of a roller on its pin: torque over wheel load and roller radius", "0.02"
    ),
    "centre_of_mass_height_m": Key("m", 0.0, 10.0, "Centre of mass above the floor", "1.5 wheel radii"),
}
"""Optional keys of ``[simulation]``. The proportions assumed are those of a common double wheel of 4 inches:
2 rows of 9 rollers, 18 mm apart."""


class PartsError(OmniError, ValueError):
    """The robot file's numbers make no robot of solid bodies; the message names the key and what is allowed."""

    exit_code = 2


@dataclass(frozen=True)
class Solid:
    """Mass [kg] and principal moments of inertia [kg.m^2] about its own centre of mass."""

    mass_kg: float
    inertia_kg_m2: tuple[float, float, float]


@dataclass(frozen=True)
class WheelPart:
    """Where a wheel is: bearing [rad] and distance [m] from the robot's centre, radius [m] over the rollers."""

    bearing_rad: float
    distance_m: float
    radius_m: float
    hub: Solid
    """Without the rollers; x is the axle."""
    armature_kg_m2: float
    """Inertia of motor and gear, as seen at the wheel: what the robot file's motor inertia has beyond the wheel."""
    friction: float
    """Coefficient of friction on the floor, of this wheel."""
    drag: float
    """Factor on its rollers' friction on their pins."""


@dataclass(frozen=True)
class RollerPart:
    """A roller in the wheel's frame: ``along_m`` along the axle, ``angle_rad`` about it, 0 along the wheel's y."""

    row: int
    along_m: float
    angle_rad: float


@dataclass(frozen=True)
class RobotParts:
    """All that a simulator needs of the robot's bodies. SI units."""

    name: str
    chassis: Solid
    chassis_height_m: float
    """Chassis' centre of mass above the axles; negative: below."""
    wheels: tuple[WheelPart, ...]
    rollers: tuple[RollerPart, ...]
    """Those of one wheel; all wheels have the same."""
    roller: Solid
    """z is its own axis."""
    roller_radius_m: float
    roller_half_length_m: float
    """Half of what a roller covers of the rim, along its axis."""
    friction: float
    """Coefficient of friction on the floor, of a wheel as good as new."""
    backlash_rad: float
    """Play of the gears; no format has it."""
    motor_viscous_N_m_s: float
    motor_dry_N_m: float
    roller_viscous_N_m_s: float
    """Of one roller about its pin, so that a wheel drags as the robot file says."""
    roller_dry_N_m: float
    """Of one roller that carries its wheel's share of the weight."""

    @property
    def hub_length_m(self) -> float:
        """Length of a wheel's hub along its axle, as it is drawn."""
        return 2.0 * max(roller.along_m for roller in self.rollers) + self.roller_radius_m

    def roller_place(self, wheel: WheelPart, part: RollerPart) -> tuple[float, float, float]:
        """Return where a roller's middle is in the wheel's frame [m]. Its z axis is the wheel's, turned about x."""
        rim = wheel.radius_m - self.roller_radius_m
        return part.along_m, rim * math.cos(part.angle_rad), rim * math.sin(part.angle_rad)

    def barrel_spheres(self, wheel: WheelPart, count: int = 5) -> list[tuple[float, float]]:
        """Return spheres that fill a barrel for formats without ellipsoids: each one's place along it, and radius [m].

        Each touches the wheel's rim from within.
        """
        spheres = []
        for number in range(count):
            offset = self.roller_half_length_m * (2.0 * number / (count - 1) - 1.0)
            rim = wheel.radius_m - self.roller_radius_m
            spheres.append((offset, wheel.radius_m - math.hypot(rim, offset)))
        return spheres

    def barrel_half_axis_m(self, wheel: WheelPart) -> float:
        """Return the long half axis of the ellipsoid that has the wheel's curvature where it is thickest."""
        return math.sqrt(self.roller_radius_m * wheel.radius_m)


def robot_parts(robot: Robot, config: Any = None) -> RobotParts:
    """Return the parts of a robot. Raises PartsError, WorldError.

    ``config`` is a ``hil_world_config_t *`` with the numbers of a scenario; without it, the robot file's.
    """
    config = world_config(robot) if config is None else config
    radius = min(config.wheel_radius_m[i] for i in range(config.wheels))
    shape = _shape(robot, config, radius)
    rows, count = int(shape["wheel_rows"]), int(shape["rollers_per_row"])
    a = shape["roller_radius_m"]
    if a >= 0.5 * radius:
        raise PartsError(f"{robot.source}: simulation.roller_radius_m is {a:g}; must be less than half of a wheel's")
    half = radius * math.sin(math.pi / (rows * count))
    roller = _cylinder(ROLLER_DENSITY_kg_m3 * math.pi * a**2 * 2.0 * half, a, 2.0 * half)
    wheels = tuple(_wheel(robot, config, i, shape, roller) for i in range(config.wheels))
    chassis = _chassis(robot, config, wheels, shape, roller.mass_kg * rows * count)
    load_N = GRAVITY_M_S2 * config.mass_kg / config.wheels
    return RobotParts(
        name=robot.name,
        chassis=chassis,
        chassis_height_m=_chassis_height(robot, config, chassis, shape["centre_of_mass_height_m"] - radius),
        wheels=wheels,
        rollers=_rollers(rows, count, shape["row_distance_m"]),
        roller=roller,
        roller_radius_m=a,
        roller_half_length_m=half,
        friction=config.friction_coefficient,
        backlash_rad=config.backlash_rad,
        motor_viscous_N_m_s=config.motor_viscous_N_m_s,
        motor_dry_N_m=config.motor_coulomb_N_m,
        roller_viscous_N_m_s=config.roller_friction_N_s_m * a**2,
        roller_dry_N_m=shape["roller_bushing_friction"] * load_N * a,
    )


def _shape(robot: Robot, config: Any, radius: float) -> dict[str, float]:
    """Return every key of KEYS: the file's number, else what is assumed for a wheel of this radius."""
    rows = _number(robot, config, "wheel_rows", 2.0)
    assumed = {
        "wheel_rows": rows,
        "rollers_per_row": 18.0 / rows,
        "row_distance_m": 0.354 * radius if rows == 2.0 else 0.0,
        "roller_radius_m": 0.16 * radius,
        "wheel_mass_kg": 0.2 * (radius / 0.0508) ** 3,
        "roller_bushing_friction": 0.02,
        "centre_of_mass_height_m": 1.5 * radius,
    }
    return {name: _number(robot, config, name, value) for name, value in assumed.items()}


def _number(robot: Robot, config: Any, name: str, assumed: float) -> float:
    """Return the scenario's number, else the robot file's, else what is assumed; 0 rollers mean: not told."""
    value, key = robot.simulation.get(name, assumed), KEYS[name]
    if getattr(config, name, 0) > 0:
        value = float(getattr(config, name))
    elif name == "rollers_per_row":
        value = assumed
    what = f"a {'whole ' if key.whole else ''}number from {key.least:g} to {key.most:g}"
    if not isinstance(value, int | float) or not key.least <= value <= key.most or (key.whole and value != int(value)):
        raise PartsError(f"{robot.source}: simulation.{name} is {value!r}; must be {what}")
    return float(value)


def _cylinder(mass: float, radius: float, length: float) -> Solid:
    across = mass * (3.0 * radius**2 + length**2) / 12.0
    return Solid(mass, (across, across, 0.5 * mass * radius**2))


def _wheel(robot: Robot, config: Any, index: int, shape: dict[str, float], roller: Solid) -> WheelPart:
    radius, count = config.wheel_radius_m[index], shape["wheel_rows"] * shape["rollers_per_row"]
    hub_mass = shape["wheel_mass_kg"] - count * roller.mass_kg
    if hub_mass <= 0.0:
        raise PartsError(
            f"{robot.source}: simulation.wheel_mass_kg is {shape['wheel_mass_kg']:g}; its rollers alone are "
            f"{count * roller.mass_kg:.3g} kg: give more, or thinner rollers"
        )
    inner = radius - 2.0 * shape["roller_radius_m"]
    disc = _cylinder(hub_mass, inner, shape["row_distance_m"] + shape["roller_radius_m"])
    rim = radius - shape["roller_radius_m"]
    spin = disc.inertia_kg_m2[2] + count * (roller.inertia_kg_m2[0] + roller.mass_kg * rim**2)
    return WheelPart(
        bearing_rad=config.wheel_angle_rad[index],
        distance_m=config.wheel_distance_m[index],
        radius_m=radius,
        hub=Solid(hub_mass, (disc.inertia_kg_m2[2], disc.inertia_kg_m2[0], disc.inertia_kg_m2[0])),
        armature_kg_m2=max(config.motor_inertia_kg_m2 - spin, 0.0),
        friction=config.friction_coefficient * config.wheel_friction[index],
        drag=config.wheel_drag[index],
    )


def _chassis(
    robot: Robot, config: Any, wheels: tuple[WheelPart, ...], shape: dict[str, float], rollers_kg: float
) -> Solid:
    mass = config.mass_kg - len(wheels) * shape["wheel_mass_kg"]
    about_z = config.inertia_kg_m2
    for wheel in wheels:
        rim = wheel.radius_m - shape["roller_radius_m"]
        about_z -= wheel.hub.inertia_kg_m2[2] + 0.5 * rollers_kg * rim**2 + shape["wheel_mass_kg"] * wheel.distance_m**2
    if mass <= 0.0 or about_z <= 0.0:
        key, left = ("mass_kg", mass) if mass <= 0.0 else ("inertia_kg_m2", about_z)
        raise PartsError(
            f"{robot.source}: simulation.{key} leaves {left:.3g} for the body without its wheels; "
            f"give more, or a smaller simulation.wheel_mass_kg than {shape['wheel_mass_kg']:.3g}"
        )
    across = 0.5 * about_z + mass * (0.5 * wheels[0].radius_m) ** 2 / 3.0
    return Solid(mass, (across, across, about_z))


def _chassis_height(robot: Robot, config: Any, chassis: Solid, above_axles: float) -> float:
    """Return where the chassis has to be so that the whole robot's centre of mass is where the file says."""
    return above_axles * float(config.mass_kg) / chassis.mass_kg


def _rollers(rows: int, count: int, apart: float) -> tuple[RollerPart, ...]:
    pitch = 2.0 * math.pi / count
    return tuple(
        RollerPart(row, (row - 0.5 * (rows - 1)) * apart, pitch * (number + row / rows))
        for row in range(rows)
        for number in range(count)
    )
