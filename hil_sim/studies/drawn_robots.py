# SPDX-License-Identifier: MIT
"""Robots drawn at random, each with a robot file that is wrong about it: what ``python -m omni.checks autotune`` tunes.

The true robot comes from numbers as a data sheet has them (``omni robots new``). So do the limits and gains of its
file, but from numbers that are wrong.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from hil_sim.scenario import Event, Scenario, load_scenario
from omni_schema import Robot
from omniwheel import files
from omniwheel.capability import drive_model
from omniwheel.datasheet import GearMotor, RobotAnswers
from omniwheel.datasheet.new_robot import derived_gains, derived_limits, supply_limits, write_designed_robot
from omniwheel.errors import RobotFileError
from omniwheel.robot_text import Changes, edited
from omniwheel.robots import read_robot

STREAM = 14
"""Tells these random numbers from others that are drawn from the same seed."""
DRAWS = 20
"""How often a robot is drawn at most until a robot file may describe it."""
ERROR = 0.3
"""Share by which each number of the robot file is wrong at most, either way."""
TOP_SPEED_M_S = (0.1, 2.0)
COUNTS = (48.0, 4000.0)
WRONG = (
    *("motor.inertia_kg_m2", "motor.viscous_friction_N_m_s", "motor.constant_N_m_A", "motor.resistance_ohm"),
    *("motor.inductance_H", "simulation.mass_kg", "simulation.inertia_kg_m2", "simulation.coulomb_friction_N_m"),
    *("geometry.wheel_radius_m", "geometry.wheel_distance_m"),
)
"""Numbers of the robot file that are wrong."""
SPEED_SHARE, ACCELERATION_SHARE = 0.5, 0.5
"""Of the limits: what the path that judges a robot uses at most."""
PETALS = 3
SIZE_M = (0.1, 1.0)
TURN_RAD, TURN_PERIODS, TURN_SHARE = 0.5, 2.0, 0.3


@dataclass(frozen=True)
class DrawnRobot:
    """A robot: the file that is ``believed``, the ``truth``, and numbers of the world that no robot file has."""

    seed: int
    believed: Robot
    truth: Robot
    world: dict[str, float]

    def tuning_scenario(self) -> Scenario:
        """Return the world in which it stands until it is tuned."""
        return self._scenario("sitl", {}, (0.0, 0.0, 0.0))

    def judging_scenario(self) -> Scenario:
        """Return the path by which its parameters are judged: a rose with three petals, at half of its limits.

        The limits are those that right and wrong numbers give, the smaller of both. So the path is the same before and
        after, and the robot can drive it.
        """
        limits = [robot.parameter_values() for robot in (self.believed, self.truth)]
        speed, acceleration, turn = (min(side[name] for side in limits) for name in ("LIM_V", "LIM_A", "LIM_W"))
        speed, acceleration = SPEED_SHARE * speed, ACCELERATION_SHARE * acceleration
        size = float(np.clip(speed * 1.0, *SIZE_M))
        # r = a cos(3 f): its peaks are 3 a pi / T, and 10 a (pi / T)^2.
        period_s = math.pi * max(3.0 * size / speed, math.sqrt(10.0 * size / acceleration))
        turn_rad = min(TURN_RAD, TURN_SHARE * turn * period_s / (2.0 * math.pi * TURN_PERIODS))
        path = {
            "TRJ_TYPE": 4.0,
            "TRJ_PETALS": float(PETALS),
            "TRJ_SIZE": size,
            "TRJ_PERIOD": period_s,
            "TRJ_LAPS": 1.0,
            "TRJ_ROT": 2.0,
            "TRJ_ROT_AMP": turn_rad,
            "TRJ_ROT_N": TURN_PERIODS,
        }
        return self._scenario("no_slip", path, (size, 0.0, 0.0))

    def _scenario(self, name: str, parameters: dict[str, float], start: tuple[float, float, float]) -> Scenario:
        sitl = load_scenario("sitl")
        events = () if name == "sitl" else tuple(Event(at_s=0.5, command=word) for word in ("trajectory_start", "arm"))
        return Scenario(
            source=f"robot {self.seed}",
            name="drawn_robot",
            description=f"Robot {self.seed} of python -m omni.checks autotune",
            robot=self.believed,
            seed=self.seed,
            duration_s=sitl.duration_s if name == "sitl" else None,
            parameters=parameters,
            world={**sitl.world, **self.world},
            start_pose=start,
            events=events,
            faults=(),
            world_robot=self.truth,
        )


def draw_robot(seed: int) -> DrawnRobot:
    """Return the robot of a seed. One in a hundred comes out so that no robot file may describe it: it is drawn again.

    Raises RobotFileError if that happens DRAWS times in a row.
    """
    for attempt in range(DRAWS):
        try:
            return _drawn(seed, attempt)
        except RobotFileError:
            if attempt == DRAWS - 1:
                raise
    raise AssertionError("DRAWS is at least 1")


def _drawn(seed: int, attempt: int) -> DrawnRobot:
    draw = np.random.default_rng([STREAM, seed, attempt] if attempt else [STREAM, seed])
    answers, changes, world = _truth(draw)
    errors = {name: 1.0 + ERROR * float(draw.uniform(-1.0, 1.0)) for name in WRONG}
    with TemporaryDirectory() as folder:
        truth = _written(Path(folder), "truth", answers, changes)
        believed = _with_errors(Path(folder), truth, errors)
    return DrawnRobot(seed, believed, truth, world)


def _spread(draw: np.random.Generator, low: float, high: float) -> float:
    """Return a number between two, evenly spread over their ratio."""
    return float(math.exp(draw.uniform(math.log(low), math.log(high))))


def _truth(draw: np.random.Generator) -> tuple[RobotAnswers, dict[str, float], dict[str, float]]:
    """Return what a data sheet would say, factors of numbers that it does not have, and the world's numbers."""
    wheels = int(draw.choice([3, 4]))
    top_m_s, mass_kg = _spread(draw, *TOP_SPEED_M_S), _spread(draw, 1.0, 10.0)
    radius_m, distance_m = float(draw.uniform(0.02, 0.06)), float(draw.uniform(0.08, 0.2))
    supply_V, idle = float(draw.choice([6.0, 7.4, 12.0, 24.0])), float(draw.uniform(0.03, 0.12))
    no_load = top_m_s / (0.8 * radius_m)
    stall_N_m = mass_kg * _spread(draw, 1.5, 8.0) * radius_m / (0.5 * wheels)
    stall_A = stall_N_m * no_load / supply_V
    motor = GearMotor(
        voltage_V=supply_V,
        no_load_rad_s=no_load,
        stall_torque_N_m=stall_N_m,
        stall_current_A=1.2 * stall_A,
        no_load_current_A=1.2 * stall_A * idle,
        encoder_lines=round(_spread(draw, *COUNTS)) / 4.0,
    )
    factors = {
        "motor.inertia_kg_m2": _spread(draw, 0.5, 2.0),
        "motor.viscous_friction_N_m_s": float(draw.uniform(0.5, 1.5)),
        "simulation.coulomb_friction_N_m": float(draw.uniform(0.5, 1.5)),
        "simulation.inertia_kg_m2": float(draw.uniform(0.6, 1.4)),
    }
    ohm = supply_V / (1.2 * stall_A)
    world = {
        "friction_coefficient": float(draw.uniform(0.35, 0.9)),
        "slip_stiffness_N_s_m": mass_kg * _spread(draw, 150.0, 1500.0),
        "roller_friction_N_s_m": mass_kg * float(draw.uniform(0.0, 0.1)),
        "slip_max": float(draw.uniform(0.0, 0.1)),
        "battery_V": supply_V * float(draw.uniform(0.9, 1.1)),
        "battery_resistance_ohm": ohm / wheels * float(draw.uniform(0.0, 0.1)),
    }
    return RobotAnswers(wheels, 2.0 * radius_m, distance_m, mass_kg, motor), factors, world


def _written(folder: Path, name: str, answers: RobotAnswers, factors: dict[str, float]) -> Robot:
    return _scaled(write_designed_robot(name, answers, folder), factors)


def _with_errors(folder: Path, truth: Robot, errors: dict[str, float]) -> Robot:
    path = folder / "believed.toml"
    files.write_text(path, Path(truth.source).read_text(encoding="utf-8"))
    return _scaled(path, errors)


def _scaled(path: Path, factors: dict[str, float]) -> Robot:
    """Multiply numbers of a robot file, and derive its limits and gains anew."""
    robot = read_robot(path)
    changes: Changes = {}
    for key, factor in factors.items():
        section, _, name = key.partition(".")
        changes = {**changes, key: (factor * float(getattr(robot, section)[name]), "drawn")}
    _edit(path, changes)
    _edit(path, derived_limits(drive_model(read_robot(path))))
    robot = read_robot(path)
    _edit(path, {**supply_limits(robot), **derived_gains(robot)})
    return read_robot(path)


def _edit(path: Path, changes: Changes) -> None:
    files.write_text(path, edited(path.read_text(encoding="utf-8"), changes))
