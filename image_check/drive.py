# SPDX-License-Identifier: MIT
"""The image drives: each motor and its encoder, the I2C bus, a path closed at the pins."""

from __future__ import annotations

import struct

import numpy as np

from emulated_teensy.machine import Stop
from hil_sim.runs import run_in_process
from hil_sim.scenario import Scenario, parse_scenario
from image_check.bench import Bench, CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from omniwheel.robot import Robot

DUTY = 0.3
SPIN_S = 0.3
BETWEEN_S = 0.05
REST_RAD_S = 0.05
COUNT_TOLERANCE = 1
"""Counts between what the discs have passed and what the driver says: the last edge may still be on its way."""
READ_ENCODERS = "_ZN4omni16Teensy40Encoders4readEPl"
SCRATCH = 0x2027F000
"""Memory that the image leaves alone: the end of its heap, below the crash record."""

PATH_LIMIT_M = 0.001
PATH = {
    "TRJ_TYPE": "circle",
    "TRJ_SIZE": 0.3,
    "TRJ_PERIOD": 10.0,
    "TRJ_RAMP": 0.5,
    "TRJ_ROT": "fixed",
    "EKF_MODE": "odometry",
}


def motors_and_encoders(context: Context) -> list[str]:
    """Wheel by wheel, both ways: the right bridge gets the duty, the right counter counts, with the right sign."""
    figures = []
    with context.booted() as bench:
        robot = bench.connect()
        robot.pump(1.2)
        robot.arm()
        for wheel in range(context.scenario.robot.wheels):
            for sign in (1.0, -1.0):
                _turn_one(bench, robot, wheel, sign * DUTY)
        robot.disarm()
        counts = _compare_counts(bench)
        figures.append(f"{context.scenario.robot.wheels} motors turn alone, both ways, at duty {DUTY:g}")
        figures.append(f"counters within {counts} counts of the discs")
    return figures


def _turn_one(bench: Bench, robot: Robot, wheel: int, duty: float) -> None:
    wheels = bench.scenario.robot.wheels
    wanted = [duty if number == wheel else 0.0 for number in range(wheels)]
    robot.drive_duty(wanted, SPIN_S, stop=False)
    speeds = [float(bench.world.c.wheel_rad_s[number]) for number in range(wheels)]
    given = bench.duties
    if speeds[wheel] * duty <= 0.0 or abs(speeds[wheel]) < 10 * REST_RAD_S:
        raise CheckError(f"duty {duty:g} on motor {wheel + 1} turns its wheel at {speeds[wheel]:.2f} rad/s")
    others = [number + 1 for number in range(wheels) if number != wheel and abs(given[number]) > 0.0]
    if others:
        raise CheckError(f"duty on motor {wheel + 1} alone drives motor {others[0]}, too")
    robot.drive_duty([0.0] * wheels, BETWEEN_S, stop=False)


def _compare_counts(bench: Bench) -> int:
    """Ask the image's own encoder driver, once the wheels rest."""
    bench.advance(0.5)
    told = read_counts(bench)
    config = bench.world.c.config
    passed = [
        round(float(bench.world.c.encoder_edges[wheel])) * int(config.encoder_direction[wheel])
        for wheel in range(bench.scenario.robot.wheels)
    ]
    worst = max(abs(a - b) for a, b in zip(passed, told, strict=True))
    if worst > COUNT_TOLERANCE:
        raise CheckError(f"counters have {told}, but {passed} edges occurred")
    return worst


def encoder_driver(bench: Bench) -> int:
    """Run until the tick reads the encoders; return where their driver is. Raises CheckError."""
    machine = bench.machine
    machine.break_at(READ_ENCODERS)
    stop = machine.run(0.01)
    driver = machine.register(0)
    machine.clear_breaks()
    if stop != Stop.BREAK:
        raise CheckError("the tick does not read the encoders")
    return driver


def ask_encoders(bench: Bench, driver: int) -> list[int]:
    """Return what the image's encoder driver counts at this moment."""
    machine = bench.machine
    machine.call(READ_ENCODERS, (driver, SCRATCH))
    wheels = bench.scenario.robot.wheels
    return list(struct.unpack(f"<{wheels}i", machine.read(SCRATCH, 4 * wheels)))


def read_counts(bench: Bench) -> list[int]:
    """Return what the image's encoder driver counts when the tick reads it."""
    return ask_encoders(bench, encoder_driver(bench))


def path_at_the_pins(context: Context) -> list[str]:
    """Some seconds of a path with nothing but wires between robot and world, beside the same core in this process."""
    path_s = context.pick(3, 3, 5)
    scenario = _path_scenario(context, path_s)
    in_process = run_in_process(scenario)
    with context.booted(scenario=scenario) as bench:
        robot = bench.connect()
        robot.pump(1.2)
        robot.parameters.set_many(dict(scenario.parameters))
        robot.set_pose_estimate(*scenario.start_pose)
        robot.start_trajectory()
        robot.arm()
        begin_s = bench.clock_s()
        trail: list[tuple[float, float, float]] = []
        with bench.watched(lambda: trail.append((bench.clock_s() - begin_s, *bench.world.truth[:2]))):
            robot.pump(path_s)
        robot.disarm()
    worst_m = distance_between_paths(np.array(trail), in_process.record)
    if worst_m > PATH_LIMIT_M:
        raise CheckError(f"the path is up to {1e3 * worst_m:.2f} mm from the in-process run's")
    return [f"{path_s} s of a circle, at most {1e3 * worst_m:.2f} mm from the in-process run"]


def _path_scenario(context: Context, path_s: float) -> Scenario:
    robot = context.scenario.robot
    document = {
        "scenario": {
            "name": "path",
            "description": "a circle without slip",
            "robot": robot.source,
            "seed": context.seed,
            "duration_s": path_s + 1.0,
        },
        "parameters": PATH,
        "world": {"slip_max": 0.0, "fix_rate_Hz": 0.0, "start_pose": [0.3, 0.0, 0.0]},
        "event": [{"at_s": 0.5, "command": "trajectory_start"}, {"at_s": 0.5, "command": "arm"}],
    }
    return parse_scenario(document, "path")


def distance_between_paths(trail: np.ndarray, record: np.ndarray) -> float:
    """Return the largest distance [m] between two drives of the same path, whichever instant each began to move at.

    ``trail`` has rows of time [s], x [m], y [m]; ``record`` is a run's. The drives are laid over each other by the time
    at which each had gone 1 mm. Then they are shifted by the millisecond beside that one which fits best.
    """
    reference = np.column_stack([record["time_s"], record["truth"][:, 0], record["truth"][:, 1]])
    shift_s = _moved_at(reference) - _moved_at(trail)
    return min(_largest_distance(trail, reference, shift_s + 0.001 * step) for step in range(-5, 6))


def _moved_at(path: np.ndarray) -> float:
    gone = np.hypot(path[:, 1] - path[0, 1], path[:, 2] - path[0, 2])
    if gone.max() < 0.001:
        raise CheckError("the robot does not move")
    return float(path[np.argmax(gone >= 0.001), 0])


def _largest_distance(trail: np.ndarray, reference: np.ndarray, shift_s: float) -> float:
    times = trail[:, 0] + shift_s
    common = (times >= reference[0, 0]) & (times <= reference[-1, 0])
    if np.count_nonzero(common) < 0.8 * len(trail):
        raise CheckError("the two drives overlap too little in time")
    x = np.interp(times[common], reference[:, 0], reference[:, 1])
    y = np.interp(times[common], reference[:, 0], reference[:, 2])
    return float(np.hypot(x - trail[common, 1], y - trail[common, 2]).max())


CHECKS = (
    Check("motors", "each motor and encoder by itself, both ways", motors_and_encoders),
    Check("path", "a path closed at the pins, beside the in-process run", path_at_the_pins, (CI, NIGHTLY)),
)
