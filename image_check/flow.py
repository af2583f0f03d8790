# SPDX-License-Identifier: MIT
"""The sensor of motion over the floor on the third I2C bus: its ways reach the estimator; without it the motors go on.

The sensor is the model of the one that the robot file names (``hil_sim/flow_chip.h``), at the pins. It moves as the
world's robot does. A Pinpoint's wheels are those of the robot file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import partial

from image_check.bench import Bench, CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.sensor_trouble import STEP_S, Sensor, fail, held_line, on_floor, wait, world_fault
from omni_schema.flow import SDA_PIN
from omniwheel.capability.speeds import top_speed, top_turn_rate
from omniwheel.dialect import Message
from omniwheel.robot import Robot
from omniwheel.telemetry import FlowState, Status, decode

NO_FLOW = "not tried: this robot has no sensor of motion over the floor"
SPEED_M_S, TURN_RAD_S = 0.15, 0.4
SPEED_SHARE, TURN_SHARE = 0.5, 0.25
"""Of what a slower robot can do."""
DRIVE_S = 1.5
CALIBRATE_S = 1.0
"""Its gyro is calibrated while the robot stands; on the move its turns would not be used."""
START_S = 3.0
WAY_LIMIT_M = 2e-3
TURN_LIMIT_RAD = 5e-3
"""The telemetry's sum is some milliseconds older than the world."""
SILENT = "flow_silent"
WORDS = {
    SILENT: "floor motion: no sensor answers; check its wires",
    "held": "floor motion: a line of its bus is held low",
}
AGAIN = "floor motion: readings again"


@dataclass
class Heard:
    """What the robot said."""

    texts: list[str] = field(default_factory=list)
    flow: list[FlowState] = field(default_factory=list)
    status: list[Status] = field(default_factory=list)

    def take(self, message: Message) -> None:
        """Listen to a message."""
        if message.get_type() == "STATUSTEXT":
            self.texts.append(str(message.text))
            return
        flow, status = decode(FlowState, message), decode(Status, message)
        self.flow += [flow] if flow is not None else []
        self.status += [status] if status is not None else []


def flow(context: Context) -> list[str]:
    """Ways of a drive and of a turn, and each trouble that wires can show: what is said, and the way back.

    All the while the motors' bus must lose no update.
    """
    if context.scenario.robot.board.flow is None:
        return [NO_FLOW]
    figures = []
    with context.booted(scenario=on_floor(context.scenario)) as bench:
        robot, heard = bench.connect(), Heard()
        robot.connection.add_listener(heard.take)
        robot.pump(0.2)
        for name in ("OMNI_FLOW", "OMNI_STATUS"):
            robot.set_message_interval(name, 50.0)
        robot.pump(CALIBRATE_S)
        robot.arm()
        speed, turn = _pace(robot)
        sensor = Sensor(
            bench, "floor motion", heard.texts, heard.status, lambda seconds: _drive(robot, speed, turn, seconds)
        )
        figures.append(_first(sensor, heard))
        figures.append(_way(bench, robot, heard, speed, turn))
        figures.append(fail(sensor, WORDS[SILENT], AGAIN, *world_fault(bench, SILENT)))
        figures.append(fail(sensor, WORDS["held"], AGAIN, *held_line(bench, SDA_PIN)))
        robot.disarm()
        errors = heard.status[-1].i2c_errors
        if errors != 0:
            raise CheckError(f"{errors} updates of the PWM chip failed meanwhile")
        figures.append("no update of the PWM chip failed meanwhile")
    return figures


def _pace(robot: Robot) -> tuple[float, float]:
    """Return a speed along each axis and a turn rate that this robot reaches."""
    model = robot.drive_model()
    top_m_s = min(top_speed(model, 0.0).value, top_speed(model, math.pi / 2.0).value)
    return min(SPEED_M_S, SPEED_SHARE * top_m_s), min(TURN_RAD_S, TURN_SHARE * top_turn_rate(model).value)


def _drive(robot: Robot, speed_m_s: float, turn_rad_s: float, seconds: float) -> None:
    """Around a circle: a robot that turns on the spot proves nothing of where the sensor points."""
    robot.repeat(lambda: robot.set_velocity(speed_m_s, 0.0, turn_rad_s), max(seconds, STEP_S))


def _first(sensor: Sensor, heard: Heard) -> str:
    begin_s = sensor.bench.clock_s()
    wait(
        sensor,
        lambda: bool(heard.flow and heard.flow[-1].usable and heard.flow[-1].readings_used > 10),
        START_S,
        "the sensor is not used",
        heard.texts,
    )
    return f"in use {sensor.bench.clock_s() - begin_s:.2f} s after the robot began to move"


def _way(bench: Bench, robot: Robot, heard: Heard, speed_m_s: float, turn_rad_s: float) -> str:
    """Along each axis and around, each from rest to rest: then the age of the telemetry does not matter."""
    told = []
    for speed in ((speed_m_s, 0.0, 0.0), (0.0, speed_m_s, 0.0), (0.0, 0.0, turn_rad_s)):
        robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 0.5)
        before, pose = heard.flow[-1], list(bench.world.c.pose)
        robot.repeat(partial(robot.set_velocity, *speed), DRIVE_S)
        robot.repeat(lambda: robot.set_velocity(0.0, 0.0, 0.0), 0.5)
        after, there = heard.flow[-1], list(bench.world.c.pose)
        way = ((after.x_m - before.x_m) ** 2 + (after.y_m - before.y_m) ** 2) ** 0.5
        true = ((there[0] - pose[0]) ** 2 + (there[1] - pose[1]) ** 2) ** 0.5
        turn, true_turn = after.turn_rad - before.turn_rad, there[2] - pose[2]
        if abs(way - true) > WAY_LIMIT_M or abs(turn - true_turn) > TURN_LIMIT_RAD:
            raise CheckError(
                f"it moved {1e3 * true:.1f} mm and {true_turn:.3f} rad; the sensor says {1e3 * way:.1f} and {turn:.3f}"
            )
        told.append(
            f"{1e3 * way:.1f} of {1e3 * true:.1f} mm" if speed[2] == 0.0 else f"{turn:.3f} of {true_turn:.3f} rad"
        )
    return "ways and a turn from rest to rest: it says " + ", ".join(told)


CHECKS = (Check("flow", "the sensor of motion over the floor: ways, silent, its bus held low", flow, (CI, NIGHTLY)),)
