# SPDX-License-Identifier: MIT
"""The sensor of motion over the floor: its direction and scale, from a push of the robot by hand along a metre."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

from omni_schema import Robot as RobotFile
from omniwheel.bringup.person import Person, require
from omniwheel.bringup.result import Findings, Result
from omniwheel.dialect import Message
from omniwheel.robot import Robot
from omniwheel.telemetry import FlowState, decode

REST = "Does the robot stand still on the floor, with a metre free in front of it, and is the motor supply off?"
PUSH = "Push the robot by hand: one metre straight ahead, without turning it. Then let it stand"
NONE = "none: FLOW_MODE is 0"
WAY_M = 1.0
RATE_HZ = 20.0
REST_S = 2.0
WAIT_S = 40.0
BEGUN_M = 0.2
STILL_M = 0.002
STILL_S = 1.0
DRIFT_LIMIT_M = 0.002
"""Of a robot at rest: several steps of the coarsest sensor."""
SCALE_TOLERANCE = 0.1
"""A hand and a ruler are good for a few millimetres of a metre; further off, it was another way."""
DIRECTION_TOLERANCE_RAD = math.radians(30.0)
TURN_TOLERANCE_RAD = math.radians(5.0)
_STEP_S = 0.1
_WIRES = "check SDA to pin 25, SCL to pin 24, 3.3 V, GND; was the firmware built from the file with this [flow]?"


class Ways:
    """What the robot says of the sensor: sums of its readings, along the robot's own axes."""

    def __init__(self) -> None:
        self.first: FlowState | None = None
        self.last: FlowState | None = None
        self.still_s = 0.0

    def take(self, message: Message) -> None:
        """Listen to a message."""
        state = decode(FlowState, message)
        if state is None:
            return
        if self.last is not None:
            way = math.hypot(state.x_m - self.last.x_m, state.y_m - self.last.y_m)
            self.still_s = self.still_s + state.time_s - self.last.time_s if way < STILL_M else 0.0
        self.first, self.last = self.first or state, state

    def clear(self) -> None:
        """Begin a new way."""
        self.first, self.still_s = self.last, 0.0

    def moved(self) -> tuple[float, float, float]:
        """Return x, y [m] and turn [rad] since then."""
        if self.first is None or self.last is None:
            return 0.0, 0.0, 0.0
        first, last = self.first, self.last
        return last.x_m - first.x_m, last.y_m - first.y_m, last.turn_rad - first.turn_rad


@contextmanager
def _listening(robot: Robot) -> Iterator[Ways]:
    ways = Ways()
    remove = robot.connection.add_listener(ways.take)
    robot.set_message_interval(FlowState.message, RATE_HZ)
    try:
        yield ways
    finally:
        robot.set_message_interval(FlowState.message, None)
        remove()


def check_flow(robot: Robot, person: Person, *, file: RobotFile | None = None, wait_s: float = WAIT_S) -> Result:
    """Look at the sensor while somebody pushes the robot along a metre. No motor is driven.

    A robot without one passes, with a word, unless its ``file`` has one. ``wait_s``: how long the person may take.
    """
    findings = Findings("flow")
    if robot.parameters["FLOW_MODE"] == 0.0:
        wired = file is not None and file.board.flow is not None
        advice = "the robot file has such a sensor: flash the firmware that was built from it"
        findings.judge("flow", not wired, NONE, advice)
        return findings.result()
    require(person, REST)
    with _listening(robot) as ways:
        if _rests(robot, findings, ways):
            _push(robot, person, findings, ways, wait_s)
    return findings.result()


def _rests(robot: Robot, findings: Findings, ways: Ways) -> bool:
    mark = robot.texts.mark()
    robot.pump(REST_S)
    prefix = "floor motion: "
    said = [text.text for text in robot.texts.since(mark) if text.text.startswith(prefix)]
    trouble = [text for text in said if not text.endswith("readings again")]
    if not findings.judge("readings", not trouble, ", ".join(trouble) or "nothing to complain of", _WIRES):
        return False
    x, y, _ = ways.moved()
    drift = math.hypot(x, y)
    findings.measured["drift_m"] = drift
    return findings.judge(
        "rest",
        drift < DRIFT_LIMIT_M,
        f"{1e3 * drift:.1f} mm in {REST_S:g} s at rest",
        "let the robot stand; an optical sensor needs a floor with texture, at the height that its maker names",
    )


def _push(robot: Robot, person: Person, findings: Findings, ways: Ways, wait_s: float) -> None:
    ways.clear()
    person.tell(PUSH)
    end_s = robot.connection.clock() + wait_s
    begun = False
    while robot.connection.clock() < end_s and not (begun and ways.still_s >= STILL_S):
        robot.pump(_STEP_S)
        begun = begun or math.hypot(*ways.moved()[:2]) > BEGUN_M
    x, y, turn = ways.moved()
    way = math.hypot(x, y)
    findings.measured.update(x_m=x, y_m=y, turn_rad=turn)
    if not begun:
        findings.bad("way", f"{1e3 * way:.0f} mm seen within {wait_s:g} s", f"push it further; or {_WIRES}")
        return
    if robot.parameters["FLOW_MODE"] > 1.0:
        advice = "push it straight; if you did, the sensor's own heading is wrong: let it stand after power-up"
        findings.judge("turn", abs(turn) < TURN_TOLERANCE_RAD, f"{math.degrees(turn):+.1f}° meanwhile", advice)
    _direction(robot, findings, math.atan2(y, x))
    _scale(robot, findings, way)


def _direction(robot: Robot, findings: Findings, seen: float) -> None:
    angle = math.degrees(math.remainder(math.radians(robot.parameters["FLOW_ANGLE"]) - seen, math.tau))
    findings.measured["angle_deg"] = angle
    findings.judge(
        "direction",
        abs(seen) < DIRECTION_TOLERANCE_RAD,
        f"{math.degrees(seen):+.1f}° off straight ahead; FLOW_ANGLE = {angle:.1f} would make it 0",
        f"set FLOW_ANGLE = {angle:.0f} and run this once more; to the front is the way in which x is counted",
    )


def _scale(robot: Robot, findings: Findings, way: float) -> None:
    ratio = WAY_M / way
    scale = robot.parameters["FLOW_SCALE"] * ratio
    findings.measured["scale"] = scale
    findings.judge(
        "scale",
        abs(ratio - 1.0) < SCALE_TOLERANCE,
        f"{1e3 * way:.0f} mm for a metre; FLOW_SCALE = {scale:.4f} would make it 1000",
        "push it by just one metre; if it was one, the sensor's height or its steps per millimetre are wrong",
    )
