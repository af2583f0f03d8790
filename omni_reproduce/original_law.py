# SPDX-License-Identifier: MIT
"""The law of the three-wheel robot's first firmware: what its chatter and that firmware's faults cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hil_sim import metrics
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, load_scenario
from hil_sim.world import IDEAL_WHEELS, NO_POSE_SENSOR, World, world_config
from omni_reproduce.experiment import Context, Result, Row, read_spec
from omni_reproduce.loops import Path, make_kinematics
from omniwheel._core import ffi, lib
from omniwheel.robots import read_robot

Array = NDArray[np.float64]

NAME = "original_law"
MM = 1e3
PERIOD_S, TICKS = 0.02, 20
"""Of the law, and how many ticks of the world that is."""


def run(context: Context) -> Result:
    """Run the whole robot on both floors, the law alone with each feed-forward, and the demo's world over seeds."""
    spec = read_spec(NAME)
    head, why = spec["experiment"], spec["explanation"]
    rows = []
    for friction in spec["whole"]["friction_coefficients"]:
        truth_m, odometry_m = whole(spec, friction)
        title = f"whole robot, friction coefficient {friction:g}"
        rows.append(Row(NAME, title, "position RMSE, truth", "mm", MM * truth_m, explanation=why["whole"]))
        rows.append(Row(NAME, title, "position RMSE, own odometry", "mm", MM * odometry_m))
    for key, law in spec["alone"]["law"].items():
        title = f"law alone, {law['title']}"
        text = why[law["feed_forward"] if key != "mended" else key]
        rows.append(Row(NAME, title, "position RMSE, truth", "mm", MM * alone(spec, key), explanation=text))
    seeds = range(head["seed"], head["seed"] + context.count(head["seeds"], head["quick_seeds"]))
    for scenario, key in ((head["scenario"], "demo"), (f"{head['scenario']}_fixes", "demo_fixes")):
        runs = [run_in_process(load_scenario(scenario), seed).record for seed in seeds]
        values = MM * np.array([metrics.tracking_rmse(record).position_m for record in runs])
        sd = float(values.std(ddof=1))
        mean = float(values.mean())
        rows.append(
            Row(NAME, f"scenario {scenario}", "position RMSE, truth", "mm", mean, sd, len(seeds), explanation=why[key])
        )
    return Result(tuple(rows))


def whole_scenario(spec: Mapping[str, Any], friction_coefficient: float) -> Scenario:
    """Return the experiment's rose under the law, on a floor without imposed slip; ideal wheels, as in the report."""
    base = load_scenario("no_slip", spec["experiment"]["robot"])
    given = {name: value for name, value in spec["whole"].items() if name.isupper()}
    given |= {"CTL_MODE": "original", "EKF_MODE": "odometry"}
    values = {name: base.robot.table[name].parse(NAME, name, value) for name, value in given.items()}
    world = {**base.world, **IDEAL_WHEELS, "friction_coefficient": friction_coefficient}
    return replace(base.with_parameters(values), world=world)


def whole(spec: Mapping[str, Any], friction_coefficient: float) -> tuple[float, float]:
    """Return how far the whole robot is off its path [m, position RMSE]: the truth, and its own odometry."""
    record = run_in_process(whole_scenario(spec, friction_coefficient)).record
    own = metrics.rmse(metrics.pose_error(record[metrics.on_path(record)], "estimate", "reference"))
    return metrics.tracking_rmse(record).position_m, own.position_m


def alone(spec: Mapping[str, Any], key: str) -> float:
    """Return how far the law alone is off its path [m, position RMSE of the truth], with one of the feed-forwards."""
    part = spec["alone"]
    robot = read_robot(spec["experiment"]["robot"])
    start = (part["path"]["size_m"], 0.0, 0.0)
    floor = {**IDEAL_WHEELS, "friction_coefficient": part["friction_coefficient"]}
    world = World(world_config(robot, pose_sensor=NO_POSE_SENSOR, start_pose=start, **floor))
    path = Path(part["path"], make_kinematics(world))
    errors = _errors(world, path, part["law"][key], robot.encoder["counts_per_revolution"])
    settled = errors[round(part["settled_s"] / PERIOD_S) :]
    return metrics.rmse(settled).position_m


def _errors(world: World, path: Path, law: Mapping[str, Any], counts_per_revolution: int) -> Array:
    """Return truth minus reference after each period, shape (n, 3): m, m, rad."""
    kinematics = make_kinematics(world)
    config = ffi.new(
        "omni_original_config_t *", lib.omni_original_defaults(PERIOD_S, 2 * np.pi / counts_per_revolution)
    )
    setattr(config, "lambda", law["lambda"])
    state = ffi.new("omni_original_state_t *")
    estimate, counts, errors = world.truth, _counts(world), []
    for n in range(round(path.duration_s / PERIOD_S)):
        moved, counts = _counts(world) - counts, _counts(world)
        estimate = _reckoned(kinematics, estimate, moved * config.rad_per_count)
        wanted, rate = path.at(n * PERIOD_S)
        given = {"rate": rate, "parser": np.array([0.0, *wanted[1:]]), "none": np.zeros(3)}[law["feed_forward"]]
        poses = [ffi.new("omni_pose_t *", list(pose)) for pose in (estimate, wanted)]
        delta = [int(count) for count in moved]
        supply_V = world.sense().battery_V
        given_rate = ffi.new("omni_twist_t *", list(given))
        lib.omni_original_step(state, config, kinematics, delta, *poses, given_rate, supply_V)
        world.drive_voltage(list(state.voltage_V)[: world.wheels])
        world.step(TICKS)
        errors.append(world.truth - path.at((n + 1) * PERIOD_S)[0])
    return np.array(errors)


def _counts(world: World) -> NDArray[np.int64]:
    return np.array(list(world.sense().counts)[: world.wheels], dtype=np.int64)


def _reckoned(kinematics: Any, pose: Array, turned_rad: Array) -> Array:
    """Return the pose after the wheels have turned by these angles, with the heading of mid-step."""
    speeds = ffi.new("omni_real_t[]", list(turned_rad))
    moved = ffi.new("omni_twist_t *")
    lib.omni_kinematics_forward(kinematics, speeds, ffi.NULL, moved)
    middle = pose[2] + 0.5 * moved.wz
    cosine, sine = np.cos(middle), np.sin(middle)
    way = np.array([cosine * moved.vx - sine * moved.vy, sine * moved.vx + cosine * moved.vy, moved.wz])
    reached: Array = pose + way
    return reached
