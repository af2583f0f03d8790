# SPDX-License-Identifier: MIT
"""Who is on the motor driver's I2C bus."""

from __future__ import annotations

from omniwheel.bringup.result import Findings, Result
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import LinkTimeoutError
from omniwheel.robot import Robot

PCA9685 = 0x40
ALL_CALL = 0x70
JUMPERS = range(0x40, 0x80)
RESULT_TIMEOUT_S = 3.0
TRIES = 3

_WIRES = "SDA to pin 18, SCL to pin 19, GND together, pull-ups to 3.3 V (1.4 kOhm at 1 MHz), VCC of the board on"


def scan(robot: Robot) -> tuple[list[int], bool]:
    """Return the 7-bit addresses that answer, and whether a line is held low.

    Raises CommandRefusedError while armed, LinkTimeoutError if no result comes.
    """
    for _ in range(TRIES):
        arrived: list[Message] = []
        remove = robot.connection.add_listener(
            lambda m, into=arrived: into.append(m) if m.get_type() == "OMNI_I2C_SCAN" else None  # type: ignore[misc]
        )
        try:
            robot.commands.send(mavlink.MAV_CMD_OMNI_I2C_SCAN, what="to scan the I2C bus")
            robot.connection.wait(lambda _, into=arrived: bool(into), RESULT_TIMEOUT_S)  # type: ignore[misc]
        finally:
            remove()
        if arrived:
            found = arrived[-1].found
            return [a for a in range(128) if found[a // 8] >> a % 8 & 1], bool(arrived[-1].stuck)
    raise LinkTimeoutError("the robot began an I2C scan but sent no result", hint="check the link for lost messages")


def check_i2c(robot: Robot) -> Result:
    """Check that the PWM chip acknowledges at 0x40, and list the other devices. The robot must be disarmed."""
    findings = Findings("i2c")
    addresses, stuck = scan(robot)
    findings.measured = {"addresses": addresses, "stuck": stuck}
    if not findings.judge(
        "bus",
        not stuck,
        "a line is held low" if stuck else "both lines are free",
        f"measure SDA and SCL against GND with the power on: the one near 0 V is shorted or unpowered; {_WIRES}",
    ):
        return findings.result()
    if not addresses:
        findings.bad("PCA9685", "no device responds on the bus", f"check {_WIRES}")
        return findings.result()
    moved = [a for a in addresses if a in JUMPERS and a != ALL_CALL]
    advice = f"a device responds, but not at 0x{PCA9685:02X}: check the PWM board's power and {_WIRES}"
    if moved and ALL_CALL in addresses:
        advice = f"the PWM board is at 0x{moved[0]:02X}: open its address jumpers A0 to A5"
    findings.judge("PCA9685", PCA9685 in addresses, f"devices: {_listed(addresses)}", advice)
    others = [a for a in addresses if a != PCA9685]
    if PCA9685 in addresses:
        findings.good("others", f"other devices: {_listed(others)}; they share the motors' bus" if others else "none")
    return findings.result()


def _listed(addresses: list[int]) -> str:
    return ", ".join(f"0x{address:02X}" for address in addresses)
