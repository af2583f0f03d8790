# SPDX-License-Identifier: MIT
"""Writes one robot's pins as a C++17 header for the Teensy's board layer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

from c_tables import c_string, float_literal
from omni_schema import FlowWiring, GyroWiring, Robot, SchemaError, as_float32, wiring_id
from omni_schema.flow import settings_bytes
from omni_schema.gyro_configuration import read_configuration

TEMPLATE = """\
// SPDX-License-Identifier: MIT
// Written by shared/generate from {source}; edit that file instead.
#pragma once

#include <cstddef>
#include <cstdint>

namespace omni::wiring {{

constexpr char robot_name[] = {name};
constexpr size_t wheels = {wheels};
/// Of everything that is wired (omni_schema/wiring_label.py).
constexpr uint32_t id = 0x{wiring_id:08X};
/// Pins A and B of each wheel's encoder; 255 where the robot file gives none.
constexpr uint8_t encoder_pins[wheels][2] = {{{pins}}};
/// What the robot file asks for.
enum class Decoder : uint8_t {{ automatic, hardware, interrupt }};
constexpr Decoder encoder_decoder[wheels] = {{{decoders}}};
constexpr int output_enable_pin = {output_enable}; ///< -1: not wired
constexpr int stop_button_pin = {stop_button}; ///< -1: not wired
constexpr int battery_pin = {battery}; ///< -1: not wired
constexpr float battery_divider = {divider}; ///< V of the battery per V at battery_pin
constexpr uint8_t light_pin = {light};
/// omni_mot_driver: what the robot file says drives the motors.
constexpr uint8_t motor_driver = {motor_driver};
constexpr bool motors_on_pins = {on_pins}; ///< not behind a chip
constexpr bool motor_pwm[2] = {{{pwm}}};  ///< which of a wheel's two pins need PWM
/// A motor driver on the processor's own pins: first and second pin of each wheel; 255: none.
constexpr uint8_t motor_pins[wheels][2] = {{{motor_pins}}};
constexpr uint32_t motor_pwm_Hz = {motor_pwm};
constexpr uint32_t i2c_speed_Hz = {i2c_speed};
constexpr uint8_t gyro_address = {gyro}; ///< of the chip on the second I2C bus; 0: none
constexpr uint8_t flow_address = {flow}; ///< of the sensor on the third I2C bus; 0: none

}} // namespace omni::wiring
"""
GYRO_TEMPLATE = """\
// SPDX-License-Identifier: MIT
// Written by shared/generate from {source}; edit that file instead.
#pragma once

#include <cstddef>
#include <cstdint>

#include "app/drivers/{header}.h"

namespace omni::wiring {{

inline constexpr const GyroRegisters &gyro_registers = {registers};
{configuration}

}} // namespace omni::wiring
"""
FLOW_TEMPLATE = """\
// SPDX-License-Identifier: MIT
// Written by shared/generate from {source}; edit that file instead.
#pragma once

#include <cstdint>

#include "app/drivers/{header}.h"

namespace omni::wiring {{

{settings}inline constexpr PoseCounter flow_chip = {chip};

}} // namespace omni::wiring
"""
FLOW_SETTINGS = "inline constexpr uint8_t flow_settings[] = {{{bytes}}};\n"
NO_CONFIGURATION = """\
constexpr const uint8_t *gyro_configuration = nullptr;
constexpr size_t gyro_configuration_size = 0;"""
# A Teensy copies all other constants into its fast memory.
CONFIGURATION = """\
constexpr size_t gyro_configuration_size = {size};
__attribute__((section(".progmem"))) constexpr uint8_t gyro_configuration[gyro_configuration_size] = {{
{rows}
}};"""
NO_GYRO = "no_gyro"
NO_PIN = 255
_DECODER = {"auto": "automatic", "hardware": "hardware", "interrupt": "interrupt"}


def wiring_header(robot: Robot) -> str:
    """Return ``omni/wiring_gen.h`` of this robot."""
    board = robot.board
    no_pins = ((NO_PIN, NO_PIN),) * robot.wheels
    pins = board.encoder_pins or no_pins
    return TEMPLATE.format(
        source=Path(robot.source).name,
        name=c_string(robot.name),
        wheels=robot.wheels,
        wiring_id=wiring_id(robot),
        pins=_joined(f"{{{a}, {b}}}" for a, b in pins),
        decoders=_joined(f"Decoder::{_DECODER[name]}" for name in board.encoder_decoder),
        output_enable=_or_none(board.output_enable_pin),
        stop_button=_or_none(board.stop_button_pin),
        battery=_or_none(board.battery_pin),
        divider=float_literal(as_float32(board.battery_divider)),
        light=board.light_pin,
        motor_driver=int(robot.parameter_values()["MOT_DRIVER"]),
        on_pins=str(bool(board.motor_driver.pins)).lower(),
        pwm=_joined(str(pin).lower() for pin in board.motor_driver.pwm),
        motor_pins=_joined(f"{{{a}, {b}}}" for a, b in board.motor_pins or no_pins),
        motor_pwm=board.motor_pwm_Hz,
        i2c_speed=board.i2c_speed_Hz,
        gyro=f"0x{board.gyro.address:02X}" if board.gyro is not None else 0,
        flow=f"0x{board.flow.chip.address:02X}" if board.flow is not None else 0,
    )


def gyro_header(source: str, gyro: GyroWiring | None) -> str:
    """Return ``omni/gyro_gen.h``: the registers of the robot's chip. Raises SchemaError for its configuration file."""
    configuration = NO_CONFIGURATION
    if gyro is not None and gyro.chip.config_file:
        content = read_configuration(source, gyro.config_file, gyro.config_sha256)
        rows = (", ".join(map(str, content[start : start + 32])) for start in range(0, len(content), 32))
        configuration = CONFIGURATION.format(size=len(content), rows=",\n".join(rows))
    return GYRO_TEMPLATE.format(
        source=Path(source).name,
        header=gyro.chip.driver if gyro is not None else "gyro_registers",
        registers=f"{gyro.chip.driver}::registers" if gyro is not None else NO_GYRO,
        configuration=configuration,
    )


def flow_header(source: str, flow: FlowWiring | None) -> str:
    """Return ``omni/flow_gen.h``: the registers and settings of the robot's sensor of motion over the floor."""
    settings, chip = "", "no_flow"
    if flow is not None and flow.chip.wheels:
        settings = FLOW_SETTINGS.format(bytes=_joined(map(str, settings_bytes(flow))))
        chip = f"{flow.chip.driver}::with(flow_settings)"
    elif flow is not None:
        chip = f"{flow.chip.driver}::chip"
    return FLOW_TEMPLATE.format(
        source=Path(source).name,
        header=flow.chip.driver if flow is not None else "pose_counter",
        settings=settings,
        chip=chip,
    )


def _joined(items: Iterable[str]) -> str:
    return ", ".join(items)


def _or_none(pin: int | None) -> int:
    return -1 if pin is None else pin


def write_wiring_header(robots: Sequence[Robot], out: Path) -> None:
    """Write the headers below ``out``; there must be exactly one robot."""
    if len(robots) != 1:
        names = ", ".join(robot.name for robot in robots)
        raise SchemaError("--part wiring", "", f"needs one robot file (--robot FILE), got {names}")
    robot = robots[0]
    texts = {
        "wiring_gen.h": wiring_header(robot),
        "gyro_gen.h": gyro_header(robot.source, robot.board.gyro),
        "flow_gen.h": flow_header(robot.source, robot.board.flow),
    }
    for name, text in texts.items():
        path = out / "include" / "omni" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
