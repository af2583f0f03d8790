# SPDX-License-Identifier: MIT
"""What a robot file says about wires, with what follows from it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import pi

from omni_schema import EncoderPlan, FlowWiring, GyroWiring, Robot, SchemaError, plan_encoders
from omni_schema.encoder_plan import INTERRUPTS_PER_S
from omni_schema.gyro_configuration import read_configuration
from omniwheel.wiring.electrics import BRIDGE_SUPPLY_V, LOGIC_V

ON_BOARD_LIGHT = 13
RADIO_RX, RADIO_TX = 0, 1
SDA, SCL = 18, 19
BRIDGE_INPUTS = ("IN1", "IN2")
"""Of the bridges behind a PWM chip."""

NO_OE = (
    "OE is not wired: only the I2C bus can stop a motor. After a press of the Teensy's button, the motors keep "
    "their last duties until the motor switch is off; if the processor hangs, until the watchdog has restarted it. "
    "Remedy: set output_enable_pin."
)
NO_ENABLE = (
    "No output-enable pin: only the motors' own pins can stop a motor. If the processor hangs, they keep running "
    "until the watchdog has restarted it; then the resistors to ground take over. Remedy: set output_enable_pin, "
    "wired to bridges or a "
    "buffer with an enable input that is active low."
)
NO_TEENSY_BUILD = "The firmware for a Teensy cannot be built from this file: {problem}."


@dataclass(frozen=True)
class WheelWiring:
    """One wheel: number from 1, channels of IN1 and IN2, pins of encoder A and B (None: not given).

    ``motor_pins`` are the Teensy's, of a motor without a PWM chip; None with one.
    """

    number: int
    in1_channel: int
    in2_channel: int
    encoder_pins: tuple[int, int] | None
    motor_pins: tuple[int, int] | None = None


@dataclass(frozen=True)
class WiringPlan:
    """All that the table and the drawing show. Pins are the Teensy's; None where nothing is wired.

    ``motor_inputs``: names of the two inputs of a motor's bridge.
    """

    name: str
    wheels: tuple[WheelWiring, ...]
    output_enable_pin: int | None
    stop_button_pin: int | None
    battery_pin: int | None
    battery_divider: float
    light_pin: int
    i2c_speed_Hz: int
    supply_V: float
    stall_A: float
    motor_inputs: tuple[str, str]
    warnings: tuple[str, ...]
    gyro: GyroWiring | None = None
    flow: FlowWiring | None = None

    @property
    def chip(self) -> bool:
        """Whether a PWM chip drives the bridges."""
        return self.wheels[0].motor_pins is None

    @property
    def encoders(self) -> bool:
        """Whether the file gives encoder pins."""
        return self.wheels[0].encoder_pins is not None

    @property
    def external_light(self) -> bool:
        """Whether the lamp is not the one on the board."""
        return self.light_pin != ON_BOARD_LIGHT


def plan_wiring(robot: Robot) -> WiringPlan:
    """Read the wiring of a robot file."""
    values, board = robot.parameter_values(), robot.board
    wheels = tuple(
        WheelWiring(
            number=n,
            in1_channel=int(values[f"W{n}_IN1_CH"]),
            in2_channel=int(values[f"W{n}_IN2_CH"]),
            encoder_pins=board.encoder_pins[n - 1] if board.encoder_pins else None,
            motor_pins=board.motor_pins[n - 1] if board.motor_pins else None,
        )
        for n in range(1, robot.wheels + 1)
    )
    supply_V = values["BAT_V_NOM"]
    first, second = board.motor_driver.pins or BRIDGE_INPUTS
    return WiringPlan(
        name=robot.name,
        wheels=wheels,
        output_enable_pin=board.output_enable_pin,
        stop_button_pin=board.stop_button_pin,
        battery_pin=board.battery_pin,
        battery_divider=board.battery_divider,
        light_pin=board.light_pin,
        i2c_speed_Hz=board.i2c_speed_Hz,
        supply_V=supply_V,
        stall_A=supply_V / values["MOT_R"],
        motor_inputs=(first, second),
        warnings=tuple(_warnings(robot, wheels, supply_V)),
        gyro=board.gyro,
        flow=board.flow,
    )


def _no_configuration(robot: Robot) -> list[str]:
    """Return what is wrong with the configuration file of the gyro's chip, if it needs one."""
    gyro = robot.board.gyro
    if gyro is None or not gyro.config_file:
        return []
    try:
        read_configuration(robot.source, gyro.config_file, gyro.config_sha256)
    except SchemaError as error:
        return [NO_TEENSY_BUILD.format(problem=f"{error.key} {error.problem}. {error.hint}")]
    return []


def _warnings(robot: Robot, wheels: tuple[WheelWiring, ...], supply_V: float) -> list[str]:
    board = robot.board
    found = []
    chip = not board.motor_pins
    if board.output_enable_pin is None:
        found.append(NO_OE if chip else NO_ENABLE)
    encoders = plan_encoders(board)
    found += [NO_TEENSY_BUILD.format(problem=problem) for problem in encoders.problems]
    found += _no_configuration(robot)
    found += _too_fast(robot, encoders)
    used = Counter(channel for wheel in wheels for channel in (wheel.in1_channel, wheel.in2_channel))
    twice = [str(channel) for channel, count in sorted(used.items()) if count > 1]
    if twice and chip:
        found.append(f"PCA9685 channel {', '.join(twice)} is used twice: every bridge input needs its own.")
    low, high = BRIDGE_SUPPLY_V
    if not low <= supply_V <= high:
        found.append(f"A supply of {supply_V:g} V is outside a DRV8871's range: {low:g} to {high:g} V.")
    if board.battery_pin is not None and supply_V / board.battery_divider > LOGIC_V:
        level_V = supply_V / board.battery_divider
        found.append(
            f"{supply_V:g} V by a divider of {board.battery_divider:g} puts {level_V:.1f} V onto pin "
            f"{board.battery_pin}: its maximum is {LOGIC_V} V. Use a larger divider."
        )
    return found


def _too_fast(robot: Robot, encoders: EncoderPlan) -> list[str]:
    """Encoders whose edges interrupts could not take at the motor's no-load speed."""
    values = robot.parameter_values()
    edges_s = values["ENC_CPR"] * values["BAT_V_NOM"] / values["MOT_K"] / (2.0 * pi)
    if encoders.problems or edges_s <= INTERRUPTS_PER_S:
        return []
    return [
        f"Wheel {wheel}'s encoder brings up to {edges_s:.0f} edges per second, and the interrupts that count it take "
        f"{INTERRUPTS_PER_S}: move its wires to pins with a hardware decoder."
        for wheel, unit in enumerate(encoders.units, start=1)
        if unit is None
    ]
