# SPDX-License-Identifier: MIT
"""Runs of the benchmarks of dead reckoning, in our world and in MuJoCo; each gives the pose error at its end.

The processes that simulate import this module only, so it draws nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim.hil import run_hil
from hil_sim.metrics import STATE_ARMED, wrap
from hil_sim.mujoco_world import MujocoWorld
from hil_sim.runs import run_in_process
from hil_sim.scenario import Event, Scenario, load_scenario
from omni_reproduce.experiment import read_spec
from omni_reproduce.square import Wheels, legs
from omniwheel.errors import OmniError

Array = NDArray[np.float64]
NAME = "odometry"
OURS, MUJOCO = "our world", "MuJoCo"
GYRO_Hz = 1000.0
LATE_S = 0.05
"""A run disarms the robot at its end; what ends sooner than this before it was stopped by the robot itself."""
STILL: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Case:
    """One run of a robot: ``wrong`` if its file is, with or without ``gyro``, in one of the worlds.

    ``motions`` are body motions, one after another, each x, y [m] and turn [rad]; the robot comes to rest after each.
    Without them it drives a rose of ``petals`` for ``laps``.
    """

    robot: str
    seed: int
    motions: tuple[tuple[float, float, float], ...] = ()
    wrong: bool = False
    gyro: bool = False
    world: str = OURS
    petals: int = 0
    laps: int = 1


@dataclass(frozen=True)
class Driven:
    """Truth less estimate at the end, x, y [m] and heading [rad], and the true turn while the robot still stood."""

    error: tuple[float, float, float]
    turned_at_rest_rad: float


def square(spec: Mapping[str, Any], robot: str, sign: int, *, turning: bool) -> tuple[tuple[float, float, float], ...]:
    """Return the motions of a robot's square; ``sign`` 1: counter-clockwise."""
    return _tuples(legs(spec["robot"][robot]["edge_m"], sign, turning=turning))


def petal(spec: Mapping[str, Any], robot: str, angle_rad: float) -> tuple[tuple[float, float, float], ...]:
    """Return the one motion of a petal: a whole turn while the robot drives to one side of its body, a full circle."""
    size = spec["robot"][robot]
    along = 2.0 * math.pi * size["petal_m_s"] / size["petal_rad_s"]
    return ((along * math.cos(angle_rad), along * math.sin(angle_rad), 2.0 * math.pi),)


def _tuples(motions: Sequence[Array]) -> tuple[tuple[float, float, float], ...]:
    return tuple((float(x), float(y), float(turn)) for x, y, turn in motions)


def wheels_of(spec: Mapping[str, Any], robot: str, *, wrong: bool) -> Wheels:
    """Return the robot's wheels as its file has them, or as the wrong file has."""
    scenario = load_scenario("no_slip", robot)
    geometry = scenario.robot.geometry
    values = wrong_parameters(spec, scenario) if wrong else {}
    scales = [values.get(f"W{number + 1}_RSCALE", 1.0) for number in range(scenario.robot.wheels)]
    return Wheels(
        geometry["wheel_radius_m"] * np.array(scales),
        np.radians(geometry["wheel_angle_deg"]),
        values.get("WHEEL_DIST", geometry["wheel_distance_m"]),
    )


def wrong_parameters(spec: Mapping[str, Any], scenario: Scenario) -> dict[str, float]:
    """Return what a wrong robot file makes the robot believe."""
    values = {"WHEEL_DIST": scenario.robot.geometry["wheel_distance_m"] * (1.0 + spec["wrong"]["distance"])}
    return {**values, **{f"W{n + 1}_RSCALE": 1.0 + share for n, share in enumerate(spec["wrong"]["radius"])}}


def scenario_of(spec: Mapping[str, Any], case: Case) -> Scenario:
    """Return the scenario of a case: the robot file's real wheels, no imposed slip, no sag, no pose fixes."""
    base = replace(load_scenario("no_slip", case.robot), start_pose=STILL).with_seed(case.seed)
    size, head = spec["robot"][case.robot], spec["experiment"]
    rest_s = head["gyro_rest_s"] if case.gyro else head["rest_s"]
    base = base.with_world({"slip_max": 0.0, "battery_resistance_ohm": 0.0, "fix_rate_Hz": 0.0})
    if case.gyro:
        base = base.with_world({"gyro_rate_Hz": GYRO_Hz}).with_parameters({"GYRO_AXIS": 3.0})
    if case.wrong:
        base = base.with_parameters(wrong_parameters(spec, base))
    start = Event(at_s=rest_s, command="arm")
    if case.motions:
        events, end_s = _drive(size, case, rest_s)
        return replace(base, events=(start, *events), duration_s=end_s)
    given = {"TRJ_PETALS": case.petals, "TRJ_SIZE": size["rose_m"], "TRJ_PERIOD": size["rose_s"], "TRJ_LAPS": case.laps}
    values = {name: base.robot.table[name].parse(NAME, name, value) for name, value in given.items()}
    path = Event(at_s=rest_s, command="trajectory_start")
    return replace(base.with_parameters(values), events=(path, start), duration_s=None)


def _drive(size: Mapping[str, Any], case: Case, start_s: float) -> tuple[list[Event], float]:
    """Return the velocities asked for, and when the robot has come to rest after the last."""
    events, now_s = [], start_s
    for motion in case.motions:
        along, turn = math.hypot(motion[0], motion[1]), abs(motion[2])
        both = along > 0.0 and turn > 0.0
        lasts_s = along / size["petal_m_s" if both else "speed_m_s"] if along > 0.0 else turn / size["turn_rad_s"]
        x, y, omega = (part / lasts_s for part in motion)
        events += [Event(at_s=now_s, velocity=(x, y, omega)), Event(at_s=now_s + lasts_s, velocity=STILL)]
        now_s += lasts_s + size["pause_s"]
    return events, now_s


def drive(case: Case) -> Driven:
    """Run a case. Raises OmniError if the robot does not drive to the end."""
    spec = read_spec(NAME)
    scenario = scenario_of(spec, case)
    run = run_in_process(scenario) if case.world == OURS else run_hil(scenario, world=MujocoWorld(scenario))
    record = run.record
    armed = np.flatnonzero(record["state"] == STATE_ARMED)
    drove_s = record["time_s"][armed[-1]] if len(armed) else 0.0
    if not run.done if scenario.duration_s is None else drove_s < scenario.duration_s - LATE_S:
        raise OmniError(f"{case.robot} stopped on its way after {drove_s:.1f} s, seed {case.seed}, {case.world}")
    first, last = armed[0], record[-1]
    error = last["truth"] - last["estimate"]
    turned = float(record["truth"][first, 2] - record["truth"][0, 2])
    return Driven((float(error[0]), float(error[1]), float(wrap(error[2:])[0])), turned)
