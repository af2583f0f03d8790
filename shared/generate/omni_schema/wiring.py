# SPDX-License-Identifier: MIT
"""The Teensy pins of a robot file: what is wired where, and what cannot be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omni_schema.errors import SchemaError
from omni_schema.flow import PIN_USERS as FLOW_PIN_USERS
from omni_schema.flow import FlowWiring
from omni_schema.gyro import PIN_USERS, GyroWiring
from omni_schema.motor_drivers import MotorDriver
from omni_schema.toml_file import take_number

ENCODER_PINS_KEY = "wiring.encoder_pins"
BOARD_KEYS = (
    ENCODER_PINS_KEY,
    "wiring.encoder_decoder",
    "wiring.output_enable_pin",
    "wiring.stop_button_pin",
    "wiring.battery_pin",
    "wiring.battery_divider",
    "wiring.light_pin",
    "wiring.i2c_speed_Hz",
    "wiring.motor_pins",
    "wiring.motor_pwm_Hz",
)
DECODERS = ("auto", "hardware", "interrupt")
I2C_SPEEDS_HZ = (100_000, 400_000, 1_000_000)
DEFAULT_I2C_SPEED_HZ = 400_000
DEFAULT_LIGHT_PIN = 13
MAX_DIVIDER = 100.0
LAST_PIN = 39
ANALOG_PINS = range(14, 28)
PWM_PINS = (*range(2, 16), 22, 23, 28, 29, 33)
"""Pins that outputs A and B of FlexPWM or a quad timer reach, but for those of an SD card."""
CHIP_DRIVER = "pca9685"
CHIP_KEYS = ("in1_channel", "in2_channel")
CHIP = MotorDriver(0, CHIP_DRIVER, "PWM chip")
"""What drives the motors of a robot file that says nothing about it."""
DEFAULT_MOTOR_PWM_HZ = 20_000
MOTOR_PWM_HZ = range(1_000, 100_001)
"""Slower, the current breaks off between pulses; faster, a period has less than 1500 steps and the bridges get hot."""
RESERVED_PINS = {0: "the radio (Serial1 RX)", 1: "the radio (Serial1 TX)", 18: "I2C (SDA)", 19: "I2C (SCL)"}


@dataclass(frozen=True)
class BoardWiring:
    """What is connected to which Teensy 4.0 pin; None where nothing is.

    ``encoder_pins``: (A, B) per wheel, empty if the file gives none. ``encoder_decoder``: one of DECODERS per wheel.
    ``battery_divider``: battery voltage per volt at ``battery_pin``. ``motor_pins``: two per wheel, as
    ``motor_driver.pins`` names them, for a driver on the processor's own pins; else empty.
    """

    encoder_pins: tuple[tuple[int, int], ...]
    encoder_decoder: tuple[str, ...]
    output_enable_pin: int | None
    stop_button_pin: int | None
    battery_pin: int | None
    battery_divider: float
    light_pin: int
    i2c_speed_Hz: int
    motor_pins: tuple[tuple[int, int], ...] = ()
    motor_pwm_Hz: int = DEFAULT_MOTOR_PWM_HZ
    motor_driver: MotorDriver = CHIP
    gyro: GyroWiring | None = None
    flow: FlowWiring | None = None


def parse_board_wiring(
    source: str,
    section: Mapping[str, Any],
    wheels: int,
    drivers: Mapping[str, MotorDriver],
    gyro: GyroWiring | None = None,
    flow: FlowWiring | None = None,
) -> BoardWiring:
    """Check the pin keys of the section ``wiring``; raise SchemaError for a pin that cannot be or is used twice.

    ``gyro`` and ``flow`` are what their own sections say. ``drivers`` are those there are. That the file
    names one of them is checked with its parameter, ``MOT_DRIVER``.
    """
    driver = drivers.get(str(section.get("motor_driver", CHIP_DRIVER)), CHIP)
    wiring = BoardWiring(
        encoder_pins=_encoder_pins(source, section, wheels),
        encoder_decoder=_encoder_decoder(source, section, wheels),
        output_enable_pin=_optional_pin(source, section, "output_enable_pin"),
        stop_button_pin=_optional_pin(source, section, "stop_button_pin"),
        battery_pin=_battery_pin(source, section),
        battery_divider=_battery_divider(source, section),
        light_pin=_pin(source, "wiring.light_pin", section.get("light_pin", DEFAULT_LIGHT_PIN)),
        i2c_speed_Hz=_i2c_speed(source, section),
        motor_pins=_motor_pins(source, section, wheels, driver, drivers),
        motor_pwm_Hz=_motor_pwm(source, section),
        motor_driver=driver,
        gyro=gyro,
        flow=flow,
    )
    _refuse_shared_pins(source, wiring)
    return wiring


def _pin(source: str, key: str, given: object) -> int:
    if type(given) is not int or not 0 <= given <= LAST_PIN:
        raise SchemaError(source, key, f"is {given!r}; a Teensy 4.0 pin number from 0 to {LAST_PIN} is needed")
    return given


def _optional_pin(source: str, section: Mapping[str, Any], leaf: str) -> int | None:
    return _pin(source, f"wiring.{leaf}", section[leaf]) if leaf in section else None


def _encoder_pins(source: str, section: Mapping[str, Any], wheels: int) -> tuple[tuple[int, int], ...]:
    given = section.get("encoder_pins")
    if given is None:
        return ()
    if not isinstance(given, list) or len(given) != wheels:
        problem = f"is {given!r}; a list of {wheels} pairs [A, B] is needed, one per wheel"
        raise SchemaError(source, ENCODER_PINS_KEY, problem)
    return tuple(_pin_pair(source, f"{ENCODER_PINS_KEY}[{wheel}]", pair) for wheel, pair in enumerate(given))


def _pin_pair(source: str, key: str, pair: object) -> tuple[int, int]:
    if not isinstance(pair, list) or len(pair) != 2 or pair[0] == pair[1]:
        raise SchemaError(source, key, f"is {pair!r}; two different pin numbers [A, B] are needed")
    return _pin(source, f"{key}[0]", pair[0]), _pin(source, f"{key}[1]", pair[1])


def _encoder_decoder(source: str, section: Mapping[str, Any], wheels: int) -> tuple[str, ...]:
    key = "wiring.encoder_decoder"
    given = section.get("encoder_decoder", ["auto"] * wheels)
    if not isinstance(given, list) or len(given) != wheels:
        raise SchemaError(source, key, f"is {given!r}; a list of {wheels} of {', '.join(DECODERS)} is needed")
    for wheel, name in enumerate(given):
        if name not in DECODERS:
            raise SchemaError(source, f"{key}[{wheel}]", f"is {name!r}; allowed are {', '.join(DECODERS)}")
    return tuple(given)


def _battery_pin(source: str, section: Mapping[str, Any]) -> int | None:
    pin = _optional_pin(source, section, "battery_pin")
    if pin is not None and pin not in ANALOG_PINS:
        problem = f"is {pin}; an analog pin is needed: {ANALOG_PINS.start} to {ANALOG_PINS.stop - 1} (A0 to A13)"
        raise SchemaError(source, "wiring.battery_pin", problem)
    return pin


def _battery_divider(source: str, section: Mapping[str, Any]) -> float:
    key = "wiring.battery_divider"
    if "battery_divider" not in section:
        if "battery_pin" in section:
            raise SchemaError(source, key, "is missing; give the battery's volts per volt at battery_pin")
        return 1.0
    if "battery_pin" not in section:
        raise SchemaError(source, key, "is given without wiring.battery_pin; add the pin or remove the divider")
    divider = take_number(source, key, section["battery_divider"])
    if not 1.0 <= divider <= MAX_DIVIDER:
        problem = f"is {divider:g}; from 1 to {MAX_DIVIDER:g} V of the battery per V at the pin"
        raise SchemaError(source, key, problem)
    return divider


def _i2c_speed(source: str, section: Mapping[str, Any]) -> int:
    speed = section.get("i2c_speed_Hz", DEFAULT_I2C_SPEED_HZ)
    if type(speed) is not int or speed not in I2C_SPEEDS_HZ:
        allowed = ", ".join(map(str, I2C_SPEEDS_HZ))
        raise SchemaError(source, "wiring.i2c_speed_Hz", f"is {speed!r}; allowed are {allowed}")
    return speed


def _motor_pins(
    source: str, section: Mapping[str, Any], wheels: int, driver: MotorDriver, drivers: Mapping[str, MotorDriver]
) -> tuple[tuple[int, int], ...]:
    key = "wiring.motor_pins"
    if not driver.pins:
        others = " and ".join(other.name for other in drivers.values() if other.pins)
        for leaf in ("motor_pins", "motor_pwm_Hz"):
            if leaf in section:
                problem = f"is given, but motor_driver is {driver.name!r}; it is for {others}"
                raise SchemaError(source, f"wiring.{leaf}", problem)
        return ()
    for leaf in CHIP_KEYS:
        if leaf in section:
            problem = f"is a channel of the PCA9685, but motor_driver is {driver.name!r}; remove it and give motor_pins"
            raise SchemaError(source, f"wiring.{leaf}", problem)
    given = section.get("motor_pins")
    if not isinstance(given, list) or len(given) != wheels:
        what = "is missing" if given is None else f"is {given!r}"
        problem = f"{what}; a list of {wheels} pairs [{', '.join(driver.pins)}] is needed, one per wheel"
        raise SchemaError(source, key, problem)
    return tuple(_motor_pair(source, f"{key}[{wheel}]", pair, driver) for wheel, pair in enumerate(given))


def _motor_pair(source: str, key: str, pair: object, driver: MotorDriver) -> tuple[int, int]:
    if not isinstance(pair, list) or len(pair) != 2:
        raise SchemaError(source, key, f"is {pair!r}; two pin numbers [{', '.join(driver.pins)}] are needed")
    first, second = (_pin(source, f"{key}[{place}]", pin) for place, pin in enumerate(pair))
    for place, (pin, pwm) in enumerate(zip((first, second), driver.pwm, strict=True)):
        if pwm and pin not in PWM_PINS:
            allowed = ", ".join(map(str, PWM_PINS))
            raise SchemaError(
                source, f"{key}[{place}]", f"is {pin}, which has no PWM on a Teensy 4.0; these have: {allowed}"
            )
    return first, second


def _motor_pwm(source: str, section: Mapping[str, Any]) -> int:
    frequency = section.get("motor_pwm_Hz", DEFAULT_MOTOR_PWM_HZ)
    if type(frequency) is not int or frequency not in MOTOR_PWM_HZ:
        problem = f"is {frequency!r}; a whole number from {MOTOR_PWM_HZ.start} to {MOTOR_PWM_HZ.stop - 1} is needed"
        raise SchemaError(source, "wiring.motor_pwm_Hz", problem)
    return frequency


def _refuse_shared_pins(source: str, wiring: BoardWiring) -> None:
    users = RESERVED_PINS | (PIN_USERS if wiring.gyro is not None else {})
    users |= FLOW_PIN_USERS if wiring.flow is not None else {}
    wanted = [
        (f"{ENCODER_PINS_KEY}[{wheel}]", pin, f"the encoder of wheel {wheel + 1}")
        for wheel, pair in enumerate(wiring.encoder_pins)
        for pin in pair
    ]
    wanted += [
        (f"wiring.motor_pins[{wheel}]", pin, f"the motor of wheel {wheel + 1}")
        for wheel, pair in enumerate(wiring.motor_pins)
        for pin in pair
    ]
    single = {
        "output_enable_pin": (wiring.output_enable_pin, "the motor driver's output enable"),
        "stop_button_pin": (wiring.stop_button_pin, "the stop button"),
        "battery_pin": (wiring.battery_pin, "the battery voltage"),
        "light_pin": (wiring.light_pin, "the status light"),
    }
    wanted += [(f"wiring.{leaf}", pin, user) for leaf, (pin, user) in single.items() if pin is not None]
    for key, pin, user in wanted:
        if pin in users:
            raise SchemaError(source, key, f"pin {pin} is used by {users[pin]}; move one of the two to a free pin")
        users[pin] = user
