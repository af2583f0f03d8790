# SPDX-License-Identifier: MIT
"""Runs of the plants with given voltages, and where their energy goes.

The processes that simulate import this module only, so it draws nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.world import IDEAL_WHEELS, NO_POSE_SENSOR, World, world_config
from omniwheel._core import ffi, lib
from omniwheel.robots import read_robot

LEDGER = ("copper", "bearings", "creep", "rollers", "stored")
COULOMB_WIDTH_rad_s = 0.01
Array = NDArray[np.float64]


@dataclass(frozen=True)
class Case:
    """One run: robot, plant, seed of the voltages; ``limit`` takes away what the models leave out."""

    robot: str
    plant: str
    seed: int
    limit: bool = False


@dataclass(frozen=True)
class Run:
    """Time [s], pose and twist (n, 3), and where the energy went [J]: ``taken`` from the sources, and per LEDGER."""

    time_s: Array
    pose: Array
    twist: Array
    taken_J: float
    spent_J: Array


def voltages(spec: Mapping[str, Any], wheels: int, seed: int) -> Array:
    """Return the voltages (holds, wheels) of a seed [V]."""
    drive = spec["drive"]
    holds = round(drive["duration_s"] / drive["hold_s"])
    return np.random.default_rng(seed).uniform(-drive["volts"], drive["volts"], (holds, wheels))


def simulate(spec: Mapping[str, Any], case: Case) -> Run:
    """Drive one plant with the voltages of a seed, from rest, on ideal wheels: the report's models know no others."""
    robot = read_robot(case.robot)
    extra = {**IDEAL_WHEELS, **(spec["limit"] if case.limit else {})}
    world = World(world_config(robot, plant=case.plant, pose_sensor=NO_POSE_SENSOR, **extra))
    step_us = spec["drive"]["step_us"]
    ticks = round(spec["drive"]["hold_s"] * 1e6 / step_us)
    state = [np.frombuffer(ffi.buffer(column)) for column in _columns(world)]
    volts = voltages(spec, robot.wheels, case.seed)
    rows = np.empty((len(volts) * (ticks + 1), sum(map(len, state))))
    for hold, block in zip(volts, rows.reshape(len(volts), ticks + 1, -1), strict=True):
        world.drive_voltage(hold)
        # The power that the sources give changes at once: both ends of a hold are needed.
        np.concatenate(state, out=block[0])
        for row in block[1:]:
            lib.hil_world_step(world.c, step_us)
            np.concatenate(state, out=row)
    pose, twist, wheel, current = np.split(rows, np.cumsum([len(column) for column in state])[:-1], axis=1)
    per_hold = 1e-6 * step_us * np.arange(ticks + 1)
    time_s = (spec["drive"]["hold_s"] * np.arange(len(volts))[:, None] + per_hold).ravel()
    taken, spent = _energy(world, time_s, pose[:, 2], twist, wheel, current, np.repeat(volts, ticks + 1, axis=0))
    return Run(time_s, pose, twist, taken, spent)


def _columns(world: World) -> tuple[Any, ...]:
    c = world.c
    return c.pose, c.twist, c.wheel_rad_s, c.current_A


def _energy(
    world: World, time_s: Array, heading: Array, twist: Array, wheel: Array, current: Array, volts: Array
) -> tuple[float, Array]:
    """Return the energy taken in and spent as LEDGER [J]; meaningful on plants that have forces."""
    config, plant = world.c.config, world.c.plant
    wheel, current = wheel[:, : world.wheels], current[:, : world.wheels]
    body = _to_body(heading, twist)
    bearings = _friction(wheel, plant.viscous_N_m_s, plant.coulomb_N_m, COULOMB_WIDTH_rad_s)
    creep = rollers = np.zeros(len(time_s))
    if config.plant == lib.HIL_PLANT_LINEAR:
        parts = zip(plant.linear_viscous, plant.linear_coulomb, plant.coulomb_width, strict=True)
        bearings = np.column_stack([_friction(body[:, axis], *numbers) for axis, numbers in enumerate(parts)])
    else:
        creep = _creep_power(world, body, wheel)
        rollers = (
            plant.drag_xx * body[:, 0] ** 2
            + 2.0 * plant.drag_xy * body[:, 0] * body[:, 1]
            + plant.drag_yy * body[:, 1] ** 2
        )
    spent = [config.motor_resistance_ohm * (current**2).sum(axis=1), bearings.sum(axis=1), creep, rollers]
    inductance = 0.0 if config.plant == lib.HIL_PLANT_LINEAR else config.motor_inductance_H
    stored = lib.hil_world_kinetic_energy(world.c) + 0.5 * inductance * float((current[-1] ** 2).sum())
    taken = float(np.trapezoid((volts * current).sum(axis=1), time_s))
    return taken, np.array([*(float(np.trapezoid(power, time_s)) for power in spent), stored])


def _to_body(heading: Array, twist: Array) -> Array:
    c, s = np.cos(heading), np.sin(heading)
    return np.column_stack([c * twist[:, 0] + s * twist[:, 1], c * twist[:, 1] - s * twist[:, 0], twist[:, 2]])


def _friction(speed: Array, viscous: float, coulomb: float, width: float) -> Array:
    """Return the power that viscous and Coulomb friction take at a speed [W]."""
    return np.asarray(viscous * speed**2 + coulomb * speed**2 / np.hypot(speed, width))


def _creep_power(world: World, body: Array, wheel: Array) -> Array:
    """Return the power lost between wheels and floor [W]."""
    plant, n = world.c.plant, world.wheels
    along = np.array([list(column)[:n] for column in (plant.along_x, plant.along_y, plant.arm_m)])
    creep = wheel * np.array(list(plant.radius_m)[:n]) - body @ along
    wish = plant.stiffness_N_s_m * creep
    return np.asarray((creep * wish / np.hypot(1.0, wish * np.array(list(plant.inverse_limit_N)[:n]))).sum(axis=1))
