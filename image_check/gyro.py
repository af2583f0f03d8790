# SPDX-License-Identifier: MIT
"""The gyro's chip on the second I2C bus: readings reach the estimator; without them the motors go on.

The chip is the register model of the one that the robot file names (``hil_sim/gyro_chip.h``), at the pins. It turns as
the world's robot does.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial

from image_check.bench import Bench, CheckError, Context
from image_check.check import CI, NIGHTLY, Check
from image_check.sensor_trouble import STEP_S, Sensor, fail, held_line, on_floor, world_fault
from omni_schema.gyro import AXIS_PARAMETER, SDA_PIN
from omniwheel.dialect import Message
from omniwheel.robot import Robot
from omniwheel.telemetry import GyroState, Status, decode

NO_GYRO = "not tried: this robot has no gyro"
TURN_RAD_S = 0.4
TURN_S = 1.5
LEARN_S = 3.0
"""Of these a BMI270 needs 0.4 s for its configuration file."""
BIAS_LIMIT_RAD_S = 5e-4
RATE_LIMIT_RAD_S = 0.05
"""The telemetry's rate is some milliseconds older than the world's, and the wheels wobble."""
SILENT, STUCK = "gyro_silent", "gyro_stuck"
WORDS = {
    SILENT: "gyro: no chip answers; check power and wires",
    STUCK: "gyro: the same reading 100 times",
    "held": "gyro: a line of its bus is held low",
}
AGAIN = "gyro: readings again"


@dataclass
class Heard:
    """What the robot said."""

    texts: list[str] = field(default_factory=list)
    gyro: list[GyroState] = field(default_factory=list)
    status: list[Status] = field(default_factory=list)

    def take(self, message: Message) -> None:
        """Listen to a message."""
        if message.get_type() == "STATUSTEXT":
            self.texts.append(str(message.text))
            return
        gyro, status = decode(GyroState, message), decode(Status, message)
        self.gyro += [gyro] if gyro is not None else []
        self.status += [status] if status is not None else []


def gyro(context: Context) -> list[str]:
    """Bias at rest, rate in a turn by the motors, and each trouble that wires can show: what is said, and the way back.

    All the while the motors' bus must lose no update.
    """
    robot_file = context.scenario.robot
    if robot_file.board.gyro is None:
        return [NO_GYRO]
    figures = []
    with context.booted(scenario=on_floor(context.scenario)) as bench:
        robot, heard = _listen(bench)
        figures.append(_rest(bench, robot, heard))
        figures.append(_turn(bench, robot, heard))
        sensor = Sensor(bench, "gyro", heard.texts, heard.status, robot.pump)
        for fault in (SILENT, STUCK):
            figures.append(fail(sensor, WORDS[fault], AGAIN, *world_fault(bench, fault)))
        figures.append(fail(sensor, WORDS["held"], AGAIN, *held_line(bench, SDA_PIN)))
        errors = heard.status[-1].i2c_errors
        if errors != 0:
            raise CheckError(f"{errors} updates of the PWM chip failed meanwhile")
        figures.append("no update of the PWM chip failed meanwhile")
    return figures


def _listen(bench: Bench) -> tuple[Robot, Heard]:
    robot, heard = bench.connect(), Heard()
    robot.connection.add_listener(heard.take)
    robot.pump(0.2)
    for name in ("OMNI_GYRO", "OMNI_STATUS"):
        robot.set_message_interval(name, 50.0)
    return robot, heard


def _rest(bench: Bench, robot: Robot, heard: Heard) -> str:
    begin_s = bench.clock_s()
    while not (heard.gyro and heard.gyro[-1].used):
        if bench.clock_s() - begin_s > LEARN_S:
            raise CheckError(f"the gyro is not used {LEARN_S:g} s after the start: {heard.texts or 'no texts'}")
        robot.pump(STEP_S)
    robot.pump(LEARN_S)
    axis = int(bench.scenario.parameter_values()[AXIS_PARAMETER])
    true_bias = float(bench.world.c.gyro_bias[abs(axis) - 1]) * (1 if axis > 0 else -1)
    off = heard.gyro[-1].bias_rad_s - true_bias
    if abs(off) > BIAS_LIMIT_RAD_S:
        raise CheckError(f"the bias at rest is off by {off:.2g} rad/s")
    return (
        f"in use {bench.clock_s() - begin_s - LEARN_S:.2f} s after the first message, bias error {abs(off):.1e} rad/s"
    )


def _turn(bench: Bench, robot: Robot, heard: Heard) -> str:
    """Both ways."""
    rates = []
    robot.arm()
    for wanted in (TURN_RAD_S, -TURN_RAD_S):
        robot.repeat(partial(robot.set_velocity, 0.0, 0.0, wanted), TURN_S)
        true, told = float(bench.world.c.twist[2]), heard.gyro[-1].rate_rad_s
        if abs(true - told) > RATE_LIMIT_RAD_S:
            raise CheckError(f"it turns at {true:.3f} rad/s, and the gyro says {told:.3f}")
        rates.append(told)
    robot.disarm()
    robot.pump(1.0)
    return "turned by the motors it says " + " and ".join(f"{rate:+.2f}" for rate in rates) + " rad/s"


CHECKS = (Check("gyro", "the gyro's chip: bias, turn, silent, stuck, its bus held low", gyro, (CI, NIGHTLY)),)
