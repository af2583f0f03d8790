# SPDX-License-Identifier: MIT
"""Intervals of the geometry hold the truth of simulated robots with wrong radii, wrong bearings and slip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hil_sim.known_robot import SimulatedRobot
from hil_sim.world import IDEAL_WHEELS
from omni_schema import Robot
from omniwheel.identification.excitation import PERIOD_S
from omniwheel.identification.pose_fit.study import GeometryStudy, identify_geometry
from omniwheel.identification.pose_fit.wheel_model import Array, WheelModel, wheel_model
from omniwheel.identification.pose_fit.windows import Run
from omniwheel.robots import read_robot

SEEDS = 24
RUNS, RUN_S = 12, 15.0
RADIUS_SPREAD, DISTANCE_SPREAD, BEARING_SPREAD_DEG = 0.02, 0.02, 1.5
SLIP_MAX = 0.1
"""The slip ratio of a wheel is drawn from 0 to this twice a second: in the mean its radius is SLIP_MAX / 2 smaller."""
DUTY = 0.9


def bent(nominal: Robot, draw: np.random.Generator) -> tuple[Robot, Array]:
    """Return a robot whose wheels stand at other bearings, and by how much (n,) [rad]."""
    off_deg = BEARING_SPREAD_DEG * draw.uniform(-1.0, 1.0, nominal.wheels)
    bearings = [float(angle + off) for angle, off in zip(nominal.geometry["wheel_angle_deg"], off_deg, strict=True)]
    return replace(nominal, geometry={**nominal.geometry, "wheel_angle_deg": bearings}), np.radians(off_deg)


def simulated(nominal: Robot, seed: int) -> tuple[list[Run], dict[str, float]]:
    """Return runs of a robot of this seed with its odometry's true parameters by name."""
    draw = np.random.default_rng(seed)
    robot, off = bent(nominal, draw)
    scale = 1.0 + RADIUS_SPREAD * draw.uniform(-1.0, 1.0, robot.wheels)
    known = SimulatedRobot(
        robot,
        seed,
        {**IDEAL_WHEELS, "slip_max": SLIP_MAX},
        tuple(scale),
        1.0 + DISTANCE_SPREAD * float(draw.uniform(-1.0, 1.0)),
    )
    runs = [one_run(known, number, draw) for number in range(RUNS)]
    values = known.true_values()
    truth = {name: value * (1.0 - SLIP_MAX / 2.0) for name, value in values.items() if name.endswith("radius_m")}
    truth |= {"wheel_distance_m": values["wheel_distance_m"], "tracked_x_m": 0.0, "tracked_y_m": 0.0}
    truth["tracked_heading_rad"] = -float(off.mean())
    truth |= {f"wheel_{wheel}_angle_rad": float(each - off.mean()) for wheel, each in enumerate(off, start=1)}
    truth |= {f"wheel_{wheel}_{kind}": 0.0 for wheel in range(1, len(off) + 1) for kind in ("lever_m", "direction")}
    truth["turn_translating"] = 0.0
    return runs, truth


def one_run(known: SimulatedRobot, number: int, draw: np.random.Generator) -> Run:
    """Drive open loop: each wheel's duty is a wave of its own, so that the robot goes every way and turns both ways."""
    time = np.arange(round(RUN_S / PERIOD_S)) * PERIOD_S
    ramp = np.minimum(1.0, np.minimum(time, RUN_S - time))[:, None]
    rate, phase = draw.uniform(0.4, 1.2, known.robot.wheels), draw.uniform(0.0, 2.0 * np.pi, known.robot.wheels)
    data = known.run(f"run{number}", DUTY * ramp * np.sin(time[:, None] * rate + phase), run=number)
    assert data.wheel_angle_rad is not None
    rolled = wheel_model(known.robot).rolled(data.time_s, data.wheel_angle_rad)
    pose = data.pose.copy()
    pose[:, 2] = np.unwrap(pose[:, 2])
    return Run(f"run{number}", f"half {number % 2}", data.time_s, rolled, data.pose_time_s, pose, same_clock=True)


def identified(nominal: Robot, layout: WheelModel, seed: int) -> tuple[GeometryStudy, dict[str, float]]:
    runs, truth = simulated(nominal, seed)
    return identify_geometry(runs, layout), truth


@pytest.mark.nightly
@pytest.mark.timeout(900)
def test_intervals_hold_the_truth_of_robots_with_wrong_radii_and_bearings_that_slip() -> None:
    nominal = read_robot("three_wheel")
    layout = wheel_model(nominal)
    inside: dict[str, list[bool]] = {}
    for seed in range(SEEDS):
        study, truth = identified(nominal, layout, seed)
        found = study.whole.chosen
        for name in found.names:
            inside.setdefault(name, []).append(found.covers(name, truth[name]))
    shares = {name: float(np.mean(values)) for name, values in inside.items() if len(values) >= SEEDS / 2}
    every = [value for values in inside.values() for value in values]
    assert np.mean(every) >= 0.9, shares
    assert "wheel_1_angle_rad" in shares  # where the gain is not clear, the plain geometry is kept
    # At a true share of 90 %, 24 seeds give less than 19 / 24 with a probability of 3 %.
    assert min(shares.values()) >= 19 / SEEDS, shares


@pytest.mark.full
def test_a_robot_that_slips_is_found_nearer_than_its_drawing() -> None:
    nominal = read_robot("three_wheel")
    layout = wheel_model(nominal)
    study, truth = identified(nominal, layout, 100)
    found = study.whole.chosen
    drawn = dict(zip(layout.names, layout.nominal, strict=True))
    for name in ("wheel_1_radius_m", "wheel_2_radius_m", "wheel_3_radius_m"):
        assert abs(found[name] - truth[name]) < 0.25 * abs(drawn[name] - truth[name]) + 1e-4
    for run in study.held_out:
        assert run.identified.largest_m < run.nominal.largest_m
