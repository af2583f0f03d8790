# SPDX-License-Identifier: MIT
"""A small square and two turns on the floor at low speed, to see whether the body's axes point where they should."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, replace

from omniwheel.bringup.bench import armed, layout_of
from omniwheel.bringup.other_stops import safety_of
from omniwheel.bringup.person import Person, require
from omniwheel.bringup.result import Findings, Result
from omniwheel.errors import StoppedError
from omniwheel.frames import Pose, Twist, relative_pose
from omniwheel.robot import Robot
from omniwheel.telemetry import Tracking

SIDE_M = 0.2
SPEED_M_S = 0.1
TURN_RAD = math.pi / 2
TURN_RAD_S = 0.5
SPEED_SHARE = 0.7
"""A wheel is asked for no more than this share of the motor model's no-load speed."""
REST_S = 0.8
TOLERANCE = 0.25
SLACK = (0.02, 0.02, 0.1)
"""Allowed beside the tolerance: forward [m], left [m], turned [rad]."""
FLOOR = (
    "The robot drives a square of 20 cm and turns on the spot. Is it on the floor, with half a metre of room on each "
    "side?"
)
_MODEL = (
    "the odometry is wrong: run `omni bringup motors` again; if that passes, compare WHEEL_RADIUS, WHEEL_DIST "
    "and the wheels' speeds in `omni monitor`"
)


@dataclass(frozen=True)
class Move:
    """A move, the body twist that makes it, for how long, and what a person sees of it ("" if not asked)."""

    name: str
    twist: Twist
    time_s: float
    seen_as: str = ""

    @property
    def wanted(self) -> Twist:
        """Displacement in the frame at its start [m, m, rad]."""
        return Twist(*(value * self.time_s for value in self.twist))

    def slower(self, share: float) -> Move:
        """Return the same displacement at this share of the speed."""
        return replace(self, twist=Twist(*(value * share for value in self.twist)), time_s=self.time_s / share)


_LEG_S = SIDE_M / SPEED_M_S
_TURN_S = TURN_RAD / TURN_RAD_S
MOVES = (
    Move("forward", Twist(SPEED_M_S, 0.0, 0.0), _LEG_S, "straight forward (along its x axis)"),
    Move("left", Twist(0.0, SPEED_M_S, 0.0), _LEG_S, "straight to its left"),
    Move("back", Twist(-SPEED_M_S, 0.0, 0.0), _LEG_S),
    Move("right", Twist(0.0, -SPEED_M_S, 0.0), _LEG_S),
    Move("turn left", Twist(0.0, 0.0, TURN_RAD_S), _TURN_S, "counter-clockwise, as seen from above"),
    Move("turn right", Twist(0.0, 0.0, -TURN_RAD_S), _TURN_S),
)


def check_drive(robot: Robot, person: Person) -> Result:
    """Drive the moves one by one, armed only meanwhile, and compare the odometry and what the person saw."""
    require(person, FLOOR)
    findings = Findings("drive")
    for move in _within_reach(robot):
        person.show(move.name)
        mark = robot.texts.mark()
        displacement = _drive(robot, move)
        findings.measured[move.name.replace(" ", "_")] = list(displacement)
        if not _judge_stop(robot, findings, move, mark):
            break
        _judge_odometry(findings, move, displacement)
        if move.seen_as and person.saw(f"Did the robot move {move.seen_as}?") is False:
            _judge_seen(findings, robot, move)
            break
    return findings.result()


def _within_reach(robot: Robot) -> list[Move]:
    """Return the moves, slower where small wheels or slow motors could not follow."""
    layout = layout_of(robot)
    radius_m, distance_m = robot.parameters["WHEEL_RADIUS"], robot.parameters["WHEEL_DIST"]
    rim_m_s = SPEED_SHARE * radius_m * layout.supply_V / layout.speed_V_s
    moves = []
    for move in MOVES:
        wanted_m_s = math.hypot(move.twist.vx, move.twist.vy) + abs(move.twist.wz) * distance_m
        moves.append(move.slower(min(1.0, rim_m_s / wanted_m_s)))
    return moves


def _drive(robot: Robot, move: Move) -> Twist:
    before = _settled_pose(robot)
    robot.require_velocity(*move.twist, duration_s=move.time_s)
    with armed(robot):
        with suppress(StoppedError):  # judged by what the robot says of it
            robot.repeat(lambda: robot.set_velocity(*move.twist), move.time_s)
            robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), REST_S)
        after = _settled_pose(robot)
    return Twist(*relative_pose(before, after))


def _settled_pose(robot: Robot) -> Pose:
    """Return a pose that is newer than what was on its way."""
    for _ in range(2):
        pose = robot.wait_for(Tracking).pose
    return pose


def _judge_stop(robot: Robot, findings: Findings, move: Move, mark: int) -> bool:
    status = safety_of(robot)
    said = [text.text for text in robot.texts.since(mark) if text.text.startswith("failsafe")]
    if not status.fault_history and status.state not in ("failsafe", "estop") and not said:
        return True
    findings.bad(
        move.name,
        f"the robot stopped by itself: {'; '.join(said[-1:]) or ', '.join(status.fault_history)}",
        "correct that first (`omni monitor` shows the faults); check for a blocked wheel and an empty battery",
    )
    return False


def _judge_odometry(findings: Findings, move: Move, moved: Twist) -> None:
    size = max(map(abs, move.wanted))
    ok = all(
        abs(got - want) <= (TOLERANCE * size if want else 0.0) + slack
        for got, want, slack in zip(moved, move.wanted, SLACK, strict=True)
    )
    seen = f"{moved.vx:+.3f} m forward, {moved.vy:+.3f} m left, {math.degrees(moved.wz):+.1f}° turned"
    findings.judge(move.name, ok, seen, _MODEL)


def _judge_seen(findings: Findings, robot: Robot, move: Move) -> None:
    wheels = int(robot.parameters["WHEELS"])
    angles = ", ".join(f"wheel {n}: {robot.parameters[f'W{n}_ANGLE']:g}°" for n in range(1, wheels + 1))
    findings.bad(
        f"{move.name}: observed",
        "the robot moved in another direction than its odometry",
        f"look from above, counter-clockwise from the front: {angles}. If wheels are elsewhere, correct [geometry] "
        "wheel_angle_deg in the robot file or exchange motor and encoder of the wheels together. If it went exactly "
        "backwards, all motors and encoders are reversed: invert [motor] direction and [encoder] direction. Note "
        "that the body's x axis is where wheel_angle_deg = 0 points",
    )
