# SPDX-License-Identifier: MIT
"""MuJoCo as the world around the real firmware: ``omni run SCENARIO --world mujoco``.

The model is made from the robot file: every roller is a body with its hinge and touches the floor by itself. Motors
follow from supply, duty and the robot file's motor data here; MuJoCo integrates current, bodies and contacts.

It needs the extra ``mujoco``. One world is for one thread.
"""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from ctypes.util import find_library
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hil_sim.c_scenario import scenario_world
from hil_sim.external import ExternalWorldInputError, Sensed
from hil_sim.models.mjcf import FLOOR_BIT, ROLLER_BIT, Bumps, mjcf
from hil_sim.models.parts import robot_parts
from hil_sim.mujoco_film import FILM_FILE, Camera
from hil_sim.mujoco_settings import Floor, Settings, read_settings
from hil_sim.patches import factor_at
from hil_sim.scenario import Scenario
from hil_sim.world import GRAVITY_M_S2
from omniwheel._core import ffi

SETTLE_STEPS = 300
"""The robot is set down on the floor before time 0."""
PLAIN = Settings()
"""A level floor and no film."""
_BUMP_ROWS = 400
"""Points of the bumps' height along each side of the floor."""


class _Numbers:
    """MuJoCo's own numbers where it keeps them, read one by one: a tick needs a tenth of them."""

    def __init__(self, data: Any) -> None:
        views = [ffi.from_buffer("double[]", array) for array in (data.qpos, data.qvel, data.ctrl, data.act)]
        self.position, self.speed, self.control, self.current = views


class MujocoWorld:
    """One robot of a scenario on a floor, as an :class:`hil_sim.external.ExternalWorld`.

    ``model`` and ``data`` are MuJoCo's own ``MjModel`` and ``MjData``; whatever they offer may be read. The wheels
    begin turned at random, by the scenario's seed, so that another seed meets the rollers elsewhere.
    """

    knows_patches = True
    """It has those of the scenario."""

    def __init__(self, scenario: Scenario, settings: Settings | Path = PLAIN) -> None:
        """Make it with a floor and a film, or the path of a file that says them.

        Raises ExternalWorldInputError without the package ``mujoco``; PartsError, WorldError for the robot;
        SchemaError for the file; ExternalWorldInputError also for what the model cannot have.
        """
        self._mujoco = _library()
        self._config = scenario_world(scenario)
        _refuse_play(scenario, self._config)
        self._patches = scenario.patches
        self.parts = robot_parts(scenario.world_robot or scenario.robot, self._config)
        self.settings = read_settings(settings) if isinstance(settings, Path) else settings
        self.floor = _floor(self.settings.floor, self._config)
        self.notes = _notes(self._config)
        """What the scenario asks for and this world has no such thing of; a sentence each."""
        config = self._config
        heights = self.floor.heights(_BUMP_ROWS)
        bumps = None if heights is None else Bumps(_BUMP_ROWS, 0.5 * self.floor.bumps_size_m, self.floor.bumps_m)
        seconds = config.motor_inductance_H / config.motor_resistance_ohm
        text = mjcf(self.parts, seconds, config.motor_constant_N_m_A, bumps)
        self.model: Any = self._mujoco.MjModel.from_xml_string(text)
        self.model.opt.gravity[:] = self.floor.gravity(GRAVITY_M_S2)
        if heights is not None:
            self.model.hfield_data[:] = (heights / self.floor.bumps_m).ravel()
        self.data: Any = self._mujoco.MjData(self.model)
        self._now = _Numbers(self.data)
        self._position, self._quaternion = self._now.position, self._now.position + 3
        self._is_ahead = False
        self._find(len(self.parts.wheels))
        self._turns, self._last_yaw = 0.0, 0.0
        self._duty, self._coast = (0.0,) * self._wheels, (1.0,) * self._wheels
        self._current_A, self._supply_V = [0.0] * self._wheels, float(config.battery_V)
        self._set_down(scenario)
        film = self.settings.film
        self._camera = None if film is None else Camera(self.model, film)

    def sense(self) -> Sensed:
        """Return encoder edges, supply under load and the true pose, in the floor's plane."""
        return Sensed(
            counts=[math.floor(self._position[i] * self._edges_per_rad) for i in self._axles],
            supply_V=self._supply_V,
            pose=self.pose,
            wheel_rad_s=self._wheel_rad_s,
            current_A=self._current_A,
        )

    def apply(self, duty: Sequence[float], coast: Sequence[float]) -> None:
        """Set the bridges for the next step."""
        self._duty, self._coast = tuple(duty), tuple(coast)

    def ahead(self) -> None:
        """Compute what of the next step needs no motors: where everything is, and what touches the floor."""
        self._lower()
        if self.floor.patches or self._patches:
            self._tread()
        self._mujoco.mj_step1(self.model, self.data)
        self._is_ahead = True

    def step(self) -> None:
        """Go on by 1 ms."""
        constant, per_ohm, now = self._constant, self._per_ohm, self._now
        supply_V, speeds = self._supply_V, self._wheel_rad_s
        now.control[0 : self._wheels] = [
            (duty * supply_V - (1.0 - coast) * constant * speed) * per_ohm
            for duty, coast, speed in zip(self._duty, self._coast, speeds, strict=True)
        ]
        if 1.0 in self._coast:
            for number, coast in enumerate(self._coast):
                if coast == 1.0:
                    now.current[number] = 0.0
        self._advance()
        self._current_A = ffi.unpack(now.current, self._wheels)
        drawn_A = sum(current * duty for current, duty in zip(self._current_A, self._duty, strict=True))
        self._supply_V = max(self._battery_V - self._battery_ohm * drawn_A, 0.0)
        if self._camera is not None:
            self._camera.look(self.data)

    def finish(self, folder: Path) -> None:
        """Write the film, if there is one, to ``world.gif`` in a folder. Raises OutputFileError."""
        if self._camera is not None:
            self._camera.write(folder / FILM_FILE)

    @property
    def pose(self) -> tuple[float, float, float]:
        """True x [m], y [m] in the floor's plane and theta [rad, not wrapped]."""
        return self._position[0], self._position[1], self._last_yaw + self._turns

    @property
    def gyro_rad_s(self) -> tuple[float, float, float]:
        """Turn rate about the body's axes, as a gyroscope in its centre has it, without noise."""
        return self._sensor("gyro")

    @property
    def accelerometer_m_s2(self) -> tuple[float, float, float]:
        """Acceleration less gravity along the body's axes, as an accelerometer in its centre has it, without noise."""
        return self._sensor("accelerometer")

    @property
    def wheel_load_N(self) -> list[float]:
        """Force of the floor on each wheel, across the floor; 0: the wheel is in the air."""
        loads = [0.0] * self._wheels
        force = np.zeros(6)
        for number in range(self.data.ncon):
            wheel = self._wheel_of_geom[max(self.data.contact.geom[number])]
            self._mujoco.mj_contactForce(self.model, self.data, number, force)
            if wheel >= 0:
                loads[wheel] += float(force[0])
        return loads

    def _find(self, wheels: int) -> None:
        """Look up where MuJoCo keeps what."""
        model, config = self.model, self._config
        joints = [model.joint(f"axle_{number + 1}") for number in range(wheels)]
        self._wheels = wheels
        self._axles = [int(joint.qposadr[0]) for joint in joints]
        self._speeds = [int(joint.dofadr[0]) for joint in joints]
        self._hubs = [model.body(f"wheel_{number + 1}").id for number in range(wheels)]
        self._edges_per_rad = config.counts_per_revolution / (2.0 * math.pi)
        self._constant, self._per_ohm = config.motor_constant_N_m_A, 1.0 / config.motor_resistance_ohm
        self._battery_V, self._battery_ohm = config.battery_V, config.battery_resistance_ohm
        self._wheel_of_geom = np.full(model.ngeom, -1)
        self._rollers: list[Any] = []
        count = len(self.parts.rollers)
        for wheel in range(wheels):
            geoms = np.array([model.geom(f"roller_{wheel + 1}_{number + 1}").id for number in range(count)])
            self._rollers.append(geoms)
            self._wheel_of_geom[geoms] = wheel
        self._pins = [[int(model.joint(f"pin_{w + 1}_{n + 1}").dofadr[0]) for n in range(count)] for w in range(wheels)]
        self._lowest: list[int] = [-1] * wheels
        self._near: list[list[bool | None]] = [[None] * count for _ in range(wheels)]

    def _set_down(self, scenario: Scenario) -> None:
        """Put the robot where it starts, let it come to rest on its wheels, and begin to count time."""
        data = self.data
        x, y, theta = scenario.start_pose
        data.qpos[0:3] = x, y, self.parts.wheels[0].radius_m + self.floor.height_m
        data.qpos[3:7] = math.cos(0.5 * theta), 0.0, 0.0, math.sin(0.5 * theta)
        data.qpos[self._axles] = np.random.default_rng(scenario.seed).uniform(0.0, 2.0 * math.pi, self._wheels)
        self._look()
        for _ in range(SETTLE_STEPS):
            data.qvel[[0, 1, 5]] = 0.0
            data.qvel[6:] = 0.0
            self._advance()
        data.qpos[0:2] = x, y
        data.qvel[:] = 0.0
        data.time = 0.0
        self._mujoco.mj_forward(self.model, data)
        self._look()
        self._turns = 2.0 * math.pi * round((theta - self._last_yaw) / (2.0 * math.pi))

    def _advance(self) -> None:
        """Take one step, in MuJoCo's two halves: the same as ``mj_step``, bit for bit."""
        if not self._is_ahead:
            self.ahead()
        self._mujoco.mj_step2(self.model, self.data)
        self._is_ahead = False
        self._look()

    def _look(self) -> None:
        """Take over where everything is now."""
        speeds = self._now.speed
        self._wheel_rad_s = [speeds[i] for i in self._speeds]
        w, x, y, z = ffi.unpack(self._quaternion, 4)
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        self._turns += 2.0 * math.pi * round((self._last_yaw - yaw) / (2.0 * math.pi))
        self._last_yaw = yaw

    def _lower(self) -> None:
        """Let only those rollers touch and rub that are near the floor, whenever a wheel has turned by a roller.

        The others turn in the air. Looking at all of them, and dry friction in every pin, would make a step slower.
        """
        for wheel, axle in enumerate(self._axles):
            part = math.floor(self._position[axle] * len(self.parts.rollers) / (2.0 * math.pi))
            if part != self._lowest[wheel]:
                self._lowest[wheel] = part
                self._choose(wheel, self._position[axle])

    def _choose(self, wheel: int, angle: float) -> None:
        # A positive turn is about minus x: a roller at angle a from y is lowest where a - turn is -90 degrees.
        reach = 2.0 * 2.0 * math.pi / len(self.parts.rollers)
        chosen = self._near[wheel]
        for number, part in enumerate(self.parts.rollers):
            near = abs(math.remainder(part.angle_rad - angle + 0.5 * math.pi, 2.0 * math.pi)) < reach
            if near != chosen[number]:
                chosen[number] = near
                self._enable_contact(wheel, number, near)

    def _enable_contact(self, wheel: int, number: int, near: bool) -> None:
        pin, geom, model = self._pins[wheel][number], self._rollers[wheel][number], self.model
        body = model.geom_bodyid[geom]
        dry_N_m = self.parts.wheels[wheel].drag * self.parts.roller_dry_N_m
        model.dof_frictionloss[pin] = dry_N_m if near else 0.0
        model.geom_contype[geom] = model.body_contype[body] = ROLLER_BIT if near else 0
        model.geom_conaffinity[geom] = model.body_conaffinity[body] = FLOOR_BIT if near else 0

    def _tread(self) -> None:
        """Give the rollers of each wheel the friction of the patch that it stands on."""
        for wheel, hub in enumerate(self._hubs):
            x, y = self.data.xpos[hub][0:2]
            friction = self.floor.friction_at(float(x), float(y), self.parts.wheels[wheel].friction)
            friction *= factor_at(self._patches, float(x), float(y))
            self.model.geom_friction[self._rollers[wheel], 0] = friction

    def _sensor(self, name: str) -> tuple[float, float, float]:
        x, y, z = self.data.sensor(name).data.tolist()
        return x, y, z


def _library() -> Any:
    if "DISPLAY" not in os.environ and find_library("OSMesa"):
        os.environ.setdefault("MUJOCO_GL", "osmesa")
    try:
        import mujoco
    except ImportError as error:
        raise ExternalWorldInputError(
            f"--world mujoco needs the package mujoco: {error}", hint="pip install 'omniwheel[mujoco]'"
        ) from error
    return mujoco


def _refuse_play(scenario: Scenario, config: Any) -> None:
    if config.backlash_rad > 0.0:
        raise ExternalWorldInputError(
            f"{scenario.source}: backlash_rad is {config.backlash_rad:g}: the MuJoCo model has no backlash",
            hint="set backlash_rad = 0 in the scenario's [world], or use the built-in world",
        )


def _floor(floor: Floor, config: Any) -> Floor:
    """Return the floor of the settings; one that is level there has the scenario's slope."""
    if floor.slope_deg > 0.0 or config.floor_slope_rad <= 0.0:
        return floor
    slope, uphill = math.degrees(config.floor_slope_rad), math.degrees(config.floor_uphill_rad)
    return replace(floor, slope_deg=slope, uphill_deg=uphill)


def _notes(config: Any) -> tuple[str, ...]:
    slips = [name for name in ("slip_max", "slip_speed_max_m_s") if getattr(config, name) > 0.0]
    shapes = [
        name for name in ("roller_dip_m", "wheel_stiffness_N_m", "wheel_damping_N_s_m") if getattr(config, name) > 0.0
    ]
    notes = []
    if slips:
        notes.append(f"{', '.join(slips)}: only in the built-in world; in MuJoCo slip follows from the contacts.")
    if shapes:
        notes.append(
            f"{', '.join(shapes)}: only in the built-in world; in MuJoCo the rollers' shape and contacts replace them."
        )
    return tuple(notes)
