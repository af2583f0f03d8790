# SPDX-License-Identifier: MIT
"""A number for what is wired where: it tells firmware of one robot from that of another before motors find out."""

from __future__ import annotations

import json
import zlib

from omni_schema.robots import Robot

CHANNELS = tuple(f"W{wheel}_IN{pin}_CH" for wheel in range(1, 5) for pin in (1, 2))
"""Parameters that say which outputs of the PWM chip drive which wheel."""


def wiring_id(robot: Robot) -> int:
    """Return the CRC-32, never 0, of everything in a robot file that a pin or an address decides.

    Two robots with the same number can run each other's firmware without an output on a wrong pin. Values that only
    scale something (a battery's divider, a bus's speed) do not count.
    """
    board, values = robot.board, robot.parameter_values()
    connected = {
        "wheels": robot.wheels,
        "encoders": board.encoder_pins,
        "driver": board.motor_driver.name,
        "motors": board.motor_pins or [values[name] for name in CHANNELS[: 2 * robot.wheels]],
        "output_enable": board.output_enable_pin,
        "stop_button": board.stop_button_pin,
        "battery": board.battery_pin,
        "light": board.light_pin,
        "gyro": [board.gyro.chip.name, board.gyro.address] if board.gyro is not None else None,
        "flow": [board.flow.chip.name, board.flow.chip.address] if board.flow is not None else None,
    }
    return zlib.crc32(json.dumps(connected, sort_keys=True).encode()) or 1
