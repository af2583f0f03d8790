# SPDX-License-Identifier: MIT
"""Autotune on the real firmware, whose robot file is wrong about the robot that is really there."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import omniwheel.robot
from hil_sim.lockstep import SteppedLink
from hil_sim.runs import new_world
from hil_sim.scenario import load_scenario
from omniwheel import FirmwareProcess, Robot, parameter_file
from omniwheel.autotune.design import CHANGED
from omniwheel.autotune.motor_values import motor_values
from omniwheel.autotune.page import AFTER, write_page
from omniwheel.autotune.procedure import Settings, autotune
from omniwheel.autotune.robot_file import write_robot_file
from omniwheel.autotune.room import PEAK_ACCELERATION, PEAK_SPEED, leg_time, points, reach_of
from omniwheel.dialect import mavlink
from omniwheel.errors import AutotuneError, OmniError
from omniwheel.frames import Pose
from omniwheel.identification.estimate import Estimate
from omniwheel.identification.model import FLOOR
from omniwheel.paths import robots_dir
from omniwheel.robots import read_robot

WRONG = {
    "constant_N_m_A = 0.33462": "constant_N_m_A = 0.26",
    "resistance_ohm = 2.87154": "resistance_ohm = 3.5",
    "inertia_kg_m2 = 0.00116979": "inertia_kg_m2 = 0.0016",
    "mass_kg = 4.0": "mass_kg = 5.0",
    'name = "fast_three_wheel"': 'name = "wrong"',
    "KF_J = 0.00731379": "KF_J = 0.0",
}
QUICK = Settings(legs=8, rounds=3)
ESTOP = mavlink.MAV_CMD_OMNI_ESTOP


@contextmanager
def wrong_robot(folder: Path, end_s: float = 600.0, fix_sd: float = 5e-3) -> Iterator[tuple[Robot, SteppedLink]]:
    """A robot in simulated time that believes in WRONG; it is the fast one. ``fix_sd``: of its pose fixes [m, rad]."""
    text = (robots_dir() / "fast_three_wheel.toml").read_text(encoding="utf-8")
    for right, wrong in WRONG.items():
        assert right in text
        text = text.replace(right, wrong)
    (folder / "wrong.toml").write_text(text, encoding="utf-8")
    scenario = load_scenario("sitl", str(folder / "wrong.toml"), "fast_three_wheel")
    fixes = {"fix_sd_xy_m": fix_sd, "fix_sd_theta_rad": fix_sd}
    scenario = replace(
        scenario,
        world={**scenario.world, **fixes},
        parameters={**scenario.parameters, "EKF_R_XY": fix_sd, "EKF_R_TH": fix_sd},
    )
    with FirmwareProcess(parameters=scenario.parameter_values(), links=["tcp:127.0.0.1:0"], lockstep=True) as firmware:
        link = SteppedLink(firmware.open_link(), new_world(scenario))
        link.end_s = end_s
        with omniwheel.robot.connect(link, clock=link.clock_s) as robot:
            yield robot, link


@pytest.mark.full
def test_a_robot_file_that_is_wrong_is_mended_and_the_robot_drives_better(tmp_path: Path) -> None:
    told: list[str] = []
    with wrong_robot(tmp_path, fix_sd=3e-4) as (robot, _):
        before = dict(robot.parameters.items())
        outcome = autotune(robot, QUICK, True, told.append)
        after = dict(robot.parameters.items())
        page = write_page(outcome, QUICK.required, robot.table, tmp_path).read_text(encoding="utf-8")
    truth = read_robot("fast_three_wheel").parameter_values()
    assert outcome.kept
    assert outcome.new["MOT_K"] / truth["MOT_R"] == pytest.approx(truth["MOT_K"] / truth["MOT_R"], rel=0.05)
    volts = outcome.new["KF_J"] * before["MOT_R"] / outcome.new["MOT_K"]
    assert volts == pytest.approx(truth["KF_J"] * truth["MOT_R"] / truth["MOT_K"], rel=0.15)
    (position,) = (verdict for verdict in outcome.verdicts if verdict.kind.key == "position_m")
    assert position.after < position.before < 2e-3
    assert math.isfinite(position.half_width)
    changed = {name for name in after if after[name] != before[name]}
    assert changed <= set(CHANGED)
    assert after["WS_P"] == pytest.approx(outcome.new["WS_P"], rel=1e-6)
    assert all(name in page for name in outcome.new)
    assert (tmp_path / "autotune.png").stat().st_size > 10_000
    mine = write_robot_file(outcome, "mine", str(tmp_path / "wrong.toml"), tmp_path)
    assert read_robot(mine).parameter_values()["WS_P"] == pytest.approx(outcome.new["WS_P"], rel=1e-4)
    assert any("70%" in text for text in told)


@pytest.mark.nightly
def test_what_the_robot_cannot_know_is_no_reason_to_keep_new_values(tmp_path: Path) -> None:
    """With pose fixes of 5 mm: it sees its error of 0.8 mm shrink, but does not know its pose to 1.7 mm."""
    with wrong_robot(tmp_path) as (robot, _):
        before = dict(robot.parameters.items())
        outcome = autotune(robot, QUICK, True, lambda _: None)
        assert dict(robot.parameters.items()) == before
        assert not outcome.kept
        write_page(outcome, QUICK.required, robot.table, tmp_path)
        # Whoever wants them all the same takes them from the folder: omni params load runs/autotune/after.toml
        robot.parameters.set_many(parameter_file.read(tmp_path / AFTER, robot.table))
        assert {name: robot.parameters[name] for name in outcome.new} == pytest.approx(outcome.new, rel=1e-6)


@pytest.mark.parametrize("when_s", [5.0, pytest.param(70.0, marks=pytest.mark.nightly)])
def test_an_emergency_stop_leaves_the_old_parameters(tmp_path: Path, when_s: float) -> None:
    """In the first drive, and while the new parameters are tried."""
    with wrong_robot(tmp_path) as (robot, link):
        before = dict(robot.parameters.items())
        stopped: list[float] = []

        def stop(_: object) -> None:
            if link.clock_s() > when_s and not stopped:
                stopped.append(link.clock_s())
                robot.connection.send(mavlink.MAVLink_command_long_message(1, 1, ESTOP, 0, 1.0, *[0.0] * 6))

        robot.connection.add_listener(stop)
        with pytest.raises(OmniError):
            autotune(robot, QUICK, True, lambda _: None)
        assert stopped
        robot.pump(0.5)
        assert robot.status.state == "estop"
        robot.parameters.forget()
        assert robot.parameters.download() == before


@given(
    side=st.floats(0.6, 5.0),
    body=st.floats(0.05, 0.2),
    legs=st.integers(4, 31),
    seed=st.integers(0, 1000),
    share=st.floats(0.1, 1.0),
)
def test_the_robot_stays_in_its_square_and_below_its_limits(
    side: float, body: float, legs: int, seed: int, share: float
) -> None:
    here = Pose(3.0, -2.0, 1.0)
    places = points(here, reach_of(side, body), 1.2, legs, seed)
    assert len(places) == legs + 1
    assert places[0] == places[-1] == here
    assert all(abs(p.theta - here.theta) <= 1.2 for p in places)
    assert all(max(abs(p.x - here.x), abs(p.y - here.y)) <= 0.5 * side - body + 1e-9 for p in places)
    speed, quick = (1.3 * share, 8.0 * share), (1.5 * share, 9.0 * share)
    leg_s = leg_time(places, speed, quick)
    ways = [(math.hypot(b.x - a.x, b.y - a.y), abs(b.theta - a.theta)) for a, b in pairwise(places)]
    u = np.linspace(0.0, 1.0, 2001)
    slope, bend = np.max(30 * u**2 * (1 - u) ** 2), np.max(np.abs(60 * u - 180 * u**2 + 120 * u**3))
    assert slope == pytest.approx(PEAK_SPEED, rel=1e-3)
    assert bend == pytest.approx(PEAK_ACCELERATION, rel=1e-3)
    peaks = [max(way[axis] for way in ways) for axis in (0, 1)]
    assert all(slope * peaks[axis] / leg_s <= speed[axis] * (1 + 1e-6) for axis in (0, 1))
    assert all(bend * peaks[axis] / leg_s**2 <= quick[axis] * (1 + 1e-3) for axis in (0, 1))


def test_a_room_that_is_too_small_says_how_much_is_needed() -> None:
    with pytest.raises(AutotuneError) as error:
        reach_of(0.4, 0.2)
    assert "--room 0.50" in error.value.hint


PRESENT = {
    "MOT_J": 0.002, "MOT_B": 0.01, "MOT_K": 0.4, "MOT_R": 3.0, "MOT_L": 1e-3, "KF_J": 0.0, "MASS": 4.0,
    "WHEEL_RADIUS": 0.05, "WHEELS": 3.0,
}  # fmt: skip


def estimate(sd: float, **values: float) -> Estimate:
    names = FLOOR[:-1]  # autotune's short drives cannot tell dry drag of the rollers
    numbers = np.array([values[name] for name in names])
    return Estimate(names, numbers, np.diag((sd * numbers) ** 2), 50.0)


@given(
    gain=st.floats(0.1, 3.0), friction=st.floats(0.0, 1.0), inertia=st.floats(0.01, 0.5), turning=st.floats(0.3, 2.0)
)
def test_the_robot_computes_what_was_measured(gain: float, friction: float, inertia: float, turning: float) -> None:
    """Whatever the file said: volts per speed and per acceleration of motor.h are those of the estimate."""
    found = estimate(
        0.01, speed_gain_V_s=gain, coulomb_V=friction, inertia_xy_V_s2=inertia * gain,
        inertia_theta_V_s2=turning * inertia * gain, drag_xy_V_s=0.01,
    )  # fmt: skip
    measured = motor_values(found, PRESENT)
    values = {**PRESENT, **measured.values}
    k, r, b = values["MOT_K"], values["MOT_R"], values["MOT_B"]
    assert k + r * b / k == pytest.approx(gain)
    assert (r * values["KF_J"] + values["MOT_L"] * b) / k == pytest.approx(inertia * gain)
    assert 0.0 < values["MOT_J"] < values["KF_J"]
    assert values["WS_FF_S"] <= friction
    again = motor_values(found, values)
    assert again.values == pytest.approx(measured.values)


def test_a_drive_that_shows_too_little_is_no_measurement() -> None:
    found = estimate(
        0.3, speed_gain_V_s=0.4, coulomb_V=0.1, inertia_xy_V_s2=0.05, inertia_theta_V_s2=0.03, drag_xy_V_s=0.01
    )
    with pytest.raises(AutotuneError, match="speed_gain_V_s"):
        motor_values(found, PRESENT)


@pytest.mark.parametrize("parameters", [{"CTL_MODE": 4.0}, {"KF_MODE": 0.0}, {"ISMC_K_XY": 0.0}])
def test_a_robot_that_it_is_not_made_for_does_not_move(tmp_path: Path, parameters: dict[str, float]) -> None:
    with wrong_robot(tmp_path) as (robot, _):
        robot.parameters.set_many(parameters)
        with pytest.raises(AutotuneError):
            autotune(robot, QUICK, True, lambda _: pytest.fail("it drives"))
