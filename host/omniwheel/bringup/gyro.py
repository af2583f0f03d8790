# SPDX-License-Identifier: MIT
"""The gyro: its readings and bias at rest, then the way it turns and its scale, from a turn of the robot by hand."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from statistics import pstdev

from omni_schema import Robot as RobotFile
from omniwheel.bringup.bench import file_line
from omniwheel.bringup.person import HandMotion, Person, require
from omniwheel.bringup.result import Findings, Result
from omniwheel.dialect import Message
from omniwheel.robot import Robot
from omniwheel.sensor_quality import BIAS_LIMIT_RAD_S
from omniwheel.telemetry import GyroState, decode

REST = "Does the robot stand still on the floor, with room to turn, and is the motor supply off?"
TURN = "Turn the robot by hand: one whole turn counter-clockwise, seen from above, back to a mark. Then let it stand"
NONE = "none: GYRO_AXIS is 0"
RATE_HZ = 50.0
REST_S = 4.0
WAIT_S = 40.0
NOISE_LIMIT_RAD_S = 0.01
BEGUN_RAD = 0.2
STILL_RAD_S = 0.03
STILL_S = 1.0
SCALE_TOLERANCE = 0.1
"""A hand and a mark are good for a degree or two; further off, it was another angle."""
_STEP_S = 0.1
_WIRES = (
    "SDA to pin 17, SCL to pin 16, 3.3 V, GND, CS to 3.3 V; check that the firmware was built from the file "
    "with this [gyro]"
)


class Readings:
    """What the robot says of its gyro, and the angle that its rates add up to."""

    def __init__(self) -> None:
        self.all: list[GyroState] = []
        self.angle_rad = 0.0
        self.still_s = 0.0

    def take(self, message: Message) -> None:
        """Listen to a message."""
        state = decode(GyroState, message)
        if state is None:
            return
        if self.all:
            last = self.all[-1]
            duration_s = state.time_s - last.time_s
            self.angle_rad += 0.5 * (last.rate_rad_s + state.rate_rad_s) * duration_s
            still = abs(state.rate_rad_s) < STILL_RAD_S
            self.still_s = self.still_s + duration_s if still else 0.0
        self.all.append(state)

    def clear(self) -> None:
        """Begin a new angle."""
        self.all = self.all[-1:]
        self.angle_rad = self.still_s = 0.0


@contextmanager
def _listening(robot: Robot) -> Iterator[Readings]:
    readings = Readings()
    remove = robot.connection.add_listener(readings.take)
    robot.set_message_interval(GyroState.message, RATE_HZ)
    try:
        yield readings
    finally:
        robot.set_message_interval(GyroState.message, None)
        remove()


def check_gyro(robot: Robot, person: Person, *, file: RobotFile | None = None, wait_s: float = WAIT_S) -> Result:
    """Check the gyro at rest, then while the operator turns the robot. No motor is driven.

    A robot without a gyro passes, with a word, unless its ``file`` has one. ``wait_s``: how long the person may take.
    """
    findings = Findings("gyro")
    axis = int(robot.parameters["GYRO_AXIS"])
    if axis == 0:
        wired = file is not None and file.board.gyro is not None
        advice = "the robot file has a gyro: flash the firmware that was built from it, or set GYRO_AXIS"
        findings.judge("gyro", not wired, NONE, advice)
        return findings.result()
    require(person, REST)
    with _listening(robot) as readings:
        if _rests(robot, findings, readings):
            _turn(robot, person, findings, readings, axis, wait_s)
    return findings.result()


def _rests(robot: Robot, findings: Findings, readings: Readings) -> bool:
    mark = robot.texts.mark()
    robot.pump(REST_S)
    said = [text.text for text in robot.texts.since(mark) if text.text.startswith("gyro: ")]
    last_second = readings.all[-round(RATE_HZ) :]
    used = bool(last_second) and all(state.used for state in last_second)
    comes = any(state.rate_rad_s != 0.0 for state in last_second)
    why = ", ".join(said) or ("it contradicted the wheels" if comes else "no readings")
    advice = "restart the robot, and do not drive it before this check" if comes and not said else f"check {_WIRES}"
    if not findings.judge("readings", used, "used by the estimator" if used else f"not used: {why}", advice):
        return False
    bias, noise = last_second[-1].bias_rad_s, pstdev(state.rate_rad_s for state in last_second)
    findings.measured.update(bias_rad_s=bias, bias_sd_rad_s=last_second[-1].bias_sd_rad_s, noise_rad_s=noise)
    findings.judge(
        "bias",
        abs(bias) < BIAS_LIMIT_RAD_S,
        f"{bias:+.4f} rad/s at rest, standard deviation {last_second[-1].bias_sd_rad_s:.1g}",
        f"beyond {BIAS_LIMIT_RAD_S:g} rad/s the chip is damaged, bent by its screws, or the robot was turning",
    )
    return findings.judge(
        "noise",
        noise < NOISE_LIMIT_RAD_S,
        f"{noise:.4f} rad/s between readings",
        "the robot vibrates, or the chip's board is loose: fix it, keep the robot at rest, and repeat the check",
    )


def _turn(robot: Robot, person: Person, findings: Findings, readings: Readings, axis: int, wait_s: float) -> None:
    """A gyro whose sign is wrong is refused by the estimator while the wheels turn along: its rate is then 0."""
    readings.clear()
    person.move_by_hand(HandMotion.TURN, TURN)
    end_s = robot.connection.clock() + wait_s
    begun = False
    while robot.connection.clock() < end_s and not (begun and readings.still_s >= STILL_S):
        robot.pump(_STEP_S)
        begun = begun or abs(readings.angle_rad) > BEGUN_RAD
    angle = readings.angle_rad
    findings.measured["angle_rad"] = angle
    if not begun:
        advice = f"turn it about the vertical; check that axis {abs(axis)} of the chip points up"
        findings.bad("turn", f"no turn seen within {wait_s:g} s", advice)
        return
    sign = f"set the parameter GYRO_AXIS, or {file_line('gyro', 'axis', -axis)}; then restart the robot"
    way = "counter-clockwise" if angle > 0.0 else "clockwise"
    if findings.judge("sign", angle > 0.0, f"it says {way}", sign):
        _scale(robot, findings, angle)


def _scale(robot: Robot, findings: Findings, angle: float) -> None:
    ratio = math.tau / angle
    scale = robot.parameters["GYRO_SCALE"] * ratio
    findings.measured["scale"] = scale
    findings.judge(
        "scale",
        abs(ratio - 1.0) < SCALE_TOLERANCE,
        f"{math.degrees(angle):.1f}° for a whole turn; GYRO_SCALE = {scale:.4f} would make it 360°",
        "turn it by exactly one turn; if it was, the axis is not vertical",
    )
