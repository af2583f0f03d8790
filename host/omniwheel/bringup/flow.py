# SPDX-License-Identifier: MIT
"""The sensor of motion over the floor: its direction and scale, from two pushes of the robot by hand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager

from omni_schema import Robot as RobotFile
from omniwheel.bringup.person import HandMotion, Person, require
from omniwheel.bringup.result import Findings, Result
from omniwheel.dialect import Message
from omniwheel.robot import Robot
from omniwheel.telemetry import FlowState, decode

REST = "Does the robot stand still on the floor, with a metre free in front of it, and is the motor supply off?"
PUSH = "Push the robot by hand: one metre straight ahead, without turning it. Then let it stand"
ASIDE = "Push the robot by hand: half a metre straight to its left, without turning it. Then let it stand"
NONE = "none: FLOW_MODE is 0"
WAY_M = 1.0
RATE_HZ = 20.0
REST_S = 2.0
WAIT_S = 40.0
LEAST_READINGS = 10
BEGUN_M = 0.2
STILL_M = 0.002
STILL_S = 1.0
DRIFT_LIMIT_M = 0.002
"""Of a robot at rest: several steps of the coarsest sensor."""
SCALE_TOLERANCE = 0.03
"""A hand and a ruler are good for some millimetres of a metre."""
DIRECTION_TOLERANCE_RAD = math.radians(3.0)
"""What a push along an edge of the floor is good for. The estimator takes an error for slip of the wheels."""
ASIDE_TOLERANCE_RAD = math.radians(30.0)
"""Only the side is asked for."""
TURN_TOLERANCE_RAD = math.radians(5.0)
_STEP_S = 0.1
_WIRES = (
    "check SDA to pin 25, SCL to pin 24, 3.3 V, GND; check that the firmware was built from the file with this [flow]"
)
_BACKWARDS, _ASIDE = math.radians(150.0), math.radians(60.0)
_TURN_ADVICE = (
    "push it straight. If it was straight, the sensor's own heading is wrong: keep the robot at rest after power-up"
)


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

    @property
    def came(self) -> int:
        """Readings since then, good or not."""
        return 0 if self.first is None or self.last is None else self.last.readings_came - self.first.readings_came

    @property
    def lost(self) -> int:
        """Readings since then that came without a way."""
        return 0 if self.first is None or self.last is None else self.last.readings_lost - self.first.readings_lost

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
    """Check the sensor while the operator pushes the robot 1 m ahead, then to the left. No motor is driven.

    A robot without one passes, with a word, unless its ``file`` has one. With the file of a sensor that has wheels the
    advice is about these. ``wait_s``: how long the person may take for a push.
    """
    findings = Findings("flow")
    wiring = None if file is None else file.board.flow
    if robot.parameters["FLOW_MODE"] == 0.0:
        advice = "the robot file has such a sensor: flash the firmware that was built from it"
        findings.judge("flow", wiring is None, NONE, advice)
        return findings.result()
    wheels = wiring is not None and wiring.chip.wheels
    angle = robot.parameters["FLOW_ANGLE"]
    if wheels and abs(angle) > math.degrees(DIRECTION_TOLERANCE_RAD):
        findings.bad(
            "FLOW_ANGLE",
            f"{angle:g}",
            "the directions of these wheels are corrected by their cables and `reversed`: set it to 0",
        )
        return findings.result()
    require(person, REST)
    with _listening(robot) as ways:
        if _rests(robot, findings, ways) and _ahead(robot, person, findings, ways, (wheels, wait_s)):
            _aside(robot, person, findings, ways, (wheels, wait_s))
    return findings.result()


def _rests(robot: Robot, findings: Findings, ways: Ways) -> bool:
    robot.pump(REST_S)
    prefix = "floor motion: "
    said = [text.text for text in robot.texts.since(0) if text.text.startswith(prefix)]
    good = ways.came - ways.lost
    seen = f"{good} in {REST_S:g} s"
    if not findings.judge("readings", good >= LEAST_READINGS, ", ".join([seen, *said[-1:]]), _WIRES):
        return False
    x, y, _ = ways.moved()
    drift = math.hypot(x, y)
    findings.measured["drift_m"] = drift
    return findings.judge(
        "rest",
        drift < DRIFT_LIMIT_M,
        f"{1e3 * drift:.1f} mm in {REST_S:g} s at rest",
        "let the robot stand; an optical sensor needs a floor with texture, at the mounting height of its data sheet",
    )


def _push(robot: Robot, ways: Ways, wait_s: float) -> tuple[float, float, float] | None:
    """Return x, y [m] and turn [rad] of a push that has been asked for; None if nothing moves."""
    ways.clear()
    end_s = robot.connection.clock() + wait_s
    begun = False
    while robot.connection.clock() < end_s and not (begun and ways.still_s >= STILL_S):
        robot.pump(_STEP_S)
        begun = begun or math.hypot(*ways.moved()[:2]) > BEGUN_M
    return ways.moved() if begun else None


def _ahead(robot: Robot, person: Person, findings: Findings, ways: Ways, how: tuple[bool, float]) -> bool:
    """Whether another push makes sense. ``how``: whether the sensor has wheels, and how long to wait."""
    wheels, wait_s = how
    person.move_by_hand(HandMotion.PUSH, PUSH)
    moved = _push(robot, ways, wait_s)
    if moved is None:
        way = math.hypot(*ways.moved()[:2])
        findings.bad("way", f"{1e3 * way:.0f} mm seen within {wait_s:g} s", f"push it further; or {_WIRES}")
        return False
    x, y, turn = moved
    findings.measured.update(x_m=x, y_m=y, turn_rad=turn, lost=ways.lost)
    lost = "the distance lacks these: improve the floor's texture, the mounting height and the plugs"
    if not findings.judge("whole", ways.lost == 0, f"{ways.lost} invalid readings during the push", lost):
        return False
    straight = _judge_turn(robot, findings, "turn", turn)
    right = _direction(robot, findings, math.atan2(y, x), wheels)
    _scale(robot, findings, math.hypot(x, y))
    return straight and right


def _judge_turn(robot: Robot, findings: Findings, name: str, turn: float) -> bool:
    """Of a sensor that measures the turn, too."""
    if robot.parameters["FLOW_MODE"] <= 1.0:
        return True
    return findings.judge(
        name, abs(turn) < TURN_TOLERANCE_RAD, f"{math.degrees(turn):+.1f}° during the push", _TURN_ADVICE
    )


def _aside(robot: Robot, person: Person, findings: Findings, ways: Ways, how: tuple[bool, float]) -> None:
    """Straight ahead, a sensor that counts y the wrong way looks right."""
    wheels, wait_s = how
    person.move_by_hand(HandMotion.PUSH, ASIDE)
    moved = _push(robot, ways, wait_s)
    if moved is None:
        advice = "push it further, straight to the left"
        findings.bad("left", f"nothing seen within {wait_s:g} s", _y_wheel_advice(advice) if wheels else advice)
        return
    x, y, turn = moved
    findings.measured.update(aside_x_m=x, aside_y_m=y)
    if not _judge_turn(robot, findings, "turn again", turn):
        return
    off = math.remainder(math.atan2(y, x) - math.pi / 2.0, math.tau)
    advice = "push it to its left. If it was left, check whether the sensor is upside down, or its x and y exchanged"
    if wheels and abs(off) > _BACKWARDS:
        advice = 'the y wheel counts backwards: write "y" into reversed of [flow], or remove it there; then flash'
    findings.judge(
        "left", abs(off) < ASIDE_TOLERANCE_RAD, f"{math.degrees(off):+.1f}° off straight to the left", advice
    )


def _y_wheel_advice(advice: str) -> str:
    return f"{advice}; or the y wheel's encoder is not connected"


def _direction(robot: Robot, findings: Findings, seen: float, wheels: bool) -> bool:
    angle = math.degrees(math.remainder(math.radians(robot.parameters["FLOW_ANGLE"]) - seen, math.tau))
    findings.measured["angle_deg"] = angle
    advice = f"if you pushed it straight, set FLOW_ANGLE={angle:.1f} (omni params set) and repeat the check"
    if wheels and abs(seen) > _BACKWARDS:
        advice = 'the x wheel counts backwards: write "x" into reversed of [flow], or remove it there; then flash'
    elif wheels and abs(seen) > _ASIDE:
        advice = "exchange the cables of the x and the y wheel: x is the one that rolls to the front"
    return findings.judge(
        "direction",
        abs(seen) < DIRECTION_TOLERANCE_RAD,
        f"{math.degrees(seen):+.1f}° off straight ahead; FLOW_ANGLE = {angle:.1f} would make it 0",
        advice,
    )


def _scale(robot: Robot, findings: Findings, way: float) -> None:
    ratio = WAY_M / way
    scale = robot.parameters["FLOW_SCALE"] * ratio
    findings.measured["scale"] = scale
    findings.judge(
        "scale",
        abs(ratio - 1.0) < SCALE_TOLERANCE,
        f"{1e3 * way:.0f} mm for a metre; FLOW_SCALE = {scale:.4f} would make it 1000",
        f"if it was exactly one metre, set FLOW_SCALE={scale:.4f} and repeat the check. More than 10 % off: check "
        "the mounting height and the steps per millimetre",
    )
